//! Goal: sensors look when they should, with the noise that is configured, and tell one latency later.

#[path = "../src/fixture.rs"]
mod fixture;
mod sensing_support;

use std::time::Duration;

use magsteer_hal::{PoseMessage, Stamp};
use magsteer_sim_plant::sensing::{
    FibreCharacter, Occlusion, PoseSensor, SensorSettings, StereoCharacter, Timing, TrackerCharacter,
};
use magsteer_sim_plant::{Plant, PlantConfig};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sensing_support::stereo;

const STEP: Duration = Duration::from_micros(500);
const START: Stamp = Stamp::from_nanoseconds(1_000_000_000);
const TIMING: Timing =
    Timing { period: Duration::from_millis(5), latency: Duration::from_millis(12), dropout_probability: 0.0 };
const TRACKER: TrackerCharacter = TrackerCharacter { orientation_noise: 3.5e-3, position_noise: 1e-4 };

fn plant() -> Plant {
    let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
    config.build(&fixture::bigmag()).expect("valid")
}

fn sensor(settings: &SensorSettings, seed: u64) -> PoseSensor {
    PoseSensor::new(settings, &fixture::bigmag().manipulator, seed, START).expect("fits")
}

fn fibre() -> FibreCharacter {
    FibreCharacter { stations: 100, noise: 0.5, offset: 0.0, measures_twist: true }
}

fn every_kind(timing: Timing) -> [SensorSettings; 3] {
    [
        SensorSettings::Tracker(timing, TRACKER),
        SensorSettings::Stereo(timing, stereo()),
        SensorSettings::Fibre(timing, fibre()),
    ]
}

/// Runs a sensor on a resting plant and returns every message with the time at which it was due.
fn run(settings: &SensorSettings, seed: u64, steps: usize, plant: &Plant) -> Vec<(Stamp, PoseMessage)> {
    let mut sensor = sensor(settings, seed);
    let mut now = START;
    let mut messages = Vec::new();
    for _ in 0..steps {
        if sensor.wants_exposure(now) {
            sensor.expose(plant.rod(), now);
        }
        while let Some(message) = sensor.take_due(now) {
            messages.push((now, message));
        }
        now = now.after(STEP);
    }
    messages
}

#[test]
fn messages_come_at_the_rate_and_one_latency_after_exposure() {
    let plant = plant();
    for settings in every_kind(TIMING) {
        let messages = run(&settings, 1, 1000, &plant);
        // 0.5 s at 200 Hz, less those still under way at the end.
        assert_eq!(messages.len(), 98, "{settings:?}");
        for (index, (due, message)) in messages.iter().enumerate() {
            let exposure = 1_000_000_000 + 5_000_000 * index as u64;
            assert_eq!(message.header.source_stamp_ns, exposure);
            assert_eq!(due.nanoseconds(), exposure + 12_000_000);
            assert_eq!(message.magnet_count, 2);
        }
    }
}

#[test]
fn a_restart_loses_what_is_under_way_and_keeps_the_period() {
    let plant = plant();
    for settings in every_kind(TIMING) {
        let mut sensor = sensor(&settings, 1);
        sensor.expose(plant.rod(), START);
        let later = START.after(Duration::from_secs(7));
        sensor.restart(later);
        assert!(!sensor.wants_exposure(later) && sensor.wants_exposure(later.after(TIMING.period)));
        assert_eq!(sensor.take_due(later), None);
    }
}

#[test]
fn tracker_noise_has_the_configured_deviations_and_no_bias() {
    let plant = plant();
    let truth = plant.rod().magnet_pose(1);
    let messages = run(&SensorSettings::Tracker(TIMING, TRACKER), 2, 80_000, &plant);
    let (mut tilt, mut bias, mut shift) = (0.0, Vector3::zeros(), 0.0);
    for (_, message) in &messages {
        let seen = &message.magnets[1];
        let [x, y, z, w] = seen.orientation_xyzw;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        let off = truth.rotation.inverse() * (rotation * Vector3::z());
        tilt += off.x.powi(2) + off.y.powi(2);
        bias += off - Vector3::z();
        shift += (Vector3::from(seen.position_m) - truth.position).norm_squared();
    }
    let count = messages.len() as f64;
    // 8000 samples: deviations are known to about 1 %.
    let tilt = (tilt / (2.0 * count)).sqrt();
    assert!((tilt / 3.5e-3 - 1.0).abs() < 0.03, "{tilt}");
    let shift = (shift / (3.0 * count)).sqrt();
    assert!((shift / 1e-4 - 1.0).abs() < 0.03, "{shift}");
    let bias = (bias / count).norm();
    assert!(bias < 3.5e-3 * 4.0 / count.sqrt(), "{bias}");
}

