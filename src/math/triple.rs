//! A vector in space over any scalar: a number, or a [`Pair`] of columns.

use core::ops::{Add, Mul, Neg, Sub};

use nalgebra::Vector3;

use super::lanes::FUSED;
use super::pair::Pair;

/// What a [`Triple`] can be made of.
pub trait Scalar:
    Copy + Default + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// True when [`Self::times_plus`] and [`Self::times_from`] are one instruction, with one rounding.
    const FUSED: bool;

    /// `self factor + sum`.
    fn times_plus(self, factor: Self, sum: Self) -> Self;

    /// `sum - self factor`.
    fn times_from(self, factor: Self, sum: Self) -> Self;
}

impl Scalar for f64 {
    const FUSED: bool = FUSED;

    #[inline(always)]
    fn times_plus(self, factor: Self, sum: Self) -> Self {
        // Without the instruction, `mul_add` is a slow call.
        if FUSED { self.mul_add(factor, sum) } else { self * factor + sum }
    }

    #[inline(always)]
    fn times_from(self, factor: Self, sum: Self) -> Self {
        if FUSED { (-self).mul_add(factor, sum) } else { sum - self * factor }
    }
}

/// A vector in space.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Triple<T = f64> {
    /// First component.
    pub x: T,
    /// Second component.
    pub y: T,
    /// Third component.
    pub z: T,
}

impl<T: Scalar> Triple<T> {
    /// The vector (`x`, `y`, `z`).
    #[inline(always)]
    #[must_use]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self { x, y, z }
    }

    /// Cross product `self x other`.
    #[inline(always)]
    #[must_use]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.z.times_from(other.y, self.y * other.z),
            y: self.x.times_from(other.z, self.z * other.x),
            z: self.y.times_from(other.x, self.x * other.y),
        }
    }

    /// `sum + self x other`.
    #[inline(always)]
    #[must_use]
    pub fn cross_plus(self, other: Self, sum: Self) -> Self {
        if !T::FUSED {
            return sum + self.cross(other);
        }
        Self {
            x: self.z.times_from(other.y, self.y.times_plus(other.z, sum.x)),
            y: self.x.times_from(other.z, self.z.times_plus(other.x, sum.y)),
            z: self.y.times_from(other.x, self.x.times_plus(other.y, sum.z)),
        }
    }

    /// Dot product.
    #[inline(always)]
    #[must_use]
    pub fn dot(self, other: Self) -> T {
        self.z.times_plus(other.z, self.y.times_plus(other.y, self.x * other.x))
    }

    /// Every component times `factor`.
    #[inline(always)]
    #[must_use]
    pub fn scaled(self, factor: T) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// The components in order.
    #[inline(always)]
    #[must_use]
    pub fn array(self) -> [T; 3] {
        [self.x, self.y, self.z]
    }
}

impl Triple {
    /// The vector in both columns of a pair.
    #[inline(always)]
    #[must_use]
    pub fn splat(self) -> Triple<Pair> {
        Triple { x: Pair::splat(self.x), y: Pair::splat(self.y), z: Pair::splat(self.z) }
    }

    /// Length.
    #[inline(always)]
    #[must_use]
    pub fn norm(self) -> f64 {
        self.dot(self).sqrt()
    }
}

impl Triple<Pair> {
    /// Columns `low` and `high`.
    #[inline(always)]
    #[must_use]
    pub fn of_columns(low: Triple, high: Triple) -> Self {
        Self { x: Pair::new(low.x, high.x), y: Pair::new(low.y, high.y), z: Pair::new(low.z, high.z) }
    }
}

impl<T: Scalar> Add for Triple<T> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<T: Scalar> Sub for Triple<T> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<T: Scalar> Neg for Triple<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl From<[f64; 3]> for Triple {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

impl From<Vector3<f64>> for Triple {
    #[inline(always)]
    fn from(vector: Vector3<f64>) -> Self {
        Self { x: vector.x, y: vector.y, z: vector.z }
    }
}

impl From<Triple> for Vector3<f64> {
    #[inline(always)]
    fn from(triple: Triple) -> Self {
        Self::new(triple.x, triple.y, triple.z)
    }
}

#[cfg(test)]
mod tests {
    use super::{Pair, Triple};

    #[test]
    fn cross_product_is_orthogonal_to_both_factors_and_right_handed() {
        let (a, b) = (Triple::new(1.0, -2.0, 0.5), Triple::new(0.3, 4.0, -1.0));
        let c = a.cross(b);
        assert!(c.dot(a).abs() < 1e-14 && c.dot(b).abs() < 1e-14);
        let (x, y) = (Triple::new(1.0, 0.0, 0.0), Triple::new(0.0, 1.0, 0.0));
        assert_eq!(x.cross(y), Triple::new(0.0, 0.0, 1.0));
    }

    #[test]
    fn a_pair_of_columns_undergoes_the_arithmetic_of_each() {
        let (a, b, c) =
            (Triple::new(1.0, -2.0, 0.5), Triple::new(0.3, 4.0, -1.0), Triple::new(-0.7, 0.1, 2.0));
        let both = Triple::of_columns(a, b).cross(c.splat());
        let expected = Triple::of_columns(a.cross(c), b.cross(c));
        assert_eq!(both, expected);
        assert_eq!(Triple::of_columns(a, b).dot(c.splat()), Pair::new(a.dot(c), b.dot(c)));
    }
}
