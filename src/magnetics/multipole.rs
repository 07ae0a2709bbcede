//! Field, gradient and second gradient of an azimuthally symmetric coil, for 1 A, in closed form.
//!
//! # Source
//! Eq. (3)-(4) of Richter, Venkiteswaran, Misra, "Multi-Point Orientation Control of Discretely-Magnetized
//! Continuum Manipulators", IEEE RA-L 6(2), 2021: `B = grad Psi`, `Psi = sum_k a_k psi_k`,
//! `psi_k = d^k/dx^k (1/r)`, x along the coil's axis, k = 1 to P. The coefficients `a_k` here are per ampere,
//! so that the division by the fitting current in eq. (6) is already done.
//!
//! # Terms
//! | symbol | meaning |
//! |---|---|
//! | `a` | unit axis of the coil, world |
//! | `d`, `r`, `s`, `n` | point minus expansion point; `r = norm d`; `s = 1/r`; `n = d/r` |
//! | `x`, `c` | `x = a . d`, the local x; `c = a . n`, its cosine |
//! | `P_k`, `P_k^(j)` | Legendre polynomial of degree k at `c`, and its j-th derivative |
//! | `b_k` | `(-1)^k k! a_k` |
//! | `L^m_k` | `P^(m)_(k+m)` |
//! | `A_jm` | `sum_k b_k s^(k+2) P^(j+m)_(k+m)` |
//! | `S(.)` | sum over the distinct permutations of the indices |
//!
//! # Method
//! `psi_k = (-1)^k k! s^(k+1) P_k(c)` depends on the point through x and `w = r^2/2` alone. Since
//! `r dc = dx` at fixed w, and `(k+1) P_k + c P_k' = P_(k+1)'`,
//! `d^(j+m) Psi / dx^j dw^m = (-1)^m s^(j+2m-1) A_jm`. The gradients of x and w are `a` and `d`, and that of `d`
//! is the identity, so that the chain rule gives tensors built from `a` and `n` in the world frame, without a
//! rotation matrix and without a singularity on the axis:
//!
//! - `B = A_10 a - A_01 n`
//! - `G = s (A_20 aa - A_11 S(an) + A_02 nn - A_01 I)`
//! - `H = s^2 (A_30 aaa - A_21 S(aan) + A_12 S(ann) - A_03 nnn - A_11 S(aI) + A_02 S(nI))`
//!
//! `A_20`, `A_21`, `A_30` follow from the others because G and H have no trace (Laplace's equation):
//! `A_20 = 3 A_01 + 2c A_11 - A_02`, `A_21 = 5 A_02 + 2c A_12 - A_03`, `A_30 = 5 A_11 + 2c A_21 - A_12`.
//! The polynomials come from `k L^1_k = (2k+1) c L^1_(k-1) - (k+1) L^1_(k-2)` and
//! `L^(m+1)_k = L^(m+1)_(k-2) + (2k+2m+1) L^m_k`, stable for `|c| <= 1`.
//!
//! The frame change of eq. (8) is therefore not carried out as printed: rotating `a` and the expansion point
//! into the world first gives the same tensors.

use magsteer_hal::config::ORDER_MAX;
use nalgebra::Vector3;

use super::sample::{FieldColumn, FieldGradient, FieldSecondGradient};
use crate::math::Pair;

/// The series of one coil: `a_k` of eq. (4) per ampere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multipole {
    order: usize,
    /// `b_k`, k = 1 first; zero past the order.
    weights: [f64; ORDER_MAX],
}

/// Where a coil is: its expansion point and its axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoilPose {
    /// Expansion point, m, world.
    pub origin: Vector3<f64>,
    /// Unit axis, pointing from the coil into the workspace, world.
    pub axis: Vector3<f64>,
}

/// Field of one coil for 1 A at one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoilField {
    /// Field and gradient, T/A and T/(m A), world.
    pub column: FieldColumn,
    /// Second gradient, T/(m^2 A), world.
    pub second_gradient: FieldSecondGradient,
    /// Local x of the point, m; the series holds only beyond the coil's `valid_from_x`.
    pub local_x: f64,
}

impl Multipole {
    /// Takes the coefficients `a_k` for 1 A, k = 1 first, T m^(k+2) / A.
    ///
    /// # Panics
    /// Unless there are 1 to [`ORDER_MAX`] coefficients; a validated description never has others.
    #[must_use]
    pub fn new(coefficients: &[f64]) -> Self {
        let order = coefficients.len();
        assert!((1..=ORDER_MAX).contains(&order), "{order} coefficients: must be 1 to {ORDER_MAX}");
        let mut weights = [0.0; ORDER_MAX];
        let mut signed_factorial = 1.0;
        for (index, (weight, coefficient)) in weights.iter_mut().zip(coefficients).enumerate() {
            signed_factorial *= -((index + 1) as f64);
            *weight = signed_factorial * coefficient;
        }
        Self { order, weights }
    }

