//! Random sequences of events against what must never happen.

use std::collections::BTreeSet;
use std::time::Duration;

use magsteer_hal::Actuation;
use magsteer_hal::operator::{Cause, state};
use rand::{RngExt, SeedableRng};

use super::bench::{Bench, limits};
use super::places::{LETTERS, letter};
use crate::control::Verdict;
use crate::control::plan::Obstacle;
use crate::daemon::causes::{Response, is_monitor, response};
use crate::daemon::config::{DaemonConfig, Mode, SafeAction, tests::shipped};
use crate::daemon::monitors::Sample;
use crate::daemon::state::{Directive, NearSnap, State, Verb};
use crate::daemon::supervisor::Decision;
use crate::daemon::trust::Astray;

/// Goal: over random events, healthy and faulty, what must never happen does not.
///
/// Proves SR-03.
#[test]
fn random_events_never_break_the_rules() {
    let actions = [SafeAction::Ramp, SafeAction::HoldThenRamp, SafeAction::Disable];
    let modes = [Mode::Active, Mode::Passive];
    let mut ever = BTreeSet::new();
    for seed in 0..48_u8 {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(u64::from(seed));
        let (safe_action, mode) = (actions[usize::from(seed) % 3], modes[usize::from(seed) / 3 % 2]);
        let config = DaemonConfig { mode, safe_action, safe_hold_ms: 100.0, ..shipped() };
        let mut bench = Bench::with(&config);
        let mut stopping = 0_u64;
        let mut before = *bench.supervisor.state();
        let mut reached = BTreeSet::new();
        for _ in 0..4_000 {
            let verb = random_event(&mut random, &mut bench);
            let decision = bench.cycle(verb);
            check_rules(&before, verb, &decision, &bench, seed);
            check_causes(&before, &decision, &bench);
            check_stop(&before, &decision, &bench, &mut stopping);
            before = *bench.supervisor.state();
            reached.insert(letter(&before, bench.now));
        }
        assert!("iqach".chars().all(|place| reached.contains(&place)), "seed {seed}: {reached:?}");
        ever.extend(reached);
    }
    // The bench has a driver from the first cycle on: Boot is left in it.
    let missing: Vec<char> = LETTERS.chars().filter(|place| *place != 'b' && !ever.contains(place)).collect();
    assert!(missing.is_empty(), "never in {missing:?}");
}

fn random_event(random: &mut rand_chacha::ChaCha8Rng, bench: &mut Bench) -> Option<Verb> {
    let toss = |random: &mut rand_chacha::ChaCha8Rng, chance| random.random_bool(chance);
    // Faults come rarely and go soon, so that the machine also works.
    if toss(random, 0.004) {
        match random.random_range(0..23) {
            0 => bench.sensor_alive = false,
            1 => bench.driver_alive = false,
            2 => bench.seen.model_converged = false,
            3 => bench.driver().fault = 1,
            4 => bench.driver().over_current = true,
            5 => bench.driver().state = random.random_range(0..4),
            6 => bench.driver_obeys = false,
            7 => bench.seen.missed = random.random_range(0..500),
            8 => bench.seen.pose_error = 1.0,
            9 => bench.seen.astray.current = 2.0,
            10 => bench.echo_alive = false,
            11 => bench.driver().life += 1,
            12 => bench.seen.pose_life = bench.seen.pose_life.map(|life| life + 1),
            13 => bench.seen.margin = random.random_range(-0.5..0.3),
            14 => bench.seen.margin = f64::NAN,
            15 => {
                let obstacle = Obstacle::BranchEnds;
                bench.seen.verdict = Verdict::Refused { obstacle, progress: 0.5 };
            }
            16 => bench.seen.description_mismatch = true,
            17 => bench.seen.sample.commanded.current_a[1] = 0.2,
            18 => bench.measured().current_a[0] = -0.4,
            19 => bench.shake = 0.3,
            20 => (bench.shake, bench.controller_sees) = (0.01, false),
            21 => bench.seen.trail_ended = true,
            _ => bench.seen.request_finite = false,
        }
    }
    // Near a snap-through a loop may stay.
    if toss(random, 0.003) {
        bench.seen.margin = random.random_range(0.0..0.3);
    }
    if toss(random, 0.02) {
        (bench.sensor_alive, bench.driver_alive, bench.driver_obeys) = (true, true, true);
        (bench.seen.model_converged, bench.seen.request_finite, bench.seen.missed) = (true, true, 0);
        (bench.driver().fault, bench.driver().over_current) = (0, false);
        (bench.seen.margin, bench.seen.trail_ended, bench.seen.verdict) = (1.0, false, Verdict::Unchecked);
        (bench.seen.description_mismatch, bench.shake, bench.controller_sees) = (false, 0.0, true);
        bench.seen.sample = Sample { measured: Some(Actuation::default()), ..Sample::default() };
        (bench.seen.pose_error, bench.seen.astray, bench.echo_alive) = (0.0, Astray::default(), true);
    }
    if !toss(random, 0.1) {
        return None;
    }
    let verbs = [
        Verb::Arm,
        Verb::Arm,
        Verb::Go,
        Verb::Go,
        Verb::Hold,
        Verb::Retreat,
        Verb::Stop,
        Verb::Reset,
        Verb::Reset,
        Verb::SetTarget([[1.0, 0.0, 0.0]; 8].into()),
        Verb::StreamTarget([[1.0, 0.0, 0.0]; 8].into(), Duration::from_millis(30)),
        Verb::EmergencyStop,
    ];
    let last = if toss(random, 0.1) { verbs.len() } else { verbs.len() - 1 };
    Some(verbs[random.random_range(0..last)])
}

