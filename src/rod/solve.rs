//! Equilibrium near a guess: Newton's method with backtracking.
//!
//! A strong pull makes shooting stiff: unknowns that are good to nine digits leave residuals of any size, and steps
//! that lessen the residual need not approach the solution. A fraction `f` of a step is therefore judged by
//! Deuflhard's natural monotonicity test, which does not depend on how the residual is scaled:
//! ```text
//! |J^-1 r(xi + f dxi)| <= (1 - f/4) |J^-1 r(xi)|,   dxi = -J^-1 r(xi),   J = dr/dxi at xi          (v1)
//! ```
//! (P. Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, section 3.3.)
//!
//! Bounded in every direction: iterations by configuration, halvings by [`HALVINGS_MAX`]. Not to converge is a value
//! that says why. Nothing here allocates, logs or panics.

use nalgebra::Vector6;

use crate::magnetics::AppliedField;
use crate::math::Triple;

use super::magnet::Wrenches;
use super::manipulator::Manipulator;
use super::pass::{Pass, PassMode, TipLoad};

/// Most halvings of one Newton step: below a thousandth of it nothing but rounding or a fold is left.
const HALVINGS_MAX: u32 = 10;

/// Newton step, relative to the unknowns, that rounding alone accounts for: the solution cannot be improved.
const STEP_MIN: f64 = 1e-14;

/// Whether an equilibrium was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The residual met its tolerance, or the unknowns cannot be improved in double precision.
    Converged,
    /// It did not.
    NotConverged {
        /// The reason.
        why: Failure,
    },
}

/// Why no equilibrium was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The bound on iterations or passes was reached.
    #[error("the bound on iterations was reached")]
    IterationsExhausted,
    /// The Jacobian of the residual has no usable inverse: the rod is at a buckling load.
    #[error("the Jacobian of the residual is singular")]
    SingularJacobian,
    /// The guess, a load or the field is not finite.
    #[error("a state or load is not finite")]
    NotFinite,
    /// No step along Newton's direction approaches a solution, or no smaller step of the load is
    /// followed: the equilibrium ends in a fold, or the tolerance is below rounding.
    #[error("no step comes closer to an equilibrium")]
    Stalled,
}

/// How a solve went. The equilibrium itself is in the [`Pass`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// Whether an equilibrium was found.
    pub outcome: Outcome,
    /// Newton iterations.
    pub iterations: u32,
    /// Shooting passes, rejected ones included.
    pub passes: u32,
    /// Scaled residual of the pass left behind.
    pub residual: f64,
    /// Fraction of gravity that was reached, then of the actuation and tip load; 1 and 1 for a solve near a guess.
    pub load_reached: [f64; 2],
    /// True when a step of a continuation passed a point where the equilibrium lost stability.
    pub lost_stability: bool,
}

impl Solution {
    /// True when an equilibrium was found.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.outcome == Outcome::Converged
    }
}

/// Field, gravity and tip load of one problem.
#[derive(Clone, Copy)]
pub(super) struct Loading<'a, F> {
    pub field: &'a F,
    pub gravity: Triple,
    pub load: TipLoad,
}

impl Manipulator {
    /// Solves for the equilibrium near the base unknowns `guess`. Leaves the last pass in `pass`: after convergence
    /// the equilibrium, its sensitivities as `mode` asks and its unknowns, the next guess.
    pub fn solve(
        &self,
        field: &impl AppliedField,
        load: &TipLoad,
        guess: &Vector6<f64>,
        mode: PassMode,
        pass: &mut Pass,
    ) -> Solution {
        let loading = Loading { field, gravity: self.gravity, load: *load };
        let solution = self.newton(&loading, guess, mode.poses, pass);
        self.finish(&loading, mode, pass);
        solution
    }

    /// Newton's iteration wants the true derivatives; a frozen-wrench Jacobian takes a pass of its own.
    pub(super) fn finish(&self, loading: &Loading<impl AppliedField>, mode: PassMode, pass: &mut Pass) {
        if mode.wrenches == Wrenches::Frozen {
            let unknowns = pass.unknowns;
            self.pass_under(loading.gravity, loading.field, &loading.load, &unknowns, mode, pass);
        }
    }

    fn scaled_norm(&self, unknowns: &Vector6<f64>) -> f64 {
        let force = unknowns.fixed_rows::<3>(0) / self.force_unit;
        let moment = unknowns.fixed_rows::<3>(3) / self.moment_unit;
        force.norm().hypot(moment.norm())
    }

    pub(super) fn newton(
        &self,
        loading: &Loading<impl AppliedField>,
        guess: &Vector6<f64>,
        poses: bool,
        pass: &mut Pass,
    ) -> Solution {
        let mode = PassMode { poses, wrenches: Wrenches::Following };
        let Loading { field, gravity, load } = loading;
        let run = |unknowns: &Vector6<f64>, pass: &mut Pass| {
            self.pass_under(*gravity, *field, load, unknowns, mode, pass);
            pass.residual()
        };
        let mut unknowns = *guess;
        let mut residual = run(&unknowns, pass);
        let (mut iterations, mut passes) = (0, 1);
        let outcome = loop {
            if !residual.is_finite() {
                break Outcome::NotConverged { why: Failure::NotFinite };
            }
            if residual <= self.options.residual_tolerance {
                break Outcome::Converged;
            }
            let (Some(step), Some(lu)) = (pass.newton_step, pass.jacobian) else {
                break Outcome::NotConverged { why: Failure::SingularJacobian };
            };
            let length = norm(&lu.solve(&pass.residual));
            if length <= STEP_MIN * (1.0 + self.scaled_norm(&unknowns)) {
                break Outcome::Converged;
            }
            if iterations == self.options.iterations_max {
                break Outcome::NotConverged { why: Failure::IterationsExhausted };
            }
            iterations += 1;
            let mut fraction = 1.0;
            let mut halvings = 0;
            let lessened = loop {
                let trial = unknowns + step * fraction;
                let found = run(&trial, pass);
                passes += 1;
                // (v1); false as well for a residual that is not a number.
                if norm(&lu.solve(&pass.residual)) <= (1.0 - 0.25 * fraction) * length {
                    (unknowns, residual) = (trial, found);
                    break true;
                }
                if halvings == HALVINGS_MAX {
                    break false;
                }
                halvings += 1;
                fraction *= 0.5;
            };
            if !lessened {
                residual = run(&unknowns, pass);
                passes += 1;
                break Outcome::NotConverged { why: Failure::Stalled };
            }
        };
        Solution { outcome, iterations, passes, residual, load_reached: [1.0, 1.0], lost_stability: false }
    }
}

fn norm(entries: &[f64; 6]) -> f64 {
    entries.iter().map(|entry| entry * entry).sum::<f64>().sqrt()
}
