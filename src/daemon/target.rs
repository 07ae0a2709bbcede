//! Targets as people write them, `m1=70deg` or `m1=0.9,0,0.4`, and tangents as people read them.
//!
//! The angle of a target turns the world's z axis about a given axis; about y, as in the paper's planar experiment, 90 deg
//! points along x. The angle shown for a tangent is that from z, 0 to 180 deg, the paper's phi.

use std::str::FromStr;

use nalgebra::{Rotation3, Unit, Vector3};

use crate::control::Directions;

/// One magnet's target, as `m1=70deg`, `m1=1.2rad` or `m1=0.9,0,0.4`.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnetTarget {
    /// Name of the magnet.
    pub magnet: String,
    /// Where it shall point.
    pub aim: Aim,
}

/// Where a magnet shall point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// Angle from z about the axis of the targets, rad.
    Angle(f64),
    /// Unit tangent, world.
    Direction([f64; 3]),
}

/// A target that cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// Not `NAME=NUMBERdeg`, `NAME=NUMBERrad` nor `NAME=X,Y,Z`.
    #[error("target {text:?}: must be NAME=ANGLE with its unit, as m1=70deg or m1=1.2rad, or NAME=X,Y,Z")]
    Form {
        /// What was written.
        text: String,
    },
    /// An angle that is not finite or beyond a turn.
    #[error("target {text:?}: must lie between -360deg and 360deg")]
    Angle {
        /// What was written.
        text: String,
    },
    /// A direction that is not finite or has no length.
    #[error("target {text:?}: must be a direction, finite and not zero")]
    Direction {
        /// What was written.
        text: String,
    },
    /// No magnet of this name.
    #[error("target for magnet {name:?}: must be one of {names}")]
    UnknownMagnet {
        /// What was written.
        name: String,
        /// The rig's magnets.
        names: String,
    },
    /// One magnet twice.
    #[error("magnet {name} has two targets: must have one")]
    Twice {
        /// Its name.
        name: String,
    },
    /// An axis without direction.
    #[error("axis {axis:?}: must be finite and not zero")]
    Axis {
        /// What was given.
        axis: [f64; 3],
    },
}

impl FromStr for MagnetTarget {
    type Err = TargetError;

    fn from_str(text: &str) -> Result<Self, TargetError> {
        let form = || TargetError::Form { text: text.to_owned() };
        let (magnet, aim) = text.split_once('=').ok_or_else(form)?;
        if magnet.is_empty() {
            return Err(form());
        }
        let magnet = magnet.to_owned();
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| form());
        if let [x, y, z] = aim.split(',').collect::<Vec<_>>()[..] {
            let direction = Vector3::new(number(x)?, number(y)?, number(z)?);
            let unit = direction.try_normalize(1e-9).filter(|unit| unit.iter().all(|it| it.is_finite()));
            let unit = unit.ok_or(TargetError::Direction { text: text.to_owned() })?;
            return Ok(Self { magnet, aim: Aim::Direction(unit.into()) });
        }
        let in_degrees = aim.strip_suffix("deg").map(|number| (number, 1.0_f64.to_radians()));
        let (written, unit) = in_degrees.or(aim.strip_suffix("rad").map(|it| (it, 1.0))).ok_or_else(form)?;
        let angle = number(written)? * unit;
        // One part in 10^12 for the rounding of 360 deg.
        if !angle.is_finite() || angle.abs() > std::f64::consts::TAU * (1.0 + 1e-12) {
            return Err(TargetError::Angle { text: text.to_owned() });
        }
        Ok(Self { magnet, aim: Aim::Angle(angle) })
    }
}

/// The tangents for `targets`, whose magnets are named base to tip by `magnets`; a magnet without a target keeps its
/// direction in `present`.
///
/// # Errors
/// A magnet that the rig does not have or that is named twice; an axis without direction.
pub fn directions(
    targets: &[MagnetTarget],
    axis: [f64; 3],
    magnets: &[&str],
    present: &Directions,
) -> Result<Directions, TargetError> {
    let turned = Unit::try_new(Vector3::from(axis), 1e-9).filter(|unit| unit.iter().all(|it| it.is_finite()));
    let turned = turned.ok_or(TargetError::Axis { axis })?;
    let mut directions = *present;
    for (index, target) in targets.iter().enumerate() {
        let name = &target.magnet;
        if targets[..index].iter().any(|earlier| earlier.magnet == *name) {
            return Err(TargetError::Twice { name: name.clone() });
        }
        let magnet = magnets.iter().position(|magnet| magnet == name);
        let unknown = || TargetError::UnknownMagnet { name: name.clone(), names: magnets.join(", ") };
        directions[magnet.ok_or_else(unknown)?] = match target.aim {
            Aim::Angle(angle) => (Rotation3::from_axis_angle(&turned, angle) * Vector3::z()).into(),
            Aim::Direction(direction) => direction,
        };
    }
    Ok(directions)
}

