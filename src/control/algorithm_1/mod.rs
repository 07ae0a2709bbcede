//! The paper's Algorithm 1: the orientation Jacobian by one boundary-value problem for each actuation parameter.
//!
//! # Method
//! The wrenches of all magnets follow from the actuation by the current-to-wrench map `T` of eq. (13), taken at the magnets' poses
//! in the present shape and *frozen* there. Under them the statics are solved once for the present shape, then once for every
//! parameter, stepped by `dI` or `dtheta`:
//! ```text
//! w  = T(p, q, theta) I,   w' = T(p, q, theta') I'                     lines 4, 5, 15 to 17
//! xi' = xi + sum_m (df_m, dtau_m + (p_m - p_0) x df_m)                 (14)   informed guess, or xi' = xi
//! solve r(xi'; w') = 0 by shooting with Levenberg-Marquardt            line 8, `rod::HeldOptions`
//! column = (k_d . (k' - k), phi' - phi) / dI                           (15), or the turn in the tangent plane
//! ```
//! The problems are independent: solved one by one, or by threads, with the same bits as a result.
//!
//! # In the loop
//! A cycle solves a bounded number of problems; a Jacobian takes as many cycles as that needs. Until it is complete the last
//! complete one stays in use, its age counted from the cycle whose shape it belongs to. A problem that does not converge
//! discards its Jacobian, and the next cycle begins anew. Which cycle solves what depends on nothing but counts.
//!
//! What freezing the wrenches does to the Jacobian and to the loop stands, with numbers, in `src/control/docs/frozen_wrenches.md`.
//!
//! # Differences from the paper
//! - Everything else of a cycle (statics at the present actuation, margin of stability, law, allocation) stays as with
//!   the exact Jacobian, so that a comparison shows the Jacobian alone.
//! - The present shape is solved under the frozen wrenches as well, so that a column is the difference of two shapes of one model,
//!   also where poses are measured and the model is not the rod.

mod algorithm;
mod config;
mod problem;

pub use algorithm::{Algorithm1, Progress};
pub use config::{Algorithm1Config, JacobianKind, PoseSource};
pub use problem::{HeldPose, Present};
