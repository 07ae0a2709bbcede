//! How a viewer stands to the daemon, judged by the data itself.
//!
//! ```text
//!  Absent ──service found──▶ Waiting ──status──▶ Attached ──no status for a while──▶ Stale
//!    ▲                          ▲                    ▲  └──────── a newer status ◀──────┤
//!    └── service gone ──────────┴────── the channel is opened anew, now and then ◀──────┘
//! ```
//!
//! A daemon's life is told from the next by the epoch in its messages' headers.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::message::Header;
use serde::Serialize;

/// Shortest silence that counts as one: many periods of the status, longer than a shared machine stops a
/// process.
const SILENCE_MIN: Duration = Duration::from_millis(500);
/// Periods of the status that are a silence.
const SILENCE_PERIODS: f64 = 4.0;

/// How the viewer stands to the daemon.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Link {
    /// No daemon serves the rig.
    Absent,
    /// Its services are there; nothing was heard yet.
    Waiting,
    /// What is shown is present.
    Attached,
    /// What is shown is old.
    Stale,
}

impl Link {
    /// The word a person reads.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::Waiting => "waiting",
            Self::Attached => "attached",
            Self::Stale => "stale",
        }
    }
}

/// What was heard of a daemon, and when.
#[derive(Debug, Clone)]
pub struct Lifeline {
    silence: Duration,
    epoch: Option<u64>,
    published: Stamp,
    lives: u32,
}

impl Lifeline {
    /// Nothing was heard yet of a daemon that publishes its status so often; 0 when that is not known.
    #[must_use]
    pub fn new(status_rate_hz: f64) -> Self {
        let periods = Duration::try_from_secs_f64(SILENCE_PERIODS / status_rate_hz).unwrap_or(Duration::ZERO);
        Self { silence: SILENCE_MIN.max(periods), epoch: None, published: Stamp::default(), lives: 0 }
    }

    /// Takes note of a message; true when it begins another life of the daemon than the one heard before.
    pub fn heard(&mut self, header: &Header) -> bool {
        let begins = self.epoch != Some(header.epoch);
        self.lives += u32::from(begins);
        self.epoch = Some(header.epoch);
        self.published = Stamp::from_nanoseconds(header.publish_stamp_ns);
        begins && self.lives > 1
    }

    /// How it stands; `open`: the daemon's services are there.
    #[must_use]
    pub fn link(&self, open: bool, now: Stamp) -> Link {
        match self.age(now) {
            Some(age) if age <= self.silence => Link::Attached,
            Some(_) => Link::Stale,
            None if open => Link::Waiting,
            None => Link::Absent,
        }
    }

    /// Age of what was heard last; `None` before the first.
    #[must_use]
    pub fn age(&self, now: Stamp) -> Option<Duration> {
        self.epoch.map(|_| now.since(self.published))
    }

    /// Lives of the daemon after the first that was heard.
    #[must_use]
    pub const fn restarts(&self) -> u32 {
        self.lives.saturating_sub(1)
    }
}
