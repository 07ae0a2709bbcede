//! The pose sensor: sees all magnets at a rate, with noise, and tells of it later.
//!
//! Terms: an *exposure* is the moment at which the poses were true; it is the message's source stamp.
//! A message is *due* one latency after. Noise turns each tangent by two independent normal angles about
//! the body's transverse axes, each of the configured standard deviation, and moves each coordinate
//! likewise. A *drop-out* loses a whole exposure.

use std::collections::VecDeque;
use std::time::Duration;

use magsteer_hal::{MAGNETS_MAX, MagnetPose, PoseMessage, Stamp};
use nalgebra::{UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::rod::Pose;

/// Stream of the plant's seed from which the sensor draws.
const RANDOM_STREAM: u64 = 1;

/// What a sensor is like.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorCharacter {
    /// Time between exposures.
    pub period: Duration,
    /// From exposure to message.
    pub latency: Duration,
    /// Standard deviation of each of the two tilts of a tangent, rad.
    pub orientation_noise: f64,
    /// Standard deviation of each coordinate, m.
    pub position_noise: f64,
    /// Share of exposures that are lost, 0 to 1.
    pub dropout_probability: f64,
}

/// A sensor at work.
#[derive(Debug, Clone)]
pub struct PoseSensor {
    character: SensorCharacter,
    random: ChaCha8Rng,
    next_exposure: Stamp,
    pending: VecDeque<PoseMessage>,
}

impl PoseSensor {
    /// A sensor whose first exposure is at `start`.
    #[must_use]
    pub fn new(character: SensorCharacter, seed: u64, start: Stamp) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RANDOM_STREAM);
        // One more than can be under way at once, so that it never grows.
        let capacity = character.latency.as_nanos() / character.period.as_nanos().max(1) + 2;
        Self {
            character,
            random,
            next_exposure: start,
            pending: VecDeque::with_capacity(usize::try_from(capacity).unwrap_or(2)),
        }
    }

    /// Starts anew at `start`, the next exposure one period after it: exposures under way are lost.
    pub fn restart(&mut self, start: Stamp) {
        self.pending.clear();
        self.next_exposure = start.after(self.character.period);
    }

    /// True when an exposure falls on or before `now`; [`Self::expose`] then takes it.
    #[must_use]
    pub fn wants_exposure(&self, now: Stamp) -> bool {
        now >= self.next_exposure
    }

    /// Takes one exposure of the true poses at `now`.
    pub fn expose(&mut self, poses: impl ExactSizeIterator<Item = Pose>, now: Stamp) {
        // Exposures keep their own grid; those that a jump of the clock passed over are lost.
        while self.next_exposure <= now {
            self.next_exposure = self.next_exposure.after(self.character.period);
        }
        let lost = self.random.random_bool(self.character.dropout_probability);
        let mut message = message_of(poses.map(|pose| self.blurred(pose)));
        message.header.source_stamp_ns = now.nanoseconds();
        if !lost && self.pending.len() < self.pending.capacity() {
            self.pending.push_back(message);
        }
    }

    /// The oldest message that is due at `now`, if any; its header has only the source stamp.
    pub fn take_due(&mut self, now: Stamp) -> Option<PoseMessage> {
        let due = self.pending.front()?.header.source_stamp().after(self.character.latency);
        if now >= due { self.pending.pop_front() } else { None }
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

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: Duration = Duration::from_micros(500);

    fn character() -> SensorCharacter {
        SensorCharacter {
            period: Duration::from_millis(5),
            latency: Duration::from_millis(12),
            orientation_noise: 0.2_f64.to_radians(),
            position_noise: 1e-4,
            dropout_probability: 0.0,
        }
    }

    fn pose() -> Pose {
        Pose {
            position: Vector3::new(0.01, -0.02, 0.03),
            rotation: UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 1.2, -0.4)),
        }
    }

    /// Runs a sensor and returns every message with the time at which it was due.
    fn run(character: SensorCharacter, seed: u64, steps: usize) -> Vec<(Stamp, PoseMessage)> {
        let start = Stamp::from_nanoseconds(1_000_000_000);
        let mut sensor = PoseSensor::new(character, seed, start);
        let mut now = start;
        let mut messages = Vec::new();
        for _ in 0..steps {
            if sensor.wants_exposure(now) {
                sensor.expose([pose(), pose()].into_iter(), now);
            }
            while let Some(message) = sensor.take_due(now) {
                messages.push((now, message));
            }
            now = now.after(STEP);
        }
        messages
    }

    #[test]
    fn messages_come_at_the_rate_and_one_latency_after_exposure() {
        let messages = run(character(), 1, 4000);
        // 2 s at 200 Hz, less those still under way at the end.
        assert_eq!(messages.len(), 398);
        for (index, (due, message)) in messages.iter().enumerate() {
            let exposure = 1_000_000_000 + 5_000_000 * index as u64;
            assert_eq!(message.header.source_stamp_ns, exposure);
            assert_eq!(due.nanoseconds(), exposure + 12_000_000);
            assert_eq!(message.magnet_count, 2);
        }
    }

    #[test]
    fn noise_has_the_configured_deviations_and_no_bias() {
        let messages = run(character(), 2, 80_000);
        let (mut tilt, mut bias, mut shift) = (0.0, Vector3::zeros(), 0.0);
        for (_, message) in &messages {
            let seen = &message.magnets[1];
            let [x, y, z, w] = seen.orientation_xyzw;
            let rotation = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            let off = pose().rotation.inverse() * (rotation * Vector3::z());
            tilt += off.x.powi(2) + off.y.powi(2);
            bias += off - Vector3::z();
            shift += (Vector3::from(seen.position_m) - pose().position).norm_squared();
        }
        let count = messages.len() as f64;
        // 8000 samples: deviations are known to about 1 %.
        let tilt_deg = (tilt / (2.0 * count)).sqrt().to_degrees();
        assert!((tilt_deg / 0.2 - 1.0).abs() < 0.03, "{tilt_deg}");
        let shift = (shift / (3.0 * count)).sqrt();
        assert!((shift / 1e-4 - 1.0).abs() < 0.03, "{shift}");
        let bias_deg = (bias / count).norm().to_degrees();
        assert!(bias_deg < 0.2 * 4.0 / count.sqrt(), "{bias_deg}");
    }

    #[test]
    fn drop_outs_lose_the_configured_share() {
        let messages = run(SensorCharacter { dropout_probability: 0.25, ..character() }, 3, 80_000);
        let share = messages.len() as f64 / 8000.0;
        assert!((share - 0.75).abs() < 0.02, "{share}");
    }

    #[test]
    fn a_seed_repeats_bit_for_bit_and_another_differs() {
        assert_eq!(run(character(), 4, 500), run(character(), 4, 500));
        assert_ne!(run(character(), 4, 500), run(character(), 5, 500));
    }
}
