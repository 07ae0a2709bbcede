//! Limits, requests and answers one by one.

use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};
use magsteer_hal::scripted::example_description;

use super::bench::{Bench, ms};
use crate::control::ReferenceTarget;
use crate::daemon::config::tests::shipped;
use crate::daemon::state::{Directive, Verb};
use crate::daemon::supervisor::Supervisor;

/// Proves SR-10.
#[test]
fn poses_late_by_the_hold_limit_hold_and_come_back_without_a_request() {
    let mut bench = Bench::active();
    bench.sensor_alive = false;
    assert_eq!(bench.cycles(50).state, state::ACTIVE, "50 ms old poses are still steered by");
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Hold));
    bench.sensor_alive = true;
    let decision = bench.cycle(None);
    // The request of this cycle was made without sensing: it is not followed yet.
    assert_eq!((decision.state, decision.directive), (state::ACTIVE, Directive::Hold));
    assert_eq!(bench.cycle(None).directive, Directive::Follow);
}

/// Proves SR-10.
#[test]
fn poses_missing_for_the_stop_limit_end_in_a_latched_fault() {
    let mut bench = Bench::active();
    bench.sensor_alive = false;
    let after = bench.until(state::SAFE_STOP, ms(400)).expect("the stop limit is 250 ms");
    assert_eq!(after, ms(251));
    bench.until(state::FAULT, ms(100)).expect("the driver ramps down within two cycles");
    assert_eq!(bench.ask(Verb::Reset), Err(Cause::PoseStale), "the sensor is still silent");
    bench.sensor_alive = true;
    bench.cycle(None);
    assert_eq!(bench.cycles(1_000).state, state::FAULT, "nothing resumes by itself");
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
}

/// Proves SR-10.
#[test]
fn poses_that_cannot_be_true_count_as_none() {
    let mut bench = Bench::active();
    // 30 degrees are allowed.
    bench.seen.pose_error = 0.53;
    assert_eq!(bench.cycles(50).state, state::ACTIVE, "the last believed ones are 50 ms old");
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Hold));
    assert_eq!(decision.transition.and_then(|transition| transition.cause), Some(Cause::PoseImplausible));
    bench.seen.pose_error = 0.52;
    assert_eq!(bench.cycles(25).state, state::HOLDING, "for half as long as poses may be late");
    assert_eq!(bench.cycle(None).state, state::ACTIVE);
    bench.seen.pose_error = 0.53;
    assert_eq!(bench.until(state::SAFE_STOP, ms(400)), Some(ms(251)));
    bench.until(state::FAULT, ms(100)).expect("the driver ramps down");
    assert_eq!(bench.ask(Verb::Reset), Err(Cause::PoseImplausible), "they still disagree");
    bench.seen.pose_error = 0.0;
    bench.cycles(50);
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
}

/// Proves SR-28.
#[test]
fn model_without_an_equilibrium_condemns_no_poses() {
    let mut bench = Bench::active();
    (bench.seen.pose_error, bench.seen.model_converged) = (3.0, false);
    bench.until(state::SAFE_STOP, ms(400)).expect("for want of a model");
    assert_eq!(bench.cycle(None).cause, Some(Cause::ModelNotConverged));
}

/// Proves SR-12.
#[test]
fn currents_may_stay_away_from_commands_for_a_while_and_no_longer() {
    let mut bench = Bench::active();
    // 1.5 A and 20 degrees are allowed, more of either for 150 ms.
    bench.seen.astray.current = 1.6;
    assert_eq!(bench.cycles(150).state, state::ACTIVE);
    bench.seen.astray.current = 1.4;
    bench.cycles(149);
    bench.seen.astray.angle = 21.0_f64.to_radians();
    assert_eq!(bench.until(state::SAFE_STOP, ms(400)), Some(ms(150)));
    assert_eq!(bench.cycle(None).cause, Some(Cause::NotFollowing));
}

/// Proves SR-10 and SR-12.
#[test]
fn what_disagrees_most_of_the_time_is_found_out() {
    for (sound, astray) in [(0.0, 2.0), (0.0, 9.0)] {
        let mut bench = Bench::active();
        let mut stopped = None;
        for cycle in 0..1000 {
            bench.seen.astray.current = if cycle % 4 == 0 { sound } else { astray };
            if bench.cycle(None).state != state::ACTIVE {
                stopped.get_or_insert(cycle);
            }
        }
        // 3 of 4 cycles gain, one loses: half of the time counts.
        assert!(stopped.is_some_and(|cycle| (290..320).contains(&cycle)), "{stopped:?}");
    }
    let mut bench = Bench::active();
    for cycle in 0..1000 {
        bench.seen.pose_error = if cycle % 20 == 0 { 2.0 } else { 0.1 };
        bench.cycle(None);
    }
    assert_eq!(bench.cycle(None).cause, Some(Cause::PoseImplausible));
}

