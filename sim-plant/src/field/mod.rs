//! The true magnetic field, written apart from the controller's.
//!
//! - `sample`: field and gradient at a point, and the wrench on a dipole there;
//! - `dipole`: a point dipole, for magnets that act on each other;
//! - `array`: the coils of the rig at their present currents and frame angles.

mod array;
mod dipole;
mod sample;

pub use array::CoilArray;
pub use dipole::Dipole;
pub use sample::{Field, Wrench};
