use super::{FUTURE_TOLERANCE, FeedbackReceiver, PoseReceiver};
use crate::hardware::{Absent, Reading};
use crate::message::{CoilFeedback, Header, MagnetPose, PoseMessage, SCHEMA};
use crate::scripted::example_description;
use crate::time::Stamp;

const NOW: Stamp = Stamp::from_nanoseconds(1_000_000_000);
const JUST_AHEAD: u64 = NOW.nanoseconds() + FUTURE_TOLERANCE.as_nanos() as u64;

fn header(sequence: u64) -> Header {
    let stamp = NOW.nanoseconds() - 1000;
    Header {
        sequence,
        source_stamp_ns: stamp,
        publish_stamp_ns: stamp,
        epoch: 5,
        schema: SCHEMA,
        ..Header::default()
    }
}

fn pose(sequence: u64) -> PoseMessage {
    let seen = MagnetPose { orientation_xyzw: [0.0, 0.6, 0.0, 0.8], valid: 1, ..MagnetPose::default() };
    let mut message = PoseMessage { header: header(sequence), magnet_count: 2, ..PoseMessage::default() };
    message.magnets[..2].fill(seen);
    message
}

fn feedback(sequence: u64) -> CoilFeedback {
    let description_fingerprint = example_description().fingerprint();
    let mut message = CoilFeedback {
        header: header(sequence),
        description_fingerprint,
        coil_count: 3,
        pose_parameter_count: 2,
        ..CoilFeedback::default()
    };
    message.measured.current_a[1] = 2.5;
    message
}

type Spoil<T> = fn(&mut T);

/// Faults of the header, with what must be said about each.
fn header_faults() -> Vec<(Spoil<Header>, Absent)> {
    let now = NOW.nanoseconds();
    vec![
        (|header| header.schema = 0, Absent::Schema { expected: SCHEMA, actual: 0 }),
        (|header| header.schema = SCHEMA + 1, Absent::Schema { expected: SCHEMA, actual: SCHEMA + 1 }),
        (|header| header.sequence = 10, Absent::Sequence { last: 10, actual: 10 }),
        (|header| header.sequence = 9, Absent::Sequence { last: 10, actual: 9 }),
        (|header| header.sequence = 0, Absent::Sequence { last: 10, actual: 0 }),
        (
            |header| header.source_stamp_ns = JUST_AHEAD + 1,
            Absent::FutureStamp { ahead_ns: JUST_AHEAD + 1 - now },
        ),
        (
            |header| header.publish_stamp_ns = JUST_AHEAD + 1,
            Absent::FutureStamp { ahead_ns: JUST_AHEAD + 1 - now },
        ),
        (|header| header.publish_stamp_ns = u64::MAX, Absent::FutureStamp { ahead_ns: u64::MAX - now }),
        (|header| header.valid_until_ns = NOW.nanoseconds(), Absent::Expired { late_ns: 0 }),
        (|header| header.valid_until_ns = 1, Absent::Expired { late_ns: now - 1 }),
        (
            |header| {
                header.epoch = 4;
                header.publish_stamp_ns -= 1;
            },
            Absent::FormerEpoch { last: 5, actual: 4 },
        ),
    ]
}

fn assert_refused<T: Copy + PartialEq + std::fmt::Debug>(
    reading: &Reading<T>,
    last: T,
    expected: Absent,
    case: usize,
) {
    assert_eq!(*reading, Reading { last: Some(last), fresh: false, refused: Some(expected) }, "case {case}");
}

