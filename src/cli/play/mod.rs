//! Plays an experiment as an operator: sets targets through the channels, watches, and judges each step.
//!
//! `session` sets targets and sees each step through, `guided` along ways that are planned on the way; `readiness` brings a daemon to
//! where it steers; `watched` gathers what a step is judged by; `live_line` shows it on the way, and `report` afterwards.

mod guided;
mod live_line;
mod readiness;
mod report;
mod session;
mod watched;

pub use live_line::LiveLine;
pub use report::{table, timing_line};
#[cfg(feature = "sim")]
pub use session::Played;
pub use session::Session;
