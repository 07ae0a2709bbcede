//! From a cycle as it was published to what is recorded of it, and back to what the loop was given.

use magsteer_hal::operator::verb;
use magsteer_hal::record::{AbsenceMessage, CycleMessage, RequestMessage, TargetMessage};
use magsteer_hal::{CoilFeedback, Header, PoseMessage};

use super::cycle::Cycle;

/// How many coils, frames and magnets a rig has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sizes {
    /// Coils.
    pub coils: usize,
    /// Frames.
    pub frames: usize,
    /// Magnets.
    pub magnets: usize,
}

impl Cycle {
    /// What is recorded of a cycle as it was published.
    #[must_use]
    pub fn of_message(it: &CycleMessage, sizes: Sizes) -> Self {
        let Sizes { coils, frames, magnets } = sizes;
        let vectors = |all: &[[f64; 3]]| all[..magnets].to_vec();
        let angles = |target: &TargetMessage| {
            if target.names_angles == 1 { target.angle_rad[..frames].to_vec() } else { Vec::new() }
        };
        let (tick, pose, back, phases) = (&it.tick, &it.pose, &it.feedback, &it.phases);
        let has_target = it.request.verb == verb::SET_TARGET;
        let answers = || it.answers.iter().filter(|answer| answer.given == 1);
        Self {
            number: tick.number,
            deadline_ns: tick.deadline_ns,
            now_ns: tick.now_ns,
            lateness_ns: tick.lateness_ns,
            missed: tick.missed,
            execution_ns: it.execution_ns,
            read_ns: phases.read_ns,
            control_ns: phases.control_ns,
            decide_ns: phases.decide_ns,
            write_ns: phases.write_ns,
            record_ns: phases.record_ns,
            allocations: it.allocations,
            state: it.state,
            cause: it.cause,
            transition_from: it.transition_from,
            transition_to: it.transition_to,
            transition_cause: it.transition_cause,
            given_up: it.given_up,
            directive: it.directive,
            order: it.order,
            epoch: it.epoch,
            command_pose_stamp_ns: it.command_pose_stamp_ns,
            engaged: it.engaged,
            period_s: it.period_s,
            request_verb: it.request.verb,
            request_id: it.request.id,
            request_target: if has_target { vectors(&it.request.target.direction) } else { Vec::new() },
            request_target_rad: angles(&it.request.target),
            request_valid_ms: it.request.target.valid_ms,
            answer_id: answers().map(|answer| answer.id).collect(),
            answer_cause: answers().map(|answer| answer.cause).collect(),
            target_accepted: it.target_accepted,
            froze: it.froze,
            pose_received: it.pose_received,
            pose_fresh: it.pose_fresh,
            pose_stamp_ns: pose.header.source_stamp_ns,
            pose_published_ns: pose.header.publish_stamp_ns,
            pose_sequence: pose.header.sequence,
            pose_epoch: pose.header.epoch,
            pose_valid_until_ns: pose.header.valid_until_ns,
            pose_refused: it.pose_refused.code,
            pose_refused_expected: it.pose_refused.expected,
            pose_refused_actual: it.pose_refused.actual,
            position_m: pose.magnets[..magnets].iter().map(|magnet| magnet.position_m).collect(),
            orientation: pose.magnets[..magnets].iter().map(|magnet| magnet.orientation_xyzw).collect(),
            seen: pose.magnets[..magnets].iter().map(|magnet| magnet.valid).collect(),
            feedback_received: it.feedback_received,
            feedback_fresh: it.feedback_fresh,
            feedback_stamp_ns: back.header.source_stamp_ns,
            feedback_published_ns: back.header.publish_stamp_ns,
            feedback_sequence: back.header.sequence,
            feedback_epoch: back.header.epoch,
            feedback_valid_until_ns: back.header.valid_until_ns,
            feedback_refused: it.feedback_refused.code,
            feedback_refused_expected: it.feedback_refused.expected,
            feedback_refused_actual: it.feedback_refused.actual,
            accepted_sequence: back.accepted_sequence,
            accepted_epoch: back.accepted_epoch,
            description_fingerprint: back.description_fingerprint,
            commands_refused: back.commands_refused,
            limit_breaks: back.limit_breaks,
            answered_pose_stamp_ns: back.answered_pose_stamp_ns,
            answer_received_stamp_ns: back.answer_received_stamp_ns,
            driver_state: back.state,
            driver_fault: back.fault,
            pose_to_driver_ns: it.pose_to_driver_ns,
            round_trip_ns: it.round_trip_ns,
            measured_a: back.measured.current_a[..coils].to_vec(),
            requested_a: it.requested.current_a[..coils].to_vec(),
            commanded_a: it.admitted.current_a[..coils].to_vec(),
            measured_rad: back.measured.angle_rad[..frames].to_vec(),
            requested_rad: it.requested.angle_rad[..frames].to_vec(),
            commanded_rad: it.admitted.angle_rad[..frames].to_vec(),
            target: vectors(&it.target.direction),
            target_rad: angles(&it.target),
            steered_to: vectors(&it.steered_to.direction),
            steered_to_rad: angles(&it.steered_to),
            in_force: vectors(&it.in_force.direction),
            in_force_rad: angles(&it.in_force),
            desired: vectors(&it.desired_direction),
            measured: vectors(&it.measured_direction),
            predicted: vectors(&it.predicted_direction),
            bias_rad: vectors(&it.bias_rad),
            coil_gain: it.coil_gain[..coils].to_vec(),
            model_converged: it.model_converged,
            residual: it.residual,
            model_passes: it.model_passes,
            jacobian_age: it.jacobian_age,
            stability_margin: it.stability_margin,
            unstable_modes: it.unstable_modes,
            field_valid: it.field_valid,
            condition: it.condition,
            saturated: it.saturated,
            limited_magnitude: it.limited_magnitude,
            limited_slew: it.limited_slew,
            limited_range: it.limited_range,
            limited_speed: it.limited_speed,
            verdict: it.verdict,
            verdict_obstacle: it.verdict_obstacle,
            verdict_progress: it.verdict_progress,
            verdict_current_a: it.verdict_current_a,
            stability_low: it.stability_low,
            coil_heat: it.coil_heat,
            passive: it.passive,
            would_trip: it.would_trip,
            would_trip_count: it.would_trip_count,
        }
    }

