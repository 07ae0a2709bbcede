//! Why readings give no coefficients.

use thiserror::Error;

/// Readings that cannot be fitted as asked.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    /// There are no more equations than unknowns.
    #[error(
        "{readings} readings give {equations} equations for {unknowns} unknowns of order {order}: must be at least {least} readings"
    )]
    TooFew {
        /// Order that was to be fitted.
        order: usize,
        /// Readings given.
        readings: usize,
        /// Three a reading.
        equations: usize,
        /// Coefficients and origins to find.
        unknowns: usize,
        /// Readings that would do.
        least: usize,
    },
    /// A coil carries no current in any reading.
    #[error("coil {coil} carries no current in any reading: must be driven in some")]
    Undriven {
        /// Index of the coil.
        coil: usize,
    },
    /// The readings do not tell the terms of the series apart.
    #[error(
        "the readings do not determine a{term} of coil {coil} at order {order}: must be spread over more places, or the order lower"
    )]
    Undetermined {
        /// Order that was to be fitted.
        order: usize,
        /// Index of the coil that stands out in what the readings do not see.
        coil: usize,
        /// Its term k.
        term: usize,
    },
    /// The readings do not say where along its axis a coil's expansion point is.
    #[error(
        "the readings do not determine the origin of coil {coil} at order {order} ({reason}): must be spread over more places, or the order lower"
    )]
    OriginUndetermined {
        /// Order that was to be fitted.
        order: usize,
        /// Index of the coil.
        coil: usize,
        /// What came of the search.
        reason: &'static str,
    },
}
