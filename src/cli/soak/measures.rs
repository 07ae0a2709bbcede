//! What is known of a soak at the end of a minute; each number is a metric with a name.
//!
//! Counts are those since the soak began to steer. Times are those of the last whole minute of the daemon's
//! loop; at the end of the soak, and before there is such a minute, those since the daemon's start.

use std::collections::BTreeMap;

use magsteer::daemon::LatencySummary;
use serde::Serialize;

/// Metrics that count from the soak's begin, and so never fall.
pub const COUNTS: [&str; 9] = [
    "cycles",
    "missed",
    "alloc_in_cycle",
    "page_faults",
    "preemptions",
    "records_dropped",
    "settled",
    "unsettled",
    "trips",
];

/// One line of `soak.jsonl`. What is not known is null.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Measures {
    /// Whole minutes.
    pub minute: u64,
    pub elapsed_s: f64,
    pub cycles: u64,
    pub missed: u64,
    pub lateness_us: LatencySummary,
    pub execution_us: LatencySummary,
    pub pose_to_command_us: LatencySummary,
    /// As the driver stamped it.
    pub pose_to_driver_us: LatencySummary,
    /// Memory of the daemon that is present.
    pub rss_mb: Option<f64>,
    /// Against the end of the first minute; before, against the soak's begin.
    pub rss_growth_mb: Option<f64>,
    /// Allocations of the loop's thread in its cycles, beyond the transport's one a message.
    pub alloc_in_cycle: u64,
    /// Of the loop's thread.
    pub page_faults: Option<u64>,
    /// How often the loop's thread was taken off its CPU.
    pub preemptions: Option<u64>,
    /// Cycles that `lateness_us` does not count, because their records were lost.
    pub records_dropped: u64,
    /// Steps that settled.
    pub settled: u64,
    /// Steps that did not; those that a trip broke off count as neither.
    pub unsettled: u64,
    pub trips: u64,
    /// How often for which cause.
    pub causes: BTreeMap<&'static str, u64>,
    /// Of the last minute; at the end, of the soak.
    pub steal_percent: Option<f64>,
    /// Over the last minute, of the whole machine.
    pub load_average: Option<f64>,
}

impl Measures {
    /// Every metric by name; `None` where it is not known.
    pub fn values(&self) -> Vec<(String, Option<f64>)> {
        let count = |value: u64| Some(value as f64);
        let numbers = [
            ("cycles", count(self.cycles)),
            ("missed", count(self.missed)),
            ("rss_mb", self.rss_mb),
            ("rss_growth_mb", self.rss_growth_mb),
            ("alloc_in_cycle", count(self.alloc_in_cycle)),
            ("page_faults", self.page_faults.and_then(count)),
            ("preemptions", self.preemptions.and_then(count)),
            ("records_dropped", count(self.records_dropped)),
            ("settled", count(self.settled)),
            ("unsettled", count(self.unsettled)),
            ("trips", count(self.trips)),
            ("steal_percent", self.steal_percent),
            ("load_average", self.load_average),
        ];
        let mut values: Vec<_> = numbers.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        for (name, latency) in [
            ("lateness", &self.lateness_us),
            ("execution", &self.execution_us),
            ("pose_to_command", &self.pose_to_command_us),
            ("pose_to_driver", &self.pose_to_driver_us),
        ] {
            let LatencySummary { p50, p99, p999, p9999, max } = *latency;
            let quantiles = [("p50", p50), ("p99", p99), ("p999", p999), ("p9999", p9999), ("max", max)];
            values.extend(quantiles.map(|(quantile, value)| (format!("{name}_{quantile}_us"), Some(value))));
        }
        values
    }

    /// One line for people.
    pub fn line(&self) -> String {
        let rss = self.rss_mb.map_or(String::new(), |rss| format!("  {rss:.1} MB"));
        format!(
            "{}  {} cycles, {} missed  late p50 {:.0}, p99.99 {:.0}, max {:.0} us{rss}  {} allocations  steps {} settled, {} not  {} trips",
            clock(self.elapsed_s),
            self.cycles,
            self.missed,
            self.lateness_us.p50,
            self.lateness_us.p9999,
            self.lateness_us.max,
            self.alloc_in_cycle,
            self.settled,
            self.unsettled,
            self.trips,
        )
    }
}

/// Hours, minutes and seconds.
pub(super) fn clock(seconds: f64) -> String {
    let whole = seconds as u64;
    format!("{}:{:02}:{:02}", whole / 3_600, whole / 60 % 60, whole % 60)
}

#[cfg(test)]
mod tests {
    use super::{COUNTS, LatencySummary, Measures, clock};

    #[test]
    fn every_metric_has_a_name_of_its_own_and_the_value_that_the_line_has() {
        let lateness_us = LatencySummary { p50: 1.0, p99: 2.0, p999: 3.0, p9999: 4.0, max: 5.0 };
        let measures = Measures { lateness_us, unsettled: 7, rss_mb: Some(8.5), ..Measures::default() };
        let values = measures.values();
        let mut names: Vec<&String> = values.iter().map(|(name, _)| name).collect();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), values.len());
        let value = |name: &str| values.iter().find(|(found, _)| found == name).expect(name).1;
        assert_eq!(value("lateness_p9999_us"), Some(4.0));
        assert_eq!(value("lateness_max_us"), Some(5.0));
        assert_eq!((value("unsettled"), value("rss_mb")), (Some(7.0), Some(8.5)));
        assert_eq!(value("page_faults"), None);
        assert!(COUNTS.iter().all(|count| names.contains(&&(*count).to_owned())), "{names:?}");
    }

    #[test]
    fn elapsed_time_is_told_as_a_clock_does() {
        assert_eq!(clock(3.9), "0:00:03");
        assert_eq!(clock(36_061.0), "10:01:01");
    }
}
