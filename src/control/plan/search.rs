//! How a search goes: ways by setting and route, walked in batches, the best kept.
//!
//! A way's score never falls as it goes on. So a way is dropped as soon as it is worse than as many that have arrived as are looked
//! at afterwards: it would not be taken. Batches are of one size whatever the number of threads, and each way is walked by a fresh
//! copy of one walker, so that neither threads nor their pace are seen in a result.

use rayon::prelude::*;

use super::planner::{Plan, Planner, Setting, Unreached};
use super::route::Route;
use super::walk::{Obstacle, Posture, Stop, Walked, Waypoint};
use super::walker::Walker;
use crate::control::step::Directions;

/// Settings about which a search goes on when none of the grid arrives.
const REFINED: usize = 8;
/// How often it does, each time with half the step.
const ROUNDS: usize = 3;
/// Difference of frame angles below which two settings are one, rad.
const SAME: f64 = 1e-6;
/// Ways that are looked at more closely, for their return and by the scout's walk, before a search to a target gives up.
const TO_TARGET: usize = 8;
/// The same of a search to rest, which nothing can take the place of but letting the currents go.
const TO_REST: usize = 64;
/// Ways that are walked before the best so far are looked at: many times the cores of a machine.
const BATCH: usize = 32;

/// A frame setting, and the rod at rest with it.
#[derive(Debug, Clone)]
pub(super) struct Tried {
    pub setting: Setting,
    /// Posture there, and the turn to it from frames at zero; `None` when that cannot be walked.
    pub rest: Option<(Posture, Walked)>,
}

/// What a search is for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal<'a> {
    /// Where the magnets shall point.
    pub directions: &'a Directions,
    /// Settings of the frames that shall not be taken, rad.
    pub avoided: &'a [Setting],
    /// How many of the best ways are looked at more closely.
    pub looked_at: usize,
}

impl<'a> Goal<'a> {
    /// A target of the loop.
    pub fn target(directions: &'a Directions, avoided: &'a [Setting]) -> Self {
        Self { directions, avoided, looked_at: TO_TARGET }
    }

    /// The directions of rest.
    pub fn rest(directions: &'a Directions, avoided: &'a [Setting]) -> Self {
        Self { directions, avoided, looked_at: TO_REST }
    }

    fn allows(&self, setting: &Setting, apart: f64) -> bool {
        !self.avoided.iter().any(|avoided| are_within(avoided, setting, apart))
    }
}

/// A way to be walked.
struct Way<'a> {
    /// The first waypoint, when it was walked to before: where it is, and how it was come to.
    begun: Option<&'a (Posture, Walked)>,
    waypoints: Vec<Waypoint>,
}

/// Where a walk ended before its goal.
#[derive(Debug, Clone, Copy)]
struct Halt {
    obstacle: Obstacle,
    /// Greatest angle of a magnet to its target, rad.
    left: f64,
    /// Frame angles of its goal.
    setting: Setting,
}

/// Why a way was not walked to its end.
enum Broken {
    Halted(Halt),
    Dropped,
}

/// Outcomes of many walks.
struct Followed {
    /// Best first.
    arrived: Vec<Plan>,
    halted: Vec<Halt>,
}

/// Why a target is not reached: what ended the walk that came closest.
fn unreached(tried: usize, halted: &[Halt]) -> Unreached {
    let closest = halted.iter().min_by(|a, b| a.left.total_cmp(&b.left));
    Unreached { tried, closest: closest.map_or(Obstacle::OutOfReach, |halt| halt.obstacle) }
}

/// Settings of the walks that came closest, each once, closest first; sorts `halted` so.
fn closest(halted: &mut [Halt]) -> Vec<Setting> {
    halted.sort_by(|a, b| a.left.total_cmp(&b.left));
    let mut settings: Vec<Setting> = Vec::new();
    for halt in halted {
        if settings.len() < REFINED && !settings.iter().any(|other| are_same(other, &halt.setting)) {
            settings.push(halt.setting);
        }
    }
    settings
}

