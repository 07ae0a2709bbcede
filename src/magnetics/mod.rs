//! Magnetic field of the coil array and the wrench on dipoles.

mod affine;
mod sample;

pub use affine::AffineField;
pub use sample::{
    AppliedField, FieldColumn, FieldGradient, FieldSample, FieldSecondGradient, PARAMETERS_MAX,
};
