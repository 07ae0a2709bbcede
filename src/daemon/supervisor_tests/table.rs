//! Where each event leads from each state.

use std::time::Duration;

use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};
use magsteer_hal::{MagnetPose, PoseMessage};

use super::bench::{Bench, ms};
use super::places::{LETTERS, Place, letter};
use crate::control::Verdict;
use crate::control::plan::Obstacle;
use crate::daemon::causes::{Response, holds_currents, is_monitor, response};
use crate::daemon::config::{DaemonConfig, Mode, SafeAction, tests::shipped};
use crate::daemon::state::{Directive, Verb};
use crate::daemon::supervisor::Decision;

/// What happens to a daemon in the table below.
#[expect(clippy::large_enum_variant, reason = "a few in a test")]
#[derive(Debug, Clone, Copy)]
enum Event {
    Ask(Verb),
    PosesStop,
    ModelFails,
    FieldInvalid,
    FeedbackStops,
    AuthorityLost,
    DriverCut,
    DriverFault,
    OverCurrent,
    Overruns,
    RequestNotFinite,
    WritesFail,
    PosesDisagree,
    NotFollowing,
    EchoStops,
    DriverRestarts,
    SensorRestarts,
    TargetRefused,
    NearSnap,
    Snapped,
    OtherDescription,
    RampStalls,
    PosesOutside,
    PosesTooFast,
    CoilOpen,
    CurrentUnasked,
    CoilOverheats,
    ModelStaysOff,
    ControllerFreezes,
}

impl Event {
    /// Every fault, with the cause that it has where it stops the daemon, and whether a reset is refused while it lasts.
    const FAULTS: [(Self, Cause, bool); 27] = [
        (Self::Ask(Verb::EmergencyStop), Cause::EmergencyStop, false),
        (Self::PosesStop, Cause::PoseStale, true),
        (Self::ModelFails, Cause::ModelNotConverged, true),
        (Self::FieldInvalid, Cause::FieldModelInvalid, true),
        (Self::FeedbackStops, Cause::FeedbackStale, true),
        (Self::AuthorityLost, Cause::AuthorityLost, false),
        (Self::DriverCut, Cause::DriverDisabled, false),
        (Self::DriverFault, Cause::DriverFault, true),
        (Self::OverCurrent, Cause::OverCurrent, true),
        (Self::Overruns, Cause::Overruns, true),
        (Self::RequestNotFinite, Cause::RequestNotFinite, false),
        (Self::WritesFail, Cause::CommandNotSent, false),
        (Self::PosesDisagree, Cause::PoseImplausible, true),
        (Self::NotFollowing, Cause::NotFollowing, false),
        (Self::EchoStops, Cause::FeedbackStale, false),
        (Self::DriverRestarts, Cause::AuthorityLost, false),
        (Self::SensorRestarts, Cause::SensorRestarted, false),
        (Self::Snapped, Cause::StabilityLost, false),
        (Self::OtherDescription, Cause::DescriptionMismatch, true),
        (Self::RampStalls, Cause::RampTimeout, true),
        (Self::PosesOutside, Cause::PoseOutsideWorkspace, true),
        (Self::PosesTooFast, Cause::PoseTooFast, true),
        (Self::CoilOpen, Cause::CoilOpen, false),
        (Self::CurrentUnasked, Cause::NotFollowing, false),
        (Self::CoilOverheats, Cause::CoilOverheated, true),
        (Self::ModelStaysOff, Cause::ModelOff, true),
        (Self::ControllerFreezes, Cause::NotProgressing, false),
    ];

    /// Lets the event happen for half a second, or as long as it takes to be found; returns the last decision.
    fn happen(self, bench: &mut Bench) -> Decision {
        self.begin(bench);
        bench.cycles(match self {
            Self::ModelStaysOff => 2_500,
            Self::RampStalls => 1_100,
            _ => 500,
        })
    }

    fn heats(self) -> bool {
        matches!(self, Self::CoilOverheats)
    }

