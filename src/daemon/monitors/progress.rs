//! A loop that turns and gets nowhere: a controller that froze, one that comes no nearer to a target that is clear, and
//! a model that stays off what is measured.
//!
//! *Frozen*: the controller's own copy of the measured directions stands still while fresh poses differ from each other.
//! *No nearer*: further than `progress_error_deg` from a target whose way is not known to end short of it, with no
//! parameter at a limit, and not nearer by a tenth for `progress_stop_ms`. A target out of reach, or one that the
//! currents do not suffice for, is no failure of the controller.
//!
//! Its limit: *any* parameter that may move and is at a limit excuses the loop, also where others could, since the
//! distance alone does not tell a rod at the end of its reach from a controller that gave up. A controller
//! that holds one coil saturated and comes no nearer is not found here, but by a frozen copy, or by poses
//! that the model disagrees with.

use std::time::Duration;

use magsteer_hal::{MAGNETS_MAX, Stamp};

use super::super::watch::lasted;
use super::bank::Sample;
use super::config::MonitorLimits;
use super::evidence::Evidence;
use crate::control::{Directions, Verdict};
use crate::math::angle_between;

/// Share of the distance that counts as nearer.
const NEARER: f64 = 0.9;

/// Memory of how far the loop has come.
#[derive(Debug, Clone, Default)]
pub(super) struct Progress {
    /// Nearest so far, rad, and since when.
    nearest: Option<(f64, Stamp)>,
    target: Directions,
    poses: Directions,
    seen_by_controller: Directions,
    frozen: Evidence,
    model_off: Evidence,
}

impl Progress {
    /// Takes a cycle of `elapsed`; `model_error` is the greatest angle between measured and predicted directions, rad,
    /// where the model found an equilibrium.
    pub(super) fn take(
        &mut self,
        limits: &MonitorLimits,
        sample: &Sample,
        model_error: Option<f64>,
        verdict: Verdict,
        now: Stamp,
        elapsed: Duration,
    ) {
        self.approach(limits, sample, verdict, now);
        let is_off = model_error.map(|error| error > limits.model_error);
        self.model_off.take(is_off, elapsed, limits.model_error_stop);
        let poses = sample
            .pose
            .filter(|_| sample.pose_is_fresh)
            .map(|pose| pose.magnets.map(|magnet| magnet.tangent()));
        let stands_still = sample.seen_by_controller == self.seen_by_controller;
        let moved = poses.map(|poses| poses != self.poses);
        // Between two messages nothing can be told; between two that are alike nothing either.
        let sign = moved.filter(|moved| *moved).map(|_| stands_still);
        // A message stands for the time since the one before: the sign lasts until the next.
        self.frozen.take(sign, elapsed.max(sample.pose_interval), limits.controller_frozen);
        if let Some(poses) = poses {
            self.poses = poses;
            self.seen_by_controller = sample.seen_by_controller;
        }
    }

    fn approach(&mut self, limits: &MonitorLimits, sample: &Sample, verdict: Verdict, now: Stamp) {
        let free = matches!(verdict, Verdict::Clear { .. } | Verdict::Unchecked) && sample.saturated == 0;
        let error = (0..MAGNETS_MAX)
            .filter(|magnet| sample.target[*magnet] != [0.0; 3])
            .map(|magnet| {
                angle_between(&sample.seen_by_controller[magnet].into(), &sample.target[magnet].into())
            })
            .fold(0.0, f64::max);
        if !sample.engaged || !free || error <= limits.progress_error || sample.target != self.target {
            self.nearest = None;
        }
        self.target = sample.target;
        if sample.engaged && free && error > limits.progress_error {
            let is_nearer = self.nearest.is_none_or(|(nearest, _)| error < NEARER * nearest);
            if is_nearer {
                self.nearest = Some((error, now));
            }
        }
    }

    pub(super) fn is_missing(&self, limits: &MonitorLimits, now: Stamp) -> bool {
        self.frozen.exceeds(limits.controller_frozen)
            || lasted(self.nearest.map(|(_, since)| since), now, limits.progress_stop)
    }

    pub(super) fn model_is_off(&self, limits: &MonitorLimits) -> bool {
        self.model_off.exceeds(limits.model_error_stop)
    }
}