fn are_same(a: &Setting, b: &Setting) -> bool {
    are_within(a, b, SAME)
}

fn are_within(a: &Setting, b: &Setting, apart: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < apart)
}

impl Planner {
    /// Turns the frames to a setting at rest.
    pub(super) fn try_at_rest(&self, setting: Setting) -> Tried {
        let there = Waypoint { directions: self.rest.posture.directions, frame_angles: setting };
        let plan = self.walk_through(&self.rest.posture, vec![there]).ok();
        Tried { setting, rest: plan.map(|plan| (plan.posture, plan.walked)) }
    }

    /// The best way to `target` from rest with one setting.
    pub(super) fn search_held(&self, tried: &Tried, target: &Directions) -> Result<Plan, Unreached> {
        let mut halted = Vec::new();
        for routes in &self.groups {
            let ways = routes.iter().map(|route| self.way_from_rest(tried, *route, target));
            let followed = self.follow_all(&self.rest.posture, ways.collect(), TO_TARGET);
            halted.extend(&followed.halted);
            if let Some(plan) = followed.arrived.into_iter().next() {
                return Ok(plan);
            }
        }
        Err(unreached(1, &halted))
    }

    /// Walks along waypoints, at least one, whatever others there are.
    pub(super) fn walk_through(&self, from: &Posture, waypoints: Vec<Waypoint>) -> Result<Plan, Obstacle> {
        let way = Way { begun: None, waypoints };
        self.follow(&mut self.walker.clone(), from, way, f64::INFINITY).map_err(|broken| match broken {
            Broken::Halted(halt) => halt.obstacle,
            // Nothing is worse than infinity.
            Broken::Dropped => Obstacle::OutOfReach,
        })
    }

    /// A way from `from` to rest: with the frames as they stand, else along `back` and then to rest; none that ends with the frames as in
    /// one of `avoided`.
    pub(super) fn way_home(
        &self,
        from: &Posture,
        back: &[Waypoint],
        avoided: &[Setting],
    ) -> Option<Vec<Waypoint>> {
        let rest = self.rest.posture.directions;
        let goal = Goal::rest(&rest, avoided);
        let home = Waypoint { directions: rest, frame_angles: from.equilibrium.actuation.angle_rad };
        let ways = self.groups.iter().flatten().map(|route| route.waypoints(&from.directions, &home));
        let ways = ways.chain(back.last().map(|last| {
            let last = last.frame_angles;
            back.iter().copied().chain([Waypoint { directions: rest, frame_angles: last }]).collect()
        }));
        let mut ways = ways.filter(|way: &Vec<Waypoint>| {
            way.last().is_some_and(|end| goal.allows(&end.frame_angles, 0.5 * self.frame_step))
        });
        ways.find(|way| self.walk_through(from, way.clone()).is_ok())
    }

