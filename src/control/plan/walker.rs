//! Quasi-static motion of the model: magnets turn along great circles while frames turn evenly, currents follow.
//!
//! A walk is the controller's own law on a plant that is its model and has all the time it needs: error, exact Jacobian
//! and bounded allocation are those of the cycle, with its null-space tasks. So an equilibrium is followed along its branch as the rod
//! would, and what ends a walk would end the motion: a current at its limit, a branch that ends, a margin of stability too small.

use magsteer_hal::{Actuation, COILS_MAX, HardwareDescription};
use nalgebra::{Matrix3, Vector3};

use super::expected_power::ExpectedPower;
use super::walk::{Advance, Bounds, Effort, Obstacle, Posture, Stop, Walk, Walked, Waypoint};
use crate::control::allocation::{Allocation, Wish};
use crate::control::config::{ControlConfig, FrameUse};
use crate::control::error::{OrientationError, OrientationErrorKind};
use crate::control::jacobian::exact_rows;
use crate::control::model::Model;
use crate::control::step::{Directions, Equilibrium};
use crate::math::{along_great_circle, angle_between, logarithm};
use crate::rod::Manipulator;

/// Greatest turn of a magnet between two stations of a walk, rad: some percent of what changes the Jacobian.
const MAGNET_STEP: f64 = 5.0_f64.to_radians();
/// By how much farther a frame turns than a magnet.
const FRAME_RATIO: f64 = 2.0;
/// Disturbance of (p1), which scouts compare nothing by, rad.
const SCOUT_DISTURBANCE: f64 = 0.05;
/// Error below which a station on the way is left for the next, rad.
const ERROR_ON_THE_WAY: f64 = 0.5_f64.to_radians();
/// Allocations spent on one station before it counts as out of reach.
const ALLOCATIONS_MAX: u32 = 40;
/// Calls of the model for one actuation; each that falls short halves the way of the next.
const FOLLOWS_MAX: u32 = 12;
/// Greatest change of a current in one allocation, A: some percent of what changes the Jacobian.
const CURRENT_STEP: f64 = 0.5;
/// Share of the currents in the null space that one allocation takes away, and of a lost margin that it
/// regains, to first order.
const NULL_SPACE_SHARE: f64 = 0.3;
/// Change of the currents per allocation at which a posture counts as relaxed, A.
const RELAXED: f64 = 0.02;

/// A model that walks.
#[derive(Debug, Clone)]
pub struct Walker {
    model: Model,
    error: OrientationError,
    allocation: Allocation,
    expected: ExpectedPower,
    at: Equilibrium,
    /// Greatest turn of a magnet between two stations, rad.
    magnet_step: f64,
    magnets: usize,
    coils: usize,
    frames: usize,
    jacobian: Vec<f64>,
    step: Vec<f64>,
}

impl Walker {
    /// A walker for the rig of `description`, at rest without currents; `disturbance` is that of (p1), rad.
    #[must_use]
    pub fn new(
        control: &ControlConfig,
        description: &HardwareDescription,
        manipulator: Manipulator,
        disturbance: f64,
    ) -> Self {
        // What the law does not do, a walk does not do.
        let share = |rate: f64| if rate > 0.0 { NULL_SPACE_SHARE } else { 0.0 };
        let shares = [control.current_release_per_s, control.determinant_rate_per_s].map(share);
        Self::with_shares(shares, control, description, manipulator, disturbance)
    }

    /// As [`Self::new`], in finer steps of `station` (rad) and with the tasks in the null space in the
    /// proportion that they have in the loop: it passes where the loop passes, at the price of more steps.
    #[must_use]
    pub fn for_scout(
        station: f64,
        control: &ControlConfig,
        description: &HardwareDescription,
        manipulator: Manipulator,
    ) -> Self {
        let rates = [control.current_release_per_s, control.determinant_rate_per_s];
        let most = rates[0].max(rates[1]).max(f64::MIN_POSITIVE);
        let finer = (station / MAGNET_STEP).min(1.0);
        let shares = rates.map(|rate| rate / most * NULL_SPACE_SHARE * finer);
        let disturbance = SCOUT_DISTURBANCE;
        Self {
            magnet_step: station,
            ..Self::with_shares(shares, control, description, manipulator, disturbance)
        }
    }

