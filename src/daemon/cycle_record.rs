//! What is known of one cycle when it has ended: for statistics, status and the flight recorder.

use std::time::Duration;

use magsteer_hal::gate::Limited;
use magsteer_hal::{Absent, Actuation, CoilFeedback, Stamp};

use super::clock::Tick;
use super::phases::PhaseTimes;
use super::receipt::Receipt;
use super::state::{Directive, Request};
use super::statistics::CycleTiming;
use super::supervisor::Decision;
use crate::control::{CycleInput, CycleOutcome, ReferenceTarget};

/// Everything about one cycle; enough to replay it.
#[derive(Debug, Clone, Copy)]
pub struct CycleRecord {
    /// When it ran.
    pub tick: Tick,
    /// What the controller was given.
    pub input: CycleInput,
    /// What the controller decided.
    pub outcome: CycleOutcome,
    /// What the supervisor decided.
    pub decision: Decision,
    /// The request that it took.
    pub request: Option<Request>,
    /// Newest valid feedback.
    pub feedback: Option<CoilFeedback>,
    /// True when that came in this cycle.
    pub feedback_is_fresh: bool,
    /// Why the newest poses were refused, when they were.
    pub pose_refused: Option<Absent>,
    /// Why the newest feedback was refused, when it was.
    pub feedback_refused: Option<Absent>,
    /// Order sent, one of [`magsteer_hal::message::order`]; `None` when nothing was sent.
    pub order: Option<u32>,
    /// Entries that the gate had to change.
    pub limited: Limited,
    /// Currents and angles admitted last, this cycle's included.
    pub admitted: Actuation,
    /// Target as set last; zero before the first.
    pub target: ReferenceTarget,
    /// The driver's receipt of poses answered, when its feedback told of one in this cycle.
    pub receipt: Option<Receipt>,
    /// Execution time; filled in by whoever has a clock.
    pub execution: Duration,
    /// The same by phase.
    pub phases: PhaseTimes,
    /// Allocations of the loop's thread in the cycles before, as `LoopEnd::allocations`; filled in by whoever
    /// counts them.
    pub allocations: u64,
}

impl CycleRecord {
    /// Age of the newest valid feedback.
    #[must_use]
    pub fn feedback_age(&self) -> Option<Duration> {
        let stamp = Stamp::from_nanoseconds(self.feedback?.header.publish_stamp_ns);
        Some(self.tick.now.since(stamp))
    }

    /// Age of the newest valid poses.
    #[must_use]
    pub fn pose_age(&self) -> Option<Duration> {
        self.pose_stamp().map(|stamp| self.tick.now.since(stamp))
    }

    /// Exposure of the newest valid poses.
    #[must_use]
    pub fn pose_stamp(&self) -> Option<Stamp> {
        self.input.pose.as_ref().map(|pose| pose.header.source_stamp())
    }

    /// The times of the cycle, once [`Self::execution`] is filled in.
    #[must_use]
    pub fn timing(&self) -> CycleTiming {
        let exposed = self.pose_stamp().filter(|_| self.answers_fresh_poses());
        let sent = self.tick.now.after(self.phases.until_sent());
        CycleTiming {
            lateness: self.tick.lateness,
            execution: self.execution,
            phases: self.phases,
            missed: self.tick.missed,
            pose_age: self.pose_age(),
            pose_to_command: exposed.map(|stamp| sent.since(stamp)),
            receipt: self.receipt,
        }
    }

    /// Fills in how long the cycle took.
    pub fn note_times(&mut self, phases: PhaseTimes) {
        self.execution = phases.total();
        self.phases = phases;
    }

    /// True when a command computed from poses that came in this cycle was sent.
    #[must_use]
    pub fn answers_fresh_poses(&self) -> bool {
        self.input.pose_is_fresh && self.decision.directive == Directive::Follow && self.order.is_some()
    }
}
