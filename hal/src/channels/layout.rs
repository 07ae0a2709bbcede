//! A hash over the memory layout of every message, stated with each service: the transport compares a type's
//! name and size alone, and would let two builds with swapped fields talk.

use std::mem::{align_of, offset_of, size_of};

use sha2::{Digest, Sha256};

use crate::binding::{Field, HasKind, Kind, Layout};
use crate::fault::{FaultAnswer, FaultRequest};
use crate::message::{Actuation, CoilCommand, CoilFeedback, Header, MagnetPose, PoseMessage, SCHEMA};
use crate::operator::{
    LoopTiming, OperatorAnswer, OperatorRequest, PhaseQuantiles, Quantiles, StatusMessage,
};
use crate::record::{
    AbsenceMessage, AnswerMessage, CycleMessage, PhasesMessage, RecordBatch, RequestMessage, TargetMessage,
    TickMessage,
};

/// Takes down name, size, alignment and every field's offset and kind. The destructuring stops the build
/// when a field is missing.
macro_rules! layout {
    ($found:ident, $type:ident { $($field:ident),+ $(,)? }) => {
        let _every_field_is_named = |$type { $($field: _),+ }: $type| ();
        $found.push(Layout {
            name: stringify!($type),
            size: size_of::<$type>(),
            align: align_of::<$type>(),
            fields: vec![$(Field {
                name: stringify!($field),
                offset: offset_of!($type, $field),
                kind: kind_of(|value: &$type| &value.$field),
            }),+],
        });
    };
}

/// The kind of what `field` points to.
fn kind_of<T, F: HasKind>(_field: fn(&T) -> &F) -> Kind {
    F::kind()
}

/// The layouts of all messages, parts before what holds them.
pub(crate) fn layouts() -> Vec<Layout> {
    let mut found = Vec::new();
    layout!(
        found,
        Header { sequence, source_stamp_ns, publish_stamp_ns, epoch, schema, flags, valid_until_ns }
    );
    layout!(found, MagnetPose { position_m, orientation_xyzw, valid, reserved });
    layout!(found, PoseMessage { header, magnet_count, reserved, magnets });
    layout!(found, Actuation { current_a, angle_rad });
    layout!(
        found,
        CoilCommand { header, token, order, coil_count, pose_parameter_count, reserved, actuation }
    );
    layout!(
        found,
        CoilFeedback {
            header,
            accepted_sequence,
            accepted_epoch,
            description_fingerprint,
            commands_refused,
            limit_breaks,
            answered_pose_stamp_ns,
            answer_received_stamp_ns,
            state,
            fault,
            coil_count,
            pose_parameter_count,
            measured,
        }
    );
    layout!(
        found,
        OperatorRequest { verb, magnet_count, direction, pose_parameter_count, valid_ms, angle_rad }
    );
    layout!(found, OperatorAnswer { accepted, cause, state, reserved, epoch });
    layout!(found, FaultRequest { action, target, part, index, verb, kind, lasts_ns, time_ns, value });
    layout!(found, FaultAnswer { accepted, reason, active, cleared });
    layout!(found, Quantiles { p50_us, p99_us, p999_us, p9999_us, max_us });
    layout!(found, PhaseQuantiles { read, control, decide, write, record });
    layout!(
        found,
        LoopTiming {
            cycles,
            missed,
            lateness,
            execution,
            phases,
            pose_age,
            pose_to_command,
            pose_to_driver,
            round_trip,
        }
    );
    layout!(
        found,
        StatusMessage {
            header,
            state,
            cause,
            cycle,
            missed,
            rate_hz,
            rate_measured_hz,
            lateness_us,
            lateness_max_us,
            pose_age_us,
            feedback_age_us,
            timing,
            last_minute,
            records_dropped,
            loop_allocations,
            stability_margin,
            magnet_count,
            coil_count,
            pose_parameter_count,
            model_converged,
            target_verdict,
            stability_low,
            recorder,
            recorder_error,
            flights,
            recorder_lost,
            passive,
            would_trip,
            would_trip_count,
            safe_action,
            coil_hot,
            coil_heat,
            target_direction,
            desired_direction,
            measured_direction,
            predicted_direction,
            coil_gain,
            modelled,
            base_force_n,
            base_moment_n_m,
            measured_position_m,
            description_fingerprint,
            measured,
            admitted,
        }
    );
    layout!(found, TickMessage { number, deadline_ns, now_ns, lateness_ns, missed });
    layout!(found, AbsenceMessage { expected, actual, code, reserved });
    layout!(found, TargetMessage { direction, angle_rad, names_angles, valid_ms });
    layout!(found, RequestMessage { verb, id, target });
    layout!(found, AnswerMessage { epoch, id, given, cause, state });
    layout!(found, PhasesMessage { read_ns, control_ns, decide_ns, write_ns, record_ns });
    layout!(
        found,
        CycleMessage {
            tick,
            pose,
            feedback,
            pose_refused,
            feedback_refused,
            request,
            answers,
            target,
            steered_to,
            in_force,
            desired_direction,
            measured_direction,
            predicted_direction,
            bias_rad,
            coil_gain,
            requested,
            admitted,
            epoch,
            command_pose_stamp_ns,
            period_s,
            residual,
            stability_margin,
            condition,
            verdict_progress,
            verdict_current_a,
            coil_heat,
            execution_ns,
            phases,
            pose_to_driver_ns,
            round_trip_ns,
            allocations,
            would_trip_count,
            pose_received,
            pose_fresh,
            feedback_received,
            feedback_fresh,
            state,
            cause,
            transition_from,
            transition_to,
            transition_cause,
            given_up,
            directive,
            order,
            engaged,
            target_accepted,
            froze,
            verdict,
            verdict_obstacle,
            stability_low,
            model_converged,
            model_passes,
            jacobian_age,
            unstable_modes,
            field_valid,
            saturated,
            limited_magnitude,
            limited_slew,
            limited_range,
            limited_speed,
            passive,
            would_trip
        }
    );
    layout!(
        found,
        RecordBatch {
            header,
            begin,
            dropped,
            config_digest,
            count,
            is_last,
            realtime_missing,
            reserved,
            cycles
        }
    );
    found
}

