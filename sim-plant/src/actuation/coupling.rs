//! Which coils share flux: coupling coefficients by pairs, as one matrix.
//!
//! A coefficient is `M / sqrt(L_1 L_2)`, negative where currents that are positive by the description oppose
//! each other's flux. It is taken as constant, though frames that turn would change it.
//!
//! The matrix must be positive definite, or the coils would store negative energy. More is asked: each
//! amplifier knows its own coil alone, so with strongly coupled coils their loops would contend with one
//! another, faster than a step resolves. With every eigenvalue above [`EIGENVALUE_MIN`] the sampled loops of
//! described coils have no pole below `1 - 1 / EIGENVALUE_MIN`, -0.43, at any step: the distance from -1 is
//! what coils with shorted turns need.

use super::propagator::factor;

/// What the least eigenvalue of the matrix of coefficients must exceed.
pub const EIGENVALUE_MIN: f64 = 0.7;

/// The coefficient of two coils, by their indices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CouplingPair {
    /// Indices into the description's coils, different ones.
    pub coils: [usize; 2],
    /// Between -1 and 1.
    pub coefficient: f64,
}

/// Coefficients of all pairs of coils, checked.
#[derive(Debug, Clone, PartialEq)]
pub struct Couplings {
    count: usize,
    matrix: Vec<f64>,
}

impl Couplings {
    /// For `count` coils that share no flux.
    #[must_use]
    pub fn none(count: usize) -> Self {
        let mut matrix = vec![0.0; count * count];
        matrix.iter_mut().step_by(count + 1).for_each(|entry| *entry = 1.0);
        Self { count, matrix }
    }

    /// The matrix for `count` coils; a pair that is not given is not coupled, one given twice has the later
    /// coefficient.
    ///
    /// # Errors
    /// The index in `pairs` of the first one that, with those before it, is too strong: the least eigenvalue
    /// is not above [`EIGENVALUE_MIN`].
    pub fn new(count: usize, pairs: &[CouplingPair]) -> Result<Self, usize> {
        let mut couplings = Self::none(count);
        pairs.iter().for_each(|pair| couplings.set(pair));
        if couplings.is_weak() {
            return Ok(couplings);
        }
        let mut part = Self::none(count);
        let too_strong = pairs.iter().position(|pair| {
            part.set(pair);
            !part.is_weak()
        });
        Err(too_strong.unwrap_or_default())
    }

    /// By rows, with ones on the diagonal.
    #[must_use]
    pub fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn set(&mut self, pair: &CouplingPair) {
        let [one, other] = pair.coils;
        self.matrix[one * self.count + other] = pair.coefficient;
        self.matrix[other * self.count + one] = pair.coefficient;
    }

    fn is_weak(&self) -> bool {
        let mut shifted = self.matrix.clone();
        shifted.iter_mut().step_by(self.count + 1).for_each(|entry| *entry -= EIGENVALUE_MIN);
        factor(self.count, &mut shifted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(one: usize, other: usize, coefficient: f64) -> CouplingPair {
        CouplingPair { coils: [one, other], coefficient }
    }

    #[test]
    fn pairs_make_a_symmetric_matrix() {
        let couplings = Couplings::new(3, &[pair(0, 2, -0.1), pair(1, 2, 0.2)]).expect("weak");
        assert_eq!(couplings.matrix(), [1.0, 0.0, -0.1, 0.0, 1.0, 0.2, -0.1, 0.2, 1.0]);
        assert_eq!(Couplings::new(0, &[]).expect("nothing").matrix(), [0.0; 0]);
    }

    #[test]
    fn the_first_pair_that_is_too_strong_is_named() {
        assert_eq!(Couplings::new(2, &[pair(0, 1, 0.301)]), Err(0));
        assert!(Couplings::new(2, &[pair(0, 1, 0.299)]).is_ok());
        // Each alone is weak; a chain of three has its least eigenvalue at 1 - 0.22 sqrt(2) = 0.69.
        assert_eq!(Couplings::new(3, &[pair(0, 1, 0.22), pair(1, 2, 0.22)]), Err(1));
        assert_eq!(Couplings::new(3, &[pair(0, 1, 0.1), pair(1, 2, f64::NAN)]), Err(1));
    }
}
