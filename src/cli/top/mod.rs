//! `magsteer top`: the rig in a terminal.
//!
//! | file | does |
//! |---|---|
//! | `command` | the terminal's life: looks, draws, takes keys |
//! | `keys` | which key asks for what |
//! | `screen` | what stands where, by the terminal's size |
//! | `plots` | angles against time |
//! | `rod_view` | the rod in a projection |
//! | `panels` | currents, frames, timing, events |

mod command;
mod keys;
mod panels;
mod plots;
mod rod_view;
mod screen;
#[cfg(test)]
mod tests;

pub use command::Top;