    /// `shares` of currents released and of margin regained in one allocation.
    fn with_shares(
        [release, regained]: [f64; 2],
        control: &ControlConfig,
        description: &HardwareDescription,
        manipulator: Manipulator,
        disturbance: f64,
    ) -> Self {
        let magnets = manipulator.magnet_count();
        let (coils, frames) = (description.coils.len(), description.frames.len());
        let [first, second, third] = description.manipulator.base_rotation;
        let base = Matrix3::from_rows(&[first.into(), second.into(), third.into()]);
        // One allocation a second, whose slew is the step of a walk.
        let hurried = ControlConfig {
            frame_angles: FrameUse::Hold,
            current_release_per_s: release,
            determinant_rate_per_s: regained,
            ..control.clone()
        };
        let mut stepped = description.clone();
        stepped.coils.iter_mut().for_each(|coil| coil.slew_max = CURRENT_STEP);
        let mut model = Model::new(description, manipulator, control.passes_max);
        model.follow(&Actuation::default());
        Self {
            at: model.equilibrium(),
            magnet_step: MAGNET_STEP,
            model,
            error: OrientationError::new(OrientationErrorKind::TangentPlane, &base),
            allocation: Allocation::new(&hurried, &stepped, 2 * magnets),
            expected: ExpectedPower::new(2 * magnets, coils, disturbance),
            magnets,
            coils,
            frames,
            jacobian: vec![0.0; 2 * magnets * (coils + frames)],
            step: vec![0.0; 2 * magnets],
        }
    }

    /// Where it is.
    pub fn posture(&mut self) -> Posture {
        let directions = self.directions();
        self.fill_rows(&directions);
        let currents = &self.at.actuation.current_a[..self.coils];
        let expected = self.expected.evaluate(currents, &self.jacobian, self.coils + self.frames);
        Posture {
            equilibrium: self.at,
            directions,
            margin: self.model.stability().margin,
            expected,
            condition: self.expected.condition(),
        }
    }

    /// Goes straight to an equilibrium.
    ///
    /// # Errors
    /// When it is none of this walker's model.
    pub fn resume(&mut self, equilibrium: &Equilibrium) -> Result<(), Obstacle> {
        self.at = *equilibrium;
        self.model.resume(equilibrium);
        // Once for every entry of the margin's gradient, so that nothing is left of where the walker was before.
        for _ in 0..(self.coils + self.frames).max(1) {
            self.settle()?;
        }
        Ok(())
    }

    /// Goes to where another model of the same rig is, with all that it knows; that must be at an equilibrium. Allocates no memory.
    pub fn take_up(&mut self, model: &Model) {
        self.model.take_up(model);
        self.at = model.equilibrium();
    }

    /// From now on every coil makes `gains` times its described field.
    pub fn set_gains(&mut self, gains: &[f64; COILS_MAX]) {
        self.model.set_gains(gains);
    }

    /// Takes currents and angles straight to `actuation`.
    ///
    /// # Errors
    /// When the model loses the equilibrium on the way.
    pub fn actuate(&mut self, actuation: &Actuation) -> Result<(), Obstacle> {
        let from = self.at.actuation;
        let farthest = actuation.current_a.iter().zip(&from.current_a);
        let farthest = farthest.fold(0.0_f64, |most, (to, from)| most.max((to - from).abs()));
        let steps = (farthest / CURRENT_STEP).ceil().max(1.0) as u32;
        for step in 1..=steps {
            let share = f64::from(step) / f64::from(steps);
            let there = &mut self.at.actuation;
            for ((there, from), to) in
                there.current_a.iter_mut().zip(&from.current_a).zip(&actuation.current_a)
            {
                *there = from + (to - from) * share;
            }
            for ((there, from), to) in
                there.angle_rad.iter_mut().zip(&from.angle_rad).zip(&actuation.angle_rad)
            {
                *there = from + (to - from) * share;
            }
            self.settle()?;
        }
        Ok(())
    }

