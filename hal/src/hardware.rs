//! The trait between the control loop and whatever drives the coils.

use std::time::Duration;

use crate::gate::AdmittedCommand;
use crate::message::{CoilFeedback, PoseMessage};
use crate::time::Stamp;

/// Why a message was refused at receipt, or is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Absent {
    /// Nothing was ever received.
    #[error("nothing received yet")]
    NeverReceived,
    /// Another layout version.
    #[error("layout version {actual} received, {expected} expected")]
    Schema {
        /// Version that this build speaks.
        expected: u32,
        /// Version received.
        actual: u32,
    },
    /// Not as many coils, frames or magnets as the description has.
    #[error("{actual} {what} received, {expected} expected")]
    Count {
        /// What was counted.
        what: &'static str,
        /// Count of the description.
        expected: u32,
        /// Count received.
        actual: u32,
    },
    /// A number that is not finite or a quaternion off its unit norm.
    #[error("{what} of entry {index} is not usable")]
    Implausible {
        /// What was wrong.
        what: &'static str,
        /// Which coil, frame or magnet.
        index: u32,
    },
    /// The sequence did not rise.
    #[error("sequence went from {last} to {actual}")]
    Sequence {
        /// Last accepted sequence.
        last: u64,
        /// Sequence received.
        actual: u64,
    },
    /// The content lies in the future of this machine's clock.
    #[error("stamp lies {ahead_ns} ns in the future")]
    FutureStamp {
        /// By how much.
        ahead_ns: u64,
    },
    /// The sensor did not see every magnet.
    #[error("magnet {magnet} was not seen")]
    NotSeen {
        /// The first magnet that was not seen.
        magnet: u32,
    },
    /// The validity that the sender gave it ran out before it was read.
    #[error("validity ran out {late_ns} ns ago")]
    Expired {
        /// How long ago.
        late_ns: u64,
    },
    /// A message of another epoch that was published before the last accepted one: a leftover of a former sender.
    #[error("epoch {actual} published before the last accepted message of epoch {last}")]
    FormerEpoch {
        /// Epoch of the last accepted message.
        last: u64,
        /// Epoch received.
        actual: u64,
    },
    /// The transport could not hand the message over.
    #[error("the transport failed to deliver")]
    Transport,
    /// The sender runs another description of the rig.
    #[error("description {actual:016x} at the driver, {expected:016x} here")]
    Description {
        /// Own fingerprint.
        expected: u64,
        /// Fingerprint received.
        actual: u64,
    },
}

/// The newest valid message of a channel, and what became of the newest one received.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading<T> {
    /// Newest message that passed every check.
    pub last: Option<T>,
    /// True when `last` arrived since the previous read.
    pub fresh: bool,
    /// Why the newest message was refused, when it was refused in this read.
    pub refused: Option<Absent>,
}

impl<T> Reading<T> {
    /// A channel on which nothing was received yet.
    #[must_use]
    pub const fn never() -> Self {
        Self { last: None, fresh: false, refused: None }
    }
}

impl Reading<PoseMessage> {
    /// Time since the newest valid poses were true; `None` when there are none.
    #[must_use]
    pub fn age(&self, now: Stamp) -> Option<Duration> {
        self.last.as_ref().map(|message| now.since(message.header.source_stamp()))
    }
}

impl Reading<CoilFeedback> {
    /// Time since the newest valid feedback was true; `None` when there is none.
    #[must_use]
    pub fn age(&self, now: Stamp) -> Option<Duration> {
        self.last.as_ref().map(|message| now.since(message.header.source_stamp()))
    }
}

/// All that a read returns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// Magnet poses.
    pub pose: Reading<PoseMessage>,
    /// Coil currents, frame angles and the state of the driver.
    pub feedback: Reading<CoilFeedback>,
}

/// A command that could not be handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum WriteError {
    /// The transport refused the message.
    #[error("the transport refused the command")]
    Transport,
}

/// A rig as the control loop sees it: poses and feedback in, admitted commands out.
///
/// Implementations never wait, and neither allocate (but for what the transport needs per sent
/// message) nor lock nor log in `read` and `write`: both are called once a control cycle.
/// The contract is checked by `conformance`.
pub trait Hardware {
    /// Takes the newest poses and feedback, each checked field by field.
    ///
    /// A message that fails a check is reported in [`Reading::refused`] and never replaces `last`.
    fn read(&mut self, now: Stamp) -> Sensed;

    /// Sends a command. Its header (sequence, stamps, epoch, validity) is filled in here.
    ///
    /// # Errors
    /// When the transport refuses; the driver then ramps to zero once the last command's
    /// validity has run out.
    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError>;
}