/// Proves SR-11.
#[test]
fn no_faulty_pose_replaces_the_last_good_one() {
    let mut cases: Vec<(PoseMessage, Absent)> = header_faults()
        .into_iter()
        .map(|(spoil, absent)| {
            let mut message = pose(11);
            spoil(&mut message.header);
            (message, absent)
        })
        .collect();
    let count = |actual| Absent::Count { what: "magnets", expected: 2, actual };
    let implausible = |what, index| Absent::Implausible { what, index };
    let body: Vec<(Spoil<PoseMessage>, Absent)> = vec![
        (|message| message.magnet_count = 1, count(1)),
        (|message| message.magnet_count = 3, count(3)),
        (|message| message.magnet_count = u32::MAX, count(u32::MAX)),
        (|message| message.magnets[1].valid = 0, Absent::NotSeen { magnet: 1 }),
        (|message| message.magnets[0].valid = 2, implausible("valid flag", 0)),
        (|message| message.magnets[0].position_m[2] = f64::NAN, implausible("position", 0)),
        (|message| message.magnets[1].position_m[0] = f64::INFINITY, implausible("position", 1)),
        (|message| message.magnets[1].position_m[0] = 1e300, implausible("position", 1)),
        // Twice the radius of 55 mm, and a bit.
        (|message| message.magnets[1].position_m[0] = -0.1101, implausible("position", 1)),
        (|message| message.magnets[1].orientation_xyzw = [0.0; 4], implausible("quaternion", 1)),
        (|message| message.magnets[0].orientation_xyzw[3] = f64::NAN, implausible("quaternion", 0)),
        (|message| message.magnets[0].orientation_xyzw = [f64::MAX; 4], implausible("quaternion", 0)),
        (
            |message| message.magnets[1].orientation_xyzw = [0.0, 0.0, 0.0, 1.0011],
            implausible("quaternion", 1),
        ),
        (
            |message| message.magnets[1].orientation_xyzw = [0.0, 0.0, 0.0, 0.9989],
            implausible("quaternion", 1),
        ),
    ];
    cases.extend(body.into_iter().map(|(spoil, absent)| {
        let mut message = pose(11);
        spoil(&mut message);
        (message, absent)
    }));
    let mut receiver = PoseReceiver::new(&example_description());
    let good = receiver.receive(Some(&pose(10)), NOW).last.expect("accepted");
    for (case, (message, absent)) in cases.iter().enumerate() {
        assert_refused(&receiver.receive(Some(message), NOW), good, *absent, case);
    }
    assert!(receiver.receive(Some(&pose(11)), NOW).fresh, "a good one is taken after all of that");
}

/// Proves SR-11.
#[test]
fn no_faulty_feedback_replaces_the_last_good_one() {
    let mut cases: Vec<(CoilFeedback, Absent)> = header_faults()
        .into_iter()
        .map(|(spoil, absent)| {
            let mut message = feedback(11);
            spoil(&mut message.header);
            (message, absent)
        })
        .collect();
    let expected = example_description().fingerprint();
    let count = |what, expected, actual| Absent::Count { what, expected, actual };
    let implausible = |what, index| Absent::Implausible { what, index };
    let body: Vec<(Spoil<CoilFeedback>, Absent)> = vec![
        (|message| message.coil_count = 2, count("coils", 3, 2)),
        (|message| message.coil_count = u32::MAX, count("coils", 3, u32::MAX)),
        (|message| message.pose_parameter_count = 3, count("frames", 2, 3)),
        (|message| message.description_fingerprint = 1, Absent::Description { expected, actual: 1 }),
        (|message| message.state = 4, implausible("state code", 0)),
        (|message| message.answered_pose_stamp_ns = JUST_AHEAD + 1, implausible("receipt stamp", 0)),
        (|message| message.answer_received_stamp_ns = u64::MAX, implausible("receipt stamp", 0)),
        (|message| message.measured.current_a[2] = f64::NAN, implausible("current", 2)),
        (|message| message.measured.current_a[0] = f64::NEG_INFINITY, implausible("current", 0)),
        (|message| message.measured.angle_rad[1] = f64::NAN, implausible("angle", 1)),
    ];
    cases.extend(body.into_iter().map(|(spoil, absent)| {
        let mut message = feedback(11);
        spoil(&mut message);
        (message, absent)
    }));
    let mut receiver = FeedbackReceiver::new(&example_description());
    let good = receiver.receive(Some(&feedback(10)), NOW).last.expect("accepted");
    for (case, (message, absent)) in cases.iter().enumerate() {
        assert_refused(&receiver.receive(Some(message), NOW), good, *absent, case);
    }
    assert!(receiver.receive(Some(&feedback(11)), NOW).fresh, "a good one is taken after all of that");
}

