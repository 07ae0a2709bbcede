//! The `[plant]` tables of the configuration file, and their validation into a [`crate::Plant`].
//!
//! Every key is required: no default is hidden in code. Keys of refusals start at `plant.`, since the
//! tables stand under that name in the rig's file. A file a table.

mod amplifier;
mod contact;
mod coupling;
mod driver;
mod errors;
mod field;
mod motor;
mod plant;
mod real_time;
mod rod;
mod sensing;
mod winding;

pub use amplifier::AmplifierConfig;
pub use contact::{ContactConfig, PlaneConfig, SurfaceConfig, TubeConfig};
pub use coupling::CouplingConfig;
pub use driver::DriverConfig;
pub use errors::ErrorsConfig;
pub use field::{CoilTruthConfig, CoreConfig, WindingShapeConfig};
pub use motor::MotorConfig;
pub use plant::PlantConfig;
pub use real_time::RealTimeConfig;
pub use rod::RodConfig;
pub use sensing::SensorConfig;
pub use winding::WindingConfig;
