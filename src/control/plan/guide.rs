//! Guide: leads a loop to one target after another, each way planned from where the loop stands.
//!
//! # Problem
//! A plan made before the fact begins where the model stands at the end of the plan before. A loop stands elsewhere: its currents in the
//! null space have gone their own way, its rod is not the model's. So a way that the model walks may be refused by the loop's scout, or
//! end beside its target.
//!
//! # Method
//! Every way is planned from the loop's own equilibrium ([`Planner::standing_at`]), with the gains of the coils that it has learnt.
//! The model is asked for directions by which the magnets, bent as much farther than the model as they are now, point at the target, and at
//! the waypoints before it the magnets are asked to where they will be when the model is there. A way that was refused, or that ended
//! beside its target, is not tried again: the next one ends with the frames elsewhere. A way that leads by way of rest is planned anew at
//! rest, which everything after two ways in vain is, too. At rest, without loads, the magnets are asked to where they rest: as far beside
//! the model as they were when they were near rest last. Where that is refused from a posture that bends them far beside the model, they go
//! first to where that takes them from rest, and from there to rest. Where that is in vain too, the next way home ends with the frames
//! elsewhere. A loop that holds near a snap-through first of all goes back along the way that it came: its model is nearly singular there,
//! and neither plans nor steers. Where the planner's model does not find the loop's equilibrium, or no way leads from there to rest, the
//! currents are let go, which is the last resort: a rod whose currents fall all at once may snap on its way.
//!
//! What is absent: a loop, a clock, a channel. Whoever steers carries out [`Order`]s and tells what became of them ([`Told`]).

use std::collections::VecDeque;
use std::iter;

use magsteer_hal::{Actuation, COILS_MAX};
use nalgebra::{Rotation3, Vector3};

use super::planner::{Plan, Planner, Setting, Standing, Unreached};
use super::walk::Waypoint;
use crate::control::step::{Directions, Equilibrium};
use crate::math::angle_between;

/// Ways to one target that are tried before it is given up.
const WAYS_MAX: u32 = 6;
/// Ways that are tried from where the loop stands before the next begins at rest.
const WAYS_BEFORE_REST: u32 = 2;
/// Ways to rest that are tried before the currents are let go.
const HOMEWARD_MAX: u32 = 4;
/// Greatest angle between a waypoint and the reference, and of a frame to its goal, of a loop that has arrived, rad.
const ARRIVED_WITHIN: f64 = 0.05_f64.to_radians();
/// Greatest angle of the model's magnets to where they rest at which the rod is beside the model by as much as it is at rest, rad.
const NEAR_REST: f64 = 5.0_f64.to_radians();

/// Where a loop stands, by its own word, its magnets at rest.
#[derive(Debug, Clone, Copy)]
pub struct Stance {
    /// Where its model is.
    pub equilibrium: Equilibrium,
    /// Tangents that its model predicts for them, world.
    pub predicted: Directions,
    /// Measured tangents, world.
    pub measured: Directions,
    /// Gains of the coils that its model believes in.
    pub gains: [f64; COILS_MAX],
}

/// What the loop is to do next.
#[derive(Debug, Clone, Copy)]
#[expect(clippy::large_enum_variant, reason = "one a leg, and never kept")]
pub enum Order {
    /// Steer to a waypoint, and stay there until all is at rest; to the last one until the magnets have settled.
    Steer(Leg),
    /// From a hold near a snap-through go back along the way that led there.
    Retreat,
    /// Let the currents go to zero, then make ready to steer again.
    Release,
}

/// One leg of a way.
#[derive(Debug, Clone, Copy)]
pub struct Leg {
    /// Where it ends.
    pub waypoint: Waypoint,
    /// True when that is the target.
    pub is_last: bool,
}

impl Leg {
    /// True when reference and frames of a loop have arrived at its end.
    #[must_use]
    pub fn has_arrived(&self, reference: &Directions, actuation: &Actuation) -> bool {
        let turns =
            reference.iter().zip(&self.waypoint.directions).filter(|(_, wanted)| **wanted != [0.0; 3]);
        let mut turns = turns.map(|(at, wanted)| angle_between(&Vector3::from(*at), &Vector3::from(*wanted)));
        let mut frames = actuation.angle_rad.iter().zip(&self.waypoint.frame_angles);
        turns.all(|turn| turn <= ARRIVED_WITHIN)
            && frames.all(|(angle, wanted)| (angle - wanted).abs() <= ARRIVED_WITHIN)
    }
}

/// What became of an order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// The leg's end was reached; of the last leg: the magnets settled there.
    Arrived,
    /// The loop's scout refused the leg: nothing has moved.
    Refused,
    /// The loop went, and did not come there, or did not settle.
    Missed,
    /// The loop holds on the way, near a snap-through.
    Held,
    /// The loop has gone back, or has come as far as it can.
    Retreated,
    /// The currents are zero, and the loop is ready to steer again.
    Released,
}

