//! What a field is at a point, and what it does to a dipole.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

/// Magnetic constant, T m / A, as in the SI before 2019; that of today differs by 2e-10 of itself.
pub(super) const MU0: f64 = 4e-7 * PI;

/// Field and gradient at a point, world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Field {
    /// B, T.
    pub flux: Vector3<f64>,
    /// `dB_i/dx_j`, T/m; symmetric and traceless.
    pub gradient: Matrix3<f64>,
    /// False when the point lies nearer to some driven coil than its series holds.
    pub valid: bool,
}

/// Force and torque on a rigid body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// N, world.
    pub force: Vector3<f64>,
    /// N m, world, about the dipole's own centre.
    pub torque: Vector3<f64>,
}

impl Field {
    /// No field anywhere.
    #[must_use]
    pub fn zero() -> Self {
        Self { flux: Vector3::zeros(), gradient: Matrix3::zeros(), valid: true }
    }

    /// Wrench on a dipole (moment in A m^2, world): torque `mu x B`, force `G mu`.
    #[must_use]
    pub fn wrench(&self, moment: &Vector3<f64>) -> Wrench {
        Wrench { force: self.gradient * moment, torque: moment.cross(&self.flux) }
    }
}
