//! Global search over frame settings: what can be asked of it. How it goes is in `search`.

use magsteer_hal::{Actuation, COILS_MAX, HardwareDescription, POSE_PARAMETERS_MAX};
use rayon::prelude::*;

use super::config::PlanConfig;
use super::rehearsal::Rehearsal;
use super::route::Route;
use super::search::{Goal, Tried};
use super::walk::{Bounds, Obstacle, Posture, Walked, Waypoint};
use super::walker::Walker;
use crate::control::config::ControlConfig;
use crate::control::step::{Directions, Equilibrium};
use crate::rod::Manipulator;

/// Greatest angle between where this model comes from a loop's equilibrium and where the loop's own model is, rad: on another branch, and
/// where the two are not of one rig, it is many times that; a loop whose jump is not caught up with is off by less.
const SAME_POSTURE: f64 = 1.5_f64.to_radians();

/// Frame angles, rad.
pub(super) type Setting = [f64; POSE_PARAMETERS_MAX];

/// A way to a target, walked in the model from its beginning to its end.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Where the way leads along, the target last.
    pub waypoints: Vec<Waypoint>,
    /// Equilibrium at its end.
    pub posture: Posture,
    /// Extremes over the whole way.
    pub walked: Walked,
    /// Greatest error of a magnet at the end, rad.
    pub error: f64,
    /// A way from its end to rest, walked as well.
    pub home: Vec<Waypoint>,
    /// True when the loop's scout would let it pass, were the loop where the plan begins; always without a scout.
    pub passes: bool,
}

impl Plan {
    /// Where the rod stands at its end.
    #[must_use]
    pub fn standing(&self) -> Standing {
        Standing { posture: self.posture, home: Some(self.home.clone()) }
    }
}

/// A posture and a way from it to rest.
#[derive(Debug, Clone)]
pub struct Standing {
    /// The equilibrium.
    pub posture: Posture,
    /// Waypoints to the rest posture; `None` where no way there is known.
    pub home: Option<Vec<Waypoint>>,
}

/// Why no way was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not reached with any of {tried} frame settings; where it came closest {}", .closest.text())]
pub struct Unreached {
    /// Frame settings tried.
    pub tried: usize,
    /// What ended the walk that came closest.
    pub closest: Obstacle,
}

/// Plans ways of one rig. Searches run on the threads of the rayon pool that they are called in, with the same result for any number.
#[derive(Debug, Clone)]
pub struct Planner {
    pub(super) walker: Walker,
    /// Best first, by what holding the rod at rest against disturbances takes.
    pub(super) settings: Vec<Tried>,
    pub(super) groups: Vec<Vec<Route>>,
    pub(super) rest: Standing,
    /// Walks as the loop's scout does, where there is one.
    pub(super) scout: Option<Rehearsal>,
    pub(super) bounds: Bounds,
    pub(super) margin_wanted: f64,
    pub(super) frame_step: f64,
    pub(super) ranges: Vec<(f64, f64)>,
}

impl Planner {
    /// A planner for the rig of `description`.
    #[must_use]
    pub fn new(
        plan: &PlanConfig,
        control: &ControlConfig,
        description: &HardwareDescription,
        manipulator: Manipulator,
    ) -> Self {
        let magnets = manipulator.magnet_count();
        let frames = description.frames.len();
        let mut settings = vec![[0.0; POSE_PARAMETERS_MAX]];
        for frame in 0..frames {
            let angles = plan.angles(description, frame);
            settings = settings
                .iter()
                .flat_map(|setting| {
                    angles.iter().map(move |angle| {
                        let mut setting = *setting;
                        setting[frame] = *angle;
                        setting
                    })
                })
                .collect();
        }
        let scout = control.scout.as_ref();
        let scout = scout.map(|scout| Rehearsal::new(scout, control, description, manipulator.clone()));
        let mut walker = Walker::new(control, description, manipulator, plan.disturbance_deg.to_radians());
        let angle_rad = control.resting_frames(description);
        // Frames that turn without currents turn nothing.
        let _ = walker.actuate(&Actuation { angle_rad, ..Actuation::default() });
        let mut planner = Self {
            rest: Standing { posture: walker.posture(), home: Some(Vec::new()) },
            walker,
            scout,
            settings: Vec::new(),
            groups: Route::groups(magnets),
            bounds: Bounds { margin_min: plan.margin_min, tolerance: plan.tolerance_deg.to_radians() },
            margin_wanted: plan.margin_wanted,
            frame_step: plan.frame_step_deg.to_radians(),
            ranges: description.frames.iter().map(|frame| (frame.angle_min, frame.angle_max)).collect(),
        };
        planner.settings = settings.into_iter().map(|setting| planner.try_at_rest(setting)).collect();
        let held = |tried: &Tried| tried.rest.map_or(f64::INFINITY, |(posture, _)| posture.expected);
        planner.settings.sort_by(|a, b| held(a).total_cmp(&held(b)));
        planner
    }

    /// From now on plans for a rig whose every coil makes `gains` times its described field. In which order settings are tried stays.
    pub fn set_gains(&mut self, gains: &[f64; COILS_MAX]) {
        self.walker.set_gains(gains);
        self.scout.iter_mut().for_each(|scout| scout.set_gains(gains));
    }

    /// The posture without currents, frames where they stand while nothing steers them.
    #[must_use]
    pub fn rest(&self) -> &Standing {
        &self.rest
    }

