//! A script of targets walked in the model before anything moves: can each be reached, with which currents, how stably.
//!
//! # Method
//! A [`Walker`] goes from target to target as the scout of the loop will, in the same steps and with the same tasks in the null
//! space. So what the scout would refuse on the way is known before the first target is set.
//!
//! # Limits
//! As the scout's: quasi-static, and as good as the model; the bias that the loop estimates is not known here. Frames without
//! goals stay where they are, which those do not that secondary tasks turn in the loop.

use magsteer_hal::{Actuation, COILS_MAX, HardwareDescription};
use nalgebra::Vector3;

use super::walk::{Advance, Bounds, Obstacle, Posture, Waypoint};
use super::walker::Walker;
use crate::control::config::{ControlConfig, FrameUse};
use crate::control::reference::ReferenceTarget;
use crate::control::scout::ScoutConfig;
use crate::control::step::{Directions, Equilibrium};
use crate::rod::Manipulator;

/// Walks targets one after another.
#[derive(Debug, Clone)]
pub struct Rehearsal {
    walker: Walker,
    bounds: Bounds,
    frames_are_free: bool,
    magnets: usize,
}

/// What one target came to.
#[derive(Debug, Clone, Copy)]
pub struct Rehearsed {
    /// What ended the way early, and after what share of it; `None` when the target was reached.
    pub obstacle: Option<(Obstacle, f64)>,
    /// Greatest magnitude of a current on the way, A.
    pub current_max: f64,
    /// Least margin of stability on the way: 1 at rest, 0 where the rod snaps through.
    pub margin_min: f64,
    /// Greatest angle between a magnet and its target at the end, rad.
    pub error: f64,
    /// Where the model came to.
    pub posture: Posture,
}

impl Rehearsal {
    /// A rehearsal that begins at rest, frames where they stand while nothing steers them; `scout` says what a way must not exceed.
    #[must_use]
    pub fn new(
        scout: &ScoutConfig,
        control: &ControlConfig,
        description: &HardwareDescription,
        manipulator: Manipulator,
    ) -> Self {
        let magnets = manipulator.magnet_count();
        let station = scout.station_deg.to_radians();
        let mut rehearsal = Self {
            walker: Walker::for_scout(station, control, description, manipulator),
            bounds: Bounds { margin_min: scout.margin_min, tolerance: scout.tolerance_deg.to_radians() },
            frames_are_free: control.frame_angles == FrameUse::Steer && !description.frames.is_empty(),
            magnets,
        };
        let angle_rad = control.resting_frames(description);
        // Frames that turn without currents turn nothing.
        let _ = rehearsal.walker.actuate(&Actuation { angle_rad, ..Actuation::default() });
        rehearsal
    }

    /// From now on every coil makes `gains` times its described field.
    pub fn set_gains(&mut self, gains: &[f64; COILS_MAX]) {
        self.walker.set_gains(gains);
    }

    /// Begins at an equilibrium.
    ///
    /// # Errors
    /// When it is none of this rig's model.
    pub fn begin_at(&mut self, equilibrium: &Equilibrium) -> Result<(), Obstacle> {
        self.walker.resume(equilibrium)
    }

    /// False where the loop turns the frames as it likes on the way to `target`, so that this rehearsal binds nobody.
    #[must_use]
    pub fn binds(&self, target: &ReferenceTarget) -> bool {
        !self.frames_are_free || target.frame_angles.is_some()
    }

    /// Walks to `target`, or as far as that goes; the next begins there.
    pub fn step(&mut self, target: &ReferenceTarget) -> Rehearsed {
        let from = self.walker.posture();
        let margin_min = crate::control::scout::margin_allowed(self.bounds.margin_min, from.margin);
        let goal = Waypoint {
            directions: self.directions(target, &from),
            frame_angles: target.frame_angles.unwrap_or(from.equilibrium.actuation.angle_rad),
        };
        let mut walk = self.walker.set_out(&goal, &Bounds { margin_min, ..self.bounds });
        let obstacle = loop {
            match self.walker.advance(&mut walk) {
                Advance::Walking => {}
                Advance::Arrived => break None,
                Advance::Ended(obstacle) => break Some((obstacle, walk.share())),
            }
        };
        let error = self.walker.error_to(&goal.directions);
        let posture = self.walker.posture();
        let walked = walk.walked();
        Rehearsed {
            obstacle,
            current_max: walked.current_max,
            margin_min: walked.margin_min.min(from.margin),
            error,
            posture,
        }
    }

    /// Directions of `target`; what is none there stays where the model is.
    fn directions(&self, target: &ReferenceTarget, from: &Posture) -> Directions {
        let mut directions = from.directions;
        for (direction, asked) in directions.iter_mut().zip(&target.directions).take(self.magnets) {
            let unit = Vector3::from(*asked).try_normalize(f64::MIN_POSITIVE);
            if let Some(unit) = unit.filter(|unit| unit.x.is_finite()) {
                *direction = unit.into();
            }
        }
        directions
    }
}
