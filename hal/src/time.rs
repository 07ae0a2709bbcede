//! Time as both sides of the channels count it: nanoseconds of `CLOCK_MONOTONIC` on one host.

use std::time::Duration;

/// An instant of `CLOCK_MONOTONIC`, in nanoseconds since the machine's boot.
///
/// Under stepped time (lockstep, tests) it is whatever the stepping code says it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Stamp(u64);

impl Stamp {
    /// The stamp that lies `nanoseconds` after the clock's zero.
    #[must_use]
    pub const fn from_nanoseconds(nanoseconds: u64) -> Self {
        Self(nanoseconds)
    }

    /// Nanoseconds since the clock's zero, as messages carry it.
    #[must_use]
    pub const fn nanoseconds(self) -> u64 {
        self.0
    }

    /// Reads the machine's monotonic clock.
    #[must_use]
    pub fn now() -> Self {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        let seconds = u64::try_from(time.tv_sec).unwrap_or(0);
        let nanoseconds = u64::try_from(time.tv_nsec).unwrap_or(0);
        Self(seconds * 1_000_000_000 + nanoseconds)
    }

    /// Time from `earlier` to this stamp; zero when `earlier` lies in the future.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_nanos(self.0.saturating_sub(earlier.0))
    }

    /// This stamp moved back by `duration`, at most to the clock's zero.
    #[must_use]
    pub fn before(self, duration: Duration) -> Self {
        let nanoseconds = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        Self(self.0.saturating_sub(nanoseconds))
    }

    /// This stamp moved forward by `duration`, saturating at the clock's end.
    #[must_use]
    pub fn after(self, duration: Duration) -> Self {
        let nanoseconds = u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX);
        Self(self.0.saturating_add(nanoseconds))
    }
}