/// Why a target was given up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum GivenUp {
    /// The model finds no way.
    #[error("{0}")]
    Unreached(Unreached),
    /// The loop was led on several ways, and none led there.
    #[error(
        "{ways} ways were tried, and none led there: {refused} were refused, {missed} ended beside the target"
    )]
    Exhausted {
        /// All.
        ways: u32,
        /// By the scout.
        refused: u32,
        /// On the way or at its end.
        missed: u32,
    },
    /// The model does not come to where the loop is, not even at rest.
    #[error("the model does not come to where the rig is")]
    Lost,
}

/// Where a way leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Heading {
    Target,
    Rest,
}

/// What became of ways to rest.
#[derive(Debug, Clone, Default)]
struct Homeward {
    failed: u32,
    /// True when the last of them was refused for the first time.
    is_refused: bool,
    /// Frame settings at rest that were tried in vain, rad.
    avoided: Vec<Setting>,
}

/// Leads one loop.
#[derive(Debug, Clone)]
pub struct Guide {
    planner: Planner,
    target: Directions,
    /// A way to rest: back along where the model came from, and on from there.
    back: Vec<Waypoint>,
    /// Legs of the present way that are still to be gone.
    legs: VecDeque<Waypoint>,
    /// Where they lead.
    heading: Heading,
    /// Frame settings that were tried in vain.
    avoided: Vec<Setting>,
    refused: u32,
    missed: u32,
    /// Ways to the target tried since the loop was at rest, or the target was set.
    since_rest: u32,
    /// What ways to rest came to since then.
    homeward: Homeward,
    must_retreat: bool,
    must_release: bool,
    /// True from when the loop was led to rest, or its currents were let go, until it is led away.
    is_at_rest: bool,
    /// True while the magnets are at rest, or beside it by no more than what the model's bias was when they set out.
    is_unbent: bool,
    /// Tangents that the loop's model predicted, and that were measured, when its magnets were near rest last.
    resting: Option<(Directions, Directions)>,
    is_there: bool,
}

impl Guide {
    /// A guide whose loop may stand anywhere, without a target yet.
    #[must_use]
    pub fn new(planner: Planner) -> Self {
        Self {
            target: planner.rest().posture.directions,
            planner,
            back: Vec::new(),
            legs: VecDeque::new(),
            heading: Heading::Target,
            avoided: Vec::new(),
            refused: 0,
            missed: 0,
            since_rest: 0,
            homeward: Homeward::default(),
            must_retreat: false,
            must_release: false,
            is_at_rest: false,
            is_unbent: false,
            resting: None,
            is_there: true,
        }
    }

    /// From now on leads to `target`, one unit tangent a magnet, world.
    pub fn set_out(&mut self, target: &Directions) {
        self.target = *target;
        self.legs.clear();
        self.avoided.clear();
        (self.refused, self.missed, self.since_rest, self.homeward) = (0, 0, 0, Homeward::default());
        (self.must_retreat, self.must_release) = (false, false);
        (self.is_at_rest, self.is_there) = (false, false);
    }

    /// What is to be done next; `None` once the target is reached.
    ///
    /// # Errors
    /// When there is nothing left to try.
    pub fn order(&mut self, stance: &Stance) -> Result<Option<Order>, GivenUp> {
        if self.is_there {
            return Ok(None);
        }
        if self.must_retreat {
            return Ok(Some(Order::Retreat));
        }
        let rest = self.planner.rest().posture.directions;
        if are_within(&stance.predicted, &rest, NEAR_REST) {
            self.resting = Some((stance.predicted, stance.measured));
        }
        if self.legs.is_empty() && !self.must_release {
            self.plan(stance)?;
        }
        let Some(waypoint) = self.legs.front() else { return Ok(Some(Order::Release)) };
        let is_last = self.legs.len() == 1 && self.heading == Heading::Target;
        let directions = match self.heading {
            Heading::Target if is_last => self.target,
            // Without loads the magnets are beside the model by their sag alone. To hold them elsewhere takes currents, and great ones
            // where frames on their way pass settings at which the coils have little authority.
            Heading::Target | Heading::Rest if self.leads_to_rest() && !self.leads_beside_rest() => {
                let resting = self.resting.as_ref();
                resting.map_or(rest, |(predicted, measured)| turned(&rest, predicted, measured))
            }
            Heading::Target | Heading::Rest => {
                turned(&waypoint.directions, &stance.predicted, &stance.measured)
            }
        };
        Ok(Some(Order::Steer(Leg { waypoint: Waypoint { directions, ..*waypoint }, is_last })))
    }

