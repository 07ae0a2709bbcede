//! What turns set points into currents and angles.
//!
//! - `actuators`: all of them, followed as one;
//! - `amplifier`: a coil's circuit and the current controller that drives it;
//! - `motor`: turns a frame.

mod actuators;
mod amplifier;
mod motor;

pub use actuators::{ActuationSettings, Actuators};
pub use amplifier::Amplifier;
pub use motor::Motor;
