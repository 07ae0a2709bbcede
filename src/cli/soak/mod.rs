//! `magsteer soak`: steers for hours, measures all the while, and stops at the first broken threshold.
//!
//! | file | does |
//! |---|---|
//! | `command` | the command line; starts and ends what is soaked |
//! | `course` | the soak itself: steers, measures minute by minute, judges |
//! | `steering` | an operator that plays an experiment over and over, and counts |
//! | `measures` | what is known of a minute, and the names of its metrics |
//! | `thresholds` | which metrics may not go where |
//! | `process` | what the kernel tells of the daemon's process |
//! | `load` | threads that keep the machine busy |
//! | `report`, `provenance` | what is left in the folder; the machine on which it was measured |
//! | `pictures` | histograms, and timing and memory against time |

mod command;
mod course;
mod load;
mod measures;
#[cfg(feature = "figures")]
mod pictures;
mod process;
mod provenance;
mod report;
mod steering;
mod thresholds;

pub use command::Soak;
