//! A cycle as it is published, and what of it comes back: requests, for whoever does the cycle again.

use std::time::Duration;

use magsteer_hal::message::order;
use magsteer_hal::operator::{Cause, verb, verdict};
use magsteer_hal::record::{
    AbsenceMessage, AnswerMessage, CYCLE_ANSWERS, CycleMessage, NONE, NONE_NS, PhasesMessage, RequestMessage,
    TargetMessage, TickMessage, own_verb,
};

use super::clock::Tick;
use super::cycle_record::CycleRecord;
use super::phases::PhaseTimes;
use super::state::{Answer, Directive, Request, Verb};
use crate::control::plan::Obstacle;
use crate::control::{ReferenceTarget, Verdict};

/// The message of a cycle.
#[must_use]
pub fn cycle_message(record: &CycleRecord) -> CycleMessage {
    let (decision, outcome, input) = (&record.decision, &record.outcome, &record.input);
    let (verdict, obstacle, progress, current) = verdict_in_numbers(&decision.verdict);
    let transition = decision.transition;
    CycleMessage {
        tick: tick(&record.tick),
        pose: input.pose.unwrap_or_default(),
        feedback: record.feedback.unwrap_or_default(),
        pose_refused: AbsenceMessage::new(record.pose_refused),
        feedback_refused: AbsenceMessage::new(record.feedback_refused),
        request: record.request.as_ref().map_or_else(RequestMessage::default, request_message),
        answers: answers(&decision.answers),
        target: target_message(&record.target),
        steered_to: target_message(&input.target),
        in_force: target_message(&outcome.in_force),
        desired_direction: outcome.desired,
        measured_direction: outcome.measured,
        predicted_direction: outcome.predicted,
        bias_rad: outcome.bias,
        coil_gain: outcome.gains,
        requested: outcome.request,
        admitted: record.admitted,
        epoch: decision.epoch,
        command_pose_stamp_ns: command_pose_stamp_ns(record),
        period_s: input.period,
        residual: outcome.model.residual,
        stability_margin: outcome.model.margin,
        condition: outcome.condition,
        verdict_progress: progress,
        verdict_current_a: current,
        coil_heat: decision.coil_heat,
        execution_ns: nanoseconds(record.execution),
        phases: phases(&record.phases),
        pose_to_driver_ns: record.receipt.map_or(NONE_NS, |receipt| nanoseconds(receipt.pose_to_driver)),
        round_trip_ns: record.receipt.map_or(NONE_NS, |receipt| nanoseconds(receipt.round_trip)),
        allocations: record.allocations,
        would_trip_count: decision.judgements.count,
        pose_received: input.pose.is_some().into(),
        pose_fresh: input.pose_is_fresh.into(),
        feedback_received: record.feedback.is_some().into(),
        feedback_fresh: record.feedback_is_fresh.into(),
        state: decision.state,
        cause: code(decision.cause),
        transition_from: transition.map_or(NONE, |transition| transition.from),
        transition_to: transition.map_or(NONE, |transition| transition.to),
        transition_cause: transition.map_or(0, |transition| code(transition.cause)),
        given_up: code(decision.given_up),
        directive: decision.directive as u32,
        order: record.order.unwrap_or(NONE),
        engaged: input.engaged.into(),
        target_accepted: decision.target.is_some().into(),
        froze: decision.froze.into(),
        verdict,
        verdict_obstacle: obstacle,
        stability_low: decision.stability_low.into(),
        model_converged: outcome.model.converged.into(),
        model_passes: outcome.model.passes,
        jacobian_age: outcome.model.jacobian_age,
        unstable_modes: outcome.model.unstable_modes,
        field_valid: outcome.model.field_valid.into(),
        saturated: outcome.saturated,
        limited_magnitude: record.limited.magnitude,
        limited_slew: record.limited.slew,
        limited_range: record.limited.range,
        limited_speed: record.limited.speed,
        passive: decision.passive.into(),
        would_trip: code(decision.judgements.worst),
    }
}

/// The request of a message; `None` when the cycle took none, or one that this version does not know.
#[must_use]
pub fn taken_request(message: &RequestMessage) -> Option<Request> {
    let verb = match message.verb {
        verb::ARM => Verb::Arm,
        verb::GO => Verb::Go,
        verb::HOLD => Verb::Hold,
        verb::RETREAT => Verb::Retreat,
        verb::STOP => Verb::Stop,
        verb::RESET => Verb::Reset,
        verb::ESTOP => Verb::EmergencyStop,
        verb::SET_TARGET if message.target.valid_ms == 0 => {
            Verb::SetTarget(reference_target(&message.target))
        }
        verb::SET_TARGET => {
            let valid = Duration::from_millis(message.target.valid_ms.into());
            Verb::StreamTarget(reference_target(&message.target), valid)
        }
        own_verb::TERMINATE => Verb::Terminate,
        _ => return None,
    };
    Some(Request { id: message.id, verb })
}

/// Digest of a configuration, as batches carry it, from its SHA-256 in hexadecimal.
#[must_use]
pub fn config_digest(sha256: &str) -> u64 {
    sha256.get(..16).and_then(|head| u64::from_str_radix(head, 16).ok()).unwrap_or(0)
}