    /// Number of terms P.
    #[must_use]
    pub fn order(&self) -> usize {
        self.order
    }

    /// Field and both gradients at `point` (m, world) for 1 A. Not finite at the expansion point itself.
    #[inline]
    #[must_use]
    pub fn evaluate(&self, pose: &CoilPose, point: &Vector3<f64>) -> CoilField {
        CoilPair {
            order: self.order,
            weights: self.weights.map(Pair::splat),
            origin: [0, 1, 2].map(|i| Pair::splat(pose.origin[i])),
            axis: [0, 1, 2].map(|i| Pair::splat(pose.axis[i])),
        }
        .evaluate(point)
        .lane(0)
    }
}

/// Two posed coils, evaluated together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct CoilPair {
    order: usize,
    weights: [Pair; ORDER_MAX],
    origin: [Pair; 3],
    axis: [Pair; 3],
}

impl CoilPair {
    /// Puts a coil into a lane (0 or 1).
    pub(super) fn set_series(&mut self, lane: usize, multipole: &Multipole) {
        self.order = self.order.max(multipole.order);
        for (pair, weight) in self.weights.iter_mut().zip(multipole.weights) {
            pair.set_lane(lane, weight);
        }
    }

    /// Moves the coil of a lane (0 or 1).
    pub(super) fn set_pose(&mut self, lane: usize, pose: &CoilPose) {
        for i in 0..3 {
            self.origin[i].set_lane(lane, pose.origin[i]);
            self.axis[i].set_lane(lane, pose.axis[i]);
        }
    }

    /// The pose of a lane (0 or 1).
    pub(super) fn pose(&self, lane: usize) -> CoilPose {
        let vector = |pairs: &[Pair; 3]| Vector3::from_fn(|i, _| pairs[i].lane(lane));
        CoilPose { origin: vector(&self.origin), axis: vector(&self.axis) }
    }

    /// Field and both gradients of both coils at `point`, each for 1 A.
    #[inline(always)]
    pub(super) fn evaluate(&self, point: &Vector3<f64>) -> PairField {
        let a = &self.axis;
        let d = [0, 1, 2].map(|i| Pair::splat(point[i]) - self.origin[i]);
        let x = a[0] * d[0] + a[1] * d[1] + a[2] * d[2];
        let s = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).inverse_sqrt();
        let n = d.map(|component| component * s);
        let c = x * s;
        let sums = RadialSums::new(&self.weights[..self.order.min(ORDER_MAX)], s, c);
        PairField {
            field: [0, 1, 2].map(|i| sums.a10 * a[i] - sums.a01 * n[i]), // (3)
            gradient: sums.gradient(a, &n, s),
            second_gradient: sums.second_gradient(a, &n, s),
            local_x: x,
        }
    }
}

/// Field of two coils, each for 1 A: components in the order of the `Field*` structs.
pub(super) struct PairField {
    field: [Pair; 3],
    gradient: [Pair; 5],
    second_gradient: [Pair; 7],
    local_x: Pair,
}

impl PairField {
    /// The field of the coil in a lane (0 or 1).
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> CoilField {
        let [bx, by, bz] = self.field.map(|pair| pair.lane(lane));
        let [xx, xy, xz, yy, yz] = self.gradient.map(|pair| pair.lane(lane));
        let [xxx, xxy, xxz, xyy, xyz, yyy, yyz] = self.second_gradient.map(|pair| pair.lane(lane));
        CoilField {
            column: FieldColumn {
                field: Vector3::new(bx, by, bz),
                gradient: FieldGradient { xx, xy, xz, yy, yz },
            },
            second_gradient: FieldSecondGradient { xxx, xxy, xxz, xyy, xyz, yyy, yyz },
            local_x: self.local_x.lane(lane),
        }
    }
}

/// The sums `A_jm`.
struct RadialSums {
    a01: Pair,
    a10: Pair,
    a02: Pair,
    a11: Pair,
    a20: Pair,
    a03: Pair,
    a12: Pair,
    a21: Pair,
    a30: Pair,
}

/// Factors of the recurrences for one k: `L^1_k = centre c L^1_(k-1) - previous L^1_(k-2)`,
/// `L^2_k = L^2_(k-2) + second L^1_k`, `L^3_k = L^3_(k-2) + third L^2_k`.
#[derive(Clone, Copy)]
struct Recurrence {
    centre: f64,
    previous: f64,
    second: f64,
    third: f64,
}

/// The recurrences of k = 2 first.
const RECURRENCES: [Recurrence; ORDER_MAX - 1] = {
    let mut table = [Recurrence { centre: 0.0, previous: 0.0, second: 0.0, third: 0.0 }; ORDER_MAX - 1];
    let mut index = 0;
    while index < table.len() {
        let k = (index + 2) as f64;
        table[index] = Recurrence {
            centre: (2.0 * k + 1.0) / k,
            previous: (k + 1.0) / k,
            second: 2.0 * k + 3.0,
            third: 2.0 * k + 5.0,
        };
        index += 1;
    }
    table
};

