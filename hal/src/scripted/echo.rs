//! An ideal rig: measured currents and angles equal the guard's set point, poses are what the test says.

use crate::conformance::Stepped;
use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::guard::CommandGuard;
use crate::hardware::{Hardware, Sensed, WriteError};
use crate::message::{CoilFeedback, MAGNETS_MAX, MagnetPose, POSE_PARAMETERS_MAX, PoseMessage};
use crate::send::count;
use crate::time::Stamp;

use super::loopback::Loopback;

/// [`Hardware`] whose driver is a [`CommandGuard`] with ideal amplifiers, stepped by the stamps given to `read`.
///
/// The first read starts its clock and finds nothing; every later one at which time has passed brings fresh messages.
#[derive(Debug, Clone)]
pub struct EchoHardware {
    guard: CommandGuard,
    clock: Option<Stamp>,
    poses: [MagnetPose; MAGNETS_MAX],
    magnet_count: u32,
    fault: u32,
    is_silent: bool,
    loopback: Loopback,
}

impl EchoHardware {
    /// An ideal rig for `description`, its frames at angle zero and its magnets at the origin along z.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        let upright =
            MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
        Self {
            guard: CommandGuard::new(description, &[0.0; POSE_PARAMETERS_MAX]),
            clock: None,
            poses: [upright; MAGNETS_MAX],
            magnet_count: count(description.magnets().count(), MAGNETS_MAX),
            fault: 0,
            is_silent: false,
            loopback: Loopback::new(description),
        }
    }

    /// Where the sensor sees each magnet from now on; magnets past the given ones stay.
    pub fn set_poses(&mut self, poses: &[MagnetPose]) {
        for (seen, pose) in self.poses.iter_mut().zip(poses) {
            *seen = *pose;
        }
    }

    /// From now on the driver reports this fault and, unless it is 0, cuts its amplifiers.
    pub fn set_fault(&mut self, fault: u32) {
        self.fault = fault;
        if fault != 0 {
            self.guard.trip();
        }
    }

    /// From now on the driver publishes nothing (or does again); it goes on obeying.
    pub const fn set_silent(&mut self, is_silent: bool) {
        self.is_silent = is_silent;
    }

    /// The driver's guard, with its counts.
    #[must_use]
    pub const fn guard(&self) -> &CommandGuard {
        &self.guard
    }

    fn step(&mut self, now: Stamp) -> (Option<PoseMessage>, Option<CoilFeedback>) {
        let elapsed = self.clock.map(|clock| now.since(clock));
        self.clock = Some(now);
        let Some(elapsed) = elapsed.filter(|elapsed| !elapsed.is_zero()) else {
            return (None, None);
        };
        let setpoint = self.guard.setpoint(now, elapsed.as_secs_f64());
        if self.is_silent {
            return (None, None);
        }
        let mut pose =
            PoseMessage { magnet_count: self.magnet_count, magnets: self.poses, ..PoseMessage::default() };
        pose.header.source_stamp_ns = now.nanoseconds();
        self.loopback.send_pose(&mut pose.header, now);
        let mut feedback =
            CoilFeedback { fault: self.fault, measured: *setpoint.actuation(), ..CoilFeedback::default() };
        feedback.header.source_stamp_ns = now.nanoseconds();
        self.loopback.send_feedback(&mut feedback.header, now);
        self.guard.report(&mut feedback);
        (Some(pose), Some(feedback))
    }
}

impl Hardware for EchoHardware {
    fn read(&mut self, now: Stamp) -> Sensed {
        let (pose, feedback) = self.step(now);
        self.loopback.sense(pose, feedback, now)
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        let message = self.loopback.command(command, now);
        // A driver that refuses says so in its feedback alone, as a remote one would.
        let _ = self.guard.offer(&message, now);
        Ok(())
    }
}

impl Stepped for EchoHardware {
    fn inject_pose(&mut self, message: PoseMessage) {
        self.loopback.inject_pose(message);
    }

    fn inject_feedback(&mut self, message: CoilFeedback) {
        self.loopback.inject_feedback(message);
    }
}
