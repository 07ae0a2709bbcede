//! A rig's numbers for a driver that cannot read the configuration itself.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use serde::Serialize;

use crate::description::{HardwareDescription, PartDescription};

/// What a driver must know of its rig; SI units, radians, world frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RigSheet {
    /// Name of the rig; part of every channel's name.
    pub rig: String,
    /// Of the description, as 16 hexadecimal digits; every feedback message carries it.
    pub fingerprint: String,
    /// In command order.
    pub coils: Vec<CoilSheet>,
    /// In command order.
    pub frames: Vec<FrameSheet>,
    /// From base to tip.
    pub magnets: Vec<MagnetSheet>,
}

/// One coil.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CoilSheet {
    /// Name, for people.
    pub name: String,
    /// Greatest magnitude of the current.
    pub current_max_a: f64,
    /// Greatest rate of the current.
    pub slew_max_a_per_s: f64,
    /// Resistance.
    pub resistance_ohm: f64,
    /// Inductance.
    pub inductance_h: f64,
}

/// One frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FrameSheet {
    /// Name, for people.
    pub name: String,
    /// Least angle.
    pub angle_min_rad: f64,
    /// Greatest angle.
    pub angle_max_rad: f64,
    /// Greatest speed.
    pub speed_max_rad_per_s: f64,
}

/// One magnet, with its pose while the rod is straight: what a template publishes until there is a sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MagnetSheet {
    /// Name, for people.
    pub name: String,
    /// Centre.
    pub position_m: [f64; 3],
    /// Unit quaternion; body z is the tangent.
    pub orientation_xyzw: [f64; 4],
}

impl RigSheet {
    /// The sheet of a rig.
    #[must_use]
    pub fn of(description: &HardwareDescription) -> Self {
        let coils = description.coils.iter().map(|coil| CoilSheet {
            name: coil.name.clone(),
            current_max_a: coil.current_max,
            slew_max_a_per_s: coil.slew_max,
            resistance_ohm: coil.resistance,
            inductance_h: coil.inductance,
        });
        let frames = description.frames.iter().map(|frame| FrameSheet {
            name: frame.name.clone(),
            angle_min_rad: frame.angle_min,
            angle_max_rad: frame.angle_max,
            speed_max_rad_per_s: frame.speed_max,
        });
        Self {
            rig: description.rig.clone(),
            fingerprint: format!("{:016x}", description.fingerprint()),
            coils: coils.collect(),
            frames: frames.collect(),
            magnets: straight(description),
        }
    }
}

/// The magnets of a straight rod.
fn straight(description: &HardwareDescription) -> Vec<MagnetSheet> {
    let rows = description.manipulator.base_rotation;
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|row, column| rows[row][column]));
    let quaternion = UnitQuaternion::from_rotation_matrix(&rotation);
    let base = description.manipulator.base_position;
    let at = |length: f64| [0, 1, 2].map(|axis| base[axis] + length * rows[axis][2]);
    let mut magnets = Vec::new();
    let mut reached = 0.0;
    for part in &description.manipulator.parts {
        match part {
            PartDescription::Section(section) => reached += section.length,
            PartDescription::Magnet(magnet) => {
                magnets.push(MagnetSheet {
                    name: magnet.name.clone(),
                    position_m: at(reached + magnet.length / 2.0),
                    orientation_xyzw: [quaternion.i, quaternion.j, quaternion.k, quaternion.w],
                });
                reached += magnet.length;
            }
        }
    }
    magnets
}

#[cfg(test)]
mod tests {
    use super::RigSheet;
    use crate::message::MagnetPose;
    use crate::scripted::example_description;

    #[test]
    fn sheet_has_every_coil_and_magnets_along_the_base_tangent() {
        let description = example_description();
        let sheet = RigSheet::of(&description);
        assert_eq!((sheet.coils.len(), sheet.frames.len(), sheet.magnets.len()), (3, 2, 2));
        assert_eq!(sheet.fingerprint, format!("{:016x}", description.fingerprint()));
        // 25 mm of section and half a magnet of 5 mm beyond the base at -55 mm, along x.
        let m1 = &sheet.magnets[0];
        assert!((m1.position_m[0] + 0.0275).abs() < 1e-12 && m1.position_m[1] == 0.0, "{m1:?}");
        let pose = MagnetPose { orientation_xyzw: m1.orientation_xyzw, ..MagnetPose::default() };
        assert!((pose.tangent()[0] - 1.0).abs() < 1e-12, "{:?}", pose.tangent());
    }
}
