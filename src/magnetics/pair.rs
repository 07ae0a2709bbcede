//! Two numbers side by side.
//!
//! The field's kernel works on two coils at once: its arithmetic has no branch, so two lanes fill the
//! two-wide vector registers that every x86-64 and AArch64 machine has. Coil by coil, the compiler packs
//! unlike operations together and loses more to shuffles than it gains.

use std::ops::{Add, Mul, Sub};

/// One value for each of two coils; arithmetic acts on both.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(align(16))]
pub(super) struct Pair(pub(super) [f64; 2]);

impl Pair {
    /// The same value in both lanes.
    #[inline(always)]
    pub(super) fn splat(value: f64) -> Self {
        Self([value; 2])
    }

    /// `1 / sqrt(self)`.
    #[inline(always)]
    pub(super) fn inverse_sqrt(self) -> Self {
        let root = [self.0[0].sqrt(), self.0[1].sqrt()];
        Self([1.0 / root[0], 1.0 / root[1]])
    }
}

impl Add for Pair {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self([self.0[0] + other.0[0], self.0[1] + other.0[1]])
    }
}

impl Sub for Pair {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self([self.0[0] - other.0[0], self.0[1] - other.0[1]])
    }
}

impl Mul for Pair {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self([self.0[0] * other.0[0], self.0[1] * other.0[1]])
    }
}

impl Mul<f64> for Pair {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f64) -> Self {
        Self([self.0[0] * factor, self.0[1] * factor])
    }
}
