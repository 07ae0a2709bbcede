//! The minutes: timing of each minute of a run as one JSON object on one line of `minutes.jsonl`.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::lines::Lines;
use crate::daemon::timing_summary::{TimingHistograms, TimingSummary};

/// Name of the file that is written to.
pub const MINUTES: &str = "minutes.jsonl";

/// Timing of the cycles of one minute, or of the last part of one in which a run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Minute {
    /// End of it, by the clock on the wall, RFC 3339.
    pub time: String,
    /// Name of the rig.
    pub rig: String,
    /// The daemon's process.
    pub pid: u32,
    /// Quantiles and maxima.
    #[serde(rename = "loop")]
    pub timing: TimingSummary,
    /// The same cycles, bin by bin.
    pub histograms: TimingHistograms,
}

/// The minutes that the files of a folder hold, the oldest first; lines that are none are left out.
///
/// # Errors
/// When a file cannot be read; a folder without any holds none.
pub fn read_minutes(folder: &Path) -> io::Result<Vec<Minute>> {
    let mut minutes = Vec::new();
    for path in Lines::Minutes.files(folder) {
        let text = std::fs::read(path)?;
        minutes
            .extend(text.split(|byte| *byte == b'\n').filter_map(|line| serde_json::from_slice(line).ok()));
    }
    Ok(minutes)
}