fn request_message(request: &Request) -> RequestMessage {
    let plain = |verb| RequestMessage { verb, id: request.id, target: TargetMessage::default() };
    match &request.verb {
        Verb::Arm => plain(verb::ARM),
        Verb::Go => plain(verb::GO),
        Verb::Hold => plain(verb::HOLD),
        Verb::Retreat => plain(verb::RETREAT),
        Verb::Stop => plain(verb::STOP),
        Verb::Reset => plain(verb::RESET),
        Verb::EmergencyStop => plain(verb::ESTOP),
        Verb::Terminate => plain(own_verb::TERMINATE),
        Verb::SetTarget(target) => {
            RequestMessage { target: target_message(target), ..plain(verb::SET_TARGET) }
        }
        Verb::StreamTarget(target, valid) => {
            let valid_ms = u32::try_from(valid.as_millis()).unwrap_or(u32::MAX);
            let target = TargetMessage { valid_ms, ..target_message(target) };
            RequestMessage { target, ..plain(verb::SET_TARGET) }
        }
    }
}

fn target_message(target: &ReferenceTarget) -> TargetMessage {
    TargetMessage {
        direction: target.directions,
        angle_rad: target.frame_angles.unwrap_or_default(),
        names_angles: target.frame_angles.is_some().into(),
        valid_ms: 0,
    }
}

fn reference_target(message: &TargetMessage) -> ReferenceTarget {
    let frame_angles = (message.names_angles == 1).then_some(message.angle_rad);
    ReferenceTarget { directions: message.direction, frame_angles }
}

fn answers(given: &[Option<Answer>]) -> [AnswerMessage; CYCLE_ANSWERS] {
    let mut messages = [AnswerMessage::default(); CYCLE_ANSWERS];
    for (message, answer) in messages.iter_mut().zip(given.iter().flatten()) {
        let cause = code(answer.refused);
        *message = AnswerMessage { epoch: answer.epoch, id: answer.id, given: 1, cause, state: answer.state };
    }
    messages
}

/// Nothing but following is computed from poses.
fn command_pose_stamp_ns(record: &CycleRecord) -> u64 {
    let follows = record.decision.directive == Directive::Follow && record.order == Some(order::DRIVE);
    record.pose_stamp().filter(|_| follows).map_or(0, |stamp| stamp.nanoseconds())
}

fn tick(tick: &Tick) -> TickMessage {
    TickMessage {
        number: tick.number,
        deadline_ns: tick.deadline.nanoseconds(),
        now_ns: tick.now.nanoseconds(),
        lateness_ns: nanoseconds(tick.lateness),
        missed: tick.missed,
    }
}

fn phases(phases: &PhaseTimes) -> PhasesMessage {
    PhasesMessage {
        read_ns: nanoseconds(phases.read),
        control_ns: nanoseconds(phases.control),
        decide_ns: nanoseconds(phases.decide),
        write_ns: nanoseconds(phases.write),
        record_ns: nanoseconds(phases.record),
    }
}

/// Code, obstacle, progress or margin, current.
fn verdict_in_numbers(known: &Verdict) -> (u32, u32, f64, f64) {
    const NAN: f64 = f64::NAN;
    match *known {
        Verdict::Unchecked => (verdict::UNCHECKED, 0, NAN, NAN),
        Verdict::Checking => (verdict::CHECKING, 0, NAN, NAN),
        Verdict::Clear { margin_min, current_max } => (verdict::CLEAR, 0, margin_min, current_max),
        Verdict::OutOfReach { progress } => (verdict::OUT_OF_REACH, 0, progress, NAN),
        Verdict::Refused { obstacle, progress } => {
            let obstacle = match obstacle {
                Obstacle::OutOfReach => 1,
                Obstacle::NearSnapThrough => 2,
                Obstacle::BranchEnds => 3,
                Obstacle::OutsideField => 4,
            };
            (verdict::REFUSED, obstacle, progress, NAN)
        }
    }
}

fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

fn code(cause: Option<Cause>) -> u32 {
    cause.map_or(0, Cause::code)
}

#[cfg(test)]
mod tests {
    use super::{Duration, ReferenceTarget, Request, RequestMessage, Verb, request_message, taken_request};

    /// Goal: every request that the loop can take comes back as it was, so that a cycle can be done again.
    #[test]
    fn requests_come_back_as_they_were_taken() {
        let target = ReferenceTarget { directions: [[0.1, -0.2, 0.97]; 8], frame_angles: Some([0.5; 8]) };
        let verbs = [
            Verb::Arm,
            Verb::Go,
            Verb::Hold,
            Verb::Retreat,
            Verb::Stop,
            Verb::Terminate,
            Verb::Reset,
            Verb::EmergencyStop,
            Verb::SetTarget(target),
            Verb::SetTarget([[0.0, 0.0, 1.0]; 8].into()),
            Verb::StreamTarget(target, Duration::from_millis(200)),
        ];
        for (id, verb) in (7..).zip(verbs) {
            let request = Request { id, verb };
            assert_eq!(taken_request(&request_message(&request)), Some(request));
        }
        assert_eq!(taken_request(&RequestMessage::default()), None);
    }
}
