//! A file of targets to be reached one after another.
//!
//! A step names the angle of each magnet's tangent, `zero_direction` turned about `axis` by that angle, or its direction in the world. With z
//! and y, as in the paper's planar experiment, an angle of 90 degrees points along x.

use std::collections::BTreeMap;
use std::path::Path;

use magsteer_hal::MAGNETS_MAX;
use magsteer_hal::invalid::{Checks, Invalid};
use nalgebra::{Rotation3, Unit, Vector3};
use serde::{Deserialize, Serialize};

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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentStep {
    /// Angle of each magnet by name, deg, -360 to 360.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub target_deg: BTreeMap<String, f64>,
    /// Direction of each other magnet's tangent by name, world; any length but zero.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub target_direction: BTreeMap<String, [f64; 3]>,
    /// Time until the next step, s, > 0.
    pub duration_s: f64,
}

impl Experiment {
    /// Reads an experiment for the magnets of a rig, named from base to tip; every step must name each of them once and no other.
    ///
    /// # Errors
    /// What [`Document::load`] refuses; every key that is unknown or missing; every value out of its range.
    pub fn load(path: &Path, magnets: &[&str]) -> Result<Self, Problems> {
        Self::from_document(&Document::load(path)?, magnets)
    }

    /// As [`Experiment::load`], from a document.
    ///
    /// # Errors
    /// Every key that is unknown or missing; every value out of its range.
    pub fn from_document(document: &Document, magnets: &[&str]) -> Result<Self, Problems> {
        let experiment: Self = document.read()?;
        let refused = document.refuse(experiment.check(magnets));
        Problems::refuse(refused, experiment)
    }

    fn check(&self, magnets: &[&str]) -> Vec<Invalid> {
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
            step.check(&format!("steps[{index}]"), magnets, &mut checks);
        }
        checks.into_result(()).err().unwrap_or_default()
    }

    /// Desired unit tangents of a step, one a magnet in the order of `magnets`; the rest is zero.
    /// A magnet that the step does not name is left at zero; [`Experiment::load`] refuses such a step.
    #[must_use]
    pub fn directions(&self, step: &ExperimentStep, magnets: &[&str]) -> [[f64; 3]; MAGNETS_MAX] {
        let axis = Unit::new_normalize(Vector3::from(self.axis));
        let zero = Vector3::from(self.zero_direction).normalize();
        let mut directions = [[0.0; 3]; MAGNETS_MAX];
        for (direction, name) in directions.iter_mut().zip(magnets) {
            if let Some(angle_deg) = step.target_deg.get(*name) {
                let turn = Rotation3::from_axis_angle(&axis, angle_deg.to_radians());
                *direction = (turn * zero).into();
            } else if let Some(along) = step.target_direction.get(*name) {
                *direction = Vector3::from(*along).normalize().into();
            }
        }
        directions
    }
}

impl ExperimentStep {
    fn check(&self, key: &str, magnets: &[&str], checks: &mut Checks) {
        let holds = self.duration_s.is_finite() && self.duration_s > 0.0 && self.duration_s <= DURATION_MAX_S;
        let expected = format!("> 0 and at most {DURATION_MAX_S}");
        checks.require(holds, format!("{key}.duration_s"), self.duration_s, expected);
        let targets = format!("{key}.target_deg");
        for (name, angle_deg) in &self.target_deg {
            let expected = format!("an angle of one of the rig's magnets ({})", magnets.join(", "));
            checks.require(magnets.contains(&name.as_str()), format!("{targets}.{name}"), name, expected);
            checks.within(format!("{targets}.{name}"), *angle_deg, -360.0, 360.0);
        }
        for (name, direction) in &self.target_direction {
            let key = format!("{key}.target_direction.{name}");
            let expected = format!("a direction of one of the rig's magnets ({})", magnets.join(", "));
            checks.require(magnets.contains(&name.as_str()), &key, name, expected);
            let norm = Vector3::from(*direction).norm();
            let value = format!("{direction:?}");
            checks.require(norm.is_finite() && norm > 1e-9, &key, value, "a finite vector other than zero");
            let twice = self.target_deg.contains_key(name);
            checks.require(!twice, &key, name, "no direction, since `target_deg` names the magnet");
        }
        for name in magnets {
            let value = format!("nothing for {name}");
            let expected = format!("an angle for each magnet ({}), or a direction", magnets.join(", "));
            let named = self.target_deg.contains_key(*name) || self.target_direction.contains_key(*name);
            checks.require(named, &targets, value, expected);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn planar() -> Experiment {
        Experiment {
            description: String::new(),
            axis: [0.0, 2.0, 0.0],
            zero_direction: [0.0, 0.0, 1.0],
            steps: vec![ExperimentStep {
                target_deg: BTreeMap::from([("m1".to_owned(), 90.0), ("m2".to_owned(), 30.0)]),
                target_direction: BTreeMap::new(),
                duration_s: 4.0,
            }],
        }
    }

    #[test]
    fn ninety_degrees_about_y_from_z_points_along_x() {
        let experiment = planar();
        let directions = experiment.directions(&experiment.steps[0], &["m1", "m2"]);
        let expected = [[1.0, 0.0, 0.0], [0.5, 0.0, 0.75_f64.sqrt()]];
        for (direction, expected) in directions.iter().zip(expected) {
            let error = (Vector3::from(*direction) - Vector3::from(expected)).norm();
            assert!(error < 1e-15, "{direction:?} instead of {expected:?}");
        }
        assert_eq!(directions[2], [0.0; 3]);
    }

    #[test]
    fn a_direction_stands_for_an_angle_and_is_given_once() {
        let mut experiment = planar();
        experiment.steps[0].target_deg.remove("m2");
        experiment.steps[0].target_direction.insert("m2".to_owned(), [0.0, 3.0, 4.0]);
        assert_eq!(experiment.check(&["m1", "m2"]).len(), 0);
        let directions = experiment.directions(&experiment.steps[0], &["m1", "m2"]);
        assert_eq!(directions[1], [0.0, 0.6, 0.8]);
        experiment.steps[0].target_deg.insert("m2".to_owned(), 30.0);
        let refused = experiment.check(&["m1", "m2"]);
        assert_eq!(refused.len(), 1, "{refused:?}");
        assert_eq!(refused[0].key, "steps[0].target_direction.m2");
    }

    #[test]
    fn a_slanted_zero_direction_is_refused_once() {
        let experiment = Experiment { zero_direction: [0.0, 0.1, 1.0], ..planar() };
        let refused = experiment.check(&["m1", "m2"]);
        assert_eq!(refused.len(), 1, "{refused:?}");
        assert_eq!(refused[0].key, "zero_direction");
    }

    #[test]
    fn each_step_names_every_magnet_and_no_other() {
        let refused: Vec<String> =
            planar().check(&["m1", "m3"]).into_iter().map(|invalid| invalid.key).collect();
        assert_eq!(refused, ["steps[0].target_deg.m2", "steps[0].target_deg"]);
    }
}
