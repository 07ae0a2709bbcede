//! The direct tracker: sees all magnets' poses, with noise.
//!
//! Noise turns each tangent by two independent normal angles about the body's transverse axes, each of the
//! configured standard deviation, and moves each coordinate likewise.

use magsteer_hal::{MAGNETS_MAX, MagnetPose, PoseMessage};
use nalgebra::{UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::rod::{Pose, Rod};

/// Stream of the plant's seed from which the tracker draws.
const RANDOM_STREAM: u64 = 1;

/// What a tracker is like.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TrackerCharacter {
    /// Standard deviation of each of the two tilts of a tangent, rad.
    pub orientation_noise: f64,
    /// Standard deviation of each coordinate, m.
    pub position_noise: f64,
}

/// A tracker at work.
#[derive(Debug, Clone)]
pub(super) struct Tracker {
    character: TrackerCharacter,
    random: ChaCha8Rng,
}

impl Tracker {
    pub fn new(character: TrackerCharacter, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RANDOM_STREAM);
        Self { character, random }
    }

    /// One exposure; `None` when it is lost.
    pub fn see(&mut self, rod: &Rod, dropout_probability: f64) -> Option<PoseMessage> {
        let lost = self.random.random_bool(dropout_probability);
        let message = message_of((0..rod.magnet_count()).map(|index| self.blurred(rod.magnet_pose(index))));
        (!lost).then_some(message)
    }

    fn blurred(&mut self, pose: Pose) -> Pose {
        let mut normal = || -> f64 { StandardNormal.sample(&mut self.random) };
        let tilt = Vector3::new(normal(), normal(), 0.0) * self.character.orientation_noise;
        let shift = Vector3::new(normal(), normal(), normal()) * self.character.position_noise;
        Pose {
            position: pose.position + shift,
            rotation: pose.rotation * UnitQuaternion::from_scaled_axis(tilt),
        }
    }
}

/// A message of poses without a header.
pub(crate) fn message_of(poses: impl ExactSizeIterator<Item = Pose>) -> PoseMessage {
    let mut message = PoseMessage::default();
    for (entry, pose) in message.magnets.iter_mut().zip(poses.take(MAGNETS_MAX)) {
        message.magnet_count += 1;
        let rotation = pose.rotation.coords;
        *entry = MagnetPose {
            position_m: pose.position.into(),
            orientation_xyzw: [rotation.x, rotation.y, rotation.z, rotation.w],
            valid: 1,
            reserved: 0,
        };
    }
    message
}

/// A message of magnets of which none was seen.
pub(super) fn unseen_message(magnets: usize) -> PoseMessage {
    let magnet_count = u32::try_from(magnets.min(MAGNETS_MAX)).unwrap_or_default();
    PoseMessage { magnet_count, ..PoseMessage::default() }
}
