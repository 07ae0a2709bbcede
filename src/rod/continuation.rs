//! Equilibrium from nothing: loads are raised step by step from the unloaded rod, whose base unknowns are zero.
//!
//! A cold Newton iteration may fail, or worse, find an equilibrium that the rod would never reach. Raising first
//! gravity, then actuation and tip load together, in steps that turn no part by more than a set angle, follows the
//! branch connected to rest. A step that fails is halved; one that succeeds with ease doubles the next. Bounded in passes and
//! in the smallest step; to fail is an outcome that says how far the loads came.
//!
//! Where an equilibrium loses stability `det(dr/dxi)` vanishes ([`Pass::determinant`]): a step that nears such a point
//! fast, or jumps to where the determinant is much different, is halved, so that an imperfect rod is followed around
//! the bifurcation. An exactly symmetric one stays an equilibrium beyond it, at which two modes may turn unstable at once and leave the
//! determinant's sign: the unstable modes of every step's end are counted. The continuation reports a loss and goes on.

use nalgebra::{Vector3, Vector6};

use crate::magnetics::{AppliedField, FieldColumn, FieldGradient, FieldSample, FieldSecondGradient};

use crate::math::Triple;

use super::magnet::Wrenches;
use super::manipulator::Manipulator;
use super::pass::{Pass, PassMode, TipLoad};
use super::solve::{Failure, Loading, Outcome, Solution};

/// Least step of a load, as a fraction of the whole; a fold lies closer than that.
const STEP_MIN: f64 = 1e-7;

/// First step. Stability could be lost and regained unseen within a step as large as the whole load.
const STEP_FIRST: f64 = 0.125;

/// Step at which a determinant that still shrinks or changes its sign is taken for a true loss of stability.
const STEP_CROSSING: f64 = 1e-5;

/// Greatest ratio by which the determinant may change in a step.
const DETERMINANT_RATIO: f64 = 3.0;

/// Share of the extrapolated way to the determinant's zero that one step may take.
const DISTANCE_SHARE: f64 = 0.6;

/// A field times a factor: actuation on its way from none to all. Its columns stay derivatives with
/// the parameters of `field`.
#[derive(Debug, Clone, Copy)]
pub struct Scaled<'a, F> {
    /// The whole field.
    pub field: &'a F,
    /// From 0 to 1.
    pub factor: f64,
}

impl<F: AppliedField> AppliedField for Scaled<'_, F> {
    fn parameter_count(&self) -> usize {
        self.field.parameter_count()
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        self.field.evaluate(point, sample);
        sample.field *= self.factor;
        sample.gradient = scaled(&sample.gradient, self.factor);
        let FieldSecondGradient { xxx, xxy, xxz, xyy, xyz, yyy, yyz } = &mut sample.second_gradient;
        for entry in [xxx, xxy, xxz, xyy, xyz, yyy, yyz] {
            *entry *= self.factor;
        }
        for FieldColumn { field, gradient } in &mut sample.columns[..self.field.parameter_count()] {
            *field *= self.factor;
            *gradient = scaled(gradient, self.factor);
        }
    }
}

fn scaled(gradient: &FieldGradient, factor: f64) -> FieldGradient {
    let FieldGradient { xx, xy, xz, yy, yz } = *gradient;
    FieldGradient { xx: xx * factor, xy: xy * factor, xz: xz * factor, yy: yy * factor, yz: yz * factor }
}

/// What is raised; the one before it is there in full, the one after it not at all.
#[derive(Clone, Copy)]
enum Phase {
    Gravity,
    ActuationAndTipLoad,
}

/// The whole of the loads, to be taken in part.
struct Whole<'a, F> {
    field: &'a F,
    gravity: Triple,
    load: TipLoad,
}

impl<'a, F: AppliedField> Whole<'a, F> {
    fn part(&self, phase: Phase, fraction: f64) -> Part<'a, F> {
        let (gravity, factor) = match phase {
            Phase::Gravity => (self.gravity.scaled(fraction), 0.0),
            Phase::ActuationAndTipLoad => (self.gravity, fraction),
        };
        let load = TipLoad { force: self.load.force * factor, moment: self.load.moment * factor };
        Part { field: Scaled { field: self.field, factor }, gravity, load }
    }
}

/// A part of the loads.
struct Part<'a, F> {
    field: Scaled<'a, F>,
    gravity: Triple,
    load: TipLoad,
}

impl<'a, F: AppliedField> Part<'a, F> {
    fn loading(&self) -> Loading<'_, Scaled<'a, F>> {
        Loading { field: &self.field, gravity: self.gravity, load: self.load }
    }
}

impl Manipulator {
    /// Solves for the equilibrium that the rod reaches when gravity, then actuation and tip load, rise from zero.
    /// Leaves in `pass` the equilibrium, or the last one on the way to it.
    pub fn solve_from_rest(
        &self,
        field: &impl AppliedField,
        load: &TipLoad,
        mode: PassMode,
        pass: &mut Pass,
    ) -> Solution {
        let whole = Whole { field, gravity: self.gravity, load: *load };
        let rest = whole.part(Phase::Gravity, 0.0);
        let mut solution = self.newton(&rest.loading(), &Vector6::zeros(), mode.poses, pass);
        solution.load_reached = [0.0, 0.0];
        for phase in [Phase::Gravity, Phase::ActuationAndTipLoad] {
            if solution.converged() {
                self.raise(phase, &whole, mode, &mut solution, pass);
            }
        }
        solution
    }

