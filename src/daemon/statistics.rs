//! Timing of every cycle, without loss: histograms with their maximum, never means.
//!
//! Terms: *lateness* from the awaited deadline to the cycle's begin; *execution* from the cycle's
//! begin to its end; *pose age* from exposure to the cycle that uses the poses; *pose to command*
//! from the exposure of fresh poses to the moment at which the command computed from them was sent.
//! Method: HDR histograms of nanoseconds with fixed bounds and three significant digits, allocated
//! at construction; a value beyond the upper bound counts there, so that nothing is dropped.

use std::time::Duration;

use hdrhistogram::Histogram;
use magsteer_hal::operator::{LoopTiming, Quantiles, StatusMessage};
use serde::{Deserialize, Serialize};

/// Longest time that is told apart, 60 s in ns.
const LONGEST_NS: u64 = 60_000_000_000;
/// Significant digits of a recorded time.
const DIGITS: u8 = 3;

/// Quantiles of a histogram, microseconds; all zero when nothing was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LatencySummary {
    /// Half of all values lie below.
    pub p50: f64,
    /// 99 of 100 values lie below.
    pub p99: f64,
    /// 999 of 1000 values lie below.
    pub p999: f64,
    /// The greatest value.
    pub max: f64,
}

/// What a run's timing came to, under the keys that other programs read.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TimingSummary {
    /// Configured rate.
    pub rate_hz: f64,
    /// Cycles run.
    pub cycles: u64,
    /// Periods skipped.
    pub missed: u64,
    /// Lateness of each cycle.
    pub lateness_us: LatencySummary,
    /// Execution time of each cycle.
    pub execution_us: LatencySummary,
    /// Age of the newest poses in each cycle that had any.
    pub pose_age_us: LatencySummary,
    /// From exposure to command, for each command computed from fresh poses.
    pub pose_to_command_us: LatencySummary,
}

impl From<LatencySummary> for Quantiles {
    fn from(LatencySummary { p50, p99, p999, max }: LatencySummary) -> Self {
        Self { p50_us: p50, p99_us: p99, p999_us: p999, max_us: max }
    }
}

impl From<Quantiles> for LatencySummary {
    fn from(Quantiles { p50_us, p99_us, p999_us, max_us }: Quantiles) -> Self {
        Self { p50: p50_us, p99: p99_us, p999: p999_us, max: max_us }
    }
}

impl From<TimingSummary> for LoopTiming {
    fn from(summary: TimingSummary) -> Self {
        Self {
            cycles: summary.cycles,
            lateness: summary.lateness_us.into(),
            execution: summary.execution_us.into(),
            pose_age: summary.pose_age_us.into(),
            pose_to_command: summary.pose_to_command_us.into(),
        }
    }
}

impl TimingSummary {
    /// The timing that a status message carries.
    #[must_use]
    pub fn of_status(status: &StatusMessage) -> Self {
        let timing = &status.timing;
        Self {
            rate_hz: status.rate_hz,
            cycles: timing.cycles,
            missed: status.missed,
            lateness_us: timing.lateness.into(),
            execution_us: timing.execution.into(),
            pose_age_us: timing.pose_age.into(),
            pose_to_command_us: timing.pose_to_command.into(),
        }
    }
}

/// The times of one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CycleTiming {
    /// See the module's terms.
    pub lateness: Duration,
    /// See the module's terms.
    pub execution: Duration,
    /// Periods skipped before the cycle.
    pub missed: u64,
    /// `None` before the first poses.
    pub pose_age: Option<Duration>,
    /// `None` when the command was not computed from fresh poses.
    pub pose_to_command: Option<Duration>,
}

/// Histograms of a run.
#[derive(Debug)]
pub struct Statistics {
    rate_hz: f64,
    cycles: u64,
    missed: u64,
    lateness: Histogram<u64>,
    execution: Histogram<u64>,
    pose_age: Histogram<u64>,
    pose_to_command: Histogram<u64>,
}