/// The layouts as the hash is taken over them.
fn text() -> String {
    let mut text = format!("schema {SCHEMA}\n");
    for layout in layouts() {
        text.push_str(&format!("{} {} {}", layout.name, layout.size, layout.align));
        for field in layout.fields {
            text.push_str(&format!(" {}@{}", field.name, field.offset));
        }
        text.push('\n');
    }
    text
}

/// First eight bytes of the SHA-256 of the layouts, in hexadecimal.
pub(crate) fn schema_hash() -> String {
    Sha256::digest(text().as_bytes()).iter().take(8).map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use iceoryx2::prelude::{Node, PortFactory, ipc};

    use super::super::service::{
        COMMAND, FEEDBACK, POSE, Payload, REQUEST, STATUS, TopicSettings, create_requests, create_topic,
    };
    use super::super::{Endpoint, PrivateRoot};
    use super::{schema_hash, text};
    use crate::binding::type_names;
    use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
    use crate::operator::{OperatorAnswer, OperatorRequest, StatusMessage};

    #[test]
    fn layouts_have_no_implicit_padding() {
        // Sizes that follow from the fields alone; a hole would make them larger.
        let sizes = [
            ("Header", 5 * 8 + 2 * 4),
            ("MagnetPose", 7 * 8 + 2 * 4),
            ("PoseMessage", 48 + 8 + 8 * 64),
            ("Actuation", 40 * 8),
            ("CoilCommand", 48 + 8 + 4 * 4 + 320),
            ("CoilFeedback", 48 + 7 * 8 + 4 * 4 + 320),
            ("OperatorRequest", 8 + 8 * 24 + 8 + 8 * 8),
            ("OperatorAnswer", 4 * 4 + 8),
            ("FaultRequest", 6 * 4 + 3 * 8),
            ("Quantiles", 5 * 8),
            ("PhaseQuantiles", 5 * 40),
            ("LoopTiming", 2 * 8 + 11 * 40),
            ("TickMessage", 5 * 8),
            ("AbsenceMessage", 2 * 8 + 8),
            ("TargetMessage", 192 + 64 + 8),
            ("RequestMessage", 8 + 264),
            ("AnswerMessage", 8 + 4 * 4),
            ("PhasesMessage", 5 * 8),
            (
                "CycleMessage",
                40 + 568 + 440 + 4 * 24 + 272 + 3 * 264 + 4 * 192 + 256 + 2 * 320 + 14 * 8 + 40 + 30 * 4,
            ),
            ("RecordBatch", 48 + 3 * 8 + 4 * 4 + 8 * 4144),
            (
                "StatusMessage",
                48 + 8 + 11 * 8 + 2 * 456 + 12 * 4 + 8 + 2 * 4 + 8 + 5 * 192 + 256 + 2 * 24 + 8 + 3 * 320,
            ),
        ];
        let text = text();
        for (name, size) in sizes {
            assert!(text.contains(&format!("\n{name} {size} 8 ")), "{name}: expected {size} in\n{text}");
        }
        assert!(text.contains("\nFaultAnswer 16 4 "), "{text}");
    }

    /// Goal: the names that other languages are told are those that the transport compares.
    #[test]
    fn told_type_names_are_those_of_the_services() {
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let node = endpoint.join(Duration::ZERO).expect("a node").node;
        fn name<T: Payload>(node: &Node<ipc::Service>, endpoint: &Endpoint, topic: TopicSettings) -> String {
            let topic = create_topic::<T>(node, endpoint, topic).expect("a topic");
            topic.static_config().message_type_details().payload.type_name().to_string()
        }
        let requests = create_requests::<OperatorRequest, OperatorAnswer>(&node, &endpoint, REQUEST);
        let requests = requests.expect("a service");
        let details = requests.static_config();
        let found = [
            ("PoseMessage", name::<PoseMessage>(&node, &endpoint, POSE)),
            ("CoilCommand", name::<CoilCommand>(&node, &endpoint, COMMAND)),
            ("CoilFeedback", name::<CoilFeedback>(&node, &endpoint, FEEDBACK)),
            ("OperatorRequest", details.request_message_type_details().payload.type_name().to_string()),
            ("OperatorAnswer", details.response_message_type_details().payload.type_name().to_string()),
            ("StatusMessage", name::<StatusMessage>(&node, &endpoint, STATUS)),
        ];
        let told = type_names().map(|(message, name)| (message, name.to_owned()));
        assert_eq!(found, told);
    }

    #[test]
    fn schema_hash_is_sixteen_hexadecimal_digits() {
        let hash = schema_hash();
        assert_eq!(hash.len(), 16);
        assert!(hash.chars().all(|digit| digit.is_ascii_hexdigit()));
    }
}
