//! Layer math: arithmetic without physics.
//!
//! - [`Pair`]: two numbers that a processor works on together; columns of sensitivities travel in pairs.
//! - [`Triple`]: a vector in space over numbers or over pairs, so that one formula serves a state and its variations.
//! - [`Lu`]: a small dense linear system, solved without allocation.

mod lu;
mod pair;
mod triple;

pub use lu::{Lu, PIVOT_MIN, Singular};
pub use pair::Pair;
pub use triple::{Scalar, Triple};
