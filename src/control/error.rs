//! Orientation error: two rows a magnet, and how they change with the magnet's tangent.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `t`, `d` | measured and desired tangent, unit | |
//! | `phi` | angle of rotation from global z, eq. (7) | rad |
//! | `k` | axis of rotation, `z x t` normalised, eq. (7) | |
//! | `L` | 2 x 3 map from a change of the tangent to the rows | rad |
//!
//! Two errors are offered. The paper's, eq. (17), is `(1 - k_d . k, phi_d - phi)`; its first row has no gradient where it
//! is zero and `phi` none at 0 and 180 degrees. The default is the direction and angle of the shortest turn from `t` to `d`, seen in the tangent
//! plane: `(e1 . log_t d, e2 . log_t d)`, regular everywhere but half a turn away from the goal.

use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::math::{logarithm, transported_basis};

/// Which error the controller drives to zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OrientationErrorKind {
    /// The shortest turn in the tangent plane.
    TangentPlane,
    /// The paper's, eq. (17).
    AxisAngle,
}

/// The error of one kind, for a manipulator clamped with a given rotation.
#[derive(Debug, Clone)]
pub struct OrientationError {
    kind: OrientationErrorKind,
    /// Columns of the clamp's rotation: the tangent plane's basis is carried from there.
    pole_basis: [Vector3<f64>; 3],
}

/// Below this sine of `phi` the axis of rotation is undefined and the rows of (16) are bounded instead.
const SINE_MIN: f64 = 1e-6;

impl OrientationError {
    /// An error of `kind`; `base_rotation` is the clamp's.
    #[must_use]
    pub fn new(kind: OrientationErrorKind, base_rotation: &Matrix3<f64>) -> Self {
        let pole_basis = [0, 1, 2].map(|column| base_rotation.column(column).into_owned());
        Self { kind, pole_basis }
    }

    /// The two rows of the error of one magnet.
    #[must_use]
    pub fn rows(&self, measured: &Vector3<f64>, desired: &Vector3<f64>) -> Vector2<f64> {
        match self.kind {
            OrientationErrorKind::TangentPlane => {
                let turn = logarithm(measured, desired);
                let [first, second] = transported_basis(&self.pole_basis, measured);
                Vector2::new(first.dot(&turn), second.dot(&turn))
            }
            OrientationErrorKind::AxisAngle => {
                let axis_desired = axis_of_rotation(desired).0;
                let (axis, angle) = signed_axis_angle(measured, &axis_desired);
                let angle_desired = signed_axis_angle(desired, &axis_desired).1;
                Vector2::new(1.0 - axis_desired.dot(&axis), angle_desired - angle) // (17)
            }
        }
    }

    /// `L` at a tangent: what a small change of the tangent does to the quantity that the rows count, so that
    /// `L dt/du` are the rows of the orientation Jacobian (16).
    #[must_use]
    pub fn map(&self, tangent: &Vector3<f64>, desired: &Vector3<f64>) -> Matrix2x3<f64> {
        match self.kind {
            OrientationErrorKind::TangentPlane => {
                let [first, second] = transported_basis(&self.pole_basis, tangent);
                Matrix2x3::from_rows(&[first.transpose(), second.transpose()])
            }
            OrientationErrorKind::AxisAngle => {
                let axis_desired = axis_of_rotation(desired).0;
                let (axis, sine) = axis_of_rotation(tangent);
                let sign = if axis.dot(&axis_desired) < 0.0 { -1.0 } else { 1.0 };
                // d(k_d . k) = k_d . (1 - k k') (z x dt) / sin(phi); a . (z x dt) = (a x z) . dt.
                let across = axis_desired - axis * axis.dot(&axis_desired);
                let axis_row = across.cross(&Vector3::z()) * (sign / sine);
                let angle_row = Vector3::z() * (-sign / sine); // phi = acos(t_z)
                Matrix2x3::from_rows(&[axis_row.transpose(), angle_row.transpose()])
            }
        }
    }

    /// By how much the quantities that the rows count change between two tangents: over the step of a parameter a column
    /// of the orientation Jacobian by differences.
    #[must_use]
    pub fn change(&self, from: &Vector3<f64>, to: &Vector3<f64>, desired: &Vector3<f64>) -> Vector2<f64> {
        match self.kind {
            // The error of `from`, were `to` desired.
            OrientationErrorKind::TangentPlane => self.rows(from, to),
            OrientationErrorKind::AxisAngle => {
                let axis_desired = axis_of_rotation(desired).0;
                let counted = |tangent| {
                    let (axis, _) = axis_of_rotation(tangent);
                    Vector2::new(axis_desired.dot(&axis), angle_of_rotation(tangent))
                };
                // One sign for both, so that a step across the axis's horizon is no leap.
                let sign = if axis_of_rotation(from).0.dot(&axis_desired) < 0.0 { -1.0 } else { 1.0 };
                (counted(to) - counted(from)) * sign // (15)
            }
        }
    }
}

