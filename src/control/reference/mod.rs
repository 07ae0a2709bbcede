//! The reference that the loop follows: targets turned into one smooth path of directions and frame angles,
//! and remembered.
//!
//! A step of the target would shake the rod at its first mode, and directions that come early or late would
//! lead through pairs of angles that nobody asked for. `limited` moves every direction on its great circle,
//! and every frame angle with a goal, in one common time scale within limits of speed and acceleration; `lag`
//! rounds off what is left of the jerk; `shaped` ties the two together.

mod lag;
mod limited;
mod shaped;

pub use limited::Limits;
pub use shaped::{Pacing, Reference, ReferenceTarget};
