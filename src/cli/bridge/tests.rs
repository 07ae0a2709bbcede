//! What is published, for statuses made here.

use std::path::Path;

use foxglove::messages::Timestamp;
use magsteer::config::Config;
use magsteer::live::{Figures, Link, Rig, RodModel};
use magsteer_hal::operator::StatusMessage;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::scene::Scene;
use super::topics::pose;

fn turned(pose: &foxglove::messages::Pose, axis: Vector3<f64>) -> Vector3<f64> {
    let turn = pose.orientation.as_ref().expect("it has one");
    UnitQuaternion::from_quaternion(Quaternion::new(turn.w, turn.x, turn.y, turn.z)) * axis
}

#[test]
fn poses_point_along_their_direction_opposite_to_z_too() {
    for direction in
        [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.6, -0.8, 0.0], [0.36, 0.48, -0.8]]
    {
        let found = turned(&pose(&[0.0; 3], &direction), Vector3::z());
        assert!((found - Vector3::from(direction)).norm() < 1e-12, "{direction:?} {found}");
    }
}

#[test]
fn scene_has_the_rod_its_magnets_targets_and_every_coil_facing_the_workspace() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    let (_, config) = Config::load(&path).expect("shipped");
    let rig = Rig::new(&config);
    let mut status = StatusMessage { description_fingerprint: rig.fingerprint, ..StatusMessage::default() };
    status.measured_position_m[0] = [-0.027, 0.0, -0.003];
    status.measured_direction[0] = [1.0, 0.0, 0.0];
    status.target_direction[0] = [0.0, 0.0, 1.0];
    status.measured.current_a[0] = 8.0;
    let rod = RodModel::new(&config).draw(&StatusMessage::default(), true);
    let figures = Figures::new(&rig, Some(&status), (Link::Attached, None, 0), rod);
    let scene = Scene::new(&config).draw(&rig, &status, &figures, Timestamp::new(1, 0));
    let of = |id: &str| scene.entities.iter().find(|entity| entity.id == id).expect("drawn");
    let line = &of("rod").lines[0];
    assert_eq!((line.points[0].x, line.thickness), (-0.055, 0.003), "from the clamp, in metres");
    assert_eq!(of("magnets").cylinders.len(), 1, "the other was not seen");
    let arrow = of("targets").arrows[0].pose.as_ref().expect("it has one");
    assert!(
        (turned(arrow, Vector3::x()) - Vector3::z()).norm() < 1e-12,
        "arrows point along x of their pose"
    );
    let coils = &of("coils").cylinders;
    assert_eq!(coils.len(), 6);
    for coil in coils {
        let pose = coil.pose.as_ref().expect("it has one");
        let place = pose.position.as_ref().expect("it has one");
        let inwards = -Vector3::new(place.x, place.y, place.z).normalize();
        assert!(turned(pose, Vector3::z()).dot(&inwards) > 0.99, "{coil:?}");
    }
    let red = |coil: usize| coils[coil].color.as_ref().expect("it has one").r;
    assert!(red(0) > 0.9 && red(1) < 0.5, "current is colour");
}
