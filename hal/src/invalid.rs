//! What is wrong with a configured value: where it stands, what it is, and what would be right.

use std::fmt::Display;

use crate::unit_slip;

/// One refused value of a configuration.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{key} = {value}: must be {expected}")]
pub struct Invalid {
    /// Path of the key from the root of the configuration, as `coils[2].distance_mm`.
    pub key: String,
    /// The value found.
    pub value: String,
    /// The values that would have been accepted, as "finite and > 0".
    pub expected: String,
}

/// Collects every refused value of a configuration, so that a user mends them in one go.
#[derive(Debug, Default)]
pub struct Checks {
    found: Vec<Invalid>,
}

impl Checks {
    /// Starts with nothing refused.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Refuses `value` at `key` unless `holds`.
    pub fn require(
        &mut self,
        holds: bool,
        key: impl Into<String>,
        value: impl Display,
        expected: impl Into<String>,
    ) {
        if !holds {
            self.found.push(Invalid { key: key.into(), value: value.to_string(), expected: expected.into() });
        }
    }

    /// Refuses a value that is not finite and greater than zero.
    pub fn positive(&mut self, key: impl Into<String>, value: f64) {
        self.require(value.is_finite() && value > 0.0, key, value, "finite and > 0");
    }

    /// Refuses a value outside `[least, most]`, both ends allowed. Where the key ends in a unit of which the
    /// value may have been given in another, the refusal says so.
    pub fn within(&mut self, key: impl Into<String>, value: f64, least: f64, most: f64) {
        let key = key.into();
        let holds = value.is_finite() && value >= least && value <= most;
        let slip = unit_slip::hint(&key, value, least, most);
        self.require(holds, key, value, format!("from {least} to {most}{slip}"));
    }

    /// The same for a quantity that may be absent: zero is allowed too.
    pub fn zero_or_within(&mut self, key: impl Into<String>, value: f64, least: f64, most: f64) {
        let key = key.into();
        let holds = value == 0.0 || (value.is_finite() && value >= least && value <= most);
        let slip = unit_slip::hint(&key, value, least, most);
        self.require(holds, key, value, format!("0, or from {least} to {most}{slip}"));
    }

    /// Refuses a vector that is longer than `most`, or with a component that is not finite.
    pub fn length_within(&mut self, key: impl Into<String>, vector: &[f64; 3], most: f64) {
        let key = key.into();
        let length = vector.iter().map(|component| component * component).sum::<f64>().sqrt();
        let slip = unit_slip::hint(&key, length, 0.0, most);
        let expected = format!("finite in every component, and at most {most} in length{slip}");
        self.require(length <= most, key, format!("{vector:?}"), expected);
    }

    /// Refuses a vector with a component that is not finite.
    pub fn finite(&mut self, key: impl Into<String>, values: &[f64]) {
        let holds = values.iter().all(|value| value.is_finite());
        self.require(holds, key, format!("{values:?}"), "finite in every component");
    }

    /// Takes over what another collection refused.
    pub fn extend(&mut self, others: Vec<Invalid>) {
        self.found.extend(others);
    }

    /// `value` when nothing was refused, else everything that was.
    ///
    /// # Errors
    /// Every refused value, in the order in which they were checked.
    pub fn into_result<T>(self, value: T) -> Result<T, Vec<Invalid>> {
        if self.found.is_empty() { Ok(value) } else { Err(self.found) }
    }

    /// True when nothing was refused so far.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.found.is_empty()
    }
}