/// Proves SR-03.
#[test]
fn another_life_of_driver_or_sensor_can_be_armed_anew() {
    let mut bench = Bench::active();
    bench.seen.pose_life = Some(42);
    bench.until(state::FAULT, ms(100)).expect("at once");
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
    bench.cycles(10);
    assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
    assert_eq!(bench.cycles(100).state, state::ACTIVE);
}

/// Proves SR-10.
#[test]
fn an_operators_hold_outlasts_a_loss_of_sensing() {
    let mut bench = Bench::in_state(state::HOLDING);
    assert_eq!(bench.cycle(None).directive, Directive::Follow, "held in closed loop");
    bench.sensor_alive = false;
    assert_eq!(bench.cycles(60).directive, Directive::Hold);
    bench.sensor_alive = true;
    bench.cycle(None);
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Follow));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
}

/// Proves SR-08.
#[test]
fn the_first_command_of_an_activity_is_what_was_measured() {
    let mut bench = Bench::armed();
    assert_eq!(bench.cycle(Some(Verb::Go)).directive, Directive::Begin);
    assert_eq!(bench.cycle(None).directive, Directive::Follow);
}

/// Proves SR-09.
#[test]
fn arming_names_what_is_missing() {
    type Spoil = fn(&mut Bench);
    let cases: [(Cause, Spoil); 7] = [
        (Cause::PoseStale, |bench| {
            bench.sensor_alive = false;
            bench.cycles(100);
        }),
        (Cause::FeedbackStale, |bench| {
            bench.driver_alive = false;
            bench.cycles(300);
        }),
        (Cause::DriverBusy, |bench| bench.driver().state = driver_state::DRIVEN),
        (Cause::DriverBusy, |bench| bench.driver().current_max = 0.2),
        (Cause::CoilOverheated, |bench| {
            // So much only to be quick about it.
            bench.measured().current_a[2] = 150.0;
            bench.cycles(400);
            bench.measured().current_a[2] = 0.0;
        }),
        (Cause::DescriptionMismatch, |bench| bench.seen.description_mismatch = true),
        (Cause::ArmTimeout, |bench| bench.driver_obeys = false),
    ];
    for (cause, spoil) in cases {
        let mut bench = Bench::idle();
        spoil(&mut bench);
        assert_eq!(bench.ask(Verb::Arm), Err(cause));
        assert_eq!(bench.cycles(200).state, state::IDLE);
        assert_eq!(bench.supervisor.epoch(), 0, "no authority is left behind");
    }
}

/// Proves SR-23.
#[test]
fn arming_is_refused_when_enforced_real_time_is_missing() {
    let mut bench = Bench::new();
    bench.supervisor = Supervisor::new(&shipped(), &example_description(), true);
    bench.cycle(None);
    assert_eq!(bench.ask(Verb::Arm), Err(Cause::RealtimeMissing));
}

/// Proves SR-13.
#[test]
fn a_stop_cancels_a_claim_and_both_requests_are_answered() {
    let mut bench = Bench::idle();
    bench.driver_obeys = false;
    let claim = bench.next_id;
    assert_eq!(bench.cycle(Some(Verb::Arm)).directive, Directive::Claim);
    let decision = bench.cycle(Some(Verb::Stop));
    let answers: Vec<_> = decision.answers.into_iter().flatten().collect();
    assert_eq!(answers[0].id, claim);
    assert_eq!(answers[0].refused, Some(Cause::OperatorStop));
    assert_eq!((answers[1].refused, decision.state), (None, state::IDLE));
}

/// Proves SR-13.
#[test]
fn a_stop_ends_on_measured_current_not_on_commanded() {
    let mut bench = Bench::active();
    bench.driver_obeys = false;
    bench.ask(Verb::Stop).expect("stopping is allowed");
    assert_eq!(bench.cycles(500).state, state::SAFE_STOP, "current still flows");
    bench.driver().current_max = 0.09;
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.cause), (state::IDLE, Some(Cause::OperatorStop)));
}

