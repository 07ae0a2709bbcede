//! Timing of every cycle, without loss: histograms with their maximum, never means.
//!
//! Terms: *lateness* from the awaited deadline to the cycle's begin; *execution* from the cycle's
//! begin to its end, by [phases](super::phases); *pose age* from exposure to the cycle that uses the poses;
//! *pose to command* from the exposure of fresh poses to the moment at which the command computed from them
//! was sent; *pose to driver* from that exposure, and *round trip* from the publication of the poses, to the
//! [receipt](super::receipt) of that command by the driver. Method: HDR histograms of nanoseconds with fixed
//! bounds and three significant digits, allocated at construction; a value beyond the upper bound counts
//! there, so that nothing is dropped.

use std::time::Duration;

use hdrhistogram::Histogram;
use magsteer_hal::Stamp;

use super::phases::PhaseTimes;
use super::receipt::Receipt;
use super::timing_summary::{Bin, LatencySummary, PhaseSummary, TimingHistograms, TimingSummary};

/// Longest time that is told apart, 60 s in ns.
const LONGEST_NS: u64 = 60_000_000_000;
/// Significant digits of a recorded time.
const DIGITS: u8 = 3;
/// Over how long a [`MinuteStatistics`] gathers.
const MINUTE: Duration = Duration::from_secs(60);

/// The times of one cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CycleTiming {
    /// See the module's terms.
    pub lateness: Duration,
    /// See the module's terms.
    pub execution: Duration,
    /// The execution by phase.
    pub phases: PhaseTimes,
    /// Periods skipped before the cycle.
    pub missed: u64,
    /// `None` before the first poses.
    pub pose_age: Option<Duration>,
    /// `None` when the command was not computed from fresh poses.
    pub pose_to_command: Option<Duration>,
    /// `None` when the driver told of no receipt in this cycle.
    pub receipt: Option<Receipt>,
}

/// Histograms of many cycles.
#[derive(Debug)]
pub struct Statistics {
    rate_hz: f64,
    cycles: u64,
    missed: u64,
    lateness: Histogram<u64>,
    execution: Histogram<u64>,
    phases: PhaseHistograms,
    pose_age: Histogram<u64>,
    pose_to_command: Histogram<u64>,
    pose_to_driver: Histogram<u64>,
    round_trip: Histogram<u64>,
}

#[derive(Debug)]
struct PhaseHistograms {
    read: Histogram<u64>,
    control: Histogram<u64>,
    decide: Histogram<u64>,
    write: Histogram<u64>,
    record: Histogram<u64>,
}

impl Statistics {
    /// Empty histograms for a loop of this rate, their memory present: recording meets no page fault.
    #[must_use]
    pub fn new(rate_hz: f64) -> Self {
        let mut statistics = Self {
            rate_hz,
            cycles: 0,
            missed: 0,
            lateness: latency_histogram(),
            execution: latency_histogram(),
            phases: PhaseHistograms {
                read: latency_histogram(),
                control: latency_histogram(),
                decide: latency_histogram(),
                write: latency_histogram(),
                record: latency_histogram(),
            },
            pose_age: latency_histogram(),
            pose_to_command: latency_histogram(),
            pose_to_driver: latency_histogram(),
            round_trip: latency_histogram(),
        };
        // Writes every counter; fresh memory is not there before it is written.
        statistics.clear();
        statistics
    }

    /// Forgets everything. Allocates nothing; takes some hundred microseconds.
    pub fn clear(&mut self) {
        self.cycles = 0;
        self.missed = 0;
        let PhaseHistograms { read, control, decide, write, record } = &mut self.phases;
        let all = [
            &mut self.lateness,
            &mut self.execution,
            read,
            control,
            decide,
            write,
            record,
            &mut self.pose_age,
            &mut self.pose_to_command,
            &mut self.pose_to_driver,
            &mut self.round_trip,
        ];
        all.into_iter().for_each(Histogram::reset);
    }

    /// Counts one cycle. Allocates nothing.
    pub fn record(&mut self, timing: &CycleTiming) {
        self.cycles += 1;
        self.missed += timing.missed;
        record(&mut self.lateness, timing.lateness);
        record(&mut self.execution, timing.execution);
        record(&mut self.phases.read, timing.phases.read);
        record(&mut self.phases.control, timing.phases.control);
        record(&mut self.phases.decide, timing.phases.decide);
        record(&mut self.phases.write, timing.phases.write);
        record(&mut self.phases.record, timing.phases.record);
        if let Some(age) = timing.pose_age {
            record(&mut self.pose_age, age);
        }
        if let Some(latency) = timing.pose_to_command {
            record(&mut self.pose_to_command, latency);
        }
        if let Some(receipt) = &timing.receipt {
            record(&mut self.pose_to_driver, receipt.pose_to_driver);
            record(&mut self.round_trip, receipt.round_trip);
        }
    }

