//! The driver's own watchdog: whom it obeys, for how long, and what its amplifiers must do when nobody valid commands.
//!
//! Terms: *authority* is the right to command, held by one epoch and token at a time; the *latch* is its place;
//! a *set point* is what the amplifiers and frame motors must follow now. A driver hands every received command to
//! [`CommandGuard::offer`] and asks [`CommandGuard::setpoint`] at each of its own steps; no more is needed to keep
//! the contract. Pure state: no clock, no transport, no allocation after construction.
//!
//! ```text
//!            CLAIM (zero currents, rising epoch)         DRIVE, RAMP_DOWN, CLAIM again: stay
//!   Idle ─────────────────────────────────────▶ Driven ◀──────┐
//!    ▲  ▲                                        │ │  └───────┘
//!    │  └── at zero ── RampingDown ◀─────────────┘ │  RELEASE, or validity ran out
//!    │                    │                        │
//!    │ CLAIM (to Driven)  │ DISABLE                │ DISABLE, trip
//!   Disabled ◀────────────┴────────────────────────┘
//! ```

mod envelope;
mod latch;
mod refusal;

pub use latch::{CommandGuard, SLEW_JITTER, Setpoint, VALIDITY_MAX};
pub use refusal::{Refusal, RefusalCounts};

#[cfg(test)]
mod tests;
