//! An ideal rig: measured currents and angles equal the guard's set point, poses are what the test says.

use crate::conformance::{Spoil, Stepped};
use crate::description::HardwareDescription;
use crate::fault::Injector;
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

    /// From now on faults happen between this driver and its channels, and its guard and its amplifiers.
    pub fn allow_faults(&mut self, injector: Injector) {
        self.loopback.allow_faults(injector);
    }

    /// What makes faults happen, where they are allowed.
    pub fn faults(&mut self) -> Option<&mut Injector> {
        self.loopback.faults()
    }

    fn step(&mut self, now: Stamp) {
        let elapsed = self.clock.map(|clock| now.since(clock));
        self.clock = Some(now);
        let Some(elapsed) = elapsed.filter(|elapsed| !elapsed.is_zero()) else {
            return;
        };
        let period = elapsed.as_secs_f64();
        let setpoint = self.guard.setpoint(now, period);
        let setpoint = self.loopback.setpoint(&setpoint, now, period);
        if self.is_silent {
            return;
        }
        let mut pose =
            PoseMessage { magnet_count: self.magnet_count, magnets: self.poses, ..PoseMessage::default() };
        pose.header.source_stamp_ns = now.nanoseconds();
        self.loopback.publish_pose(pose, now);
        let mut feedback =
            CoilFeedback { fault: self.fault, measured: *setpoint.actuation(), ..CoilFeedback::default() };
        feedback.header.source_stamp_ns = now.nanoseconds();
        self.guard.report(&mut feedback);
        self.loopback.publish_feedback(feedback, now);
    }
}

impl Hardware for EchoHardware {
    fn read(&mut self, now: Stamp) -> Sensed {
        self.step(now);
        self.loopback.sense(now)
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

    fn write_spoilt(&mut self, command: &AdmittedCommand, now: Stamp, spoil: Spoil<'_>) -> bool {
        let mut message = self.loopback.command(command, now);
        spoil(&mut message, now);
        let _ = self.guard.offer(&message, now);
        true
    }
}