    /// Quantiles and maxima so far. Reads hundreds of thousands of counters: not for the loop.
    #[must_use]
    pub fn summary(&self) -> TimingSummary {
        TimingSummary {
            rate_hz: self.rate_hz,
            cycles: self.cycles,
            missed: self.missed,
            lateness_us: latency_summary(&self.lateness),
            execution_us: latency_summary(&self.execution),
            phases_us: PhaseSummary {
                read: latency_summary(&self.phases.read),
                control: latency_summary(&self.phases.control),
                decide: latency_summary(&self.phases.decide),
                write: latency_summary(&self.phases.write),
                record: latency_summary(&self.phases.record),
            },
            pose_age_us: latency_summary(&self.pose_age),
            pose_to_command_us: latency_summary(&self.pose_to_command),
            pose_to_driver_us: latency_summary(&self.pose_to_driver),
            round_trip_us: latency_summary(&self.round_trip),
        }
    }

    fn minute(&self) -> MinuteTiming {
        MinuteTiming { timing: self.summary(), histograms: self.histograms() }
    }

    /// Lateness and execution bin by bin. Allocates, and reads as many counters: not for the loop.
    #[must_use]
    pub fn histograms(&self) -> TimingHistograms {
        TimingHistograms { lateness_us: bins(&self.lateness), execution_us: bins(&self.execution) }
    }
}

/// What one minute came to.
#[derive(Debug, Clone, PartialEq)]
pub struct MinuteTiming {
    /// Quantiles and maxima.
    pub timing: TimingSummary,
    /// The same cycles, bin by bin.
    pub histograms: TimingHistograms,
}

/// The same minute by minute: what the last whole one came to. Minutes are counted from the first cycle on.
#[derive(Debug)]
pub struct MinuteStatistics {
    current: Statistics,
    /// The last whole minute.
    over: Statistics,
    end: Option<Stamp>,
    last: Option<TimingSummary>,
    /// True until the last whole minute was taken.
    is_new: bool,
}

impl MinuteStatistics {
    /// Before the first minute of a loop of this rate.
    #[must_use]
    pub fn new(rate_hz: f64) -> Self {
        let (current, over) = (Statistics::new(rate_hz), Statistics::new(rate_hz));
        Self { current, over, end: None, last: None, is_new: false }
    }

    /// Counts one cycle that began at `now`. Allocates nothing; the first of a minute also sums up the one
    /// before.
    pub fn record(&mut self, now: Stamp, timing: &CycleTiming) {
        let end = *self.end.get_or_insert(now.after(MINUTE));
        if now >= end {
            std::mem::swap(&mut self.current, &mut self.over);
            self.current.clear();
            self.last = Some(self.over.summary());
            self.is_new = true;
            // Whole minutes, also when none of their cycles ran.
            let minutes = now.since(end).as_secs() / MINUTE.as_secs() + 1;
            self.end = Some(end.after(Duration::from_secs(minutes * MINUTE.as_secs())));
        }
        self.current.record(timing);
    }

    /// What the last whole minute in which cycles ran came to.
    #[must_use]
    pub fn last(&self) -> Option<&TimingSummary> {
        self.last.as_ref()
    }

    /// The last whole minute, once. Allocates.
    pub fn take_over(&mut self) -> Option<MinuteTiming> {
        std::mem::take(&mut self.is_new).then(|| self.over.minute())
    }

    /// The minute that is not over yet, for the end of a run; `None` when no cycle of it ran. Allocates.
    #[must_use]
    pub fn rest(&self) -> Option<MinuteTiming> {
        (self.current.cycles > 0).then(|| self.current.minute())
    }
}

/// An empty histogram of times in ns, as the loop's are kept: to three digits, up to what is longest.
#[must_use]
#[expect(clippy::missing_panics_doc, reason = "the bounds are constants that it accepts")]
pub fn latency_histogram() -> Histogram<u64> {
    Histogram::new_with_bounds(1, LONGEST_NS, DIGITS).expect("the bounds are constants that it accepts")
}

fn record(histogram: &mut Histogram<u64>, duration: Duration) {
    histogram.saturating_record(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX));
}

/// Quantiles of a histogram of times in ns; zeros of an empty one.
#[must_use]
pub fn latency_summary(histogram: &Histogram<u64>) -> LatencySummary {
    let microseconds = |nanoseconds: u64| nanoseconds as f64 * 1e-3;
    let quantile = |share: f64| microseconds(histogram.value_at_quantile(share));
    LatencySummary {
        p50: quantile(0.5),
        p99: quantile(0.99),
        p999: quantile(0.999),
        p9999: quantile(0.9999),
        max: microseconds(histogram.max()),
    }
}