/// Angle of a tangent from z, deg; `None` for the zero vector, which stands for no tangent.
#[must_use]
pub fn angle_from_z_deg(direction: &[f64; 3]) -> Option<f64> {
    let [x, y, z] = *direction;
    let across = x.hypot(y);
    // atan2 keeps its precision near 0 and 180 deg, where acos(z) loses half the digits.
    (across.hypot(z) > 0.5).then(|| across.atan2(z).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::{MagnetTarget, TargetError, angle_from_z_deg, directions};
    use crate::control::Directions;

    fn parsed(texts: &[&str]) -> Vec<MagnetTarget> {
        texts.iter().map(|text| text.parse().expect("well formed")).collect()
    }

    #[test]
    fn ninety_degrees_about_y_points_along_x_and_reads_back() {
        let present = Directions::default();
        let set = directions(&parsed(&["m2=90deg", "m1=30deg"]), [0.0, 2.0, 0.0], &["m1", "m2"], &present);
        let set = set.expect("valid");
        for (component, expected) in set[1].iter().zip([1.0, 0.0, 0.0]) {
            assert!((component - expected).abs() < 1e-15);
        }
        assert!((angle_from_z_deg(&set[0]).expect("set") - 30.0).abs() < 1e-12);
        assert_eq!(angle_from_z_deg(&set[2]), None, "no third magnet");
    }

    #[test]
    fn a_direction_is_made_unit_and_needs_no_axis() {
        let set = directions(&parsed(&["m1=0,3,4"]), [0.0, 1.0, 0.0], &["m1", "m2"], &Directions::default());
        assert_eq!(set.expect("valid")[0], [0.0, 0.6, 0.8]);
        for text in ["m1=0,0,0", "m1=nan,0,1", "m1=inf,0,1"] {
            let refused = text.parse::<MagnetTarget>();
            assert!(matches!(refused, Err(TargetError::Direction { .. })), "{text}: {refused:?}");
        }
        assert!(matches!("m1=1,2".parse::<MagnetTarget>(), Err(TargetError::Form { .. })));
    }

    #[test]
    fn a_magnet_without_a_target_keeps_its_direction() {
        let mut present = Directions::default();
        present[0] = [0.6, 0.0, 0.8];
        let set = directions(&parsed(&["m2=0.5rad"]), [0.0, 1.0, 0.0], &["m1", "m2"], &present);
        let set = set.expect("valid");
        assert_eq!(set[0], [0.6, 0.0, 0.8]);
        assert!((set[1][0] - 0.5_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn what_is_wrong_with_a_target_is_said() {
        for text in ["m1", "m1=70", "=70deg", "m1=deg", "m1=x deg", "m1=70 grad"] {
            let refused = text.parse::<MagnetTarget>();
            assert!(matches!(refused, Err(TargetError::Form { .. })), "{text}: {refused:?}");
        }
        for text in ["m1=361deg", "m1=7rad", "m1=nandeg", "m1=infdeg"] {
            let refused = text.parse::<MagnetTarget>();
            assert!(matches!(refused, Err(TargetError::Angle { .. })), "{text}: {refused:?}");
        }
        let y = [0.0, 1.0, 0.0];
        let refuse = |texts: &[&str], axis| {
            directions(&parsed(texts), axis, &["m1", "m2"], &Directions::default())
                .expect_err("refused")
                .to_string()
        };
        assert!(refuse(&["m3=10deg"], y).contains("must be one of m1, m2"));
        assert!(refuse(&["m1=10deg", "m1=20deg"], y).contains("two targets"));
        assert!(refuse(&["m1=10deg"], [0.0; 3]).contains("must be finite and not zero"));
        assert!(refuse(&["m1=10deg"], [f64::NAN, 0.0, 1.0]).contains("must be finite"));
    }
}
