//! Magnetic field of the coil array and the wrench on dipoles.
//!
//! - `sample`: the field at a point and its changes, the contract with the rod's statics.
//! - `multipole`: one coil's field with both gradients, two coils at a time.
//! - `array`: coils on turning frames, and the columns of every actuation parameter.
//! - `validity`: where the series of the coils hold.
//! - `wrench`: dipoles, and the actuation matrix of eq. (13).
//! - `affine`: a uniform field and gradient in place of an array.
//! - [`fit`]: the coils' coefficients from measurements.
//! - `mpem`: calibrations of multipole electromagnet models, as other systems keep them.

mod affine;
mod array;
pub mod fit;
#[cfg(feature = "mpem")]
pub mod mpem;
mod multipole;
mod sample;
mod validity;
mod wrench;

pub use affine::AffineField;
pub use array::{ActuatedArray, CoilArray, PosedArray};
pub use multipole::{CoilField, CoilPose, Multipole};
pub use sample::{
    AppliedField, FieldColumn, FieldGradient, FieldSample, FieldSecondGradient, PARAMETERS_MAX,
};
pub use validity::OutsideModel;
pub use wrench::{ActuationMatrix, Dipole, Wrench, field_to_wrench, gradient_to_force, stacked_field};
