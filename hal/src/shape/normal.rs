//! Normal equations of a small least-squares problem, by Cholesky factors, in storage of their own.
//!
//! | symbol | meaning |
//! |---|---|
//! | `H` | `J^T W J`, symmetric; the lower triangle is kept, by rows |
//! | `b` | `J^T W r` |
//! | `C` | lower factor, `H = C C^T` |

use nalgebra::{Matrix3, Vector3};

/// `H x = b`.
#[derive(Debug, Clone)]
pub(super) struct NormalEquations {
    size: usize,
    matrix: Vec<f64>,
    right: Vec<f64>,
    factor: Vec<f64>,
    scratch: Vec<f64>,
    products: Vec<Vector3<f64>>,
}

impl NormalEquations {
    /// For `size` unknowns.
    pub fn new(size: usize) -> Self {
        Self {
            size,
            matrix: vec![0.0; size * size],
            right: vec![0.0; size],
            factor: vec![0.0; size * size],
            scratch: vec![0.0; size],
            products: vec![Vector3::zeros(); size],
        }
    }

    pub fn clear(&mut self) {
        self.matrix.fill(0.0);
        self.right.fill(0.0);
    }

    /// Adds residuals of a displacement: `columns` are its derivatives by the first unknowns, `weight` and
    /// `pull` are `W` and `W r`.
    pub fn add_displacement(&mut self, columns: &[Vector3<f64>], weight: &Matrix3<f64>, pull: &Vector3<f64>) {
        for (product, column) in self.products.iter_mut().zip(columns) {
            *product = weight * column;
        }
        for (row, column) in columns.iter().enumerate() {
            self.right[row] += column.dot(pull);
            let entries = &mut self.matrix[row * self.size..=row * self.size + row];
            for (entry, product) in entries.iter_mut().zip(&self.products) {
                *entry += column.dot(product);
            }
        }
    }

    /// Adds a residual `r` of one row `J` with a weight.
    pub fn add_row(&mut self, row: &[f64], weight: f64, residual: f64) {
        for (index, left) in row.iter().enumerate() {
            let scaled = left * weight;
            self.right[index] += scaled * residual;
            let entries = &mut self.matrix[index * self.size..=index * self.size + index];
            for (entry, right) in entries.iter_mut().zip(row) {
                *entry += scaled * right;
            }
        }
    }

    /// Adds a residual `r` of the one unknown `index`.
    pub fn add_single(&mut self, index: usize, weight: f64, residual: f64) {
        self.matrix[index * self.size + index] += weight;
        self.right[index] += weight * residual;
    }

    /// Finds `C`; false when `H` is not positive definite or not finite.
    pub fn factorise(&mut self) -> bool {
        let size = self.size;
        for row in 0..size {
            for column in 0..=row {
                let (left, right) = (row * size, column * size);
                let mut sum = self.matrix[left + column];
                for k in 0..column {
                    sum -= self.factor[left + k] * self.factor[right + k];
                }
                if row == column {
                    // Written so that NaN fails too.
                    let is_positive = sum > 0.0 && sum.is_finite();
                    if !is_positive {
                        return false;
                    }
                    self.factor[left + row] = sum.sqrt();
                } else {
                    self.factor[left + column] = sum / self.factor[right + column];
                }
            }
        }
        true
    }

    /// Solves into `x`; after [`Self::factorise`].
    pub fn solve(&self, x: &mut [f64]) {
        let size = self.size;
        for row in 0..size {
            let known: f64 = (0..row).map(|k| self.factor[row * size + k] * x[k]).sum();
            x[row] = (self.right[row] - known) / self.factor[row * size + row];
        }
        for row in (0..size).rev() {
            let known: f64 = (row + 1..size).map(|k| self.factor[k * size + row] * x[k]).sum();
            x[row] = (x[row] - known) / self.factor[row * size + row];
        }
    }

    /// `x^T H x` of the solution `x`, which is `x^T b`.
    pub fn decrement(&self, x: &[f64]) -> f64 {
        x.iter().zip(&self.right).map(|(x, b)| x * b).sum()
    }

    /// `a^T H^-1 a`, the variance of `a . x` when `W` is the inverse of the residuals' variance; after
    /// [`Self::factorise`].
    pub fn variance(&mut self, a: impl Iterator<Item = f64>) -> f64 {
        let size = self.size;
        let mut sum = 0.0;
        for (row, entry) in a.chain(std::iter::repeat(0.0)).take(size).enumerate() {
            let known: f64 = (0..row).map(|k| self.factor[row * size + k] * self.scratch[k]).sum();
            self.scratch[row] = (entry - known) / self.factor[row * size + row];
            sum += self.scratch[row].powi(2);
        }
        sum
    }
}
