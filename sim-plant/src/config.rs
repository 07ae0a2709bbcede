//! The `[plant]` tables of the configuration file, and their validation into a [`Plant`].
//!
//! Every key is required: no default is hidden in code. Keys of refusals start at `plant.`, since the
//! tables stand under that name in the rig's file.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::time::Duration;

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

use crate::errors::ErrorMagnitudes;
use crate::plant::{Plant, PlantError, Settings};
use crate::rod::Meshing;
use crate::sensor::SensorCharacter;

/// `[plant]`: the simulated rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantConfig {
    /// Everything random comes from it: parameter errors, sensor noise, drop-outs.
    pub seed: u64,
    /// Fixed step of the simulation, us, 50 to 2000.
    pub step_us: u64,
    /// One of `sensors`: the one that is mounted.
    pub sensor: String,
    /// `[plant.rod]`
    pub rod: RodConfig,
    /// `[plant.amplifier]`
    pub amplifier: AmplifierConfig,
    /// `[plant.errors]`
    pub errors: ErrorsConfig,
    /// `[plant.sensors.NAME]`
    pub sensors: BTreeMap<String, SensorConfig>,
    /// `[plant.real_time]`
    pub real_time: RealTimeConfig,
}

/// `[plant.rod]`: mesh and damping of the dynamic rod.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RodConfig {
    /// Sections are cut into equal elements no longer than this, mm, > 0; at most 1000 in all.
    pub element_length_max_mm: f64,
    /// Damping ratio of the first mode about rest, 0 to 2. Kelvin-Voigt: that of a faster mode is greater
    /// in proportion to its frequency.
    pub first_mode_damping_ratio: f64,
}

/// `[plant.amplifier]`: the current controllers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AmplifierConfig {
    /// Bandwidth of the closed current loop while the supply suffices, Hz, > 0.
    pub bandwidth_hz: f64,
}

/// `[plant.errors]`: how far the plant's parameters are from the description's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorsConfig {
    /// Rubber is stiffer by this share than described (softer when negative), above -0.9 and up to 10.
    pub modulus_relative: f64,
    /// Each magnet's moment is off by this share, up or down as the seed decides, 0 to 0.9.
    pub moment_relative: f64,
    /// Field per ampere of each coil is off by this share, up or down as the seed decides, 0 to 0.9.
    pub coil_gain_relative: f64,
}

/// One of `[plant.sensors.NAME]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorConfig {
    /// Exposures a second, Hz, > 0, at most one a step.
    pub rate_hz: f64,
    /// From exposure to message, ms, 0 to 1000.
    pub latency_ms: f64,
    /// Standard deviation of each of a tangent's two tilts, deg, 0 to 45.
    pub orientation_noise_deg: f64,
    /// Standard deviation of each coordinate, mm, 0 to 100.
    pub position_noise_mm: f64,
    /// Share of exposures that are lost, 0 to 1.
    pub dropout_probability: f64,
}

/// `[plant.real_time]`: how the driver process keeps pace with the machine's clock.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RealTimeConfig {
    /// Period of the process's wake-ups, us, 100 to 20000, not under `step_us`.
    pub wake_us: u64,
    /// Most simulated time caught up in one wake-up, ms, 1 to 1000; what lies further back is
    /// counted and left out.
    pub catch_up_max_ms: u64,
    /// Period of true poses published for observers, ms, 1 to 1000.
    pub truth_period_ms: u64,
}

impl PlantConfig {
    /// Validates every value and builds the plant at rest under gravity.
    ///
    /// # Errors
    /// Every value out of its range, and a manipulator that has no mass to move or finds no rest.
    pub fn build(&self, description: &HardwareDescription) -> Result<Plant, Vec<Invalid>> {
        let mut checks = Checks::new();
        self.check(description, &mut checks);
        let sensor = self.sensors.get(&self.sensor).map(SensorConfig::character).unwrap_or_default();
        let sensor = checks.into_result(sensor)?;
        let settings = Settings {
            seed: self.seed,
            step: Duration::from_micros(self.step_us),
            meshing: Meshing { element_length_max: self.rod.element_length_max_mm * 1e-3 },
            first_mode_damping_ratio: self.rod.first_mode_damping_ratio,
            amplifier_bandwidth: TAU * self.amplifier.bandwidth_hz,
            errors: ErrorMagnitudes {
                modulus: self.errors.modulus_relative,
                moment: self.errors.moment_relative,
                coil_gain: self.errors.coil_gain_relative,
            },
            sensor,
        };
        Plant::new(description, &settings).map_err(|error| {
            let (value, expected) = match error {
                PlantError::Weightless => {
                    ("a manipulator of 0 kg", "given one with mass: a dynamic rod without any has no motion")
                }
                PlantError::NoRest => {
                    ("a manipulator without rest", "given one that comes to rest under its own weight")
                }
            };
            vec![Invalid {
                key: "plant.rod".to_owned(),
                value: value.to_owned(),
                expected: expected.to_owned(),
            }]
        })
    }

