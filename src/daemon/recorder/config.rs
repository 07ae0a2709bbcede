//! `[daemon.recorder]`: where flights and the journal go, and how much is kept.

use std::path::PathBuf;
use std::time::Duration;

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

/// `[daemon.recorder]`. A file without the table has no recorder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecorderConfig {
    /// Folder for flights and the journal, relative to the daemon's working directory; made when it is
    /// missing.
    pub folder: PathBuf,
    /// How long the ring reaches back, s, 1 to 60. Memory goes with it: twice this time in records, at most
    /// 512 MiB; the daemon says how much at its start.
    pub seconds: f64,
    /// Flights kept in the folder, 1 to 10000; the oldest make room for new ones.
    pub flights_max: u32,
}

impl RecorderConfig {
    /// Adds every value out of its range, keyed from the root of the file.
    pub fn check(&self, checks: &mut Checks) {
        let folder = self.folder.display();
        checks.require(
            !self.folder.as_os_str().is_empty(),
            "daemon.recorder.folder",
            folder,
            "the path of a folder",
        );
        checks.within("daemon.recorder.seconds", self.seconds, 1.0, 60.0);
        let flights = self.flights_max;
        let holds = (1..=10_000).contains(&flights);
        checks.require(holds, "daemon.recorder.flights_max", flights, "from 1 to 10000");
    }

    /// How long the ring reaches back.
    #[must_use]
    pub fn reach(&self) -> Duration {
        Duration::try_from_secs_f64(self.seconds).unwrap_or(Duration::ZERO)
    }
}
