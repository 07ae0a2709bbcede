//! The daemon's end: [`Hardware`] over the channels.

use std::time::Duration;

use super::endpoint::Endpoint;
use super::error::{ChannelError, Role};
use super::lock::RoleLock;
use super::membership::Membership;
use super::ports::{Inlet, Outlet};
use super::service::{COMMAND, FEEDBACK, POSE, Topic, Wait, open_topic};
use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::hardware::{Hardware, Sensed, WriteError};
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::receive::{FeedbackReceiver, PoseReceiver};
use crate::send::CommandWriter;
use crate::time::Stamp;

/// The daemon's topics, opened but not yet joined: may move to the thread of the control loop.
#[derive(Debug)]
pub struct DaemonServices {
    pub(super) lock: RoleLock,
    pub(super) membership: Membership,
    pub(super) pose: Topic<PoseMessage>,
    pub(super) feedback: Topic<CoilFeedback>,
    pub(super) command: Topic<CoilCommand>,
}

impl DaemonServices {
    /// Becomes the rig's daemon and opens the topics of its driver, for which it waits up to `wait`.
    ///
    /// # Errors
    /// When the rig has a daemon already, no driver appears in time, or the transport fails.
    pub fn open(endpoint: &Endpoint, wait: Duration) -> Result<Self, ChannelError> {
        let lock = RoleLock::acquire(endpoint.root(), endpoint.rig(), Role::Daemon)?;
        // The control loop never waits for another process: connections that fail are made anew later.
        let membership = endpoint.join(Duration::ZERO)?;
        let wait = Wait::new(wait);
        Ok(Self {
            lock,
            pose: open_topic(&membership.node, endpoint, POSE, Role::Driver, &wait)?,
            feedback: open_topic(&membership.node, endpoint, FEEDBACK, Role::Driver, &wait)?,
            command: open_topic(&membership.node, endpoint, COMMAND, Role::Driver, &wait)?,
            membership,
        })
    }

    /// Joins the topics; call it on the thread of the control loop, before arming.
    ///
    /// # Errors
    /// When another process publishes commands on this rig, or the transport fails.
    pub fn into_ports(self, description: &HardwareDescription) -> Result<DaemonEnd, ChannelError> {
        Ok(DaemonEnd {
            pose: Inlet::new(self.pose, 1)?,
            feedback: Inlet::new(self.feedback, 1)?,
            command: Outlet::sole(self.command, &self.membership.node)?,
            pose_receiver: PoseReceiver::new(description),
            feedback_receiver: FeedbackReceiver::new(description),
            writer: CommandWriter::new(description),
            _membership: self.membership,
            _lock: self.lock,
        })
    }
}

/// The daemon's end of the channels. Belongs to the thread that made it.
#[derive(Debug)]
pub struct DaemonEnd {
    pose: Inlet<PoseMessage>,
    feedback: Inlet<CoilFeedback>,
    command: Outlet<CoilCommand>,
    pose_receiver: PoseReceiver,
    feedback_receiver: FeedbackReceiver,
    writer: CommandWriter,
    _membership: Membership,
    _lock: RoleLock,
}

impl Hardware for DaemonEnd {
    fn read(&mut self, now: Stamp) -> Sensed {
        let pose = match self.pose.newest(now) {
            Ok(message) => self.pose_receiver.receive(message.as_ref(), now),
            Err(()) => self.pose_receiver.failed(),
        };
        let feedback = match self.feedback.newest(now) {
            Ok(message) => self.feedback_receiver.receive(message.as_ref(), now),
            Err(()) => self.feedback_receiver.failed(),
        };
        Sensed { pose, feedback }
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        self.command.send(self.writer.message(command, now), now)
    }
}
