//! `[plant.amplifier]`.

use std::f64::consts::TAU;

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::actuation::ActuationSettings;

/// `[plant.amplifier]`: the current controllers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AmplifierConfig {
    /// Bandwidth of the closed current loop while the supply suffices, Hz, > 0.
    pub bandwidth_hz: f64,
}

impl AmplifierConfig {
    pub(super) fn check(&self, checks: &mut Checks) {
        checks.positive("plant.amplifier.bandwidth_hz", self.bandwidth_hz);
    }

    pub(super) fn settings(&self) -> ActuationSettings {
        ActuationSettings { amplifier_bandwidth: TAU * self.bandwidth_hz }
    }
}
