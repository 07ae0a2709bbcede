//! A stream of targets: steered to while it flows, held when it ends, and never taken up again by itself.

use std::time::Duration;

use magsteer_hal::operator::{Cause, state};

use super::bench::{Bench, limits};
use crate::control::Verdict;
use crate::control::plan::Obstacle;
use crate::daemon::state::{Directive, Verb};

/// The bench runs at 1 kHz.
const VALID_CYCLES: u64 = 200;

fn streamed() -> Verb {
    Verb::StreamTarget([[0.0, 0.0, 1.0]; 8].into(), Duration::from_millis(VALID_CYCLES))
}

fn set() -> Verb {
    Verb::SetTarget([[0.0, 0.0, 1.0]; 8].into())
}

/// Proves SR-26.
#[test]
fn stream_that_ends_is_held_by_its_name_until_an_operator_says_go() {
    let mut bench = Bench::active();
    for _ in 0..10 {
        bench.cycle(Some(streamed()));
        assert_eq!(bench.cycles(VALID_CYCLES - 1).state, state::ACTIVE, "a target came in time");
    }
    bench.cycle(Some(streamed()));
    assert_eq!(bench.cycles(VALID_CYCLES).state, state::ACTIVE);
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.froze), (state::HOLDING, true));
    assert_eq!(decision.transition.expect("a change of state").cause, Some(Cause::StreamEnded));
    let decision = bench.cycles(500);
    assert_eq!((decision.state, decision.cause), (state::HOLDING, Some(Cause::StreamEnded)));
    assert_eq!(decision.directive, Directive::Follow, "the magnets are held in closed loop");
    assert_eq!(bench.cycle(Some(streamed())).state, state::HOLDING, "a late target moves nothing");
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
    assert_eq!(bench.cycle(None).cause, None);
}

/// Proves SR-26.
#[test]
fn target_that_is_no_longer_one_of_a_stream_stays() {
    let mut bench = Bench::active();
    bench.cycle(Some(streamed()));
    bench.cycle(Some(set()));
    let decision = bench.cycles(3 * VALID_CYCLES);
    assert_eq!((decision.state, decision.cause), (state::ACTIVE, None));
}

/// Goal: a stream that ends while sensing is lost is not resumed when sensing is back.
///
/// Proves SR-26.
#[test]
fn stream_that_ends_while_sensing_is_lost_stays_held_when_sensing_is_back() {
    let mut bench = Bench::active();
    bench.cycle(Some(streamed()));
    bench.cycles(VALID_CYCLES - 70);
    bench.sensor_alive = false;
    assert_eq!(bench.cycles(100).directive, Directive::Hold);
    bench.sensor_alive = true;
    let decision = bench.cycles(100);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Follow));
    assert_eq!(decision.cause, Some(Cause::StreamEnded));
}

/// Goal: what was told of a target before is not taken for why the loop holds; closeness to a snap-through is, and stays.
///
/// Proves SR-26.
#[test]
fn hold_is_told_by_the_streams_end_and_not_by_what_went_before() {
    let mut bench = Bench::active();
    bench.cycle(Some(streamed()));
    bench.seen.verdict = Verdict::Refused { obstacle: Obstacle::BranchEnds, progress: 0.5 };
    assert_eq!(bench.cycle(None).cause, Some(Cause::TargetCrossesSnapThrough));
    assert_eq!(bench.cycles(2 * VALID_CYCLES).cause, Some(Cause::StreamEnded));
    let mut bench = Bench::active();
    bench.cycle(Some(streamed()));
    bench.seen.margin = limits().stability_hold - 1e-6;
    let decision = bench.cycles(2 * VALID_CYCLES);
    assert_eq!((decision.state, decision.cause), (state::HOLDING, Some(Cause::NearSnapThrough)));
}

/// Goal: before `go` a stream that ends holds nothing, and does so no later either.
///
/// Proves SR-26.
#[test]
fn stream_that_ended_before_go_does_not_hold_afterwards() {
    let mut bench = Bench::armed();
    bench.cycle(Some(streamed()));
    assert_eq!(bench.cycles(2 * VALID_CYCLES).state, state::ARMED);
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
    assert_eq!(bench.cycles(2 * VALID_CYCLES).state, state::ACTIVE);
}
