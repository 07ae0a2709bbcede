//! Unit vectors: the angle between two, the shortest way from one to another, and a basis of the tangent plane.

use nalgebra::Vector3;

/// Angle between two unit vectors, 0 to pi, accurate at both ends where `acos` of their product is not.
#[must_use]
pub fn angle_between(from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    from.cross(to).norm().atan2(from.dot(to))
}

/// The tangent vector at `from` that points along the great circle to `to` and is as long as their angle, rad.
///
/// Opposite vectors have no shortest way: one perpendicular to `from` is returned.
#[must_use]
pub fn logarithm(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let cosine = from.dot(to);
    let along = to - from * cosine;
    let sine = along.norm();
    // Below 1e-9 rad the direction is lost in rounding; `along` is then the angle to 1e-18 rad.
    if sine > 1e-9 {
        along * (sine.atan2(cosine) / sine)
    } else if cosine > 0.0 {
        along
    } else {
        orthonormal_complement(from)[0] * std::f64::consts::PI
    }
}

/// Walks from the unit vector `from` along the great circle of the tangent vector `way` as far as that is long,
/// rad: where that ends, and `carried`, a tangent vector at `from`, taken along.
#[must_use]
pub fn along_great_circle(
    from: &Vector3<f64>,
    way: &Vector3<f64>,
    carried: &Vector3<f64>,
) -> (Vector3<f64>, Vector3<f64>) {
    let angle = way.norm();
    if angle == 0.0 {
        return (*from, *carried);
    }
    let ahead = way / angle;
    let (sine, cosine) = angle.sin_cos();
    let reached = (from * cosine + ahead * sine).normalize();
    // What points ahead turns with the way; what lies across stays.
    let forward = carried.dot(&ahead);
    let turned = carried + (ahead * (cosine - 1.0) - from * sine) * forward;
    // Without this, rounding would lift it out of the tangent plane in the long run.
    (reached, turned - reached * reached.dot(&turned))
}

/// Two unit vectors that complete `normal` to a right-handed orthonormal basis, continuous except
/// where `normal.z` changes sign (Duff et al., "Building an orthonormal basis, revisited", JCGT 2017).
#[must_use]
pub fn orthonormal_complement(normal: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let sign = 1.0_f64.copysign(normal.z);
    let scale = -1.0 / (sign + normal.z);
    let mixed = normal.x * normal.y * scale;
    [
        Vector3::new(1.0 + sign * normal.x * normal.x * scale, sign * mixed, -sign * normal.x),
        Vector3::new(mixed, sign + normal.y * normal.y * scale, -normal.y),
    ]
}

/// The first two vectors of a right-handed orthonormal basis `pole_basis`, carried along the shortest way from its
/// third vector to the unit vector `to`: a basis of the tangent plane at `to`, smooth everywhere but at the antipode of the
/// pole, where the basis itself is returned with its second vector turned round.
#[must_use]
pub fn transported_basis(pole_basis: &[Vector3<f64>; 3], to: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let [first, second, pole] = pole_basis;
    let closeness = 1.0 + pole.dot(to);
    if closeness < 1e-12 {
        return [*first, -second];
    }
    let bisector = pole + to;
    [*first, *second].map(|axis| axis - bisector * (axis.dot(to) / closeness))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Directions spread over the sphere, the poles included.
    fn directions() -> Vec<Vector3<f64>> {
        let mut found = vec![Vector3::z(), -Vector3::z()];
        for step in 0..40 {
            let polar = f64::from(step) * 0.08 + 0.01;
            let azimuth = f64::from(step) * 2.4;
            let (sine, cosine) = polar.sin_cos();
            found.push(Vector3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine));
        }
        found
    }

    #[test]
    fn angles_are_exact_from_nothing_to_a_half_turn() {
        for angle in [0.0_f64, 1e-9, 0.3, 1.5, 3.0, std::f64::consts::PI] {
            let found = angle_between(&Vector3::x(), &Vector3::new(angle.cos(), 0.0, angle.sin()));
            assert!((found - angle).abs() < 1e-15 * (1.0 + angle), "{found} instead of {angle}");
        }
    }

    /// Goal: the complement is orthonormal and right-handed everywhere.
    #[test]
    fn complement_is_orthonormal_and_right_handed() {
        for normal in directions() {
            let [first, second] = orthonormal_complement(&normal);
            assert!((first.norm() - 1.0).abs() < 1e-14);
            assert!((second.norm() - 1.0).abs() < 1e-14);
            assert!((first.cross(&second) - normal).norm() < 1e-14);
        }
    }

    /// Goal: the transported basis is orthonormal with the vector it was carried to.
    #[test]
    fn transported_basis_is_orthonormal_and_right_handed() {
        let pole_basis = [Vector3::y(), Vector3::z(), Vector3::x()];
        for to in directions() {
            let [first, second] = transported_basis(&pole_basis, &to);
            assert!((first.cross(&second) - to).norm() < 1e-12);
            assert!((first.norm() - 1.0).abs() < 1e-12);
        }
    }

    /// Goal: walking the logarithm's great circle ends at the other vector.
    #[test]
    fn logarithm_leads_to_the_other_vector() {
        for from in directions() {
            for to in directions() {
                let tangent = logarithm(&from, &to);
                let angle = tangent.norm();
                assert!(tangent.dot(&from).abs() < 1e-12);
                assert!((angle - angle_between(&from, &to)).abs() < 1e-9);
                let (reached, _) = along_great_circle(&from, &tangent, &Vector3::zeros());
                // Opposite vectors may be reached along any great circle.
                assert!((reached - to).norm() < 1e-9, "{from} to {to}");
            }
        }
    }

    /// Goal: what is carried along keeps its length and its angle with the way, and stays a tangent vector.
    #[test]
    fn carried_vectors_keep_length_and_angle_with_the_way() {
        for from in directions() {
            for to in directions() {
                let way = logarithm(&from, &to);
                let [first, second] = orthonormal_complement(&from);
                let carried = first * 0.3 - second * 2.0;
                let (reached, there) = along_great_circle(&from, &way, &carried);
                assert!(there.dot(&reached).abs() < 1e-12);
                assert!((there.norm() - carried.norm()).abs() < 1e-12);
                let (_, ahead) = along_great_circle(&from, &way, &way);
                assert!((there.dot(&ahead) - carried.dot(&way)).abs() < 1e-9);
            }
        }
    }
}
