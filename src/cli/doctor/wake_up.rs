//! Wake-ups at the loop's rate and priority, measured: what no file of the kernel tells.
//!
//! Terms as in the daemon: *lateness* from the awaited deadline to the wake-up; a period is *missed* when it
//! was over by then. Method: a thread set up as the loop's waits as the loop does and does nothing else, so
//! that what is measured is the machine's part of the daemon's lateness.

use std::time::Duration;

use magsteer::daemon::idle::IdleBound;
use magsteer::daemon::kernel::{RealtimeRequest, request_realtime};
use magsteer::daemon::realtime::RealtimeReport;
use magsteer::daemon::{Clock, CycleTiming, DaemonConfig, LatencySummary, Pace, Statistics};
use magsteer_hal::Stamp;
use serde::Serialize;

use super::finding::Finding;

/// What to measure.
#[derive(Debug, Clone, Copy)]
pub struct Trial {
    pub pace: Pace,
    pub priority: u32,
    pub cpu: Option<u32>,
    pub idle_latency_us: Option<u32>,
    pub duration: Duration,
}

impl Trial {
    /// As the daemon of this configuration; without one as the shipped one's.
    pub fn of(daemon: Option<&DaemonConfig>, duration: Duration) -> Self {
        let shipped = Pace { period: Duration::from_millis(1), spin: Duration::ZERO };
        Self {
            pace: daemon.map_or(shipped, DaemonConfig::pace),
            priority: daemon.map_or(80, |daemon| daemon.priority),
            cpu: daemon.and_then(|daemon| daemon.cpu),
            idle_latency_us: daemon.and_then(|daemon| daemon.idle_latency_us),
            duration,
        }
    }
}

/// Wake-ups up to a lateness, and beyond that of the row before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Row {
    pub up_to_us: u64,
    pub count: u64,
}

/// What was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WakeUps {
    pub rate_hz: f64,
    pub cycles: u64,
    pub missed: u64,
    pub lateness_us: LatencySummary,
    /// By powers of two.
    pub histogram: Vec<Row>,
    /// What the kernel granted to the measuring thread.
    pub realtime: String,
}

/// Measures in a thread of its own, which leaves the caller's policy alone.
///
/// # Errors
/// When no thread can be started.
pub fn measure(trial: &Trial) -> std::io::Result<WakeUps> {
    let trial = *trial;
    let thread = std::thread::Builder::new().name("magsteer-wake".to_owned()).spawn(move || watch(&trial))?;
    thread.join().map_err(|_| std::io::Error::other("the measuring thread panicked"))
}

fn watch(trial: &Trial) -> WakeUps {
    let rate_hz = 1.0 / trial.pace.period.as_secs_f64();
    let mut statistics = Statistics::new(rate_hz);
    let mut rows = Rows::default();
    // Memory is the daemon's own affair: to lock this program's tells nothing of the machine.
    let request = RealtimeRequest { priority: trial.priority, cpu: trial.cpu, lock_memory: false };
    let mut realtime: RealtimeReport = request_realtime(&request);
    let idle = trial.idle_latency_us.map(IdleBound::hold);
    realtime.items.extend(idle.as_ref().map(|idle| idle.item.clone()));
    let mut clock = Clock::start(trial.pace);
    let end = Stamp::now().after(trial.duration);
    loop {
        let tick = clock.wait();
        let timing = CycleTiming { lateness: tick.lateness, missed: tick.missed, ..CycleTiming::default() };
        statistics.record(&timing);
        rows.take(tick.lateness);
        if tick.now >= end {
            break;
        }
    }
    let summary = statistics.summary();
    WakeUps {
        rate_hz,
        cycles: summary.cycles,
        missed: summary.missed,
        lateness_us: summary.lateness_us,
        histogram: rows.into_rows(),
        realtime: realtime.to_string(),
    }
}

/// The last is for 18 minutes and all beyond.
const ROWS: usize = 32;

/// Counts by powers of two of a microsecond.
#[derive(Debug, Default)]
struct Rows([u64; ROWS]);

impl Rows {
    fn take(&mut self, lateness: Duration) {
        let microseconds = lateness.as_nanos().div_ceil(1_000).max(1);
        // 1 in the first, 2 in the second, 3 and 4 in the third.
        let row = (u128::BITS - (microseconds - 1).leading_zeros()) as usize;
        self.0[row.min(self.0.len() - 1)] += 1;
    }

    fn into_rows(self) -> Vec<Row> {
        let used = |count: &u64| *count > 0;
        let (Some(first), Some(last)) = (self.0.iter().position(used), self.0.iter().rposition(used)) else {
            return Vec::new();
        };
        (first..=last).map(|row| Row { up_to_us: 1 << row, count: self.0[row] }).collect()
    }
}

