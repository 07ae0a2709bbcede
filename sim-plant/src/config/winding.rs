//! `[plant.winding]`.

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::actuation::WindingCharacter;

/// Kelvin of zero degrees Celsius.
pub(super) const CELSIUS_ZERO: f64 = 273.15;

/// `[plant.winding]`: how coils warm and what that does to them; the same for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindingConfig {
    /// Temperature of the surroundings and of every coil at the start, degrees Celsius, -20 to 60.
    pub ambient_celsius: f64,
    /// Temperature at which a coil has its described resistance, degrees Celsius, 0 to 60.
    pub reference_celsius: f64,
    /// Rise of the resistance with temperature, as a share a kelvin, 0 to 0.01.
    pub resistance_coefficient_per_k: f64,
    /// Thermal resistance of a coil to its surroundings, K/W, 0.001 to 1000.
    pub thermal_resistance_k_per_w: f64,
    /// Heat capacity of a coil, J/K, 0.001 to 1e6.
    pub heat_capacity_j_per_k: f64,
}

impl WindingConfig {
    pub(super) fn check(&self, checks: &mut Checks) {
        let key = |name: &str| format!("plant.winding.{name}");
        checks.within(key("ambient_celsius"), self.ambient_celsius, -20.0, 60.0);
        checks.within(key("reference_celsius"), self.reference_celsius, 0.0, 60.0);
        checks.within(key("resistance_coefficient_per_k"), self.resistance_coefficient_per_k, 0.0, 0.01);
        checks.within(key("thermal_resistance_k_per_w"), self.thermal_resistance_k_per_w, 1e-3, 1e3);
        checks.within(key("heat_capacity_j_per_k"), self.heat_capacity_j_per_k, 1e-3, 1e6);
    }

    pub(super) fn character(&self) -> WindingCharacter {
        WindingCharacter {
            ambient: self.ambient_celsius + CELSIUS_ZERO,
            reference: self.reference_celsius + CELSIUS_ZERO,
            coefficient: self.resistance_coefficient_per_k,
            thermal_resistance: self.thermal_resistance_k_per_w,
            heat_capacity: self.heat_capacity_j_per_k,
        }
    }
}
