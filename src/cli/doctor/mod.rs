//! `magsteer doctor`: is this machine fit for a control loop, and what mends it.
//!
//! | file | does |
//! |---|---|
//! | `command` | the command line, what is printed |
//! | `finding` | one line of the answer |
//! | `machine` | the kernel's files, below a root that tests replace |
//! | `kernel`, `processors`, `limits` | what the kernel, the CPUs, and rights and memory allow |
//! | `services` | who runs on the channels, and what dead processes left there |
//! | `consequences` | what the values of `[daemon]` mean |
//! | `wake_up` | wake-ups at the configured rate, measured |
//!
//! What is absent: any change to the machine. A line names the command that mends it; `--clean` alone
//! removes, and only what dead processes left.

mod command;
mod consequences;
mod finding;
#[cfg(test)]
mod fixture;
mod kernel;
mod limits;
mod machine;
mod processors;
mod services;
mod wake_up;

pub use command::Doctor;
#[cfg(feature = "sim")]
pub use command::of_machine;
#[cfg(feature = "sim")]
pub use machine::Machine;
#[cfg(feature = "sim")]
pub use {finding::Finding, processors::Stolen};
