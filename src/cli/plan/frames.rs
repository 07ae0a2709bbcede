//! Frame angles by name, as arguments.

use std::str::FromStr;

use magsteer_hal::{HardwareDescription, POSE_PARAMETERS_MAX};

use crate::cli::actuation::finite;
use crate::cli::exit::Failure;

/// Angles of named frames: `bottom=45,top=-45`, deg.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedAngles(Vec<(String, f64)>);

impl FromStr for NamedAngles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = |pair: &str| {
            let (name, angle) = pair
                .split_once('=')
                .ok_or_else(|| format!("{pair:?}: must be a frame and its angle, as bottom=45"))?;
            Ok((name.trim().to_owned(), finite(angle)?))
        };
        text.split(',').map(named).collect::<Result<_, String>>().map(Self)
    }
}

impl NamedAngles {
    /// The angles of a rig's frames, rad.
    ///
    /// # Errors
    /// Usage: a frame that the rig does not have, one that is missing or stands twice, an angle outside its range.
    pub fn for_rig(
        &self,
        argument: &str,
        rig: &HardwareDescription,
    ) -> anyhow::Result<[f64; POSE_PARAMETERS_MAX]> {
        let names: Vec<&str> = rig.frames.iter().map(|frame| frame.name.as_str()).collect();
        let each = format!("one angle for each of the rig's frames ({})", names.join(", "));
        if let Some((name, _)) = self.0.iter().find(|(name, _)| !names.contains(&name.as_str())) {
            return Err(Failure::usage(format_args!("{argument}: no frame {name}: must be {each}")));
        }
        let mut angles = [0.0; POSE_PARAMETERS_MAX];
        for (angle, frame) in angles.iter_mut().zip(&rig.frames) {
            let mut given = self.0.iter().filter(|(name, _)| *name == frame.name);
            let (Some((_, angle_deg)), None) = (given.next(), given.next()) else {
                return Err(Failure::usage(format_args!("{argument}: frame {}: must be {each}", frame.name)));
            };
            let (least, most) = (frame.angle_min.to_degrees(), frame.angle_max.to_degrees());
            // A limit converted to radians and back may have moved in its last digit.
            if *angle_deg < least - 1e-9 || *angle_deg > most + 1e-9 {
                return Err(Failure::usage(format_args!(
                    "{argument}: {} = {angle_deg}: must be from {least} to {most} deg",
                    frame.name
                )));
            }
            *angle = angle_deg.to_radians().clamp(frame.angle_min, frame.angle_max);
        }
        Ok(angles)
    }
}
