//! A harness for implementations inside the process, whose time is whatever stamp they are read at.

use std::time::Duration;

use crate::description::HardwareDescription;
use crate::gate::AdmittedCommand;
use crate::hardware::Hardware;
use crate::message::{CoilFeedback, PoseMessage};
use crate::time::Stamp;

use super::harness::{Rig, Spoil};

/// [`Hardware`] whose driver lives by the stamps of its reads, and into which a test can put messages.
pub trait Stepped: Hardware {
    /// The next read receives exactly these poses.
    fn inject_pose(&mut self, message: PoseMessage);

    /// The next read receives exactly this feedback.
    fn inject_feedback(&mut self, message: CoilFeedback);

    /// The driver is offered `command` after `spoil` changed its message; false when that cannot be done.
    fn write_spoilt(&mut self, command: &AdmittedCommand, now: Stamp, spoil: Spoil<'_>) -> bool {
        let _ = (command, now, spoil);
        false
    }
}

/// A rig under stepped time.
#[derive(Debug)]
pub struct SteppedRig<H> {
    description: HardwareDescription,
    hardware: H,
    now: Stamp,
    settling: Duration,
    angle_settling: Duration,
    angle_tolerance: f64,
}

impl<H: Stepped> SteppedRig<H> {
    /// Starts the clock of `hardware` by its first read. Measured currents follow standing set points within `settling`.
    pub fn new(description: HardwareDescription, mut hardware: H, settling: Duration) -> Self {
        // Any moment but zero, which means "no stamp".
        let now = Stamp::from_nanoseconds(1_000_000_000);
        hardware.read(now);
        Self { description, hardware, now, settling, angle_settling: Duration::ZERO, angle_tolerance: 1e-6 }
    }

    /// Frames follow standing set points within `settling`, and are measured within `tolerance`, rad.
    #[must_use]
    pub fn with_frames(self, settling: Duration, tolerance: f64) -> Self {
        Self { angle_settling: settling, angle_tolerance: tolerance, ..self }
    }
}

impl<H: Stepped + 'static> Rig for SteppedRig<H> {
    type H = H;

    fn hardware(&mut self) -> &mut H {
        &mut self.hardware
    }

    fn description(&self) -> &HardwareDescription {
        &self.description
    }

    fn now(&self) -> Stamp {
        self.now
    }

    fn advance(&mut self, duration: Duration) {
        self.now = self.now.after(duration);
    }

    fn inject_pose(&mut self, message: PoseMessage) -> bool {
        self.hardware.inject_pose(message);
        true
    }

    fn inject_feedback(&mut self, message: CoilFeedback) -> bool {
        self.hardware.inject_feedback(message);
        true
    }

    fn send_spoilt(&mut self, command: &AdmittedCommand, spoil: Spoil<'_>) -> bool {
        self.hardware.write_spoilt(command, self.now, spoil)
    }

    fn settling(&self) -> Duration {
        self.settling
    }

    fn angle_settling(&self) -> Duration {
        self.angle_settling
    }

    fn angle_tolerance(&self) -> f64 {
        self.angle_tolerance
    }
}
