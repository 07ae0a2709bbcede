//! Singular value decomposition of a small matrix with more columns than rows, without allocation.
//!
//! Method: one-sided Jacobi (Hestenes 1958; Golub, Van Loan: Matrix Computations, 4th ed., section 8.6.3) on the rows of
//! `A = U S V'`: plane rotations make the rows of `U'A = S V'` orthogonal, so that small singular values keep their relative
//! accuracy. Sweeps end when every pair of rows is orthogonal to rounding; 30 sweeps are far more than ever needed. A row below rounding of
//! the whole matrix, as a matrix of lower rank leaves it, is noise that never becomes orthogonal to anything: it is left alone.

/// Sweeps after which the decomposition is used as it is.
const SWEEPS_MAX: usize = 30;

/// Norm of a row, relative to that of the matrix, that is rounding; far below what [`ThinSvd::condition`] and its like are asked to keep.
const ROUNDING: f64 = 1e-15;

/// Decomposition of an `rows x columns` matrix.
#[derive(Debug, Clone)]
pub struct ThinSvd {
    rows: usize,
    columns: usize,
    /// `S V'` by rows.
    scaled_right: Vec<f64>,
    /// `U'` by rows.
    left: Vec<f64>,
    values: Vec<f64>,
}

impl ThinSvd {
    /// Storage for matrices of one size.
    #[must_use]
    pub fn new(rows: usize, columns: usize) -> Self {
        Self {
            rows,
            columns,
            scaled_right: vec![0.0; rows * columns],
            left: vec![0.0; rows * rows],
            values: vec![0.0; rows],
        }
    }

    /// Decomposes `matrix`, given by rows.
    pub fn decompose(&mut self, matrix: &[f64]) {
        self.scaled_right.copy_from_slice(matrix);
        self.left.fill(0.0);
        for i in 0..self.rows {
            self.left[i * self.rows + i] = 1.0;
        }
        let whole: f64 = matrix.iter().map(|entry| entry * entry).sum();
        let noise = whole * ROUNDING * ROUNDING;
        for _ in 0..SWEEPS_MAX {
            if !self.sweep(noise) {
                break;
            }
        }
        for (value, row) in self.values.iter_mut().zip(self.scaled_right.chunks_exact(self.columns)) {
            *value = row.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
        }
    }

    /// Singular values, in no order; as many as rows.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Ratio of the largest singular value to the smallest one kept under (19).
    #[must_use]
    pub fn condition(&self, ratio_max: f64) -> f64 {
        let largest = self.largest();
        let kept = self.values.iter().filter(|value| is_kept(**value, largest, ratio_max));
        let smallest = kept.fold(largest, |least, value| least.min(*value));
        if smallest > 0.0 { largest / smallest } else { f64::INFINITY }
    }

    /// `x = A^+ b` with singular values kept while `s_1 / s_i <= ratio_max` (18), (19).
    pub fn pseudo_solve(&self, right: &[f64], ratio_max: f64, solution: &mut [f64]) {
        solution.fill(0.0);
        let largest = self.largest();
        for (i, value) in self.values.iter().enumerate() {
            if !is_kept(*value, largest, ratio_max) {
                continue;
            }
            let left = &self.left[i * self.rows..(i + 1) * self.rows];
            let along: f64 = left.iter().zip(right).map(|(u, b)| u * b).sum();
            let row = &self.scaled_right[i * self.columns..(i + 1) * self.columns];
            // The stored row is s_i v_i: one division by s_i makes it v_i, one inverts.
            let scale = along / (value * value);
            for (entry, v) in solution.iter_mut().zip(row) {
                *entry += scale * v;
            }
        }
    }

    /// Takes out of `vector` what the matrix sees of it: afterwards it lies in the null space, of the singular
    /// values kept as above.
    pub fn project_to_null_space(&self, ratio_max: f64, vector: &mut [f64]) {
        let largest = self.largest();
        for (row, value) in self.scaled_right.chunks_exact(self.columns).zip(&self.values) {
            if !is_kept(*value, largest, ratio_max) {
                continue;
            }
            let along: f64 = row.iter().zip(vector.iter()).map(|(v, x)| v * x).sum::<f64>() / (value * value);
            for (x, v) in vector.iter_mut().zip(row) {
                *x -= along * v;
            }
        }
    }

    fn largest(&self) -> f64 {
        self.values.iter().fold(0.0, |most, value| most.max(*value))
    }

    /// Rotates every pair of rows whose squared norms exceed `noise`; false when all were orthogonal already.
    fn sweep(&mut self, noise: f64) -> bool {
        let mut rotated = false;
        for p in 0..self.rows {
            for q in p + 1..self.rows {
                rotated |= self.rotate(p, q, noise);
            }
        }
        rotated
    }

    fn rotate(&mut self, p: usize, q: usize, noise: f64) -> bool {
        let n = self.columns;
        let (head, tail) = self.scaled_right.split_at_mut(q * n);
        let (first, second) = (&mut head[p * n..(p + 1) * n], &mut tail[..n]);
        let (mut alpha, mut beta, mut gamma) = (0.0, 0.0, 0.0);
        for (a, b) in first.iter().zip(second.iter()) {
            alpha += a * a;
            beta += b * b;
            gamma += a * b;
        }
        // Also false for numbers that are not finite: the sweeps then end at once.
        let coupled = gamma != 0.0 && gamma.abs() > 1e-15 * (alpha * beta).sqrt();
        if !coupled || alpha.min(beta) <= noise {
            return false;
        }
        let zeta = (beta - alpha) / (2.0 * gamma);
        let tangent = 1.0_f64.copysign(zeta) / (zeta.abs() + zeta.hypot(1.0));
        let cosine = 1.0 / tangent.hypot(1.0);
        let sine = cosine * tangent;
        turn(first, second, cosine, sine);
        let m = self.rows;
        let (head, tail) = self.left.split_at_mut(q * m);
        turn(&mut head[p * m..(p + 1) * m], &mut tail[..m], cosine, sine);
        true
    }
}

