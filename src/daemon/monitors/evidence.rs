//! Time in which a sign was seen, less time in which its opposite was.
//!
//! What is wrong most of the time is found out, however it comes and goes; a cycle that says neither leaves the
//! evidence as it is, so that a monitor which can judge only now and then is not outlived by its own silence.

use std::time::Duration;

/// The evidence for one sign.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Evidence {
    gathered: Duration,
}

impl Evidence {
    /// Takes a cycle of `elapsed`: `Some(true)` where the sign was seen, `None` where nothing could be. Never holds more
    /// than `limit` and a tenth, so that what was wrong for long is forgiven as fast as what just tripped.
    pub(super) fn take(&mut self, sign: Option<bool>, elapsed: Duration, limit: Duration) {
        // A pause of the loop says nothing about the time in between.
        let elapsed = elapsed.min(limit / 10);
        self.gathered = match sign {
            Some(true) => (self.gathered + elapsed).min(limit + limit / 10),
            Some(false) => self.gathered.saturating_sub(elapsed),
            None => self.gathered,
        };
    }

    pub(super) fn exceeds(&self, limit: Duration) -> bool {
        self.gathered > limit
    }
}
