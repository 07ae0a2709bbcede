//! Global search over frame settings.

use std::collections::BTreeMap;

use magsteer_hal::{Actuation, HardwareDescription, POSE_PARAMETERS_MAX};
use rayon::prelude::*;

use super::config::PlanConfig;
use super::route::Route;
use super::walker::{Bounds, Obstacle, Posture, Walked, Walker, Waypoint};
use crate::control::config::ControlConfig;
use crate::control::cycle::Directions;
use crate::rod::Manipulator;

/// By how much worse the direct way may be than one by way of rest, as a ratio of scores, and still be preferred.
const DIRECT_PREFERENCE: f64 = 2.0;

/// Settings of the grid about which a search goes on when none of the grid arrives.
const REFINED: usize = 8;
/// Ways whose return is tried before a search gives up.
const RETURNS_TRIED: usize = 8;

/// Frame angles, rad.
type Setting = [f64; POSE_PARAMETERS_MAX];

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
}

impl Plan {
    /// Where the rod stands at its end.
    #[must_use]
    pub fn standing(&self) -> Standing {
        Standing { posture: self.posture, home: self.home.clone() }
    }
}

/// A posture and a way from it to rest.
#[derive(Debug, Clone)]
pub struct Standing {
    /// The equilibrium.
    pub posture: Posture,
    /// Waypoints to the rest posture.
    pub home: Vec<Waypoint>,
}

/// Where a walk ended before its goal.
#[derive(Debug, Clone, Copy)]
struct Halt {
    obstacle: Obstacle,
    /// Waypoints reached, and the share of the way to the next.
    progress: f64,
    /// Frame angles of its goal.
    setting: Setting,
}

/// Outcomes of many walks.
struct Followed {
    /// Best first.
    arrived: Vec<Plan>,
    halted: Vec<Halt>,
}

impl Followed {
    fn most_often(&self) -> Obstacle {
        let mut counts = BTreeMap::new();
        for halt in &self.halted {
            *counts.entry(halt.obstacle).or_insert(0_u32) += 1;
        }
        let most = counts.into_iter().max_by_key(|(_, count)| *count);
        most.map_or(Obstacle::OutOfReach, |(obstacle, _)| obstacle)
    }
}

/// Why no way was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("not reached with any of {tried} frame settings; most often {}", .most_often.text())]
pub struct Unreached {
    /// Frame settings tried.
    pub tried: usize,
    /// What ended most walks.
    pub most_often: Obstacle,
}

