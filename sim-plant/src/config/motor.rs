//! `[plant.motor]`.

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::actuation::MotorCharacter;

/// `[plant.motor]`: motors, gears and encoders of the frames; the same for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorConfig {
    /// Greatest acceleration of a frame, deg/s^2, > 0. The greatest speed is the description's.
    pub acceleration_max_deg_per_s2: f64,
    /// Play between motor and frame, from end to end, deg, 0 to 10.
    pub backlash_deg: f64,
    /// Step of the encoder, referred to the frame, deg, 0 (none) to 10.
    pub encoder_step_deg: f64,
}

impl MotorConfig {
    pub(super) fn check(&self, checks: &mut Checks) {
        checks.positive("plant.motor.acceleration_max_deg_per_s2", self.acceleration_max_deg_per_s2);
        checks.within("plant.motor.backlash_deg", self.backlash_deg, 0.0, 10.0);
        checks.within("plant.motor.encoder_step_deg", self.encoder_step_deg, 0.0, 10.0);
    }

    pub(super) fn character(&self) -> MotorCharacter {
        MotorCharacter {
            acceleration_max: self.acceleration_max_deg_per_s2.to_radians(),
            backlash: self.backlash_deg.to_radians(),
            encoder_step: self.encoder_step_deg.to_radians(),
        }
    }
}
