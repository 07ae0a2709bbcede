//! The scout: goes ahead of the loop to every new target, in the model, and tells whether the rod would snap
//! through on the way.
//!
//! # Problem
//! Magnetic stiffness can end a branch of equilibria between two targets that are both steerable. The rod
//! then snaps to another shape, faster than any loop. The margin of stability warns late: it falls with the
//! square root of what is left of the way. So the way is walked before the reference sets out.
//!
//! # Method
//! A [`Walker`] takes up the loop's own model where it is, equilibrium, derivatives and margin, and walks to
//! the target as the reference will lead: along great circles, frames evenly. It takes a few steps a cycle,
//! each one call of the model and one allocation, so that a cycle's cost is bounded; a way of 30 degrees
//! takes some 60 steps. Until it has arrived the reference goes to the target before: nothing is steered to
//! that was not seen. What is waited for, some 20 ms at 1 kHz, is little beside the time of the reference,
//! and the same promise holds at any rate of the loop.
//!
//! The model's bias, where it is estimated, is taken along: the walk goes to where the model must point for
//! the magnets to arrive.
//!
//! A target that comes while a way is walked waits for its end: a stream of targets is cleared one by one,
//! the newest next. A target beyond the currents' limits does no harm and is gone to as far as they lead.
//!
//! # Limits
//! The walk begins where the loop is, not where it will be when the verdict falls: on a reference in full
//! motion the ways differ by what is turned meanwhile. It is quasi-static, and as good as the model: a softer
//! rod snaps earlier. Frames that the secondary tasks turn as they like follow no way that could be walked
//! before: such targets are gone to unchecked. The watch over the present margin stands behind it.
//!
//! What is absent: a clock, an allocation after construction, a decision about what becomes of a refused
//! target.

use magsteer_hal::invalid::Checks;
use magsteer_hal::{HardwareDescription, MAGNETS_MAX};
use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::config::{ControlConfig, FrameUse};
use super::model::Model;
use super::plan::{Advance, Bounds, Obstacle, Walk, Walker, Waypoint};
use super::reference::ReferenceTarget;
use super::step::Directions;
use crate::rod::Manipulator;

/// Share of a margin that a motion may lose when it begins below what is allowed: ways out are rarely ways up
/// from the first step.
const LOSS_SHARE: f64 = 0.5;
/// Most steps of a walk in one cycle, however long that is.
const STEPS_MAX: f64 = 20.0;

/// `[control.scout]`: how new targets are looked at before the reference goes there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScoutConfig {
    /// Steps of the walk in a second, 10 to 100000, at most 20 in one cycle; each costs about as much as a
    /// cycle's own call of the model.
    pub steps_per_s: f64,
    /// Farthest that a magnet turns between two stations of the walk, deg, 0.1 to 10; frames turn twice as
    /// far. What is walked between is steered by derivatives from some stations before.
    pub station_deg: f64,
    /// Least margin of stability on a way that may be gone, -10 to 10; 1 is the rod at rest, 0 the snap.
    /// Above what the model's errors and the swing of the first mode make of it.
    pub margin_min: f64,
    /// Greatest error at the end of a way that counts as reached, deg, > 0, at most 45. Of no consequence but
    /// for the verdict.
    pub tolerance_deg: f64,
}

impl ScoutConfig {
    /// Adds every value out of its range, keyed from the root of the file.
    pub fn check(&self, checks: &mut Checks) {
        checks.within("control.scout.steps_per_s", self.steps_per_s, 10.0, 1e5);
        checks.within("control.scout.station_deg", self.station_deg, 0.1, 10.0);
        checks.within("control.scout.margin_min", self.margin_min, -10.0, 10.0);
        checks.within("control.scout.tolerance_deg", self.tolerance_deg, 1e-3, 45.0);
    }
}

/// What is known of the way to the target.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Verdict {
    /// Nobody looks: there is no scout, the loop does not steer, or secondary tasks turn the frames as they like.
    #[default]
    Unchecked,
    /// The scout is under way.
    Checking,
    /// The whole way was walked.
    Clear {
        /// Least margin of stability on it.
        margin_min: f64,
        /// Greatest magnitude of a current on it, A.
        current_max: f64,
    },
    /// Safe as far as the currents' limits lead, which is not to the target.
    OutOfReach {
        /// Share of the way that was walked.
        progress: f64,
    },
    /// The way must not be gone.
    Refused {
        /// Why.
        obstacle: Obstacle,
        /// Share of the way at which it lies.
        progress: f64,
    },
}

/// Least margin that a motion which begins at `present` may come to, where `least` is asked of one that
/// begins above it.
#[must_use]
pub fn margin_allowed(least: f64, present: f64) -> f64 {
    // Not a number is no reason to allow less.
    least.min(present - LOSS_SHARE * present.abs())
}

/// Where the loop is when it asks.
#[derive(Debug)]
pub(super) struct Standing<'a> {
    /// Reference of the cycle before.
    pub(super) reference: &'a Directions,
    /// The loop's model.
    pub(super) model: &'a Model,
    /// True when the model is at its equilibrium.
    pub(super) converged: bool,
    /// Time since the cycle before, s.
    pub(super) period: f64,
    /// The model's bias, rotation vectors, rad.
    pub(super) bias: &'a [[f64; 3]; MAGNETS_MAX],
}