    fn check(&self, description: &HardwareDescription, checks: &mut Checks) {
        whole(checks, "plant.step_us", self.step_us, 50, 2000);
        let names: Vec<&str> = self.sensors.keys().map(String::as_str).collect();
        let expected = format!("the name of one of plant.sensors ({})", names.join(", "));
        checks.require(self.sensors.contains_key(&self.sensor), "plant.sensor", &self.sensor, expected);
        self.rod.check(description, checks);
        checks.positive("plant.amplifier.bandwidth_hz", self.amplifier.bandwidth_hz);
        self.errors.check(checks);
        for (name, sensor) in &self.sensors {
            sensor.check(&format!("plant.sensors.{name}"), self.step_us, checks);
        }
        self.real_time.check(self.step_us, checks);
    }
}

impl RodConfig {
    fn check(&self, description: &HardwareDescription, checks: &mut Checks) {
        let key = "plant.rod.element_length_max_mm";
        checks.positive(key, self.element_length_max_mm);
        let meshing = Meshing { element_length_max: self.element_length_max_mm * 1e-3 };
        let elements = meshing.element_count(&description.manipulator);
        let expected = "long enough for at most 1000 elements in all";
        let few = self.element_length_max_mm > 0.0 && elements <= 1000;
        checks.require(few, key, self.element_length_max_mm, expected);
        checks.within("plant.rod.first_mode_damping_ratio", self.first_mode_damping_ratio, 0.0, 2.0);
    }
}

impl ErrorsConfig {
    fn check(&self, checks: &mut Checks) {
        checks.within("plant.errors.modulus_relative", self.modulus_relative, -0.9, 10.0);
        checks.within("plant.errors.moment_relative", self.moment_relative, 0.0, 0.9);
        checks.within("plant.errors.coil_gain_relative", self.coil_gain_relative, 0.0, 0.9);
    }
}

impl SensorConfig {
    fn check(&self, key: &str, step_us: u64, checks: &mut Checks) {
        let rate_max = 1e6 / step_us.max(1) as f64;
        let holds = self.rate_hz.is_finite() && self.rate_hz >= 0.01 && self.rate_hz <= rate_max;
        let expected = format!("from 0.01 to {rate_max}, one exposure a step");
        checks.require(holds, format!("{key}.rate_hz"), self.rate_hz, expected);
        checks.within(format!("{key}.latency_ms"), self.latency_ms, 0.0, 1000.0);
        checks.within(format!("{key}.orientation_noise_deg"), self.orientation_noise_deg, 0.0, 45.0);
        checks.within(format!("{key}.position_noise_mm"), self.position_noise_mm, 0.0, 100.0);
        checks.within(format!("{key}.dropout_probability"), self.dropout_probability, 0.0, 1.0);
    }

    /// Only for values that were checked.
    fn character(&self) -> SensorCharacter {
        let seconds = |value: f64| Duration::try_from_secs_f64(value).unwrap_or_default();
        SensorCharacter {
            period: seconds(1.0 / self.rate_hz),
            latency: seconds(self.latency_ms * 1e-3),
            orientation_noise: self.orientation_noise_deg.to_radians(),
            position_noise: self.position_noise_mm * 1e-3,
            dropout_probability: self.dropout_probability,
        }
    }
}

impl RealTimeConfig {
    fn check(&self, step_us: u64, checks: &mut Checks) {
        let key = "plant.real_time";
        whole(checks, &format!("{key}.wake_us"), self.wake_us, step_us.max(100), 20_000);
        whole(checks, &format!("{key}.catch_up_max_ms"), self.catch_up_max_ms, 1, 1000);
        whole(checks, &format!("{key}.truth_period_ms"), self.truth_period_ms, 1, 1000);
    }
}

fn whole(checks: &mut Checks, key: &str, value: u64, least: u64, most: u64) {
    let holds = (least..=most).contains(&value);
    checks.require(holds, key, value, format!("a whole number from {least} to {most}"));
}
