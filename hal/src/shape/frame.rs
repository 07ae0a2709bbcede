//! A frame carried along the centreline: constant curvature and twist over a length, exactly.
//!
//! With `v = length (k_x, k_y, twist)` in body axes, `R <- R exp(v^)` and
//! `p <- p + length R [1 + (1 - cos |v|) / |v|^2 v^ + (|v| - sin |v|) / |v|^3 v^ v^] e_z`.

use nalgebra::{Matrix3, Vector3};

use crate::description::ManipulatorDescription;

/// Below this squared angle, series replace the closed forms: the first term left out is under 1e-15.
const SERIES_BELOW: f64 = 1e-4;

/// Position, and rotation from body to world; body z is the tangent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub position: Vector3<f64>,
    pub rotation: Matrix3<f64>,
}

impl Frame {
    /// The clamp of a manipulator.
    pub fn of_base(manipulator: &ManipulatorDescription) -> Self {
        Self {
            position: Vector3::from(manipulator.base_position),
            rotation: Matrix3::from_row_iterator(manipulator.base_rotation.into_iter().flatten()),
        }
    }

    /// Body z, world.
    pub fn tangent(&self) -> Vector3<f64> {
        self.rotation.column(2).into_owned()
    }

    /// The frame `length` further on, under a constant `curvature` (1/m, body axes; z is twist).
    pub fn advanced(&self, curvature: &Vector3<f64>, length: f64) -> Self {
        let v = curvature * length;
        let squared = v.norm_squared();
        let (sine, cosine_gap, sine_gap) = if squared < SERIES_BELOW {
            (
                1.0 - squared / 6.0 * (1.0 - squared / 20.0),
                0.5 - squared / 24.0 * (1.0 - squared / 30.0),
                (1.0 - squared / 20.0 * (1.0 - squared / 42.0)) / 6.0,
            )
        } else {
            let angle = squared.sqrt();
            let (sine, cosine) = angle.sin_cos();
            (sine / angle, (1.0 - cosine) / squared, (angle - sine) / (squared * angle))
        };
        let across = v.cross(&Vector3::z());
        let chord = Vector3::z() + across * cosine_gap + v.cross(&across) * sine_gap;
        let skew = v.cross_matrix();
        let turn = Matrix3::identity() + skew * sine + skew * skew * cosine_gap;
        Self { position: self.position + self.rotation * chord * length, rotation: self.rotation * turn }
    }
}
