//! The true magnetic field, written apart from the controller's. Equations (F1) to (F17) stand in
//! `docs/field.md`, too.
//!
//! - `sample`: field and gradient at a point, and the wrench on a dipole there;
//! - `dipole`: a point dipole, for magnets that act on each other;
//! - `axial`: axisymmetric fields, from the half plane to space;
//! - `elliptic`, `current_loop`, `quadrature`, `winding`: a winding as an integral of current loops;
//! - `table`: the same winding, interpolated;
//! - `multipole`, `saturation`: the published series, behind a core;
//! - `source`: which of them a coil is;
//! - `array`: the coils of the rig at their present currents and frame angles.

mod array;
mod axial;
mod current_loop;
mod dipole;
mod elliptic;
mod multipole;
mod quadrature;
mod sample;
mod saturation;
mod source;
mod table;
mod winding;

pub use array::CoilArray;
pub use axial::{Axial, Superposition};
pub use current_loop::LoopField;
pub use dipole::Dipole;
pub use multipole::Multipole;
pub use sample::{Field, Wrench};
pub use saturation::Saturation;
pub use source::{CoilTruth, Source};
pub use table::{Domain, Table};
pub use winding::{Sheet, Winding, mutual_inductance};
