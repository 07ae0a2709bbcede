//! What a loop's timing came to: quantiles in microseconds, as people and programs read them.
//!
//! The terms are those of [`super::statistics`]. The same numbers travel in status messages.

use magsteer_hal::operator::{LoopTiming, PhaseQuantiles, Quantiles, StatusMessage};
use serde::{Deserialize, Serialize};

/// Quantiles of a histogram, microseconds; all zero when nothing was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LatencySummary {
    /// Half of all values lie below.
    pub p50: f64,
    /// 99 of 100 values lie below.
    pub p99: f64,
    /// 999 of 1000 values lie below.
    pub p999: f64,
    /// 9999 of 10000 values lie below.
    pub p9999: f64,
    /// The greatest value.
    pub max: f64,
}

/// Execution time of each phase of a cycle; together they are the execution.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PhaseSummary {
    /// From the tick until requests and messages are taken.
    pub read: LatencySummary,
    /// The controller's step.
    pub control: LatencySummary,
    /// Supervisor and gate.
    pub decide: LatencySummary,
    /// Handing the command to the transport.
    pub write: LatencySummary,
    /// Putting the cycle's record together.
    pub record: LatencySummary,
}

/// What the timing came to, under the keys that other programs read.
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
    /// The same by phase.
    pub phases_us: PhaseSummary,
    /// Age of the newest poses in each cycle that had any.
    pub pose_age_us: LatencySummary,
    /// From exposure to command, for each command computed from fresh poses.
    pub pose_to_command_us: LatencySummary,
    /// From exposure to the driver's receipt of that command, as the driver stamped it.
    pub pose_to_driver_us: LatencySummary,
    /// From the publication of the poses to the same receipt.
    pub round_trip_us: LatencySummary,
}

/// Cycles whose time lies between the former bin's edge and this one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bin {
    /// Upper edge.
    pub up_to_us: f64,
    /// How many.
    pub cycles: u64,
}

/// Cycles by their times: eight bins an octave, upwards, the empty ones left out.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TimingHistograms {
    /// Lateness of each cycle.
    pub lateness_us: Vec<Bin>,
    /// Execution time of each cycle.
    pub execution_us: Vec<Bin>,
}

impl TimingHistograms {
    /// Bins an octave.
    pub const PER_OCTAVE: f64 = 8.0;
}

impl From<LatencySummary> for Quantiles {
    fn from(LatencySummary { p50, p99, p999, p9999, max }: LatencySummary) -> Self {
        Self { p50_us: p50, p99_us: p99, p999_us: p999, p9999_us: p9999, max_us: max }
    }
}

impl From<Quantiles> for LatencySummary {
    fn from(Quantiles { p50_us, p99_us, p999_us, p9999_us, max_us }: Quantiles) -> Self {
        Self { p50: p50_us, p99: p99_us, p999: p999_us, p9999: p9999_us, max: max_us }
    }
}

impl From<PhaseSummary> for PhaseQuantiles {
    fn from(PhaseSummary { read, control, decide, write, record }: PhaseSummary) -> Self {
        Self {
            read: read.into(),
            control: control.into(),
            decide: decide.into(),
            write: write.into(),
            record: record.into(),
        }
    }
}

impl From<PhaseQuantiles> for PhaseSummary {
    fn from(PhaseQuantiles { read, control, decide, write, record }: PhaseQuantiles) -> Self {
        Self {
            read: read.into(),
            control: control.into(),
            decide: decide.into(),
            write: write.into(),
            record: record.into(),
        }
    }
}

impl From<TimingSummary> for LoopTiming {
    fn from(summary: TimingSummary) -> Self {
        Self {
            cycles: summary.cycles,
            missed: summary.missed,
            lateness: summary.lateness_us.into(),
            execution: summary.execution_us.into(),
            phases: summary.phases_us.into(),
            pose_age: summary.pose_age_us.into(),
            pose_to_command: summary.pose_to_command_us.into(),
            pose_to_driver: summary.pose_to_driver_us.into(),
            round_trip: summary.round_trip_us.into(),
        }
    }
}

impl TimingSummary {
    /// The timing since the daemon's start that a status message carries.
    #[must_use]
    pub fn of_status(status: &StatusMessage) -> Self {
        Self::of_message(&status.timing, status.rate_hz)
    }

    /// The timing of the last whole minute that a status message carries; `None` during the first.
    #[must_use]
    pub fn of_last_minute(status: &StatusMessage) -> Option<Self> {
        (status.last_minute.cycles > 0).then(|| Self::of_message(&status.last_minute, status.rate_hz))
    }

    fn of_message(timing: &LoopTiming, rate_hz: f64) -> Self {
        Self {
            rate_hz,
            cycles: timing.cycles,
            missed: timing.missed,
            lateness_us: timing.lateness.into(),
            execution_us: timing.execution.into(),
            phases_us: timing.phases.into(),
            pose_age_us: timing.pose_age.into(),
            pose_to_command_us: timing.pose_to_command.into(),
            pose_to_driver_us: timing.pose_to_driver.into(),
            round_trip_us: timing.round_trip.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use magsteer_hal::operator::StatusMessage;

    use super::{LatencySummary, PhaseSummary, TimingSummary};

    /// Numbers that are all different.
    fn summary() -> TimingSummary {
        let mut next = 0.0;
        let mut latency = || {
            let mut value = || {
                next += 1.0;
                next
            };
            LatencySummary { p50: value(), p99: value(), p999: value(), p9999: value(), max: value() }
        };
        TimingSummary {
            rate_hz: 1_000.0,
            cycles: 7,
            missed: 8,
            lateness_us: latency(),
            execution_us: latency(),
            phases_us: PhaseSummary {
                read: latency(),
                control: latency(),
                decide: latency(),
                write: latency(),
                record: latency(),
            },
            pose_age_us: latency(),
            pose_to_command_us: latency(),
            pose_to_driver_us: latency(),
            round_trip_us: latency(),
        }
    }

    #[test]
    fn a_status_message_carries_every_number_there_and_back() {
        let summary = summary();
        let mut status =
            StatusMessage { timing: summary.into(), rate_hz: 1_000.0, ..StatusMessage::default() };
        assert_eq!(TimingSummary::of_status(&status), summary);
        assert_eq!(TimingSummary::of_last_minute(&status), None, "the first minute is not over");
        status.last_minute = summary.into();
        assert_eq!(TimingSummary::of_last_minute(&status), Some(summary));
    }

    #[test]
    fn the_summary_has_the_published_keys() {
        let value = serde_json::to_value(summary()).expect("plain data");
        for key in ["rate_hz", "cycles", "missed"] {
            assert!(value.get(key).is_some(), "{key}");
        }
        let latencies = [
            "lateness_us",
            "execution_us",
            "pose_age_us",
            "pose_to_command_us",
            "pose_to_driver_us",
            "round_trip_us",
        ];
        let phases = ["read", "control", "decide", "write", "record"].map(|name| &value["phases_us"][name]);
        for latency in latencies.map(|name| &value[name]).into_iter().chain(phases) {
            for key in ["p50", "p99", "p999", "p9999", "max"] {
                assert!(latency[key].is_number(), "{key} of {latency}");
            }
        }
    }
}
