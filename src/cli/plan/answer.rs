//! What `magsteer plan` prints. The keys of [`Answer`] up to `reached_fraction` are stable: other programs test against them.

use magsteer::control::Directions;
use magsteer::control::plan::{Plan, Unreached, Waypoint};
use magsteer::math::statistics::wilson_interval;
use magsteer_hal::HardwareDescription;
use serde::Serialize;

use super::search::Found;

/// What became of every target.
#[derive(Debug, Serialize)]
pub struct Answer {
    pub targets: Vec<TargetAnswer>,
    pub reached_fraction: f64,
    /// Wilson's 95 % interval of the share.
    pub reached_interval: [f64; 2],
    /// Names of the frames, in the order of all angles.
    pub frames: Vec<String>,
    /// The one setting of the frames for all targets, where there is one.
    pub fixed_angles_deg: Option<Vec<f64>>,
    /// From begin to end of the search.
    pub elapsed_s: f64,
    /// Processor time of all threads.
    pub processor_s: f64,
}

/// One target. What only a way has is `null` where none was found.
#[derive(Debug, Serialize)]
pub struct TargetAnswer {
    pub reached: bool,
    /// Greatest of the magnets.
    pub error_deg: Option<f64>,
    pub currents_a: Option<Vec<f64>>,
    pub angles_deg: Option<Vec<f64>>,
    /// At the target.
    pub current_max_a: Option<f64>,
    /// Ratio of the singular values of the orientation Jacobian in the currents.
    pub condition: Option<f64>,
    /// At the target.
    pub stability_margin: Option<f64>,
    /// Why no way was found.
    pub reason: Option<String>,
    /// What was asked for: unit tangents.
    pub directions: Vec<[f64; 3]>,
    pub waypoints: Vec<WaypointAnswer>,
    /// Way from the target to rest.
    pub home: Vec<WaypointAnswer>,
    pub path_current_max_a: Option<f64>,
    pub path_margin_min: Option<f64>,
    /// Sum of squared currents that holds the target and undoes the disturbance of `[control.plan]`, in the mean.
    pub expected_power_a2: Option<f64>,
}

/// Where the magnets point, and the frames stand.
#[derive(Debug, Serialize)]
pub struct WaypointAnswer {
    pub directions: Vec<[f64; 3]>,
    pub angles_deg: Vec<f64>,
}

impl TargetAnswer {
    fn new(rig: &HardwareDescription, target: &Directions, plan: &Result<Plan, Unreached>) -> Self {
        let magnets = rig.magnets().count();
        let way = |way: &[Waypoint]| way.iter().map(|point| WaypointAnswer::new(rig, point)).collect();
        let found = plan.as_ref().ok();
        let posture = found.map(|plan| &plan.posture);
        let currents = posture.map(|posture| &posture.equilibrium.actuation.current_a[..rig.coils.len()]);
        Self {
            reached: found.is_some(),
            error_deg: found.map(|plan| plan.error.to_degrees()),
            currents_a: currents.map(<[f64]>::to_vec),
            angles_deg: posture.map(|posture| degrees(rig, &posture.equilibrium.actuation.angle_rad)),
            current_max_a: currents.map(greatest),
            condition: posture.map(|posture| posture.condition),
            stability_margin: posture.map(|posture| posture.margin),
            reason: plan.as_ref().err().map(ToString::to_string),
            directions: target[..magnets].to_vec(),
            waypoints: found.map(|plan| way(&plan.waypoints)).unwrap_or_default(),
            home: found.map(|plan| way(&plan.home)).unwrap_or_default(),
            path_current_max_a: found.map(|plan| plan.walked.current_max),
            path_margin_min: found.map(|plan| plan.walked.margin_min),
            expected_power_a2: posture.map(|posture| posture.expected),
        }
    }

    /// A line of the table.
    fn line(&self, index: usize) -> String {
        let Some(angles_deg) = &self.angles_deg else {
            return format!("{:>5}  no   {}\n", index + 1, self.reason.as_deref().unwrap_or_default());
        };
        let angles: String = angles_deg.iter().map(|angle| format!("{angle:10.1}")).collect();
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        format!(
            "{:>5}  yes{angles}{:10.2}{:10.2}{:10.2}{:10.2}{:10.1}{:10.3}\n",
            index + 1,
            number(self.current_max_a),
            number(self.path_current_max_a),
            number(self.stability_margin),
            number(self.path_margin_min),
            number(self.condition),
            number(self.error_deg),
        )
    }
}

impl WaypointAnswer {
    fn new(rig: &HardwareDescription, point: &Waypoint) -> Self {
        let magnets = rig.magnets().count();
        Self {
            directions: point.directions[..magnets].to_vec(),
            angles_deg: degrees(rig, &point.frame_angles),
        }
    }
}

impl Answer {
    /// The answer about `targets` of a rig.
    pub fn new(
        rig: &HardwareDescription,
        targets: &[Directions],
        found: &Found,
        fixed_angles: Option<&[f64]>,
    ) -> Self {
        let (reached, count) = (found.reached(), found.plans.len());
        let each = targets.iter().zip(&found.plans);
        Self {
            targets: each.map(|(target, plan)| TargetAnswer::new(rig, target, plan)).collect(),
            reached_fraction: reached as f64 / count.max(1) as f64,
            reached_interval: wilson_interval(reached as u64, count as u64),
            frames: rig.frames.iter().map(|frame| frame.name.clone()).collect(),
            fixed_angles_deg: fixed_angles.map(|angles| degrees(rig, angles)),
            elapsed_s: found.elapsed,
            processor_s: found.processor,
        }
    }

    /// True when every target was reached.
    pub fn all_reached(&self) -> bool {
        self.targets.iter().all(|target| target.reached)
    }

    /// The answer for people.
    pub fn table(&self) -> String {
        let frames: String = self.frames.iter().map(|frame| format!("{frame:>10}")).collect();
        let columns = "   current    on way    margin    on way condition     error";
        let units: String = self.frames.iter().map(|_| format!("{:>10}", "deg")).collect();
        let mut text = format!(
            "target  way{frames}{columns}\n           {units}{:>10}{:>10}{:40}{:>10}\n",
            "A", "A", "", "deg"
        );
        text = text.replace("           ", "          ");
        for (index, target) in self.targets.iter().enumerate() {
            text += &target.line(index);
        }
        let reached = self.targets.iter().filter(|target| target.reached).count();
        let count = self.targets.len();
        let [low, high] = self.reached_interval.map(|share| 100.0 * share);
        let share = 100.0 * self.reached_fraction;
        let held = self.fixed_angles_deg.as_ref().map(|angles| {
            let named =
                self.frames.iter().zip(angles).map(|(frame, angle)| format!("{frame} {angle:.0} deg"));
            format!(" with frames held at {}", named.collect::<Vec<_>>().join(", "))
        });
        let held = held.unwrap_or_default();
        text +=
            &format!("reached {reached} of {count}{held} ({share:.1} %, interval {low:.1} to {high:.1} %)\n");
        text += &format!(
            "{:.1} s, processor time {:.2} s a target\n",
            self.elapsed_s,
            self.processor_s / count.max(1) as f64
        );
        text
    }
}

/// Angles of a rig's frames, deg.
fn degrees(rig: &HardwareDescription, angles: &[f64]) -> Vec<f64> {
    angles.iter().take(rig.frames.len()).map(|angle| angle.to_degrees()).collect()
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}
