//! As many columns, or coils, together as the processor that the program is built for has room for.
//!
//! A build for any x86-64 or ARMv8 processor works on a [`Pair`]. One that may rely on AVX and FMA
//! (`RUSTFLAGS="-C target-cpu=x86-64-v3"`, or `native` on the machine that runs it) works on a [`Quad`]: half as many
//! instructions, and fewer again where a product and a sum become one instruction with one rounding. Chosen when
//! building: a processor's abilities cannot change the numbers of a program while it runs.

use core::ops::{Add, Mul, Neg, Sub};

use wide::f64x4;

use super::pair::Pair;
use super::triple::{Scalar, Triple};

/// True when a product and a sum are one instruction.
pub(super) const FUSED: bool = cfg!(all(target_arch = "x86_64", target_feature = "fma"));

/// What the columns of a transition travel in.
#[cfg(all(target_arch = "x86_64", target_feature = "avx"))]
pub type Lanes = Quad;
/// What the columns of a transition travel in.
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx")))]
pub type Lanes = Pair;

/// Numbers of one sort, worked on together.
pub trait Columnar: Scalar {
    /// How many pairs they are.
    const PAIRS: usize;
    /// How many numbers they are.
    const WIDTH: usize = 2 * Self::PAIRS;

    /// The same number in all lanes.
    fn splat(number: f64) -> Self;

    /// Some pairs; zero past the last.
    fn of_pairs(pairs: &[Pair]) -> Self;

    /// One of the pairs.
    fn pair(self, index: usize) -> Pair;

    /// One of the numbers.
    fn lane(self, lane: usize) -> f64;

    /// Replaces one of the numbers.
    fn set_lane(&mut self, lane: usize, number: f64);

    /// `1 / sqrt(self)`.
    #[must_use]
    fn inverse_sqrt(self) -> Self;
}

impl Columnar for Pair {
    const PAIRS: usize = 1;

    #[inline(always)]
    fn splat(number: f64) -> Self {
        Pair::splat(number)
    }

    #[inline(always)]
    fn of_pairs(pairs: &[Pair]) -> Self {
        pairs.first().copied().unwrap_or_default()
    }

    #[inline(always)]
    fn pair(self, _index: usize) -> Pair {
        self
    }

    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        Pair::lane(self, lane)
    }

    #[inline(always)]
    fn set_lane(&mut self, lane: usize, number: f64) {
        Pair::set_lane(self, lane, number);
    }

    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        Pair::inverse_sqrt(self)
    }
}

/// Four numbers, worked on together.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Quad(f64x4);

impl Columnar for Quad {
    const PAIRS: usize = 2;

    #[inline(always)]
    fn splat(number: f64) -> Self {
        Self(f64x4::splat(number))
    }

    #[inline(always)]
    fn of_pairs(pairs: &[Pair]) -> Self {
        let of = |index: usize| pairs.get(index).copied().unwrap_or_default();
        let (first, second) = (of(0), of(1));
        Self(f64x4::new([first.low(), first.high(), second.low(), second.high()]))
    }

    #[inline(always)]
    fn pair(self, index: usize) -> Pair {
        let [a, b, c, d] = self.0.to_array();
        if index == 0 { Pair::new(a, b) } else { Pair::new(c, d) }
    }

    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        self.0.to_array()[lane]
    }

    #[inline(always)]
    fn set_lane(&mut self, lane: usize, number: f64) {
        self.0.as_mut_array()[lane] = number;
    }

    #[inline(always)]
    fn inverse_sqrt(self) -> Self {
        Self(f64x4::splat(1.0) / self.0.sqrt())
    }
}

impl Scalar for Quad {
    const FUSED: bool = FUSED;

    #[inline(always)]
    fn times_plus(self, factor: Self, sum: Self) -> Self {
        Self(self.0.mul_add(factor.0, sum.0))
    }

    #[inline(always)]
    fn times_from(self, factor: Self, sum: Self) -> Self {
        Self(self.0.mul_neg_add(factor.0, sum.0))
    }
}

impl Add for Quad {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Quad {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Mul for Quad {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0)
    }
}

impl Neg for Quad {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Triple {
    /// The vector in every column.
    #[inline(always)]
    #[must_use]
    pub fn in_all<V: Columnar>(self) -> Triple<V> {
        Triple { x: V::splat(self.x), y: V::splat(self.y), z: V::splat(self.z) }
    }
}

impl<V: Columnar> Triple<V> {
    /// Columns out of pairs of columns; zero past the last.
    #[inline(always)]
    #[must_use]
    pub fn of_pairs<const P: usize>(pairs: [Triple<Pair>; P]) -> Self {
        Self {
            x: V::of_pairs(&pairs.map(|pair| pair.x)),
            y: V::of_pairs(&pairs.map(|pair| pair.y)),
            z: V::of_pairs(&pairs.map(|pair| pair.z)),
        }
    }

