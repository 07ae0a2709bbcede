//! Damped linear least squares within a box, for a few unknowns, without allocation.
//!
//! Problem: minimise `|A x - b|^2 + d |x - p|^2` subject to `lower <= x <= upper`, with damping `d > 0`
//! towards a preferred point `p`. It is strictly convex, so the minimum is unique.
//! Method: primal active set on the normal equations (Nocedal, Wright: Numerical Optimization, 2nd ed., ch. 16.5), a
//! Cholesky factor of the free unknowns per change of the set. Each change lowers the cost, so that it
//! ends; a bound on the changes guards against rounding.
//!
//! Symbols: `m` rows, `n` unknowns, `H = A'A + d I`, `c = A'b + d p`, gradient `g = H x - c`.

/// What a solve returns beside the point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoundedReport {
    /// True when the optimality conditions hold; false when the changes ran out (the point is still in the box).
    pub converged: bool,
    /// Changes of the active set.
    pub iterations: u32,
    /// Unknowns at a bound, but for those whose bounds leave them no room.
    pub at_bound: u32,
}

/// One problem; slices have the solver's sizes.
#[derive(Debug, Clone, Copy)]
pub struct BoundedProblem<'a> {
    /// `A` by rows, `m * n` entries.
    pub matrix: &'a [f64],
    /// `b`, `m` entries.
    pub right: &'a [f64],
    /// `d`, > 0.
    pub damping: f64,
    /// `p`, `n` entries.
    pub preferred: &'a [f64],
    /// Least values, `n` entries.
    pub lower: &'a [f64],
    /// Greatest values, `n` entries, none below `lower`.
    pub upper: &'a [f64],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Free,
    Lower,
    Upper,
    /// The box is a point.
    Fixed,
}

/// Storage for problems of one size.
#[derive(Debug, Clone)]
pub struct BoundedLeastSquares {
    rows: usize,
    unknowns: usize,
    hessian: Vec<f64>,
    linear: Vec<f64>,
    factor: Vec<f64>,
    trial: Vec<f64>,
    free: Vec<usize>,
    side: Vec<Side>,
    solution: Vec<f64>,
}

impl BoundedLeastSquares {
    /// Storage for `rows` equations in `unknowns` unknowns.
    #[must_use]
    pub fn new(rows: usize, unknowns: usize) -> Self {
        Self {
            rows,
            unknowns,
            hessian: vec![0.0; unknowns * unknowns],
            linear: vec![0.0; unknowns],
            factor: vec![0.0; unknowns * unknowns],
            trial: vec![0.0; unknowns],
            free: Vec::with_capacity(unknowns),
            side: vec![Side::Free; unknowns],
            solution: vec![0.0; unknowns],
        }
    }

    /// The point found last.
    #[must_use]
    pub fn solution(&self) -> &[f64] {
        &self.solution
    }

    /// Minimises `problem`; the point is then in [`Self::solution`].
    ///
    /// A problem with numbers that are not finite ends unconverged at the preferred point clamped to the box,
    /// or at `lower` where even that is not finite.
    pub fn solve(&mut self, problem: &BoundedProblem<'_>) -> BoundedReport {
        self.assemble(problem);
        self.start(problem);
        let iterations_max = 4 * self.unknowns as u32 + 8;
        for iterations in 0..iterations_max {
            self.collect_free();
            if !self.minimise_over_free() {
                return self.report(problem, false, iterations);
            }
            if let Some(blocked) = self.advance(problem) {
                self.side[blocked.0] = blocked.1;
                continue;
            }
            match self.worst_held() {
                Some(index) => self.side[index] = Side::Free,
                None => return self.report(problem, true, iterations),
            }
        }
        self.report(problem, false, iterations_max)
    }

    fn report(&self, problem: &BoundedProblem<'_>, converged: bool, iterations: u32) -> BoundedReport {
        let bounds = problem.lower.iter().zip(problem.upper);
        let is_at_bound =
            |(side, (lower, upper)): &(&Side, (&f64, &f64))| **side != Side::Free && lower < upper;
        let at_bound = self.side.iter().zip(bounds).filter(is_at_bound).count() as u32;
        BoundedReport { converged, iterations, at_bound }
    }

