//! The simulated rig: a second physics, written apart from the controller's, that stands in for
//! real coils, motors, manipulator and sensors.
//!
//! It is truth, not a mirror. The controller's library and this one never import each other: they
//! meet in the channels and in one hardware description, so a wrong equation on either side shows
//! up as a disagreement.
//!
//! Start reading at [`plant`]: one fixed step advances guard, amplifiers, motors, field, rod and
//! sensor. [`process`] runs it against the machine's clock behind the channels; [`rig`] offers the
//! same plant in-process, in lockstep, as a [`magsteer_hal::Hardware`].
//!
//! Conventions: SI units, radians and the world frame inside; configuration keys end in their unit.
//! Everything random comes from one seed, so that a run can be repeated bit for bit.

pub mod actuation;
pub mod config;
pub mod errors;
mod faults;
pub mod field;
#[cfg(test)]
mod fixture;
pub mod plant;
pub mod process;
pub mod ramp;
pub mod rig;
pub mod rod;
pub mod sensing;

pub use config::PlantConfig;
pub use plant::Plant;
pub use rig::SimulatedRig;
