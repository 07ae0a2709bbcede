//! `[control.plan]` of the configuration file.

use std::ops::RangeInclusive;

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

/// Most frame settings of a search; a hundred take some 0.1 s of a core.
const SETTINGS_MAX: usize = 10_000;
/// Steps between frame angles that may be asked for.
const STEP_DEG: RangeInclusive<f64> = 1.0..=180.0;
/// Farthest frame angles that may be asked for.
const RANGE_DEG: RangeInclusive<f64> = 0.0..=180.0;

/// `[control.plan]`: how frame angles are searched for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanConfig {
    /// Step of the frame angles that are tried, deg, 1 to 180.
    pub frame_step_deg: f64,
    /// Farthest frame angle that is tried, either way, within the frame's own range, deg, 0 to 180.
    pub frame_range_deg: f64,
    /// RMS of the orientation disturbance that the currents shall be able to undo, deg, 0 to 30; (p1).
    pub disturbance_deg: f64,
    /// Least margin of stability on a way, 0 to 1: 1 without loads, 0 at a snap-through.
    pub margin_min: f64,
    /// Margin of stability below which a way is taken only where there is no better, 0 to 1.
    pub margin_wanted: f64,
    /// Greatest error of a target that counts as reached in the model, deg, > 0, at most 5.
    pub tolerance_deg: f64,
}

impl PlanConfig {
    /// Adds every value out of its range, keyed from the root of the file.
    pub fn check(&self, checks: &mut Checks) {
        checks.within("control.plan.frame_step_deg", self.frame_step_deg, *STEP_DEG.start(), *STEP_DEG.end());
        checks.within(
            "control.plan.frame_range_deg",
            self.frame_range_deg,
            *RANGE_DEG.start(),
            *RANGE_DEG.end(),
        );
        checks.within("control.plan.disturbance_deg", self.disturbance_deg, 0.0, 30.0);
        checks.within("control.plan.margin_min", self.margin_min, 0.0, 1.0);
        checks.within("control.plan.margin_wanted", self.margin_wanted, 0.0, 1.0);
        checks.within("control.plan.tolerance_deg", self.tolerance_deg, 1e-4, 5.0);
    }

    /// What does not fit the rig of `description`, keyed from the root of the file.
    #[must_use]
    pub(in crate::control) fn check_rig(&self, description: &HardwareDescription) -> Vec<Invalid> {
        let mut checks = Checks::new();
        // Values out of their own ranges are refused by `check`; a grid of them may not even fit into memory.
        if !(STEP_DEG.contains(&self.frame_step_deg) && RANGE_DEG.contains(&self.frame_range_deg)) {
            return Vec::new();
        }
        let angles = (0..description.frames.len()).map(|frame| self.angles(description, frame).len());
        let settings = angles.fold(1_usize, usize::saturating_mul);
        checks.require(
            settings <= SETTINGS_MAX,
            "control.plan.frame_step_deg",
            format!("{} ({settings} settings of all frames)", self.frame_step_deg),
            format!("large enough for at most {SETTINGS_MAX} settings"),
        );
        checks.into_result(()).err().unwrap_or_default()
    }

    /// Angles that are tried for one frame, rad: zero first, then by distance from it.
    pub(super) fn angles(&self, description: &HardwareDescription, frame: usize) -> Vec<f64> {
        let frame = &description.frames[frame];
        let (step, range) = (self.frame_step_deg.to_radians(), self.frame_range_deg.to_radians());
        // A little more, so that a range that is a multiple of the step keeps its end.
        let count = (range / step + 1e-9).floor() as i32;
        let mut angles: Vec<f64> = (-count..=count).map(|index| f64::from(index) * step).collect();
        angles.retain(|angle| (frame.angle_min..=frame.angle_max).contains(angle));
        if angles.is_empty() {
            angles.push(0.0_f64.clamp(frame.angle_min, frame.angle_max));
        }
        angles.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        angles
    }
}

#[cfg(test)]
mod tests {
    use magsteer_hal::scripted::example_description;

    use super::*;

    fn config(frame_step_deg: f64, frame_range_deg: f64) -> PlanConfig {
        PlanConfig {
            frame_step_deg,
            frame_range_deg,
            disturbance_deg: 3.0,
            margin_min: 0.1,
            margin_wanted: 0.7,
            tolerance_deg: 0.1,
        }
    }

    /// Goal: two frames of 361 angles each make more settings than a search can try, and are refused by their key.
    #[test]
    fn too_fine_a_grid_is_refused() {
        let rig = example_description();
        assert_eq!(config(10.0, 90.0).check_rig(&rig), []);
        let refused = config(1.0, 180.0).check_rig(&rig);
        assert_eq!(refused.len(), 1);
        assert_eq!(refused[0].key, "control.plan.frame_step_deg");
        assert!(refused[0].value.contains("130321 settings"), "{refused:?}");
    }

    /// Goal: a grid that would not fit into memory is refused by the range of its key, and never made.
    #[test]
    fn a_grid_out_of_its_range_is_refused_before_it_is_counted() {
        for (step, range) in [(1e-12, 90.0), (10.0, 1e12), (10.0, f64::INFINITY), (f64::NAN, 90.0)] {
            assert_eq!(config(step, range).check_rig(&example_description()), []);
            let mut checks = Checks::new();
            config(step, range).check(&mut checks);
            assert_eq!(checks.into_result(()).expect_err("out of its range").len(), 1, "{step} {range}");
        }
    }

    #[test]
    fn a_grid_keeps_its_end_and_begins_at_zero() {
        let angles = config(30.0, 90.0).angles(&example_description(), 0);
        assert_eq!(angles.len(), 7);
        assert_eq!(angles[0], 0.0);
        assert!((angles[6].abs() - 90.0_f64.to_radians()).abs() < 1e-12);
    }
}
