//! Frames that steer, in lockstep: six coils point both magnets in 3-D while the frames move to where the currents have it easier.
#![cfg(feature = "sim")]

mod rig_support;

use std::ops::ControlFlow;

use magsteer::config::{Document, Experiment};
use magsteer::control::{ControlConfig, FrameUse};
use magsteer::daemon::lockstep::{PlayEnd, TimedTarget};
use rig_support::{Bench, Setup, report};

fn control(setup: &mut Setup) -> &mut ControlConfig {
    setup.config.control.as_mut().expect("has a controller")
}

/// Goal: two magnets settle in 3-D with six coils, with model errors, whatever the seed; frames move meanwhile.
#[test]
fn pointing_steps_settle_with_six_coils() {
    for seed in [1, 2, 3] {
        let mut bench = Bench::new(&Setup::shipped("bigmag-3d.toml").seeded(seed));
        let steps = bench.play_shipped("pointing.toml");
        report(&format!("pointing, seed {seed}"), &steps);
        assert_eq!(bench.limit_breaks(), 0);
        for step in &steps {
            assert!(step.settled_s.is_some_and(|settled| settled < 2.0), "seed {seed}: {step:?}");
            assert!(step.error_rms_deg.iter().all(|rms| *rms < 0.5), "seed {seed}: {step:?}");
            assert!(step.current_max_a <= 8.05, "seed {seed}: {step:?}");
        }
    }
}

/// Sum of squares of the currents at the end of every step, A^2, and how far the frames moved in all, rad.
fn play(setup: &Setup) -> (f64, f64) {
    let rig = &setup.config.description;
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config/experiments/pointing.toml");
    let experiment =
        Experiment::from_document(&Document::load(&path).expect("shipped"), rig).expect("shipped");
    let steps = experiment.steps.iter();
    let steps: Vec<TimedTarget> = steps
        .map(|step| TimedTarget { target: experiment.target(step, rig), duration: step.duration_s })
        .collect();
    let mut bench = Bench::new(setup);
    let mut power = vec![0.0; steps.len()];
    let (mut moved, mut angles, mut speeds) = (0.0, None, [0.0; 2]);
    let acceleration = 200.0_f64.to_radians();
    let played = bench.lockstep.play(
        &steps,
        |rig| rig.plant().truth(),
        |seen| {
            let admitted = &seen.record.admitted;
            let now = [admitted.angle_rad[0], admitted.angle_rad[1]];
            let before = angles.replace(now).unwrap_or(now);
            let speed = [0, 1].map(|frame| (now[frame] - before[frame]) / 1e-3);
            let last = std::mem::replace(&mut speeds, speed);
            // Frames may move before the first step, as soon as the loop steers.
            let Some(step) = seen.step else { return ControlFlow::Continue(()) };
            power[step] = admitted.current_a.iter().map(|current| current * current).sum();
            for frame in 0..2 {
                // What the motors can do: they follow what they are asked for without lagging ever farther behind.
                let jerk = (speed[frame] - last[frame]).abs();
                assert!(jerk <= acceleration * 1e-3, "frame {frame} in step {step}: {last:?} then {speed:?}");
                assert!(speed[frame].abs() <= 45.0_f64.to_radians() * (1.0 + 1e-9));
                moved += (now[frame] - before[frame]).abs();
            }
            ControlFlow::Continue(())
        },
    );
    assert_eq!(played.end, PlayEnd::Complete);
    (power.iter().sum(), moved)
}

/// Goal: frames that steer end every step with less power than frames that stand at home, and are never asked for what motors cannot do.
#[test]
fn steering_frames_lower_the_power_and_spare_the_motors() {
    let mut setup = Setup::shipped("bigmag-3d.toml");
    // No more stiffness than an unloaded rod's: what is wanted beyond costs power by itself.
    control(&mut setup).determinant_wanted = 1.0;
    let (steered, moved) = play(&setup);
    control(&mut setup).frame_angles = FrameUse::Hold;
    let (held, still) = play(&setup);
    println!(
        "{steered:.1} A^2 steered, {held:.1} A^2 held; frames moved by {:.0} deg in all",
        moved.to_degrees()
    );
    assert!(steered < 0.9 * held, "{steered} {held}");
    assert!(moved > 10.0_f64.to_radians() && still == 0.0);
}