    /// `H = A'A + d I`, `c = A'b + d p`.
    fn assemble(&mut self, problem: &BoundedProblem<'_>) {
        let n = self.unknowns;
        self.hessian.fill(0.0);
        for (linear, preferred) in self.linear.iter_mut().zip(problem.preferred) {
            *linear = problem.damping * preferred;
        }
        for (row, right) in problem.matrix.chunks_exact(n).zip(problem.right).take(self.rows) {
            for (i, left) in row.iter().enumerate() {
                self.linear[i] += left * right;
                for (entry, other) in self.hessian[i * n..=i * n + i].iter_mut().zip(row) {
                    *entry += left * other;
                }
            }
        }
        for i in 0..n {
            self.hessian[i * n + i] += problem.damping;
            for j in 0..i {
                self.hessian[j * n + i] = self.hessian[i * n + j];
            }
        }
    }

    /// The preferred point clamped to the box; unknowns with an empty interior are held from the start.
    fn start(&mut self, problem: &BoundedProblem<'_>) {
        for i in 0..self.unknowns {
            let (lower, upper) = (problem.lower[i], problem.upper[i]);
            let preferred = problem.preferred[i];
            let start = if preferred.is_finite() { preferred } else { lower };
            self.solution[i] = start.min(upper).max(lower);
            self.side[i] = if upper <= lower { Side::Fixed } else { Side::Free };
        }
    }

    fn collect_free(&mut self) {
        self.free.clear();
        for (index, side) in self.side.iter().enumerate() {
            if *side == Side::Free {
                self.free.push(index);
            }
        }
    }

    /// Solves `H_ff y = c_f - H_fb x_b` into `trial`; false when the factor breaks down (not finite).
    fn minimise_over_free(&mut self) -> bool {
        let n = self.unknowns;
        let count = self.free.len();
        for (a, &i) in self.free.iter().enumerate() {
            let mut right = self.linear[i];
            for (j, side) in self.side.iter().enumerate() {
                if *side != Side::Free {
                    right -= self.hessian[i * n + j] * self.solution[j];
                }
            }
            self.trial[a] = right;
            for (b, &j) in self.free.iter().enumerate().take(a + 1) {
                self.factor[a * n + b] = self.hessian[i * n + j];
            }
        }
        cholesky_solve(&mut self.factor, n, count, &mut self.trial)
    }

    /// Moves the free unknowns towards `trial` as far as the box allows; the first bound met, if any.
    fn advance(&mut self, problem: &BoundedProblem<'_>) -> Option<(usize, Side)> {
        let mut fraction = 1.0;
        let mut blocked = None;
        for (&index, &goal) in self.free.iter().zip(&self.trial) {
            let here = self.solution[index];
            let (bound, side) = if goal < problem.lower[index] {
                (problem.lower[index], Side::Lower)
            } else if goal > problem.upper[index] {
                (problem.upper[index], Side::Upper)
            } else {
                continue;
            };
            let reach = (bound - here) / (goal - here);
            if reach < fraction {
                fraction = reach.max(0.0);
                blocked = Some((index, side));
            }
        }
        for (&index, &goal) in self.free.iter().zip(&self.trial) {
            let here = self.solution[index];
            let moved = here + fraction * (goal - here);
            self.solution[index] = moved.min(problem.upper[index]).max(problem.lower[index]);
        }
        if let Some((index, side)) = blocked {
            let bound = if side == Side::Lower { problem.lower } else { problem.upper };
            self.solution[index] = bound[index];
        }
        blocked
    }

    /// The held unknown whose release lowers the cost most steeply.
    fn worst_held(&self) -> Option<usize> {
        let n = self.unknowns;
        let mut worst = None;
        // Rounding in the gradient must not release an unknown for ever: relative to its own terms.
        let mut steepest = 0.0;
        for (index, side) in self.side.iter().enumerate() {
            let row = &self.hessian[index * n..(index + 1) * n];
            let product: f64 = row.iter().zip(&self.solution).map(|(h, x)| h * x).sum();
            let size: f64 = row.iter().zip(&self.solution).map(|(h, x)| (h * x).abs()).sum();
            let gradient = product - self.linear[index];
            let noise = 1e-12 * (size + self.linear[index].abs());
            let descent = match side {
                Side::Free | Side::Fixed => continue,
                Side::Lower => -gradient,
                Side::Upper => gradient,
            };
            if descent > noise && descent > steepest {
                steepest = descent;
                worst = Some(index);
            }
        }
        worst
    }
}

