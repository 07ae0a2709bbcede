//! Small, allocation-free numerical tools of the layers above: no physics.

mod bounded_least_squares;
mod sphere;
mod thin_svd;

pub use bounded_least_squares::{BoundedLeastSquares, BoundedProblem, BoundedReport};
pub use sphere::{angle_between, logarithm, orthonormal_complement, transported_basis};
pub use thin_svd::ThinSvd;
