//! One control cycle: a pure function of what was sensed, with state of its own.
//!
//! What is absent: a clock, a channel, an allocation after construction, a lock, a log, a panic.

use magsteer_hal::{Actuation, MAGNETS_MAX, PoseMessage};

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
    /// Desired tangents.
    pub target: Directions,
    /// True to steer; false to follow the model along and integrate nothing.
    pub engaged: bool,
}

/// How the model fared in a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ModelReport {
    /// True when the residual met its tolerance.
    pub converged: bool,
    /// Scaled residual of the boundary-value problem before this cycle's correction.
    pub residual: f64,
    /// Shooting passes spent.
    pub passes: u32,
    /// Cycles since the Jacobian in use was computed; 0 when it is this cycle's.
    pub jacobian_age: u32,
    /// False when a magnet lies outside the field model's range.
    pub field_valid: bool,
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
    /// Tangents that the model predicts for the present actuation.
    pub predicted: Directions,
    /// The model's health.
    pub model: ModelReport,
    /// Ratio of the largest to the smallest singular value in use of the scaled Jacobian.
    pub condition: f64,
    /// Actuation parameters at a limit of value or rate.
    pub saturated: u32,
}

/// Why a cycle asks to be stopped is judged by the supervisor from the outcome; a step itself cannot fail.
pub trait Step {
    /// Runs one cycle. Never panics, allocates nothing.
    fn step(&mut self, input: &CycleInput) -> CycleOutcome;
}