    /// Tells what became of the last order.
    pub fn tell(&mut self, told: Told) {
        match told {
            // Without loads the bias is another: what is left of the leg is gone without it.
            Told::Arrived if self.leads_beside_rest() => self.is_unbent = true,
            Told::Arrived => {
                self.is_unbent = self.leads_to_rest();
                self.back.splice(0..0, self.legs.pop_front());
                if self.legs.is_empty() {
                    self.is_at_rest = self.heading == Heading::Rest;
                    self.is_there = !self.is_at_rest;
                    (self.since_rest, self.homeward) = (0, Homeward::default());
                }
            }
            Told::Retreated => self.must_retreat = false,
            Told::Released => {
                self.back.clear();
                (self.must_release, self.is_at_rest, self.is_unbent) = (false, true, true);
                (self.since_rest, self.homeward) = (0, Homeward::default());
            }
            Told::Refused | Told::Missed | Told::Held => {
                self.is_unbent &= told == Told::Refused;
                self.must_retreat = told == Told::Held;
                match self.heading {
                    Heading::Target => {
                        let failed = if told == Told::Refused { &mut self.refused } else { &mut self.missed };
                        *failed += 1;
                        self.avoided.extend(self.legs.back().map(|goal| goal.frame_angles));
                    }
                    Heading::Rest => {
                        let homeward = &mut self.homeward;
                        homeward.failed += 1;
                        // What was refused without the bias is tried with it, before other frames are.
                        homeward.is_refused = told == Told::Refused && !homeward.is_refused;
                        if !homeward.is_refused {
                            homeward.avoided.extend(self.legs.back().map(|end| end.frame_angles));
                        }
                        self.must_release = homeward.failed >= HOMEWARD_MAX;
                    }
                }
                self.legs.clear();
            }
        }
    }

    /// True when the present leg ends where the model rests.
    fn leads_to_rest(&self) -> bool {
        let rest = self.planner.rest().posture.directions;
        self.legs.front().is_some_and(|leg| leg.directions == rest)
    }

    /// True when the present leg is the first of two steps to rest: with the model's bias, without which the way was refused.
    fn leads_beside_rest(&self) -> bool {
        self.heading == Heading::Rest && self.leads_to_rest() && !self.is_unbent && self.homeward.is_refused
    }

    /// Finds the next way, to the target or to rest, or that the currents must go before there is one.
    fn plan(&mut self, stance: &Stance) -> Result<(), GivenUp> {
        let Self { refused, missed, .. } = *self;
        let exhausted = GivenUp::Exhausted { ways: refused + missed, refused, missed };
        if refused + missed >= WAYS_MAX {
            return Err(exhausted);
        }
        self.planner.set_gains(&stance.gains);
        let Stance { equilibrium, predicted, .. } = stance;
        let standing = self.planner.standing_at(equilibrium, predicted, &self.back, &self.homeward.avoided);
        let Some(Standing { posture, home }) = standing else {
            self.must_release = true;
            return if self.is_at_rest { Err(GivenUp::Lost) } else { Ok(()) };
        };
        let is_wanted_at_rest = self.since_rest >= WAYS_BEFORE_REST || self.homeward.failed > 0;
        let plan = (!is_wanted_at_rest).then(|| self.way(&Standing { posture, home: home.clone() }, stance));
        let home = home.filter(|home| !self.is_at_rest && !home.is_empty());
        let here =
            Waypoint { directions: posture.directions, frame_angles: stance.equilibrium.actuation.angle_rad };
        self.back = iter::once(here).chain(home.iter().flatten().copied()).collect();
        match (plan, home) {
            (Some(Ok(plan)), home) if !home.as_ref().is_some_and(|home| plan.waypoints.starts_with(home)) => {
                (self.legs, self.heading) = (plan.waypoints.into(), Heading::Target);
                (self.since_rest, self.is_at_rest) = (self.since_rest + 1, false);
            }
            (_, Some(home)) => (self.legs, self.heading) = (home.into(), Heading::Rest),
            _ if !self.is_at_rest => self.must_release = true,
            (Some(Err(unreached)), _) if refused + missed == 0 => return Err(GivenUp::Unreached(unreached)),
            _ => return Err(exhausted),
        }
        Ok(())
    }

    /// The best way to where the magnets are expected to point at the target; to where the model does, if there is none.
    fn way(&self, standing: &Standing, stance: &Stance) -> Result<Plan, Unreached> {
        let to = |target: &Directions| self.planner.plan_avoiding(standing, target, &self.avoided);
        to(&turned(&self.target, &stance.measured, &stance.predicted)).or_else(|_| to(&self.target))
    }
}

/// True where no direction is farther from the other than `most`, rad; what is no direction has no angle.
fn are_within(directions: &Directions, others: &Directions, most: f64) -> bool {
    let mut pairs = directions.iter().zip(others);
    pairs.all(|(one, other)| angle_between(&Vector3::from(*one), &Vector3::from(*other)) <= most)
}

/// `directions`, each turned as the shortest way leads from its direction in `from` to that in `to`.
fn turned(directions: &Directions, from: &Directions, to: &Directions) -> Directions {
    let mut turned = *directions;
    for ((direction, from), to) in turned.iter_mut().zip(from).zip(to) {
        // None between opposite directions, and of what is no direction.
        if let Some(off) = Rotation3::rotation_between(&Vector3::from(*from), &Vector3::from(*to)) {
            *direction = (off * Vector3::from(*direction)).into();
        }
    }
    turned
}
