//! Targets of another program as lines of JSON, one object a line, with an experiment step's keys.
//!
//! A magnet that a line does not name keeps its target. What refuses a step of an experiment refuses a line.

use std::collections::BTreeMap;

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;
use serde::Deserialize;

use super::experiment::{Experiment, ExperimentStep};
use crate::control::{Directions, ReferenceTarget};

/// One line.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    #[serde(default)]
    target_deg: BTreeMap<String, f64>,
    #[serde(default)]
    target_direction: BTreeMap<String, [f64; 3]>,
    #[serde(default)]
    frames_deg: BTreeMap<String, f64>,
}

/// Turns lines into targets.
#[derive(Debug)]
pub struct TargetLines<'a> {
    rig: &'a HardwareDescription,
    axis: [f64; 3],
    /// Of every magnet, what it points to when a line does not name it.
    present: Directions,
}

impl<'a> TargetLines<'a> {
    /// `axis`: about which angles turn from z, world, right-handed, of any length but zero; `present`: unit tangents that the
    /// magnets are sent to before the first line, world.
    #[must_use]
    pub const fn new(rig: &'a HardwareDescription, axis: [f64; 3], present: Directions) -> Self {
        Self { rig, axis, present }
    }

    /// The rig whose magnets and frames lines name.
    #[must_use]
    pub const fn rig(&self) -> &'a HardwareDescription {
        self.rig
    }

    /// The target of the next line.
    ///
    /// # Errors
    /// What is wrong with the line, by key, value and what would be right.
    pub fn target(&mut self, text: &str) -> Result<ReferenceTarget, String> {
        let line: Line = serde_json::from_str(text).map_err(|error| {
            let expected = "as {\"target_deg\": {\"m1\": 80}}";
            format!("{text:?}: {error}: must be one JSON object, {expected}")
        })?;
        let mut step = ExperimentStep {
            target_deg: line.target_deg,
            target_direction: line.target_direction,
            frames_deg: line.frames_deg,
            duration_s: 1.0,
            until: None,
        };
        for (magnet, direction) in self.rig.magnets().zip(&self.present) {
            if !step.target_deg.contains_key(&magnet.name) {
                step.target_direction.entry(magnet.name.clone()).or_insert(*direction);
            }
        }
        let mut checks = Checks::new();
        step.check("target", self.rig, &mut checks);
        if let Some(invalid) = checks.into_result(()).err().and_then(|found| found.into_iter().next()) {
            return Err(invalid.to_string().replacen("target.", "", 1));
        }
        let zero_direction = [0.0, 0.0, 1.0];
        let script =
            Experiment { description: String::new(), axis: self.axis, zero_direction, steps: Vec::new() };
        let target = script.target(&step, self.rig);
        self.present = target.directions;
        Ok(target)
    }
}

#[cfg(test)]
mod tests {
    use super::{Directions, TargetLines};

    #[test]
    fn lines_name_some_magnets_and_leave_the_others_where_they_were_sent() {
        let rig = magsteer_hal::scripted::example_description();
        let mut present = Directions::default();
        (present[0], present[1]) = ([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]);
        let mut lines = TargetLines::new(&rig, [0.0, 1.0, 0.0], present);
        let target = lines.target(r#"{"target_deg": {"m1": 90}}"#).expect("well formed");
        assert!((target.directions[0][0] - 1.0).abs() < 1e-15);
        assert_eq!(target.directions[1], [0.0, 1.0, 0.0]);
        let target = lines.target(r#"{"target_direction": {"m2": [0, 0, 2]}}"#).expect("well formed");
        assert!((target.directions[0][0] - 1.0).abs() < 1e-15, "stays where the first line sent it");
        assert_eq!(target.directions[1], [0.0, 0.0, 1.0]);
        for (text, named) in [
            ("{", "EOF"),
            (r#"{"target": 1}"#, "unknown field"),
            (r#"{"target_deg": {"m9": 1}}"#, "m9"),
            (r#"{"target_deg": {"m1": 400}}"#, "400"),
            (r#"{"target_direction": {"m1": [0, 0, 0]}}"#, "other than zero"),
        ] {
            let message = lines.target(text).expect_err("refused");
            assert!(message.contains(named), "{message}");
        }
    }
}
