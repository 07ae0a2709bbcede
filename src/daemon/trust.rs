//! Whether driver and sensor can be believed, though what they say is fresh and well formed.
//!
//! | sign | what may be behind it | what follows |
//! |---|---|---|
//! | poses outside of the workspace, or faster than a rod | a sensor that sees something else | as below |
//! | measured directions far off the model's | a sensor that froze or sees something else, magnets mixed up, a rod that is held | such poses, and those of half of `pose_hold_ms` after, count as none: hold, then stop |
//! | poses of another life of the sensor than at arming | it restarted; nobody checked where it looks now | stop |
//! | measured currents or angles far off the commanded, for a while | an amplifier or motor that does not obey, a sensor that froze | stop |
//! | the echo of commands stands still | feedback that froze under fresh stamps | feedback counts as stale |
//! | feedback of another life of the driver than at arming | it restarted and holds no authority | authority is lost |
//!
//! What is absent: a judgement where the model found no equilibrium; that is a cause of its own.

use std::time::Duration;

use magsteer_hal::operator::Cause;
use magsteer_hal::{Actuation, Stamp};

use super::config::Limits;
use super::watch::{Observation, lasted};
use crate::control::CycleOutcome;
use crate::math::angle_between;

/// Greatest distance of anything measured from what was commanded last.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Astray {
    /// Of a current, A.
    pub current: f64,
    /// Of a frame angle, rad.
    pub angle: f64,
}

impl Astray {
    /// Between what was measured and what was commanded; entries that a rig does not have are zero in both.
    pub(super) fn between(measured: &Actuation, commanded: &Actuation) -> Self {
        let greatest = |measured: &[f64], commanded: &[f64]| {
            let distances = measured.iter().zip(commanded).map(|(measured, commanded)| measured - commanded);
            distances.fold(0.0, |most: f64, distance| most.max(distance.abs()))
        };
        Self {
            current: greatest(&measured.current_a, &commanded.current_a),
            angle: greatest(&measured.angle_rad, &commanded.angle_rad),
        }
    }
}

/// Greatest angle between the measured and the predicted direction of a magnet, rad; 0 before both are known.
pub(super) fn pose_error(outcome: &CycleOutcome) -> f64 {
    let is_known = |direction: &[f64; 3]| direction.iter().any(|component| *component != 0.0);
    let pairs = outcome.measured.iter().zip(&outcome.predicted);
    let known = pairs.filter(|(measured, predicted)| is_known(measured) && is_known(predicted));
    known
        .map(|(measured, predicted)| angle_between(&(*measured).into(), &(*predicted).into()))
        .fold(0.0, f64::max)
}

/// Memory of what was believed.
#[derive(Debug, Clone)]
pub(super) struct Trust {
    limits: Limits,
    /// Exposure of the newest poses that are believed.
    believed_pose: Option<Stamp>,
    /// When poses last disagreed with the model.
    disagreed: Option<Stamp>,
    /// When poses could last not be a rod's, and why.
    doubted: Option<(Stamp, Cause)>,
    pose_is_believed: bool,
    /// Time spent astray, less time spent otherwise: what is wrong most of the time is wrong.
    astray: Duration,
    previous: Option<Stamp>,
    echo: Option<Echo>,
    /// Lives of driver and sensor when authority was granted.
    granted: Option<Lives>,
}

/// The echo of commands, and since when it has stood where it is.
#[derive(Debug, Clone, Copy)]
struct Echo {
    sequence: u64,
    since: Stamp,
}

#[derive(Debug, Clone, Copy)]
struct Lives {
    driver: Option<u64>,
    sensor: Option<u64>,
}

impl Trust {
    pub(super) fn new(limits: Limits) -> Self {
        Self {
            limits,
            believed_pose: None,
            disagreed: None,
            doubted: None,
            pose_is_believed: true,
            astray: Duration::ZERO,
            previous: None,
            echo: None,
            granted: None,
        }
    }

