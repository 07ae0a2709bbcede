//! The noise of tangents and positions: stated, or what a fit leaves.
//!
//! Deviations that are not stated are taken from the residuals: at first from their median, which half the
//! data cannot spoil, in the end from the squares of all blocks that are no outliers, over their degrees of
//! freedom. What the model cannot follow counts as noise.

use super::sample::Quantity;

/// Deviations to start from when they are estimated: a coarse tracker's. rad, m.
const START: [f64; 2] = [0.01, 1e-3];
/// Least deviations, far below any sensor's: below, the prior would drown in rounding. rad, m.
const LEAST: [f64; 2] = [1e-6, 1e-7];
/// Median of the square of a normal vector with two and with three components of deviation 1 (chi-square).
const MEDIAN_SQUARE: [f64; 2] = [1.386_294, 2.365_974];

/// A deviation that is stated or to be estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseLevel {
    /// Known, rad or m, > 0.
    Stated(f64),
    /// From what the fit leaves.
    Estimated,
}

/// Standard deviations of the sensor's noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Of each of the two tilts of a tangent, rad.
    pub orientation: NoiseLevel,
    /// Of each coordinate of a position, m.
    pub position: NoiseLevel,
}

impl Quantity {
    pub(super) fn index(self) -> usize {
        match self {
            Self::Tangent => 0,
            Self::Position => 1,
        }
    }

    /// Rows of a block.
    pub(super) fn rows(self) -> usize {
        match self {
            Self::Tangent => 2,
            Self::Position => 3,
        }
    }
}

/// One block's residual in SI, and whether it is an outlier now.
#[derive(Debug, Clone, Copy)]
pub(super) struct Left {
    pub quantity: Quantity,
    /// Its norm, rad or m.
    pub norm: f64,
    pub is_outlier: bool,
}

/// Deviations in use.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Deviations {
    stated: [Option<f64>; 2],
    pub values: [f64; 2],
}

impl Deviations {
    pub fn new(noise: &Noise) -> Self {
        let stated = [noise.orientation, noise.position].map(|level| match level {
            NoiseLevel::Stated(value) => Some(value),
            NoiseLevel::Estimated => None,
        });
        let values = core::array::from_fn(|index| stated[index].unwrap_or(START[index]));
        Self { stated, values }
    }

    /// From the medians of the blocks, and no less than what is stated: while the model is still far off,
    /// all blocks would be outliers, of which a fit finds its way slowly.
    pub fn by_medians(&self, left: &[Left]) -> Self {
        self.with(|index, quantity| {
            let mut squares: Vec<f64> =
                left.iter().filter(|left| left.quantity == quantity).map(|left| left.norm.powi(2)).collect();
            squares.sort_by(f64::total_cmp);
            let median = squares.get(squares.len() / 2).map_or(0.0, |median| median / MEDIAN_SQUARE[index]);
            median.sqrt().max(self.stated[index].unwrap_or(LEAST[index]))
        })
    }

    /// What is stated, and the rest from the squares of all but outliers; `taken` are the degrees of
    /// freedom that the parameters took of each sort.
    pub fn by_squares(&self, left: &[Left], taken: [f64; 2]) -> Self {
        self.with(|index, quantity| {
            if let Some(stated) = self.stated[index] {
                return stated;
            }
            let kept = || left.iter().filter(|left| left.quantity == quantity && !left.is_outlier);
            let freedom = (kept().count() * quantity.rows()) as f64 - taken[index];
            let squares: f64 = kept().map(|left| left.norm.powi(2)).sum();
            if freedom > 0.0 { (squares / freedom).sqrt().max(LEAST[index]) } else { self.values[index] }
        })
    }

    fn with(&self, estimate: impl Fn(usize, Quantity) -> f64) -> Self {
        let values =
            [Quantity::Tangent, Quantity::Position].map(|quantity| estimate(quantity.index(), quantity));
        Self { values, ..*self }
    }

    /// Greatest relative difference.
    pub fn change(&self, other: &Self) -> f64 {
        self.values
            .iter()
            .zip(&other.values)
            .map(|(one, other)| (one / other - 1.0).abs())
            .fold(0.0, f64::max)
    }
}
