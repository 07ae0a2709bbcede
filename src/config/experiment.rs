//! A file of targets to be reached one after another.
//!
//! A step names the angle of each magnet's tangent: `zero_direction` turned about `axis` by that angle. With z and y, as in the
//! paper's planar experiment, an angle of 90 degrees points along x. For targets out of one plane a step names directions instead.
//! It may also name where the frames shall stand when the magnets have arrived; else they are the loop's own.

use std::collections::BTreeMap;
use std::path::Path;

use magsteer_hal::invalid::{Checks, Invalid};
use magsteer_hal::{HardwareDescription, MAGNETS_MAX, POSE_PARAMETERS_MAX};
use nalgebra::{Rotation3, Unit, Vector3};
use serde::{Deserialize, Serialize};

use crate::control::ReferenceTarget;

use super::document::Document;
use super::problem::Problems;

/// Longest time that a step may take, s: a day.
const DURATION_MAX_S: f64 = 86_400.0;

/// Targets one after another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// What the experiment shows, for people.
    pub description: String,
    /// Axis about which targets turn, world, right-handed; any length but zero.
    pub axis: [f64; 3],
    /// Direction of a tangent at angle zero, world, perpendicular to `axis`; any length but zero.
    pub zero_direction: [f64; 3],
    /// `[[steps]]`, at least one.
    pub steps: Vec<ExperimentStep>,
}

/// One of `[[steps]]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentStep {
    /// Angle of magnets by name, deg, -360 to 360.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub target_deg: BTreeMap<String, f64>,
    /// Direction of magnets by name, world; any length but zero. Every magnet has an angle or a direction.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub target_direction: BTreeMap<String, [f64; 3]>,
    /// Angle of each frame by name, deg, within its range; all of them or none.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub frames_deg: BTreeMap<String, f64>,
    /// Time until the next step, s, > 0.
    pub duration_s: f64,
    /// What ends the step before that; nothing when left out. Campaigns and soaks see every step to its duration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<Until>,
}

/// What ends a step before its time is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Until {
    /// Every magnet has settled at its target.
    Settled,
}

impl Experiment {
    /// Reads an experiment for the magnets and frames of a rig; every step must name each magnet once and no other.
    ///
    /// # Errors
    /// What [`Document::load`] refuses; every key that is unknown or missing; every value out of its range.
    pub fn load(path: &Path, rig: &HardwareDescription) -> Result<Self, Problems> {
        Self::from_document(&Document::load(path)?, rig)
    }

    /// As [`Experiment::load`], from a document.
    ///
    /// # Errors
    /// Every key that is unknown or missing; every value out of its range.
    pub fn from_document(document: &Document, rig: &HardwareDescription) -> Result<Self, Problems> {
        let experiment: Self = document.read()?;
        let refused = document.refuse(experiment.check(rig));
        Problems::refuse(refused, experiment)
    }

    fn check(&self, rig: &HardwareDescription) -> Vec<Invalid> {
        let mut checks = Checks::new();
        for (key, vector) in [("axis", self.axis), ("zero_direction", self.zero_direction)] {
            let norm = Vector3::from(vector).norm();
            let holds = norm.is_finite() && norm > 1e-9;
            checks.require(holds, key, format!("{vector:?}"), "a finite vector other than zero");
        }
        let (axis, zero) = (Vector3::from(self.axis), Vector3::from(self.zero_direction));
        // NaN is refused above: it must not be refused twice.
        let slanted = axis.dot(&zero).abs() > 1e-6 * axis.norm() * zero.norm();
        let value = format!("{:?}", self.zero_direction);
        checks.require(!slanted, "zero_direction", value, "perpendicular to `axis`");
        checks.require(!self.steps.is_empty(), "steps", "empty", "at least one step");
        for (index, step) in self.steps.iter().enumerate() {
            step.check(&format!("steps[{index}]"), rig, &mut checks);
        }
        checks.into_result(()).err().unwrap_or_default()
    }

