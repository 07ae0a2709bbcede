//! Eq. (7): from the tangent of a magnet to its orientation.
//!
//! | symbol | meaning |
//! |---|---|
//! | `z` | global vertical axis, to which an orientation refers |
//! | `p'` | tangent of the centreline at the magnet, unit |
//! | `phi`, `k` | angle and unit axis of the turn that takes `z` to `p'` |
//! | `k_d` | desired axis |
//! | `q` | `(k sin(phi / 2), cos(phi / 2))` |
//!
//! Departures from the paper, which prints `phi = acos(z . p')` and `k = z x p'`:
//! - `k` is normalised, else `q` is no rotation;
//! - `phi` comes from the arc tangent of sine and cosine: the arc cosine loses half the digits at 0 and 180
//!   degrees;
//! - at 0 and 180 degrees `z x p'` vanishes. Any horizontal axis serves there; that of `k_d` is taken, or x
//!   when `k_d` is vertical. At 0 the orientation is the identity whatever the axis. At 180 the axis matters:
//!   body x turns over with it, while the tangent, and so an axial moment, stays.
//!
//! The sign rule: of `(k, phi)` and `(-k, -phi)` the one whose axis is nearer to `k_d` is taken. Both are the
//! same turn, so `q` does not depend on it; the errors of eq. (17) do.

use nalgebra::Vector3;

/// Below this sine of `phi` the axis is taken from `k_d`: rounding of a unit tangent would decide it.
const SINE_MIN: f64 = 1e-12;

/// A turn that takes global z to a tangent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisAngle {
    /// `k`, unit, horizontal.
    pub axis: [f64; 3],
    /// `phi`, negative when the sign rule turned the axis round.
    pub angle_rad: f64,
}

impl AxisAngle {
    /// The turn to `tangent` (of any length but zero) whose axis is nearest to `desired_axis`.
    #[must_use]
    pub fn of_tangent(tangent: [f64; 3], desired_axis: [f64; 3]) -> Self {
        let tangent = Vector3::from(tangent);
        let desired = Vector3::from(desired_axis);
        let across = Vector3::z().cross(&tangent);
        let sine = across.norm();
        let angle = sine.atan2(tangent.z); // (7)
        let axis = if sine > SINE_MIN * tangent.norm() { across / sine } else { horizontal(&desired) }; // (7)
        if axis.dot(&desired) < 0.0 {
            Self { axis: (-axis).into(), angle_rad: -angle }
        } else {
            Self { axis: axis.into(), angle_rad: angle }
        }
    }

    /// `q` as x, y, z, w.
    #[must_use]
    pub fn orientation_xyzw(&self) -> [f64; 4] {
        let (sine, cosine) = (self.angle_rad / 2.0).sin_cos(); // (7)
        let [x, y, z] = self.axis;
        [x * sine, y * sine, z * sine, cosine]
    }
}

/// The horizontal direction of an axis; x when it has none.
fn horizontal(axis: &Vector3<f64>) -> Vector3<f64> {
    let flat = Vector3::new(axis.x, axis.y, 0.0);
    flat.try_normalize(1e-9 * axis.norm()).unwrap_or_else(Vector3::x)
}
