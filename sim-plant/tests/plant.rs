//! The plant as a whole, under stepped time.

#[path = "../src/fixture.rs"]
mod fixture;

use std::time::Duration;

use magsteer_hal::message::driver_state;
use magsteer_hal::{Actuation, Authority, Gate, Hardware, HardwareDescription, PoseMessage, Sensed, Stamp};
use magsteer_sim_plant::{Plant, PlantConfig, SimulatedRig};
use nalgebra::Vector3;
use serde_json::{Value, json};

const CYCLE: Duration = Duration::from_millis(1);
const START: Stamp = Stamp::from_nanoseconds(5_000_000_000);
const AUTHORITY: Authority = Authority { epoch: 3, token: 9, validity: Duration::from_millis(100) };

/// The fixture's plant with some keys replaced, given as JSON pointers.
fn plant_with(changes: &[(&str, Value)]) -> Plant {
    let mut tables = fixture::plant_tables();
    for (pointer, value) in changes {
        *tables.pointer_mut(pointer).expect("a key of the fixture") = value.clone();
    }
    let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
    config.build(&fixture::bigmag()).expect("valid")
}

/// Greatest angle (deg) and distance (m) between the magnets of two messages.
fn difference(left: &PoseMessage, right: &PoseMessage) -> (f64, f64) {
    let pairs = left.magnets.iter().zip(&right.magnets).take(2);
    pairs.fold((0.0, 0.0), |(angle, distance): (f64, f64), (left, right)| {
        let apart = (Vector3::from(left.position_m) - Vector3::from(right.position_m)).norm();
        let turned = Vector3::from(left.tangent()).angle(&Vector3::from(right.tangent()));
        (angle.max(turned.to_degrees()), distance.max(apart))
    })
}

/// A rig, its clock and a commanding side that sends every cycle.
struct Session {
    rig: SimulatedRig,
    gate: Gate,
    now: Stamp,
}

impl Session {
    fn claimed(plant: Plant, description: &HardwareDescription) -> Self {
        let mut session =
            Self { rig: SimulatedRig::new(plant, description), gate: Gate::new(description), now: START };
        session.rig.read(START);
        let claim = session.gate.claim(AUTHORITY);
        session.rig.write(&claim, START).expect("sent");
        session
    }

    fn drive(&mut self, request: &Actuation, cycles: usize) -> Vec<Sensed> {
        (0..cycles)
            .map(|_| {
                self.now = self.now.after(CYCLE);
                let admitted = self
                    .gate
                    .drive(request, CYCLE.as_secs_f64(), AUTHORITY, Stamp::default())
                    .expect("finite");
                self.rig.write(&admitted.command, self.now).expect("sent");
                self.rig.read(self.now)
            })
            .collect()
    }

    fn wait(&mut self, cycles: usize) {
        for _ in 0..cycles {
            self.now = self.now.after(CYCLE);
            self.rig.read(self.now);
        }
    }
}

fn request() -> Actuation {
    let mut request = Actuation::default();
    request.current_a[..6].copy_from_slice(&[1.0, -0.8, 0.5, 1.2, 1.5, -1.0]);
    request.angle_rad[..2].copy_from_slice(&[0.2, -0.15]);
    request
}

#[test]
fn driven_plant_ends_where_statics_of_the_same_actuation_rests() {
    let description = fixture::bigmag();
    let mut session = Session::claimed(plant_with(&[]), &description);
    session.drive(&request(), 4000);
    let plant = session.rig.plant();
    let measured = plant.actual();
    for (measured, wanted) in measured.current_a.iter().zip(&request().current_a) {
        assert!((measured - wanted).abs() < 1e-9);
    }
    assert_eq!(measured.angle_rad, request().angle_rad);
    let mut still = plant.clone();
    assert!(still.settle_at(&request()));
    let (angle, distance) = difference(&plant.truth(), &still.truth());
    // Four seconds are fifteen time constants of the first mode: e^-15 of a bend of some 20 degrees.
    assert!(angle < 1e-4 && distance < 1e-7, "{angle} deg, {distance} m");
    assert_eq!(plant.counts().steps_unsolved, 0);
    assert_eq!(plant.guard().limit_breaks(), 0);
}

