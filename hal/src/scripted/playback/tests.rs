use std::time::Duration;

use super::{ScriptedHardware, Step};
use crate::gate::{Authority, Gate};
use crate::hardware::{Absent, Hardware, Reading, WriteError};
use crate::message::{CoilFeedback, MagnetPose, PoseMessage};
use crate::scripted::example_description;
use crate::send::HeaderWriter;
use crate::time::Stamp;

const fn at(milliseconds: u64) -> Stamp {
    Stamp::from_nanoseconds(milliseconds * 1_000_000)
}

/// Poses at `times`, with a faulty quaternion at `faulty`.
fn script(times: &[u64], faulty: u64) -> Vec<Step> {
    let mut header = HeaderWriter::new(1);
    let mut step = |time: u64| {
        let seen = MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
        let mut pose = PoseMessage { magnet_count: 2, magnets: [seen; 8], ..PoseMessage::default() };
        pose.header.source_stamp_ns = at(time).nanoseconds();
        header.write(&mut pose.header, at(time));
        if time == faulty {
            pose.magnets[1].orientation_xyzw = [0.0; 4];
        }
        Step { at: at(time), pose: Some(pose), feedback: None }
    };
    times.iter().map(|time| step(*time)).collect()
}

#[test]
fn script_arrives_by_its_times_and_only_the_newest_is_read() {
    let mut hardware = ScriptedHardware::new(&example_description(), script(&[1, 2, 3, 10], 0), 0);
    assert_eq!(hardware.read(at(0)).pose, Reading::never());
    let sequence =
        |reading: Reading<PoseMessage>| (reading.fresh, reading.last.map(|pose| pose.header.sequence));
    assert_eq!(sequence(hardware.read(at(3)).pose), (true, Some(3)));
    assert_eq!(sequence(hardware.read(at(9)).pose), (false, Some(3)));
    assert_eq!(hardware.read(at(9)).pose.age(at(9)), Some(Duration::from_millis(6)));
    assert_eq!(sequence(hardware.read(at(99)).pose), (true, Some(4)));
}

#[test]
fn faulty_message_of_a_script_is_refused_as_a_received_one() {
    let mut hardware = ScriptedHardware::new(&example_description(), script(&[1, 2], 2), 0);
    let good = hardware.read(at(1)).pose;
    let bad = hardware.read(at(2)).pose;
    assert_eq!(bad.refused, Some(Absent::Implausible { what: "quaternion", index: 1 }));
    assert_eq!((bad.last, bad.fresh), (good.last, false));
}

#[test]
fn feedback_of_another_rig_is_refused() {
    let mut feedback = CoilFeedback { coil_count: 3, pose_parameter_count: 2, ..CoilFeedback::default() };
    HeaderWriter::new(1).write(&mut feedback.header, at(1));
    let script = vec![Step { at: at(1), pose: None, feedback: Some(feedback) }];
    let description = example_description();
    let mut hardware = ScriptedHardware::new(&description, script, 0);
    let expected = description.fingerprint();
    assert_eq!(hardware.read(at(1)).feedback.refused, Some(Absent::Description { expected, actual: 0 }));
}

#[test]
fn commands_are_recorded_up_to_the_room_given_and_failures_are_told() {
    let description = example_description();
    let mut hardware = ScriptedHardware::new(&description, Vec::new(), 2);
    let mut gate = Gate::new(&description);
    let authority = Authority { epoch: 3, token: 7, validity: Duration::from_millis(100) };
    for millisecond in 1..=3 {
        hardware.write(&gate.claim(authority), at(millisecond)).expect("taken");
    }
    let sequences: Vec<u64> = hardware.commands().iter().map(|command| command.header.sequence).collect();
    assert_eq!(sequences, [1, 2]);
    hardware.set_writes_fail(true);
    assert_eq!(hardware.write(&gate.claim(authority), at(4)), Err(WriteError::Transport));
}
