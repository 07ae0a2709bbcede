//! Sensors: what becomes of the true shape on its way to a pose message.
//!
//! - `tracker`: sees the magnets' poses directly, at a rate, with noise and latency.

mod tracker;

pub(crate) use tracker::message_of;
pub use tracker::{PoseSensor, SensorCharacter};
