//! Both halves of a rig's channels inside the process, for [`crate::Hardware`] whose driver is stepped by the reads.

use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::hardware::Sensed;
use crate::message::{CoilCommand, CoilFeedback, Header, PoseMessage};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::send::{CommandWriter, HeaderWriter};
use crate::time::Stamp;

/// Writes the headers on the driver's side, checks messages on the daemon's, and lets a test put messages of its own between.
#[derive(Debug, Clone)]
pub struct Loopback {
    pose_header: HeaderWriter,
    feedback_header: HeaderWriter,
    injected_pose: Option<PoseMessage>,
    injected_feedback: Option<CoilFeedback>,
    pose: PoseReceiver,
    feedback: FeedbackReceiver,
    writer: CommandWriter,
}

impl Loopback {
    /// Channels of the rig of `description`; the driver's epoch is 1.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        Self {
            pose_header: HeaderWriter::new(1),
            feedback_header: HeaderWriter::new(1),
            injected_pose: None,
            injected_feedback: None,
            pose: PoseReceiver::new(description),
            feedback: FeedbackReceiver::new(description),
            writer: CommandWriter::new(description),
        }
    }

    /// The next [`Self::sense`] receives exactly these poses in place of the driver's.
    pub const fn inject_pose(&mut self, message: PoseMessage) {
        self.injected_pose = Some(message);
    }

    /// The next [`Self::sense`] receives exactly this feedback in place of the driver's.
    pub const fn inject_feedback(&mut self, message: CoilFeedback) {
        self.injected_feedback = Some(message);
    }

    /// The driver sends poses: sequence, epoch and publish stamp.
    pub fn send_pose(&mut self, header: &mut Header, now: Stamp) {
        self.pose_header.write(header, now);
    }

    /// The driver sends feedback: sequence, epoch and publish stamp.
    pub fn send_feedback(&mut self, header: &mut Header, now: Stamp) {
        self.feedback_header.write(header, now);
    }

    /// The daemon receives the newest messages since it last did.
    pub fn sense(&mut self, pose: Option<PoseMessage>, feedback: Option<CoilFeedback>, now: Stamp) -> Sensed {
        let pose = self.injected_pose.take().or(pose);
        let feedback = self.injected_feedback.take().or(feedback);
        Sensed {
            pose: self.pose.receive(pose.as_ref(), now),
            feedback: self.feedback.receive(feedback.as_ref(), now),
        }
    }

    /// The daemon sends a command: the message that the driver is offered.
    pub fn command(&mut self, command: &AdmittedCommand, now: Stamp) -> CoilCommand {
        self.writer.message(command, now)
    }
}