/// The counters gathered into bins of equal width on a logarithmic axis.
fn bins(histogram: &Histogram<u64>) -> Vec<Bin> {
    let mut bins: Vec<(i32, u64)> = Vec::new();
    for counter in histogram.iter_recorded() {
        // Times are nanoseconds, 1 at least; one on an edge belongs below it.
        let time = counter.value_iterated_to().max(1) as f64;
        let number = (TimingHistograms::PER_OCTAVE * time.log2()).ceil() as i32;
        match bins.last_mut().filter(|last| last.0 == number) {
            Some(last) => last.1 += counter.count_at_value(),
            None => bins.push((number, counter.count_at_value())),
        }
    }
    let edge = |number: i32| 1e-3 * (f64::from(number) / TimingHistograms::PER_OCTAVE).exp2();
    bins.into_iter().map(|(number, cycles)| Bin { up_to_us: edge(number), cycles }).collect()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use magsteer_hal::Stamp;

    use super::{
        CycleTiming, LatencySummary, MinuteStatistics, MinuteTiming, PhaseTimes, Receipt, Statistics,
    };

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
    fn bins_hold_every_cycle_below_an_edge_that_is_near() {
        let mut statistics = Statistics::new(1_000.0);
        let times = [0, 1, 7, 7, 800, 50_000];
        times.into_iter().for_each(|microseconds| statistics.record(&cycle(microseconds)));
        let bins = statistics.histograms().lateness_us;
        assert_eq!(bins.iter().map(|bin| bin.cycles).collect::<Vec<_>>(), [1, 1, 2, 1, 1]);
        for (bin, time) in bins.iter().zip([0.001, 1.0, 7.0, 800.0, 50_000.0]) {
            // An eighth of an octave, and the histogram's three digits.
            assert!(bin.up_to_us >= time && bin.up_to_us < 1.1 * time, "{bin:?} for {time}");
        }
        assert!(statistics.histograms().execution_us.iter().map(|bin| bin.cycles).sum::<u64>() == 6);
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

    fn at(seconds: f64) -> Stamp {
        Stamp::from_nanoseconds(((1_000.0 + seconds) * 1e9) as u64)
    }

    #[test]
    fn each_minute_is_summed_up_by_itself_and_its_maximum_forgotten_after() {
        let mut minutes = MinuteStatistics::new(10.0);
        for tick in 0..1_800_u32 {
            assert_eq!(minutes.last().is_some(), tick > 600, "at {tick}");
            let stall = if tick == 300 { 5_000 } else { 10 };
            minutes.record(at(f64::from(tick) * 0.1), &cycle(stall));
            let expected = if tick < 1_200 { 5_000.0 } else { 10.0 };
            if let Some(last) = minutes.last() {
                assert_eq!(last.cycles, 600, "at {tick}");
                assert!(is_near(last.lateness_us.max, expected), "at {tick}: {last:?}");
            }
            let taken = minutes.take_over();
            assert_eq!(taken.is_some(), tick == 600 || tick == 1_200, "at {tick}");
            if let Some(MinuteTiming { timing, histograms }) = taken {
                assert!(is_near(timing.lateness_us.max, expected), "at {tick}: {timing:?}");
                let bins = &histograms.lateness_us;
                assert_eq!(bins.iter().map(|bin| bin.cycles).sum::<u64>(), 600);
                assert!(bins.last().is_some_and(|bin| bin.up_to_us >= expected), "at {tick}: {bins:?}");
            }
        }
        let rest = minutes.rest().expect("a part of the third minute");
        assert_eq!(rest.timing.cycles, 600);
    }

    #[test]
    fn a_stall_of_minutes_ends_the_minute_that_it_began_in_and_belongs_to_the_one_that_it_ends_in() {
        let mut minutes = MinuteStatistics::new(10.0);
        minutes.record(at(0.0), &cycle(1));
        minutes.record(at(59.9), &cycle(1));
        minutes.record(at(200.0), &CycleTiming { missed: 1_400, ..cycle(140_000_000) });
        let first = minutes.last().expect("it is over");
        assert_eq!((first.cycles, first.missed), (2, 0));
        minutes.record(at(239.9), &cycle(1));
        assert_eq!(minutes.last().map(|last| last.cycles), Some(2), "the fourth minute is not over");
        minutes.record(at(240.0), &cycle(1));
        assert_eq!(minutes.last().map(|last| (last.cycles, last.missed)), Some((2, 1_400)));
    }

    #[test]
    fn phases_and_receipts_are_counted_apart() {
        let mut statistics = Statistics::new(1_000.0);
        let us = Duration::from_micros;
        let phases = PhaseTimes { read: us(1), control: us(20), decide: us(3), write: us(4), record: us(5) };
        let receipt = Receipt { pose_to_driver: us(6_000), round_trip: us(900) };
        statistics.record(&CycleTiming { phases, execution: phases.total(), ..cycle(7) });
        statistics.record(&CycleTiming { phases, receipt: Some(receipt), ..cycle(7) });
        let summary = statistics.summary();
        let found = summary.phases_us;
        let latencies = [found.read, found.control, found.decide, found.write, found.record];
        for (latency, expected) in latencies.into_iter().zip([1.0, 20.0, 3.0, 4.0, 5.0]) {
            assert!(is_near(latency.p50, expected) && is_near(latency.max, expected), "{latency:?}");
        }
        assert!(is_near(summary.execution_us.max, 33.0));
        assert!(is_near(summary.pose_to_driver_us.p50, 6_000.0) && is_near(summary.round_trip_us.p50, 900.0));
    }

    /// To the histogram's three digits.
    fn is_near(found: f64, expected: f64) -> bool {
        (found / expected - 1.0).abs() < 2e-3
    }
}