impl RadialSums {
    #[inline(always)]
    fn new(weights: &[Pair], s: Pair, c: Pair) -> Self {
        // L^m_k and L^m_(k-1) for m = 1, 2, 3, here at k = 1.
        let (mut l1, mut l1_before) = (c * 3.0, Pair::splat(1.0));
        let (mut l2, mut l2_before) = (c * 15.0, Pair::splat(3.0));
        let (mut l3, mut l3_before) = (c * 105.0, Pair::splat(15.0));
        let mut power = s * s * s;
        let Some((&first, rest)) = weights.split_first() else { return Self::zero() };
        let weight = first * power;
        let (mut a01, mut a10) = (weight * l1, weight);
        let (mut a02, mut a11) = (weight * l2, weight * 3.0);
        let (mut a03, mut a12) = (weight * l3, weight * 15.0);
        for (&b, factors) in rest.iter().zip(&RECURRENCES) {
            let l1_next = c * factors.centre * l1 - l1_before * factors.previous;
            (l1_before, l1) = (l1, l1_next);
            let l2_next = l2_before + l1 * factors.second;
            (l2_before, l2) = (l2, l2_next);
            let l3_next = l3_before + l2 * factors.third;
            (l3_before, l3) = (l3, l3_next);
            power = power * s;
            let weight = b * power;
            (a01, a10) = (a01 + weight * l1, a10 + weight * l1_before);
            (a02, a11) = (a02 + weight * l2, a11 + weight * l2_before);
            (a03, a12) = (a03 + weight * l3, a12 + weight * l3_before);
        }
        let twice_c = c + c;
        let a20 = a01 * 3.0 + twice_c * a11 - a02;
        let a21 = a02 * 5.0 + twice_c * a12 - a03;
        let a30 = a11 * 5.0 + twice_c * a21 - a12;
        Self { a01, a10, a02, a11, a20, a03, a12, a21, a30 }
    }

    /// The sums of an empty series, which no constructed coil has.
    fn zero() -> Self {
        let zero = Pair::splat(0.0);
        let [a01, a10, a02, a11, a20, a03, a12, a21, a30] = [zero; 9];
        Self { a01, a10, a02, a11, a20, a03, a12, a21, a30 }
    }

    /// G, grouped as `G_ij = a_i e_j + n_i f_j - s A_01 I_ij`.
    #[inline(always)]
    fn gradient(&self, a: &[Pair; 3], n: &[Pair; 3], s: Pair) -> [Pair; 5] {
        let [a01, a11, a02, a20] = [self.a01, self.a11, self.a02, self.a20].map(|sum| s * sum);
        let e = [0, 1].map(|j: usize| a20 * a[j] - a11 * n[j]);
        let f = [0, 1].map(|j: usize| a02 * n[j] - a11 * a[j]);
        let g = |i: usize, j: usize| a[i] * e[j] + n[i] * f[j];
        [g(0, 0) - a01, g(1, 0), g(2, 0), g(1, 1) - a01, g(2, 1)]
    }

    /// H, grouped as `H_ijk = M_ij a_k + N_ij n_k + S(v I)_ijk` with symmetric `M = a e + n f`, `N = a f + n g`.
    #[inline(always)]
    fn second_gradient(&self, a: &[Pair; 3], n: &[Pair; 3], s: Pair) -> [Pair; 7] {
        let s2 = s * s;
        let [a02, a11] = [self.a02, self.a11].map(|sum| s2 * sum);
        let [a03, a12, a21, a30] = [self.a03, self.a12, self.a21, self.a30].map(|sum| s2 * sum);
        let v = [0, 1, 2].map(|i: usize| a02 * n[i] - a11 * a[i]);
        let e = [0, 1].map(|j: usize| a30 * a[j] - a21 * n[j]);
        let f = [0, 1].map(|j: usize| a12 * n[j] - a21 * a[j]);
        let g = [0, 1].map(|j: usize| a12 * a[j] - a03 * n[j]);
        let contracted = |i: usize, j: usize| (a[i] * e[j] + n[i] * f[j], a[i] * f[j] + n[i] * g[j]);
        let (m_xx, n_xx) = contracted(0, 0);
        let (m_xy, n_xy) = contracted(0, 1);
        let (m_yy, n_yy) = contracted(1, 1);
        let h_xx = |k: usize| m_xx * a[k] + n_xx * n[k];
        let h_xy = |k: usize| m_xy * a[k] + n_xy * n[k];
        let h_yy = |k: usize| m_yy * a[k] + n_yy * n[k];
        [
            h_xx(0) + v[0] * 3.0,
            h_xx(1) + v[1],
            h_xx(2) + v[2],
            h_xy(1) + v[0],
            h_xy(2),
            h_yy(1) + v[1] * 3.0,
            h_yy(2) + v[2],
        ]
    }
}
