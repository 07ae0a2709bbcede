//! The true magnetic field, written apart from the controller's.
//!
//! - `sample`: field and gradient at a point, and the wrench on a dipole there;
//! - `array`: the coils of the rig at their present currents and frame angles.

mod array;
mod sample;

pub use array::CoilArray;
pub use sample::{Field, Wrench};
