//! Tests of the layer: what allocation promises about limits, null space and margin, how the model follows the actuation, and
//! what a cycle does with whatever it is given.

mod allocation;
mod cycle;
pub(super) mod fixtures;
mod model;
mod scout;
mod secondary;
