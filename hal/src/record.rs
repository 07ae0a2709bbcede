//! What a daemon tells of each of its cycles, for whoever records or watches it: everything that a cycle
//! was given and what it made of it, bit for bit, so that it can be done again.
//!
//! Cycles come in batches, from a thread that is not the loop's. Nothing here reaches a driver. Rules of the
//! layout are those of [`crate::message`].

use iceoryx2::prelude::ZeroCopySend;

use crate::hardware::Absent;
use crate::message::{
    Actuation, COILS_MAX, CoilFeedback, Header, MAGNETS_MAX, POSE_PARAMETERS_MAX, PoseMessage,
};

/// Most cycles of a batch: 8 ms at 1 kHz.
pub const BATCH_CYCLES: usize = 8;
/// Most answers in one cycle: to its request, and to the claim that this cancelled.
pub const CYCLE_ANSWERS: usize = 2;
/// A code or time that is not there.
pub const NONE: u32 = u32::MAX;
/// The same for times and other wide counts.
pub const NONE_NS: u64 = u64::MAX;

/// Verbs of [`RequestMessage::verb`] beside those of [`crate::operator::verb`].
pub mod own_verb {
    /// No request was taken.
    pub const NONE: u32 = 0;
    /// The process was told to end.
    pub const TERMINATE: u32 = 1_000;
}

/// When a cycle ran.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
pub struct TickMessage {
    /// Number of the period on the daemon's grid; missed ones are skipped.
    pub number: u64,
    /// Begin of this period.
    pub deadline_ns: u64,
    /// When the cycle began.
    pub now_ns: u64,
    /// From the deadline that was waited for to `now_ns`.
    pub lateness_ns: u64,
    /// Periods skipped before it.
    pub missed: u64,
}

/// Why the newest poses or feedback were refused in this cycle: [`Absent`] in numbers.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
pub struct AbsenceMessage {
    /// What was expected, where the reason has such a thing.
    pub expected: u64,
    /// What was found: a version, count, sequence, epoch, time or index, as the reason has it.
    pub actual: u64,
    /// 0 when nothing was refused; see [`AbsenceMessage::absent`].
    pub code: u32,
    /// Reserved, zero.
    pub reserved: u32,
}

impl AbsenceMessage {
    /// The reason in numbers.
    #[must_use]
    pub fn new(absent: Option<Absent>) -> Self {
        let (code, expected, actual) = match absent {
            None => (0, 0, 0),
            Some(Absent::NeverReceived) => (1, 0, 0),
            Some(Absent::Schema { expected, actual }) => (2, expected.into(), actual.into()),
            Some(Absent::Count { expected, actual, .. }) => (3, expected.into(), actual.into()),
            Some(Absent::Implausible { index, .. }) => (4, 0, index.into()),
            Some(Absent::Sequence { last, actual }) => (5, last, actual),
            Some(Absent::FutureStamp { ahead_ns }) => (6, 0, ahead_ns),
            Some(Absent::NotSeen { magnet }) => (7, 0, magnet.into()),
            Some(Absent::Expired { late_ns }) => (8, 0, late_ns),
            Some(Absent::FormerEpoch { last, actual }) => (9, last, actual),
            Some(Absent::Transport) => (10, 0, 0),
            Some(Absent::Description { expected, actual }) => (11, expected, actual),
        };
        Self { expected, actual, code, reserved: 0 }
    }

    /// The reason, but for the words that numbers do not carry; `None` when nothing was refused, or for a
    /// code that this version does not know.
    #[must_use]
    pub fn absent(&self) -> Option<Absent> {
        let Self { expected, actual, .. } = *self;
        let narrow = |value: u64| u32::try_from(value).unwrap_or(u32::MAX);
        Some(match self.code {
            1 => Absent::NeverReceived,
            2 => Absent::Schema { expected: narrow(expected), actual: narrow(actual) },
            3 => Absent::Count { what: "entries", expected: narrow(expected), actual: narrow(actual) },
            4 => Absent::Implausible { what: "a value", index: narrow(actual) },
            5 => Absent::Sequence { last: expected, actual },
            6 => Absent::FutureStamp { ahead_ns: actual },
            7 => Absent::NotSeen { magnet: narrow(actual) },
            8 => Absent::Expired { late_ns: actual },
            9 => Absent::FormerEpoch { last: expected, actual },
            10 => Absent::Transport,
            11 => Absent::Description { expected, actual },
            _ => return None,
        })
    }
}

/// Where magnets are to point, and frames to stand.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct TargetMessage {
    /// Unit tangent of each magnet, world; zero before the first target.
    pub direction: [[f64; 3]; MAGNETS_MAX],
    /// Where each frame shall stand, when `names_angles` is 1.
    pub angle_rad: [f64; POSE_PARAMETERS_MAX],
    /// 1 when the target names frame angles.
    pub names_angles: u32,
    /// For one of a stream of targets, how long it is valid without a newer one; 0 for a target that stays.
    pub valid_ms: u32,
}

