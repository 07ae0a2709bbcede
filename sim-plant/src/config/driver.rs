//! `[plant.driver]`.

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use super::amplifier::AmplifierConfig;
use super::motor::MotorConfig;
use super::winding::{CELSIUS_ZERO, WindingConfig};
use crate::actuation::WatchSettings;

/// `[plant.driver]`: when the driver finds fault with its own hardware and cuts all amplifiers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverConfig {
    /// Distance of a measured current from a set point other than zero, A. Above the lag of a ramp at the
    /// allowed slew, `slew / (2 pi bandwidth) + slew * step`, and above `idle_current_max_a`.
    pub follow_error_max_a: f64,
    /// Measured current at a set point of zero, A. Above what a sensor may show without any.
    pub idle_current_max_a: f64,
    /// How long a current may be so far off, ms, 1 to 10000.
    pub follow_error_time_ms: f64,
    /// Distance of a measured frame angle from its set point, deg. Above `3 speed^2 / (2 acceleration)`: so
    /// far lags a motor that was turned back at full speed.
    pub frame_error_max_deg: f64,
    /// How long an angle may be so far off, ms, 1 to 10000.
    pub frame_error_time_ms: f64,
    /// A coil that is hotter, degrees Celsius, above `temperature_release_celsius`, up to 500.
    pub temperature_max_celsius: f64,
    /// That is over once every coil is cooler, degrees Celsius, above the surroundings.
    pub temperature_release_celsius: f64,
}

/// What the driver watches, as far as its limits depend on it.
pub(super) struct Watched<'a> {
    pub description: &'a HardwareDescription,
    pub amplifier: &'a AmplifierConfig,
    pub motor: &'a MotorConfig,
    pub winding: &'a WindingConfig,
    pub step_us: u64,
}

impl DriverConfig {
    pub(super) fn check(&self, watched: &Watched, checks: &mut Checks) {
        let mut above = |name: &str, value: f64, least: f64, why: &str| {
            let expected = format!("above {least:.4}, {why}");
            let holds = value.is_finite() && value > least;
            checks.require(holds, format!("plant.driver.{name}"), value, expected);
        };
        let slew = watched.description.coils.iter().fold(0.0_f64, |most, coil| most.max(coil.slew_max));
        let lag = slew * (watched.amplifier.bandwidth().recip() + watched.step_us as f64 * 1e-6);
        above("follow_error_max_a", self.follow_error_max_a, lag, "the lag of a ramp at the allowed slew");
        above(
            "follow_error_max_a",
            self.follow_error_max_a,
            self.idle_current_max_a,
            "plant.driver.idle_current_max_a",
        );
        let zero_error = watched.amplifier.zero_error();
        above(
            "idle_current_max_a",
            self.idle_current_max_a,
            zero_error,
            "what a sensor may show without any",
        );
        let speed = watched.description.frames.iter().fold(0.0_f64, |most, frame| most.max(frame.speed_max));
        let acceleration = watched.motor.acceleration_max_deg_per_s2;
        let overrun = 1.5 * speed.to_degrees().powi(2) / acceleration + watched.motor.encoder_step_deg;
        above(
            "frame_error_max_deg",
            self.frame_error_max_deg,
            overrun,
            "the lag of a motor turned back at full speed",
        );
        let release = self.temperature_release_celsius;
        above("temperature_max_celsius", self.temperature_max_celsius, release, "the temperature of release");
        let ambient = watched.winding.ambient_celsius;
        above("temperature_release_celsius", release, ambient, "the surroundings");
        checks.within("plant.driver.follow_error_max_a", self.follow_error_max_a, 0.0, 1e3);
        checks.within("plant.driver.idle_current_max_a", self.idle_current_max_a, 0.0, 1e3);
        checks.within("plant.driver.frame_error_max_deg", self.frame_error_max_deg, 0.0, 1e4);
        checks.within("plant.driver.follow_error_time_ms", self.follow_error_time_ms, 1.0, 1e4);
        checks.within("plant.driver.frame_error_time_ms", self.frame_error_time_ms, 1.0, 1e4);
        checks.within("plant.driver.temperature_max_celsius", self.temperature_max_celsius, -20.0, 500.0);
    }

    pub(super) fn settings(&self) -> WatchSettings {
        WatchSettings {
            current_deviation_max: self.follow_error_max_a,
            idle_current_max: self.idle_current_max_a,
            current_deviation_time: self.follow_error_time_ms * 1e-3,
            angle_deviation_max: self.frame_error_max_deg.to_radians(),
            angle_deviation_time: self.frame_error_time_ms * 1e-3,
            temperature_max: self.temperature_max_celsius + CELSIUS_ZERO,
            temperature_release: self.temperature_release_celsius + CELSIUS_ZERO,
        }
    }
}