/// Goal: recorded runs stay reproducible: the tracker draws from stream 1, drop-out first, then per magnet
/// two tilts and three shifts.
#[test]
fn tracker_draws_in_its_order_from_its_stream() {
    let plant = plant();
    let messages = run(&SensorSettings::Tracker(TIMING, TRACKER), 4, 100, &plant);
    let mut random = ChaCha8Rng::seed_from_u64(4);
    random.set_stream(1);
    for (_, message) in &messages {
        let _ = random.random_bool(0.0);
        for (index, seen) in message.magnets[..2].iter().enumerate() {
            let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
            let tilt = Vector3::new(normal(), normal(), 0.0) * 3.5e-3;
            let shift = Vector3::new(normal(), normal(), normal()) * 1e-4;
            let pose = plant.rod().magnet_pose(index);
            assert_eq!(seen.position_m, <[f64; 3]>::from(pose.position + shift));
            let rotation = (pose.rotation * UnitQuaternion::from_scaled_axis(tilt)).coords;
            assert_eq!(seen.orientation_xyzw, [rotation.x, rotation.y, rotation.z, rotation.w]);
        }
    }
    assert!(messages.len() >= 7);
}

#[test]
fn drop_outs_lose_the_configured_share_of_every_kind() {
    let plant = plant();
    let timing = Timing { period: STEP, latency: Duration::ZERO, dropout_probability: 0.25 };
    for (settings, exposures) in every_kind(timing).into_iter().zip([8000, 1000, 4000]) {
        let share = run(&settings, 3, exposures, &plant).len() as f64 / exposures as f64;
        // Four standard deviations of a binomial share.
        let tolerance = 4.0 * (0.25 * 0.75 / exposures as f64).sqrt();
        assert!((share - 0.75).abs() < tolerance, "{settings:?}: {share}");
    }
}

#[test]
fn a_seed_repeats_bit_for_bit_and_another_differs() {
    let plant = plant();
    for settings in every_kind(TIMING) {
        assert_eq!(run(&settings, 4, 200, &plant), run(&settings, 4, 200, &plant));
        assert_ne!(run(&settings, 4, 200, &plant), run(&settings, 5, 200, &plant));
    }
}

#[test]
fn a_rod_mostly_hidden_is_reported_as_not_seen_and_seen_again_later() {
    let plant = plant();
    let hidden = StereoCharacter { occlusion: Occlusion::Fixed { share: 0.4, from: 0.6 }, ..stereo() };
    for (_, message) in run(&SensorSettings::Stereo(TIMING, hidden), 1, 200, &plant) {
        assert_eq!([message.magnets[0].valid, message.magnets[1].valid], [1, 0]);
    }
    // Nothing but noise: no shape at all.
    let lost = StereoCharacter { outlier_share: 1.0, ..stereo() };
    for (_, message) in run(&SensorSettings::Stereo(TIMING, lost), 1, 200, &plant) {
        assert_eq!(message.magnet_count, 2);
        assert_eq!([message.magnets[0].valid, message.magnets[1].valid], [0, 0]);
    }
}

#[test]
fn a_perfect_fibre_gives_the_poses_of_the_magnets_torsion_included() {
    let plant = plant();
    let perfect = FibreCharacter { noise: 0.0, stations: 1000, ..fibre() };
    for (_, message) in run(&SensorSettings::Fibre(TIMING, perfect), 1, 100, &plant) {
        for (index, seen) in message.magnets[..2].iter().enumerate() {
            let truth = plant.rod().magnet_pose(index);
            let [x, y, z, w] = seen.orientation_xyzw;
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            // The plant's curvature jumps between its elements; the fibre's stations straddle the jumps.
            assert!(rotation.angle_to(&truth.rotation) < 2e-4);
            assert!((Vector3::from(seen.position_m) - truth.position).norm() < 2e-5);
        }
    }
}
