//! All amplifiers and motors of the rig.

use magsteer_hal::description::HardwareDescription;
use magsteer_hal::{Actuation, Setpoint};

use super::amplifier::Amplifier;
use super::motor::Motor;

/// What amplifiers and motors are like.
#[derive(Debug, Clone, PartialEq)]
pub struct ActuationSettings {
    /// Of the current controllers, rad/s.
    pub amplifier_bandwidth: f64,
}

/// Amplifiers and motors at work.
#[derive(Debug, Clone)]
pub struct Actuators {
    amplifiers: Vec<Amplifier>,
    motors: Vec<Motor>,
    actual: Actuation,
}

impl Actuators {
    /// All currents at zero, all frames at rest. `step` in s.
    #[must_use]
    pub fn new(description: &HardwareDescription, settings: &ActuationSettings, step: f64) -> Self {
        let amplifier = |coil| Amplifier::new(coil, settings.amplifier_bandwidth, step);
        let motors: Vec<_> = description.frames.iter().map(|frame| Motor::new(frame, step)).collect();
        let mut actual = Actuation::default();
        for (angle, motor) in actual.angle_rad.iter_mut().zip(&motors) {
            *angle = motor.angle();
        }
        Self { amplifiers: description.coils.iter().map(amplifier).collect(), motors, actual }
    }

    /// True currents and angles.
    #[must_use]
    pub fn actual(&self) -> &Actuation {
        &self.actual
    }

    /// Follows a set point for one step.
    pub fn follow(&mut self, setpoint: &Setpoint) {
        let wanted = setpoint.actuation();
        let is_cut = matches!(setpoint, Setpoint::Disable(_));
        let currents = self.actual.current_a.iter_mut().zip(&wanted.current_a);
        for (amplifier, (current, wanted)) in self.amplifiers.iter_mut().zip(currents) {
            if is_cut {
                amplifier.discharge();
            } else {
                amplifier.follow(*wanted);
            }
            *current = amplifier.current();
        }
        let angles = self.actual.angle_rad.iter_mut().zip(&wanted.angle_rad);
        for (motor, (angle, wanted)) in self.motors.iter_mut().zip(angles) {
            motor.follow(*wanted);
            *angle = motor.angle();
        }
    }
}
