//! The `[campaign]` table: which experiment many simulated plants play, and what differs from plant to plant.
//!
//! ```toml
//! [campaign]
//! experiment = "experiments/planar.toml"  # relative to this file
//!
//! [[campaign.draw]]
//! key = "plant.errors.modulus_relative"   # any number below [plant]
//! uniform = { low = -0.15, high = 0.15 }
//!
//! [[campaign.draw]]
//! key = "plant.sensors.tracker.poses.latency_ms"
//! normal = { mean = 5.0, deviation = 1.5, low = 1.0, high = 12.0 }  # truncated to low..high
//!
//! [[campaign.draw]]
//! key = "plant.step_us"
//! choice = [250, 500]
//! ```
//!
//! A number that the file writes without a point is drawn as a whole number.
//!
//! **Seeds.** Run r (0 first) of the campaign with seed S has the seed `scramble(scramble(S) + (r + 1) g) >>
//! 1`: element r of the `SplitMix64` stream that begins at `scramble(S)`, with `g` its step, without its last
//! bit since TOML's whole numbers are signed. That is also its `plant.seed`. Every key draws from a stream of
//! its own, which begins at `scramble(run's seed) ^ FNV-1a(key)`: a run follows from its seed alone, and a
//! further entry leaves the values of the others as they were.

use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

use super::document::{Document, Number};
use crate::math::{SplitMix, scramble};

/// Keys that may be drawn begin so.
const DRAWN_BELOW: &str = "plant.";
/// The key that every run draws anyway.
const SEED_KEY: &str = "plant.seed";
/// Trials of one draw from a truncated normal distribution: each is accepted with a probability of 0.49 at
/// least, see [`Distribution::sample`].
const TRIALS_MAX: u32 = 1000;

/// `[campaign]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignConfig {
    /// Path of the experiment, relative to the file that holds this key.
    pub experiment: String,
    /// `[[campaign.draw]]`; empty when the plants differ in their seeds alone.
    pub draw: Vec<Draw>,
}

/// One of `[[campaign.draw]]`: a key, and exactly one of the distributions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Draw {
    /// Path of a number below `[plant]`, in that key's unit.
    pub key: String,
    /// Every value between `low` and `high` with equal chance.
    uniform: Option<Uniform>,
    /// A normal distribution without what lies outside `low` to `high`.
    normal: Option<Normal>,
    /// Each of these values with equal chance.
    choice: Option<Vec<f64>>,
}

/// `uniform = { low, high }`, in the unit of the key.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uniform {
    /// Least value.
    pub low: f64,
    /// Greatest value, > `low`.
    pub high: f64,
}

/// `normal = { mean, deviation, low, high }`, in the unit of the key.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normal {
    /// Mean before truncation, from `low` to `high`.
    pub mean: f64,
    /// Standard deviation before truncation, > 0.
    pub deviation: f64,
    /// Least value.
    pub low: f64,
    /// Greatest value, > `low`.
    pub high: f64,
}

/// What a value is drawn from.
#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// Equal chance for everything in between.
    Uniform(Uniform),
    /// Truncated normal.
    Normal(Normal),
    /// Equal chance for each.
    Choice(Vec<f64>),
}

/// Seed of a run of a campaign, the first run being 0; below 2^63.
#[must_use]
pub fn run_seed(campaign_seed: u64, run: u64) -> u64 {
    let mut stream = SplitMix::new(scramble(campaign_seed));
    stream.skip(run);
    stream.bits() >> 1
}

impl CampaignConfig {
    /// Every refused value: keys that the document has no number at, distributions without sense. Whether a
    /// plant can be built is not asked here.
    #[must_use]
    pub fn check(&self, document: &Document) -> Vec<Invalid> {
        let mut checks = Checks::new();
        for (index, draw) in self.draw.iter().enumerate() {
            let path = format!("campaign.draw[{index}]");
            let number = document.number(&draw.key).filter(|_| draw.key.starts_with(DRAWN_BELOW));
            let key = format!("{path}.key");
            let expected =
                format!("the path of a number below [plant], as {DRAWN_BELOW}errors.modulus_relative");
            checks.require(number.is_some(), &key, &draw.key, expected);
            let expected = "another key: the seed is drawn for every run anyway";
            checks.require(draw.key != SEED_KEY, &key, &draw.key, expected);
            let is_first = self.draw[..index].iter().all(|other| other.key != draw.key);
            checks.require(is_first, &key, &draw.key, "drawn once, not twice");
            // Of a key that is refused it does not matter how its number is written.
            let number = number.filter(|_| is_first && draw.key != SEED_KEY);
            draw.check(&path, number, &mut checks);
        }
        checks.into_result(()).err().unwrap_or_default()
    }

    /// The values of the run with this seed, one a [`Draw`], as `document` writes the numbers that they
    /// replace.
    #[must_use]
    pub fn values(&self, document: &Document, run_seed: u64) -> Vec<Number> {
        self.draw.iter().map(|draw| draw.value(document.number(&draw.key), run_seed)).collect()
    }
}

impl Draw {
    /// The distribution; `None` unless exactly one is given.
    #[must_use]
    pub fn distribution(&self) -> Option<Distribution> {
        match (self.uniform, self.normal, &self.choice) {
            (Some(uniform), None, None) => Some(Distribution::Uniform(uniform)),
            (None, Some(normal), None) => Some(Distribution::Normal(normal)),
            (None, None, Some(values)) => Some(Distribution::Choice(values.clone())),
            _ => None,
        }
    }

