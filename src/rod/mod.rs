//! Layer rod: statics of a clamped, free-ended chain of flexible sections and rigid magnets, with exact sensitivities.
//!
//! # Terms
//! - **Section**: a Cosserat rod, Kirchhoff or extensible, straight or precurved, under gravity (`section`).
//! - **Magnet**: a rigid part on which the applied field exerts a wrench at its present pose (`magnet`).
//! - **Base unknowns**: internal force and moment at the clamp. **Shooting** integrates from them to the tip and
//!   demands that force and moment there equal the tip load.
//! - **Pass**: one such integration that yields residual, Newton step and the Jacobian of the magnets with
//!   every actuation parameter (`shooting`; start reading there). A controller runs one pass a cycle.
//! - **Solve**: passes until the residual meets a tolerance, near a guess (`solve`) or from rest (`continuation`).
//! - **Constants**: what the manipulator is, and how an equilibrium changes with it, for identification (`constants`).
//! - **Stability** of an equilibrium: number of unstable modes and margin, by the second variation of the energy (`stability`).
//! - **Held** wrenches stay in the world while the rod moves: the problems of the paper's Algorithm 1 (`held`).
//!
//! Constants are in [`Manipulator`], made by [`RodConfig::build`]; state and results are in [`Pass`], allocated once.
//! What is absent: no pass or solve allocates, logs or panics, and nothing here knows a coil.

mod config;
mod constants;
mod continuation;
mod held;
mod magnet;
mod manipulator;
mod pass;
mod section;
mod shape;
mod shooting;
mod solve;
mod stability;
mod state;
mod transition;
mod variation;

#[cfg(test)]
mod tests;

pub use config::{RodConfig, SolverOptions};
pub use constants::{ByConstants, Constant};
pub use continuation::Scaled;
pub use held::{HeldOptions, HeldShape, HeldSolution, ResidualDerivative};
pub use magnet::Wrenches;
pub use manipulator::Manipulator;
pub use pass::{MagnetPass, Pass, PassMode, TipLoad};
pub use shape::Station;
pub use solve::{Failure, Outcome, Solution};
pub use stability::Stability;
