//! Block-tridiagonal systems with 6 x 6 blocks: a chain's tangent, factorised once and solved often.
//!
//! Row `i` reads `lower_i x_(i-1) + diagonal_i x_i + upper_i x_(i+1) = b_i`. Block elimination from
//! the clamp to the tip keeps `inverse_i = (diagonal_i - lower_i inverse_(i-1) upper_(i-1))^-1` and
//! `next_i = inverse_i upper_i`, so that a solution costs three block products a row.

use nalgebra::{Matrix6, Vector6};

use super::element::blocks;

/// The system and its factors. All storage is allocated at construction.
#[derive(Debug, Clone)]
pub struct BlockTridiagonal {
    lower: Vec<Matrix6<f64>>,
    diagonal: Vec<Matrix6<f64>>,
    upper: Vec<Matrix6<f64>>,
    inverse: Vec<Matrix6<f64>>,
    next: Vec<Matrix6<f64>>,
}

impl BlockTridiagonal {
    /// A system of `rows` block rows, all zero.
    pub fn new(rows: usize) -> Self {
        let zeros = vec![Matrix6::zeros(); rows];
        Self {
            lower: zeros.clone(),
            diagonal: zeros.clone(),
            upper: zeros.clone(),
            inverse: zeros.clone(),
            next: zeros,
        }
    }

    /// Sets every block to zero.
    pub fn clear(&mut self) {
        for blocks in [&mut self.lower, &mut self.diagonal, &mut self.upper] {
            blocks.fill(Matrix6::zeros());
        }
    }

    /// Adds to the diagonal block of row `row`.
    pub fn add_diagonal(&mut self, row: usize, block: &Matrix6<f64>) {
        self.diagonal[row] += block;
    }

    /// Adds to the two blocks that couple row `row - 1` and row `row`: `above` stands in row
    /// `row - 1`, `below` in row `row`.
    pub fn add_coupling(&mut self, row: usize, above: &Matrix6<f64>, below: &Matrix6<f64>) {
        self.upper[row - 1] += above;
        self.lower[row] += below;
    }

    /// Prepares [`Self::solve`]; false when a pivot block is singular.
    pub fn factorise(&mut self) -> bool {
        for row in 0..self.diagonal.len() {
            let mut pivot = self.diagonal[row];
            if row > 0 {
                pivot -= self.lower[row] * self.next[row - 1];
            }
            let Some(inverse) = inverse(&pivot) else { return false };
            self.inverse[row] = inverse;
            self.next[row] = inverse * self.upper[row];
        }
        true
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&self, x: &mut [Vector6<f64>]) {
        let rows = self.diagonal.len();
        for row in 0..rows {
            let known = if row > 0 { x[row] - self.lower[row] * x[row - 1] } else { x[row] };
            x[row] = self.inverse[row] * known;
        }
        for row in (0..rows.saturating_sub(1)).rev() {
            let beyond = self.next[row] * x[row + 1];
            x[row] -= beyond;
        }
    }

    /// The product of the system's matrix with `x`.
    pub fn multiply(&self, x: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let rows = self.diagonal.len();
        (0..rows)
            .map(|row| {
                let mut product = self.diagonal[row] * x[row];
                if row > 0 {
                    product += self.lower[row] * x[row - 1];
                }
                if row + 1 < rows {
                    product += self.upper[row] * x[row + 1];
                }
                product
            })
            .collect()
    }
}

/// The inverse by blocks of three, without pivoting between them: the first block of a body is its mass and the
/// stiffness against displacement, which is regular where the whole is.
fn inverse(whole: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let block = |row, column| whole.fixed_view::<3, 3>(row, column).into_owned();
    let (a, b, c, d) = (block(0, 0), block(0, 3), block(3, 0), block(3, 3));
    let a_inverse = a.try_inverse()?;
    let beside = a_inverse * b;
    let below = c * a_inverse;
    let rest = (d - c * beside).try_inverse()?;
    let corner = beside * rest;
    Some(blocks(&(a_inverse + corner * below), &-corner, &-(rest * below), &rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solution_multiplied_by_the_matrix_gives_back_the_right_hand_side() {
        let rows = 7;
        let mut system = BlockTridiagonal::new(rows);
        // Diagonally dominant blocks without any symmetry.
        let block = |seed: usize| {
            Matrix6::from_fn(|row, column| ((seed * 31 + row * 7 + column * 13) as f64 * 0.7).sin())
        };
        for row in 0..rows {
            system.add_diagonal(row, &(block(row) + Matrix6::from_diagonal_element(20.0)));
            if row > 0 {
                system.add_coupling(row, &block(row + 50), &block(row + 90));
            }
        }
        let right: Vec<_> = (0..rows).map(|row| block(row + 200).column(0).into_owned()).collect();
        let mut x = right.clone();
        assert!(system.factorise());
        system.solve(&mut x);
        for (found, expected) in system.multiply(&x).iter().zip(&right) {
            assert!((found - expected).norm() < 1e-13);
        }
    }

    #[test]
    fn a_singular_system_is_refused() {
        assert!(!BlockTridiagonal::new(3).factorise());
    }
}