    /// The least and the greatest value, or every choice, each with the path of the key that gives it, below
    /// that of the draw.
    #[must_use]
    pub fn extremes(&self) -> Vec<(String, f64)> {
        match self.distribution() {
            Some(Distribution::Uniform(Uniform { low, high })) => {
                vec![("uniform.low".to_owned(), low), ("uniform.high".to_owned(), high)]
            }
            Some(Distribution::Normal(Normal { low, high, .. })) => {
                vec![("normal.low".to_owned(), low), ("normal.high".to_owned(), high)]
            }
            Some(Distribution::Choice(values)) => values
                .into_iter()
                .enumerate()
                .map(|(index, value)| (format!("choice[{index}]"), value))
                .collect(),
            None => Vec::new(),
        }
    }

    /// The value that takes the place of `replaced` in the run with this seed.
    fn value(&self, replaced: Option<Number>, run_seed: u64) -> Number {
        let mut stream = SplitMix::new(scramble(run_seed) ^ fnv_1a(&self.key));
        let replaced = replaced.unwrap_or(Number::Decimal(f64::NAN));
        let value = self.distribution().map_or(f64::NAN, |distribution| match replaced {
            Number::Whole(_) => distribution.sample_whole(&mut stream),
            Number::Decimal(_) => distribution.sample(&mut stream),
        });
        replaced.with_value(value)
    }

    fn check(&self, path: &str, number: Option<Number>, checks: &mut Checks) {
        let Some(distribution) = self.distribution() else {
            let given = [self.uniform.is_some(), self.normal.is_some(), self.choice.is_some()];
            let count = given.iter().filter(|given| **given).count();
            let value = format!("{} with {count} distributions", self.key);
            checks.require(false, path, value, "given exactly one of uniform, normal, choice");
            return;
        };
        match distribution {
            Distribution::Uniform(Uniform { low, high }) => {
                check_range(&format!("{path}.uniform"), low, high, checks);
            }
            Distribution::Normal(Normal { mean, deviation, low, high }) => {
                let path = format!("{path}.normal");
                checks.positive(format!("{path}.deviation"), deviation);
                check_range(&path, low, high, checks);
                if low < high {
                    checks.within(format!("{path}.mean"), mean, low, high);
                }
            }
            Distribution::Choice(values) => {
                let key = format!("{path}.choice");
                checks.require(!values.is_empty(), &key, "[]", "at least one value");
                checks.finite(&key, &values);
            }
        }
        if matches!(number, Some(Number::Whole(_))) {
            for (key, value) in self.extremes() {
                let expected = format!(
                    "a whole number, since {} is written as one; write it with a point to draw fractions",
                    self.key
                );
                // Whole numbers beyond 2^53 cannot be told apart.
                let is_whole = value.fract() == 0.0 && value.abs() < (1_u64 << 53) as f64;
                checks.require(is_whole || !value.is_finite(), format!("{path}.{key}"), value, expected);
            }
        }
    }
}

fn check_range(path: &str, low: f64, high: f64, checks: &mut Checks) {
    for (key, value) in [("low", low), ("high", high)] {
        checks.require(value.is_finite(), format!("{path}.{key}"), value, "finite");
    }
    // What is not a number was refused above: it must not be refused twice.
    let upside_down = low >= high;
    checks.require(!upside_down, format!("{path}.low"), low, format!("< high, which is {high}"));
}

impl Distribution {
    /// Draws a value.
    ///
    /// A truncated normal distribution is drawn by rejection: of a normal one while the range is wider than
    /// sqrt(2 pi) deviations, else of a uniform one. Since the mean lies within the range, the worst case is
    /// a mean at one end of a range of that width; either way a trial is then accepted with a probability of
    /// 0.49.
    pub fn sample(&self, stream: &mut SplitMix) -> f64 {
        match self {
            Self::Uniform(Uniform { low, high }) => (low + stream.unit() * (high - low)).min(*high),
            Self::Choice(values) => {
                let index = (stream.unit() * values.len() as f64) as usize;
                values.get(index).copied().unwrap_or(f64::NAN)
            }
            Self::Normal(Normal { mean, deviation, low, high }) => {
                let is_wide = (high - low) > std::f64::consts::TAU.sqrt() * deviation;
                for _ in 0..TRIALS_MAX {
                    let value = if is_wide {
                        mean + deviation * stream.normal()
                    } else {
                        low + stream.unit() * (high - low)
                    };
                    let density = (-0.5 * ((value - mean) / deviation).powi(2)).exp();
                    let accepted = is_wide || stream.unit() < density;
                    if accepted && (*low..=*high).contains(&value) {
                        return value;
                    }
                }
                // Once in 10^292 draws.
                *mean
            }
        }
    }

    /// Draws a whole number; the ends of a range must be whole.
    pub fn sample_whole(&self, stream: &mut SplitMix) -> f64 {
        match self {
            Self::Uniform(Uniform { low, high }) => {
                (low + (stream.unit() * (high - low + 1.0)).floor()).min(*high)
            }
            Self::Normal(_) | Self::Choice(_) => self.sample(stream).round(),
        }
    }
}

/// A number for a text: Fowler, Noll and Vo's hash 1a, 64 bits.
fn fnv_1a(text: &str) -> u64 {
    let offset = 0xcbf2_9ce4_8422_2325_u64;
    text.bytes().fold(offset, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
}
