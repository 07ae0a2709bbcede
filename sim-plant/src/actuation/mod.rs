//! What turns set points into currents and angles.
//!
//! The physics, with its sources, its discretisation and what it leaves out, stands in
//! `sim-plant/docs/electrical.md`; equation numbers are that page's.
//!
//! - `actuators`: coils and frames, followed as one, and the driver's faults;
//! - `coils`: coils with their bridges, whatever is wrong with them;
//! - `circuit`, `propagator`: coupled circuits, stepped exactly; `coupling`: which coils share flux;
//! - `amplifier`: the controller of a current; `sensor`: what is measured of it;
//! - `winding`: how warm a coil gets, and what that does to its resistance;
//! - `motor`: turns a frame;
//! - `condition`: what can be wrong with them; `watch`, `fault`: how the driver notices, and its codes.

mod actuators;
mod amplifier;
mod circuit;
mod coils;
mod condition;
mod coupling;
mod fault;
mod motor;
mod propagator;
mod sensor;
mod watch;
mod winding;

pub use actuators::{ActuationSettings, Actuators};
pub use amplifier::Amplifier;
pub use circuit::{CircuitValues, Circuits, RESISTANCE_TOLERANCE};
pub use coils::{Coils, CoilsSettings};
pub use condition::{CoilCondition, FrameCondition, Held, SHORTED_MAX};
pub use coupling::{CouplingPair, Couplings, EIGENVALUE_MIN};
pub use fault::{Fault, fault_code};
pub use motor::{Motor, MotorCharacter};
pub use sensor::{CurrentSensorCharacter, CurrentSensors, quantised};
pub use watch::{DriverWatch, STANDS_MIN, Seen, WatchSettings};
pub use winding::{Winding, WindingCharacter};
