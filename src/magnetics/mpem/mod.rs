//! Calibrations of multipole electromagnet models (MPEM), as other electromagnetic-navigation systems keep
//! them: read, turned into coils of ours, and written.
//!
//! **Problem.** Those systems keep their arrays in YAML files: for each coil one or more *sources*, each
//! with a position, a direction and coefficients of a scalar potential. Ours are a series a coil along its
//! axis ([`Multipole`](super::Multipole)). Signs, factorials and units differ, and nothing in such a file
//! says so.
//!
//! **Source.** The model: Petruska, Edelmann, Nelson, "Model-Based Calibration for Magnetic Manipulation",
//! IEEE Transactions on Magnetics 53(7), 2017. The file and its meaning: class `ElectromagnetCalibration` of
//! the package `mpem` of Tesla (<https://github.com/ethz-msrl/Tesla_core_public>, folder
//! `mag_control/mpem`).
//!
//! # Terms
//! | symbol | meaning |
//! |---|---|
//! | `p`, `z` | position (m) and unit direction of a source, world |
//! | `d`, `r`, `c` | point minus `p`; `r = norm d`; `c = z . d / r` |
//! | `P_n` | Legendre polynomial of degree n |
//! | `A_n` | `A_Coeff`, n = 1 first: rising terms, of sources beyond the workspace; T m^(1-n) / A |
//! | `B_n` | `B_Coeff`, n = 1 first: falling terms, of the coil itself; T m^(n+2) / A |
//! | `Phi` | scalar potential of a source for 1 A |
//! | `a_n` | coefficients of our series, T m^(n+2) / A |
//! | background | field without currents: the entry of `Coil_List` whose name holds `Offset` |
//!
//! # Method
//! A file means
//!
//! - `Phi = sum_n (A_n r^n + B_n r^-(n+1)) P_n(c)`                                               (M1)
//! - `B = -grad Phi`, summed over the sources of a coil and times its current                      (M2)
//!
//! and our series `B = grad Psi`, `Psi = sum_n a_n d^n/dx^n (1/r) = sum_n a_n (-1)^n n! r^-(n+1) P_n(c)`
//! with x along the axis. Equal powers of r with `Psi = -Phi` and the axis along `z` give
//!
//! - `B_n = (-1)^(n+1) n! a_n`                                                                      (M3)
//!
//! The direction may point away from the workspace; since `P_n(-c) = (-1)^n P_n(c)`, turning it round is
//!
//! - `z -> -z`, `B_n -> (-1)^n B_n`                                                                 (M4)
//!
//! - `node`: YAML as a tree that knows its lines, without tags, aliases and keys that stand twice.
//! - `calibration`: what a file holds; `read`: the tree to it; `write`: it to text.
//! - `source`: (M1) to (M4); `coils`: sources to coils, and coils to sources.
//! - `one_source`: one source in place of several, fitted to their field.
//!
//! What is absent: files; rising terms and backgrounds in our array, which are refused by name.

mod calibration;
mod coils;
mod node;
mod one_source;
mod read;
mod source;
mod write;

pub use crate::math::csv::Refusal;
pub use calibration::{Calibration, CoilSources};
pub use coils::{PlacedCoil, placed_coils};
pub use one_source::Substitute;
pub use read::read;
pub use source::Source;
pub use write::write;
