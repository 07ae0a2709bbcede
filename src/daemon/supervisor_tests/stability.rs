//! Near a snap-through: targets refused before, currents kept close to it, a ramp beyond it.

use magsteer_hal::operator::{Cause, state};

use super::bench::{Bench, limits};
use crate::control::Verdict;
use crate::control::plan::Obstacle;
use crate::daemon::state::{Directive, Verb};

const REFUSED: Verdict = Verdict::Refused { obstacle: Obstacle::BranchEnds, progress: 0.8 };
const CLEAR: Verdict = Verdict::Clear { margin_min: 0.7, current_max: 2.0 };

fn target() -> Verb {
    Verb::SetTarget([[0.0, 0.0, 1.0]; 8].into())
}

/// Goal: a refused target is given up once, the loop goes on steering, and the refusal is seen until another
/// target is set.
///
/// Proves SR-25.
#[test]
fn refused_target_is_given_up_and_named_until_the_next() {
    let mut bench = Bench::active();
    bench.seen.verdict = Verdict::Checking;
    let decision = bench.cycle(None);
    assert_eq!((decision.verdict, decision.given_up), (Verdict::Checking, None));
    bench.seen.verdict = REFUSED;
    let decision = bench.cycle(None);
    assert_eq!(decision.given_up, Some(Cause::TargetCrossesSnapThrough));
    assert_eq!((decision.state, decision.directive), (state::ACTIVE, Directive::Follow));
    // The target before is in force again, and that is clear.
    bench.seen.verdict = CLEAR;
    let decision = bench.cycles(500);
    assert_eq!((decision.verdict, decision.given_up), (REFUSED, None));
    assert_eq!(decision.cause, Some(Cause::TargetCrossesSnapThrough));
    bench.cycle(Some(target()));
    let decision = bench.cycle(None);
    assert_eq!((decision.verdict, decision.cause), (CLEAR, None));
}

/// Proves SR-25.
#[test]
fn way_out_of_the_field_model_is_refused_by_its_name_and_one_out_of_reach_is_gone() {
    let mut bench = Bench::active();
    bench.seen.verdict = Verdict::OutOfReach { progress: 0.5 };
    assert_eq!(bench.cycle(None).given_up, None);
    bench.cycle(Some(target()));
    bench.seen.verdict = Verdict::Refused { obstacle: Obstacle::OutsideField, progress: 0.5 };
    assert_eq!(bench.cycle(None).given_up, Some(Cause::TargetOutsideField));
}

/// Goal: below the limit, and not above it, currents are kept until another target is set, whatever the
/// margin does meanwhile.
///
/// Proves SR-25.
#[test]
fn margin_below_its_limit_keeps_the_currents_until_another_target_is_set() {
    let mut bench = Bench::active();
    let hold = limits().stability_hold;
    bench.seen.margin = hold;
    let decision = bench.cycles(1_000);
    assert_eq!((decision.state, decision.directive), (state::ACTIVE, Directive::Follow));
    bench.seen.margin = hold - 1e-6;
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Hold));
    assert_eq!(decision.given_up, Some(Cause::NearSnapThrough));
    let transition = decision.transition.expect("a change of state");
    assert_eq!(transition.cause, Some(Cause::NearSnapThrough));
    bench.seen.margin = 1.0;
    let decision = bench.cycles(500);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Hold));
    assert_eq!((decision.given_up, decision.cause), (None, Some(Cause::NearSnapThrough)));
    assert_eq!(bench.ask(Verb::Go), Err(Cause::NearSnapThrough));
    let decision = bench.cycle(Some(target()));
    assert_eq!((decision.state, decision.cause), (state::ACTIVE, None));
    assert_eq!(bench.cycle(None).directive, Directive::Follow);
}

/// Goal: a motion that begins below the limit may lose half of the margin left and no more.
///
/// Proves SR-25.
#[test]
fn motion_from_below_the_limit_is_held_when_it_loses_half() {
    let mut bench = Bench::active();
    bench.seen.margin = 0.08;
    bench.cycle(None);
    bench.cycle(Some(target()));
    bench.seen.margin = 0.041;
    assert_eq!(bench.cycles(500).state, state::ACTIVE);
    bench.seen.margin = 0.039;
    assert_eq!(bench.cycle(None).state, state::HOLDING);
}

/// Proves SR-25.
#[test]
fn margin_without_an_equilibrium_holds_nothing() {
    let mut bench = Bench::active();
    (bench.seen.margin, bench.seen.model_converged) = (0.05, false);
    assert_eq!(bench.cycles(100).state, state::ACTIVE);
}

/// Goal: an operator's hold and one near a snap-through end each by its own request.
///
/// Proves SR-25.
#[test]
fn operators_hold_outlasts_the_one_near_a_snap_through() {
    let mut bench = Bench::in_state(state::HOLDING);
    bench.seen.margin = 0.05;
    assert_eq!(bench.cycle(None).directive, Directive::Hold);
    bench.cycle(Some(target()));
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Follow));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
}

