//! The end of whoever checks a driver: in the daemon's place, hearing every message, and free to send
//! garbage.

use std::time::Duration;

use super::daemon::DaemonServices;
use super::endpoint::Endpoint;
use super::error::{ChannelError, Role};
use super::lock::{RoleLock, holder};
use super::membership::Membership;
use super::ports::{Inlet, Outlet};
use super::service::{FEEDBACK, POSE};
use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::hardware::WriteError;
use crate::message::{CoilCommand, CoilFeedback, PoseMessage};
use crate::send::CommandWriter;
use crate::time::Stamp;

/// The daemon's place on the channels, for a conformance suite: no daemon can run beside it.
///
/// Unlike [`DaemonEnd`](super::DaemonEnd) it hands over every message as it came, unchecked, and can send
/// what no gate admitted. Belongs to the thread that made it.
#[derive(Debug)]
pub struct ProbeEnd {
    pose: Inlet<PoseMessage>,
    feedback: Inlet<CoilFeedback>,
    command: Outlet<CoilCommand>,
    writer: CommandWriter,
    _membership: Membership,
    _lock: RoleLock,
}

impl ProbeEnd {
    /// Takes the daemon's place on a rig and joins the topics of its driver, for which it waits up to `wait`.
    ///
    /// # Errors
    /// When the rig has a daemon, no driver appears in time, or the transport fails.
    pub fn open(
        endpoint: &Endpoint,
        description: &HardwareDescription,
        wait: Duration,
    ) -> Result<Self, ChannelError> {
        let services = DaemonServices::open(endpoint, wait)?;
        // Topics outlive their driver until somebody clears them up.
        if holder(endpoint.root(), endpoint.rig(), Role::Driver).is_none() {
            let (rig, root) = (endpoint.rig().to_owned(), endpoint.root().to_owned());
            return Err(ChannelError::Missing { rig, role: Role::Driver, root, waited: wait });
        }
        let DaemonServices { lock, membership, pose, feedback, command } = services;
        Ok(Self {
            pose: Inlet::new(pose, POSE.buffer)?,
            feedback: Inlet::new(feedback, FEEDBACK.buffer)?,
            command: Outlet::sole(command, &membership.node)?,
            writer: CommandWriter::new(description),
            _membership: membership,
            _lock: lock,
        })
    }

    /// Hands over everything that arrived since the former call, oldest first, up to a queue of 64 each.
    pub fn drain(
        &mut self,
        now: Stamp,
        mut take_feedback: impl FnMut(&CoilFeedback),
        mut take_pose: impl FnMut(&PoseMessage),
    ) {
        // What cannot be received is missed, and shows in what was heard.
        let _ = self.feedback.drain(now, &mut take_feedback);
        let _ = self.pose.drain(now, &mut take_pose);
    }

    /// Sends `command` after `spoil` changed its message.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn send(
        &mut self,
        command: &AdmittedCommand,
        now: Stamp,
        spoil: impl FnOnce(&mut CoilCommand),
    ) -> Result<(), WriteError> {
        let mut message = self.writer.message(command, now);
        spoil(&mut message);
        self.command.send(message, now)
    }
}
