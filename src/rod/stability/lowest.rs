//! The lowest eigenvalue, by inverse iteration whose shift closes in from below.
//!
//! Factors of `A - sigma E` that count no eigenvalue below `sigma` make inverse iteration, `y = (A - sigma
//! E)^-1 E x`, turn towards the weakest mode. Its Rayleigh quotient and residual,
//! ```text
//! lambda = sigma + x E y / y E y,   r^2 = (1 - (x E y)^2 / (x E x y E y)) x E x / y E y                (z7)
//! ```
//! bound the lowest eigenvalue from above and leave one within `r`: the next shift is put at `lambda - r`,
//! and the count says whether that lies below all of them. Convergence is quadratic. The mode found last
//! starts the next search, which then takes one or two factorisations.

use super::chain::Chain;
use super::measure::Stability;

/// Norm of an eigenvalue's residual at which it is taken. The eigenvalue errs by its square over the gap to
/// the next one, and by no more than the norm itself.
const RESIDUAL: f64 = 1e-6;
/// Greatest distance of the value taken from the shift, below which there is no eigenvalue: when two modes
/// change places the lower one shows at the latest then.
const SURE: f64 = 2e-3;
/// How far below the last value the search begins.
const SLACK: f64 = 1e-3;
/// Greatest residual, as a share of the distance to the shift, at which a closer shift is tried: a
/// factorisation takes as long as four iterations, and one in vain as well.
const CLEAR: f64 = 0.1;
/// Most factorisations of one search.
const FACTORS_MAX: u32 = 60;
/// Most inverse iterations of one search.
const ITERATIONS_MAX: u32 = 100;

/// An approximate eigenvalue.
#[derive(Clone, Copy)]
struct Ritz {
    value: f64,
    residual: f64,
}

impl Chain {
    /// Number of modes that are not stable, and the lowest eigenvalue.
    pub(super) fn measure(&mut self) -> Stability {
        self.lowest = self.find_lowest();
        let unstable_modes = match self.lowest {
            Some(lowest) if lowest > SURE => 0,
            _ => self.factor(0.0),
        };
        let margin = match (self.lowest, unstable_modes) {
            (None, _) => f64::NAN,
            // The continuous rod has eigenvalues as close to 1 as one likes.
            (Some(lowest), 0) => lowest.clamp(0.0, 1.0),
            // A value is never below the eigenvalue: rounding must not contradict the count.
            (Some(lowest), _) => lowest.min(0.0),
        };
        Stability { unstable_modes, margin }
    }

    fn find_lowest(&mut self) -> Option<f64> {
        let mut factors = 0;
        let mut shift = self.begin(&mut factors)?;
        let mut best = None;
        for _ in 0..ITERATIONS_MAX {
            let Ritz { value, residual } = self.iterate(shift);
            if !value.is_finite() {
                return None;
            }
            best = Some(value);
            let sure = value - shift <= SURE;
            if residual <= RESIDUAL && sure {
                break;
            }
            if !sure && residual <= CLEAR * (value - shift) {
                let closer = value - residual.max(0.5 * SURE);
                shift = self.close_in(shift, closer, &mut factors)?;
            }
        }
        best
    }

    /// A shift below all eigenvalues, with its factors, and a mode to begin with.
    fn begin(&mut self, factors: &mut u32) -> Option<f64> {
        let mut shift = match self.lowest {
            Some(lowest) => lowest - SLACK,
            None => {
                self.start_anew();
                0.0
            }
        };
        let mut stride = 1.0;
        while self.counted(shift, factors)? > 0 {
            shift = if shift > 0.0 { 0.0 } else { shift - stride };
            stride *= 2.0;
        }
        if stride > 1.0 && self.lowest.is_some() {
            // Lost its track: another mode may have become the weakest one.
            self.stir();
        }
        self.normalise();
        Some(shift)
    }

    /// One inverse iteration (z7); leaves the new mode, of unit energy.
    fn iterate(&mut self, shift: f64) -> Ritz {
        let products = self.invert();
        let norm = 1.0 / products.image.sqrt();
        let cosine = products.mixed * norm;
        self.adopt(norm);
        Ritz { value: shift + cosine * norm, residual: norm * (1.0 - cosine * cosine).max(0.0).sqrt() }
    }

    /// The shift `closer`, or one between, that still has no eigenvalue below it.
    fn close_in(&mut self, shift: f64, closer: f64, factors: &mut u32) -> Option<f64> {
        let mut trial = closer;
        while self.counted(trial, factors)? > 0 {
            // Some eigenvalue hides below the one that the mode was about to settle on.
            self.stir();
            self.normalise();
            trial = 0.5 * (trial + shift);
        }
        Some(trial)
    }

    fn normalise(&mut self) {
        let norm = self.energy().sqrt();
        self.scale(1.0 / norm);
    }

    fn counted(&mut self, shift: f64, factors: &mut u32) -> Option<u32> {
        *factors += 1;
        (*factors <= FACTORS_MAX).then(|| self.factor(shift))
    }
}
