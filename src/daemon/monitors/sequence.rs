//! Counts of messages that were lost on the way, or came twice, or backward.
//!
//! None of them trips by itself. A repeated or backward message is refused at receipt, and when no better one comes the
//! poses or the feedback grow old. A gap is what a loop leaves that reads the newest message alone, whenever a sender is
//! quicker than it: it is told, since one that grows without that reason points at a transport that loses messages.

use magsteer_hal::Absent;
use magsteer_hal::message::Header;
use serde::{Deserialize, Serialize};

/// Counts of one channel since the daemon's start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SequenceCounts {
    /// Messages that the sender counted and this loop never read.
    pub skipped: u64,
    /// Messages refused because their sequence was that of the last one.
    pub repeated: u64,
    /// Messages refused because their sequence was lower than that of the last one.
    pub backward: u64,
    /// How often another life of the sender took over.
    pub restarts: u64,
    /// Messages refused for any other reason.
    pub refused: u64,
}

/// Counts one channel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counter {
    counts: SequenceCounts,
    last: Option<(u64, u64)>,
}

impl Counter {
    /// Takes one read: the header of the newest valid message when it is fresh, and why another was refused.
    pub(super) fn take(&mut self, fresh: Option<&Header>, refused: Option<Absent>) {
        match refused {
            Some(Absent::Sequence { last, actual }) if actual == last => self.counts.repeated += 1,
            Some(Absent::Sequence { .. }) => self.counts.backward += 1,
            Some(Absent::NeverReceived) | None => {}
            Some(_) => self.counts.refused += 1,
        }
        let Some(header) = fresh else { return };
        match self.last {
            Some((epoch, sequence)) if epoch == header.epoch => {
                self.counts.skipped += header.sequence.saturating_sub(sequence).saturating_sub(1);
            }
            Some(_) => self.counts.restarts += 1,
            None => {}
        }
        self.last = Some((header.epoch, header.sequence));
    }

    pub(super) const fn counts(&self) -> SequenceCounts {
        self.counts
    }
}