    fn begin(self, bench: &mut Bench) {
        match self {
            // Whether it is refused shows in the state.
            Self::Ask(verb) => _ = bench.ask(verb),
            Self::PosesStop => bench.sensor_alive = false,
            Self::ModelFails => bench.seen.model_converged = false,
            Self::FieldInvalid => bench.seen.field_valid = false,
            Self::FeedbackStops => bench.driver_alive = false,
            // It ramped down by itself.
            Self::AuthorityLost => {
                (bench.driver().state, bench.driver().current_max) = (driver_state::IDLE, 0.0);
                bench.driver_obeys = false;
            }
            Self::DriverCut => bench.driver().state = driver_state::DISABLED,
            Self::DriverFault => bench.driver().fault = 7,
            Self::OverCurrent => bench.driver().over_current = true,
            Self::Overruns => bench.seen.missed = 10,
            Self::RequestNotFinite => bench.seen.request_finite = false,
            Self::WritesFail => bench.seen.write_failed = true,
            Self::PosesDisagree => bench.seen.pose_error = 1.0,
            Self::NotFollowing => bench.seen.astray.current = 2.0,
            Self::EchoStops => bench.echo_alive = false,
            Self::DriverRestarts => bench.driver().life += 1,
            Self::SensorRestarts => bench.seen.pose_life = Some(42),
            Self::TargetRefused => {
                let obstacle = Obstacle::BranchEnds;
                bench.seen.verdict = Verdict::Refused { obstacle, progress: 0.5 };
            }
            Self::NearSnap => bench.seen.margin = 0.05,
            Self::Snapped => bench.seen.margin = -0.05,
            Self::OtherDescription => bench.seen.description_mismatch = true,
            Self::RampStalls => {
                bench.driver_obeys = false;
                _ = bench.ask(Verb::Stop);
            }
            Self::PosesOutside => {
                let magnet = MagnetPose { position_m: [0.2, 0.0, 0.0], ..MagnetPose::default() };
                bench.seen.sample.pose =
                    Some(PoseMessage { magnet_count: 2, magnets: [magnet; 8], ..PoseMessage::default() });
                bench.seen.sample.pose_is_fresh = true;
            }
            Self::PosesTooFast => bench.shake = 0.3,
            Self::CoilOpen => bench.seen.sample.commanded.current_a[1] = -0.2,
            Self::CurrentUnasked => bench.measured().current_a[3] = 0.3,
            Self::CoilOverheats => {
                // So much only to be quick about it; the driver's over-current is another matter.
                bench.measured().current_a[0] = 200.0;
                bench.seen.sample.commanded.current_a[0] = 200.0;
            }
            Self::ModelStaysOff => bench.seen.pose_error = 0.4,
            Self::ControllerFreezes => (bench.shake, bench.controller_sees) = (0.01, false),
        }
    }
}

/// Every verb in a row, each after the one before it. A new verb does not compile until it is one of them,
/// and then fails the test below until it has its rows.
fn verb_after(verb: Option<Verb>) -> Option<Verb> {
    let target = [[0.0, 0.0, 1.0]; 8];
    match verb {
        None => Some(Verb::Arm),
        Some(Verb::Arm) => Some(Verb::Go),
        Some(Verb::Go) => Some(Verb::Hold),
        Some(Verb::Hold) => Some(Verb::Retreat),
        Some(Verb::Retreat) => Some(Verb::Stop),
        Some(Verb::Stop) => Some(Verb::Terminate),
        Some(Verb::Terminate) => Some(Verb::Reset),
        Some(Verb::Reset) => Some(Verb::EmergencyStop),
        Some(Verb::EmergencyStop) => Some(Verb::SetTarget(target.into())),
        Some(Verb::SetTarget(_)) => Some(Verb::StreamTarget(target.into(), ms(200))),
        Some(Verb::StreamTarget(..)) => None,
    }
}

/// A letter for what may be sent.
fn told(directive: Directive) -> char {
    match directive {
        Directive::Silent => '.',
        Directive::Claim => 'C',
        Directive::Rest => '0',
        Directive::Begin => 'B',
        Directive::Follow => 'F',
        Directive::Hold => 'H',
        Directive::Retreat => 'T',
        Directive::RampDown => 'R',
        Directive::Release => 'L',
        Directive::Disable => 'X',
    }
}

/// True for what lets current flow.
fn energises(directive: Directive) -> bool {
    matches!(directive, Directive::Begin | Directive::Follow | Directive::Hold | Directive::Retreat)
}