    /// Takes one cycle's observation.
    pub(super) fn observe(&mut self, seen: &Observation, doubt: Option<Cause>) {
        self.doubted = doubt.map(|cause| (seen.now, cause)).or(self.doubted);
        if seen.model_converged && seen.pose_error > self.limits.pose_error_max {
            self.disagreed = Some(seen.now);
        }
        // Of poses at random one in some is near the truth: trust comes back more slowly than it goes.
        self.pose_is_believed = self.disbelief(seen.now).is_none();
        if self.pose_is_believed {
            self.believed_pose = seen.pose_stamp;
        }
        self.follow(seen);
        if let Some(driver) = &seen.driver
            && self.echo.is_none_or(|echo| echo.sequence != driver.echoed)
        {
            self.echo = Some(Echo { sequence: driver.echoed, since: seen.now });
        }
    }

    fn follow(&mut self, seen: &Observation) {
        // A pause of the loop says nothing about the time in between.
        let most = self.limits.following_stop / 10;
        let elapsed = self.previous.map_or(Duration::ZERO, |previous| seen.now.since(previous).min(most));
        self.previous = Some(seen.now);
        let is_astray = seen.astray.current > self.limits.following_current_max
            || seen.astray.angle > self.limits.following_angle_max;
        self.astray = if is_astray { self.astray + elapsed } else { self.astray.saturating_sub(elapsed) };
        // What was wrong for long is forgiven as fast as what tripped.
        self.astray = self.astray.min(self.limits.following_stop + most);
    }

    /// True while the newest poses are believed.
    pub(super) fn pose_is_believed(&self) -> bool {
        self.pose_is_believed
    }

    /// Why the newest poses are not believed, if they are not: that the model contradicts them says most.
    pub(super) fn disbelief(&self, now: Stamp) -> Option<Cause> {
        let lasts = |begin: &Stamp| now.since(*begin) <= self.limits.pose_hold / 2;
        let contradicted = self.disagreed.filter(lasts).map(|_| Cause::PoseImplausible);
        contradicted.or(self.doubted.filter(|(begin, _)| lasts(begin)).map(|(_, cause)| cause))
    }

    /// Remembers who granted authority and who measured then. What went astray before is no concern of the
    /// new holder.
    pub(super) fn note_grant(&mut self, seen: &Observation) {
        self.astray = Duration::ZERO;
        self.granted = Some(Lives { driver: seen.driver.map(|driver| driver.life), sensor: seen.pose_life });
    }

    /// True when poses that are believed were true within `limit`.
    pub(super) fn poses_within(&self, seen: &Observation, limit: Duration) -> bool {
        self.believed_pose.is_some_and(|stamp| seen.now.since(stamp) <= limit)
    }

    /// True when currents or angles have not followed commands for too long.
    pub(super) fn is_astray(&self) -> bool {
        self.astray > self.limits.following_stop
    }

    /// True when commands were sent for too long without any being echoed.
    pub(super) fn echo_stands_still(&self, seen: &Observation) -> bool {
        lasted(self.echo.map(|echo| echo.since), seen.now, self.limits.feedback_stop)
    }

    /// True when the driver's feedback is of another life than when it granted authority.
    pub(super) fn driver_restarted(&self, seen: &Observation) -> bool {
        self.granted.is_some_and(|lives| lives.driver != seen.driver.map(|driver| driver.life))
    }

    /// True when the poses are of another life of the sensor than when authority was granted.
    pub(super) fn sensor_restarted(&self, seen: &Observation) -> bool {
        self.granted.is_some_and(|lives| lives.sensor != seen.pose_life)
    }
}

#[cfg(test)]
mod tests {
    use super::{Actuation, Astray, CycleOutcome, pose_error};

    #[test]
    fn pose_error_is_that_of_the_worst_magnet_that_both_know() {
        let mut outcome = CycleOutcome::asking_for(Actuation::default());
        assert_eq!(pose_error(&outcome), 0.0);
        outcome.measured[1] = [0.5_f64.sin(), 0.0, 0.5_f64.cos()];
        outcome.measured[2] = [0.0; 3];
        outcome.predicted[3] = [0.0; 3];
        assert!((pose_error(&outcome) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn astray_is_the_greatest_distance_either_way() {
        let (mut measured, mut commanded) = (Actuation::default(), Actuation::default());
        (measured.current_a[1], commanded.current_a[2]) = (-2.0, 1.5);
        (measured.angle_rad[0], commanded.angle_rad[0]) = (0.1, 0.4);
        let found = Astray::between(&measured, &commanded);
        assert!((found.current - 2.0).abs() < 1e-15 && (found.angle - 0.3).abs() < 1e-15, "{found:?}");
    }
}