fn is_kept(value: f64, largest: f64, ratio_max: f64) -> bool {
    value > 0.0 && largest <= ratio_max * value
}

fn turn(first: &mut [f64], second: &mut [f64], cosine: f64, sine: f64) {
    for (a, b) in first.iter_mut().zip(second) {
        let (old_a, old_b) = (*a, *b);
        *a = cosine * old_a - sine * old_b;
        *b = sine * old_a + cosine * old_b;
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Goal: singular values and the pseudoinverse agree with nalgebra's, an independent implementation, over
    /// wide and tall, well and badly conditioned matrices.
    #[test]
    fn agrees_with_an_independent_decomposition() {
        let mut random = ChaCha8Rng::seed_from_u64(11);
        for _ in 0..200 {
            let rows = random.random_range(1..9);
            let columns = random.random_range(1..20);
            let grade: f64 = random.random_range(0.0..3.0);
            let matrix = DMatrix::from_fn(rows, columns, |i, _| {
                random.random_range(-1.0..1.0) * 10f64.powf(-grade * i as f64 / rows as f64)
            });
            let right = DVector::from_fn(rows, |_, _| random.random_range(-1.0..1.0));
            let by_rows: Vec<f64> = matrix.transpose().iter().copied().collect();
            let mut svd = ThinSvd::new(rows, columns);
            svd.decompose(&by_rows);
            let mut values = svd.values().to_vec();
            values.sort_by(|a, b| b.total_cmp(a));
            let oracle = matrix.clone().svd(true, true);
            for (ours, theirs) in values.iter().zip(oracle.singular_values.iter()) {
                assert!((ours - theirs).abs() < 1e-12);
            }
            // Both drop values 1e-5 below the largest, as (19) does.
            let cut = oracle.singular_values[0] * 1e-5;
            let expected = oracle.solve(&right, cut).expect("both factors were asked for");
            let mut solution = vec![0.0; columns];
            svd.pseudo_solve(right.as_slice(), 1e5, &mut solution);
            for (ours, theirs) in solution.iter().zip(expected.iter()) {
                assert!((ours - theirs).abs() < 1e-8 * (1.0 + theirs.abs()), "{ours} {theirs}");
            }
        }
    }

    /// Goal: what is left of a vector is not seen by the matrix, and a vector of the null space is left as it is.
    #[test]
    fn projection_leaves_only_the_null_space() {
        let mut svd = ThinSvd::new(2, 4);
        let matrix = [1.0, 2.0, 0.0, -1.0, 0.5, 0.0, 3.0, 1.0];
        svd.decompose(&matrix);
        let mut vector = [1.0, -2.0, 0.7, 3.0];
        svd.project_to_null_space(1e5, &mut vector);
        let once = vector;
        for row in matrix.chunks_exact(4) {
            let seen: f64 = row.iter().zip(&vector).map(|(a, x)| a * x).sum();
            assert!(seen.abs() < 1e-13);
        }
        svd.project_to_null_space(1e5, &mut vector);
        for (first, second) in once.iter().zip(&vector) {
            assert!((first - second).abs() < 1e-14);
        }
        assert!(once.iter().any(|x| x.abs() > 0.1));
    }

    /// Goal: a matrix of far lower rank than it has rows takes no more sweeps than others.
    #[test]
    fn low_rank_ends_as_soon_as_full_rank() {
        let mut random = ChaCha8Rng::seed_from_u64(12);
        for _ in 0..100 {
            let mut factor =
                |rows, columns| DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0));
            let matrix: DMatrix<f64> = factor(16, 3) * factor(3, 10);
            let by_rows: Vec<f64> = matrix.transpose().iter().copied().collect();
            let noise = matrix.norm_squared() * ROUNDING * ROUNDING;
            let mut svd = ThinSvd::new(16, 10);
            svd.scaled_right.copy_from_slice(&by_rows);
            let sweeps = (1..=SWEEPS_MAX).find(|_| !svd.sweep(noise));
            assert!(sweeps.is_some_and(|sweeps| sweeps < 12), "{sweeps:?}");
            svd.decompose(&by_rows);
            let mut values = svd.values().to_vec();
            values.sort_by(|a, b| b.total_cmp(a));
            for (ours, theirs) in values.iter().zip(matrix.singular_values().iter()) {
                assert!((ours - theirs).abs() < 1e-13 * values[0]);
            }
        }
    }

    /// Goal: a rank-deficient matrix keeps only what (19) keeps, and a zero matrix moves nothing.
    #[test]
    fn drops_what_has_no_singular_value() {
        let mut svd = ThinSvd::new(2, 3);
        svd.decompose(&[1.0, 2.0, 2.0, 2.0, 4.0, 4.0]);
        assert!((svd.condition(1e5) - 1.0).abs() < 1e-12);
        let mut solution = [0.0; 3];
        svd.pseudo_solve(&[1.0, 2.0], 1e5, &mut solution);
        for (found, expected) in solution.iter().zip([1.0 / 9.0, 2.0 / 9.0, 2.0 / 9.0]) {
            assert!((found - expected).abs() < 1e-14);
        }
        svd.decompose(&[0.0; 6]);
        svd.pseudo_solve(&[1.0, 2.0], 1e5, &mut solution);
        assert_eq!(solution, [0.0; 3]);
        assert_eq!(svd.condition(1e5), f64::INFINITY);
    }
}
