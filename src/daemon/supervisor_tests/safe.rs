//! What safe means by configuration: when currents are held, when they ramp, when they are cut, and that none of it is
//! begun twice.

use magsteer_hal::operator::{Cause, state};

use super::bench::{Bench, ms};
use crate::daemon::config::{DaemonConfig, SafeAction, tests::shipped};
use crate::daemon::state::{Directive, State, Verb};

fn with(safe_action: SafeAction) -> DaemonConfig {
    DaemonConfig { safe_action, safe_hold_ms: 500.0, ..shipped() }
}

/// A loop that holds its currents because its poses stopped, some time ago.
fn holding() -> Bench {
    let mut bench = Bench::active_of(&with(SafeAction::HoldThenRamp));
    bench.sensor_alive = false;
    bench.until(state::SAFE_STOP, ms(400)).expect("poses are missed");
    assert_eq!(bench.cycles(100).directive, Directive::Hold);
    bench
}

/// Proves SR-13.
#[test]
fn an_operators_stop_ramps_at_once_whatever_is_configured() {
    for action in [SafeAction::Ramp, SafeAction::HoldThenRamp, SafeAction::Disable] {
        for verb in [Verb::Stop, Verb::Terminate] {
            let mut bench = Bench::active_of(&with(action));
            assert_eq!(bench.cycle(Some(verb)).directive, Directive::RampDown, "{action:?}");
            bench.until(state::IDLE, ms(100)).expect("a wanted stop ends in idle");
        }
    }
}

/// Proves SR-13.
#[test]
fn an_operators_stop_ends_a_hold_and_leaves_its_cause() {
    let mut bench = holding();
    let decision = bench.cycle(Some(Verb::Stop));
    assert_eq!((decision.directive, decision.cause), (Directive::RampDown, Some(Cause::PoseStale)));
    bench.until(state::FAULT, ms(100)).expect("a trip ends in a fault");
}

/// Goal: while currents are held, whoever takes authority or feedback away is noticed, and the hold is over.
///
/// Proves SR-02 and SR-12.
#[test]
fn a_hold_ends_when_the_currents_are_no_longer_known_or_obeyed() {
    type Spoil = fn(&mut Bench);
    let cases: [(Cause, Spoil); 3] = [
        (Cause::FeedbackStale, |bench| bench.driver_alive = false),
        (Cause::CoilOpen, |bench| bench.seen.sample.commanded.current_a[1] = 0.2),
        (Cause::AuthorityLost, |bench| bench.driver().epoch += 1),
    ];
    for (cause, spoil) in cases {
        let mut bench = holding();
        spoil(&mut bench);
        let ramps =
            (0..500).map(|_| bench.cycle(None)).find(|decision| decision.directive != Directive::Hold);
        let decision = ramps.expect("within the hold");
        assert_eq!(decision.directive, Directive::RampDown, "{cause:?}");
        assert_eq!(decision.cause, Some(Cause::PoseStale.max(cause)), "the worst stays");
        assert!(matches!(bench.supervisor.state(), State::SafeStop { .. }));
    }
}

/// Proves SR-14.
#[test]
fn an_emergency_stop_cuts_a_hold() {
    let mut bench = holding();
    assert_eq!(bench.cycle(Some(Verb::EmergencyStop)).directive, Directive::Disable);
}

/// Goal: a sensor that comes back during the hold resumes nothing.
///
/// Proves SR-03 and SR-13.
#[test]
fn a_hold_is_not_resumed_from_and_its_ramp_has_its_full_time() {
    let mut bench = holding();
    bench.sensor_alive = true;
    assert_eq!(bench.cycles(398).directive, Directive::Hold);
    bench.driver_obeys = false;
    assert_eq!(bench.cycles(3).directive, Directive::RampDown);
    // The time-out of a ramp counts from where the ramp began.
    let after = bench.until(state::FAULT, ms(1_500)).expect("the ramp's time-out");
    assert!((ms(990)..=ms(1_001)).contains(&after), "{after:?}");
    assert_eq!(bench.cycle(None).cause, Some(Cause::RampTimeout));
}

/// Proves SR-03.
#[test]
fn cut_amplifiers_latch_the_trips_own_cause_and_can_be_armed_anew() {
    let mut bench = Bench::active_of(&with(SafeAction::Disable));
    bench.sensor_alive = false;
    bench.until(state::SAFE_STOP, ms(400)).expect("poses are missed");
    bench.until(state::FAULT, ms(10)).expect("no current is measured");
    assert_eq!(bench.cycle(None).cause, Some(Cause::PoseStale));
    bench.sensor_alive = true;
    bench.cycles(10);
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
    assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED), "a claim puts cut amplifiers back to work");
}