/// The request that a cycle took.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
pub struct RequestMessage {
    /// One of [`crate::operator::verb`] or [`own_verb`].
    pub verb: u32,
    /// Number under which it is answered.
    pub id: u32,
    /// Its target, for [`crate::operator::verb::SET_TARGET`].
    pub target: TargetMessage,
}

/// An answer that a cycle gave.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
pub struct AnswerMessage {
    /// Epoch held, 0 without authority.
    pub epoch: u64,
    /// Of the request; meaningless while `given` is 0.
    pub id: u32,
    /// 1 when there is an answer.
    pub given: u32,
    /// Cause code of a refusal, 0 when done.
    pub cause: u32,
    /// State code after it.
    pub state: u32,
}

/// How long each phase of a cycle took.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend)]
pub struct PhasesMessage {
    /// From the tick until requests and messages are taken.
    pub read_ns: u64,
    /// The controller's step.
    pub control_ns: u64,
    /// Supervisor and gate.
    pub decide_ns: u64,
    /// Handing the command to the transport.
    pub write_ns: u64,
    /// Putting the record together.
    pub record_ns: u64,
}

/// One cycle of the daemon.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("magsteer_cycle_v2")]
pub struct CycleMessage {
    /// When it ran.
    pub tick: TickMessage,
    /// Newest valid poses; meaningless while `pose_received` is 0.
    pub pose: PoseMessage,
    /// Newest valid feedback; meaningless while `feedback_received` is 0.
    pub feedback: CoilFeedback,
    /// Why the newest poses were refused.
    pub pose_refused: AbsenceMessage,
    /// Why the newest feedback was refused.
    pub feedback_refused: AbsenceMessage,
    /// The request that it took.
    pub request: RequestMessage,
    /// Its answers.
    pub answers: [AnswerMessage; CYCLE_ANSWERS],
    /// Target as the operator set it last.
    pub target: TargetMessage,
    /// Target given to the controller.
    pub steered_to: TargetMessage,
    /// Target that the reference goes to, once its way was looked at.
    pub in_force: TargetMessage,
    /// Reference followed in this cycle, world.
    pub desired_direction: [[f64; 3]; MAGNETS_MAX],
    /// Tangents seen last, world.
    pub measured_direction: [[f64; 3]; MAGNETS_MAX],
    /// Tangents that the model predicts, world.
    pub predicted_direction: [[f64; 3]; MAGNETS_MAX],
    /// Bias of the model, a rotation vector a magnet, world.
    pub bias_rad: [[f64; 3]; MAGNETS_MAX],
    /// Field of every coil that the model believed in, over that of its description.
    pub coil_gain: [f64; COILS_MAX],
    /// Currents and angles that the controller asked of the gate.
    pub requested: Actuation,
    /// Currents and angles admitted last, this cycle's included.
    pub admitted: Actuation,
    /// Epoch of authority held, 0 without.
    pub epoch: u64,
    /// Exposure of the poses that the command was computed from, 0 for one that needs none.
    pub command_pose_stamp_ns: u64,
    /// Time that the controller stepped by.
    pub period_s: f64,
    /// Scaled residual of the statics.
    pub residual: f64,
    /// Margin of stability: 1 at rest, 0 where the rod snaps through.
    pub stability_margin: f64,
    /// Condition of the scaled Jacobian.
    pub condition: f64,
    /// Share of the way to the target that was looked at, or the least margin on a clear one.
    pub verdict_progress: f64,
    /// Largest current on a clear way.
    pub verdict_current_a: f64,
    /// Heat of the hottest coil: 0 when cold, 1 at the limit.
    pub coil_heat: f64,
    /// From the cycle's begin to its end.
    pub execution_ns: u64,
    /// The same by phase.
    pub phases: PhasesMessage,
    /// From the exposure of poses to the driver's receipt of their command; [`NONE_NS`] when none was told.
    pub pose_to_driver_ns: u64,
    /// From the publication of those poses to the same receipt; [`NONE_NS`] when none was told.
    pub round_trip_ns: u64,
    /// Allocations of the loop's thread in the cycles before this one, beyond the transport's.
    pub allocations: u64,
    /// How often a monitor would have tripped in passive mode.
    pub would_trip_count: u64,
    /// 1 when there are poses.
    pub pose_received: u32,
    /// 1 when they came in this cycle.
    pub pose_fresh: u32,
    /// 1 when there is feedback.
    pub feedback_received: u32,
    /// 1 when it came in this cycle.
    pub feedback_fresh: u32,
    /// State code after the cycle.
    pub state: u32,
    /// Cause code in force, 0 without one.
    pub cause: u32,
    /// State code before a change; [`NONE`] without one.
    pub transition_from: u32,
    /// State code after a change; [`NONE`] without one.
    pub transition_to: u32,
    /// Cause code of the change, 0 without one.
    pub transition_cause: u32,
    /// Cause code of a target given up, 0 without one.
    pub given_up: u32,
    /// What might be sent: 0 nothing, 1 claim, 2 rest, 3 begin, 4 follow, 5 hold, 6 ramp down, 7 release,
    /// 8 disable.
    pub directive: u32,
    /// Order sent, one of [`crate::message::order`]; [`NONE`] when nothing was.
    pub order: u32,
    /// 1 while the controller closes the loop.
    pub engaged: u32,
    /// 1 when a target was accepted.
    pub target_accepted: u32,
    /// 1 when the reference was frozen.
    pub froze: u32,
    /// One of [`crate::operator::verdict`].
    pub verdict: u32,
    /// What stands in the way: 1 limits, 2 near a snap, 3 a snap, 4 the field's range; 0 nothing.
    pub verdict_obstacle: u32,
    /// 1 while the margin of stability is warned of.
    pub stability_low: u32,
    /// 1 when the equilibrium was found.
    pub model_converged: u32,
    /// Shooting passes spent.
    pub model_passes: u32,
    /// Cycles since the Jacobian in use.
    pub jacobian_age: u32,
    /// Ways in which the rod would leave its shape.
    pub unstable_modes: u32,
    /// 0 when a magnet lies outside the field model.
    pub field_valid: u32,
    /// Actuation parameters at a limit.
    pub saturated: u32,
    /// Currents that the gate cut to their limit.
    pub limited_magnitude: u32,
    /// Currents that it held back.
    pub limited_slew: u32,
    /// Angles that it cut to their range.
    pub limited_range: u32,
    /// Angles that it held back.
    pub limited_speed: u32,
    /// 1 in passive mode.
    pub passive: u32,
    /// Code of the worst cause for which a passive daemon would have tripped, 0 without one.
    pub would_trip: u32,
}