/// What the measurement means for a loop of that rate, and for the limits of `daemon`.
pub fn judge(measured: &WakeUps, daemon: Option<&DaemonConfig>) -> Finding {
    const CHECK: &str = "wake-ups";
    const MEND: &str = "mend the lines above, from the top; then measure anew: magsteer doctor --seconds 60";
    let LatencySummary { p50, p99, max, .. } = measured.lateness_us;
    let period_us = 1e6 / measured.rate_hz;
    let found = format!(
        "at {:.0} Hz late by {p50:.0} us (median), {p99:.0} (99 of 100), {max:.0} (maximum); {} of {} periods missed",
        measured.rate_hz,
        measured.missed,
        measured.cycles + measured.missed,
    );
    let pause_max_us = daemon.map(|daemon| 1e3 * daemon.command_validity_ms);
    if let Some(validity) = pause_max_us.filter(|validity| max >= *validity) {
        let found = format!(
            "{found}: longer than command_validity_ms = {}, the driver would ramp down",
            validity * 1e-3
        );
        return Finding::fail(CHECK, found, MEND);
    }
    let missed_share = measured.missed as f64 / (measured.cycles + measured.missed).max(1) as f64;
    if p99 >= period_us || missed_share >= 0.01 {
        return Finding::fail(CHECK, found, MEND);
    }
    // A fifth of the period leaves the cycle its time.
    if p99 >= 0.2 * period_us || measured.missed > 0 {
        return Finding::warn(CHECK, found, MEND);
    }
    Finding::pass(CHECK, found)
}

/// The histogram for people: a row for each power of two, a bar by the logarithm of its count.
pub fn picture(measured: &WakeUps) -> String {
    let mut text = String::from("      late by (us)      wake-ups\n");
    for row in &measured.histogram {
        let bar = "#".repeat(row.count.checked_ilog2().map_or(0, |log| log as usize + 1));
        text += &format!("      up to {:>9} {:>10}  {bar}\n", row.up_to_us, row.count);
    }
    text
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::super::consequences::tests::daemon;
    use super::super::finding::Level;
    use super::{LatencySummary, Row, Rows, Trial, WakeUps, judge, measure, picture};

    fn measured(p99: f64, max: f64, missed: u64) -> WakeUps {
        WakeUps {
            rate_hz: 1_000.0,
            cycles: 2_000 - missed,
            missed,
            lateness_us: LatencySummary { p50: 5.0, p99, max, ..LatencySummary::default() },
            histogram: vec![Row { up_to_us: 8, count: 1_990 }, Row { up_to_us: 16, count: 0 }],
            realtime: String::new(),
        }
    }

    #[test]
    fn wake_ups_are_judged_against_the_period_and_the_commands_validity() {
        let cases = [
            (measured(50.0, 800.0, 0), Level::Pass),
            (measured(250.0, 800.0, 0), Level::Warn),
            (measured(50.0, 3_000.0, 2), Level::Warn),
            (measured(1_200.0, 3_000.0, 2), Level::Fail),
            (measured(50.0, 3_000.0, 30), Level::Fail),
            (measured(50.0, 120_000.0, 1), Level::Fail),
        ];
        for (measured, level) in cases {
            assert_eq!(judge(&measured, Some(&daemon())).level, level, "{measured:?}");
        }
        assert_eq!(judge(&measured(50.0, 120_000.0, 1), None).level, Level::Warn, "no limit is known");
    }

    #[test]
    fn rows_hold_what_is_late_by_up_to_their_power_of_two() {
        let mut rows = Rows::default();
        for nanoseconds in [0, 1_000, 1_001, 2_000, 2_001, 4_000, 4_001, 70_000_000_000_000_000] {
            rows.take(Duration::from_nanos(nanoseconds));
        }
        let rows = rows.into_rows();
        let counts: Vec<(u64, u64)> = rows.iter().take(4).map(|row| (row.up_to_us, row.count)).collect();
        assert_eq!(counts, [(1, 2), (2, 2), (4, 2), (8, 1)]);
        assert_eq!(rows.last().map(|row| row.count), Some(1), "what is beyond them all counts in the last");
        assert!(Rows::default().into_rows().is_empty());
    }

    #[test]
    fn a_measurement_counts_every_period_as_run_or_missed() {
        let trial = Trial::of(None, Duration::from_millis(50));
        let measured = measure(&trial).expect("a thread");
        assert!(measured.cycles + measured.missed >= 49, "{measured:?}");
        assert_eq!(measured.histogram.iter().map(|row| row.count).sum::<u64>(), measured.cycles);
        assert_eq!(picture(&measured).lines().count(), 1 + measured.histogram.len());
    }
}
