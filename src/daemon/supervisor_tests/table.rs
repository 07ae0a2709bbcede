//! Where each event leads from each state.

use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};

use super::bench::Bench;
use crate::control::Verdict;
use crate::control::plan::Obstacle;
use crate::daemon::state::Verb;
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
}

impl Event {
    /// Lets the event happen for half a second; returns the last decision.
    fn happen(self, bench: &mut Bench) -> Decision {
        match self {
            // Whether it is refused shows in the state.
            Self::Ask(verb) => _ = bench.ask(verb),
            Self::PosesStop => bench.sensor_alive = false,
            Self::ModelFails => bench.seen.model_converged = false,
            Self::FieldInvalid => bench.seen.field_valid = false,
            Self::FeedbackStops => bench.driver_alive = false,
            Self::AuthorityLost => (bench.driver().state, bench.driver_obeys) = (driver_state::IDLE, false),
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
        }
        bench.cycles(500)
    }
}

/// Goal: each event in each state, half a second later. A letter names the state: `b`oot, `i`dle, `a`rmed,
/// a`c`tive, `h`olding, `s`afe-stop, `f`ault; the columns are the states before, in the same order.
///
/// Proves SR-03, SR-14 and SR-21.
#[test]
fn every_event_in_every_state_leads_where_the_table_says() {
    use Event::{
        Ask, AuthorityLost, DriverCut, DriverFault, DriverRestarts, EchoStops, FeedbackStops, FieldInvalid,
        ModelFails, NearSnap, NotFollowing, OverCurrent, Overruns, PosesDisagree, PosesStop,
        RequestNotFinite, SensorRestarts, Snapped, TargetRefused, WritesFail,
    };
    let target = [[0.0, 0.0, 1.0]; 8];
    let table: [(Event, &str, Option<Cause>); 27] = [
        //                              biachsf
        (Ask(Verb::Arm), "baachsf", None),
        (Ask(Verb::Go), "bicccsf", None),
        (Ask(Verb::Hold), "biahhsf", None),
        (Ask(Verb::Stop), "biiiisf", None),
        (Ask(Verb::Terminate), "biiiisf", None),
        (Ask(Verb::Reset), "biachsi", None),
        (Ask(Verb::EmergencyStop), "fffffff", Some(Cause::EmergencyStop)),
        (Ask(Verb::SetTarget(target.into())), "biachsf", None),
        (PosesStop, "biaffsf", Some(Cause::PoseStale)),
        (ModelFails, "biaffsf", Some(Cause::ModelNotConverged)),
        (FieldInvalid, "biaffsf", Some(Cause::FieldModelInvalid)),
        (FeedbackStops, "bissssf", Some(Cause::FeedbackStale)),
        (AuthorityLost, "bifsssf", Some(Cause::AuthorityLost)),
        (DriverCut, "bifffsf", Some(Cause::DriverDisabled)),
        (DriverFault, "bffffff", Some(Cause::DriverFault)),
        (OverCurrent, "bffffff", Some(Cause::OverCurrent)),
        (Overruns, "bifffsf", Some(Cause::Overruns)),
        (RequestNotFinite, "biaffsf", Some(Cause::RequestNotFinite)),
        (WritesFail, "bifffsf", Some(Cause::CommandNotSent)),
        (PosesDisagree, "biaffsf", Some(Cause::PoseImplausible)),
        (NotFollowing, "bifffsf", Some(Cause::NotFollowing)),
        (EchoStops, "bifffsf", Some(Cause::FeedbackStale)),
        (DriverRestarts, "bifffsf", Some(Cause::AuthorityLost)),
        (SensorRestarts, "biaffsf", Some(Cause::SensorRestarted)),
        (TargetRefused, "biachsf", None),
        (NearSnap, "biahhsf", None),
        (Snapped, "biaffsf", Some(Cause::StabilityLost)),
    ];
    let letters = ["b", "i", "a", "c", "h", "s", "f"];
    for (event, row, cause) in table {
        for (code, expected) in (0_u32..).zip(row.chars()) {
            let mut bench = Bench::in_state(code);
            let before = bench.supervisor.state().code();
            assert_eq!(before, code, "the bench reached the state");
            let decision = event.happen(&mut bench);
            let after = letters[decision.state as usize];
            assert_eq!(after, expected.to_string(), "{event:?} in {}", state::name(code));
            let stopped = (state::ARMED..=state::HOLDING).contains(&code)
                && matches!(decision.state, state::FAULT | state::SAFE_STOP);
            if let (true, Some(cause)) = (stopped, cause) {
                assert_eq!(decision.cause, Some(cause), "{event:?} in {}", state::name(code));
            }
        }
    }
}
