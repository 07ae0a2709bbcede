//! The coils' coefficients from measurements of the field: eq. (4)-(5), with what a user must know to trust
//! them.
//!
//! **Problem.** Eq. (5) gives coefficients for any file and any order, and says nothing of how good they are.
//! A fit is of use once the file is known to mean what it says, the order is as high as the data bear and no
//! higher, every coefficient has a standard deviation, and it is known how near to the coil the series may be
//! used.
//!
//! **Terms.**
//!
//! | word | meaning |
//! |---|---|
//! | reading | one measured field, with the place of the probe and the current in every coil |
//! | order P | number of terms of the series (4) |
//! | unknowns n | P coefficients a coil, and one origin a coil where origins are fitted |
//! | RMS norm | norm over the components of the RMS residual: `sqrt(sum of squares / number of readings)` |
//! | hold-out | RMS norm of readings that were left out of the fit |
//! | origin | local x of the expansion point, from where the pose says that it is |
//!
//! **Method.**
//! - `readings`, `parse`: two layouts of CSV, to SI; every refusal names line, column, value and what would
//!   be right.
//! - `plausible`: finds units that were mixed up, before they become coefficients.
//! - `design`: the rows of eq. (5), all coils and all components side by side: superposed currents separate
//!   into coils by themselves.
//! - `triangle`: least squares by the triangular factor, joined from factors of parts, so that leaving parts
//!   out costs little.
//! - `origin`: expansion points along the axes, by Gauss-Newton on what the coefficients leave.
//! - `scan`, `regions`, `found`: every order with hold-out, by interleaved folds and by regions; the choice
//!   of the order.
//! - `range`: how near to the coil the series may be used.
//!
//! **Source.** Richter, Venkiteswaran, Misra, IEEE RA-L 6(2), 2021, eqs. (4)-(5) and Fig. 3; the choice of
//! the order follows the one-standard-error rule (Hastie, Tibshirani, Friedman: The Elements of Statistical
//! Learning, 2nd ed., section 7.10), with paired differences and two standard errors.
//!
//! What is absent: files, and a field of the surroundings; a probe is taken to have been set to zero without
//! currents.

mod design;
mod error;
mod found;
mod origin;
mod parse;
mod plausible;
mod range;
mod readings;
mod regions;
mod scan;
mod triangle;

pub use crate::math::csv::Refusal;
pub use error::FitError;
pub use found::{CoilFit, FieldFit, FitRequest, OrderChoice, OrderReport, RegionReport};
pub use parse::{ARRAY_COLUMNS, COIL_COLUMNS, parse};
pub use plausible::{Expectation, check_units};
pub use range::ValidRange;
pub use readings::{Layout, Reading, Readings};
pub use scan::fit;
