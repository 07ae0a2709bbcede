//! The driver's end: it makes the rig's topics, takes commands and publishes what it measured.

use std::time::Duration;

use super::endpoint::Endpoint;
use super::error::{ChannelError, Role};
use super::lock::RoleLock;
use super::membership::Membership;
use super::ports::{Inlet, Outlet};
use super::service::{COMMAND, FEEDBACK, POSE, TRUTH, Topic, create_topic};
use crate::hardware::WriteError;
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::send::HeaderWriter;
use crate::time::Stamp;

/// The driver's topics, made but not yet joined: may move to the thread that will use them.
#[derive(Debug)]
pub struct DriverServices {
    lock: RoleLock,
    membership: Membership,
    pose: Topic<PoseMessage>,
    feedback: Topic<CoilFeedback>,
    command: Topic<CoilCommand>,
    truth: Topic<PoseMessage>,
}

impl DriverServices {
    /// Becomes the rig's driver and makes its topics.
    ///
    /// # Errors
    /// When the rig has a driver already, or the transport fails.
    pub fn create(endpoint: &Endpoint) -> Result<Self, ChannelError> {
        let lock = RoleLock::acquire(endpoint.root(), endpoint.rig(), Role::Driver)?;
        // A driver's loop never waits for another process: connections that fail are made anew later.
        let membership = endpoint.join(Duration::ZERO)?;
        Ok(Self {
            lock,
            pose: create_topic(&membership.node, endpoint, POSE)?,
            feedback: create_topic(&membership.node, endpoint, FEEDBACK)?,
            command: create_topic(&membership.node, endpoint, COMMAND)?,
            truth: create_topic(&membership.node, endpoint, TRUTH)?,
            membership,
        })
    }

    /// Joins the topics; call it on the thread that takes commands and publishes.
    ///
    /// # Errors
    /// When another process publishes as the rig's driver, or the transport fails.
    pub fn into_ports(self) -> Result<DriverEnd, ChannelError> {
        let epoch = Stamp::now().nanoseconds().max(1);
        Ok(DriverEnd {
            pose: Outlet::sole(self.pose, &self.membership.node)?,
            feedback: Outlet::sole(self.feedback, &self.membership.node)?,
            truth: Outlet::sole(self.truth, &self.membership.node)?,
            command: Inlet::new(self.command, 1)?,
            pose_header: HeaderWriter::new(epoch),
            feedback_header: HeaderWriter::new(epoch),
            truth_header: HeaderWriter::new(epoch),
            _membership: self.membership,
            _lock: self.lock,
        })
    }
}

/// The driver's end of the channels. Belongs to the thread that made it.
///
/// Each `publish` fills in sequence, epoch, schema and publish stamp; source stamp and validity are the driver's.
#[derive(Debug)]
pub struct DriverEnd {
    pose: Outlet<PoseMessage>,
    feedback: Outlet<CoilFeedback>,
    truth: Outlet<PoseMessage>,
    command: Inlet<CoilCommand>,
    pose_header: HeaderWriter,
    feedback_header: HeaderWriter,
    truth_header: HeaderWriter,
    _membership: Membership,
    _lock: RoleLock,
}

impl DriverEnd {
    /// [`DriverServices::create`] and [`DriverServices::into_ports`] in one, for a driver of one thread.
    ///
    /// # Errors
    /// As those two.
    pub fn create(endpoint: &Endpoint) -> Result<Self, ChannelError> {
        DriverServices::create(endpoint)?.into_ports()
    }

    /// The newest command since the former call, unchecked: hand it to [`crate::CommandGuard::offer`].
    pub fn take_command(&mut self, now: Stamp) -> Option<CoilCommand> {
        // Nothing received and nothing receivable are the same to a driver: the guard ramps down.
        self.command.newest(now).unwrap_or(None)
    }

    /// Publishes measured poses.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_pose(&mut self, mut message: PoseMessage, now: Stamp) -> Result<(), WriteError> {
        self.pose_header.write(&mut message.header, now);
        self.pose.send(message, now)
    }

    /// Publishes measured currents and angles and the driver's state.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_feedback(&mut self, mut message: CoilFeedback, now: Stamp) -> Result<(), WriteError> {
        self.feedback_header.write(&mut message.header, now);
        self.feedback.send(message, now)
    }

    /// Publishes true poses of a simulated plant, for observers alone: the daemon has no way to read them.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_truth(&mut self, mut message: PoseMessage, now: Stamp) -> Result<(), WriteError> {
        self.truth_header.write(&mut message.header, now);
        self.truth.send(message, now)
    }

    /// Publishes poses with their header as it stands, to test how a receiver takes garbage.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_raw_pose(&mut self, message: PoseMessage, now: Stamp) -> Result<(), WriteError> {
        self.pose.send(message, now)
    }

    /// Publishes feedback with its header as it stands, to test how a receiver takes garbage.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_raw_feedback(&mut self, message: CoilFeedback, now: Stamp) -> Result<(), WriteError> {
        self.feedback.send(message, now)
    }
}