/// Axis `z x t` normalised, and `sin(phi)` bounded from below; (7). The y axis where `t` is along z.
fn axis_of_rotation(tangent: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let across = Vector3::z().cross(tangent);
    let sine = across.norm();
    if sine < SINE_MIN { (Vector3::y(), SINE_MIN) } else { (across / sine, sine) }
}

/// Angle `phi` between global z and the tangent, 0 to pi; (7).
fn angle_of_rotation(tangent: &Vector3<f64>) -> f64 {
    Vector3::z().cross(tangent).norm().atan2(tangent.z)
}

/// Of the two descriptions `(k, phi)` and `(-k, -phi)` of a tangent, the one whose axis is nearer to the desired axis.
fn signed_axis_angle(tangent: &Vector3<f64>, axis_desired: &Vector3<f64>) -> (Vector3<f64>, f64) {
    let (axis, _) = axis_of_rotation(tangent);
    let angle = angle_of_rotation(tangent);
    if axis.dot(axis_desired) < 0.0 { (-axis, -angle) } else { (axis, angle) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planar(degrees: f64) -> Vector3<f64> {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        Vector3::new(sine, 0.0, cosine)
    }

    fn errors() -> [OrientationError; 2] {
        // Clamped along x, as BigMag's manipulator.
        let base = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0);
        [OrientationErrorKind::TangentPlane, OrientationErrorKind::AxisAngle]
            .map(|kind| OrientationError::new(kind, &base))
    }

    /// Goal: in the plane both errors are the difference of the angles, and zero at the goal.
    #[test]
    fn planar_error_is_the_difference_of_angles() {
        let (measured, desired) = (planar(70.0), planar(110.0));
        for error in errors() {
            let size = error.rows(&measured, &desired).norm();
            assert!((size - 40f64.to_radians()).abs() < 1e-12);
            assert!(error.rows(&desired, &desired).norm() < 1e-12);
        }
    }

    /// Goal: the map is the derivative of what the rows count, so minus the derivative of the error with the tangent,
    /// at the goal for the tangent-plane error and anywhere for the paper's.
    #[test]
    fn map_is_minus_the_derivative_of_the_error() {
        let step = 1e-6;
        let tangent = Vector3::new(0.8, 0.3, -0.5).normalize();
        let desired = Vector3::new(0.7, -0.2, 0.4).normalize();
        for (error, goal) in errors().iter().zip([tangent, desired]) {
            let map = error.map(&tangent, &goal);
            for direction in crate::math::orthonormal_complement(&tangent) {
                let moved = |size: f64| (tangent + direction * size).normalize();
                let difference =
                    (error.rows(&moved(step), &goal) - error.rows(&moved(-step), &goal)) / (2.0 * step);
                // Central differences of rows of order one: 1e-6^2 truncation, 1e-16/1e-6 rounding.
                assert!((map * direction + difference).norm() < 1e-8, "{:?}", error.kind);
            }
        }
    }

    /// Goal: the change between two tangents is what the map says, to first order.
    #[test]
    fn change_tends_to_the_map() {
        let tangent = Vector3::new(0.8, 0.3, -0.5).normalize();
        let desired = Vector3::new(0.7, -0.2, 0.4).normalize();
        for error in errors() {
            let map = error.map(&tangent, &desired);
            for direction in crate::math::orthonormal_complement(&tangent) {
                let moved = |size: f64| (tangent + direction * size).normalize();
                let change = (error.change(&tangent, &moved(1e-6), &desired)
                    - error.change(&tangent, &moved(-1e-6), &desired))
                    / 2e-6;
                // As in the differences above.
                assert!((map * direction - change).norm() < 1e-8, "{:?}", error.kind);
            }
        }
    }

    /// Goal: the tangent-plane error sees an error out of the plane at the goal; the paper's first row does not.
    #[test]
    fn only_the_tangent_plane_error_is_regular_at_its_goal() {
        let [tangent_plane, axis_angle] = errors();
        let goal = planar(90.0);
        let out_of_plane = Vector3::y();
        assert!((tangent_plane.map(&goal, &goal) * out_of_plane).norm() > 0.999);
        assert!((axis_angle.map(&goal, &goal) * out_of_plane).norm() < 1e-12);
    }
}
