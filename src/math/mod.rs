//! Numerical tools of the layers above: no physics. Those that a control cycle uses allocate nothing in use.

mod bounded_least_squares;
pub mod csv;
mod lanes;
mod lu;
mod pair;
mod sphere;
mod splitmix;
pub mod statistics;
mod thin_svd;
mod triple;

pub use bounded_least_squares::{BoundedLeastSquares, BoundedProblem, BoundedReport};
pub use lanes::{Columnar, Lanes, Quad};
pub use lu::{Lu, Singular};
pub use pair::Pair;
pub use sphere::{along_great_circle, angle_between, logarithm, orthonormal_complement, transported_basis};
pub use splitmix::{SplitMix, scramble};
pub use thin_svd::ThinSvd;
pub use triple::{Scalar, Triple};
