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
use crate::math::{Columnar, Lanes, Pair, Triple};

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
        CoilGroup {
            order: self.order,
            weights: self.weights.map(Pair::splat),
            origin: Triple::from(pose.origin).in_all(),
            axis: Triple::from(pose.axis).in_all(),
        }
        .evaluate(point)
        .lane(0)
    }
}

/// As many posed coils as there are lanes, evaluated together. A lane may stay without a coil: it then has no weights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct CoilGroup<V = Lanes> {
    order: usize,
    weights: [V; ORDER_MAX],
    origin: Triple<V>,
    axis: Triple<V>,
}

impl<V: Columnar> CoilGroup<V> {
    /// Puts a coil into a lane.
    pub(super) fn set_series(&mut self, lane: usize, multipole: &Multipole) {
        self.order = self.order.max(multipole.order);
        for (lanes, weight) in self.weights.iter_mut().zip(multipole.weights) {
            lanes.set_lane(lane, weight);
        }
    }

    /// Takes the series of `unit`, the field of each lane multiplied by its gain; lanes past the last gain, and all poses, stay.
    pub(super) fn set_scaled_series(&mut self, unit: &Self, gains: &[f64]) {
        for (lanes, unit) in self.weights.iter_mut().zip(&unit.weights) {
            for (lane, gain) in gains.iter().enumerate() {
                lanes.set_lane(lane, unit.lane(lane) * gain);
            }
        }
    }

    /// Moves the coil of a lane.
    pub(super) fn set_pose(&mut self, lane: usize, pose: &CoilPose) {
        self.origin.set_column(lane, pose.origin.into());
        self.axis.set_column(lane, pose.axis.into());
    }

    /// The pose of a lane.
    pub(super) fn pose(&self, lane: usize) -> CoilPose {
        CoilPose { origin: self.origin.column(lane).into(), axis: self.axis.column(lane).into() }
    }

    /// Field and both gradients of all coils at `point`, each for 1 A.
    #[inline(always)]
    pub(super) fn evaluate(&self, point: &Vector3<f64>) -> GroupField<V> {
        let d = Triple::from(*point).in_all() - self.origin;
        let x = self.axis.dot(d);
        let s = d.dot(d).inverse_sqrt();
        let (a, n) = (self.axis.array(), d.scaled(s).array());
        let sums = RadialSums::new(&self.weights[..self.order.min(ORDER_MAX)], s, x * s);
        GroupField {
            field: [0, 1, 2].map(|i| sums.a01.times_from(n[i], sums.a10 * a[i])), // (3)
            gradient: sums.gradient(&a, &n, s),
            second_gradient: sums.second_gradient(&a, &n, s),
            local_x: x,
        }
    }
}

/// Field of a group of coils, each for 1 A: components in the order of the `Field*` structs.
pub(super) struct GroupField<V> {
    field: [V; 3],
    gradient: [V; 5],
    second_gradient: [V; 7],
    local_x: V,
}