    /// What a step asks for. What it does not name is left at zero; [`Experiment::load`] refuses such a step.
    #[must_use]
    pub fn target(&self, step: &ExperimentStep, rig: &HardwareDescription) -> ReferenceTarget {
        let axis = Unit::new_normalize(Vector3::from(self.axis));
        let zero = Vector3::from(self.zero_direction).normalize();
        let mut directions = [[0.0; 3]; MAGNETS_MAX];
        for (direction, magnet) in directions.iter_mut().zip(rig.magnets()) {
            if let Some(angle_deg) = step.target_deg.get(&magnet.name) {
                let turn = Rotation3::from_axis_angle(&axis, angle_deg.to_radians());
                *direction = (turn * zero).into();
            } else if let Some(named) = step.target_direction.get(&magnet.name) {
                *direction = Vector3::from(*named).normalize().into();
            }
        }
        let mut angles = [0.0; POSE_PARAMETERS_MAX];
        for (angle, frame) in angles.iter_mut().zip(&rig.frames) {
            *angle = step.frames_deg.get(&frame.name).map_or(0.0, |angle_deg| angle_deg.to_radians());
        }
        ReferenceTarget { directions, frame_angles: (!step.frames_deg.is_empty()).then_some(angles) }
    }
}

impl ExperimentStep {
    /// Adds every value out of its range, and every magnet and frame that is missing or unknown, keyed from `key`.
    pub fn check(&self, key: &str, rig: &HardwareDescription, checks: &mut Checks) {
        let holds = self.duration_s.is_finite() && self.duration_s > 0.0 && self.duration_s <= DURATION_MAX_S;
        let expected = format!("> 0 and at most {DURATION_MAX_S}");
        checks.require(holds, format!("{key}.duration_s"), self.duration_s, expected);
        let magnets: Vec<&str> = rig.magnets().map(|magnet| magnet.name.as_str()).collect();
        let one_of = || format!("an angle of one of the rig's magnets ({})", magnets.join(", "));
        let targets = format!("{key}.target_deg");
        for (name, angle_deg) in &self.target_deg {
            let known = magnets.contains(&name.as_str());
            checks.require(known, format!("{targets}.{name}"), name, one_of());
            checks.within(format!("{targets}.{name}"), *angle_deg, -360.0, 360.0);
        }
        for (name, direction) in &self.target_direction {
            let key = format!("{key}.target_direction.{name}");
            checks.require(magnets.contains(&name.as_str()), &key, name, one_of());
            let norm = Vector3::from(*direction).norm();
            let holds = norm.is_finite() && norm > 1e-9;
            checks.require(holds, &key, format!("{direction:?}"), "a finite vector other than zero");
            let once = !self.target_deg.contains_key(name);
            checks.require(once, key, name, "an angle or a direction, not both");
        }
        for name in &magnets {
            let value = format!("nothing for {name}");
            let expected = format!("an angle for each magnet ({})", magnets.join(", "));
            let told = self.target_deg.contains_key(*name) || self.target_direction.contains_key(*name);
            checks.require(told, &targets, value, expected);
        }
        self.check_frames(key, rig, checks);
    }