/// Some cycles in their order.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("magsteer_record_batch_v2")]
pub struct RecordBatch {
    /// Common header; `epoch` is the daemon's life, `sequence` rises by one with every batch.
    pub header: Header,
    /// How many cycles came to the publisher before the first of this batch, since the daemon's start.
    pub begin: u64,
    /// Cycles that never came to it, since the daemon's start.
    pub dropped: u64,
    /// First eight bytes of the SHA-256 of the daemon's resolved configuration, big-endian; 0 when unknown.
    pub config_digest: u64,
    /// Cycles in this batch.
    pub count: u32,
    /// 1 when the loop has ended and no batch follows.
    pub is_last: u32,
    /// 1 when the daemon refuses to arm because real time is missing.
    pub realtime_missing: u32,
    /// Reserved, zero.
    pub reserved: u32,
    /// The cycles, `count` of them.
    pub cycles: [CycleMessage; BATCH_CYCLES],
}

impl Default for RecordBatch {
    fn default() -> Self {
        Self {
            header: Header::default(),
            begin: 0,
            dropped: 0,
            config_digest: 0,
            count: 0,
            is_last: 0,
            realtime_missing: 0,
            reserved: 0,
            cycles: [CycleMessage::default(); BATCH_CYCLES],
        }
    }
}

impl RecordBatch {
    /// The cycles in use; a count beyond the capacity is cut to it.
    #[must_use]
    pub fn used(&self) -> &[CycleMessage] {
        &self.cycles[..(self.count as usize).min(BATCH_CYCLES)]
    }
}

#[cfg(test)]
mod tests {
    use super::{AbsenceMessage, Absent};

    /// Goal: a refusal comes back from its numbers as it was, but for its words.
    #[test]
    fn refusals_survive_their_numbers() {
        let refusals = [
            Absent::NeverReceived,
            Absent::Schema { expected: 1, actual: 2 },
            Absent::Count { what: "entries", expected: 2, actual: 3 },
            Absent::Implausible { what: "a value", index: 4 },
            Absent::Sequence { last: u64::MAX, actual: 5 },
            Absent::FutureStamp { ahead_ns: 6 },
            Absent::NotSeen { magnet: 7 },
            Absent::Expired { late_ns: 8 },
            Absent::FormerEpoch { last: 9, actual: 10 },
            Absent::Transport,
            Absent::Description { expected: 11, actual: 12 },
        ];
        for refused in refusals {
            assert_eq!(AbsenceMessage::new(Some(refused)).absent(), Some(refused));
        }
        assert_eq!(AbsenceMessage::new(None).absent(), None);
        assert_eq!(AbsenceMessage { code: 99, ..AbsenceMessage::default() }.absent(), None);
    }
}
