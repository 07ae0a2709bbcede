//! What a controller is to the loop: what it is given in a cycle, what it decides, and the trait between the two.

use std::sync::Arc;

use magsteer_hal::{Actuation, COILS_MAX, MAGNETS_MAX, PoseMessage};
use rayon::{ThreadPool, ThreadPoolBuildError};

use super::reference::ReferenceTarget;
use super::scout::Verdict;

/// Unit vectors, one a magnet, base to tip; entries past the rig's magnets are zero.
pub type Directions = [[f64; 3]; MAGNETS_MAX];

/// What a cycle works from.
#[derive(Debug, Clone, Copy)]
pub struct CycleInput {
    /// Time since the previous cycle, s.
    pub period: f64,
    /// Newest valid poses, `None` before the first.
    pub pose: Option<PoseMessage>,
    /// True when `pose` is new since the previous cycle.
    pub pose_is_fresh: bool,
    /// Time since `pose` was true, s; 0 without one.
    pub pose_age: f64,
    /// Measured currents and angles; the last admitted ones when nothing was measured.
    pub measured: Actuation,
    /// Currents and angles admitted last.
    pub admitted: Actuation,
    /// Desired tangents, and where the frames shall stand if that is asked for.
    pub target: ReferenceTarget,
    /// True to steer; false to follow the model along and integrate nothing.
    pub engaged: bool,
}

/// How the model fared in a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelReport {
    /// True when the residual met its tolerance at the measured actuation, and the Jacobian in use is no older than it may be.
    pub converged: bool,
    /// Scaled residual of the boundary-value problem, at an actuation on the way while a jump is caught up; not a number where
    /// there is none.
    pub residual: f64,
    /// Shooting passes spent.
    pub passes: u32,
    /// Cycles since the equilibrium to which the Jacobian in use belongs; 0 when it is this cycle's.
    pub jacobian_age: u32,
    /// Margin of stability of the last good equilibrium: 1 for the unloaded rod, 0 where it snaps through, negative beyond.
    pub margin: f64,
    /// Number of ways in which the rod would leave that equilibrium by itself; 0 when it is stable.
    pub unstable_modes: u32,
    /// False when a magnet lies outside the field model's range.
    pub field_valid: bool,
}

/// The equilibrium that the model is at, by what another model of the same rig needs to be there too.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Equilibrium {
    /// Currents and angles: those measured, smoothed where the configuration says so.
    pub actuation: Actuation,
    /// Force that the manipulator transmits at the clamp, the sum of all loads, N, world.
    pub base_force: [f64; 3],
    /// Moment that it transmits there, N m, world.
    pub base_moment: [f64; 3],
}

/// What a cycle decided.
#[derive(Debug, Clone, Copy)]
pub struct CycleOutcome {
    /// Currents and angles asked of the gate.
    pub request: Actuation,
    /// Reference followed in this cycle.
    pub desired: Directions,
    /// Measured tangents; zero before the first pose.
    pub measured: Directions,
    /// Target that the reference goes to: the one asked for, once its way was looked at.
    pub in_force: ReferenceTarget,
    /// What is known of the way to the target asked for.
    pub verdict: Verdict,
    /// Tangents that the model predicts for the present actuation.
    pub predicted: Directions,
    /// Where the model was.
    pub equilibrium: Equilibrium,
    /// Bias of the model: of every magnet the rotation vector from its predicted tangent to where it is taken
    /// to be, rad, world; zero where it is not estimated.
    pub bias: [[f64; 3]; MAGNETS_MAX],
    /// Gains of the coils that the model was computed with; 1 past the last coil, and where they are not learnt.
    pub gains: [f64; COILS_MAX],
    /// The model's health.
    pub model: ModelReport,
    /// Ratio of the largest to the smallest singular value in use of the scaled Jacobian.
    pub condition: f64,
    /// Actuation parameters at a limit of value or rate.
    pub saturated: u32,
}

impl CycleOutcome {
    /// Asks for `request` with nothing amiss, every tangent along z: for a controller without a model, such as a scripted one.
    #[must_use]
    pub const fn asking_for(request: Actuation) -> Self {
        const UP: Directions = [[0.0, 0.0, 1.0]; MAGNETS_MAX];
        Self {
            request,
            desired: UP,
            in_force: ReferenceTarget { directions: UP, frame_angles: None },
            verdict: Verdict::Unchecked,
            measured: UP,
            predicted: UP,
            equilibrium: Equilibrium { actuation: request, base_force: [0.0; 3], base_moment: [0.0; 3] },
            bias: [[0.0; 3]; MAGNETS_MAX],
            gains: [1.0; COILS_MAX],
            model: ModelReport {
                converged: true,
                residual: 0.0,
                passes: 1,
                jacobian_age: 0,
                margin: 1.0,
                unstable_modes: 0,
                field_valid: true,
            },
            condition: 1.0,
            saturated: 0,
        }
    }
}

/// Why a cycle asks to be stopped is judged by the supervisor from the outcome; a step itself cannot fail.
pub trait Step {
    /// Starts the threads that share this controller's work, each with a stack of `stack_bytes`; `None` when it works alone.
    /// Called once, in the loop's thread, before the first step; the loop then runs inside of the pool.
    ///
    /// # Errors
    /// When the system refuses a thread.
    fn start_workers(
        &mut self,
        _stack_bytes: usize,
    ) -> Result<Option<Arc<ThreadPool>>, ThreadPoolBuildError> {
        Ok(None)
    }

    /// Runs one cycle. Never panics, allocates nothing.
    fn step(&mut self, input: &CycleInput) -> CycleOutcome;
}
