//! The exact step of coupled coils at constant voltages and resistances.
//!
//! | symbol | meaning |
//! |---|---|
//! | `i`, `v` | currents, A, and voltages, V, of all coils |
//! | `L`, `R` | inductance matrix, H, symmetric and positive definite; diagonal of the resistances, ohm |
//! | `t` | the step, s |
//!
//! `L di/dt = v - R i` has, over a step in which nothing but `i` changes, the solution
//!
//! `i(t) = E i(0) + F v`,  `E = exp(A)`,  `F = t phi(A) L^-1`,  `A = -t L^-1 R`,            (2)
//!
//! with `phi(x) = (e^x - 1) / x`. Method: scaling and squaring. `A` is halved until its norm is at most
//! 1/8, `phi` taken from its Taylor series, and both doubled back by
//! `phi(2 A) = phi(A) (E(A) + 1) / 2`, `E(2 A) = E(A)^2`. Nothing cancels, however small the step; and the
//! result decays however large the step is against a coil's time constant.
//!
//! Matrices lie by rows in one array. After construction nothing here allocates.

/// Terms of the Taylor series of `phi`: the first one left out is below `(1/8)^10 / 11!`, 2e-17.
const TERMS: u32 = 10;
/// Norm up to which the series is used.
const NORM_MAX: f64 = 0.125;

/// `E` and `F` of the module's head, and `L^-1`.
#[derive(Debug, Clone)]
pub(super) struct Propagator {
    count: usize,
    decay: Vec<f64>,
    gain: Vec<f64>,
    inverse: Vec<f64>,
    scaled: Vec<f64>,
    product: Vec<f64>,
    phi: Vec<f64>,
}

impl Propagator {
    /// For `count` coils; of no use before [`Propagator::rebuild`].
    pub(super) fn new(count: usize) -> Self {
        let zeros = || vec![0.0; count * count];
        Self {
            count,
            decay: zeros(),
            gain: zeros(),
            inverse: zeros(),
            scaled: zeros(),
            product: zeros(),
            phi: zeros(),
        }
    }

    /// Takes over inductances, resistances and the step. `inductance` must be positive definite.
    pub(super) fn rebuild(&mut self, inductance: &[f64], resistance: &[f64], step: f64) {
        let count = self.count;
        self.product.copy_from_slice(inductance);
        let is_definite = factor(count, &mut self.product);
        debug_assert!(is_definite, "couplings are checked before anything is built from them");
        invert(count, &self.product, &mut self.inverse);
        for (row, inverse) in self.scaled.chunks_mut(count.max(1)).zip(self.inverse.chunks(count.max(1))) {
            for ((entry, inverse), resistance) in row.iter_mut().zip(inverse).zip(resistance) {
                *entry = -step * inverse * resistance;
            }
        }
        let doublings = self.scale();
        self.series();
        for _ in 0..doublings {
            self.double();
        }
        multiply(count, &self.phi, &self.inverse, &mut self.gain);
        self.gain.iter_mut().for_each(|entry| *entry *= step); // (2)
    }

    /// Currents after the step.
    pub(super) fn advance(&self, currents: &[f64], voltages: &[f64], next: &mut [f64]) {
        let rows = self.decay.chunks_exact(self.count.max(1)).zip(self.gain.chunks_exact(self.count.max(1)));
        for ((decay, gain), next) in rows.zip(next) {
            *next = dot(decay, currents) + dot(gain, voltages); // (2)
        }
    }

    /// `L^-1` by rows.
    pub(super) fn inverse(&self) -> &[f64] {
        &self.inverse
    }

    /// Halves `A` until the series holds; how often.
    fn scale(&mut self) -> u32 {
        let rows = self.scaled.chunks(self.count.max(1));
        let mut norm = rows.map(|row| row.iter().map(|entry| entry.abs()).sum()).fold(0.0, f64::max);
        let mut doublings = 0;
        let mut factor = 1.0;
        while norm > NORM_MAX {
            norm *= 0.5;
            factor *= 0.5;
            doublings += 1;
        }
        self.scaled.iter_mut().for_each(|entry| *entry *= factor);
        doublings
    }

    /// `phi` and `E` of the scaled matrix.
    fn series(&mut self) {
        identity(self.count, &mut self.phi);
        for term in (2..=TERMS).rev() {
            multiply(self.count, &self.scaled, &self.phi, &mut self.product);
            let scale = 1.0 / f64::from(term);
            self.phi.iter_mut().zip(&self.product).for_each(|(phi, product)| *phi = scale * product);
            add_identity(self.count, &mut self.phi);
        }
        multiply(self.count, &self.scaled, &self.phi, &mut self.decay);
        add_identity(self.count, &mut self.decay);
    }

    /// From `A` to `2 A`.
    fn double(&mut self) {
        multiply(self.count, &self.phi, &self.decay, &mut self.product);
        self.phi.iter_mut().zip(&self.product).for_each(|(phi, product)| *phi = 0.5 * (*phi + product));
        multiply(self.count, &self.decay, &self.decay, &mut self.product);
        self.decay.copy_from_slice(&self.product);
    }
}

