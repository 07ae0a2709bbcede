//! Small dense linear systems `A x = b` by LU factors with partial pivoting.
//!
//! The caller brings `A` to comparable units in rows and columns first, so that pivots may be compared
//! with each other and with [`PIVOT_MIN`].

use super::pair::Pair;
use super::triple::Scalar;

/// Least admitted ratio of a pivot to the greatest entry of the matrix. Below it a solution keeps
/// fewer than three digits of sixteen.
pub const PIVOT_MIN: f64 = 1e-13;

/// The matrix has no usable inverse: a pivot vanished, or an entry was not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the matrix is singular to working precision")]
pub struct Singular;

/// Factors of a square matrix.
#[derive(Debug, Clone, Copy)]
pub struct Lu<const N: usize> {
    /// L below the diagonal (its diagonal is one), U above it, reciprocal pivots on it.
    factors: [[f64; N]; N],
    /// Row `i` of the factors is row `order[i]` of the matrix.
    order: [usize; N],
    determinant: f64,
}

impl<const N: usize> Lu<N> {
    /// Factors `matrix`, given by rows.
    ///
    /// # Errors
    /// [`Singular`] when a pivot falls below `PIVOT_MIN` times the greatest entry, or is not a number.
    pub fn new(mut matrix: [[f64; N]; N]) -> Result<Self, Singular> {
        let greatest = matrix.iter().flatten().fold(0.0_f64, |greatest, entry| greatest.max(entry.abs()));
        let mut order = core::array::from_fn(|i| i);
        let mut determinant = 1.0;
        for k in 0..N {
            let mut pivot_row = k;
            for i in k + 1..N {
                if matrix[i][k].abs() > matrix[pivot_row][k].abs() {
                    pivot_row = i;
                }
            }
            if pivot_row != k {
                matrix.swap(k, pivot_row);
                order.swap(k, pivot_row);
                determinant = -determinant;
            }
            let pivot = matrix[k][k];
            // Written so that a pivot that is not a number is refused as well.
            if !(pivot.abs() > PIVOT_MIN * greatest && pivot.is_finite()) {
                return Err(Singular);
            }
            determinant *= pivot;
            let reciprocal = 1.0 / pivot;
            matrix[k][k] = reciprocal;
            let row = matrix[k];
            for below in &mut matrix[k + 1..] {
                let factor = below[k] * reciprocal;
                below[k] = factor;
                for j in k + 1..N {
                    below[j] -= factor * row[j];
                }
            }
        }
        Ok(Self { factors: matrix, order, determinant })
    }

    /// Determinant of the matrix.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        self.determinant
    }

    /// `A^-1 b`.
    #[must_use]
    pub fn solve(&self, right: &[f64; N]) -> [f64; N] {
        let mut x: [f64; N] = core::array::from_fn(|i| right[self.order[i]]);
        for i in 1..N {
            for k in 0..i {
                x[i] -= self.factors[i][k] * x[k];
            }
        }
        for i in (0..N).rev() {
            for k in i + 1..N {
                x[i] -= self.factors[i][k] * x[k];
            }
            x[i] *= self.factors[i][i];
        }
        x
    }

    /// `A^-1 B` for `P` pairs of columns, `B` by rows.
    #[inline]
    #[must_use]
    pub fn solve_columns<const P: usize>(&self, right: &[[Pair; P]; N]) -> [[Pair; P]; N] {
        let mut x: [[Pair; P]; N] = core::array::from_fn(|i| right[self.order[i]]);
        for i in 1..N {
            for k in 0..i {
                let known = x[k];
                subtract(&mut x[i], self.factors[i][k], &known);
            }
        }
        for i in (0..N).rev() {
            for k in i + 1..N {
                let known = x[k];
                subtract(&mut x[i], self.factors[i][k], &known);
            }
            let reciprocal = Pair::splat(self.factors[i][i]);
            for column in &mut x[i] {
                *column = *column * reciprocal;
            }
        }
        x
    }
}

/// `row - factor known`.
#[inline(always)]
fn subtract<const P: usize>(row: &mut [Pair; P], factor: f64, known: &[Pair; P]) {
    let factor = Pair::splat(factor);
    for (entry, known) in row.iter_mut().zip(known) {
        *entry = factor.times_from(*known, *entry);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector6};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{Lu, Pair, Singular};

    fn rows(matrix: &Matrix6<f64>) -> [[f64; 6]; 6] {
        core::array::from_fn(|i| core::array::from_fn(|j| matrix[(i, j)]))
    }

    #[test]
    fn random_systems_are_solved_and_their_determinants_agree_with_nalgebra() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let matrix = Matrix6::from_fn(|_, _| random.random_range(-1.0..1.0));
            let x = Vector6::from_fn(|_, _| random.random_range(-1.0..1.0));
            let lu = Lu::new(rows(&matrix)).expect("random matrices are regular");
            let b: [f64; 6] = (matrix * x).into();
            let found = Vector6::from(lu.solve(&b));
            // Condition numbers of such matrices stay below 1e5.
            assert!((found - x).norm() < 1e-9, "{found} {x}");
            let determinant = matrix.determinant();
            assert!((lu.determinant() - determinant).abs() < 1e-12 * (1.0 + determinant.abs()));
            let columns = lu.solve_columns(&b.map(|entry| [Pair::new(entry, -2.0 * entry)]));
            for i in 0..6 {
                assert!((columns[i][0].low() - found[i]).abs() < 1e-12 * (1.0 + found.norm()));
                assert!((columns[i][0].high() + 2.0 * found[i]).abs() < 1e-12 * (1.0 + found.norm()));
            }
        }
    }

    #[test]
    fn dependent_rows_and_numbers_that_are_none_are_refused() {
        let dependent = [[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.5, -1.0, 2.0]];
        assert_eq!(Lu::new(dependent).err(), Some(Singular));
        let none = [[f64::NAN, 1.0], [1.0, f64::NAN]];
        assert_eq!(Lu::new(none).err(), Some(Singular));
        assert_eq!(Lu::new([[0.0; 2]; 2]).err(), Some(Singular));
    }
}
