//! Goal: eq. (7) with its sign rule, normalised, and defined where the paper's form is not.

use nalgebra::Vector3;

use crate::message::MagnetPose;
use crate::seeded::Seeded;
use crate::shape::AxisAngle;

fn tangent_of(turn: &AxisAngle) -> Vector3<f64> {
    let pose = MagnetPose { orientation_xyzw: turn.orientation_xyzw(), ..MagnetPose::default() };
    Vector3::from(pose.tangent())
}

#[test]
fn orientation_turns_global_z_into_the_tangent_whatever_its_length() {
    let mut random = Seeded::new(1);
    for _ in 0..1000 {
        let tangent = Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
        let desired = [random.within(1.0), random.within(1.0), random.within(1.0)];
        let turn = AxisAngle::of_tangent(tangent.into(), desired);
        assert!((tangent_of(&turn) - tangent.normalize()).norm() < 1e-14);
        let norm: f64 = turn.orientation_xyzw().iter().map(|part| part * part).sum();
        assert!((norm - 1.0).abs() < 1e-14);
    }
}

#[test]
fn axis_is_unit_horizontal_and_the_one_nearer_to_the_desired() {
    let mut random = Seeded::new(2);
    for _ in 0..1000 {
        let tangent = [random.within(1.0), random.within(1.0), random.within(1.0)];
        let desired = Vector3::new(random.within(1.0), random.within(1.0), random.within(1.0));
        let turn = AxisAngle::of_tangent(tangent, desired.into());
        let axis = Vector3::from(turn.axis);
        assert!((axis.norm() - 1.0).abs() < 1e-14 && axis.z == 0.0);
        assert!(axis.dot(&desired) >= 0.0);
        let other = AxisAngle::of_tangent(tangent, (-desired).into());
        assert_eq!(other.angle_rad, -turn.angle_rad);
        // The same turn by the other axis: the same quaternion.
        let (one, two) = (turn.orientation_xyzw(), other.orientation_xyzw());
        assert!(one.iter().zip(two).all(|(one, two)| (one - two).abs() < 1e-15));
    }
}

#[test]
fn angle_keeps_its_digits_near_0_and_180_degrees() {
    for small in [1e-9, 1e-7, 1e-4] {
        for (cosine, expected) in [(1.0, small), (-1.0, std::f64::consts::PI - small)] {
            let tangent = [small.sin(), 0.0, cosine * small.cos()];
            let found = AxisAngle::of_tangent(tangent, [0.0, 1.0, 0.0]);
            assert!((found.angle_rad - expected).abs() < 1e-15 + 1e-9 * small, "{small}: {found:?}");
        }
    }
}

#[test]
fn vertical_tangents_turn_about_the_desired_axis_made_horizontal() {
    let up = AxisAngle::of_tangent([0.0, 0.0, 2.0], [0.0, 3.0, 4.0]);
    assert_eq!((up.axis, up.angle_rad), ([0.0, 1.0, 0.0], 0.0));
    assert_eq!(up.orientation_xyzw(), [0.0, 0.0, 0.0, 1.0]);
    let down = AxisAngle::of_tangent([0.0, 0.0, -1.0], [0.6, -0.8, 5.0]);
    assert!((Vector3::from(down.axis) - Vector3::new(0.6, -0.8, 0.0)).norm() < 1e-15);
    assert!((tangent_of(&down) + Vector3::z()).norm() < 1e-15);
    let neither = AxisAngle::of_tangent([0.0, 0.0, -1.0], [0.0, 0.0, 1.0]);
    assert_eq!(neither.axis, [1.0, 0.0, 0.0]);
}

#[test]
fn no_direction_at_all_is_the_identity() {
    let none = AxisAngle::of_tangent([0.0; 3], [0.0; 3]);
    assert_eq!(none.orientation_xyzw(), [0.0, 0.0, 0.0, 1.0]);
}
