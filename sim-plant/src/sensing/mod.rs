//! Sensors: what becomes of the true shape on its way to a pose message.
//!
//! - `tracker`: sees the magnets' poses directly, with noise;
//! - `stereo`: two cameras see points on the rod's surface, with noise, outliers and a hidden stretch; the
//!   shape is reconstructed by [`magsteer_hal::shape::CloudShape`], as on a real rig;
//! - `fibre`: feels curvature along the rod, with noise; integrated by
//!   [`magsteer_hal::shape::CurvatureShape`];
//! - `exposures`: when they look, and what is under way to the message's receiver;
//! - `sensor`: the one that is mounted.
//!
//! A reconstruction takes about a millisecond, within the plant's step: the real-time process then publishes
//! feedback that much later, thirty times a second.
//!
//! Equations, sources, what is left out and what each attains: `docs/sensing.md`.

mod exposures;
mod fibre;
mod sensor;
mod stereo;
mod tracker;

pub use exposures::Timing;
pub use fibre::FibreCharacter;
pub use sensor::{PoseSensor, SensorError, SensorSettings};
pub use stereo::{Occlusion, StereoCharacter};
pub use tracker::TrackerCharacter;
pub(crate) use tracker::message_of;
