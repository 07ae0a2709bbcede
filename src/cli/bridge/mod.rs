//! `magsteer bridge`: what the daemon publishes, for programs that speak other protocols.
//!
//! | file | does |
//! |---|---|
//! | `command` | the process of `bridge foxglove`: address, loop, end |
//! | `topics` | what is published under which topic |
//! | `scene` | rod, magnets, targets, coils and workspace in 3-D |

mod command;
mod scene;
#[cfg(test)]
mod tests;
mod topics;

pub use command::Bridge;