#[test]
fn a_silent_commander_loses_the_coils_and_they_come_to_zero() {
    let mut session = Session::claimed(plant_with(&[]), &fixture::bigmag());
    session.drive(&request(), 200);
    assert!(session.rig.plant().is_driven());
    session.wait(99);
    assert!(session.rig.plant().is_driven(), "the last command is still valid");
    session.wait(2);
    assert!(!session.rig.plant().is_driven());
    assert!(!session.rig.plant().is_currentless(), "currents ramp, they do not jump");
    session.wait(30);
    let plant = session.rig.plant();
    assert!(plant.is_currentless());
    assert_eq!(plant.guard().state(), driver_state::IDLE);
    let ramp = plant.last_ramp().expect("a complete ramp");
    // 1.5 A at 300 A/s are 5 ms, then a few time constants of 0.8 ms.
    assert!(ramp.from_loss >= Duration::from_millis(5) && ramp.from_loss < Duration::from_millis(15));
    let validity = ramp.from_last_command - ramp.from_loss;
    assert!(validity >= Duration::from_millis(99) && validity <= Duration::from_millis(101), "{validity:?}");
}

#[test]
fn runs_of_one_seed_are_equal_bit_for_bit_and_of_another_are_not() {
    let run = |seed: u64| {
        let errors = json!({"modulus_relative": 0.1, "moment_relative": 0.05, "coil_gain_relative": 0.02, "coil_axis_deg": 0.5, "coil_position_mm": 0.5});
        let plant = plant_with(&[("/seed", json!(seed)), ("/errors", errors)]);
        let mut session = Session::claimed(plant, &fixture::bigmag());
        let sensed = session.drive(&request(), 300);
        (sensed, session.rig.plant().truth())
    };
    assert_eq!(run(5), run(5));
    assert_ne!(run(5).0, run(6).0);
}

#[test]
fn sensed_poses_are_the_truth_of_their_exposure_late_and_with_noise() {
    let noiseless = [
        ("/sensors/tracker/poses/orientation_noise_deg", json!(0.0)),
        ("/sensors/tracker/poses/position_noise_mm", json!(0.0)),
    ];
    let mut session = Session::claimed(plant_with(&noiseless), &fixture::bigmag());
    let mut truths = std::collections::BTreeMap::new();
    let mut seen = 0;
    for _ in 0..300 {
        let sensed = session.drive(&request(), 1);
        let truth = session.rig.plant().truth();
        truths.insert(truth.header.source_stamp_ns, truth);
        let Some(pose) = sensed[0].pose.last.filter(|_| sensed[0].pose.fresh) else { continue };
        assert_eq!(session.now.nanoseconds() - pose.header.source_stamp_ns, 5_000_000);
        if let Some(truth) = truths.get(&pose.header.source_stamp_ns) {
            assert_eq!(difference(truth, &pose).1, 0.0);
            seen += 1;
        }
    }
    // 200 Hz over 0.3 s, but for the exposures before the first truth and after the last message.
    assert!(seen >= 57, "{seen}");
}

#[test]
fn softer_rubber_sags_further() {
    let sag = |modulus: f64| {
        let plant = plant_with(&[("/errors/modulus_relative", json!(modulus))]);
        -plant.tip().position.z
    };
    assert!(sag(-0.1) > sag(0.0) && sag(0.0) > sag(0.1));
}

#[test]
fn a_magnet_among_the_coils_is_counted() {
    let mut description = fixture::bigmag();
    description.coils.iter_mut().for_each(|coil| coil.valid_from_x = 0.2);
    let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
    let mut session = Session::claimed(config.build(&description).expect("valid"), &description);
    session.drive(&request(), 10);
    assert!(session.rig.plant().counts().steps_outside_field_model > 0);
}

/// Keys that a build of the fixture with one value replaced refuses.
fn refused(pointer: &str, value: Value) -> Vec<String> {
    let mut tables = fixture::plant_tables();
    *tables.pointer_mut(pointer).expect("a key of the fixture") = value;
    let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
    match config.build(&fixture::bigmag()) {
        Ok(_) => Vec::new(),
        Err(invalid) => invalid.into_iter().map(|invalid| invalid.key).collect(),
    }
}

