//! The rig's tables of the configuration file, in the units that people write, and their validation
//! into a [`HardwareDescription`](crate::HardwareDescription).
//!
//! `tables` holds the keys with their units and ranges; `build` checks every value and converts it to SI; `rotation` turns
//! angles and directions into rotation matrices.

mod build;
mod rotation;
mod tables;
#[cfg(test)]
mod tests;

pub use build::ORDER_MAX;
pub use tables::{
    CoilConfig, CoilPlacement, CoilTypeConfig, FrameConfig, HardwareConfig, MagnetConfig, ManipulatorConfig,
    MaterialConfig, PartConfig, RigConfig, SectionConfig, StiffnessSectionConfig,
};
