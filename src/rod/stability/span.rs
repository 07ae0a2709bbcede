//! A piece of a flexible section in the second variation: unknown strains at Gauss points, eliminated in
//! favour of its start.

use crate::math::Triple;
use crate::rod::section::Section;

use super::samples::{POINTS, Place, Sample};
use super::stiffness::{Pose, Square, Stiffness, skew, sway};

/// Strains of a span that can only bend and twist.
pub(super) const BENDING: usize = 3 * POINTS;
/// Strains of one that can also shear and stretch.
pub(super) const EXTENSIBLE: usize = 6 * POINTS;

/// Abscissae of the Gauss-Legendre rule on (0, 1): `(1 -+ sqrt(3/7 +- 2/7 sqrt(6/5))) / 2`.
const ABSCISSAE: [f64; POINTS] =
    [0.069_431_844_202_973_71, 0.330_009_478_207_571_9, 0.669_990_521_792_428_1, 0.930_568_155_797_026_3];
/// Its weights.
const WEIGHTS: [f64; POINTS] = integrals(1.0);
/// Weights of integrals from 0 to each abscissa, by rows: Gauss's collocation method.
const PARTIAL: [[f64; POINTS]; POINTS] =
    [integrals(ABSCISSAE[0]), integrals(ABSCISSAE[1]), integrals(ABSCISSAE[2]), integrals(ABSCISSAE[3])];

/// Integrals from 0 to `end` of the polynomials that are 1 at one abscissa and 0 at the others.
const fn integrals(end: f64) -> [f64; POINTS] {
    let mut integrals = [0.0; POINTS];
    let mut p = 0;
    while p < POINTS {
        // Coefficients, lowest power first, of the product of (x - c) / (c_p - c).
        let mut coefficients = [0.0; POINTS];
        coefficients[0] = 1.0;
        let mut q = 0;
        while q < POINTS {
            if q != p {
                let scale = 1.0 / (ABSCISSAE[p] - ABSCISSAE[q]);
                let mut power = POINTS - 1;
                while power > 0 {
                    coefficients[power] =
                        (coefficients[power - 1] - ABSCISSAE[q] * coefficients[power]) * scale;
                    power -= 1;
                }
                coefficients[0] *= -ABSCISSAE[q] * scale;
            }
            q += 1;
        }
        let mut power = POINTS;
        while power > 0 {
            power -= 1;
            integrals[p] = (integrals[p] + coefficients[power] / (power + 1) as f64) * end;
        }
        p += 1;
    }
    integrals
}

/// Places of the Gauss points of a section's span `index` of `count`.
pub(super) fn places(index: usize, count: usize, segments: usize) -> [Place; POINTS] {
    ABSCISSAE.map(|abscissa| Place::new((index as f64 + abscissa) / count as f64, segments))
}

/// A span with `N` strains; `D` counts the displacement of its start as well.
///
/// Strains are rotation vectors `x = h kappa` and displacements `h w` a point, then follow dp and phi of the
/// start.
#[derive(Debug, Clone)]
pub(super) struct Span<const N: usize, const D: usize> {
    length: f64,
    bending: f64,
    /// `GJ - EI`.
    torsion_excess: f64,
    shear: f64,
    /// `EA - GA`.
    axial_excess: f64,
    tangents: [Triple; POINTS],
    /// `h sum b v`: from start to end.
    arm: Triple,
    /// How a rotation strain displaces the end: dp = x x lever.
    levers: [Triple; POINTS],
    /// What the loads add to the strain energy, upper triangle.
    form: [[f64; D]; D],
    /// Rows of the factors, upper triangle.
    factors: [[f64; D]; N],
    inverse_pivots: [f64; N],
    pub mode: [f64; N],
    pub image: [f64; N],
}

impl<const N: usize, const D: usize> Span<N, D> {
    pub(super) fn new(section: &Section, count: usize) -> Self {
        let [shear, axial] = if N == EXTENSIBLE { section.extensional_stiffness() } else { [0.0; 2] };
        Self {
            length: section.length / count as f64,
            bending: section.bending_stiffness,
            torsion_excess: section.torsion_stiffness() - section.bending_stiffness,
            shear,
            axial_excess: axial - shear,
            tangents: [Triple::default(); POINTS],
            arm: Triple::default(),
            levers: [Triple::default(); POINTS],
            form: [[0.0; D]; D],
            factors: [[0.0; D]; N],
            inverse_pivots: [0.0; N],
            mode: [0.0; N],
            image: [0.0; N],
        }
    }