    fn check_frames(&self, key: &str, rig: &HardwareDescription, checks: &mut Checks) {
        let key = format!("{key}.frames_deg");
        let names: Vec<&str> = rig.frames.iter().map(|frame| frame.name.as_str()).collect();
        for (name, angle_deg) in &self.frames_deg {
            let key = format!("{key}.{name}");
            match rig.frames.iter().find(|frame| frame.name == *name) {
                Some(frame) => {
                    let (least, most) = (frame.angle_min.to_degrees(), frame.angle_max.to_degrees());
                    // One part in 10^12 for the rounding of a range in radians.
                    let slack = 1e-12 * (most - least);
                    checks.within(key, *angle_deg, least - slack, most + slack);
                }
                None => {
                    let expected = format!("an angle of one of the rig's frames ({})", names.join(", "));
                    checks.require(false, key, name, expected);
                }
            }
        }
        if self.frames_deg.is_empty() {
            return;
        }
        for name in &names {
            let expected = format!("an angle for each frame ({}) or for none", names.join(", "));
            checks.require(
                self.frames_deg.contains_key(*name),
                &key,
                format!("nothing for {name}"),
                expected,
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rig of two magnets and two frames.
    fn rig() -> HardwareDescription {
        magsteer_hal::scripted::example_description()
    }

    fn planar() -> Experiment {
        Experiment {
            description: String::new(),
            axis: [0.0, 2.0, 0.0],
            zero_direction: [0.0, 0.0, 1.0],
            steps: vec![ExperimentStep {
                target_deg: BTreeMap::from([("m1".to_owned(), 90.0), ("m2".to_owned(), 30.0)]),
                target_direction: BTreeMap::new(),
                frames_deg: BTreeMap::new(),
                duration_s: 4.0,
                until: None,
            }],
        }
    }

    #[test]
    fn ninety_degrees_about_y_from_z_points_along_x() {
        let experiment = planar();
        let target = experiment.target(&experiment.steps[0], &rig());
        assert_eq!(target.frame_angles, None);
        let directions = target.directions;
        let expected = [[1.0, 0.0, 0.0], [0.5, 0.0, 0.75_f64.sqrt()]];
        for (direction, expected) in directions.iter().zip(expected) {
            let error = (Vector3::from(*direction) - Vector3::from(expected)).norm();
            assert!(error < 1e-15, "{direction:?} instead of {expected:?}");
        }
        assert_eq!(directions[2], [0.0; 3]);
    }

    #[test]
    fn a_slanted_zero_direction_is_refused_once() {
        let experiment = Experiment { zero_direction: [0.0, 0.1, 1.0], ..planar() };
        let refused = experiment.check(&rig());
        assert_eq!(refused.len(), 1, "{refused:?}");
        assert_eq!(refused[0].key, "zero_direction");
    }

    /// The planar experiment with its step changed.
    fn refused(change: impl Fn(&mut ExperimentStep)) -> Vec<String> {
        let mut experiment = planar();
        change(&mut experiment.steps[0]);
        experiment.check(&rig()).into_iter().map(|invalid| invalid.key).collect()
    }

    #[test]
    fn each_step_names_every_magnet_once_and_no_other() {
        let missing = refused(|step| step.target_deg = BTreeMap::from([("m1".to_owned(), 0.0)]));
        assert_eq!(missing, ["steps[0].target_deg"]);
        let unknown = refused(|step| {
            step.target_deg.insert("m3".to_owned(), 0.0);
        });
        assert_eq!(unknown, ["steps[0].target_deg.m3"]);
        let twice = refused(|step| {
            step.target_direction.insert("m1".to_owned(), [0.0, 0.0, 2.0]);
        });
        assert_eq!(twice, ["steps[0].target_direction.m1"]);
    }

    #[test]
    fn frames_are_named_all_or_none_and_within_their_ranges() {
        let frames = |angles: &[(&str, f64)]| {
            let angles: BTreeMap<_, _> =
                angles.iter().map(|(name, angle)| ((*name).to_owned(), *angle)).collect();
            refused(|step| step.frames_deg = angles.clone())
        };
        let [first, second] = [0, 1].map(|frame| rig().frames[frame].name.clone());
        assert_eq!(frames(&[(&first, 180.0), (&second, -180.0)]), [""; 0]);
        assert_eq!(frames(&[(&first, 10.0)]), ["steps[0].frames_deg"]);
        assert_eq!(frames(&[(&first, 181.0), (&second, 0.0)]), [format!("steps[0].frames_deg.{first}")]);
        assert_eq!(frames(&[(&first, 1.0), (&second, 0.0), ("middle", 0.0)]), ["steps[0].frames_deg.middle"]);
    }

    #[test]
    fn a_direction_is_normalised_and_frame_angles_are_in_radians() {
        let rig = rig();
        let mut experiment = planar();
        let step = &mut experiment.steps[0];
        step.target_deg.remove("m2");
        step.target_direction.insert("m2".to_owned(), [0.0, 3.0, 4.0]);
        for (frame, angle) in rig.frames.iter().zip([90.0, -45.0]) {
            step.frames_deg.insert(frame.name.clone(), angle);
        }
        let target = experiment.target(&experiment.steps[0], &rig);
        assert_eq!(target.directions[1], [0.0, 0.6, 0.8]);
        let angles = target.frame_angles.expect("given");
        assert_eq!(angles[..2], [90.0_f64.to_radians(), -45.0_f64.to_radians()]);
    }
}
