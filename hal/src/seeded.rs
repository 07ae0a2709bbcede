//! Seeded numbers: Steele, Lea and Flood's SplitMix64, 2014.

/// A sequence of numbers that its seed repeats bit for bit.
#[derive(Debug, Clone)]
pub(crate) struct Seeded(u64);

impl Seeded {
    pub(crate) const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// One of the independent sequences of a seed, by its number.
    pub(crate) const fn stream(seed: u64, number: u64) -> Self {
        let mut numbers = Self::new(number);
        Self::new(seed ^ numbers.bits())
    }

    /// A sequence of its own, that this one's next number begins.
    pub(crate) const fn fork(&mut self) -> Self {
        Self::new(self.bits())
    }

    pub(crate) const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// Uniform in [0, 1).
    #[expect(clippy::cast_precision_loss, reason = "53 bits fit an f64 exactly")]
    pub(crate) const fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [-`limit`, `limit`).
    pub(crate) const fn within(&mut self, limit: f64) -> f64 {
        (2.0 * self.unit() - 1.0) * limit
    }

    /// One of `0..count`.
    #[cfg(test)]
    pub(crate) const fn below(&mut self, count: u64) -> u64 {
        self.bits() % count
    }
}
