//! `magsteer runs`: flights, which are what a daemon saw before it tripped.
//!
//! | file | does |
//! |---|---|
//! | `command` | the subcommands, and how a flight that cannot be read ends them |
//! | `list` | the flights of a folder |
//! | `show` | one flight: why, a table, extremes |
//! | `table` | its rows as text |
//! | `csv` | all of its values |
//! | `picture` | angles, currents, margin and lateness against time |

mod command;
mod csv;
mod list;
#[cfg(feature = "figures")]
mod picture;
mod show;
mod table;

pub use command::Runs;