    /// Without currents frames turn freely: a way from rest begins with them in place.
    fn way_from_rest<'a>(&self, tried: &'a Tried, route: Route, target: &Directions) -> Way<'a> {
        let from = Waypoint { directions: self.rest.posture.directions, frame_angles: tried.setting };
        let to = Waypoint { directions: *target, frame_angles: tried.setting };
        let waypoints = [from].into_iter().chain(route.waypoints(&from.directions, &to)).collect();
        Way { begun: tried.rest.as_ref(), waypoints }
    }

    /// The way from a posture, or from rest, to `target`.
    fn way<'a>(
        &self,
        from: Option<&Posture>,
        tried: &'a Tried,
        route: Route,
        target: &Directions,
    ) -> Way<'a> {
        let Some(from) = from else { return self.way_from_rest(tried, route, target) };
        let to = Waypoint { directions: *target, frame_angles: tried.setting };
        Way { begun: None, waypoints: route.waypoints(&from.directions, &to) }
    }

    /// The best way to a goal: tries every setting on one group of routes after another, then settings between those of the grid.
    /// `at_rest` where `from` is without currents: frames then stand in place before the magnets turn. A way that the scout would
    /// refuse is taken only when no setting of the grid has one that passes.
    pub(super) fn search(&self, from: &Posture, goal: &Goal<'_>, at_rest: bool) -> Result<Plan, Unreached> {
        let from_here = (!at_rest).then_some(from);
        let target = goal.directions;
        let is_allowed = |tried: &&Tried| goal.allows(&tried.setting, 0.5 * self.frame_step);
        let mut halted: Vec<Halt> = Vec::new();
        let mut refused = None;
        for routes in &self.groups {
            let ways =
                self.settings.iter().filter(is_allowed).flat_map(|tried| {
                    routes.iter().map(move |route| self.way(from_here, tried, *route, target))
                });
            let followed = self.follow_all(from, ways.collect(), goal.looked_at);
            halted.extend(&followed.halted);
            match self.best_with_return(from, followed.arrived) {
                Some(plan) if plan.passes => return Ok(plan),
                plan => refused = refused.or(plan),
            }
        }
        if let Some(plan) = refused {
            return Ok(plan);
        }
        // Between the settings of the grid, about those that came closest, ever closer.
        let mut tried: Vec<Setting> = self.settings.iter().map(|tried| tried.setting).collect();
        let mut step = self.frame_step;
        for _ in 0..ROUNDS {
            step *= 0.5;
            let refined: Vec<Tried> = self
                .beside(&closest(&mut halted), step, &tried)
                .into_iter()
                .map(
                    |setting| if at_rest { self.try_at_rest(setting) } else { Tried { setting, rest: None } },
                )
                .collect();
            tried.extend(refined.iter().map(|refined| refined.setting));
            let routes = || self.groups.iter().flatten();
            let ways = refined
                .iter()
                .filter(is_allowed)
                .flat_map(|tried| routes().map(move |route| self.way(from_here, tried, *route, target)));
            let followed = self.follow_all(from, ways.collect(), goal.looked_at);
            halted.extend(&followed.halted);
            if let Some(plan) = self.best_with_return(from, followed.arrived) {
                return Ok(plan);
            }
        }
        Err(unreached(tried.len(), &halted))
    }

    /// Neighbours of `settings` at `step`, in the plane of the first two frames, that are not among those `tried`.
    fn beside(&self, settings: &[Setting], step: f64, tried: &[Setting]) -> Vec<Setting> {
        let mut beside: Vec<Setting> = Vec::new();
        let second = if self.ranges.len() > 1 { -1..=1 } else { 0..=0 };
        let first = if self.ranges.is_empty() { 0..=0 } else { -1..=1 };
        for setting in settings {
            for (first, second) in
                first.clone().flat_map(|first| second.clone().map(move |second| (first, second)))
            {
                let mut moved = *setting;
                moved[0] += step * f64::from(first);
                moved[1] += step * f64::from(second);
                if !tried.iter().chain(&beside).any(|other| are_same(other, &moved)) {
                    beside.push(moved);
                }
            }
        }
        beside
    }

    /// The best of `plans`, best first, from which there is a way to rest; one that the scout lets pass where there is one.
    fn best_with_return(&self, from: &Posture, plans: Vec<Plan>) -> Option<Plan> {
        let mut refused = None;
        for mut plan in plans {
            let mut back: Vec<Waypoint> = plan.waypoints.iter().rev().skip(1).copied().collect();
            back.push(Waypoint {
                directions: from.directions,
                frame_angles: from.equilibrium.actuation.angle_rad,
            });
            let Some(home) = self.way_home(&plan.posture, &back, &[]) else { continue };
            plan.home = home;
            plan.passes = self.passes(from, &plan.waypoints);
            if plan.passes {
                return Some(plan);
            }
            refused = refused.or(Some(plan));
        }
        refused
    }

    /// True when the loop's scout would let these waypoints pass, or there is none.
    pub(super) fn passes(&self, from: &Posture, waypoints: &[Waypoint]) -> bool {
        let Some(mut scout) = self.scout.clone() else { return true };
        scout.begin_at(&from.equilibrium).is_ok()
            && waypoints.iter().all(|waypoint| scout.step(&waypoint.target()).obstacle.is_none())
    }

    /// Walks every way that may be among the best `looked_at`.
    fn follow_all(&self, from: &Posture, ways: Vec<Way<'_>>, looked_at: usize) -> Followed {
        let mut followed = Followed { arrived: Vec::new(), halted: Vec::new() };
        let mut ways = ways.into_iter();
        loop {
            let batch: Vec<Way<'_>> = ways.by_ref().take(BATCH).collect();
            if batch.is_empty() {
                return followed;
            }
            let last_looked_at = followed.arrived.get(looked_at - 1);
            let score_max = last_looked_at.map_or(f64::INFINITY, |plan| self.score(&plan.walked));
            let outcomes: Vec<_> = batch
                .into_par_iter()
                .map(|way| self.follow(&mut self.walker.clone(), from, way, score_max))
                .collect();
            for outcome in outcomes {
                match outcome {
                    Ok(plan) => followed.arrived.push(plan),
                    Err(Broken::Halted(halt)) => followed.halted.push(halt),
                    Err(Broken::Dropped) => {}
                }
            }
            followed.arrived.sort_by(|a, b| self.score(&a.walked).total_cmp(&self.score(&b.walked)));
            followed.arrived.truncate(looked_at);
        }
    }

    /// Walks a way, as long as its score does not exceed `score_max`.
    fn follow(
        &self,
        walker: &mut Walker,
        from: &Posture,
        way: Way<'_>,
        score_max: f64,
    ) -> Result<Plan, Broken> {
        let Way { begun, waypoints } = way;
        let goal = waypoints.last().copied();
        let goal = goal.unwrap_or(Waypoint { directions: from.directions, frame_angles: Setting::default() });
        let halt = |walker: &Walker, obstacle: Obstacle| {
            let left = walker.error_to(&goal.directions);
            Broken::Halted(Halt { obstacle, left, setting: goal.frame_angles })
        };
        let (start, mut walked) = begun.copied().unwrap_or((*from, Walked::NOWHERE));
        let is_wanted = |walked: &Walked| self.score(walked) <= score_max;
        walker.resume(&start.equilibrium).map_err(|obstacle| halt(walker, obstacle))?;
        let mut error = f64::INFINITY;
        let mut before = start.directions;
        for waypoint in waypoints.iter().skip(usize::from(begun.is_some())) {
            if !self.within_range(waypoint) {
                return Err(halt(walker, Obstacle::OutOfReach));
            }
            let rest = &self.rest.posture.directions;
            let at_rest = before == *rest && waypoint.directions == *rest;
            // Frames that turn at rest hold nothing: what holding would take does not count.
            let counted = |leg: &Walked| {
                let expected_max = if at_rest { 0.0 } else { leg.expected_max };
                walked.then(&Walked { expected_max, ..*leg })
            };
            let leg = walker.walk_while(waypoint, &self.bounds, |leg| is_wanted(&counted(leg)));
            walked = counted(&leg.map_err(|stop| match stop {
                Stop::Obstacle(obstacle, _) => halt(walker, obstacle),
                Stop::Dropped => Broken::Dropped,
            })?);
            error = walker.error_to(&waypoint.directions);
            before = waypoint.directions;
        }
        Ok(Plan { posture: walker.posture(), waypoints, walked, error, home: Vec::new(), passes: true })
    }

    fn within_range(&self, waypoint: &Waypoint) -> bool {
        let mut angles = waypoint.frame_angles.iter().zip(&self.ranges);
        angles.all(|(angle, (least, most))| (*least..=*most).contains(angle))
    }
}
