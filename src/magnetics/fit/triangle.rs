//! Least squares by the triangular factor.
//!
//! # Terms
//! | symbol | meaning |
//! |---|---|
//! | `A`, `b` | rows of the equations and what they must give |
//! | `R` | triangular factor of `[A b]` without Q: `R'R = [A b]'[A b]` |
//! | `D` | the norms of A's columns, on a diagonal |
//!
//! # Method
//! Householder's QR of `[A b]` keeps all that least squares needs in a small triangle: the solution, the sum
//! of squares at any x, `|R [x; -1]|^2`, and the columns' norms. The triangle of a union of rows is that of
//! the parts' triangles one above the other, so that every fit without one part costs little. The columns of
//! eq. (5) differ by twenty powers of ten; QR does not mind, and singular values are taken of `A D^-1`, whose
//! columns have unit norm (Golub, Van Loan: Matrix Computations, 4th ed., sections 5.3 and 5.5).

use nalgebra::{DMatrix, DVector};

/// Singular values of the scaled columns below this part of the largest are rounding: `1e-16` times a few
/// hundred equations, and a margin of a hundred.
const SINGULAR_RATIO_MIN: f64 = 1e-12;

/// The triangular factor of a set of equations.
#[derive(Debug, Clone)]
pub(super) struct Triangle {
    factor: DMatrix<f64>,
    equations: usize,
}

/// Index of a column that the equations do not determine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Deficient(pub usize);

/// What the equations say of the solution's uncertainty.
#[derive(Debug, Clone)]
pub(super) struct Spectrum {
    /// `(A'A)^-1`: times the variance of one equation, the covariance of the solution.
    pub inverse: DMatrix<f64>,
    /// Condition number of `A D^-1`.
    pub condition: f64,
}

impl Triangle {
    /// Factors `[A b]`; `b` is the last column.
    pub fn of(rows: DMatrix<f64>) -> Self {
        let equations = rows.nrows();
        Self { factor: rows.qr().unpack_r(), equations }
    }

    /// The factor of all equations of the parts, which have the same columns.
    pub fn joined<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let equations = parts.clone().map(|part| part.equations).sum();
        let columns = parts.clone().map(|part| part.factor.ncols()).max().unwrap_or(0);
        let mut stacked = DMatrix::zeros(parts.clone().map(|part| part.factor.nrows()).sum(), columns);
        let mut at = 0;
        for part in parts {
            stacked.rows_mut(at, part.factor.nrows()).copy_from(&part.factor);
            at += part.factor.nrows();
        }
        Self { factor: stacked.qr().unpack_r(), equations }
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        self.factor.ncols() - 1
    }

    /// Number of equations.
    pub fn equations(&self) -> usize {
        self.equations
    }

    /// The x that makes `|Ax - b|` least.
    ///
    /// # Errors
    /// A column that depends on those before it.
    pub fn solve(&self) -> Result<DVector<f64>, Deficient> {
        let unknowns = self.unknowns();
        if self.factor.nrows() < unknowns {
            return Err(Deficient(self.factor.nrows()));
        }
        let mut x = self.factor.column(unknowns).rows(0, unknowns).into_owned();
        for row in (0..unknowns).rev() {
            let pivot = self.factor[(row, row)];
            let norm = self.factor.column(row).norm();
            // False also when it is not a number.
            let is_determined = pivot.abs() > SINGULAR_RATIO_MIN * norm;
            if !is_determined {
                return Err(Deficient(row));
            }
            let known: f64 = (row + 1..unknowns).map(|column| self.factor[(row, column)] * x[column]).sum();
            x[row] = (x[row] - known) / pivot;
        }
        Ok(x)
    }

    /// `|Ax - b|^2`.
    pub fn squares(&self, x: &DVector<f64>) -> f64 {
        let unknowns = self.unknowns();
        (self.factor.columns(0, unknowns) * x - self.factor.column(unknowns)).norm_squared()
    }

    /// Condition and inverse of the normal matrix.
    ///
    /// # Errors
    /// The column that stands out in a combination that the equations do not see.
    pub fn spectrum(&self) -> Result<Spectrum, Deficient> {
        let unknowns = self.unknowns();
        let mut scaled =
            self.factor.columns(0, unknowns).rows(0, self.factor.nrows().min(unknowns)).into_owned();
        let norms: Vec<f64> = scaled.column_iter().map(|column| column.norm()).collect();
        for (index, norm) in norms.iter().enumerate() {
            let is_seen = *norm > 0.0 && norm.is_finite();
            if !is_seen {
                return Err(Deficient(index));
            }
            scaled.column_mut(index).unscale_mut(*norm);
        }
        let svd = scaled.svd(false, true);
        let Some(right) = &svd.v_t else { return Err(Deficient(0)) };
        let (largest, smallest) = (svd.singular_values.max(), svd.singular_values.min());
        let is_determined = svd.singular_values.len() == unknowns && smallest > SINGULAR_RATIO_MIN * largest;
        if !is_determined {
            let unseen = right.row(svd.singular_values.imin());
            return Err(Deficient(unseen.transpose().iamax()));
        }
        let mut weighted = right.clone();
        for (mut row, value) in weighted.row_iter_mut().zip(svd.singular_values.iter()) {
            row.unscale_mut(*value);
        }
        for (mut column, norm) in weighted.column_iter_mut().zip(&norms) {
            column.unscale_mut(*norm);
        }
        Ok(Spectrum { inverse: weighted.transpose() * &weighted, condition: largest / smallest })
    }
}
