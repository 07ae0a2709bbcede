//! How long it takes from poses to the driver, as the driver stamped it.
//!
//! Terms: *poses answered* are those that a command was computed from; the *receipt* is the driver's note in
//! its feedback: which poses the newest command answered, and when the first command that did so came. Both
//! sides read one clock. Method: the loop remembers the poses of its latest answers and looks up the one that
//! a receipt names. A driver tells of the newest answer alone, so that answers overtaken before the next
//! feedback have no receipt.

use std::time::Duration;

use magsteer_hal::message::Header;
use magsteer_hal::{CoilFeedback, Stamp};

/// Answers remembered: 32 ms of poses at 1 kHz, many periods of any feedback.
const ANSWERS: usize = 32;

/// What a driver's receipt came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Receipt {
    /// From the exposure of the poses to the driver's receipt of the command computed from them.
    pub pose_to_driver: Duration,
    /// From the publication of those poses to the same receipt.
    pub round_trip: Duration,
}

/// Matches receipts with the poses answered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Receipts {
    /// Exposure and publication of the poses answered.
    answers: [(Stamp, Stamp); ANSWERS],
    next: usize,
    /// Exposure that the last receipt named.
    told: Stamp,
}

impl Receipts {
    /// Nothing answered yet.
    pub(super) const fn new() -> Self {
        let never = Stamp::from_nanoseconds(0);
        Self { answers: [(never, never); ANSWERS], next: 0, told: never }
    }

    /// Remembers that a command computed from poses with this header was sent.
    pub(super) fn note_answer(&mut self, pose: &Header) {
        let published = Stamp::from_nanoseconds(pose.publish_stamp_ns);
        self.answers[self.next] = (pose.source_stamp(), published);
        self.next = (self.next + 1) % ANSWERS;
    }

    /// The receipt in `feedback`, the first time that it is told.
    pub(super) fn take(&mut self, feedback: &CoilFeedback) -> Option<Receipt> {
        let exposed = Stamp::from_nanoseconds(feedback.answered_pose_stamp_ns);
        if exposed == self.told || exposed == Stamp::default() {
            return None;
        }
        self.told = exposed;
        let (_, published) = self.answers.iter().find(|(answered, _)| *answered == exposed)?;
        let received = Stamp::from_nanoseconds(feedback.answer_received_stamp_ns);
        Some(Receipt { pose_to_driver: received.since(exposed), round_trip: received.since(*published) })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use magsteer_hal::CoilFeedback;
    use magsteer_hal::message::Header;

    use super::{ANSWERS, Receipt, Receipts};

    fn pose(exposed_us: u64) -> Header {
        Header {
            source_stamp_ns: exposed_us * 1_000,
            publish_stamp_ns: (exposed_us + 5_000) * 1_000,
            ..Header::default()
        }
    }

    fn feedback(exposed_us: u64, received_us: u64) -> CoilFeedback {
        CoilFeedback {
            answered_pose_stamp_ns: exposed_us * 1_000,
            answer_received_stamp_ns: received_us * 1_000,
            ..CoilFeedback::default()
        }
    }

    #[test]
    fn receipt_is_counted_once_from_exposure_and_from_publication() {
        let mut receipts = Receipts::new();
        assert_eq!(receipts.take(&feedback(0, 0)), None, "nothing answered yet");
        receipts.note_answer(&pose(1_000));
        receipts.note_answer(&pose(6_000));
        let expected =
            Receipt { pose_to_driver: Duration::from_micros(5_800), round_trip: Duration::from_micros(800) };
        assert_eq!(receipts.take(&feedback(1_000, 6_800)), Some(expected));
        assert_eq!(receipts.take(&feedback(1_000, 6_800)), None, "the same feedback, or its echo, once more");
        assert_eq!(receipts.take(&feedback(6_000, 11_800)), Some(expected));
    }

    #[test]
    fn receipt_for_poses_that_this_loop_did_not_answer_is_not_counted() {
        let mut receipts = Receipts::new();
        receipts.note_answer(&pose(1_000));
        assert_eq!(receipts.take(&feedback(900, 6_800)), None, "of a former daemon");
        for later in 1..=ANSWERS as u64 {
            receipts.note_answer(&pose(1_000 + later));
        }
        assert_eq!(receipts.take(&feedback(1_000, 6_800)), None, "forgotten");
        assert!(receipts.take(&feedback(1_001, 6_800)).is_some(), "the oldest that is remembered");
    }
}
