//! Numerical tools of the layers above, without allocation in use: no physics.

mod bounded_least_squares;
mod lu;
mod pair;
mod sphere;
mod thin_svd;
mod triple;

pub use bounded_least_squares::{BoundedLeastSquares, BoundedProblem, BoundedReport};
pub use lu::{Lu, Singular};
pub use pair::Pair;
pub use sphere::{angle_between, logarithm, orthonormal_complement, transported_basis};
pub use thin_svd::ThinSvd;
pub use triple::{Scalar, Triple};
