//! An injector on the example rig, stepped by the millisecond.

use std::time::Duration;

use crate::fault::{Fault, FaultPlan, FaultTarget, FaultVerb, Injector, Part, Reach, Scheduled};
use crate::message::{Actuation, CoilFeedback, MagnetPose, PoseMessage};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::scripted::example_description;
use crate::send::HeaderWriter;
use crate::time::Stamp;

pub const START: Stamp = Stamp::from_nanoseconds(1_000_000_000);
pub const EPOCH: u64 = 100;

pub fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

pub fn at(milliseconds: u64) -> Stamp {
    START.after(ms(milliseconds))
}

pub fn fault(target: FaultTarget, verb: FaultVerb, part: Option<Part>) -> Fault {
    Fault::new(target, part, verb, &example_description(), Reach::Plant).expect("makes sense")
}

/// One fault from `from` for `lasts` milliseconds.
pub fn injector(fault: Fault, from: u64, lasts: u64) -> Injector {
    let scheduled = vec![Scheduled { fault, from: ms(from), lasts: Some(ms(lasts)) }];
    let mut injector = Injector::new(&example_description(), &FaultPlan::new(Reach::Plant, scheduled), 7);
    injector.start(START);
    injector
}

/// Poses that tell their millisecond by their positions.
pub fn pose(millisecond: u64) -> PoseMessage {
    let magnet = |index: usize| MagnetPose {
        position_m: [1e-6 * millisecond as f64, index as f64 * 1e-3, 0.0],
        orientation_xyzw: [0.0, 0.0, 0.0, 1.0],
        valid: u32::from(index < 2),
        reserved: 0,
    };
    let mut message = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
    message.magnets = std::array::from_fn(magnet);
    message.header.source_stamp_ns = at(millisecond).nanoseconds();
    message
}

/// The millisecond that a magnet of a message tells.
pub fn told(message: &PoseMessage, magnet: usize) -> u64 {
    (message.magnets[magnet].position_m[0] * 1e6).round() as u64
}

/// Feedback that tells its millisecond by its first current, in mA, and by its counts.
pub fn feedback(millisecond: u64) -> CoilFeedback {
    let mut measured = Actuation::default();
    measured.current_a[..3].fill(1e-3 * millisecond as f64);
    measured.angle_rad[..2].fill(1e-3 * millisecond as f64);
    let mut message = CoilFeedback {
        accepted_sequence: millisecond,
        description_fingerprint: example_description().fingerprint(),
        coil_count: 3,
        pose_parameter_count: 2,
        measured,
        ..CoilFeedback::default()
    };
    message.header.source_stamp_ns = at(millisecond).nanoseconds();
    message
}

/// The poses that go out at each millisecond when the driver offers some at each, with that millisecond.
pub fn poses_through(injector: &mut Injector, milliseconds: u64) -> Vec<(u64, PoseMessage)> {
    let mut header = HeaderWriter::new(EPOCH);
    let mut out = Vec::new();
    for millisecond in 1..=milliseconds {
        injector.offer_pose(pose(millisecond), at(millisecond));
        while let Some(message) = injector.take_pose(&mut header, at(millisecond)) {
            out.push((millisecond, message));
        }
    }
    out
}

/// The same for feedback.
pub fn feedback_through(injector: &mut Injector, milliseconds: u64) -> Vec<(u64, CoilFeedback)> {
    let mut header = HeaderWriter::new(EPOCH);
    let mut out = Vec::new();
    for millisecond in 1..=milliseconds {
        injector.offer_feedback(feedback(millisecond), at(millisecond));
        while let Some(message) = injector.take_feedback(&mut header, at(millisecond)) {
            out.push((millisecond, message));
        }
    }
    out
}

/// Milliseconds at which the daemon's receiver accepts one of the messages.
pub fn poses_accepted(messages: &[(u64, PoseMessage)]) -> Vec<u64> {
    let mut receiver = PoseReceiver::new(&example_description());
    let fresh = messages.iter().filter(|(now, message)| receiver.receive(Some(message), at(*now)).fresh);
    fresh.map(|(now, _)| *now).collect()
}

/// The same for feedback.
pub fn feedback_accepted(messages: &[(u64, CoilFeedback)]) -> Vec<u64> {
    let mut receiver = FeedbackReceiver::new(&example_description());
    let fresh = messages.iter().filter(|(now, message)| receiver.receive(Some(message), at(*now)).fresh);
    fresh.map(|(now, _)| *now).collect()
}

/// From `first` to `last`, both included.
pub fn all(first: u64, last: u64) -> Vec<u64> {
    (first..=last).collect()
}
