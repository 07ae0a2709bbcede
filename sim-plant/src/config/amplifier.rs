//! `[plant.amplifier]`.

use std::f64::consts::TAU;

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::actuation::CurrentSensorCharacter;

/// `[plant.amplifier]`: current controllers and current sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AmplifierConfig {
    /// Bandwidth of the closed current loop while the supply suffices, Hz, 1 to 100000.
    pub bandwidth_hz: f64,
    /// Each current sensor's gain is off by this share, up or down as the seed decides, 0 to 0.1.
    pub current_gain_relative: f64,
    /// Each current sensor's zero is off by so much, up or down as the seed decides, A, 0 to 1.
    pub current_offset_a: f64,
    /// Standard deviation of a measured current, A, 0 to 1.
    pub current_noise_a: f64,
    /// Step of a measured current's digits, A, 0 (none) to 1.
    pub current_step_a: f64,
}

impl AmplifierConfig {
    pub(super) fn check(&self, checks: &mut Checks) {
        let key = |name: &str| format!("plant.amplifier.{name}");
        checks.within(key("bandwidth_hz"), self.bandwidth_hz, 1.0, 1e5);
        checks.within(key("current_gain_relative"), self.current_gain_relative, 0.0, 0.1);
        checks.within(key("current_offset_a"), self.current_offset_a, 0.0, 1.0);
        checks.within(key("current_noise_a"), self.current_noise_a, 0.0, 1.0);
        checks.within(key("current_step_a"), self.current_step_a, 0.0, 1.0);
    }

    /// Of the current controllers, rad/s.
    pub(super) fn bandwidth(&self) -> f64 {
        TAU * self.bandwidth_hz
    }

    /// How far a measured zero current may seem to be off, A: five standard deviations of the noise.
    pub(super) fn zero_error(&self) -> f64 {
        self.current_offset_a + 5.0 * self.current_noise_a + self.current_step_a
    }

    pub(super) fn sensor(&self) -> CurrentSensorCharacter {
        CurrentSensorCharacter {
            gain: self.current_gain_relative,
            offset: self.current_offset_a,
            noise: self.current_noise_a,
            quantum: self.current_step_a,
        }
    }
}