/// Goal: each event in each place, half a second later: where it leads, by the letters of `places`, and what
/// is sent there, by those of `told`. The columns are the places before: `b`oot, `i`dle, claiming (`q`) with
/// a driver about to confirm and with one that does not answer, `a`rmed, a`c`tive, `h`olding, holding b`l`ind
/// and `n`ear a snap-through, `r`etreating from there, `s`topping, stopping with currents `k`ept, a `f`ault that cut, and two that did
/// not (`m`): all well by now, and poses still missing.
///
/// Proves SR-03, SR-14 and SR-21.
#[test]
fn every_event_in_every_place_leads_where_the_table_says() {
    use Event::{
        Ask, AuthorityLost, CoilOpen, CoilOverheats, ControllerFreezes, CurrentUnasked, DriverCut,
        DriverFault, DriverRestarts, EchoStops, FeedbackStops, FieldInvalid, ModelFails, ModelStaysOff,
        NearSnap, NotFollowing, OtherDescription, OverCurrent, Overruns, PosesDisagree, PosesOutside,
        PosesStop, PosesTooFast, RampStalls, RequestNotFinite, SensorRestarts, Snapped, TargetRefused,
        WritesFail,
    };
    let target = [[0.0, 0.0, 1.0]; 8];
    let table: [(Event, &str, &str, Option<Cause>); 38] = [
        // biqqachlnrskfmm
        (Ask(Verb::Arm), "baaiachmnrskfmm", ".00.0FF.HTRHX..", None),
        (Ask(Verb::Go), "biaicccmnrskfmm", "..0.FFF.HTRHX..", None),
        (Ask(Verb::Hold), "biaiahhmnnskfmm", "..0.0FF.HHRHX..", None),
        (Ask(Verb::Retreat), "biaiachmrrskfmm", "..0.0FF.TTRHX..", None),
        (Ask(Verb::Stop), "biiiiiiiiismfmm", "..........R.X..", None),
        (Ask(Verb::Terminate), "biiiiiiiiismfmm", "..........R.X..", None),
        (Ask(Verb::Reset), "biaiachmnrskiim", "..0.0FF.HTRH...", None),
        (Ask(Verb::EmergencyStop), "fffffffffffffff", "XXXXXXXXXXXXXXX", Some(Cause::EmergencyStop)),
        (Ask(Verb::SetTarget(target.into())), "biaiachmccskfmm", "..0.0FF.FFRHX..", None),
        (
            Ask(Verb::StreamTarget(target.into(), Duration::from_millis(200))),
            "biaiahhmhhskfmm",
            "..0.0FF.FFRHX..",
            None,
        ),
        (PosesStop, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::PoseStale)),
        (ModelFails, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::ModelNotConverged)),
        (FieldInvalid, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::FieldModelInvalid)),
        (FeedbackStops, "bisissssssssfmm", "..R.RRRRRRRRX..", Some(Cause::FeedbackStale)),
        (AuthorityLost, "biiimmmmmmimfmm", "............X..", Some(Cause::AuthorityLost)),
        (DriverCut, "biaiffffffsmfmm", "..0.XXXXXXR.X..", Some(Cause::DriverDisabled)),
        (DriverFault, "bffffffffffffff", ".XXXXXXXXXXXXXX", Some(Cause::DriverFault)),
        (OverCurrent, "bffffffffffffff", ".XXXXXXXXXXXXXX", Some(Cause::OverCurrent)),
        (Overruns, "bimimmmmmmskfmm", "..........RHX..", Some(Cause::Overruns)),
        (RequestNotFinite, "biaiammmnrskfmm", "..0.0...HTRHX..", Some(Cause::RequestNotFinite)),
        (WritesFail, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::CommandNotSent)),
        (PosesDisagree, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::PoseImplausible)),
        (NotFollowing, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::NotFollowing)),
        (EchoStops, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::FeedbackStale)),
        (DriverRestarts, "biaimmmmmmsmfmm", "..0.......R.X..", Some(Cause::AuthorityLost)),
        (SensorRestarts, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::SensorRestarted)),
        (TargetRefused, "biaiachmnrskfmm", "..0.0FF.HTRHX..", None),
        (NearSnap, "biaiannmnrskfmm", "..0.0HH.HTRHX..", None),
        (Snapped, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::StabilityLost)),
        (OtherDescription, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::DescriptionMismatch)),
        (RampStalls, "biiiiffffffffmm", ".....XXXXXXXX..", Some(Cause::RampTimeout)),
        (PosesOutside, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::PoseOutsideWorkspace)),
        (PosesTooFast, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::PoseTooFast)),
        (CoilOpen, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::CoilOpen)),
        (CurrentUnasked, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::NotFollowing)),
        (CoilOverheats, "bimimmmmmmsmfmm", "..........R.X..", Some(Cause::CoilOverheated)),
        (ModelStaysOff, "biaiammmmmfkfmm", "..0.0.....XHX..", Some(Cause::ModelOff)),
        (ControllerFreezes, "biaiammmmmskfmm", "..0.0.....RHX..", Some(Cause::NotProgressing)),
    ];
    let named = |cause: &Cause| table.iter().any(|(_, _, _, found)| *found == Some(*cause));
    let faults = Cause::ALL.iter().filter(|cause| response(**cause) >= Response::Trip);
    assert_eq!(faults.filter(|cause| !named(cause)).count(), 0, "every cause of a fault stands in the table");
    for verb in std::iter::successors(verb_after(None), |verb| verb_after(Some(*verb))) {
        let asked = |event: &Event| matches!(event, Event::Ask(asked) if *asked == verb);
        assert!(table.iter().any(|(event, ..)| asked(event)), "{verb:?} stands in the table");
    }
    for letter in LETTERS.chars() {
        assert!(Place::ALL.iter().any(|place| place.letter() == letter), "{letter} has a column");
    }
    for (event, row, sent, cause) in table {
        for (place, (expected, sent)) in Place::ALL.into_iter().zip(row.chars().zip(sent.chars())) {
            let (decision, after) = happens(event, place);
            let found = (after, told(decision.directive));
            assert_eq!(found, (expected, sent), "{event:?} in {place:?}");
            let stopped = "qachnr".contains(place.letter()) && "smf".contains(after);
            if let (true, Some(cause)) = (stopped, cause) {
                assert_eq!(decision.cause, Some(cause), "{event:?} in {place:?}");
            }
        }
    }
}

