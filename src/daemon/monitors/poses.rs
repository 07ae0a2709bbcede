//! Poses that cannot be a rod's, whatever the model says: outside of its reach, or faster than it moves.
//!
//! Between two messages dt apart a magnet turns by at most `jump + rate dt` and moves by at most `shift + speed dt`:
//! the first terms are the sensor's noise, the second what a swinging rod does.

use magsteer_hal::operator::Cause;
use magsteer_hal::{HardwareDescription, MagnetPose, PoseMessage};
use nalgebra::Vector3;

use super::config::MonitorLimits;
use crate::math::angle_between;

/// Memory of the poses seen last.
#[derive(Debug, Clone)]
pub(super) struct PoseSanity {
    center: [f64; 3],
    radius: f64,
    last: Option<PoseMessage>,
}

impl PoseSanity {
    pub(super) fn new(rig: &HardwareDescription) -> Self {
        Self { center: rig.workspace.center, radius: rig.workspace.radius, last: None }
    }

    /// Takes fresh poses; why they cannot be a rod's, if they cannot.
    pub(super) fn take(&mut self, limits: &MonitorLimits, pose: &PoseMessage) -> Option<Cause> {
        let magnets = &pose.magnets[..(pose.magnet_count as usize).min(pose.magnets.len())];
        // Written so that a distance that is not a number is no rod's either.
        let is_near = |magnet: &MagnetPose| {
            distance(&magnet.position_m, &self.center) <= self.radius + limits.workspace_margin
        };
        let outside = !magnets.iter().all(is_near);
        let too_fast = self.last.is_some_and(|last| is_too_fast(limits, &last, pose, magnets));
        self.last = Some(*pose);
        match (too_fast, outside) {
            (true, _) => Some(Cause::PoseTooFast),
            (false, true) => Some(Cause::PoseOutsideWorkspace),
            (false, false) => None,
        }
    }
}

fn is_too_fast(
    limits: &MonitorLimits,
    last: &PoseMessage,
    pose: &PoseMessage,
    magnets: &[MagnetPose],
) -> bool {
    // Another sensor may see from elsewhere; that it is another one is a cause of its own.
    if last.header.epoch != pose.header.epoch {
        return false;
    }
    let elapsed = pose.header.source_stamp().since(last.header.source_stamp()).as_secs_f64();
    let (turn, shift) =
        (limits.pose_jump + limits.pose_rate * elapsed, limits.pose_shift + limits.pose_speed * elapsed);
    let within = |(before, now): (&MagnetPose, &MagnetPose)| {
        angle_between(&before.tangent().into(), &now.tangent().into()) <= turn
            && distance(&before.position_m, &now.position_m) <= shift
    };
    !last.magnets.iter().zip(magnets).all(within)
}

fn distance(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    (Vector3::from(*one) - Vector3::from(*other)).norm()
}
