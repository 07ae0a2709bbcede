//! Every place that a supervisor can be in, as the table of events tells them apart: the states, and of those
//! that hide several situations behind one code, each.

use magsteer_hal::Stamp;
use magsteer_hal::operator::state;

use super::bench::{Bench, ms};
use crate::daemon::causes::{Response, response};
use crate::daemon::config::{DaemonConfig, SafeAction};
use crate::daemon::state::{NearSnap, State, Verb};

/// Letters of the places a supervisor may be found in; a cut fault and one that leaves the amplifiers alone
/// apart.
pub(super) const LETTERS: &str = "biqachlnrskfm";

/// The letter of a state at a moment. A new state, or another thing that a state remembers, does not compile
/// until it has one.
pub(super) fn letter(state: &State, now: Stamp) -> char {
    match *state {
        State::Boot => 'b',
        State::Idle => 'i',
        State::Arming { since: _, request_id: _ } => 'q',
        State::Armed => 'a',
        State::Active => 'c',
        State::Holding { near_snap: NearSnap::Kept, by_operator: _, sensing_lost: _ } => 'n',
        State::Holding { near_snap: NearSnap::Retreating, by_operator: _, sensing_lost: _ } => 'r',
        State::Holding { sensing_lost: true, by_operator: _, near_snap: NearSnap::No } => 'l',
        State::Holding { by_operator: _, sensing_lost: false, near_snap: NearSnap::No } => 'h',
        State::SafeStop { hold_until, since: _, cause: _ } if now < hold_until => 'k',
        State::SafeStop { .. } => 's',
        State::Fault { cause } if response(cause) == Response::Disable => 'f',
        State::Fault { .. } => 'm',
    }
}

/// A place that events are tried in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    Boot,
    Idle,
    /// A claim that the driver is about to confirm.
    Arming,
    /// A claim that the driver does not answer.
    ArmingUnanswered,
    Armed,
    Active,
    /// By the operator's wish.
    Holding,
    /// For want of poses.
    HoldingBlind,
    HoldingNearSnap,
    /// Going back from there.
    Retreating,
    /// By the operator's wish; the currents stay up.
    SafeStop,
    /// By a trip whose currents are held, its cause being over.
    SafeStopHeld,
    /// Cut by an emergency stop.
    Cut,
    /// Latched by a monitor, all being well by now.
    Tripped,
    /// Latched for want of poses, which are still missing.
    TrippedStale,
}

impl Place {
    /// In the order of the table's columns.
    pub(super) const ALL: [Self; 15] = [
        Self::Boot,
        Self::Idle,
        Self::Arming,
        Self::ArmingUnanswered,
        Self::Armed,
        Self::Active,
        Self::Holding,
        Self::HoldingBlind,
        Self::HoldingNearSnap,
        Self::Retreating,
        Self::SafeStop,
        Self::SafeStopHeld,
        Self::Cut,
        Self::Tripped,
        Self::TrippedStale,
    ];

    /// The letter that the place is found under.
    pub(super) fn letter(self) -> char {
        match self {
            Self::Boot => 'b',
            Self::Idle => 'i',
            Self::Arming | Self::ArmingUnanswered => 'q',
            Self::Armed => 'a',
            Self::Active => 'c',
            Self::Holding => 'h',
            Self::HoldingBlind => 'l',
            Self::HoldingNearSnap => 'n',
            Self::Retreating => 'r',
            Self::SafeStop => 's',
            Self::SafeStopHeld => 'k',
            Self::Cut => 'f',
            Self::Tripped | Self::TrippedStale => 'm',
        }
    }

    /// A bench whose supervisor is there.
    pub(super) fn bench(self, config: &DaemonConfig) -> Bench {
        let bench = match self {
            Self::Boot => Bench::in_state_of(config, state::BOOT),
            Self::Idle => Bench::in_state_of(config, state::IDLE),
            Self::Arming => claiming(config, true),
            Self::ArmingUnanswered => claiming(config, false),
            Self::Armed => Bench::in_state_of(config, state::ARMED),
            Self::Active => Bench::in_state_of(config, state::ACTIVE),
            Self::Holding => Bench::in_state_of(config, state::HOLDING),
            Self::HoldingBlind => {
                let mut bench = Bench::active_of(config);
                bench.sensor_alive = false;
                bench.until(state::HOLDING, ms(100)).expect("poses are missed");
                bench
            }
            Self::HoldingNearSnap => {
                let mut bench = Bench::active_of(config);
                bench.seen.margin = 0.05;
                bench.cycle(None);
                bench
            }
            Self::Retreating => {
                let mut bench = Self::HoldingNearSnap.bench(config);
                assert_eq!(bench.ask(Verb::Retreat), Ok(state::HOLDING));
                bench
            }
            Self::SafeStop => Bench::in_state_of(config, state::SAFE_STOP),
            Self::SafeStopHeld => {
                let safe_action = SafeAction::HoldThenRamp;
                let config = DaemonConfig { safe_action, safe_hold_ms: 5_000.0, ..config.clone() };
                let mut bench = Bench::active_of(&config);
                bench.sensor_alive = false;
                bench.until(state::SAFE_STOP, ms(400)).expect("poses are missed");
                bench.sensor_alive = true;
                bench.cycles(60);
                bench
            }
            Self::Cut => Bench::in_state_of(config, state::FAULT),
            Self::Tripped => {
                let mut bench = Bench::active_of(config);
                bench.seen.pose_error = 1.0;
                bench.until(state::FAULT, ms(500)).expect("poses disagree");
                bench.seen.pose_error = 0.0;
                bench.cycles(60);
                bench
            }
            Self::TrippedStale => {
                let mut bench = Bench::active_of(config);
                bench.sensor_alive = false;
                bench.until(state::FAULT, ms(500)).expect("poses are missed");
                bench.cycles(60);
                bench
            }
        };
        assert_eq!(letter(bench.supervisor.state(), bench.now), self.letter(), "the bench reached {self:?}");
        bench
    }
}

fn claiming(config: &DaemonConfig, driver_obeys: bool) -> Bench {
    let mut bench = Bench::in_state_of(config, state::IDLE);
    bench.driver_obeys = driver_obeys;
    bench.cycle(Some(Verb::Arm));
    bench
}
