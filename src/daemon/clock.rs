//! Absolute deadlines on `CLOCK_MONOTONIC`.
//!
//! Problem: a loop that sleeps for "the rest of the period" drifts, and one that catches up after a
//! stall bursts commands. Terms: a *period* is numbered from the loop's start; its *deadline* is the
//! moment at which its cycle should begin; *lateness* is how long after the deadline that it waited
//! for a cycle really began; a period is *missed* when the next one began before its cycle could.
//! Method: deadlines lie on a fixed grid; after a stall whole periods are skipped and counted, and
//! the next deadline is again on the grid.

use std::time::Duration;

use magsteer_hal::Stamp;

use super::kernel;

/// The moment at which a cycle runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tick {
    /// Number of the period on the grid; the first is 0, missed ones are skipped.
    pub number: u64,
    /// Begin of this period.
    pub deadline: Stamp,
    /// When the cycle began; the only clock reading that a cycle sees.
    pub now: Stamp,
    /// From the deadline that was waited for to `now`; longer than a period when periods were missed.
    pub lateness: Duration,
    /// Periods skipped since the previous tick.
    pub missed: u64,
}

impl Tick {
    /// The first tick under stepped time.
    #[must_use]
    pub fn first(now: Stamp) -> Self {
        Self { number: 0, deadline: now, now, lateness: Duration::ZERO, missed: 0 }
    }

    /// The next tick under stepped time: one period later, on time.
    #[must_use]
    pub fn stepped(self, period: Duration) -> Self {
        let deadline = self.deadline.after(period);
        Self { number: self.number + 1, deadline, now: deadline, lateness: Duration::ZERO, missed: 0 }
    }
}

/// The grid of deadlines, apart from the clock, so that it can be tested under any times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Schedule {
    period: Duration,
    next_number: u64,
    next_deadline: Stamp,
}

impl Schedule {
    /// A grid whose period 0 begins at `start`. A period of zero is taken as one nanosecond.
    #[must_use]
    pub fn starting_at(start: Stamp, period: Duration) -> Self {
        Self { period: period.max(Duration::from_nanos(1)), next_number: 0, next_deadline: start }
    }

    /// The deadline to wait for.
    #[must_use]
    pub fn deadline(&self) -> Stamp {
        self.next_deadline
    }

    /// Takes the period that `now` lies in, skipping those that are over.
    pub fn take(&mut self, now: Stamp) -> Tick {
        let lateness = now.since(self.next_deadline);
        let missed = u64::try_from(lateness.as_nanos() / self.period.as_nanos()).unwrap_or(u64::MAX);
        let skipped = Duration::from_nanos(saturating_nanoseconds(self.period).saturating_mul(missed));
        let number = self.next_number.saturating_add(missed);
        let deadline = self.next_deadline.after(skipped);
        self.next_number = number.saturating_add(1);
        self.next_deadline = deadline.after(self.period);
        Tick { number, deadline, now, lateness, missed }
    }
}

fn saturating_nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// How a thread waits for its deadlines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pace {
    /// From one deadline to the next.
    pub period: Duration,
    /// How long before a deadline to stop sleeping and to watch the clock; zero to sleep all the way.
    pub spin: Duration,
}

/// Waits for the deadlines of a [`Schedule`] on the machine's monotonic clock.
#[derive(Debug)]
pub struct Clock {
    schedule: Schedule,
    spin: Duration,
}

impl Clock {
    /// A clock whose first deadline lies one period ahead.
    #[must_use]
    pub fn start(pace: Pace) -> Self {
        let Pace { period, spin } = pace;
        Self { schedule: Schedule::starting_at(Stamp::now().after(period), period), spin }
    }

    /// Waits until the next deadline and takes its period. Returns at once when it is already over.
    pub fn wait(&mut self) -> Tick {
        let deadline = self.schedule.deadline();
        kernel::sleep_until(deadline.before(self.spin));
        let mut now = Stamp::now();
        // Without the processor's hint for waiting loops: a hypervisor may take the CPU from a guest that
        // gives it often.
        while now < deadline {
            now = Stamp::now();
        }
        self.schedule.take(now)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use magsteer_hal::Stamp;
    use rand::{RngExt, SeedableRng};

    use super::{Clock, Pace, Schedule, Tick};

    const PERIOD: Duration = Duration::from_millis(1);

    fn at_us(microseconds: u64) -> Stamp {
        Stamp::from_nanoseconds(microseconds * 1_000)
    }

    #[test]
    fn a_punctual_loop_misses_nothing_and_keeps_the_grid() {
        let mut schedule = Schedule::starting_at(at_us(10_000), PERIOD);
        for number in 0..1_000 {
            assert_eq!(schedule.deadline(), at_us(10_000 + 1_000 * number));
            let tick = schedule.take(at_us(10_000 + 1_000 * number + 120));
            assert_eq!((tick.number, tick.missed), (number, 0));
            assert_eq!(tick.lateness, Duration::from_micros(120));
        }
    }

    /// Proves SR-21.
    #[test]
    fn a_stall_skips_whole_periods_counts_them_and_never_bursts() {
        let mut schedule = Schedule::starting_at(at_us(0), PERIOD);
        schedule.take(at_us(0));
        // Waited for 1 ms, woke at 51.4 ms: periods 1 to 50 are over, 51 is this one.
        let tick = schedule.take(at_us(51_400));
        assert_eq!((tick.number, tick.missed), (51, 50));
        assert_eq!(tick.deadline, at_us(51_000));
        assert_eq!(tick.lateness, Duration::from_micros(50_400), "late against the deadline waited for");
        assert_eq!(schedule.deadline(), at_us(52_000), "the next deadline lies ahead, on the grid");
    }

    /// Goal: over any pattern of delays every period is either run or counted as missed, exactly once.
    #[test]
    fn ticks_and_missed_periods_add_up_to_the_periods_elapsed() {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut schedule = Schedule::starting_at(at_us(7), PERIOD);
        let (mut run, mut missed, mut now) = (0, 0, 7);
        let mut last = None;
        for _ in 0..5_000 {
            let stall = if random.random_bool(0.02) { random.random_range(0..60_000) } else { 0 };
            now = now.max(schedule.deadline().nanoseconds() / 1_000) + random.random_range(0..900) + stall;
            let tick = schedule.take(at_us(now));
            run += 1;
            missed += tick.missed;
            assert!(last.is_none_or(|last| tick.number > last));
            assert!(tick.deadline <= tick.now && schedule.deadline() > tick.now);
            last = Some(tick.number);
        }
        assert_eq!(run + missed, last.unwrap_or(0) + 1);
        assert!(missed > 100, "the seed must exercise stalls");
    }

    #[test]
    fn stepped_ticks_are_on_time() {
        let tick = Tick::first(at_us(3)).stepped(PERIOD).stepped(PERIOD);
        assert_eq!((tick.number, tick.now, tick.missed), (2, at_us(2_003), 0));
    }

    #[test]
    fn the_clock_never_returns_before_its_deadline_whether_it_sleeps_or_spins() {
        for spin_us in [0, 200, 900, 2_000] {
            let mut clock = Clock::start(Pace { period: PERIOD, spin: Duration::from_micros(spin_us) });
            for _ in 0..20 {
                let tick = clock.wait();
                assert!(tick.now >= tick.deadline, "spin {spin_us} us");
            }
        }
    }
}