/// Solves `F y = b` in place with the Cholesky factor of the leading `count` rows of `factor` (row
/// stride `stride`, lower triangle given); false when a pivot is not positive and finite.
fn cholesky_solve(factor: &mut [f64], stride: usize, count: usize, vector: &mut [f64]) -> bool {
    for i in 0..count {
        for j in 0..=i {
            let mut sum = factor[i * stride + j];
            for k in 0..j {
                sum -= factor[i * stride + k] * factor[j * stride + k];
            }
            if i == j {
                if !(sum > 0.0 && sum.is_finite()) {
                    return false;
                }
                factor[i * stride + i] = sum.sqrt();
            } else {
                factor[i * stride + j] = sum / factor[j * stride + j];
            }
        }
    }
    for i in 0..count {
        let mut sum = vector[i];
        for k in 0..i {
            sum -= factor[i * stride + k] * vector[k];
        }
        vector[i] = sum / factor[i * stride + i];
    }
    for i in (0..count).rev() {
        let mut sum = vector[i];
        for k in i + 1..count {
            sum -= factor[k * stride + i] * vector[k];
        }
        vector[i] = sum / factor[i * stride + i];
    }
    vector[..count].iter().all(|value| value.is_finite())
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    struct Case {
        rows: usize,
        unknowns: usize,
        matrix: Vec<f64>,
        right: Vec<f64>,
        damping: f64,
        preferred: Vec<f64>,
        lower: Vec<f64>,
        upper: Vec<f64>,
    }

    impl Case {
        fn random(random: &mut ChaCha8Rng) -> Self {
            let rows = random.random_range(1..8);
            let unknowns = random.random_range(1..20);
            let mut draw =
                |count: usize| -> Vec<f64> { (0..count).map(|_| random.random_range(-1.0..1.0)).collect() };
            let (matrix, right) = (draw(rows * unknowns), draw(rows));
            let (preferred, center, width) = (draw(unknowns), draw(unknowns), draw(unknowns));
            // A fifth of the boxes are points.
            let half = |width: f64| if width < -0.6 { 0.0 } else { width.abs() };
            let lower = center.iter().zip(&width).map(|(c, w)| c - half(*w)).collect();
            let upper = center.iter().zip(&width).map(|(c, w)| c + half(*w)).collect();
            Self { rows, unknowns, matrix, right, damping: 1e-3, preferred, lower, upper }
        }

        fn problem(&self) -> BoundedProblem<'_> {
            BoundedProblem {
                matrix: &self.matrix,
                right: &self.right,
                damping: self.damping,
                preferred: &self.preferred,
                lower: &self.lower,
                upper: &self.upper,
            }
        }

        /// Half the gradient of the cost, from the definition.
        fn gradient(&self, x: &[f64]) -> Vec<f64> {
            let residual: Vec<f64> = self
                .matrix
                .chunks_exact(self.unknowns)
                .zip(&self.right)
                .map(|(row, right)| row.iter().zip(x).map(|(a, x)| a * x).sum::<f64>() - right)
                .collect();
            (0..self.unknowns)
                .map(|j| {
                    let pull: f64 =
                        (0..self.rows).map(|i| self.matrix[i * self.unknowns + j] * residual[i]).sum();
                    pull + self.damping * (x[j] - self.preferred[j])
                })
                .collect()
        }
    }

    /// Goal: the point meets the optimality conditions of the box-constrained minimum, which are sufficient
    /// because the cost is strictly convex.
    #[test]
    fn solution_is_the_minimum_within_the_box() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..500 {
            let case = Case::random(&mut random);
            let mut solver = BoundedLeastSquares::new(case.rows, case.unknowns);
            let report = solver.solve(&case.problem());
            assert!(report.converged);
            let x = solver.solution();
            for (j, gradient) in case.gradient(x).iter().enumerate() {
                assert!(x[j] >= case.lower[j] && x[j] <= case.upper[j]);
                let (at_lower, at_upper) = (x[j] == case.lower[j], x[j] == case.upper[j]);
                // 1e-9: far above rounding of sums of twenty products of order one.
                assert!(at_lower || *gradient < 1e-9, "could decrease by lowering {j}");
                assert!(at_upper || *gradient > -1e-9, "could decrease by raising {j}");
            }
        }
    }

    /// Goal: a problem that is not finite ends inside the box and says so.
    #[test]
    fn not_finite_problem_stays_in_the_box_and_is_reported() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        for _ in 0..100 {
            let mut case = Case::random(&mut random);
            case.right[0] = f64::NAN;
            let mut solver = BoundedLeastSquares::new(case.rows, case.unknowns);
            let report = solver.solve(&case.problem());
            let movable = case.lower.iter().zip(&case.upper).any(|(lower, upper)| lower < upper);
            assert!(!(movable && report.converged));
            for (j, x) in solver.solution().iter().enumerate() {
                assert!(*x >= case.lower[j] && *x <= case.upper[j]);
            }
        }
    }
}