/// The last decision after an event in a place, and where it led. Nothing but `go` lets current flow where
/// none did.
fn happens(event: Event, place: Place) -> (Decision, char) {
    let mut bench = place.bench(&shipped());
    let first = bench.directives.len() - 1;
    let decision = event.happen(&mut bench);
    let begins = bench.directives[first..].windows(2).any(|pair| !energises(pair[0]) && energises(pair[1]));
    assert!(
        !begins || matches!(event, Event::Ask(Verb::Go)),
        "{event:?} in {place:?}: {:?}",
        bench.directives
    );
    (decision, letter(bench.supervisor.state(), bench.now))
}

/// Goal: the table of when causes are over, by every fault: refused while it lasts where it can be seen to last, allowed
/// once all is well, and nothing leaves the fault meanwhile.
///
/// Proves SR-03.
#[test]
fn resets_are_refused_while_the_cause_lasts_and_work_once_it_is_over() {
    for (event, cause, lasts) in Event::FAULTS {
        let mut bench = Bench::active();
        event.happen(&mut bench);
        // A driver that says nothing, or whose currents stay, shows no end of the ramp.
        let latched = bench.until(state::FAULT, ms(1_500)).map_or(state::FAULT, |_| state::FAULT);
        assert_eq!(bench.cycle(None).state, latched, "{event:?}");
        let present = bench.cycle(None).cause.expect("a fault has one");
        assert!(present == cause || present == Cause::RampTimeout, "{event:?}: {present:?}");
        let answer = bench.ask(Verb::Reset);
        assert_eq!(answer.is_err(), lasts, "{event:?}: {answer:?}");
        bench.heal();
        // A coil that took up several times its limit cools for some time constants of 400 s.
        bench.cycles(if event.heats() { 1_200_000 } else { 1_500 });
        let expected = if lasts { state::FAULT } else { state::IDLE };
        assert_eq!(bench.cycle(None).state, expected, "{event:?}: nothing resumes by itself");
        if lasts {
            assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE), "{event:?}");
        }
        // Another driver or sensor, and all else, can be armed anew.
        bench.driver().state = driver_state::IDLE;
        bench.driver().current_max = 0.0;
        assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED), "{event:?}");
        assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE), "{event:?}");
    }
}

