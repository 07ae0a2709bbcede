//! Two `f64` worked on together.
//!
//! Columns of a sensitivity matrix undergo the same arithmetic, and so do the coils of an array. Packing two of them into one register
//! halves the instructions on every x86-64 and ARMv8 processor, without asking for a newer one. Left to itself, the
//! compiler packs unlike operations of one coil together and loses more to shuffles than it gains.

use core::ops::{Add, AddAssign, Mul, Neg, Sub};

use wide::f64x2;

use super::lanes::FUSED;
use super::triple::Scalar;

/// Two numbers, the low one first.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pair(f64x2);

impl Pair {
    /// `low` and `high`.
    #[inline(always)]
    #[must_use]
    pub fn new(low: f64, high: f64) -> Self {
        Self(f64x2::new([low, high]))
    }

    /// `both` twice.
    #[inline(always)]
    #[must_use]
    pub fn splat(both: f64) -> Self {
        Self(f64x2::splat(both))
    }

    /// The first number.
    #[inline(always)]
    #[must_use]
    pub fn low(self) -> f64 {
        self.0.to_array()[0]
    }

    /// The second number.
    #[inline(always)]
    #[must_use]
    pub fn high(self) -> f64 {
        self.0.to_array()[1]
    }

    /// The number of a lane, 0 or 1.
    #[inline(always)]
    #[must_use]
    pub fn lane(self, lane: usize) -> f64 {
        if lane == 0 { self.low() } else { self.high() }
    }

    /// Replaces the number of a lane, 0 or 1.
    #[inline(always)]
    pub fn set_lane(&mut self, lane: usize, value: f64) {
        self.0.as_mut_array()[lane] = value;
    }

    /// `1 / sqrt(self)`.
    #[inline(always)]
    #[must_use]
    pub fn inverse_sqrt(self) -> Self {
        Self(f64x2::splat(1.0) / self.0.sqrt())
    }

    /// The first number twice.
    #[inline(always)]
    #[must_use]
    pub fn splat_low(self) -> Self {
        Self::splat(self.low())
    }

    /// The second number twice.
    #[inline(always)]
    #[must_use]
    pub fn splat_high(self) -> Self {
        Self::splat(self.high())
    }
}

impl Scalar for Pair {
    const FUSED: bool = FUSED;

    #[inline(always)]
    fn times_plus(self, factor: Self, sum: Self) -> Self {
        if FUSED { Self(self.0.mul_add(factor.0, sum.0)) } else { self * factor + sum }
    }

    #[inline(always)]
    fn times_from(self, factor: Self, sum: Self) -> Self {
        if FUSED { Self(self.0.mul_neg_add(factor.0, sum.0)) } else { sum - self * factor }
    }
}

impl Add for Pair {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Pair {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Pair {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Mul<f64> for Pair {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        self * Self::splat(factor)
    }
}

impl Neg for Pair {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl AddAssign for Pair {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

#[cfg(test)]
mod tests {
    use super::Pair;

    #[test]
    fn lanes_never_mix() {
        let (a, b) = (Pair::new(2.0, -3.0), Pair::new(0.5, 7.0));
        assert_eq!(a + b, Pair::new(2.5, 4.0));
        assert_eq!(a - b, Pair::new(1.5, -10.0));
        assert_eq!(a * b, Pair::new(1.0, -21.0));
        assert_eq!(-a, Pair::new(-2.0, 3.0));
        assert_eq!(a.splat_low(), Pair::splat(2.0));
        assert_eq!(a.splat_high(), Pair::splat(-3.0));
        assert_eq!((a.low(), a.high()), (2.0, -3.0));
        assert_eq!((a.lane(0), a.lane(1)), (2.0, -3.0));
        assert_eq!(a * 2.0, Pair::new(4.0, -6.0));
        assert_eq!(Pair::new(4.0, 0.25).inverse_sqrt(), Pair::new(0.5, 2.0));
        let mut changed = a;
        changed.set_lane(1, 5.0);
        assert_eq!(changed, Pair::new(2.0, 5.0));
    }
}