/// Proves SR-13.
#[test]
fn a_ramp_that_takes_too_long_cuts_the_amplifiers() {
    let mut bench = Bench::active();
    bench.driver_obeys = false;
    bench.ask(Verb::Stop).expect("stopping is allowed");
    let decision = bench.cycles(1_100);
    assert_eq!((decision.state, decision.cause), (state::FAULT, Some(Cause::RampTimeout)));
    assert_eq!(decision.directive, Directive::Disable);
    assert_eq!(bench.ask(Verb::Reset), Err(Cause::RampTimeout), "current still flows");
}

/// Proves SR-03.
#[test]
fn the_worst_cause_of_an_episode_wins_and_stays() {
    let mut bench = Bench::active();
    bench.driver_obeys = false;
    bench.ask(Verb::Stop).expect("stopping is allowed");
    bench.driver().over_current = true;
    assert_eq!(bench.cycle(None).cause, Some(Cause::OverCurrent));
    bench.driver().over_current = false;
    bench.driver().fault = 3;
    assert_eq!(bench.cycle(None).cause, Some(Cause::OverCurrent), "a milder one does not replace it");
    bench.ask(Verb::EmergencyStop).expect("always allowed");
    assert_eq!(bench.cycle(None).cause, Some(Cause::EmergencyStop));
}

/// Proves SR-14.
#[test]
fn an_emergency_stop_from_idle_carries_an_epoch_that_the_driver_can_obey() {
    let mut bench = Bench::idle();
    let decision = bench.cycle(Some(Verb::EmergencyStop));
    assert_eq!(decision.directive, Directive::Disable);
    assert!(decision.epoch > 0);
}

/// Proves SR-03.
#[test]
fn after_an_emergency_stop_it_takes_reset_and_arm_and_go() {
    let mut bench = Bench::in_state(state::FAULT);
    assert_eq!(bench.ask(Verb::Arm), Err(Cause::EmergencyStop));
    assert_eq!(bench.ask(Verb::Go), Err(Cause::EmergencyStop));
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
    assert_eq!(bench.ask(Verb::Go), Err(Cause::WrongState));
    assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
}

/// Proves SR-11.
#[test]
fn targets_that_are_no_unit_vectors_are_refused() {
    let mut bench = Bench::idle();
    let good = [0.6, 0.0, 0.8];
    for bad in [[0.0; 3], [f64::NAN, 0.0, 1.0], [1.0, 1.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
        let mut target = [[0.0; 3]; 8];
        (target[0], target[1]) = (good, bad);
        assert_eq!(bench.ask(Verb::SetTarget(target.into())), Err(Cause::TargetInvalid), "{bad:?}");
    }
    let mut target = [[0.0; 3]; 8];
    (target[0], target[1]) = (good, good);
    let decision = bench.cycle(Some(Verb::SetTarget(target.into())));
    assert_eq!(decision.target, Some(target.into()));
}

/// Goal: frames of -180 to 180 deg take targets to their very ends, and none beyond; entries past the last frame are not read.
///
/// Proves SR-11.
#[test]
fn targets_with_frame_angles_out_of_range_are_refused() {
    let mut bench = Bench::idle();
    let target = |first: f64, second: f64| {
        let mut angles = [f64::NAN; 8];
        (angles[0], angles[1]) = (first.to_radians(), second.to_radians());
        ReferenceTarget { directions: [[0.6, 0.0, 0.8]; 8], frame_angles: Some(angles) }
    };
    for bad in [target(180.1, 0.0), target(0.0, -181.0), target(f64::NAN, 0.0), target(0.0, f64::INFINITY)] {
        assert_eq!(bench.ask(Verb::SetTarget(bad)), Err(Cause::TargetInvalid), "{bad:?}");
    }
    assert!(bench.ask(Verb::SetTarget(target(180.0, -180.0))).is_ok());
}

/// Proves SR-15.
#[test]
fn a_process_told_to_end_ramps_down_and_takes_no_more_orders() {
    let mut bench = Bench::active();
    bench.ask(Verb::Terminate).expect("ending is allowed");
    bench.until(state::IDLE, ms(50)).expect("the driver ramps down within two cycles");
    bench.cycles(2);
    assert!(bench.supervisor.has_ended(bench.now));
    assert_eq!(bench.ask(Verb::Arm), Err(Cause::Ending));
}

/// Proves SR-13.
#[test]
fn authority_is_released_until_the_driver_shows_it() {
    let mut bench = Bench::active();
    bench.ask(Verb::Stop).expect("stopping is allowed");
    let mut released = 0;
    for _ in 0..10 {
        released += u32::from(bench.cycle(None).directive == Directive::Release);
    }
    assert!(released >= 1);
    assert_eq!(bench.cycle(None).directive, Directive::Silent);
    assert_eq!(bench.supervisor.epoch(), 0);
}
