//! `magsteer runs`: recordings, which hold every cycle of a run, and flights, which are what a daemon saw before
//! it tripped.
//!
//! | file | does |
//! |---|---|
//! | `command` | the subcommands, and how a flight that cannot be read ends them |
//! | `list` | the recordings and flights of a folder |
//! | `show` | one flight: why, a table, extremes |
//! | `recording` | one recording: what it holds, what happened |
//! | `export` | a recording as a table, and a whole one of one that was cut |
//! | `table` | its rows as text |
//! | `csv` | all of its values |
//! | `picture` | angles, currents, margin and lateness against time |

mod command;
mod csv;
#[cfg(feature = "record")]
mod export;
mod list;
#[cfg(feature = "figures")]
mod picture;
#[cfg(feature = "record")]
mod recording;
mod show;
mod table;

pub use command::Runs;
#[cfg(feature = "record")]
pub use export::refused_recording;