/// Goal: by every fault in a loop that steers: a passive daemon goes on and tells what it would have tripped for where it
/// is a monitor's, and does what an active one does where it is not.
///
/// Proves SR-28.
#[test]
fn passive_monitors_tell_and_do_not_act_and_all_else_acts() {
    let config = DaemonConfig { mode: Mode::Passive, ..shipped() };
    for (event, cause, _) in Event::FAULTS {
        for code in [state::ACTIVE, state::HOLDING] {
            let mut bench = Bench::in_state_of(&config, code);
            let decision = event.happen(&mut bench);
            assert!(decision.passive);
            if is_monitor(cause) {
                // That currents are kept near a snap-through is part of the steering.
                let expected = if matches!(event, Event::Snapped) { state::HOLDING } else { code };
                assert_eq!(decision.state, expected, "{event:?}");
                assert_eq!(decision.judgements.worst, Some(cause), "{event:?}");
                assert_eq!(decision.judgements.count, 1, "{event:?} is told once");
                assert!(!matches!(decision.directive, Directive::RampDown | Directive::Disable));
            } else {
                assert!(matches!(decision.state, state::SAFE_STOP | state::FAULT), "{event:?}: {decision:?}");
                assert_eq!(decision.judgements.count, 0, "{event:?}");
            }
        }
    }
}

/// Goal: nothing energises more easily in passive mode: by every fault, what may be armed and what may go is the same.
///
/// Proves SR-09.
#[test]
fn passive_daemons_arm_and_go_no_more_easily_than_active_ones() {
    let passive = DaemonConfig { mode: Mode::Passive, ..shipped() };
    for (event, _, _) in Event::FAULTS {
        for (code, verb) in [(state::IDLE, Verb::Arm), (state::ARMED, Verb::Go), (state::FAULT, Verb::Go)] {
            let answer = |config: &DaemonConfig| {
                let mut bench = Bench::in_state_of(config, code);
                event.happen(&mut bench);
                bench.ask(verb)
            };
            let (active, passive) = (answer(&shipped()), answer(&passive));
            assert_eq!(
                active.is_err(),
                passive.is_err(),
                "{event:?} in {}: {active:?} {passive:?}",
                state::name(code)
            );
        }
    }
}

/// Goal: by every fault, with each action: currents are held only for causes that leave them known and harmless, are
/// never raised, and the amplifiers are cut at once where that is what is asked for.
///
/// Proves SR-10 and SR-13.
#[test]
fn safe_action_does_for_every_cause_what_it_says() {
    for action in [SafeAction::Ramp, SafeAction::HoldThenRamp, SafeAction::Disable] {
        let config = DaemonConfig { safe_action: action, safe_hold_ms: 200.0, ..shipped() };
        for (event, cause, _) in
            Event::FAULTS.into_iter().filter(|(event, _, _)| !matches!(event, Event::RampStalls))
        {
            let mut bench = Bench::active_of(&config);
            bench.driver_obeys = false;
            event.begin(&mut bench);
            let stopped =
                (0..3_000).map(|_| bench.cycle(None)).find(|decision| decision.state >= state::SAFE_STOP);
            let decision = stopped.unwrap_or_else(|| panic!("{event:?} stops"));
            let first = decision.directive;
            assert_eq!(decision.safe_action, action);
            let expected = match (response(cause), action) {
                (Response::Disable, _) | (_, SafeAction::Disable) => Directive::Disable,
                (_, SafeAction::HoldThenRamp) if holds_currents(cause) => Directive::Hold,
                _ => Directive::RampDown,
            };
            assert_eq!(first, expected, "{event:?} with {action:?}");
            if first == Directive::Hold {
                let held =
                    1 + (0..1_000).take_while(|_| bench.cycle(None).directive == Directive::Hold).count();
                assert_eq!(held, 200, "{event:?}");
                assert_eq!(bench.cycle(None).directive, Directive::RampDown, "{event:?}");
            }
        }
    }
}
