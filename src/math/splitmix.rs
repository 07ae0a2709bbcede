//! Numbers that look random and follow from a seed: `SplitMix64` of Steele, Lea and Flood, 2014.
//!
//! It is written out here, and not taken from a library, because what follows from a seed must not change
//! with a library's version.

use std::f64::consts::TAU;

/// Step of the counter: the golden ratio's fraction in 64 bits, odd.
const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Spreads a number over all bits, one to one: the finaliser of `SplitMix64`.
#[must_use]
pub const fn scramble(number: u64) -> u64 {
    let mixed = (number ^ (number >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

/// A stream of numbers.
#[derive(Debug, Clone)]
pub struct SplitMix(u64);

impl SplitMix {
    /// The stream that follows from a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Passes over elements.
    pub const fn skip(&mut self, count: u64) {
        self.0 = self.0.wrapping_add(count.wrapping_mul(STEP));
    }

    /// 64 bits.
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        scramble(self.0)
    }

    /// Uniform in [0, 1).
    pub const fn unit(&mut self) -> f64 {
        // 53 bits fit an f64 exactly.
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Normal with mean 0 and deviation 1, by Box and Muller.
    pub fn normal(&mut self) -> f64 {
        // The logarithm's argument lies in (0, 1].
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (TAU * self.unit()).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::SplitMix;

    /// Goal: the numbers are those of the published generator: the first five for the seed 1234567, as
    /// Rosetta Code gives them.
    #[test]
    fn numbers_are_those_of_the_published_generator() {
        let mut stream = SplitMix::new(1_234_567);
        let numbers: Vec<u64> = (0..5).map(|_| stream.bits()).collect();
        let published = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
            4_593_380_528_125_082_431,
            16_408_922_859_458_223_821,
        ];
        assert_eq!(numbers, published);
        let mut later = SplitMix::new(1_234_567);
        later.skip(3);
        assert_eq!(later.bits(), published[3]);
    }

    /// Goal: 20,000 normal numbers have mean 0, deviation 1 and 95 % within 1.96, each within four standard
    /// errors.
    #[test]
    fn normal_numbers_have_the_moments_of_a_normal_distribution() {
        let mut stream = SplitMix::new(7);
        let numbers: Vec<f64> = (0..20_000).map(|_| stream.normal()).collect();
        let count = numbers.len() as f64;
        let mean = numbers.iter().sum::<f64>() / count;
        let variance = numbers.iter().map(|number| (number - mean).powi(2)).sum::<f64>() / count;
        let within = numbers.iter().filter(|number| number.abs() < 1.959_964).count() as f64 / count;
        assert!(mean.abs() < 4.0 / count.sqrt(), "{mean}");
        assert!((variance - 1.0).abs() < 4.0 * (2.0 / count).sqrt(), "{variance}");
        assert!((within - 0.95).abs() < 4.0 * (0.95 * 0.05 / count).sqrt(), "{within}");
    }
}
