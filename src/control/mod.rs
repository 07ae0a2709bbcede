//! The controller: from measured tangents to requested currents and angles.
//!
//! `reference` shapes the targets; `feedback` decides what they are compared with: late measurements, or the model with its bias
//! as `disturbance` estimates it. `smoothing` takes the noise off what the model is given, `gains` learns how far the rod bends
//! under it. `scout` looks ahead to a new target before the reference goes there. `error` compares tangents, `integral` turns the
//! error into a wanted velocity, `allocation` spreads it over currents and frame angles within their limits, and `cycle` ties
//! them to the model's statics and orientation Jacobian (`jacobian`): the exact one, or the paper's `algorithm_1`. What a cycle
//! is given and decides is in `step`. Between runs, [`plan`] chooses frame angles and ways, and [`identification`] estimates what
//! the model should believe in.
//! What is absent: a clock, a channel, an allocation after construction (but between runs).

mod algorithm_1;
mod allocation;
mod config;
mod cycle;
mod disturbance;
mod error;
mod feedback;
mod gains;
pub mod identification;
mod integral;
mod jacobian;
mod model;
mod past;
pub mod plan;
mod probe;
mod reference;
mod scout;
mod secondary;
mod smoothing;
mod step;

#[cfg(test)]
mod tests;

pub use algorithm_1::{Algorithm1, Algorithm1Config, HeldPose, JacobianKind, PoseSource, Present, Progress};
pub use allocation::{Allocated, Allocation, AllocationKind, Wish};
pub use config::{ControlConfig, FrameUse};
pub use cycle::Cycle;
pub use disturbance::{Disturbance, DisturbanceConfig};
pub use error::{OrientationError, OrientationErrorKind};
pub use feedback::FeedbackKind;
pub use gains::GainsConfig;
pub use integral::ProportionalIntegral;
pub use model::Model;
pub use reference::{Limits, Pacing, Reference, ReferenceTarget};
pub use scout::{ScoutConfig, Verdict, margin_allowed};
pub use secondary::{MarginGuardConfig, SecondaryConfig};
pub use step::{CycleInput, CycleOutcome, Directions, Equilibrium, ModelReport, Step};
