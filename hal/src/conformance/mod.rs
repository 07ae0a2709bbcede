//! The contract of [`Hardware`](crate::Hardware), as clauses that any rig can be held against.
//!
//! A harness ([`Rig`], for rigs inside the process [`SteppedRig`]) gives the suite a rig and lets its time pass; [`run`] tries every clause on a rig of its own and
//! returns what it found broken, so that tests can assert on it and a tool can print it. The suite commands small
//! currents (a quarter of each coil's maximum) through the gate and judges by what the rig reports alone.

mod clauses;
mod harness;
mod stepped;
mod trial;

pub use harness::{Clause, Rig, Violation};
pub use stepped::{Stepped, SteppedRig};

/// Tries every clause on a fresh rig each, made by `make`. Nothing found means that the contract is kept as far as
/// the harness lets it be tried.
pub fn run<R: Rig>(mut make: impl FnMut() -> R) -> Vec<Violation> {
    let mut found = Vec::new();
    for (clause, attempt) in clauses::all::<R>() {
        if let Err(detail) = attempt(&mut make()) {
            found.push(Violation { clause, detail });
        }
    }
    found
}
