//! The report of a campaign: how fast and how exactly the drawn plants settled, what those that failed have in common, how close all
//! came to the limits, and how each failure is played again.
//!
//! `runs` reads the folder, `figures` makes sheets of it, `page` puts them together.

mod figures;
mod page;
mod runs;

pub use page::write;
pub use runs::{CampaignRuns, FailedRun, is_campaign};
