//! Amplifiers, motors and trackers behind UDP: a protocol small enough for a microcontroller or any language.
//!
//! `docs/udp.md` of this crate is its specification. [`UdpDevice`] is the driver's side, to be run by
//! [`crate::driver::run`]; [`SimulatedDevice`] is a far side of ideal hardware, for tests and as an
//! example. What must hold without the network, holds on the far side: it keeps its own watchdog over
//! datagrams.

mod device;
mod protocol;
mod simulated;

pub use device::UdpDevice;
pub use protocol::{Answer, DATAGRAM_MAX, MalformedDatagram, Poses, Request, device_state, kind};
pub use simulated::{SimulatedConfig, SimulatedDevice};