impl<V: Columnar> GroupField<V> {
    /// The field of the coil in a lane.
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> CoilField {
        let [bx, by, bz] = self.field.map(|lanes| lanes.lane(lane));
        let [xx, xy, xz, yy, yz] = self.gradient.map(|lanes| lanes.lane(lane));
        let [xxx, xxy, xxz, xyy, xyz, yyy, yyz] = self.second_gradient.map(|lanes| lanes.lane(lane));
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
struct RadialSums<V> {
    a01: V,
    a10: V,
    a02: V,
    a11: V,
    a20: V,
    a03: V,
    a12: V,
    a21: V,
    a30: V,
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

impl<V: Columnar> RadialSums<V> {
    #[inline(always)]
    fn new(weights: &[V], s: V, c: V) -> Self {
        let number = V::splat;
        // L^m_k and L^m_(k-1) for m = 1, 2, 3, here at k = 1.
        let (mut l1, mut l1_before) = (c * number(3.0), number(1.0));
        let (mut l2, mut l2_before) = (c * number(15.0), number(3.0));
        let (mut l3, mut l3_before) = (c * number(105.0), number(15.0));
        let mut power = s * s * s;
        let Some((&first, rest)) = weights.split_first() else { return Self::zero() };
        let weight = first * power;
        let (mut a01, mut a10) = (weight * l1, weight);
        let (mut a02, mut a11) = (weight * l2, weight * number(3.0));
        let (mut a03, mut a12) = (weight * l3, weight * number(15.0));
        for (&b, factors) in rest.iter().zip(&RECURRENCES) {
            let l1_next = l1_before.times_from(number(factors.previous), c * number(factors.centre) * l1);
            (l1_before, l1) = (l1, l1_next);
            let l2_next = l1.times_plus(number(factors.second), l2_before);
            (l2_before, l2) = (l2, l2_next);
            let l3_next = l2.times_plus(number(factors.third), l3_before);
            (l3_before, l3) = (l3, l3_next);
            power = power * s;
            let weight = b * power;
            (a01, a10) = (weight.times_plus(l1, a01), weight.times_plus(l1_before, a10));
            (a02, a11) = (weight.times_plus(l2, a02), weight.times_plus(l2_before, a11));
            (a03, a12) = (weight.times_plus(l3, a03), weight.times_plus(l3_before, a12));
        }
        let twice_c = c + c;
        let a20 = twice_c.times_plus(a11, a01 * number(3.0)) - a02;
        let a21 = twice_c.times_plus(a12, a02 * number(5.0)) - a03;
        let a30 = twice_c.times_plus(a21, a11 * number(5.0)) - a12;
        Self { a01, a10, a02, a11, a20, a03, a12, a21, a30 }
    }

    /// The sums of an empty series, which no constructed coil has.
    fn zero() -> Self {
        let [a01, a10, a02, a11, a20, a03, a12, a21, a30] = [V::default(); 9];
        Self { a01, a10, a02, a11, a20, a03, a12, a21, a30 }
    }

    /// G, grouped as `G_ij = a_i e_j + n_i f_j - s A_01 I_ij`.
    #[inline(always)]
    fn gradient(&self, a: &[V; 3], n: &[V; 3], s: V) -> [V; 5] {
        let [a01, a11, a02, a20] = [self.a01, self.a11, self.a02, self.a20].map(|sum| s * sum);
        let e = [0, 1].map(|j: usize| a11.times_from(n[j], a20 * a[j]));
        let f = [0, 1].map(|j: usize| a11.times_from(a[j], a02 * n[j]));
        let g = |i: usize, j: usize| a[i].times_plus(e[j], n[i] * f[j]);
        [g(0, 0) - a01, g(1, 0), g(2, 0), g(1, 1) - a01, g(2, 1)]
    }

    /// H, grouped as `H_ijk = M_ij a_k + N_ij n_k + S(v I)_ijk` with symmetric `M = a e + n f`, `N = a f + n g`.
    #[inline(always)]
    fn second_gradient(&self, a: &[V; 3], n: &[V; 3], s: V) -> [V; 7] {
        let s2 = s * s;
        let [a02, a11] = [self.a02, self.a11].map(|sum| s2 * sum);
        let [a03, a12, a21, a30] = [self.a03, self.a12, self.a21, self.a30].map(|sum| s2 * sum);
        let v = [0, 1, 2].map(|i: usize| a11.times_from(a[i], a02 * n[i]));
        let e = [0, 1].map(|j: usize| a21.times_from(n[j], a30 * a[j]));
        let f = [0, 1].map(|j: usize| a21.times_from(a[j], a12 * n[j]));
        let g = [0, 1].map(|j: usize| a03.times_from(n[j], a12 * a[j]));
        let contracted =
            |i: usize, j: usize| (a[i].times_plus(e[j], n[i] * f[j]), a[i].times_plus(f[j], n[i] * g[j]));
        let (m_xx, n_xx) = contracted(0, 0);
        let (m_xy, n_xy) = contracted(0, 1);
        let (m_yy, n_yy) = contracted(1, 1);
        let h_xx = |k: usize| m_xx.times_plus(a[k], n_xx * n[k]);
        let h_xy = |k: usize| m_xy.times_plus(a[k], n_xy * n[k]);
        let h_yy = |k: usize| m_yy.times_plus(a[k], n_yy * n[k]);
        [
            v[0].times_plus(V::splat(3.0), h_xx(0)),
            h_xx(1) + v[1],
            h_xx(2) + v[2],
            h_xy(1) + v[0],
            h_xy(2),
            v[1].times_plus(V::splat(3.0), h_yy(1)),
            h_yy(2) + v[2],
        ]
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{CoilField, CoilGroup, CoilPose, Multipole};
    use crate::math::{Columnar, Pair, Quad};

    /// Three coils, of unlike order and place.
    fn coils() -> [(Multipole, CoilPose); 3] {
        let coil = |coefficients: &[f64], origin: [f64; 3], axis: [f64; 3]| {
            let pose = CoilPose { origin: origin.into(), axis: Vector3::from(axis).normalize() };
            (Multipole::new(coefficients), pose)
        };
        [
            coil(&[2.8e-6, 7.5e-8, 7.4e-10, 2.4e-12], [-0.1, 0.0, 0.05], [2.0, 0.1, -1.0]),
            coil(&[6.4e-7], [0.0, 0.01, 0.085], [0.0, 0.0, -1.0]),
            coil(&[6.4e-7, 1.9e-8, 1.7e-10, 5.2e-13, 1e-15, 2e-18], [0.08, -0.03, -0.04], [-1.0, 0.3, 0.5]),
        ]
    }

    fn components(made: &CoilField) -> [f64; 16] {
        let CoilField { column, second_gradient: h, local_x } = made;
        let (b, g) = (column.field, column.gradient);
        [
            b.x, b.y, b.z, g.xx, g.xy, g.xz, g.yy, g.yz, h.xxx, h.xxy, h.xxz, h.xyy, h.xyz, h.yyy, h.yyz,
            *local_x,
        ]
    }

    /// Goal: a group makes in every lane what its coil makes alone, however many lanes there are; a lane without a coil
    /// makes nothing, and nothing that is no number.
    #[test]
    fn lanes_make_what_their_coils_make_alone() {
        fn check<V: Columnar>() {
            let point = Vector3::new(0.011, -0.007, 0.003);
            let coils = coils();
            for (first, _) in coils.iter().enumerate() {
                let mut group = CoilGroup::<V>::default();
                for lane in 0..V::WIDTH {
                    // A lane is left empty whenever the coils are through.
                    let Some((series, pose)) = coils.get(first + lane) else {
                        group.set_pose(lane, &coils[first].1);
                        continue;
                    };
                    group.set_series(lane, series);
                    group.set_pose(lane, pose);
                }
                let made = group.evaluate(&point);
                for lane in 0..V::WIDTH {
                    let found = components(&made.lane(lane));
                    let Some((series, pose)) = coils.get(first + lane) else {
                        assert!(found[..15].iter().all(|component| *component == 0.0), "{found:?}");
                        continue;
                    };
                    assert_eq!(group.pose(lane), *pose);
                    let alone = components(&series.evaluate(pose, &point));
                    for (found, alone) in found.iter().zip(&alone) {
                        // The same arithmetic, but that a longer series beside adds zeros.
                        assert!((found - alone).abs() <= 1e-15 * alone.abs(), "{found} {alone}");
                    }
                }
            }
        }
        check::<Pair>();
        check::<Quad>();
    }
}
