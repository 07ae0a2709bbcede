//! Walls: how far a point is from one, and which way leads away from it.
//!
//! A plane has a free side. A tube is a polyline with a radius, the rod inside; its first and last segment go on for ever, so that
//! a rod that leaves it is guided on. Where two segments meet, the wall is rounded.

use nalgebra::Vector3;

/// What stands in the rod's way.
#[derive(Debug, Clone, PartialEq)]
pub enum Wall {
    /// Everything behind it is solid.
    Plane {
        /// A point on it, m, world.
        point: Vector3<f64>,
        /// Unit vector towards the free side, world.
        normal: Vector3<f64>,
    },
    /// Everything outside it is solid.
    Tube {
        /// Its axis from end to end, m, world; at least two, no neighbours equal.
        points: Vec<Vector3<f64>>,
        /// Its inner radius, m.
        radius: f64,
    },
}

/// A point's place beside a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    /// From the wall to the point, m; negative inside the solid.
    pub gap: f64,
    /// Unit vector away from the wall; zero on the axis of a tube, where every way leads towards it.
    pub normal: Vector3<f64>,
}

impl Wall {
    /// Where a point (m, world) is beside the wall.
    #[must_use]
    pub fn clearance(&self, x: &Vector3<f64>) -> Clearance {
        match self {
            Self::Plane { point, normal } => Clearance { gap: normal.dot(&(x - point)), normal: *normal },
            Self::Tube { points, radius } => {
                let offset = nearest_offset(points, x);
                let distance = offset.norm();
                let normal = if distance > 0.0 { -offset / distance } else { Vector3::zeros() };
                Clearance { gap: radius - distance, normal }
            }
        }
    }
}

/// From the nearest point of a polyline, its ends prolonged, to `x`.
fn nearest_offset(points: &[Vector3<f64>], x: &Vector3<f64>) -> Vector3<f64> {
    let last = points.len().saturating_sub(2);
    let mut nearest = Vector3::repeat(f64::INFINITY);
    for (index, ends) in points.windows(2).enumerate() {
        let along = ends[1] - ends[0];
        let share = along.dot(&(x - ends[0])) / along.norm_squared();
        let least = if index == 0 { f64::NEG_INFINITY } else { 0.0 };
        let most = if index == last { f64::INFINITY } else { 1.0 };
        let offset = x - (ends[0] + along * share.clamp(least, most));
        if offset.norm_squared() < nearest.norm_squared() {
            nearest = offset;
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_is_the_gradient_of_the_gap() {
        let bent = vec![Vector3::zeros(), Vector3::new(0.03, 0.0, 0.0), Vector3::new(0.05, 0.02, 0.01)];
        let walls = [
            Wall::Plane { point: Vector3::new(0.0, 0.0, -0.01), normal: Vector3::new(0.0, 0.6, 0.8) },
            Wall::Tube { points: bent, radius: 4e-3 },
        ];
        for wall in walls {
            // Before, beside, at the bend of and beyond the tube.
            for x in [[-0.01, 1e-3, 2e-3], [0.02, -3e-3, 1e-3], [0.031, -2e-3, 5e-4], [0.06, 0.031, 0.012]] {
                let x = Vector3::from(x);
                let clearance = wall.clearance(&x);
                assert!((clearance.normal.norm() - 1.0).abs() < 1e-12);
                for axis in 0..3 {
                    let step = Vector3::ith(axis, 1e-7);
                    let slope = (wall.clearance(&(x + step)).gap - wall.clearance(&(x - step)).gap) / 2e-7;
                    assert!((slope - clearance.normal[axis]).abs() < 1e-6, "{x} along {axis}");
                }
            }
        }
    }

    #[test]
    fn the_axis_of_a_tube_is_a_radius_from_its_wall() {
        let points = vec![Vector3::zeros(), Vector3::x() * 0.02, Vector3::new(0.03, 0.0, 0.01)];
        let wall = Wall::Tube { points: points.clone(), radius: 3e-3 };
        for point in points {
            assert_eq!(wall.clearance(&point), Clearance { gap: 3e-3, normal: Vector3::zeros() });
        }
    }
}