    /// Walks to `goal` along great circles, frames turning evenly with the magnets; stays where it came to otherwise.
    ///
    /// # Errors
    /// What ended it, and after what share of the way.
    pub fn walk(&mut self, goal: &Waypoint, bounds: &Bounds) -> Result<Walked, (Obstacle, f64)> {
        self.walk_while(goal, bounds, |_| true).map_err(|stop| match stop {
            Stop::Obstacle(obstacle, share) => (obstacle, share),
            // Nothing drops a walk that is always wanted.
            Stop::Dropped => (Obstacle::OutOfReach, 0.0),
        })
    }

    /// As [`Self::walk`], as long as what was walked so far is wanted.
    pub(super) fn walk_while(
        &mut self,
        goal: &Waypoint,
        bounds: &Bounds,
        wanted: impl Fn(&Walked) -> bool,
    ) -> Result<Walked, Stop> {
        let mut walk = self.set_out(goal, bounds);
        loop {
            match self.advance(&mut walk) {
                Advance::Walking if walk.is_at_station() && !wanted(&walk.walked) => {
                    return Err(Stop::Dropped);
                }
                Advance::Walking => {}
                Advance::Arrived if !wanted(&walk.walked) => return Err(Stop::Dropped),
                Advance::Arrived => return Ok(walk.walked),
                Advance::Ended(obstacle) => return Err(Stop::Obstacle(obstacle, walk.share())),
            }
        }
    }

    /// A walk from here to `goal`, to be advanced step by step; ends after finitely many.
    #[must_use]
    pub fn set_out(&self, goal: &Waypoint, bounds: &Bounds) -> Walk {
        let from = Waypoint { directions: self.directions(), frame_angles: self.at.actuation.angle_rad };
        Walk {
            stations: self.stations(&from, goal),
            from,
            goal: *goal,
            bounds: *bounds,
            station: 0,
            there: from.directions,
            effort: Effort::ARRIVED,
            walked: Walked::NOWHERE,
        }
    }

    /// Takes one step of a walk: one call of the model, and at most one allocation. Allocates no memory.
    pub fn advance(&mut self, walk: &mut Walk) -> Advance {
        match self.step(walk) {
            Ok(false) => Advance::Walking,
            Ok(true) => Advance::Arrived,
            Err(obstacle) => Advance::Ended(obstacle),
        }
    }

    /// One step; true when the goal is reached.
    fn step(&mut self, walk: &mut Walk) -> Result<bool, Obstacle> {
        if walk.effort.arrived {
            walk.station += 1;
            let there = self.between(&walk.from, &walk.goal, walk.share());
            self.at.actuation.angle_rad = there.frame_angles;
            walk.there = there.directions;
            walk.effort = Effort::NONE;
        }
        if !self.follow(&mut walk.effort.follows)? {
            return Ok(false);
        }
        let effort = &mut walk.effort;
        if effort.allocations > 0 && self.model.stability().unstable_modes > 0 {
            return Err(Obstacle::BranchEnds);
        }
        let last = walk.station >= walk.stations;
        let tolerance = if last { walk.bounds.tolerance } else { ERROR_ON_THE_WAY };
        let close = self.error_to(&walk.there) <= tolerance;
        let rests = !last || effort.change <= RELAXED;
        if !(close && rests) && effort.allocations < ALLOCATIONS_MAX {
            effort.change = self.approach(&walk.there);
            effort.allocations += 1;
            return Ok(false);
        }
        // Currents that still wander in the null space do not make a reached goal unreached.
        if !close {
            return Err(Obstacle::OutOfReach);
        }
        effort.arrived = true;
        let here = self.posture();
        walk.walked = walk.walked.then(&Walked {
            current_max: greatest(&here.equilibrium.actuation.current_a),
            margin_min: here.margin,
            expected_max: here.expected,
        });
        if here.margin < walk.bounds.margin_min || here.margin.is_nan() {
            return Err(Obstacle::NearSnapThrough);
        }
        Ok(last)
    }

