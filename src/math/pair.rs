//! Two `f64` worked on together.
//!
//! Columns of a sensitivity matrix undergo the same arithmetic. Packing two of them into one register
//! halves the instructions on every x86-64 and ARMv8 processor, without asking for a newer one.

use core::ops::{Add, AddAssign, Mul, Neg, Sub};

use wide::f64x2;

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
    }
}