#[test]
fn reading_of_nothing_is_never_and_then_keeps_the_last() {
    let mut receiver = PoseReceiver::new(&example_description());
    assert_eq!(receiver.receive(None, NOW), Reading::never());
    let first = receiver.receive(Some(&pose(1)), NOW);
    assert!(first.fresh);
    assert_eq!(receiver.receive(None, NOW), Reading { fresh: false, ..first });
    assert_eq!(receiver.failed(), Reading { fresh: false, refused: Some(Absent::Transport), ..first });
}

#[test]
fn first_message_may_join_at_any_sequence_but_zero() {
    let description = example_description();
    let mut receiver = PoseReceiver::new(&description);
    let refused = receiver.receive(Some(&pose(0)), NOW);
    assert_eq!(
        refused,
        Reading { refused: Some(Absent::Sequence { last: 0, actual: 0 }), ..Reading::never() }
    );
    assert!(receiver.receive(Some(&pose(4711)), NOW).fresh);
}

#[test]
fn new_epoch_is_a_restart_of_the_sender_and_is_counted() {
    let mut receiver = FeedbackReceiver::new(&example_description());
    receiver.receive(Some(&feedback(900)), NOW);
    assert_eq!(receiver.restarts(), 0);
    let mut restarted = feedback(1);
    restarted.header.epoch = 6;
    restarted.header.publish_stamp_ns += 1;
    assert!(receiver.receive(Some(&restarted), NOW).fresh);
    assert_eq!(receiver.restarts(), 1);
    restarted.header.sequence = 0;
    restarted.header.epoch = 7;
    assert!(!receiver.receive(Some(&restarted), NOW).fresh, "no sequence starts at zero");
    assert_eq!(receiver.restarts(), 1);
}

#[test]
fn quaternion_near_unit_norm_is_normalised() {
    let mut receiver = PoseReceiver::new(&example_description());
    let mut message = pose(1);
    message.magnets[0].orientation_xyzw = [0.0, 0.6 * 1.0009, 0.0, 0.8 * 1.0009];
    let accepted = receiver.receive(Some(&message), NOW).last.expect("accepted");
    let norm: f64 = accepted.magnets[0].orientation_xyzw.iter().map(|value| value * value).sum();
    assert!((norm - 1.0).abs() < 1e-15, "{norm}");
    assert!((accepted.magnets[0].orientation_xyzw[1] - 0.6).abs() < 1e-15);
}

#[test]
fn stamps_up_to_the_tolerance_ahead_are_taken_and_a_validity_not_yet_over_too() {
    let mut receiver = PoseReceiver::new(&example_description());
    let mut message = pose(1);
    message.header.source_stamp_ns = JUST_AHEAD;
    message.header.publish_stamp_ns = JUST_AHEAD;
    message.header.valid_until_ns = NOW.nanoseconds() + 1;
    assert!(receiver.receive(Some(&message), NOW).fresh);
}

#[test]
fn unused_entries_come_out_as_zero_whatever_was_in_them() {
    let description = example_description();
    let mut message = feedback(1);
    message.measured.current_a[3..].fill(f64::NAN);
    message.measured.angle_rad[2..].fill(1.0);
    let accepted = FeedbackReceiver::new(&description).receive(Some(&message), NOW).last.expect("accepted");
    assert_eq!(accepted.measured.current_a[1], 2.5);
    assert!(
        accepted.measured.current_a[3..]
            .iter()
            .chain(&accepted.measured.angle_rad)
            .all(|value| *value == 0.0)
    );
    let mut message = pose(1);
    message.magnets[2].position_m = [f64::NAN; 3];
    let accepted = PoseReceiver::new(&description).receive(Some(&message), NOW).last.expect("accepted");
    assert_eq!(accepted.magnets[2], MagnetPose::default());
}