fn check_rules(before: &State, verb: Option<Verb>, decision: &Decision, bench: &Bench, seed: u8) {
    let context = format!("seed {seed}: {before:?} with {verb:?} gave {decision:?}");
    let after = bench.supervisor.state();
    let moves = matches!(decision.directive, Directive::Begin | Directive::Follow | Directive::Retreat);
    let drives = moves || decision.directive == Directive::Hold;
    let holds = matches!(after, State::SafeStop { hold_until, .. } if bench.now < *hold_until)
        && decision.safe_action == SafeAction::HoldThenRamp;
    let drives_now = matches!(after, State::Active | State::Holding { .. }) || holds;
    assert_eq!(drives, drives_now, "{context}");
    assert!(
        !moves || matches!(after, State::Active | State::Holding { .. }),
        "only steering moves currents: {context}"
    );
    if matches!(before, State::Fault { .. }) && !matches!(after, State::Fault { .. }) {
        assert_eq!(verb, Some(Verb::Reset), "only a reset leaves Fault: {context}");
        assert_eq!(*after, State::Idle, "{context}");
    }
    if matches!(after, State::Active) && !matches!(before, State::Active | State::Holding { .. }) {
        assert_eq!((before, verb), (&State::Armed, Some(Verb::Go)), "{context}");
    }
    if matches!(after, State::Arming { .. }) && !matches!(before, State::Arming { .. }) {
        assert_eq!(verb, Some(Verb::Arm), "{context}");
    }
    if let State::Holding { near_snap: NearSnap::Kept, .. } = after {
        assert_eq!(decision.directive, Directive::Hold, "currents are kept: {context}");
    }
    if let State::Holding { near_snap: NearSnap::Retreating, .. } = after {
        assert_eq!(decision.directive, Directive::Retreat, "{context}");
    }
    let near_snap = |state: &State| match state {
        State::Holding { near_snap, .. } => *near_snap,
        _ => NearSnap::No,
    };
    if near_snap(before) != NearSnap::No && decision.directive == Directive::Follow {
        panic!("currents moved without another target, or in its very cycle: {context}");
    }
    if near_snap(before) != NearSnap::Retreating && near_snap(after) == NearSnap::Retreating {
        assert_eq!(verb, Some(Verb::Retreat), "{context}");
        let is_held =
            near_snap(before) == NearSnap::Kept || decision.given_up == Some(Cause::NearSnapThrough);
        assert!(is_held, "{context}");
    }
    if let (State::SafeStop { .. }, false) = (before, matches!(after, State::SafeStop { .. })) {
        assert!(matches!(after, State::Idle | State::Fault { .. }), "{context}");
    }
    if let (State::Fault { cause: old }, State::Fault { cause: new }) = (before, after) {
        assert!(new >= old, "a worse cause is never replaced by a milder one: {context}");
    }
    if let State::Fault { cause } = after {
        let disables = response(*cause) == Response::Disable;
        assert_eq!(disables, decision.directive == Directive::Disable, "{context}");
    }
    if !matches!(decision.directive, Directive::Silent) {
        assert!(decision.epoch > 0, "nothing is sent without an epoch: {context}");
    }
    let faulty = bench.seen.driver.is_some_and(|driver| driver.over_current);
    if faulty && *after != State::Boot {
        assert_eq!(decision.directive, Directive::Disable, "{context}");
    }
}