    /// Raises one sort of load from none to all, from the equilibrium in `pass`.
    fn raise(
        &self,
        phase: Phase,
        whole: &Whole<impl AppliedField>,
        mode: PassMode,
        solution: &mut Solution,
        pass: &mut Pass,
    ) {
        let mut unknowns = pass.unknowns;
        let stable = self.unstable_modes(pass) == 0;
        let mut pace = Pace::new(self.options.rotation_step_max, pass.determinant, stable);
        let reached = &mut solution.load_reached[phase as usize];
        accept(pass);
        while *reached < 1.0 {
            let target = f64::min(*reached + pace.step, 1.0);
            let trial = self.newton(&whole.part(phase, target).loading(), &unknowns, mode.poses, pass);
            solution.passes += trial.passes;
            solution.iterations += trial.iterations;
            let unstable = trial.converged() && self.unstable_modes(pass) > 0;
            let found = Found {
                converged: trial.converged(),
                cosine: least_cosine(pass),
                determinant: pass.determinant,
                unstable,
            };
            let verdict = pace.judge(&found, target - *reached);
            if verdict != Verdict::Rejected {
                *reached = target;
                unknowns = pass.unknowns;
                solution.residual = trial.residual;
                solution.lost_stability |= verdict == Verdict::Crossed;
                accept(pass);
                continue;
            }
            let exhausted = solution.passes >= self.options.passes_max;
            if exhausted || pace.step < STEP_MIN {
                let why = match trial.outcome {
                    _ if exhausted => Failure::IterationsExhausted,
                    Outcome::NotConverged { why: Failure::NotFinite } => Failure::NotFinite,
                    _ => Failure::Stalled,
                };
                solution.outcome = Outcome::NotConverged { why };
                break;
            }
        }
        let there = whole.part(phase, *reached);
        if solution.outcome != Outcome::Converged || mode.wrenches == Wrenches::Frozen {
            let Loading { field, gravity, load } = there.loading();
            self.pass_under(gravity, field, &load, &unknowns, mode, pass);
            solution.passes += 1;
            solution.residual = pass.residual();
        }
    }
}

/// What became of a trial step.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Verdict {
    /// Part of the branch.
    Accepted,
    /// Part of the branch beyond a loss of stability.
    Crossed,
    /// Too far away, or no equilibrium; the step is smaller now.
    Rejected,
}

/// Where a trial step led to.
struct Found {
    converged: bool,
    /// Cosine of the greatest rotation of a part's end.
    cosine: f64,
    determinant: f64,
    /// True when the equilibrium has an unstable mode.
    unstable: bool,
}

/// Chooses the steps of a load and judges what they lead to.
struct Pace {
    /// Next step, as a fraction of the load.
    step: f64,
    cosine_min: f64,
    cosine_easy: f64,
    determinant: f64,
    /// True while the branch has been stable all the way.
    stable: bool,
}

impl Pace {
    fn new(rotation_step_max: f64, determinant: f64, stable: bool) -> Self {
        let (cosine_min, cosine_easy) = (rotation_step_max.cos(), (0.5 * rotation_step_max).cos());
        Self { step: STEP_FIRST, cosine_min, cosine_easy, determinant, stable }
    }

    fn judge(&mut self, found: &Found, step: f64) -> Verdict {
        let &Found { converged, cosine, determinant, unstable } = found;
        // Written so that a number that is none rejects.
        if !(converged && cosine >= self.cosine_min) {
            self.step = 0.5 * step;
            return Verdict::Rejected;
        }
        let ratio = determinant / self.determinant;
        let steady = (1.0 / DETERMINANT_RATIO..=DETERMINANT_RATIO).contains(&ratio);
        if self.stable && (unstable || !steady) {
            if step > STEP_CROSSING {
                self.step = 0.5 * step;
                return Verdict::Rejected;
            }
            // Stability is lost without a fold: a symmetric rod goes on, unstable.
            self.stable = false;
        }
        self.step = if cosine >= self.cosine_easy { 2.0 * step } else { step };
        let fall = self.determinant - determinant;
        if self.stable && fall > 0.0 {
            // Stay well short of where the determinant, were it linear, would vanish.
            self.step = self.step.min((DISTANCE_SHARE * step * determinant / fall).max(STEP_CROSSING));
        }
        self.determinant = determinant;
        if self.stable { Verdict::Accepted } else { Verdict::Crossed }
    }
}

/// Notes how every part's end is turned.
fn accept(pass: &mut Pass) {
    for (accepted, state) in pass.accepted.iter_mut().zip(&pass.states) {
        *accepted = state.frame;
    }
}

/// Cosine of the greatest rotation of a part's end since the last accepted step.
fn least_cosine(pass: &Pass) -> f64 {
    let turns = pass.accepted.iter().zip(&pass.states);
    turns.map(|(accepted, state)| state.frame.cosine_to(accepted)).fold(1.0, f64::min)
}
