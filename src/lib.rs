//! magsteer: steers soft continuum manipulators that carry permanent magnets with an array of mobile electromagnets.
//!
//! Inside the library everything is SI, radians and world frame, unless a name's suffix says otherwise.
//!
//! Layers; a module may import only from those before it:
//! `math < magnetics < rod < control < daemon < config < recording < live < tunnel < cli < main`.

pub mod config;
pub mod control;
pub mod daemon;
pub mod live;
pub mod magnetics;
pub mod math;
#[cfg(feature = "record")]
pub mod recording;
pub mod rod;
pub mod tunnel;