/// Looks ahead for one loop.
#[derive(Debug)]
pub(super) struct Scout {
    walker: Walker,
    /// True where frames without goals are turned by secondary tasks.
    frames_are_free: bool,
    steps_per_s: f64,
    /// Steps that time has earned and nobody has taken.
    credit: f64,
    bounds: Bounds,
    magnets: usize,
    /// Where the reference may go.
    cleared: ReferenceTarget,
    /// The target that is walked to.
    under_way: Option<(ReferenceTarget, Walk)>,
    /// The target judged last.
    judged: Option<ReferenceTarget>,
    verdict: Verdict,
}

impl Scout {
    pub(super) fn new(
        config: &ScoutConfig,
        control: &ControlConfig,
        description: &HardwareDescription,
        manipulator: Manipulator,
    ) -> Self {
        Self {
            magnets: manipulator.magnet_count(),
            walker: Walker::for_scout(config.station_deg.to_radians(), control, description, manipulator),
            frames_are_free: control.frame_angles == FrameUse::Steer && !description.frames.is_empty(),
            steps_per_s: config.steps_per_s,
            credit: 0.0,
            bounds: Bounds { margin_min: config.margin_min, tolerance: config.tolerance_deg.to_radians() },
            cleared: ReferenceTarget::default(),
            under_way: None,
            judged: None,
            verdict: Verdict::Unchecked,
        }
    }

    /// The loop does not steer: the reference rests here, and every target will be new.
    pub(super) fn rest(&mut self, reference: &Directions) {
        self.cleared = (*reference).into();
        (self.under_way, self.judged, self.verdict) = (None, None, Verdict::Unchecked);
    }

    /// What is known of the way to the target asked for last.
    pub(super) fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// One cycle's share of looking ahead to `asked`; returns where the reference may go meanwhile.
    pub(super) fn lead(&mut self, asked: &ReferenceTarget, standing: &Standing<'_>) -> ReferenceTarget {
        if self.frames_are_free && asked.frame_angles.is_none() {
            (self.under_way, self.judged, self.verdict) = (None, None, Verdict::Unchecked);
            self.cleared = *asked;
            return *asked;
        }
        if self.judged.as_ref() != Some(asked) {
            self.verdict = Verdict::Checking;
            // To stop, and to go where it goes anyway, need no looking.
            if *asked == (*standing.reference).into() || *asked == self.cleared {
                self.accept(asked, standing.model);
            } else if self.under_way.is_none() && standing.converged {
                self.set_out(asked, standing);
            }
        }
        self.credit = (self.credit + self.steps_per_s * standing.period).clamp(0.0, STEPS_MAX);
        while self.credit >= 1.0 {
            self.credit -= 1.0;
            let Some((target, walk)) = &mut self.under_way else { continue };
            let (target, verdict) = (*target, judge(self.walker.advance(walk), walk));
            if verdict == Verdict::Checking {
                continue;
            }
            self.under_way = None;
            if matches!(verdict, Verdict::Clear { .. } | Verdict::OutOfReach { .. }) {
                self.cleared = target;
            }
            if target == *asked {
                (self.judged, self.verdict) = (Some(target), verdict);
            }
        }
        self.cleared
    }

    fn accept(&mut self, asked: &ReferenceTarget, model: &Model) {
        let currents = model.equilibrium().actuation.current_a;
        let current_max = currents.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
        self.verdict = Verdict::Clear { margin_min: model.stability().margin, current_max };
        (self.cleared, self.judged, self.under_way) = (*asked, Some(*asked), None);
    }

    fn set_out(&mut self, asked: &ReferenceTarget, standing: &Standing<'_>) {
        let margin_min = margin_allowed(self.bounds.margin_min, standing.model.stability().margin);
        self.walker.take_up(standing.model);
        let present = standing.model.equilibrium().actuation;
        let mut goal = Waypoint {
            directions: Directions::default(),
            frame_angles: asked.frame_angles.unwrap_or(present.angle_rad),
        };
        for (magnet, direction) in goal.directions.iter_mut().enumerate().take(self.magnets) {
            let wanted = Vector3::from(asked.directions[magnet]);
            let undone = Rotation3::new(-Vector3::from(standing.bias[magnet])) * wanted;
            // What is no direction leaves its magnet where it is.
            let usable = undone.try_normalize(f64::MIN_POSITIVE).filter(|unit| unit.x.is_finite());
            *direction = usable.unwrap_or_else(|| standing.model.tangent(magnet)).into();
        }
        self.under_way = Some((*asked, self.walker.set_out(&goal, &Bounds { margin_min, ..self.bounds })));
    }
}

fn judge(advance: Advance, walk: &Walk) -> Verdict {
    let (walked, progress) = (walk.walked(), walk.share());
    match advance {
        Advance::Walking => Verdict::Checking,
        Advance::Arrived => Verdict::Clear { margin_min: walked.margin_min, current_max: walked.current_max },
        Advance::Ended(Obstacle::OutOfReach) => Verdict::OutOfReach { progress },
        Advance::Ended(obstacle) => Verdict::Refused { obstacle, progress },
    }
}