    /// Greatest angle between a magnet and its direction, rad.
    #[must_use]
    pub fn error_to(&self, directions: &Directions) -> f64 {
        let errors = directions.iter().take(self.magnets).enumerate();
        let errors = errors
            .map(|(magnet, wanted)| angle_between(&self.model.tangent(magnet), &Vector3::from(*wanted)));
        errors.fold(0.0, f64::max)
    }

    fn directions(&self) -> Directions {
        let mut directions = Directions::default();
        for (magnet, direction) in directions.iter_mut().enumerate().take(self.magnets) {
            *direction = self.model.tangent(magnet).into();
        }
        directions
    }

    /// How many stations a way has.
    fn stations(&self, from: &Waypoint, to: &Waypoint) -> u32 {
        let magnets = from.directions.iter().zip(&to.directions).take(self.magnets);
        let turns = magnets
            .map(|(from, to)| angle_between(&Vector3::from(*from), &Vector3::from(*to)) / self.magnet_step);
        let frames = from.frame_angles.iter().zip(&to.frame_angles).take(self.frames);
        let turned = frames.map(|(from, to)| (to - from).abs() / (FRAME_RATIO * self.magnet_step));
        (turns.chain(turned).fold(0.0, f64::max).ceil() as u32).max(1)
    }

    fn between(&self, from: &Waypoint, to: &Waypoint, share: f64) -> Waypoint {
        let mut there = *to;
        for ((there, from), to) in there.directions.iter_mut().zip(&from.directions).zip(&to.directions) {
            let (from, to) = (Vector3::from(*from), Vector3::from(*to));
            let way = logarithm(&from, &to) * share;
            *there = along_great_circle(&from, &way, &Vector3::zeros()).0.into();
        }
        for ((there, from), to) in there.frame_angles.iter_mut().zip(&from.frame_angles).zip(&to.frame_angles)
        {
            *there = from + (to - from) * share;
        }
        there
    }

    /// Brings the model to the equilibrium of the present actuation.
    fn settle(&mut self) -> Result<(), Obstacle> {
        let mut follows = 0;
        while !self.follow(&mut follows)? {}
        Ok(())
    }

    /// One call of the model towards the present actuation; true when it is there.
    fn follow(&mut self, follows: &mut u32) -> Result<bool, Obstacle> {
        let report = self.model.follow(&self.at.actuation);
        *follows += 1;
        if !report.field_valid {
            return Err(Obstacle::OutsideField);
        }
        if report.converged {
            *follows = 0;
            self.at = self.model.equilibrium();
            return Ok(true);
        }
        if *follows >= FOLLOWS_MAX { Err(Obstacle::BranchEnds) } else { Ok(false) }
    }

    /// One allocation; returns the greatest change of a current, A.
    fn approach(&mut self, directions: &Directions) -> f64 {
        self.fill_rows(directions);
        self.allocation.allocate(&Wish {
            jacobian: &self.jacobian,
            step: &self.step,
            admitted: &self.at.actuation,
            period: 1.0,
            determinant: self.model.determinant(),
            determinant_gradient: self.model.determinant_gradient(),
            // A walk takes no time in which the margin could fall too fast.
            margin: None,
            expected_power: None,
            frame_angles: None,
        });
        let increment = &self.allocation.increment()[..self.coils];
        for (current, change) in self.at.actuation.current_a.iter_mut().zip(increment) {
            *current += change;
        }
        greatest(increment)
    }

    fn fill_rows(&mut self, directions: &Directions) {
        let parameters = self.coils + self.frames;
        let jacobian = self.jacobian.chunks_exact_mut(2 * parameters.max(1));
        let rows = jacobian.zip(self.step.chunks_exact_mut(2)).zip(directions).enumerate();
        for (magnet, ((jacobian, step), wanted)) in rows {
            let wanted = Vector3::from(*wanted);
            let error = self.error.rows(&self.model.tangent(magnet), &wanted);
            step.copy_from_slice(error.as_slice());
            exact_rows(&self.model, &self.error, magnet, &wanted, jacobian);
        }
    }
}

fn greatest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |most, value| most.max(value.abs()))
}
