//! `magsteer report`: the figures of a recorded run or of a campaign, as pictures, tables and one page.
//!
//! `run` reads a recording into what figures need; `steering` (angles, views), `modelling` (field, forces) and `health` (currents,
//! margins, timing) make sheets of it; `page` puts them together. `campaign` does the same for a campaign.

#[cfg(feature = "sim")]
mod campaign;
mod command;
mod health;
mod modelling;
mod page;
mod run;
mod steering;

#[cfg(feature = "sim")]
pub use campaign::{CampaignRuns, write as write_campaign};
pub use command::Report;
#[cfg(feature = "sim")]
pub use command::{beside, write};
#[cfg(feature = "sim")]
pub use run::Run;
