//! The controller: from measured tangents to requested currents and angles.

mod cycle;

pub use cycle::{CycleInput, CycleOutcome, Directions, ModelReport, Step};
