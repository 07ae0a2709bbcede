//! The contract of [`Hardware`](crate::Hardware), as clauses that any rig can be held against.
//!
//! A harness ([`Rig`]; for rigs inside the process [`SteppedRig`], for a driver that runs elsewhere
//! [`RunningRig`]) gives the suite a rig and lets its time pass. [`run`] tries every clause on a rig of its
//! own and returns what it found broken; [`examine()`] tries them one after the other on a running rig, the
//! harmless first, and tells what it measured. The suite commands small currents (a quarter of each coil's
//! maximum) and judges by what the rig reports alone. Each [`Clause`] has a stable name, the [`Level`] it
//! belongs to, and says what would be right.

mod clause;
mod clauses;
mod commands;
mod examine;
mod finding;
mod garbage;
mod harness;
mod junit;
mod listening;
mod running;
mod stepped;
mod sweep;
mod trial;
mod watchdog;

pub use clause::{Clause, Facts, Level};
pub use examine::{examine, run};
pub use finding::{Finding, Verdict, Violation};
pub use garbage::Garbage;
pub use harness::{Heard, Rig, Spoil, StatedRates};
pub use junit::junit;
pub use running::{Ending, RunningRig, Tolerances};
pub use stepped::{Stepped, SteppedRig};
