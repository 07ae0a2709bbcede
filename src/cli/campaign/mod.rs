//! `magsteer campaign`: many simulated plants, drawn at random, play one experiment in lockstep on all cores.
//!
//! **Problem.** One demonstration shows one plant. What share of the plants that a rig might turn out to be
//! does the controller steer, how fast, how exactly, and which not?
//!
//! **Terms.** A *campaign* is a configuration, an experiment and a seed. A *run* is one drawn plant playing
//! the experiment; its number and the campaign's seed give its seed, and that gives everything else
//! ([`magsteer::config::CampaignConfig`] states the rule). Its *digest* stands for every bit that it
//! commanded and did.
//!
//! | file | does |
//! |---|---|
//! | `command` | the subcommand: start, resume, replay |
//! | `plants` | draws plants and builds them |
//! | `runner` | plays one run |
//! | `row` | what a run came to, as a line of a table |
//! | `folder` | the files of a campaign |
//! | `pool` | all runs, over all cores |
//! | `progress` | how far it is |
//! | `summary` | what all runs say together |

mod command;
mod folder;
mod plants;
mod pool;
mod progress;
mod row;
mod runner;
mod summary;

pub use command::Campaign;
#[cfg(all(feature = "figures", feature = "record"))]
pub use folder::{Manifest, read_columns, read_manifest, read_rows};
pub use plants::Plants;
#[cfg(all(feature = "figures", feature = "record"))]
pub use row::{Columns, RunRow};
