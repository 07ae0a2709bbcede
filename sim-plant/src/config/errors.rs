//! `[plant.errors]`.

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::errors::ErrorMagnitudes;

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
    /// Each coil's axis is tilted by this angle, in a direction that the seed decides, deg, 0 to 30.
    pub coil_axis_deg: f64,
    /// Each coil is shifted by this distance, in a direction that the seed decides, mm, 0 to 20.
    pub coil_position_mm: f64,
}

impl ErrorsConfig {
    pub(super) fn check(&self, checks: &mut Checks) {
        checks.within("plant.errors.modulus_relative", self.modulus_relative, -0.9, 10.0);
        checks.within("plant.errors.moment_relative", self.moment_relative, 0.0, 0.9);
        checks.within("plant.errors.coil_gain_relative", self.coil_gain_relative, 0.0, 0.9);
        checks.within("plant.errors.coil_axis_deg", self.coil_axis_deg, 0.0, 30.0);
        checks.within("plant.errors.coil_position_mm", self.coil_position_mm, 0.0, 20.0);
    }

    pub(super) fn magnitudes(&self) -> ErrorMagnitudes {
        ErrorMagnitudes {
            modulus: self.modulus_relative,
            moment: self.moment_relative,
            coil_gain: self.coil_gain_relative,
            coil_axis: self.coil_axis_deg.to_radians(),
            coil_position: self.coil_position_mm * 1e-3,
        }
    }
}
