//! The plant as [`Hardware`] inside the controller's own process, under stepped time.
//!
//! [`Hardware::read`] first advances the plant to the stamp that it is given, so that the very loop
//! that drives a real rig runs in lockstep, as fast as the machine allows and the same every time.
//! The first read starts the clock and finds nothing.

use magsteer_hal::conformance::{Spoil, Stepped};
use magsteer_hal::fault::Injector;
use magsteer_hal::scripted::Loopback;
use magsteer_hal::{
    AdmittedCommand, CoilFeedback, Hardware, HardwareDescription, PoseMessage, Sensed, Stamp, WriteError,
};

use crate::plant::Plant;

/// A plant and both halves of its channels, in-process.
#[derive(Debug, Clone)]
pub struct SimulatedRig {
    plant: Plant,
    is_started: bool,
    reported_until: Stamp,
    loopback: Loopback,
}

impl SimulatedRig {
    /// Takes over a plant that was built from `description`.
    #[must_use]
    pub fn new(plant: Plant, description: &HardwareDescription) -> Self {
        Self {
            plant,
            is_started: false,
            reported_until: Stamp::default(),
            loopback: Loopback::new(description),
        }
    }

    /// The plant, for its truth and its counts.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// From now on faults happen on the driver's side.
    pub fn allow_faults(&mut self, injector: Injector) {
        self.loopback.allow_faults(injector);
    }

    /// What makes faults happen, where they are allowed.
    pub fn faults(&mut self) -> Option<&mut Injector> {
        self.loopback.faults()
    }

    /// Publishes what comes about on the way to `now`.
    fn advance_to(&mut self, now: Stamp) {
        if !self.is_started {
            self.is_started = true;
            self.plant.set_clock(now);
            self.reported_until = now;
            if let Some(faults) = self.loopback.faults() {
                faults.start(now);
            }
            return;
        }
        let step = self.plant.step_duration();
        while let Some(change) = self.loopback.next_condition(self.plant.now()) {
            self.plant.take_on(&change);
        }
        while self.plant.now().after(step) <= now {
            let loopback = &mut self.loopback;
            self.plant.advance_through(|setpoint, now| loopback.setpoint(setpoint, now, step.as_secs_f64()));
            while let Some(message) = self.plant.take_pose() {
                self.loopback.publish_pose(message, self.plant.now());
            }
        }
        if self.plant.now() == self.reported_until {
            return;
        }
        self.reported_until = self.plant.now();
        self.loopback.publish_feedback(self.plant.feedback(), self.plant.now());
    }
}

impl Hardware for SimulatedRig {
    fn read(&mut self, now: Stamp) -> Sensed {
        self.advance_to(now);
        self.loopback.sense(now)
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        let message = self.loopback.command(command, now);
        // A driver that refuses says so in its feedback alone, as a remote one does.
        let _ = self.plant.offer(&message, now);
        Ok(())
    }
}

impl Stepped for SimulatedRig {
    fn inject_pose(&mut self, message: PoseMessage) {
        self.loopback.inject_pose(message);
    }

    fn inject_feedback(&mut self, message: CoilFeedback) {
        self.loopback.inject_feedback(message);
    }

    fn write_spoilt(&mut self, command: &AdmittedCommand, now: Stamp, spoil: Spoil<'_>) -> bool {
        let mut message = self.loopback.command(command, now);
        spoil(&mut message, now);
        let _ = self.plant.offer(&message, now);
        true
    }
}
