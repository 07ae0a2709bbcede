//! What holding a posture costs, disturbances included: the measure by which postures are compared.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `I` | coil currents | A |
//! | `J` | rows of the orientation Jacobian (16) in the currents alone | rad/A |
//! | `epsilon` | RMS of an orientation disturbance, the same in every row | rad |
//!
//! Currents that undo a random disturbance `e` of the rows, `<e e'> = epsilon^2 1`, are `J^+ e` on top of those that hold the
//! posture, so that the expected sum of squares is
//! ```text
//! V = |I|^2 + epsilon^2 tr((J J')^-1) = |I|^2 + epsilon^2 sum_i 1 / sigma_i^2            (p1)
//! ```
//! in A^2: in proportion to ohmic power where all coils have one resistance. It is large where currents are, and where a direction is
//! left in which the currents have no authority, and both in one unit.

use crate::math::ThinSvd;

/// Singular value below which a direction counts as lost, rad/A: (p1) stays finite.
const SIGMA_MIN: f64 = 1e-4;

/// Evaluates (p1) for one rig.
#[derive(Debug, Clone)]
pub struct ExpectedPower {
    disturbance: f64,
    coils: usize,
    columns: Vec<f64>,
    svd: ThinSvd,
}

impl ExpectedPower {
    /// For `rows` rows of error and `coils` coils; `disturbance` is `epsilon`, rad.
    #[must_use]
    pub fn new(rows: usize, coils: usize, disturbance: f64) -> Self {
        Self { disturbance, coils, columns: vec![0.0; rows * coils], svd: ThinSvd::new(rows, coils) }
    }

    /// `V`, A^2; `jacobian` by rows of all `parameters`, currents first, of which the angles are not read.
    pub fn evaluate(&mut self, currents: &[f64], jacobian: &[f64], parameters: usize) -> f64 {
        let rows = self.columns.chunks_exact_mut(self.coils.max(1));
        for (columns, row) in rows.zip(jacobian.chunks_exact(parameters.max(1))) {
            columns.copy_from_slice(&row[..self.coils]);
        }
        self.svd.decompose(&self.columns);
        let holding: f64 = currents[..self.coils].iter().map(|current| current * current).sum();
        let inverse: f64 = self.svd.values().iter().map(|sigma| sigma.max(SIGMA_MIN).powi(-2)).sum();
        holding + self.disturbance * self.disturbance * inverse // (p1)
    }

    /// Ratio of the largest to the smallest singular value of `J` at the last evaluation.
    #[must_use]
    pub fn condition(&self) -> f64 {
        self.svd.condition(f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Goal: (p1) is the mean, over random disturbances, of the least squares of currents that hold and undo them.
    #[test]
    fn is_the_mean_over_disturbances() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let jacobian: Vec<f64> = (0..4 * 8).map(|_| random.random_range(-0.2..0.2)).collect();
        let currents: Vec<f64> = (0..6).map(|_| random.random_range(-2.0..2.0)).collect();
        let epsilon = 0.05;
        let mut expected = ExpectedPower::new(4, 6, epsilon);
        let value = expected.evaluate(&currents, &jacobian, 8);
        let held: f64 = currents.iter().map(|current| current * current).sum();
        let coil_columns: Vec<f64> =
            jacobian.chunks_exact(8).flat_map(|row| row[..6].iter().copied()).collect();
        let mut svd = ThinSvd::new(4, 6);
        svd.decompose(&coil_columns);
        let (mut undone, draws) = (0.0, 40_000);
        let mut solution = [0.0; 6];
        for _ in 0..draws {
            // Signs at random have the covariance of (p1).
            let disturbance: Vec<f64> =
                (0..4).map(|_| if random.random::<bool>() { epsilon } else { -epsilon }).collect();
            svd.pseudo_solve(&disturbance, 1e12, &mut solution);
            undone += solution.iter().map(|current| current * current).sum::<f64>() / f64::from(draws);
        }
        assert!((value - held - undone).abs() < 0.02 * undone, "{value} {held} {undone}");
    }

    /// Goal: a direction without authority costs much, not infinitely much.
    #[test]
    fn a_lost_direction_stays_finite() {
        let mut expected = ExpectedPower::new(2, 2, 0.1);
        let value = expected.evaluate(&[1.0, 0.0], &[0.1, 0.0, 0.0, 0.0], 2);
        assert!(value.is_finite() && value > 1e5);
    }
}
