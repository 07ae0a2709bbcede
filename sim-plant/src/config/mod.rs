//! The `[plant]` tables of the configuration file, and their validation into a [`crate::Plant`].
//!
//! Every key is required: no default is hidden in code. Keys of refusals start at `plant.`, since the
//! tables stand under that name in the rig's file. A file a table.

mod actuation;
mod errors;
mod field;
mod plant;
mod real_time;
mod rod;
mod sensing;

pub use actuation::AmplifierConfig;
pub use errors::ErrorsConfig;
pub use field::{CoilTruthConfig, CoreConfig, WindingConfig};
pub use plant::PlantConfig;
pub use real_time::RealTimeConfig;
pub use rod::RodConfig;
pub use sensing::SensorConfig;