/// Steering begins with what was measured and with nothing else, also after another episode, and goes on
/// after a hold with what is held; a fault is left when its cause is seen to be over; the worst cause present
/// is the one that is told.
fn check_causes(before: &State, decision: &Decision, bench: &Bench) {
    let after = bench.supervisor.state();
    let context = format!("{before:?} gave {decision:?}");
    let steers = |state: &State| matches!(state, State::Active | State::Holding { .. });
    assert_eq!(decision.directive == Directive::Begin, !steers(before) && steers(after), "{context}");
    if steers(before) && !before.is_engaged() && steers(after) {
        let goes = matches!(decision.directive, Directive::Hold | Directive::Retreat);
        assert!(goes, "{context}");
    }
    if let (State::Fault { cause }, State::Idle) = (before, after) {
        assert!(!lasts(*cause, bench), "reset while its cause lasts: {context}");
    }
    match (before, after) {
        (State::SafeStop { cause: old, .. }, State::Fault { cause: new }) => assert!(new >= old, "{context}"),
        (_, State::SafeStop { cause, .. } | State::Fault { cause }) => {
            assert_eq!(decision.cause, Some(*cause), "{context}");
        }
        _ => {}
    }
    let driver = bench.seen.driver.as_ref().expect("the bench always has one");
    let worst = [(driver.fault != 0, Cause::DriverFault), (driver.over_current, Cause::OverCurrent)];
    for (_, cause) in worst.into_iter().filter(|(present, _)| *present && *before != State::Boot) {
        assert!(decision.cause >= Some(cause), "{cause:?} is present: {context}");
    }
}

/// What the bench itself knows of a cause that lasts.
fn lasts(cause: Cause, bench: &Bench) -> bool {
    let driver = bench.seen.driver.as_ref().expect("the bench always has one");
    match cause {
        Cause::PoseStale => bench.seen.pose_age().is_none_or(|age| age > limits().pose_stop),
        Cause::FeedbackStale => bench.now.since(driver.stamp) > limits().feedback_stop,
        Cause::ModelNotConverged => !bench.seen.model_converged,
        Cause::DescriptionMismatch => bench.seen.description_mismatch,
        Cause::DriverFault => driver.fault != 0,
        Cause::OverCurrent => driver.over_current,
        _ => false,
    }
}

/// A stop is begun once an episode, from where authority is held; its cause only grows worse; it ends within the hold and
/// the ramp's time-out. A passive daemon is stopped by no monitor.
fn check_stop(before: &State, decision: &Decision, bench: &Bench, stopping: &mut u64) {
    let after = bench.supervisor.state();
    let context = format!("{before:?} gave {decision:?}");
    match (before, after) {
        (State::SafeStop { cause: old, .. }, State::SafeStop { cause: new, .. }) => {
            assert!(new >= old, "a worse cause is never replaced by a milder one: {context}");
            *stopping += 1;
        }
        (_, State::SafeStop { .. }) => {
            assert!(before.holds_authority(), "{context}");
            *stopping = 1;
        }
        (State::SafeStop { .. }, State::Fault { .. }) | (_, State::Idle) => *stopping = 0,
        _ => {}
    }
    assert!(*stopping <= 100 + 1_000 + 2, "{stopping} ms on the way to zero: {context}");
    if let (true, Some(cause), state::SAFE_STOP | state::FAULT) =
        (decision.passive, decision.cause, decision.state)
    {
        assert!(!is_monitor(cause), "{context}");
    }
}
