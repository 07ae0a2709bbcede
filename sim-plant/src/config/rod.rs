//! `[plant.rod]`.

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use super::contact::ContactConfig;
use crate::rod::{Meshing, RodSettings};

/// `[plant.rod]`: mesh and damping of the dynamic rod.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RodConfig {
    /// Sections are cut into equal elements no longer than this, mm, 0.001 to 1000; at most 1000 in all.
    pub element_length_max_mm: f64,
    /// Damping ratio of the first mode about rest, 0 to 2. Kelvin-Voigt: that of a faster mode is greater
    /// in proportion to its frequency.
    pub first_mode_damping_ratio: f64,
    /// Whether magnets that are not rigidly joined feel each other's dipole field.
    pub magnet_interaction: bool,
    /// A wall that the rod may touch: `"none"`, `{ plane = { ... } }` or `{ tube = { ... } }`.
    pub contact: ContactConfig,
}

impl RodConfig {
    pub(super) fn check(&self, description: &HardwareDescription, checks: &mut Checks) {
        let key = "plant.rod.element_length_max_mm";
        checks.within(key, self.element_length_max_mm, 1e-3, 1e3);
        let elements = self.meshing().element_count(&description.manipulator);
        let expected = "long enough for at most 1000 elements in all";
        let few = self.element_length_max_mm > 0.0 && elements <= 1000;
        checks.require(few, key, self.element_length_max_mm, expected);
        checks.within("plant.rod.first_mode_damping_ratio", self.first_mode_damping_ratio, 0.0, 2.0);
        self.contact.check(description, checks);
    }

    fn meshing(&self) -> Meshing {
        Meshing { element_length_max: self.element_length_max_mm * 1e-3 }
    }

    /// Only for values that were checked.
    pub(super) fn settings(&self) -> RodSettings {
        RodSettings {
            meshing: self.meshing(),
            first_mode_damping_ratio: self.first_mode_damping_ratio,
            magnet_interaction: self.magnet_interaction,
            contact: self.contact.contact(),
        }
    }
}
