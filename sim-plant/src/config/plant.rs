//! `[plant]`, with all tables below it.

use std::collections::BTreeMap;
use std::time::Duration;

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

use super::amplifier::AmplifierConfig;
use super::coupling::{CouplingConfig, couplings};
use super::driver::{DriverConfig, Watched};
use super::errors::ErrorsConfig;
use super::field::{self, CoilTruthConfig};
use super::motor::MotorConfig;
use super::real_time::RealTimeConfig;
use super::rod::RodConfig;
use super::sensing::SensorConfig;
use super::winding::WindingConfig;
use crate::actuation::{ActuationSettings, CoilsSettings, Couplings};
use crate::plant::{Plant, PlantError, Settings};

/// `[plant]`: the simulated rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantConfig {
    /// Configuration whose rig the plant is built as, before its errors; a path relative to the file that says so. This
    /// one's when left out. Names what parameters were identified from, so that they do not change the truth.
    pub nominal: Option<String>,
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
    /// `[plant.winding]`
    pub winding: WindingConfig,
    /// `[[plant.coupling]]`; coils that no entry names share no flux.
    pub coupling: Vec<CouplingConfig>,
    /// `[plant.motor]`
    pub motor: MotorConfig,
    /// `[plant.driver]`
    pub driver: DriverConfig,
    /// `[plant.field.TYPE]`, TYPE one of `[coil_types]`
    pub field: BTreeMap<String, CoilTruthConfig>,
    /// `[plant.errors]`
    pub errors: ErrorsConfig,
    /// `[plant.sensors.NAME]`
    pub sensors: BTreeMap<String, SensorConfig>,
    /// `[plant.real_time]`
    pub real_time: RealTimeConfig,
}

/// What two descriptions of one rig have in common, whatever their parameters: by their names, its coils with the frames
/// that turn them, its frames and its magnets.
fn parts(rig: &HardwareDescription) -> Vec<(&str, Option<usize>)> {
    let coils = rig.coils.iter().map(|coil| (coil.name.as_str(), coil.frame));
    let frames = rig.frames.iter().map(|frame| (frame.name.as_str(), None));
    let magnets = rig.magnets().map(|magnet| (magnet.name.as_str(), None));
    coils.chain(frames).chain(magnets).collect()
}

impl PlantConfig {
    /// Validates every value and builds the plant at rest under gravity.
    ///
    /// # Errors
    /// Every value out of its range, and a manipulator that has no mass to move or finds no rest.
    pub fn build(&self, description: &HardwareDescription) -> Result<Plant, Vec<Invalid>> {
        self.build_as(description, description)
    }

    /// The same, in truth built as `nominal` says: the rig of `plant.nominal`.
    ///
    /// # Errors
    /// As [`Self::build`], and when the two have not the same coils, frames and magnets.
    pub fn build_as(
        &self,
        description: &HardwareDescription,
        nominal: &HardwareDescription,
    ) -> Result<Plant, Vec<Invalid>> {
        let mut checks = Checks::new();
        let is_one_rig = parts(description) == parts(nominal);
        let expected = "of a rig with the same coils, frames and magnets";
        checks.require(is_one_rig, "plant.nominal", self.nominal.as_deref().unwrap_or_default(), expected);
        self.check(description, &mut checks);
        let couplings = couplings(&self.coupling, description, &mut checks);
        let coil_truths = field::truths(&self.field, nominal, &mut checks);
        // One that is not there has been refused.
        let Some(sensor) = checks.into_result(self.sensors.get(&self.sensor))? else {
            return Err(Vec::new());
        };
        let settings = Settings {
            seed: self.seed,
            step: Duration::from_micros(self.step_us),
            rod: self.rod.settings(),
            actuation: self.actuation(couplings, description),
            coil_truths,
            errors: self.errors.magnitudes(),
            sensor: sensor.settings(),
        };
        Plant::new(description, nominal, &settings).map_err(|error| {
            let (key, value, expected) = match error {
                PlantError::Weightless => (
                    "plant.rod",
                    "a manipulator of 0 kg".to_owned(),
                    "given one with mass: a dynamic rod without any has no motion",
                ),
                PlantError::NoRest => (
                    "plant.rod",
                    "a manipulator without rest".to_owned(),
                    "given one that comes to rest under its own weight",
                ),
                PlantError::Sensor(error) => {
                    ("plant.sensor", error.to_string(), "a sensor that can reconstruct the manipulator")
                }
            };
            vec![Invalid { key: key.to_owned(), value, expected: expected.to_owned() }]
        })
    }

    /// Only for values that were checked.
    fn actuation(
        &self,
        couplings: Option<Couplings>,
        description: &HardwareDescription,
    ) -> ActuationSettings {
        ActuationSettings {
            coils: CoilsSettings {
                bandwidth: self.amplifier.bandwidth(),
                sensor: self.amplifier.sensor(),
                winding: self.winding.character(),
                couplings: couplings.unwrap_or_else(|| Couplings::none(description.coils.len())),
            },
            motor: self.motor.character(),
            frame_start: self.motor.start(description),
            watch: self.driver.settings(),
        }
    }

    fn check(&self, description: &HardwareDescription, checks: &mut Checks) {
        whole(checks, "plant.step_us", self.step_us, 50, 2000);
        let names: Vec<&str> = self.sensors.keys().map(String::as_str).collect();
        let expected = format!("the name of one of plant.sensors ({})", names.join(", "));
        checks.require(self.sensors.contains_key(&self.sensor), "plant.sensor", &self.sensor, expected);
        self.rod.check(description, checks);
        self.amplifier.check(checks);
        self.winding.check(checks);
        self.motor.check(description, checks);
        let Self { amplifier, motor, winding, step_us, .. } = self;
        self.driver.check(&Watched { description, amplifier, motor, winding, step_us: *step_us }, checks);
        self.errors.check(checks);
        for (name, sensor) in &self.sensors {
            let key = format!("plant.sensors.{name}");
            sensor.check(&key, self.step_us, &description.manipulator, checks);
        }
        self.real_time.check(self.step_us, checks);
    }
}

/// Refuses a whole number out of its range.
pub(super) fn whole(checks: &mut Checks, key: &str, value: u64, least: u64, most: u64) {
    let holds = (least..=most).contains(&value);
    checks.require(holds, key, value, format!("a whole number from {least} to {most}"));
}
