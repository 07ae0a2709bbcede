//! `[plant.motor]`.

use std::collections::BTreeMap;

use magsteer_hal::invalid::Checks;
use magsteer_hal::{HardwareDescription, POSE_PARAMETERS_MAX};
use serde::{Deserialize, Serialize};

use crate::actuation::MotorCharacter;

/// `[plant.motor]`: motors, gears and encoders of the frames; the same for all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorConfig {
    /// Greatest acceleration of a frame, deg/s^2, 0.1 to 1e6. The greatest speed is the description's.
    pub acceleration_max_deg_per_s2: f64,
    /// Play between motor and frame, from end to end, deg, 0 to 10.
    pub backlash_deg: f64,
    /// Step of the encoder, referred to the frame, deg, 0 (none) to 10.
    pub encoder_step_deg: f64,
    /// How frames stand when the plant starts, by name, deg, within their ranges; a frame that is not named stands at zero.
    pub start_deg: Option<BTreeMap<String, f64>>,
}

impl MotorConfig {
    pub(super) fn check(&self, description: &HardwareDescription, checks: &mut Checks) {
        let acceleration = self.acceleration_max_deg_per_s2;
        checks.within("plant.motor.acceleration_max_deg_per_s2", acceleration, 0.1, 1e6);
        checks.within("plant.motor.backlash_deg", self.backlash_deg, 0.0, 10.0);
        checks.within("plant.motor.encoder_step_deg", self.encoder_step_deg, 0.0, 10.0);
        for (name, angle_deg) in self.start_deg.iter().flatten() {
            let key = format!("plant.motor.start_deg.{name}");
            let Some(frame) = description.frames.iter().find(|frame| frame.name == *name) else {
                checks.require(false, key, name, "the name of one of the rig's frames");
                continue;
            };
            checks.within(key, *angle_deg, frame.angle_min.to_degrees(), frame.angle_max.to_degrees());
        }
    }

    /// Angles at which the frames stand when the plant starts, rad, in the order of the description.
    pub(super) fn start(&self, description: &HardwareDescription) -> [f64; POSE_PARAMETERS_MAX] {
        let mut start = [0.0; POSE_PARAMETERS_MAX];
        for (start, frame) in start.iter_mut().zip(&description.frames) {
            let named = self.start_deg.as_ref().and_then(|angles| angles.get(&frame.name));
            *start = named.map_or(0.0, |angle_deg| angle_deg.to_radians());
        }
        start
    }

    pub(super) fn character(&self) -> MotorCharacter {
        MotorCharacter {
            acceleration_max: self.acceleration_max_deg_per_s2.to_radians(),
            backlash: self.backlash_deg.to_radians(),
            encoder_step: self.encoder_step_deg.to_radians(),
        }
    }
}
