//! What the current sensors say of the currents.
//!
//! `m = q round(((1 + g) i + o + noise) / q)`                                                    (12)
//!
//! with a gain error `g` and an offset `o` of the stated size each, up or down as the seed decides for each
//! coil, normal noise, and a quantum `q`. The current controllers see `m` alone: a gain error is one of the
//! true current.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Stream of the plant's seed from which errors and noise are drawn.
const RANDOM_STREAM: u64 = 5;

/// What current sensors are like.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CurrentSensorCharacter {
    /// Size of the gain error.
    pub gain: f64,
    /// Size of the offset, A.
    pub offset: f64,
    /// Standard deviation of a sample's noise, A.
    pub noise: f64,
    /// Step of the digits, A; 0 for none.
    pub quantum: f64,
}

/// The current sensors of all coils.
#[derive(Debug, Clone)]
pub struct CurrentSensors {
    character: CurrentSensorCharacter,
    /// Gain and offset of each.
    errors: Vec<(f64, f64)>,
    random: ChaCha8Rng,
}

impl CurrentSensors {
    /// Sensors for `count` coils.
    #[must_use]
    pub fn new(character: CurrentSensorCharacter, count: usize, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RANDOM_STREAM);
        let mut signed = |size: f64| if random.random_bool(0.5) { size } else { -size };
        let errors = (0..count).map(|_| (1.0 + signed(character.gain), signed(character.offset))).collect();
        Self { character, errors, random }
    }

    /// Measures all currents, A, once.
    pub fn measure(&mut self, currents: &[f64], measured: &mut [f64]) {
        let Self { character, errors, random } = self;
        for ((current, measured), (gain, offset)) in currents.iter().zip(measured).zip(errors) {
            let mut value = *gain * current + *offset;
            if character.noise > 0.0 {
                let normal: f64 = StandardNormal.sample(random);
                value += character.noise * normal;
            }
            *measured = quantised(value, character.quantum); // (12)
        }
    }
}

/// The nearest multiple of `quantum`; the value itself when that is 0.
#[must_use]
pub fn quantised(value: f64, quantum: f64) -> f64 {
    if quantum > 0.0 { quantum * (value / quantum).round() } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_without_errors_says_what_is() {
        let mut sensors = CurrentSensors::new(CurrentSensorCharacter::default(), 3, 1);
        let (currents, mut measured) = ([1.5, -0.1, 1e-7], [0.0; 3]);
        sensors.measure(&currents, &mut measured);
        assert_eq!(measured, currents);
    }

    #[test]
    fn errors_have_their_stated_size_and_a_sign_from_the_seed() {
        let character = CurrentSensorCharacter { gain: 0.01, offset: 0.02, noise: 0.0, quantum: 0.0 };
        let mut patterns = std::collections::BTreeSet::new();
        for seed in 0..20 {
            let mut sensors = CurrentSensors::new(character, 4, seed);
            let (mut zero, mut one) = ([0.0; 4], [0.0; 4]);
            sensors.measure(&[0.0; 4], &mut zero);
            sensors.measure(&[1.0; 4], &mut one);
            let mut pattern = Vec::new();
            for (zero, one) in zero.iter().zip(one) {
                assert!((zero.abs() - 0.02).abs() < 1e-12 && ((one - zero - 1.0).abs() - 0.01).abs() < 1e-12);
                pattern.push((*zero > 0.0, one - zero > 1.0));
            }
            patterns.insert(pattern);
        }
        // 20 draws out of 256 patterns.
        assert!(patterns.len() > 15);
    }

    #[test]
    fn noise_has_its_standard_deviation_and_digits_their_step() {
        let character = CurrentSensorCharacter { gain: 0.0, offset: 0.0, noise: 0.01, quantum: 1e-3 };
        let mut sensors = CurrentSensors::new(character, 1, 3);
        let count = 20_000;
        let (mut sum, mut squares, mut measured) = (0.0, 0.0, [0.0]);
        for _ in 0..count {
            sensors.measure(&[2.0], &mut measured);
            let digits = measured[0] / 1e-3;
            assert!((digits - digits.round()).abs() < 1e-9);
            sum += measured[0] - 2.0;
            squares += (measured[0] - 2.0).powi(2);
        }
        let mean = sum / f64::from(count);
        // Standard errors of mean and deviation: 7e-5 and 5e-5 A; four of each.
        assert!(mean.abs() < 2.8e-4, "{mean}");
        let deviation = (squares / f64::from(count) - mean * mean).sqrt();
        assert!((deviation - 0.01).abs() < 2e-4, "{deviation}");
    }
}