    /// One of the columns.
    #[inline(always)]
    #[must_use]
    pub fn column(self, lane: usize) -> Triple {
        Triple { x: self.x.lane(lane), y: self.y.lane(lane), z: self.z.lane(lane) }
    }

    /// Replaces one of the columns.
    #[inline(always)]
    pub fn set_column(&mut self, lane: usize, column: Triple) {
        self.x.set_lane(lane, column.x);
        self.y.set_lane(lane, column.y);
        self.z.set_lane(lane, column.z);
    }

    /// One pair of the columns.
    #[inline(always)]
    #[must_use]
    pub fn pair(self, index: usize) -> Triple<Pair> {
        Triple { x: self.x.pair(index), y: self.y.pair(index), z: self.z.pair(index) }
    }
}

#[cfg(test)]
mod tests {
    use super::{Columnar, Pair, Quad, Scalar, Triple};

    #[test]
    fn four_columns_undergo_the_arithmetic_of_two_pairs() {
        let (a, b) = (Pair::new(2.0, -3.0), Pair::new(0.5, 7.0));
        let (c, d) = (Pair::new(1.5, 4.0), Pair::new(-8.0, 0.25));
        let (left, right) = (Quad::of_pairs(&[a, b]), Quad::of_pairs(&[c, d]));
        let both = |quad: Quad| [quad.pair(0), quad.pair(1)];
        assert_eq!(both(left + right), [a + c, b + d]);
        assert_eq!(both(left - right), [a - c, b - d]);
        assert_eq!(both(left * right), [a * c, b * d]);
        assert_eq!(both(-left), [-a, -b]);
        // Every product here is exact, so that one rounding and two agree.
        assert_eq!(both(left.times_plus(right, left)), [a * c + a, b * d + b]);
        assert_eq!(both(left.times_from(right, left)), [a - a * c, b - b * d]);
        assert_eq!(a.times_plus(c, d), a * c + d);
        assert_eq!(a.times_from(c, d), d - a * c);
        assert_eq!(both(Quad::splat(3.0)), [Pair::splat(3.0); 2]);
        assert_eq!(both(Quad::of_pairs(&[a])), [a, Pair::default()]);
        assert_eq!(
            both(Quad::of_pairs(&[c * c, d * d]).inverse_sqrt()),
            [c * c, d * d].map(Pair::inverse_sqrt)
        );
        assert_eq!([0, 1, 2, 3].map(|lane| left.lane(lane)), [2.0, -3.0, 0.5, 7.0]);
        let (mut four, mut two) = (left, a);
        four.set_lane(2, 9.0);
        Columnar::set_lane(&mut two, 1, 9.0);
        assert_eq!((both(four), two), ([a, Pair::new(9.0, 7.0)], Pair::new(2.0, 9.0)));
        assert_eq!(Columnar::lane(a, 1), -3.0);
        assert_eq!((Pair::WIDTH, Quad::WIDTH), (2, 4));
    }

    #[test]
    fn vectors_are_taken_apart_into_the_pairs_they_were_made_of() {
        let pairs = [
            Triple::new(Pair::new(1.0, 2.0), Pair::new(3.0, 4.0), Pair::new(5.0, 6.0)),
            Triple::new(Pair::new(-1.0, 0.5), Pair::new(7.0, 8.0), Pair::new(0.0, 9.0)),
        ];
        let quad: Triple<Quad> = Triple::of_pairs(pairs);
        assert_eq!([quad.pair(0), quad.pair(1)], pairs);
        let one: Triple<Pair> = Triple::of_pairs([pairs[1]]);
        assert_eq!(one.pair(0), pairs[1]);
        assert_eq!(quad.column(2), Triple::new(-1.0, 7.0, 0.0));
        let mut replaced = quad;
        replaced.set_column(2, Triple::new(4.0, 5.0, 6.0));
        assert_eq!((replaced.column(2), replaced.column(1)), (Triple::new(4.0, 5.0, 6.0), quad.column(1)));
        assert_eq!(Triple::new(1.0, 2.0, 3.0).in_all::<Quad>().pair(1), Triple::new(1.0, 2.0, 3.0).splat());
    }
}