    /// The newest valid poses as the loop had them; `None` before the first.
    #[must_use]
    pub fn pose(&self) -> Option<PoseMessage> {
        if self.pose_received == 0 {
            return None;
        }
        let mut pose = PoseMessage {
            magnet_count: u32::try_from(self.position_m.len()).unwrap_or(u32::MAX),
            ..PoseMessage::default()
        };
        pose.header = header(
            self.pose_sequence,
            self.pose_stamp_ns,
            self.pose_published_ns,
            self.pose_epoch,
            self.pose_valid_until_ns,
        );
        let entries = self.position_m.iter().zip(&self.orientation).zip(&self.seen);
        for (magnet, ((position, orientation), seen)) in pose.magnets.iter_mut().zip(entries) {
            (magnet.position_m, magnet.orientation_xyzw, magnet.valid) = (*position, *orientation, *seen);
        }
        Some(pose)
    }

    /// The newest valid feedback as the loop had it; `None` before the first.
    #[must_use]
    pub fn feedback(&self) -> Option<CoilFeedback> {
        if self.feedback_received == 0 {
            return None;
        }
        let mut feedback = CoilFeedback {
            accepted_sequence: self.accepted_sequence,
            accepted_epoch: self.accepted_epoch,
            description_fingerprint: self.description_fingerprint,
            commands_refused: self.commands_refused,
            limit_breaks: self.limit_breaks,
            answered_pose_stamp_ns: self.answered_pose_stamp_ns,
            answer_received_stamp_ns: self.answer_received_stamp_ns,
            state: self.driver_state,
            fault: self.driver_fault,
            coil_count: u32::try_from(self.measured_a.len()).unwrap_or(u32::MAX),
            pose_parameter_count: u32::try_from(self.measured_rad.len()).unwrap_or(u32::MAX),
            ..CoilFeedback::default()
        };
        feedback.header = header(
            self.feedback_sequence,
            self.feedback_stamp_ns,
            self.feedback_published_ns,
            self.feedback_epoch,
            self.feedback_valid_until_ns,
        );
        copy(&mut feedback.measured.current_a, &self.measured_a);
        copy(&mut feedback.measured.angle_rad, &self.measured_rad);
        Some(feedback)
    }

    /// The request that the loop took.
    #[must_use]
    pub fn request(&self) -> RequestMessage {
        let mut target = TargetMessage {
            names_angles: u32::from(!self.request_target_rad.is_empty()),
            valid_ms: self.request_valid_ms,
            ..TargetMessage::default()
        };
        copy(&mut target.direction, &self.request_target);
        copy(&mut target.angle_rad, &self.request_target_rad);
        RequestMessage { verb: self.request_verb, id: self.request_id, target }
    }

    /// Why the newest poses were refused.
    #[must_use]
    pub fn pose_refusal(&self) -> AbsenceMessage {
        refusal(self.pose_refused, self.pose_refused_expected, self.pose_refused_actual)
    }

    /// Why the newest feedback was refused.
    #[must_use]
    pub fn feedback_refusal(&self) -> AbsenceMessage {
        refusal(self.feedback_refused, self.feedback_refused_expected, self.feedback_refused_actual)
    }
}

fn header(sequence: u64, source: u64, published: u64, epoch: u64, valid_until: u64) -> Header {
    Header {
        sequence,
        source_stamp_ns: source,
        publish_stamp_ns: published,
        epoch,
        schema: magsteer_hal::message::SCHEMA,
        flags: 0,
        valid_until_ns: valid_until,
    }
}

fn refusal(code: u32, expected: u64, actual: u64) -> AbsenceMessage {
    AbsenceMessage { expected, actual, code, reserved: 0 }
}

/// As many values as both have.
fn copy<T: Copy>(to: &mut [T], from: &[T]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
}
