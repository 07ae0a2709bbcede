//! Rotations as unit quaternions and rotation vectors.
//!
//! | symbol | meaning |
//! |---|---|
//! | `v` | rotation vector: axis times angle, rad |
//! | `v^` | the skew matrix with `v^ a = v x a` |

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Below this squared angle, series replace the closed forms: the first term left out is under 1e-15.
const SERIES_BELOW: f64 = 1e-2;

/// The rotation by the vector `v`.
#[inline(always)]
pub fn exponential(v: &Vector3<f64>) -> UnitQuaternion<f64> {
    let squared = 0.25 * v.norm_squared();
    let (cosine, sine_ratio) = if squared < SERIES_BELOW {
        // cos(x) and sin(x) / x; products with constants, since a chain of divisions takes five times as long.
        let cosine = squared * (1.0 / 40_320.0) - 1.0 / 720.0;
        let cosine = 1.0 + squared * (-0.5 + squared * (1.0 / 24.0 + squared * cosine));
        let sine = squared * (1.0 / 362_880.0) - 1.0 / 5040.0;
        (cosine, 1.0 + squared * (-1.0 / 6.0 + squared * (1.0 / 120.0 + squared * sine)))
    } else {
        let half = squared.sqrt();
        (half.cos(), half.sin() / half)
    };
    let imaginary = v * (0.5 * sine_ratio);
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cosine, imaginary))
}

/// The rotation vector of `q`, of angle at most pi.
#[inline(always)]
pub fn logarithm(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let imaginary = q.imag();
    let squared = imaginary.norm_squared();
    let sign = 1.0_f64.copysign(q.w);
    if squared < SERIES_BELOW {
        // 2 asin(x) / x
        let ratio = 2.0
            + squared
                * (1.0 / 3.0
                    + squared
                        * (3.0 / 20.0
                            + squared * (5.0 / 56.0 + squared * (35.0 / 576.0 + squared * 63.0 / 1408.0))));
        imaginary * (sign * ratio)
    } else {
        let sine = squared.sqrt();
        imaginary * (sign * 2.0 * sine.atan2(q.w.abs()) / sine)
    }
}

/// The rotation half-way from `left` to `right` along the shorter way.
#[inline(always)]
pub fn midpoint(left: &UnitQuaternion<f64>, right: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let sum = if left.coords.dot(&right.coords) < 0.0 {
        left.coords - right.coords
    } else {
        left.coords + right.coords
    };
    UnitQuaternion::new_unchecked(Quaternion::from(sum / sum.norm()))
}

/// The skew matrix `v^`.
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    v.cross_matrix()
}

/// The rotation matrix of `q`.
pub fn matrix(q: &UnitQuaternion<f64>) -> Matrix3<f64> {
    q.to_rotation_matrix().into_inner()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_undoes_exponential_up_to_half_a_turn() {
        for angle in [0.0, 1e-9, 1e-3, 0.19, 0.2, 0.21, 1.0, 3.1, 3.13] {
            let v = Vector3::new(0.6, -0.48, 0.64) * angle;
            // Near half a turn the angle comes from an arc tangent: a few units in the last place.
            assert!((logarithm(&exponential(&v)) - v).norm() < 1e-14 * (1.0 + angle), "angle {angle}");
        }
    }

    #[test]
    fn exponential_agrees_with_the_rotation_of_another_library() {
        for angle in [1e-6, 0.1, 0.19, 0.5, 2.0] {
            let v = Vector3::new(0.6, -0.48, 0.64) * angle;
            let difference = exponential(&v).coords - UnitQuaternion::from_scaled_axis(v).coords;
            assert!(difference.norm() < 1e-15);
        }
    }

    #[test]
    fn midpoint_is_half_the_relative_rotation() {
        let left = exponential(&Vector3::new(0.3, 1.2, -0.7));
        let relative = Vector3::new(-0.4, 0.2, 0.9);
        let expected = left * exponential(&(relative * 0.5));
        let found = midpoint(&left, &(left * exponential(&relative)));
        assert!((matrix(&found) - matrix(&expected)).norm() < 1e-14);
    }
}