impl Statistics {
    /// Empty histograms for a loop of this rate.
    #[must_use]
    pub fn new(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            cycles: 0,
            missed: 0,
            lateness: histogram(),
            execution: histogram(),
            pose_age: histogram(),
            pose_to_command: histogram(),
        }
    }

    /// Counts one cycle. Allocates nothing.
    pub fn record(&mut self, timing: &CycleTiming) {
        self.cycles += 1;
        self.missed += timing.missed;
        record(&mut self.lateness, timing.lateness);
        record(&mut self.execution, timing.execution);
        if let Some(age) = timing.pose_age {
            record(&mut self.pose_age, age);
        }
        if let Some(latency) = timing.pose_to_command {
            record(&mut self.pose_to_command, latency);
        }
    }

    /// Quantiles and maxima so far.
    #[must_use]
    pub fn summary(&self) -> TimingSummary {
        TimingSummary {
            rate_hz: self.rate_hz,
            cycles: self.cycles,
            missed: self.missed,
            lateness_us: summary(&self.lateness),
            execution_us: summary(&self.execution),
            pose_age_us: summary(&self.pose_age),
            pose_to_command_us: summary(&self.pose_to_command),
        }
    }
}

fn histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("the bounds are constants that it accepts")
}

fn record(histogram: &mut Histogram<u64>, duration: Duration) {
    histogram.saturating_record(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX));
}

fn summary(histogram: &Histogram<u64>) -> LatencySummary {
    let microseconds = |nanoseconds: u64| nanoseconds as f64 * 1e-3;
    LatencySummary {
        p50: microseconds(histogram.value_at_quantile(0.5)),
        p99: microseconds(histogram.value_at_quantile(0.99)),
        p999: microseconds(histogram.value_at_quantile(0.999)),
        max: microseconds(histogram.max()),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{CycleTiming, LatencySummary, Statistics};

    fn cycle(lateness_us: u64) -> CycleTiming {
        CycleTiming { lateness: Duration::from_micros(lateness_us), ..CycleTiming::default() }
    }

    /// Goal: quantiles against values known by construction, to the histogram's three digits.
    #[test]
    fn quantiles_of_a_ramp_are_those_of_the_ramp() {
        let mut statistics = Statistics::new(1_000.0);
        (1..=10_000).for_each(|microseconds| statistics.record(&cycle(microseconds)));
        let summary = statistics.summary();
        let expected = [(summary.lateness_us.p50, 5_000.0), (summary.lateness_us.p99, 9_900.0)];
        for (actual, expected) in expected {
            assert!((actual / expected - 1.0_f64).abs() < 2e-3, "{actual} for {expected}");
        }
        assert!(summary.lateness_us.max >= 10_000.0 && summary.lateness_us.max < 10_010.0);
        assert_eq!(summary.cycles, 10_000);
    }

    #[test]
    fn one_stall_in_a_hundred_thousand_is_not_lost() {
        let mut statistics = Statistics::new(1_000.0);
        (0..100_000).for_each(|_| statistics.record(&cycle(10)));
        let stall = CycleTiming { missed: 49, ..cycle(49_700) };
        statistics.record(&stall);
        let summary = statistics.summary();
        assert!(summary.lateness_us.max >= 49_700.0 && summary.lateness_us.p999 < 11.0);
        assert_eq!(summary.missed, 49);
    }

    #[test]
    fn times_beyond_the_bounds_are_counted_at_the_bound() {
        let mut statistics = Statistics::new(1_000.0);
        statistics.record(&cycle(u64::MAX / 1_000));
        assert!(statistics.summary().lateness_us.max >= 59.9e6);
    }

    #[test]
    fn absent_poses_are_not_recorded_as_fresh_ones() {
        let mut statistics = Statistics::new(1_000.0);
        statistics.record(&cycle(1));
        assert_eq!(statistics.summary().pose_age_us, LatencySummary::default());
    }

    #[test]
    fn the_summary_has_the_published_keys() {
        let value = serde_json::to_value(Statistics::new(1_000.0).summary()).expect("plain data");
        for key in ["rate_hz", "cycles", "missed", "lateness_us", "execution_us", "pose_to_command_us"] {
            assert!(value.get(key).is_some(), "{key}");
        }
        for key in ["p50", "p99", "p999", "max"] {
            assert!(value["lateness_us"].get(key).is_some(), "{key}");
        }
    }
}
