//! The daemon's loop closed with Algorithm 1's Jacobian, against the simulated rig in lockstep.
#![cfg(feature = "sim")]

mod rig_support;

use std::ops::ControlFlow;

use magsteer::control::{
    Algorithm1Config, AllocationKind, ControlConfig, FeedbackKind, JacobianKind, OrientationErrorKind,
    PoseSource,
};
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{CycleRecord, Verb};
use magsteer_hal::operator::state;
use rig_support::{Bench, Setup};

/// Moderate steps of the planar kind.
const MODERATE_DEG: [[f64; 2]; 3] = [[90.0, 90.0], [75.0, 80.0], [105.0, 95.0]];

/// The shipped rig with Algorithm 1 as shipped, but for `change`.
fn setup(change: impl FnOnce(&mut ControlConfig)) -> Setup {
    let mut setup = Setup::shipped("bigmag-planar.toml");
    let control = setup.config.control.as_mut().expect("has a controller");
    control.jacobian = JacobianKind::Algorithm1;
    // Gains are judged where they act on measurements, as the paper's.
    control.feedback = FeedbackKind::DelayedReference;
    change(control);
    assert_eq!(control.check(), []);
    setup
}

fn algorithm_1(control: &mut ControlConfig) -> &mut Algorithm1Config {
    control.algorithm_1.as_mut().expect("shipped")
}

fn settle(name: &str, setup: &Setup, within_s: f64) -> Vec<StepResponse> {
    let mut bench = Bench::new(setup);
    let steps = bench.play_planar(&MODERATE_DEG, within_s.max(2.0) + 1.0);
    for step in &steps {
        println!(
            "{name}: {:.0?} settled {:?} rms {:.2?}",
            step.target_deg, step.settled_s, step.error_rms_deg
        );
        assert!(step.settled_s.is_some_and(|settled| settled < within_s), "{name}: {step:?}");
        assert!(step.error_rms_deg.iter().all(|rms| *rms < 0.5), "{name}: {step:?}");
    }
    assert_eq!(bench.limit_breaks(), 0);
    steps
}

/// Goal: planar steps settle with it too, whether a Jacobian takes one cycle, five or nine.
#[test]
fn planar_steps_settle_however_far_the_jacobian_is_spread() {
    for per_cycle in [9, 2, 1] {
        let setup = setup(|control| algorithm_1(control).problems_per_cycle_max = per_cycle);
        settle(&format!("{per_cycle} problems a cycle"), &setup, 1.5);
    }
}

/// Goal: the same with wrenches frozen where the sensor saw the magnets, at a gain a quarter lower: as the page on frozen wrenches asks for. At
/// the shipped gain (105, 95) takes more than twice as long to settle.
#[test]
fn planar_steps_settle_with_wrenches_frozen_at_measured_poses() {
    let setup = setup(|control| {
        algorithm_1(control).magnet_poses = PoseSource::Measured;
        control.proportional_per_s *= 0.75;
    });
    settle("measured poses", &setup, 1.5);
}

/// Goal: the same while the model's bias is estimated.
#[test]
fn planar_steps_settle_with_the_bias_estimated() {
    settle("bias estimated", &setup(|control| control.feedback = FeedbackKind::DisturbanceEstimate), 1.5);
}

/// Goal: with everything that the paper has, Jacobian, error (17) and allocation (18), (19), the loop closes. Slower is accepted, as
/// with the exact Jacobian.
#[test]
fn planar_steps_settle_with_all_of_the_papers_options() {
    let setup = setup(|control| {
        control.orientation_error = OrientationErrorKind::AxisAngle;
        control.allocation = AllocationKind::TruncatedSvd;
    });
    settle("the paper's options", &setup, 4.0);
}

/// Goal: the age of the Jacobian in use is told in every record, and stays within what the spreading allows.
#[test]
fn the_age_of_the_jacobian_is_told_in_every_cycle() {
    // Nine problems, two a cycle: complete in the fifth cycle, replaced five cycles later.
    let mut bench = Bench::new(&setup(|_| ()));
    let mut ages = Vec::new();
    run(&mut bench, 0.1, |record| ages.push(record.outcome.model.jacobian_age));
    let first = ages.iter().position(|age| *age != u32::MAX).expect("completed");
    assert!(first <= 5, "{first}");
    let found: Vec<u32> = ages[first..].to_vec();
    assert!(found.iter().all(|age| (4..=8).contains(age)), "{found:?}");
    assert!(found.contains(&4) && found.contains(&8));
}

/// Runs cycles for a time.
fn run(bench: &mut Bench, seconds: f64, mut look: impl FnMut(&CycleRecord)) {
    let flow = bench.lockstep.run(seconds, |record, _| {
        look(record);
        ControlFlow::Continue(())
    });
    assert!(flow.is_continue());
}

/// Goal: a Jacobian older than allowed counts as no model: such a loop is never armed.
#[test]
fn a_jacobian_too_old_is_no_model() {
    let mut bench = Bench::new(&setup(|control| algorithm_1(control).age_max_cycles = 3));
    run(&mut bench, 0.2, |record| assert!(!record.outcome.model.converged));
    bench.lockstep.request(Verb::Arm).expect("one a cycle");
    run(&mut bench, 0.3, |record| assert!(record.decision.state != state::ACTIVE));
    bench.lockstep.request(Verb::Go).expect("one a cycle");
    run(&mut bench, 0.3, |record| {
        assert!(record.decision.state != state::ACTIVE);
        assert!(record.outcome.request.current_a.iter().all(|current| *current == 0.0));
    });
}

/// Goal: what the greatest gain is that settles, beside the exact Jacobian's: printed for the page on frozen wrenches.
#[test]
fn the_shipped_gain_settles_with_either_jacobian() {
    for (name, jacobian) in [("exact", JacobianKind::Exact), ("algorithm 1", JacobianKind::Algorithm1)] {
        for factor in [1.0, 1.5] {
            let setup = setup(|control| {
                control.jacobian = jacobian;
                control.proportional_per_s *= factor;
                algorithm_1(control).problems_per_cycle_max = 9;
            });
            let steps = Bench::new(&setup).play_planar(&MODERATE_DEG, 3.0);
            let settled: Vec<Option<f64>> = steps.iter().map(|step| step.settled_s).collect();
            println!("{name}, {factor} of the shipped gain: settled {settled:.2?}");
            assert!(factor > 1.0 || settled.iter().all(Option::is_some), "{name}: {steps:?}");
        }
    }
}