    /// Takes over the state at the Gauss points: `B` by (z1), the loads' form by (z3).
    pub(super) fn update(&mut self, samples: &[Sample]) {
        let h = self.length;
        let sways: [Square; POINTS] = core::array::from_fn(|g| sway(samples[g].force, samples[g].velocity));
        self.tangents = core::array::from_fn(|g| samples[g].tangent);
        let travel = |weights: [f64; POINTS]| {
            let parts = weights.iter().zip(samples).map(|(b, at)| at.velocity.scaled(*b));
            parts.fold(Triple::default(), |sum, part| sum + part).scaled(h)
        };
        self.arm = travel(WEIGHTS);
        self.levers = core::array::from_fn(|p| travel(core::array::from_fn(|g| WEIGHTS[g] * PARTIAL[g][p])));
        self.form = [[0.0; D]; D];
        let phi = N + 3;
        let weighted = |weights: [f64; POINTS]| -> Square {
            core::array::from_fn(|i| {
                core::array::from_fn(|j| h * (0..POINTS).map(|g| weights[g] * sways[g][i][j]).sum::<f64>())
            })
        };
        self.add(phi, phi, 1.0, &weighted(WEIGHTS));
        for p in 0..POINTS {
            let turning = skew(samples[p].moment);
            let by_start = weighted(core::array::from_fn(|g| WEIGHTS[g] * PARTIAL[g][p]));
            self.add(3 * p, phi, 1.0, &by_start);
            self.add(3 * p, phi, -0.5 * WEIGHTS[p], &turning);
            for q in p..POINTS {
                let both = weighted(core::array::from_fn(|g| WEIGHTS[g] * PARTIAL[g][p] * PARTIAL[g][q]));
                self.add(3 * p, 3 * q, 1.0, &both);
                if q > p {
                    self.add(3 * p, 3 * q, -0.5 * WEIGHTS[p] * PARTIAL[p][q], &turning);
                    let other = skew(samples[q].moment);
                    self.add(3 * p, 3 * q, 0.5 * WEIGHTS[q] * PARTIAL[q][p], &other);
                }
            }
            if N == EXTENSIBLE {
                let pulling = skew(samples[p].force);
                self.add(BENDING + 3 * p, phi, -WEIGHTS[p], &pulling);
                for (q, partial) in PARTIAL[p].iter().enumerate() {
                    self.add(3 * q, BENDING + 3 * p, WEIGHTS[p] * partial, &pulling);
                }
            }
        }
    }

    #[inline(always)]
    fn add(&mut self, row: usize, first: usize, factor: f64, block: &Square) {
        for (i, from) in block.iter().enumerate() {
            for (j, entry) in from.iter().enumerate() {
                self.form[row + i][first + j] += factor * entry;
            }
        }
    }

    /// Strain energy's matrix times strains, `E x` (z2).
    #[inline(always)]
    pub(super) fn energy(&self, x: &[f64; N]) -> [f64; N] {
        let mut image = [0.0; N];
        for (p, weight) in WEIGHTS.into_iter().enumerate() {
            let weight = weight / self.length;
            self.energy_at(p, 3 * p, weight * self.bending, weight * self.torsion_excess, x, &mut image);
            if N == EXTENSIBLE {
                let first = BENDING + 3 * p;
                self.energy_at(p, first, weight * self.shear, weight * self.axial_excess, x, &mut image);
            }
        }
        image
    }

    #[inline(always)]
    fn energy_at(&self, p: usize, first: usize, across: f64, along: f64, x: &[f64; N], image: &mut [f64; N]) {
        let t = self.tangents[p];
        let strain = Triple::new(x[first], x[first + 1], x[first + 2]);
        let force = strain.scaled(across) + t.scaled(along * t.dot(strain));
        image[first..first + 3].copy_from_slice(&force.array());
    }

    /// Wrench at the end to the unknowns: `B^T f`.
    #[inline(always)]
    pub(super) fn pull(&self, wrench: Pose) -> [f64; D] {
        let (force, moment) = (wrench.position, wrench.rotation);
        let mut pulled = [0.0; D];
        for p in 0..POINTS {
            let by_strain = self.levers[p].cross(force) + moment.scaled(WEIGHTS[p]);
            pulled[3 * p..3 * p + 3].copy_from_slice(&by_strain.array());
            if N == EXTENSIBLE {
                let first = BENDING + 3 * p;
                pulled[first..first + 3].copy_from_slice(&force.scaled(WEIGHTS[p]).array());
            }
        }
        pulled[N..].copy_from_slice(&wrench.pulled_back(self.arm).array());
        pulled
    }

    /// Displacement of the end: `B z`.
    #[inline(always)]
    pub(super) fn push(&self, x: &[f64; N], start: Pose) -> Pose {
        let mut end = start.pushed_on(self.arm);
        for p in 0..POINTS {
            let strain = Triple::new(x[3 * p], x[3 * p + 1], x[3 * p + 2]);
            end.position = end.position + strain.cross(self.levers[p]);
            end.rotation = end.rotation + strain.scaled(WEIGHTS[p]);
            if N == EXTENSIBLE {
                let first = BENDING + 3 * p;
                let shift = Triple::new(x[first], x[first + 1], x[first + 2]);
                end.position = end.position + shift.scaled(WEIGHTS[p]);
            }
        }
        end
    }

