//! When a flight is due: half a second after a trip, or after the ramp that the trip began has ended.
//!
//! One flight an episode: a fault that follows a tripped ramp belongs to it. A stop that was wished for makes
//! none.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::operator::{Cause, state};

use super::header::Reason;
use crate::daemon::cycle_record::CycleRecord;

/// How long a flight goes on after its trip.
pub const AFTER: Duration = Duration::from_millis(500);
/// The least code of a cause that nobody wished for; see [`Cause`].
const TRIP_CODE_MIN: u32 = 200;

/// What a flight is about, until it is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Trip {
    /// Why.
    pub reason: Reason,
    /// Cycle of the trip.
    pub cycle: u64,
    /// When it began.
    pub at: Stamp,
    /// State code before.
    pub from: u32,
    /// State code after.
    pub to: u32,
    /// Cause code, 0 without one.
    pub cause: u32,
    /// Worst cause code since.
    pub worst_cause: u32,
    due: Stamp,
}

/// Sees trips, and remembers one until its flight is due.
#[derive(Debug)]
pub struct Trigger {
    pending: Option<Trip>,
    /// Longest time from a trip to its flight, so that the trip stays in the ring.
    patience: Duration,
}

impl Trigger {
    /// For a ring that reaches back this far before a trip.
    pub fn new(reach: Duration) -> Self {
        Self { pending: None, patience: (reach / 2).max(AFTER) }
    }

    /// Looks at one cycle; the trip whose flight is due now.
    pub fn take(&mut self, record: &CycleRecord) -> Option<Trip> {
        let now = record.tick.now;
        if let Some(trip) = trip(record) {
            match &mut self.pending {
                Some(pending) if pending.reason != Reason::Operator => {
                    pending.due = now.after(AFTER);
                }
                // An order is served by the flight of the trip.
                pending => *pending = Some(trip),
            }
        }
        let pending = self.pending.as_mut()?;
        if pending.reason != Reason::Operator {
            let cause = record.decision.cause.map_or(0, Cause::code);
            pending.worst_cause = pending.worst_cause.max(cause);
            if record.decision.state == state::SAFE_STOP {
                pending.due = now.after(AFTER);
            }
        }
        let is_due = now >= pending.due || now.since(pending.at) >= self.patience;
        if is_due { self.pending.take() } else { None }
    }

    /// An operator asks for a flight, at the newest cycle; nothing changes when one is due already.
    pub fn order(&mut self, record: &CycleRecord) {
        let after = record.tick.now.after(AFTER);
        self.pending.get_or_insert_with(|| Trip { due: after, ..plain(Reason::Operator, record) });
    }

    /// The loop has ended, `newest` being its last cycle: what is due now.
    pub fn end(&mut self, newest: &CycleRecord) -> Option<Trip> {
        let ended = matches!(newest.decision.state, state::BOOT | state::IDLE | state::FAULT);
        let died = (!ended).then(|| plain(Reason::LoopDied, newest));
        self.pending.take().or(died)
    }
}

/// A trip in this very cycle.
fn trip(record: &CycleRecord) -> Option<Trip> {
    let transition = record.decision.transition?;
    let cause = transition.cause.map_or(0, Cause::code);
    let reason = match transition.to {
        state::FAULT => Reason::Fault,
        state::SAFE_STOP if cause >= TRIP_CODE_MIN => Reason::SafeStop,
        _ => return None,
    };
    let (from, to, due) = (transition.from, transition.to, record.tick.now.after(AFTER));
    Some(Trip { from, to, cause, worst_cause: cause, due, ..plain(reason, record) })
}

/// About a cycle in which nothing changed.
fn plain(reason: Reason, record: &CycleRecord) -> Trip {
    let cause = record.decision.cause.map_or(0, Cause::code);
    Trip {
        reason,
        cycle: record.tick.number,
        at: record.tick.now,
        from: record.decision.state,
        to: record.decision.state,
        cause,
        worst_cause: cause,
        due: record.tick.now,
    }
}
