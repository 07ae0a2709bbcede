//! The closed loop in lockstep: the daemon's own loop and controller against the simulated rig, under stepped time.
#![cfg(feature = "sim")]

mod rig_support;

use magsteer::daemon::step_response::StepResponse;
use rig_support::{Bench, Setup};

fn report(name: &str, steps: &[StepResponse]) {
    for step in steps {
        println!(
            "{name}: {:?} settled {:?} mean {:.2?} rms {:.2?} current {:.2}",
            step.target_deg.iter().map(|angle| angle.round()).collect::<Vec<_>>(),
            step.settled_s,
            step.error_mean_deg,
            step.error_rms_deg,
            step.current_max_a
        );
    }
}

/// Goal: every step of the planar experiment settles in time and stays close, with model errors and the default sensor, whatever
/// the seed; and the plant sees no command beyond a limit.
#[test]
fn planar_steps_settle_with_the_tracker() {
    for seed in [1, 2, 3, 4, 5, 6] {
        let mut bench = Bench::new(&Setup::shipped("bigmag-planar.toml").seeded(seed));
        let steps = bench.play_shipped("planar.toml");
        report(&format!("tracker, seed {seed}"), &steps);
        assert_eq!(bench.limit_breaks(), 0);
        for step in &steps {
            assert!(step.settled_s.is_some_and(|settled| settled < 1.5), "seed {seed}: {step:?}");
            assert!(step.error_rms_deg.iter().all(|rms| *rms < 0.5), "seed {seed}: {step:?}");
            assert!(step.current_max_a <= 8.0);
        }
    }
}

/// Goal: the same with the slow camera, within three seconds.
#[test]
fn planar_steps_settle_with_the_camera() {
    for seed in [1, 2, 3] {
        let mut bench = Bench::new(&Setup::shipped("bigmag-planar-camera.toml").seeded(seed));
        let steps = bench.play_shipped("planar.toml");
        report(&format!("camera, seed {seed}"), &steps);
        assert_eq!(bench.limit_breaks(), 0);
        for step in &steps {
            assert!(step.settled_s.is_some_and(|settled| settled < 3.0), "seed {seed}: {step:?}");
        }
    }
}
