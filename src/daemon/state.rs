//! States of the daemon, what an operator may ask in them, and what they let the cycle send.
//!
//! ```text
//!        feedback of the right rig         arm                   driver echoes the epoch
//!  Boot ───────────────────────────▶ Idle ─────▶ Arming ─────────────────────────────────▶ Armed
//!                                     ▲ ▲          │ time-out: refused                       │ go
//!                                     │ └──────────┘                                         ▼
//!                       reset (refused│               go, or sensing back          ┌───── Active
//!                       while the     │               ┌────────────────────────────│────▶    │ hold, or poses
//!                       cause lasts)  │            Holding ◀───────────────────────│─────────┘ late, or near a snap
//!                                     │               │ stop, or a trip            │
//!                                     │               ▼                            │
//!                                   Fault ◀──────── SafeStop ◀─────────────────────┘
//!                                     ▲   trip, or    │
//!                                     │   time-out    └──▶ Idle, when an operator or a signal asked for it
//!                                     └── from every state but Boot: over-current, driver fault; from all: e-stop
//! ```
//!
//! What a trip does on the way to zero is configuration: ramp, hold the currents for a while and ramp then, or cut the
//! amplifiers. A stop that an operator asked for ramps.
//!
//! Near a snap-through the loop holds until another target is set, or until it has gone back, when that is asked for, along the way
//! that it came.
//!
//! Rules: nothing resumes by itself after a stop; a trip is latched before anyone is told; a worse cause
//! replaces a milder one within an episode, never the other way round.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::operator::{Cause, state};

use crate::control::ReferenceTarget;

/// Where the daemon is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum State {
    /// Waiting for feedback from a driver of the right rig.
    Boot,
    /// Outputs zero, no authority.
    Idle,
    /// Claiming authority; still idle to the outside.
    Arming {
        /// When the claim began.
        since: Stamp,
        /// Which request is to be answered.
        request_id: u32,
    },
    /// Authority held at zero current.
    Armed,
    /// Steering.
    Active,
    /// Target held: by the operator's wish the loop steers to the reference of that moment; while
    /// sensing is lost, and close to a snap-through, the currents hold, or go back the way that they came.
    Holding {
        /// True until the operator says go.
        by_operator: bool,
        /// True while poses are older than the hold limit.
        sensing_lost: bool,
        /// Whether a snap-through is near, and what is done about it.
        near_snap: NearSnap,
    },
    /// On the way to zero, as `safe_action` has it; ends on measured current.
    SafeStop {
        /// When the stop began.
        since: Stamp,
        /// Until when the currents are held; the ramp begins then.
        hold_until: Stamp,
        /// Worst cause so far.
        cause: Cause,
    },
    /// Latched until reset.
    Fault {
        /// Worst cause of the episode.
        cause: Cause,
    },
}

impl State {
    /// The code that messages carry.
    #[must_use]
    pub const fn code(&self) -> u32 {
        match self {
            Self::Boot => state::BOOT,
            Self::Idle | Self::Arming { .. } => state::IDLE,
            Self::Armed => state::ARMED,
            Self::Active => state::ACTIVE,
            Self::Holding { .. } => state::HOLDING,
            Self::SafeStop { .. } => state::SAFE_STOP,
            Self::Fault { .. } => state::FAULT,
        }
    }

    /// True where the controller closes the loop.
    #[must_use]
    pub const fn is_engaged(&self) -> bool {
        matches!(self, Self::Active | Self::Holding { sensing_lost: false, near_snap: NearSnap::No, .. })
    }

    /// True where losing the driver is a trip.
    #[must_use]
    pub const fn holds_authority(&self) -> bool {
        matches!(self, Self::Armed | Self::Active | Self::Holding { .. })
    }
}

/// What a snap-through nearby makes of a hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NearSnap {
    /// There is none.
    No,
    /// The margin of stability fell below what is allowed: the currents are kept until another target is set, or a retreat asked for.
    Kept,
    /// The actuation goes back along the way it came, until the margin is one that nobody is warned of.
    Retreating,
}

/// What an operator asks of the loop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verb {
    /// Take authority at zero current.
    Arm,
    /// Steer.
    Go,
    /// Hold the present reference.
    Hold,
    /// Go back along the way that led near a snap-through.
    Retreat,
    /// Ramp to zero, then idle.
    Stop,
    /// As `Stop`, because the process is to end: no arming afterwards.
    Terminate,
    /// Clear a latched fault.
    Reset,
    /// Cut the amplifiers.
    EmergencyStop,
    /// Steer towards these tangents, with the frames at these angles if any are given.
    SetTarget(ReferenceTarget),
    /// As `SetTarget`, one of a stream: without a newer one within this time the loop holds.
    StreamTarget(ReferenceTarget, Duration),
}

/// A verb with the number under which it is answered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Chosen by the sender.
    pub id: u32,
    /// What is asked.
    pub verb: Verb,
}

/// The loop's answer to a [`Request`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    /// Of the request.
    pub id: u32,
    /// `None` when done, else why not.
    pub refused: Option<Cause>,
    /// State code after the request.
    pub state: u32,
    /// Epoch held, 0 without authority.
    pub epoch: u64,
}

/// Most answers in one cycle: to the request of the cycle, and to the claim that it cancelled.
pub const ANSWERS_MAX: usize = 2;

/// Answers of one cycle: whom, and why not.
#[derive(Debug, Default)]
pub(super) struct Answers {
    verdicts: [Option<(u32, Option<Cause>)>; ANSWERS_MAX],
}

impl Answers {
    pub(super) fn push(&mut self, id: u32, refused: Option<Cause>) {
        if let Some(free) = self.verdicts.iter_mut().find(|verdict| verdict.is_none()) {
            *free = Some((id, refused));
        }
    }

    pub(super) fn refuse(&mut self, id: u32, cause: Cause) {
        self.push(id, Some(cause));
    }

    pub(super) fn given(&self, state: u32, epoch: u64) -> [Option<Answer>; ANSWERS_MAX] {
        self.verdicts.map(|verdict| verdict.map(|(id, refused)| Answer { id, refused, state, epoch }))
    }
}

/// What the cycle may send.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Directive {
    /// Nothing: no authority.
    Silent,
    /// Ask for authority.
    Claim,
    /// Zero currents, frames where they were measured.
    Rest,
    /// First command of an activity: exactly what was measured.
    Begin,
    /// What the controller asks for.
    Follow,
    /// The currents and angles admitted last.
    Hold,
    /// Those admitted before, the newest first.
    Retreat,
    /// Towards zero within slew.
    RampDown,
    /// Give up authority.
    Release,
    /// Cut the amplifiers.
    Disable,
}

/// A change of state, as it is told afterwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// State code before the cycle.
    pub from: u32,
    /// State code after it.
    pub to: u32,
    /// Why, when there is a cause to name.
    pub cause: Option<Cause>,
}
