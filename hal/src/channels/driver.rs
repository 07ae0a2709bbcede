//! The driver's end: it makes the rig's topics, takes commands and publishes what it measured.

use std::time::Duration;

use super::endpoint::Endpoint;
use super::error::{ChannelError, Role};
use super::fault::{FaultDesk, FaultServices};
use super::lock::RoleLock;
use super::membership::Membership;
use super::ports::{Inlet, Outlet};
use super::service::{COMMAND, FEEDBACK, POSE, TRUTH, Topic, create_topic};
use crate::fault::{ConditionChange, FaultEvent, Injector};
use crate::guard::Setpoint;
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
    faults: Option<FaultServices>,
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
            faults: None,
            membership,
        })
    }

    /// Lets faults happen: those of the injector's plan, and those that anyone asks for from now on. For a
    /// driver whose user said so explicitly.
    ///
    /// # Errors
    /// When the transport fails.
    pub fn allow_faults(mut self, endpoint: &Endpoint, injector: Injector) -> Result<Self, ChannelError> {
        self.faults = Some(FaultServices::create(&self.membership, endpoint, injector)?);
        Ok(self)
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
            faults: self.faults.map(FaultServices::into_desk).transpose()?,
            _membership: self.membership,
            _lock: self.lock,
        })
    }
}

/// The driver's end of the channels. Belongs to the thread that made it.
///
/// Each `publish` fills in sequence, epoch, schema and publish stamp; source stamp and validity are the
/// driver's. Where faults are allowed they happen in here: a driver takes commands and publishes as ever, and
/// hands each set point through [`DriverEnd::setpoint`].
#[derive(Debug)]
pub struct DriverEnd {
    pose: Outlet<PoseMessage>,
    feedback: Outlet<CoilFeedback>,
    truth: Outlet<PoseMessage>,
    command: Inlet<CoilCommand>,
    pose_header: HeaderWriter,
    feedback_header: HeaderWriter,
    truth_header: HeaderWriter,
    faults: Option<FaultDesk>,
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

    /// The newest command since the former call, unchecked: hand it to [`crate::CommandGuard::offer`]. Call
    /// it once a cycle of the driver, since requests for faults are served here, too.
    pub fn take_command(&mut self, now: Stamp) -> Option<CoilCommand> {
        // Nothing received and nothing receivable are the same to a driver: the guard ramps down.
        let received = self.command.newest(now).unwrap_or(None);
        let Some(faults) = &mut self.faults else { return received };
        faults.serve(now);
        received.map(|command| faults.injector.command(&command, now))
    }

    /// What the amplifiers and motors are to follow in place of the guard's set point, `period_s` after the
    /// former call: the same, unless a fault of actuators acts. Within the rig's limits in any case.
    pub fn setpoint(&mut self, setpoint: &Setpoint, now: Stamp, period_s: f64) -> Setpoint {
        match &mut self.faults {
            Some(faults) => faults.injector.setpoint(setpoint, now, period_s),
            None => *setpoint,
        }
    }

    /// The next physical condition that a simulated plant is to take on or to lose: ask until there is none.
    pub fn next_condition(&mut self, now: Stamp) -> Option<ConditionChange> {
        self.faults.as_mut().and_then(|faults| faults.injector.next_condition(now))
    }

    /// The oldest begin or end of a fault that was not taken yet; telling of it belongs outside of the
    /// driver's cycle.
    pub fn take_fault_event(&mut self) -> Option<FaultEvent> {
        self.faults.as_mut().and_then(|faults| faults.injector.take_event())
    }

    /// What makes faults happen, with its counts; `None` where they are not allowed.
    #[must_use]
    pub fn faults(&self) -> Option<&Injector> {
        self.faults.as_ref().map(|faults| &faults.injector)
    }

    /// Publishes measured poses.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_pose(&mut self, mut message: PoseMessage, now: Stamp) -> Result<(), WriteError> {
        if let Some(faults) = &mut self.faults {
            faults.injector.offer_pose(message, now);
            return self.publish_due_poses(now);
        }
        self.pose_header.write(&mut message.header, now);
        self.pose.send(message, now)
    }

    /// Publishes what faults left of the poses, or kept until now.
    fn publish_due_poses(&mut self, now: Stamp) -> Result<(), WriteError> {
        let Some(faults) = &mut self.faults else { return Ok(()) };
        let mut sent = Ok(());
        while let Some(message) = faults.injector.take_pose(&mut self.pose_header, now) {
            sent = sent.and(self.pose.send(message, now));
        }
        sent
    }

    /// Publishes measured currents and angles and the driver's state.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_feedback(&mut self, mut message: CoilFeedback, now: Stamp) -> Result<(), WriteError> {
        if let Some(faults) = &mut self.faults {
            faults.injector.offer_feedback(message, now);
            let mut sent = Ok(());
            while let Some(message) = faults.injector.take_feedback(&mut self.feedback_header, now) {
                sent = sent.and(self.feedback.send(message, now));
            }
            return sent.and(self.publish_due_poses(now));
        }
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