    /// Eliminates the strains: stiffness at the start from that at the end, and how many pivots are not
    /// positive.
    pub(super) fn condense(&mut self, shift: f64, beyond: &Stiffness) -> (Stiffness, u32) {
        let mut matrix = self.form;
        for (p, weight) in WEIGHTS.into_iter().enumerate() {
            let weight = (1.0 - shift) * weight / self.length;
            self.add_energy(&mut matrix, p, 3 * p, weight * self.bending, weight * self.torsion_excess);
            if N == EXTENSIBLE {
                let first = BENDING + 3 * p;
                self.add_energy(&mut matrix, p, first, weight * self.shear, weight * self.axial_excess);
            }
        }
        self.add_beyond(&mut matrix, beyond);
        let mut negative = 0;
        for j in 0..N {
            let pivot = matrix[j][j];
            negative += u32::from(pivot <= 0.0 || pivot.is_nan());
            let inverse = 1.0 / pivot;
            let row = matrix[j];
            for i in j + 1..D {
                let factor = row[i] * inverse;
                for k in i..D {
                    matrix[i][k] -= factor * row[k];
                }
            }
            self.factors[j] = row;
            self.inverse_pivots[j] = inverse;
        }
        let left = |i: usize, j: usize| matrix[N + i.min(j)][N + i.max(j)];
        let rows = core::array::from_fn(|i| Pose::from_array(core::array::from_fn(|j| left(i, j))));
        (rows, negative)
    }

    /// Adds `B^T K B`, upper triangle.
    #[inline(always)]
    fn add_beyond(&self, matrix: &mut [[f64; D]; D], beyond: &Stiffness) {
        let half: [[f64; D]; 6] = core::array::from_fn(|i| self.pull(beyond[i]));
        let [fx, fy, fz, mx, my, mz] = &half;
        let mut turn = |first: usize, lever: Triple, weight: f64| {
            for k in first..D {
                matrix[first][k] += lever.y * fz[k] - lever.z * fy[k] + weight * mx[k];
                matrix[first + 1][k] += lever.z * fx[k] - lever.x * fz[k] + weight * my[k];
                matrix[first + 2][k] += lever.x * fy[k] - lever.y * fx[k] + weight * mz[k];
            }
        };
        for (p, weight) in WEIGHTS.into_iter().enumerate() {
            turn(3 * p, self.levers[p], weight);
        }
        turn(N + 3, self.arm, 1.0);
        let mut shift = |first: usize, weight: f64| {
            for (i, force) in [fx, fy, fz].into_iter().enumerate() {
                for k in first..D {
                    matrix[first + i][k] += weight * force[k];
                }
            }
        };
        if N == EXTENSIBLE {
            for (p, weight) in WEIGHTS.into_iter().enumerate() {
                shift(BENDING + 3 * p, weight);
            }
        }
        shift(N, 1.0);
    }

    #[inline(always)]
    fn add_energy(&self, matrix: &mut [[f64; D]; D], p: usize, first: usize, across: f64, along: f64) {
        let t = self.tangents[p].array();
        for i in 0..3 {
            matrix[first + i][first + i] += across;
            for j in 0..3 {
                matrix[first + i][first + j] += along * t[i] * t[j];
            }
        }
    }

    /// Forward half of a solution: eliminates the right side `E mode` and the wrench at the end.
    pub(super) fn forward(&mut self, wrench: Pose) -> Pose {
        let mut right = self.pull(wrench);
        for (entry, load) in right.iter_mut().zip(self.energy(&self.mode)) {
            *entry += load;
        }
        for j in 0..N {
            let share = right[j] * self.inverse_pivots[j];
            let row = &self.factors[j];
            for k in j + 1..D {
                right[k] -= row[k] * share;
            }
            self.image[j] = share;
        }
        Pose::from_array(core::array::from_fn(|i| right[N + i]))
    }

    /// Backward half: the strains, given the displacement of the start; returns that of the end.
    pub(super) fn backward(&mut self, start: Pose) -> Pose {
        let mut all = [0.0; D];
        all[N..].copy_from_slice(&start.array());
        for j in (0..N).rev() {
            let row = &self.factors[j];
            let sum: f64 = (j + 1..D).map(|k| row[k] * all[k]).sum();
            all[j] = self.image[j] - self.inverse_pivots[j] * sum;
            self.image[j] = all[j];
        }
        self.push(&self.image, start)
    }

    /// Product of the pivots of `A - shift E`, over that of E.
    #[cfg(test)]
    pub(super) fn pivot_product(&self) -> f64 {
        let mut product: f64 = self.inverse_pivots.iter().map(|inverse| 1.0 / inverse).product();
        for weight in WEIGHTS.map(|weight| weight / self.length) {
            let torsion = self.bending + self.torsion_excess;
            product /= weight * self.bending * weight * self.bending * weight * torsion;
            if N == EXTENSIBLE {
                let axial = self.shear + self.axial_excess;
                product /= weight * self.shear * weight * self.shear * weight * axial;
            }
        }
        product
    }
}
