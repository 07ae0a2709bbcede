//! When a sensor looks, and the messages that are under way.
//!
//! Terms: an *exposure* is the moment at which the shape was true; it is the message's source stamp. A
//! message is *due* one latency after. A *drop-out* loses a whole exposure.

use std::collections::VecDeque;
use std::time::Duration;

use magsteer_hal::{PoseMessage, Stamp};

/// When a sensor looks and tells.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Timing {
    /// Time between exposures.
    pub period: Duration,
    /// From exposure to message.
    pub latency: Duration,
    /// Share of exposures that are lost, 0 to 1.
    pub dropout_probability: f64,
}

/// The grid of exposures and the messages not yet due. Never grows after construction.
#[derive(Debug, Clone)]
pub(super) struct Exposures {
    timing: Timing,
    next: Stamp,
    pending: VecDeque<PoseMessage>,
}

impl Exposures {
    /// The first exposure is at `start`.
    pub fn new(timing: Timing, start: Stamp) -> Self {
        // One more than can be under way at once.
        let capacity = timing.latency.as_nanos() / timing.period.as_nanos().max(1) + 2;
        Self { timing, next: start, pending: VecDeque::with_capacity(usize::try_from(capacity).unwrap_or(2)) }
    }

    /// Starts anew at `start`, the next exposure one period after it: exposures under way are lost.
    pub fn restart(&mut self, start: Stamp) {
        self.pending.clear();
        self.next = start.after(self.timing.period);
    }

    /// True when an exposure falls on or before `now`.
    pub fn wants(&self, now: Stamp) -> bool {
        now >= self.next
    }

    pub fn dropout_probability(&self) -> f64 {
        self.timing.dropout_probability
    }

    /// Takes note of an exposure at `now` and of its message, unless that is lost.
    pub fn expose(&mut self, message: Option<PoseMessage>, now: Stamp) {
        // Exposures keep their own grid; those that a jump of the clock passed over are lost.
        while self.next <= now {
            self.next = self.next.after(self.timing.period);
        }
        let Some(mut message) = message else { return };
        message.header.source_stamp_ns = now.nanoseconds();
        if self.pending.len() < self.pending.capacity() {
            self.pending.push_back(message);
        }
    }

    /// The oldest message that is due at `now`, if any; its header has only the source stamp.
    pub fn take_due(&mut self, now: Stamp) -> Option<PoseMessage> {
        let due = self.pending.front()?.header.source_stamp().after(self.timing.latency);
        if now >= due { self.pending.pop_front() } else { None }
    }
}
