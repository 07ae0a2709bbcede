//! Where a cross-section is, how it is turned, and what it transmits.

use nalgebra::{Matrix3, Vector3};

use crate::math::Triple;

/// A body frame by its axes in world; the third one is the tangent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// First transverse axis, unit.
    pub d1: Triple,
    /// Second transverse axis, unit, `tangent x d1`.
    pub d2: Triple,
    /// Tangent, unit, towards the tip.
    pub tangent: Triple,
}

impl Frame {
    /// The frame whose rotation from body to world has these rows.
    #[must_use]
    pub fn from_rows(rows: &[[f64; 3]; 3]) -> Self {
        let column = |j: usize| Triple::new(rows[0][j], rows[1][j], rows[2][j]);
        Self { d1: column(0), d2: column(1), tangent: column(2) }
    }

    /// A vector given in body axes, in world.
    #[inline(always)]
    #[must_use]
    pub fn to_world(self, body: Triple) -> Triple {
        self.d1.scaled(body.x) + self.d2.scaled(body.y) + self.tangent.scaled(body.z)
    }

    /// Rotation from body to world.
    #[must_use]
    pub fn rotation(&self) -> Matrix3<f64> {
        let columns: [Vector3<f64>; 3] = [self.d1.into(), self.d2.into(), self.tangent.into()];
        Matrix3::from_columns(&columns)
    }

    /// Cosine of the angle of the rotation that takes `other` to `self`.
    #[must_use]
    pub fn cosine_to(&self, other: &Self) -> f64 {
        let trace = self.d1.dot(other.d1) + self.d2.dot(other.d2) + self.tangent.dot(other.tangent);
        0.5 * (trace - 1.0)
    }
}

/// A cross-section's pose and what the part beyond it exerts on it. World frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Centre of the cross-section, m.
    pub position: Triple,
    /// Its orientation.
    pub frame: Frame,
    /// Internal force `n`, N.
    pub force: Triple,
    /// Internal moment `m`, N m.
    pub moment: Triple,
}
