//! `[plant.sensors.NAME]`.

use std::time::Duration;

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::sensing::SensorCharacter;

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

impl SensorConfig {
    pub(super) fn check(&self, key: &str, step_us: u64, checks: &mut Checks) {
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
    pub(super) fn character(&self) -> SensorCharacter {
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