/// Goal: a retreat that was asked for goes on until the margin is no longer warned of; the loop then steers, and keeps what is new.
///
/// Proves SR-25.
#[test]
fn retreat_ends_where_the_margin_is_no_longer_warned_of() {
    let mut bench = Bench::active();
    assert_eq!(bench.ask(Verb::Retreat), Err(Cause::WrongState), "nothing to go back from");
    bench.seen.margin = 0.05;
    bench.cycle(None);
    assert_eq!(bench.ask(Verb::Retreat), Ok(state::HOLDING));
    assert_eq!(bench.ask(Verb::Retreat), Ok(state::HOLDING), "it is under way");
    let decision = bench.cycles(50);
    assert_eq!((decision.directive, decision.cause), (Directive::Retreat, Some(Cause::Retreating)));
    bench.seen.margin = limits().stability_warn;
    assert_eq!(bench.cycles(50).directive, Directive::Retreat);
    (bench.seen.margin, bench.seen.model_converged) = (1.0, false);
    assert_eq!(bench.cycle(None).directive, Directive::Retreat, "a margin of what?");
    (bench.seen.model_converged, bench.seen.pose_error) = (true, 1.0);
    assert_eq!(bench.cycle(None).directive, Directive::Retreat, "not the rod's");
    bench.seen.pose_error = 0.0;
    let forgotten = limits().pose_hold.as_millis() as u64;
    let decision = bench.cycles(forgotten);
    assert_eq!((decision.state, decision.cause, decision.given_up), (state::ACTIVE, None, None));
    assert_eq!(bench.directives[bench.directives.len() - 2..], [Directive::Hold, Directive::Follow]);
    // What may be lost from here on is as ever.
    bench.seen.margin = limits().stability_hold - 1e-6;
    assert_eq!(bench.cycle(None).cause, Some(Cause::NearSnapThrough));
}

/// Goal: where there is nothing left to go back along the loop holds as before, and says so.
///
/// Proves SR-25.
#[test]
fn retreat_that_comes_to_the_begin_of_the_way_holds_again() {
    let mut bench = Bench::active();
    bench.seen.margin = 0.05;
    bench.cycle(None);
    bench.cycle(Some(Verb::Retreat));
    bench.seen.trail_ended = true;
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Hold));
    assert_eq!(decision.cause, Some(Cause::NearSnapThrough));
    assert_eq!(bench.ask(Verb::Retreat), Err(Cause::NearSnapThrough));
}

/// Goal: an operator's hold stops a retreat until it is asked for again, and it then ends in the hold; a moment without sensing does not.
///
/// Proves SR-25.
#[test]
fn retreat_waits_for_the_operator_and_not_for_sensing() {
    let mut bench = Bench::active();
    bench.seen.margin = 0.05;
    bench.cycle(None);
    bench.cycle(Some(Verb::Retreat));
    bench.sensor_alive = false;
    assert_eq!(bench.cycles(100).directive, Directive::Retreat);
    bench.sensor_alive = true;
    assert_eq!(bench.cycles(2).directive, Directive::Retreat);
    assert_eq!(bench.ask(Verb::Hold), Ok(state::HOLDING));
    let decision = bench.cycles(100);
    assert_eq!((decision.directive, decision.cause), (Directive::Hold, Some(Cause::NearSnapThrough)));
    assert_eq!(bench.ask(Verb::Go), Err(Cause::NearSnapThrough));
    assert_eq!(bench.ask(Verb::Retreat), Ok(state::HOLDING));
    assert_eq!(bench.cycle(None).directive, Directive::Retreat);
    bench.seen.margin = 1.0;
    let decision = bench.cycles(2);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Follow));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
}

/// Goal: a margin below zero stops after its time and not before, also where the currents are kept.
///
/// Proves SR-25.
#[test]
fn lost_stability_stops_after_its_time() {
    let mut bench = Bench::active();
    bench.seen.margin = -0.01;
    assert_eq!(bench.cycles(151).state, state::HOLDING);
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.cause), (state::SAFE_STOP, Some(Cause::StabilityLost)));
    let mut bench = Bench::active();
    for _ in 0..10 {
        bench.seen.margin = -0.01;
        bench.cycles(150);
        bench.seen.margin = 0.01;
        assert_eq!(bench.cycle(None).state, state::HOLDING);
    }
    bench.seen.margin = f64::NAN;
    assert_eq!(bench.cycles(153).cause, Some(Cause::StabilityLost), "not a number is no margin");
}

/// Proves SR-25.
#[test]
fn warning_begins_below_its_limit_and_does_not_flicker() {
    let mut bench = Bench::active();
    let warn = limits().stability_warn;
    bench.seen.margin = warn;
    assert!(!bench.cycle(None).stability_low);
    for (margin, low) in [(-0.001, true), (0.02, true), (0.04, false), (0.02, false)] {
        bench.seen.margin = warn + margin;
        assert_eq!(bench.cycle(None).stability_low, low, "{margin}");
    }
}