#[test]
fn values_out_of_range_are_refused_by_their_keys() {
    let cases = [
        ("/step_us", json!(0)),
        ("/step_us", json!(5000)),
        ("/sensor", json!("radar")),
        ("/rod/element_length_max_mm", json!(0.0)),
        ("/rod/element_length_max_mm", json!(0.001)),
        ("/rod/first_mode_damping_ratio", json!(-0.1)),
        ("/amplifier/bandwidth_hz", json!(0.0)),
        ("/errors/modulus_relative", json!(-1.0)),
        ("/errors/moment_relative", json!(-0.05)),
        ("/errors/coil_gain_relative", json!(1.0)),
        ("/errors/coil_axis_deg", json!(-0.5)),
        ("/errors/coil_position_mm", json!(50.0)),
        ("/sensors/tracker/poses/rate_hz", json!(0.0)),
        ("/sensors/tracker/poses/rate_hz", json!(4000.0)),
        ("/sensors/tracker/poses/orientation_noise_deg", json!(90.0)),
        ("/sensors/tracker/poses/position_noise_mm", json!(-0.1)),
        ("/sensors/camera/point_cloud/latency_ms", json!(-1.0)),
        ("/sensors/camera/point_cloud/dropout_probability", json!(1.5)),
        ("/sensors/camera/point_cloud/viewers_mm", json!([[0.0, -300.0, 100.0]])),
        ("/sensors/camera/point_cloud/points", json!(5000)),
        ("/sensors/camera/point_cloud/noise_across_mm", json!(0.0)),
        ("/sensors/camera/point_cloud/noise_depth_mm", json!(11.0)),
        ("/sensors/camera/point_cloud/outlier_share", json!(0.6)),
        ("/sensors/camera/point_cloud/outlier_margin_mm", json!(-1.0)),
        ("/sensors/camera/point_cloud/occlusion/random/share", json!(0.95)),
        ("/sensors/camera/point_cloud/centreline/curvature/degree", json!(7)),
        ("/sensors/camera/point_cloud/tangent_deviation_max_deg", json!(0.0)),
        ("/sensors/fibre/curvature/rate_hz", json!(2001.0)),
        ("/sensors/fibre/curvature/stations", json!(0)),
        ("/sensors/fibre/curvature/noise_per_m", json!(-0.1)),
        ("/sensors/fibre/curvature/offset_per_m", json!(101.0)),
        ("/real_time/wake_us", json!(100)),
        ("/real_time/catch_up_max_ms", json!(0)),
        ("/real_time/truth_period_ms", json!(0)),
    ];
    for (pointer, value) in cases {
        let expected = format!("plant{}", pointer.replace('/', "."));
        let keys = refused(pointer, value.clone());
        assert!(keys.contains(&expected), "{pointer} = {value}: refused {keys:?}");
    }
    assert!(refused("/seed", json!(7)).is_empty());
}

#[test]
fn a_sensor_that_cannot_reconstruct_the_manipulator_is_refused() {
    let mut tables = fixture::plant_tables();
    // One station in the middle of the rod leaves the second section unmeasured.
    tables["sensors"]["fibre"]["curvature"]["stations"] = json!(1);
    let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
    let invalid = config.build(&fixture::bigmag()).expect_err("unmeasured");
    assert_eq!(invalid[0].key, "plant.sensors.fibre");
    assert!(invalid[0].value.contains("part 0 is flexible and has no station"), "{}", invalid[0]);
}

#[test]
fn unknown_and_missing_keys_are_refused() {
    let mut unknown = fixture::plant_tables();
    unknown["rod"]["elements"] = json!(3);
    assert!(serde_json::from_value::<PlantConfig>(unknown).is_err());
    let mut missing = fixture::plant_tables();
    missing["rod"].as_object_mut().expect("a table").remove("first_mode_damping_ratio");
    assert!(serde_json::from_value::<PlantConfig>(missing).is_err());
}

#[test]
fn a_manipulator_without_mass_is_refused() {
    let mut section = fixture::rubber();
    section.mass_per_length = 0.0;
    let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
    let invalid = config.build(&fixture::cantilever(section)).expect_err("weightless");
    assert_eq!(invalid[0].key, "plant.rod");
}
