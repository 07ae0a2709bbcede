//! Both halves of a rig's channels inside the process, for [`crate::Hardware`] whose driver is stepped by the reads.

use crate::description::HardwareDescription;
use crate::fault::{ConditionChange, Injector};
use crate::gate::AdmittedCommand;
use crate::guard::Setpoint;
use crate::hardware::Sensed;
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::send::{CommandWriter, HeaderWriter};
use crate::time::Stamp;

/// Writes the headers on the driver's side, checks messages on the daemon's, and lets a test put messages of
/// its own between, or faults.
#[derive(Debug, Clone)]
pub struct Loopback {
    pose_header: HeaderWriter,
    feedback_header: HeaderWriter,
    /// The newest messages that the daemon has not received yet.
    pose_under_way: Option<PoseMessage>,
    feedback_under_way: Option<CoilFeedback>,
    injected_pose: Option<PoseMessage>,
    injected_feedback: Option<CoilFeedback>,
    pose: PoseReceiver,
    feedback: FeedbackReceiver,
    writer: CommandWriter,
    faults: Option<Box<Injector>>,
}

impl Loopback {
    /// Channels of the rig of `description`; the driver's epoch is 1.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        Self {
            pose_header: HeaderWriter::new(1),
            feedback_header: HeaderWriter::new(1),
            pose_under_way: None,
            feedback_under_way: None,
            injected_pose: None,
            injected_feedback: None,
            pose: PoseReceiver::new(description),
            feedback: FeedbackReceiver::new(description),
            writer: CommandWriter::new(description),
            faults: None,
        }
    }

    /// From now on faults happen on the driver's side.
    pub fn allow_faults(&mut self, injector: Injector) {
        self.faults = Some(Box::new(injector));
    }

    /// What makes faults happen, where they are allowed.
    pub fn faults(&mut self) -> Option<&mut Injector> {
        self.faults.as_deref_mut()
    }

    /// The next [`Self::sense`] receives exactly these poses in place of the driver's.
    pub const fn inject_pose(&mut self, message: PoseMessage) {
        self.injected_pose = Some(message);
    }

    /// The next [`Self::sense`] receives exactly this feedback in place of the driver's.
    pub const fn inject_feedback(&mut self, message: CoilFeedback) {
        self.injected_feedback = Some(message);
    }

    /// The driver publishes poses; sequence, epoch, schema and publish stamp are filled in.
    pub fn publish_pose(&mut self, mut message: PoseMessage, now: Stamp) {
        if let Some(faults) = &mut self.faults {
            faults.offer_pose(message, now);
            self.publish_due_poses(now);
        } else {
            self.pose_header.write(&mut message.header, now);
            self.pose_under_way = Some(message);
        }
    }

    /// The driver publishes feedback; sequence, epoch, schema and publish stamp are filled in.
    pub fn publish_feedback(&mut self, mut message: CoilFeedback, now: Stamp) {
        if let Some(faults) = &mut self.faults {
            faults.offer_feedback(message, now);
            while let Some(message) = faults.take_feedback(&mut self.feedback_header, now) {
                self.feedback_under_way = Some(message);
            }
            self.publish_due_poses(now);
        } else {
            self.feedback_header.write(&mut message.header, now);
            self.feedback_under_way = Some(message);
        }
    }

    /// Publishes what faults left of the poses, or kept until now.
    fn publish_due_poses(&mut self, now: Stamp) {
        let Some(faults) = &mut self.faults else { return };
        while let Some(message) = faults.take_pose(&mut self.pose_header, now) {
            self.pose_under_way = Some(message);
        }
    }

    /// What the driver's amplifiers follow in place of the guard's set point.
    pub fn setpoint(&mut self, setpoint: &Setpoint, now: Stamp, period_s: f64) -> Setpoint {
        match &mut self.faults {
            Some(faults) => faults.setpoint(setpoint, now, period_s),
            None => *setpoint,
        }
    }

    /// The next physical condition that a simulated plant is to take on or to lose: ask until there is none.
    pub fn next_condition(&mut self, now: Stamp) -> Option<ConditionChange> {
        self.faults.as_mut().and_then(|faults| faults.next_condition(now))
    }

    /// The daemon receives the newest messages since it last did.
    pub fn sense(&mut self, now: Stamp) -> Sensed {
        let pose = self.injected_pose.take().or(self.pose_under_way.take());
        let feedback = self.injected_feedback.take().or(self.feedback_under_way.take());
        Sensed {
            pose: self.pose.receive(pose.as_ref(), now),
            feedback: self.feedback.receive(feedback.as_ref(), now),
        }
    }

    /// The daemon sends a command: the message that the driver is offered.
    pub fn command(&mut self, command: &AdmittedCommand, now: Stamp) -> CoilCommand {
        let message = self.writer.message(command, now);
        match &mut self.faults {
            Some(faults) => faults.command(&message, now),
            None => message,
        }
    }
}