/// Plans ways of one rig. Searches run on the threads of the rayon pool that they are called in, with the same result for any number.
#[derive(Debug, Clone)]
pub struct Planner {
    walker: Walker,
    settings: Vec<Setting>,
    groups: Vec<Vec<Route>>,
    rest: Standing,
    bounds: Bounds,
    margin_wanted: f64,
    frame_step: f64,
    ranges: Vec<(f64, f64)>,
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
        let mut walker = Walker::new(control, description, manipulator, plan.disturbance_deg.to_radians());
        Self {
            rest: Standing { posture: walker.posture(), home: Vec::new() },
            walker,
            settings,
            groups: Route::groups(magnets),
            bounds: Bounds { margin_min: plan.margin_min, tolerance: plan.tolerance_deg.to_radians() },
            margin_wanted: plan.margin_wanted,
            frame_step: plan.frame_step_deg.to_radians(),
            ranges: description.frames.iter().map(|frame| (frame.angle_min, frame.angle_max)).collect(),
        }
    }

    /// The posture without currents, frames at zero.
    #[must_use]
    pub fn rest(&self) -> &Standing {
        &self.rest
    }

    /// Number of frame settings that a search tries.
    #[must_use]
    pub fn setting_count(&self) -> usize {
        self.settings.len()
    }

    /// Where the rod stands when currents and angles go from rest straight to `actuation`.
    ///
    /// # Errors
    /// When the model loses it on the way, or no way back to rest is found.
    pub fn standing_at(&self, actuation: &Actuation) -> Result<Standing, Unreached> {
        let mut walker = self.walker.clone();
        let lost = |most_often| Unreached { tried: 0, most_often };
        walker.resume(&self.rest.posture).map_err(lost)?;
        walker.actuate(actuation).map_err(lost)?;
        let posture = walker.posture();
        let home = match self.way_home(&posture, Vec::new()) {
            Some(home) => home,
            None => self.search(&posture, &self.rest.posture.directions, |_| None)?.waypoints,
        };
        Ok(Standing { posture, home })
    }

    /// The best way from rest to `target`.
    ///
    /// # Errors
    /// When no setting arrives.
    pub fn from_rest(&self, target: &Directions) -> Result<Plan, Unreached> {
        // Without currents frames turn freely: the way begins with them in place.
        let start = |setting: &Setting| {
            Some(Waypoint { directions: self.rest.posture.directions, frame_angles: *setting })
        };
        self.search(&self.rest.posture, target, start)
    }

    /// A way from rest to `target` with the frames held at one setting, as an array without frames would have it.
    ///
    /// # Errors
    /// When it does not arrive.
    pub fn from_rest_with(&self, setting: &Setting, target: &Directions) -> Result<Plan, Unreached> {
        let rest = &self.rest.posture;
        let to = Waypoint { directions: *target, frame_angles: *setting };
        let from = Waypoint { directions: rest.directions, frame_angles: *setting };
        let ways = self
            .routes()
            .map(|route| [from].into_iter().chain(route.waypoints(&from.directions, &to)).collect());
        let followed = self.follow_all(rest, ways.collect());
        let most_often = followed.most_often();
        followed.arrived.into_iter().next().ok_or(Unreached { tried: 1, most_often })
    }

    /// The setting of the grid, rad, with which most of `targets` are reached from rest, frames held; the one nearest to zero of several.
    /// `done` is told of each target whether any setting reaches it.
    pub fn best_fixed(&self, targets: &[Directions], done: impl Fn(bool) + Sync) -> Setting {
        let reached: Vec<Vec<bool>> = targets
            .par_iter()
            .map(|target| {
                let reached: Vec<bool> =
                    self.settings.par_iter().map(|setting| self.is_reached_with(setting, target)).collect();
                done(reached.contains(&true));
                reached
            })
            .collect();
        let count = |setting: &usize| reached.iter().filter(|reached| reached[*setting]).count();
        let distance = |setting: &usize| self.settings[*setting].iter().map(|angle| angle.abs()).sum::<f64>();
        let better =
            |a: &usize, b: &usize| count(a).cmp(&count(b)).then_with(|| distance(b).total_cmp(&distance(a)));
        let best = (0..self.settings.len()).max_by(better);
        best.map_or_else(Setting::default, |best| self.settings[best])
    }

    fn is_reached_with(&self, setting: &Setting, target: &Directions) -> bool {
        let rest = &self.rest.posture;
        let to = Waypoint { directions: *target, frame_angles: *setting };
        let from = Waypoint { directions: rest.directions, frame_angles: *setting };
        let mut ways =
            self.routes().map(|route| [from].into_iter().chain(route.waypoints(&from.directions, &to)));
        ways.any(|way| self.follow(&mut self.walker.clone(), rest, way.collect()).is_ok())
    }

    /// The best way from `from` to `target`: straight there, or back to rest and from there, whichever keeps farther from what ends walks.
    ///
    /// # Errors
    /// When no setting arrives.
    pub fn plan(&self, from: &Standing, target: &Directions) -> Result<Plan, Unreached> {
        let straight = self.search(&from.posture, target, |_| None);
        let around = self.by_way_of_rest(from, target);
        match (straight, around) {
            (Ok(straight), Ok(around)) => {
                let preferred = self.score(&straight) <= DIRECT_PREFERENCE * self.score(&around);
                Ok(if preferred { straight } else { around })
            }
            (Ok(plan), Err(_)) | (Err(_), Ok(plan)) => Ok(plan),
            (Err(_), Err(unreached)) => Err(unreached),
        }
    }

    fn by_way_of_rest(&self, from: &Standing, target: &Directions) -> Result<Plan, Unreached> {
        let onward = self.from_rest(target)?;
        let waypoints = from.home.iter().chain(&onward.waypoints).copied().collect();
        let mut walker = self.walker.clone();
        let whole = self.follow(&mut walker, &from.posture, waypoints);
        let whole = whole.map_err(|halt| Unreached { tried: 1, most_often: halt.obstacle })?;
        Ok(Plan { home: onward.home, ..whole })
    }

    fn routes(&self) -> impl Iterator<Item = &Route> {
        self.groups.iter().flatten()
    }

    /// Tries every setting on one group of routes after another; `start` gives a waypoint to begin with.
    fn search(
        &self,
        from: &Posture,
        target: &Directions,
        start: impl Fn(&Setting) -> Option<Waypoint> + Sync,
    ) -> Result<Plan, Unreached> {
        let mut most_often = None;
        let mut closest: Vec<(f64, Setting)> = Vec::new();
        for routes in &self.groups {
            let way = |setting: &Setting, route: &Route| {
                let to = Waypoint { directions: *target, frame_angles: *setting };
                start(setting).into_iter().chain(route.waypoints(&from.directions, &to)).collect()
            };
            let settings =
                self.settings.iter().flat_map(|setting| routes.iter().map(move |route| (setting, route)));
            let followed =
                self.follow_all(from, settings.map(|(setting, route)| way(setting, route)).collect());
            most_often = most_often.or(Some(followed.most_often()));
            closest.extend(followed.halted.iter().map(|halt| (halt.progress, halt.setting)));
            if let Some(plan) = self.best_with_return(from, followed.arrived) {
                return Ok(plan);
            }
        }
        // Between the settings of the grid, about those that came closest.
        closest.sort_by(|a, b| b.0.total_cmp(&a.0));
        let refined = closest.iter().take(REFINED).flat_map(|(_, setting)| self.beside(setting));
        let ways = refined.flat_map(|setting| {
            let to = Waypoint { directions: *target, frame_angles: setting };
            let start = start(&setting);
            self.routes()
                .map(move |route| start.into_iter().chain(route.waypoints(&from.directions, &to)).collect())
        });
        let followed = self.follow_all(from, ways.collect());
        let most_often = most_often.unwrap_or(Obstacle::OutOfReach);
        let found = self.best_with_return(from, followed.arrived);
        found.ok_or(Unreached { tried: self.settings.len(), most_often })
    }

    /// Settings between a setting of the grid and its neighbours, in the plane of the first two frames.
    fn beside(&self, setting: &Setting) -> Vec<Setting> {
        let offsets = [-2.0, -1.0, 1.0, 2.0].map(|thirds| thirds * self.frame_step / 3.0);
        let offsets = offsets.iter().chain(&[0.0]);
        let both = offsets.clone().flat_map(|first| offsets.clone().map(move |second| (first, second)));
        let moved = both.filter(|offset| *offset != (&0.0, &0.0)).map(|(first, second)| {
            let mut moved = *setting;
            moved[0] += first;
            moved[1] += if self.ranges.len() > 1 { *second } else { 0.0 };
            moved
        });
        if self.ranges.is_empty() { Vec::new() } else { moved.collect() }
    }

    /// The best of `plans`, best first, from which there is a way to rest; without one the best.
    fn best_with_return(&self, from: &Posture, plans: Vec<Plan>) -> Option<Plan> {
        let mut plans = plans.into_iter().take(RETURNS_TRIED);
        plans.find_map(|mut plan| {
            let mut back: Vec<Waypoint> = plan.waypoints.iter().rev().skip(1).copied().collect();
            back.push(Waypoint {
                directions: from.directions,
                frame_angles: from.present.actuation.angle_rad,
            });
            plan.home = self.way_home(&plan.posture, back)?;
            Some(plan)
        })
    }

    /// A way from `from` to rest: with the frames as they stand, else along `back` and then to rest.
    fn way_home(&self, from: &Posture, back: Vec<Waypoint>) -> Option<Vec<Waypoint>> {
        let rest = self.rest.posture.directions;
        let home = Waypoint { directions: rest, frame_angles: from.present.actuation.angle_rad };
        let mut walker = self.walker.clone();
        let ways = self.routes().map(|route| route.waypoints(&from.directions, &home));
        let ways = ways.chain((!back.is_empty()).then(|| {
            let last = back.last().map_or(home.frame_angles, |last| last.frame_angles);
            back.iter().copied().chain([Waypoint { directions: rest, frame_angles: last }]).collect()
        }));
        ways.into_iter().find(|way: &Vec<Waypoint>| self.follow(&mut walker, from, way.clone()).is_ok())
    }

    /// Walks every way.
    fn follow_all(&self, from: &Posture, ways: Vec<Vec<Waypoint>>) -> Followed {
        let outcomes: Vec<_> = ways
            .into_par_iter()
            .map_init(|| self.walker.clone(), |walker, waypoints| self.follow(walker, from, waypoints))
            .collect();
        let mut followed = Followed { arrived: Vec::new(), halted: Vec::new() };
        for outcome in outcomes {
            match outcome {
                Ok(plan) => followed.arrived.push(plan),
                Err(halt) => followed.halted.push(halt),
            }
        }
        followed.arrived.sort_by(|a, b| self.score(a).total_cmp(&self.score(b)));
        followed
    }

    /// Walks along `waypoints`, at least one.
    fn follow(&self, walker: &mut Walker, from: &Posture, waypoints: Vec<Waypoint>) -> Result<Plan, Halt> {
        let setting = waypoints.last().map_or_else(Default::default, |last| last.frame_angles);
        let halt = |index: usize, share: f64| {
            move |obstacle| Halt { obstacle, progress: index as f64 + share, setting }
        };
        walker.resume(from).map_err(halt(0, 0.0))?;
        let mut walked = Walked::NOWHERE;
        let mut error = f64::INFINITY;
        for (index, waypoint) in waypoints.iter().enumerate() {
            if !self.within_range(waypoint) {
                return Err(halt(index, 0.0)(Obstacle::OutOfReach));
            }
            let leg = walker
                .walk(waypoint, &self.bounds)
                .map_err(|(obstacle, share)| halt(index, share)(obstacle))?;
            walked = walked.then(&leg);
            error = walker.error_to(&waypoint.directions);
        }
        Ok(Plan { posture: walker.posture(), waypoints, walked, error, home: Vec::new() })
    }

    fn within_range(&self, waypoint: &Waypoint) -> bool {
        let mut angles = waypoint.frame_angles.iter().zip(&self.ranges);
        angles.all(|(angle, (least, most))| (*least..=*most).contains(angle))
    }

    /// The greatest expected power on the way, A^2, raised where the margin falls short of what is wanted.
    fn score(&self, plan: &Plan) -> f64 {
        let short = (self.margin_wanted / plan.walked.margin_min).max(1.0);
        plan.walked.expected_max * short * short
    }
}