    /// Number of frame settings that a search tries.
    #[must_use]
    pub fn setting_count(&self) -> usize {
        self.settings.len()
    }

    /// The best way from rest to `target`.
    ///
    /// # Errors
    /// When no setting arrives.
    pub fn from_rest(&self, target: &Directions) -> Result<Plan, Unreached> {
        self.search(&self.rest.posture, &Goal::target(target, &[]), true)
    }

    /// A way from rest to `target` with the frames held at one setting, as an array without frames would have it.
    ///
    /// # Errors
    /// When it does not arrive.
    pub fn from_rest_with(&self, setting: &Setting, target: &Directions) -> Result<Plan, Unreached> {
        self.search_held(&self.try_at_rest(*setting), target)
    }

    /// The setting of the grid, rad, with which most of `targets` are reached from rest, frames held; the one nearest to zero of several.
    /// `done` is told of each target whether any setting reaches it.
    pub fn best_fixed(&self, targets: &[Directions], done: impl Fn(bool) + Sync) -> Setting {
        let reached_by = |target: &Directions| {
            let settings = self.settings.par_iter();
            let reached: Vec<bool> = settings.map(|tried| self.search_held(tried, target).is_ok()).collect();
            done(reached.contains(&true));
            reached
        };
        let reached: Vec<Vec<bool>> = targets.par_iter().map(reached_by).collect();
        let count = |index: &usize| reached.iter().filter(|reached| reached[*index]).count();
        let distance =
            |index: &usize| self.settings[*index].setting.iter().map(|angle| angle.abs()).sum::<f64>();
        let better =
            |a: &usize, b: &usize| count(a).cmp(&count(b)).then_with(|| distance(b).total_cmp(&distance(a)));
        let best = (0..self.settings.len()).max_by(better);
        best.map_or_else(Setting::default, |best| self.settings[best].setting)
    }

    /// The best way from `from` to `target`: straight there, or back to rest and from there, whichever keeps farther from what ends walks.
    ///
    /// # Errors
    /// When no setting arrives.
    pub fn plan(&self, from: &Standing, target: &Directions) -> Result<Plan, Unreached> {
        self.plan_avoiding(from, target, &[])
    }

    /// As [`Self::plan`], with none of these frame settings at the end, rad: those that a loop has tried in vain.
    ///
    /// # Errors
    /// When no other setting arrives.
    pub fn plan_avoiding(
        &self,
        from: &Standing,
        target: &Directions,
        avoided: &[Setting],
    ) -> Result<Plan, Unreached> {
        let goal = Goal::target(target, avoided);
        let straight = self.search(&from.posture, &goal, false);
        let around = self.by_way_of_rest(from, &goal);
        match (straight, around) {
            (Ok(straight), Ok(around)) => {
                let is_better = match (straight.passes, around.passes) {
                    (true, false) => true,
                    (false, true) => false,
                    _ => self.score(&straight.walked) <= self.score(&around.walked),
                };
                Ok(if is_better { straight } else { around })
            }
            (Ok(plan), Err(_)) | (Err(_), Ok(plan)) => Ok(plan),
            // A way to rest that is missing says nothing of the target.
            (Err(straight), Err(around)) => Err(if around.tried > 1 { around } else { straight }),
        }
    }

    /// Where a loop stands whose model is at `equilibrium`, its magnets as `predicted` there; `None` when this model does not come there.
    /// Its way to rest is one that the loop's scout lets pass, where there is one, and ends with none of the frame settings `avoided`, rad;
    /// `back` leads there along where the loop came from.
    #[must_use]
    pub fn standing_at(
        &self,
        equilibrium: &Equilibrium,
        predicted: &Directions,
        back: &[Waypoint],
        avoided: &[Setting],
    ) -> Option<Standing> {
        let mut walker = self.walker.clone();
        walker.resume(equilibrium).ok()?;
        let posture = (walker.error_to(predicted) <= SAME_POSTURE).then(|| walker.posture())?;
        let along = self.way_home(&posture, back, avoided);
        if along.as_ref().is_some_and(|home| self.passes(&posture, home)) {
            return Some(Standing { posture, home: along });
        }
        let rest = Goal::rest(&self.rest.posture.directions, avoided);
        let found = self.search(&posture, &rest, false).ok();
        let home = match (found, along) {
            (Some(found), along) if found.passes || along.is_none() => Some(found.waypoints),
            (_, along) => along,
        };
        Some(Standing { posture, home })
    }

    fn by_way_of_rest(&self, from: &Standing, goal: &Goal<'_>) -> Result<Plan, Unreached> {
        let lost = |obstacle| Unreached { tried: 1, closest: obstacle };
        let home = from.home.as_ref().ok_or_else(|| lost(Obstacle::BranchEnds))?;
        let onward = self.search(&self.rest.posture, goal, true)?;
        let waypoints: Vec<Waypoint> = home.iter().chain(&onward.waypoints).copied().collect();
        let whole = self.walk_through(&from.posture, waypoints).map_err(lost)?;
        let passes = self.passes(&from.posture, &whole.waypoints);
        Ok(Plan { home: onward.home, passes, ..whole })
    }

    /// What ways are compared by: the greatest expected power, A^2, raised where the margin falls short of what is wanted. It never
    /// falls as a way goes on.
    pub(super) fn score(&self, walked: &Walked) -> f64 {
        let short = (self.margin_wanted / walked.margin_min).max(1.0);
        walked.expected_max * short * short
    }
}
