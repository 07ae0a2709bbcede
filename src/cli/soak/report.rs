//! What a soak leaves: the last line, `report.json` and `report.md`.

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use magsteer::daemon::{LatencySummary, RunReport};
use serde::Serialize;

use super::course::Course;
use super::measures::Measures;
use super::provenance::Provenance;
use super::thresholds::Judged;
use crate::cli::exit::{Exit, Failure, cannot_create};
use crate::cli::sim_plant::PlantReport;

/// One line a minute, and the last one.
pub const LINES: &str = "soak.jsonl";

/// The last line; its keys are stable.
#[derive(Debug, Serialize)]
pub struct LastLine<'a> {
    pub passed: bool,
    pub hours: f64,
    #[serde(flatten)]
    pub end: &'a Measures,
    /// Each in words.
    pub broken: &'a [String],
    pub flights: &'a [PathBuf],
    pub folder: &'a Path,
}

/// `report.json`.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    #[serde(flatten)]
    pub last: LastLine<'a>,
    pub thresholds: &'a [Judged],
    pub minutes: &'a [Measures],
    pub machine: &'a Provenance,
    /// Null for a daemon that was attached to.
    pub daemon: Option<&'a RunReport>,
    /// Null likewise.
    pub plant: Option<&'a PlantReport>,
}

impl<'a> Report<'a> {
    pub fn new(
        course: &'a Course,
        machine: &'a Provenance,
        reports: Option<&'a (RunReport, PlantReport)>,
        folder: &'a Path,
    ) -> Self {
        let daemon = reports.map(|(daemon, _)| daemon);
        let last = LastLine {
            passed: course.broken.is_empty(),
            hours: course.end.elapsed_s / 3_600.0,
            end: &course.end,
            broken: &course.broken,
            flights: daemon.map_or(&[], |daemon| &daemon.flights),
            folder,
        };
        Self {
            last,
            thresholds: &course.judged,
            minutes: &course.minutes,
            machine,
            daemon,
            plant: reports.map(|(_, plant)| plant),
        }
    }

    /// Writes both files, and the last line below those of the minutes.
    ///
    /// # Errors
    /// When one cannot be written.
    pub fn write(&self, pictures: &[PathBuf]) -> anyhow::Result<()> {
        let json = serde_json::to_string_pretty(self)?;
        for (name, text) in [("report.json", json), ("report.md", self.markdown(pictures))] {
            let path = self.last.folder.join(name);
            fs::write(&path, text).map_err(|error| cannot_create(&path, &error))?;
        }
        let path = self.last.folder.join(LINES);
        let line = format!("{}\n", serde_json::to_string(&self.last)?);
        let appended = OpenOptions::new().append(true).open(&path);
        appended.and_then(|mut file| file.write_all(line.as_bytes())).map_err(|error| {
            Failure::with(Exit::Io, anyhow::anyhow!("{}: cannot be written: {error}", path.display()))
        })
    }

    /// For people.
    pub fn markdown(&self, pictures: &[PathBuf]) -> String {
        let LastLine { passed, hours, end, broken, flights, .. } = &self.last;
        let mut text = format!("# Soak: {}\n\n", if *passed { "passed" } else { "NOT passed" });
        text += &format!("{:.2} h ({:.0} s) of steering.\n", hours, end.elapsed_s);
        broken.iter().for_each(|why| text += &format!("\n- broken: {why}"));
        flights.iter().for_each(|flight| text += &format!("\n- flight: {}", flight.display()));
        text += &format!("\n## Thresholds\n\n{}", self.threshold_table());
        text += &format!("\n## Run\n\n{}\n{}", latency_table(end), count_table(end));
        for picture in pictures {
            let name = picture.file_name().unwrap_or_default().to_string_lossy();
            text += &format!("\n![{name}]({name})\n");
        }
        text + &format!("\n## Machine\n\n{}", self.machine_list())
    }

    fn threshold_table(&self) -> String {
        if self.thresholds.is_empty() {
            return "None were named.\n".to_owned();
        }
        let mut text = "| breaks when | found | held |\n|---|---|---|\n".to_owned();
        for Judged { threshold, value, held } in self.thresholds {
            let value = value.map_or("not known".to_owned(), short);
            text += &format!("| `{threshold}` | {value} | {} |\n", if *held { "yes" } else { "NO" });
        }
        text
    }

    fn machine_list(&self) -> String {
        let Provenance { program, profile, config_sha256, kernel, cpu_model, cpus, findings } = self.machine;
        let known = |text: &Option<String>| text.clone().unwrap_or_else(|| "not known".to_owned());
        let mut text = format!(
            "- program: {program}, {profile} build, configuration {}\n- kernel: {}\n- CPU: {cpus} x {}\n",
            config_sha256.get(..12).unwrap_or(config_sha256),
            known(kernel),
            known(cpu_model),
        );
        if let Some(daemon) = self.daemon {
            text += &format!("- real time, read back: {}\n", daemon.realtime);
        }
        for finding in findings {
            text += &format!("- {}: {} ({})\n", finding.check, finding.found, finding.level);
        }
        text
    }
}

fn latency_table(end: &Measures) -> String {
    let row = |name: &str, latency: &LatencySummary| {
        let LatencySummary { p50, p99, p999, p9999, max } = latency;
        format!("| {name} | {p50:.1} | {p99:.1} | {p999:.1} | {p9999:.1} | {max:.1} |\n")
    };
    [
        "| us | p50 | p99 | p99.9 | p99.99 | max |\n|---|---|---|---|---|---|\n".to_owned(),
        row("lateness", &end.lateness_us),
        row("execution", &end.execution_us),
        row("pose to command", &end.pose_to_command_us),
        row("pose to driver", &end.pose_to_driver_us),
    ]
    .concat()
}

fn count_table(end: &Measures) -> String {
    let known = |value: Option<f64>| value.map_or("not known".to_owned(), short);
    let causes: Vec<String> = end.causes.iter().map(|(cause, count)| format!("{cause}: {count}")).collect();
    let rows = [
        ("cycles", end.cycles.to_string()),
        ("periods missed", end.missed.to_string()),
        ("allocations in cycles, beyond the transport's", end.alloc_in_cycle.to_string()),
        ("daemon's memory (MB)", known(end.rss_mb)),
        ("its growth after the first minute (MB)", known(end.rss_growth_mb)),
        ("page faults of the loop's thread", known(end.page_faults.map(|count| count as f64))),
        ("preemptions of the loop's thread", known(end.preemptions.map(|count| count as f64))),
        ("steps settled, not settled", format!("{}, {}", end.settled, end.unsettled)),
        ("trips", end.trips.to_string()),
        ("causes", if causes.is_empty() { "none".to_owned() } else { causes.join("; ") }),
        ("time taken by the host (%)", known(end.steal_percent)),
        ("load average", known(end.load_average)),
    ];
    let rows: String = rows.iter().map(|(name, value)| format!("| {name} | {value} |\n")).collect();
    format!("| | |\n|---|---|\n{rows}")
}

/// At most two decimals.
fn short(value: f64) -> String {
    if value.fract() == 0.0 { format!("{value:.0}") } else { format!("{value:.2}") }
}