/// Cholesky's factor in the lower triangle of a symmetric matrix; false when it is not positive definite.
pub(super) fn factor(count: usize, matrix: &mut [f64]) -> bool {
    for row in 0..count {
        for column in 0..=row {
            let (begin_row, begin_column) = (row * count, column * count);
            let known =
                dot(&matrix[begin_row..begin_row + column], &matrix[begin_column..begin_column + column]);
            let rest = matrix[begin_row + column] - known;
            if column < row {
                matrix[begin_row + column] = rest / matrix[begin_column + column];
            } else if rest > 0.0 {
                matrix[begin_row + row] = rest.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

/// The inverse from Cholesky's factor.
fn invert(count: usize, factor: &[f64], inverse: &mut [f64]) {
    // Each unit vector is solved for in the row of the result, which is symmetric.
    for (unit, solution) in inverse.chunks_mut(count.max(1)).enumerate() {
        solution.fill(0.0);
        solution[unit] = 1.0;
        for row in unit..count {
            let known = dot(&factor[row * count + unit..row * count + row], &solution[unit..row]);
            solution[row] = (solution[row] - known) / factor[row * count + row];
        }
        for row in (0..count).rev() {
            let later = (row + 1..count).map(|below| factor[below * count + row] * solution[below]);
            solution[row] = (solution[row] - later.sum::<f64>()) / factor[row * count + row];
        }
    }
}

fn multiply(count: usize, left: &[f64], right: &[f64], result: &mut [f64]) {
    if count == 0 {
        return;
    }
    for (row, sums) in left.chunks_exact(count).zip(result.chunks_exact_mut(count)) {
        sums.fill(0.0);
        for (factor, others) in row.iter().zip(right.chunks_exact(count)) {
            sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += factor * other);
        }
    }
}

fn identity(count: usize, matrix: &mut [f64]) {
    matrix.fill(0.0);
    add_identity(count, matrix);
}

fn add_identity(count: usize, matrix: &mut [f64]) {
    matrix.iter_mut().step_by(count + 1).for_each(|entry| *entry += 1.0);
}

fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left * right).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn propagator(inductance: &[f64], resistance: &[f64], step: f64) -> Propagator {
        let mut propagator = Propagator::new(resistance.len());
        propagator.rebuild(inductance, resistance, step);
        propagator
    }

    #[test]
    fn a_single_coil_decays_by_its_exponential_at_any_step() {
        for step in [1e-9, 5e-5, 2e-3, 0.02, 1.0] {
            let found = propagator(&[0.1], &[5.0], step);
            let decay = (-step * 50.0_f64).exp();
            assert!((found.decay[0] - decay).abs() < 1e-14, "step {step}");
            let gain = -(-step * 50.0_f64).exp_m1() / 5.0;
            assert!((found.gain[0] - gain).abs() < 1e-13 * gain, "step {step}");
        }
    }

    /// Goal: two steps are one of twice the length: the property that defines an exponential, without a
    /// second way to compute one.
    #[test]
    fn two_steps_are_one_of_twice_the_length() {
        let inductance = [0.1, -0.03, 0.01, -0.03, 0.2, 0.05, 0.01, 0.05, 0.08];
        let resistance = [5.0, 0.5, 40.0];
        for step in [5e-5, 5e-4, 5e-3, 0.5] {
            let (once, twice) = (
                propagator(&inductance, &resistance, step),
                propagator(&inductance, &resistance, 2.0 * step),
            );
            let (start, voltage) = ([3.0, -2.0, 0.5], [48.0, -12.0, 7.0]);
            let (mut half, mut two, mut one) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            once.advance(&start, &voltage, &mut half);
            once.advance(&half, &voltage, &mut two);
            twice.advance(&start, &voltage, &mut one);
            for (two, one) in two.iter().zip(one) {
                assert!((two - one).abs() < 1e-12 * (1.0 + one.abs()), "step {step}: {two} {one}");
            }
        }
    }

    #[test]
    fn a_matrix_that_is_not_positive_definite_has_no_factor() {
        assert!(factor(2, &mut [1.0, 0.99, 0.99, 1.0]));
        assert!(!factor(2, &mut [1.0, 1.01, 1.01, 1.0]));
        assert!(!factor(2, &mut [1.0, f64::NAN, f64::NAN, 1.0]));
    }

    #[test]
    fn the_inverse_undoes_its_matrix() {
        let matrix = [4.0, 1.0, -1.0, 1.0, 3.0, 0.5, -1.0, 0.5, 2.0];
        let mut lower = matrix;
        assert!(factor(3, &mut lower));
        let (mut inverse, mut unit) = ([0.0; 9], [0.0; 9]);
        invert(3, &lower, &mut inverse);
        multiply(3, &matrix, &inverse, &mut unit);
        for (index, entry) in unit.iter().enumerate() {
            let expected = if index % 4 == 0 { 1.0 } else { 0.0 };
            assert!((entry - expected).abs() < 1e-14);
        }
    }
}
