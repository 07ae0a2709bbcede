//! The soak itself: steers, measures minute by minute, judges.

use std::fs::File;
use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use magsteer::daemon::{StopFlag, TimingSummary};
use magsteer_hal::operator::StatusMessage;
use serde::Serialize;

use super::measures::Measures;
use super::process::{DaemonProcess, Met};
use super::steering::Steering;
use super::thresholds::{Judged, Thresholds};
use crate::cli::doctor::{Machine, Stolen};
use crate::cli::exit::{Exit, Failure, cannot_create};
use crate::cli::output;
use crate::cli::play::LiveLine;

/// How often the channels are looked at.
const POLL: Duration = Duration::from_millis(10);
/// How often the line on the terminal is drawn anew.
const REDRAW: Duration = Duration::from_millis(500);
const MINUTE: Duration = Duration::from_secs(60);
/// How often counts are judged: what broke a threshold is among the seconds that are saved.
const COUNTS_EVERY: Duration = Duration::from_millis(500);
/// The recorder goes on for half a second, then writes some megabytes.
const SAVE_WAIT: Duration = Duration::from_secs(15);

/// What to do for how long.
pub struct Plan {
    pub duration: Duration,
    pub thresholds: Thresholds,
    /// Where the lines of the minutes go.
    pub lines: PathBuf,
    /// Also print them.
    pub json: bool,
}

/// How it went.
#[derive(Debug)]
pub struct Course {
    pub minutes: Vec<Measures>,
    /// Over the whole soak.
    pub end: Measures,
    /// Thresholds as last judged.
    pub judged: Vec<Judged>,
    /// Why it did not pass, in words; empty when it passed.
    pub broken: Vec<String>,
}

/// Steers until the time is over, a threshold is broken, steering ends, or `stop` is set. `check` fails when
/// what is soaked died; `process` looks the daemon's process up.
///
/// # Errors
/// What `check` says; when the daemon falls silent or does not come to steer; when a line cannot be written.
pub fn run(
    plan: &Plan,
    steering: &mut Steering<'_>,
    process: impl FnOnce() -> Option<DaemonProcess>,
    mut check: impl FnMut() -> anyhow::Result<()>,
    stop: &StopFlag,
) -> anyhow::Result<Course> {
    let mut lines = Lines::create(plan)?;
    while stop.requested().is_none() && !steering.is_engaged() {
        check()?;
        steering.poll()?;
        std::thread::sleep(POLL);
    }
    let first = steering.status().unwrap_or_default();
    let mut watch = Watch::new(first, process());
    let mut minutes: Vec<Measures> = Vec::new();
    let mut line = LiveLine::new();
    let mut judged = Vec::new();
    let mut counted = Instant::now();
    let ended = loop {
        steering.poll()?;
        check()?;
        let elapsed = watch.begin.elapsed();
        if stop.requested().is_some() {
            break Some("interrupted".to_owned());
        }
        if let Some(cause) = steering.lost() {
            break Some(format!("the daemon stopped steering: {cause}"));
        }
        if elapsed >= MINUTE * (minutes.len() as u32 + 1) {
            let measures = watch.minute(steering, minutes.len() as u64 + 1);
            lines.write(&measures)?;
            judged = plan.thresholds.judge(&measures);
            line.milestone(|| measures.line());
            minutes.push(measures);
            if judged.iter().any(|threshold| !threshold.held) {
                break None;
            }
        }
        if counted.elapsed() >= COUNTS_EVERY {
            counted = Instant::now();
            let measures = watch.now(steering);
            if plan.thresholds.is_exceeded_by_counts(&measures) {
                judged = plan.thresholds.judge(&measures);
                break None;
            }
        }
        // After the minute that ends with it.
        if elapsed >= plan.duration {
            break None;
        }
        line.draw(|| watch.now(steering).line(), REDRAW);
        std::thread::sleep(POLL);
    };
    let end = watch.now(steering);
    line.draw(|| end.line(), Duration::ZERO);
    line.end();
    if judged.iter().all(|threshold| threshold.held) {
        judged = plan.thresholds.judge(&end);
    }
    let mut broken: Vec<String> =
        judged.iter().filter(|threshold| !threshold.held).map(ToString::to_string).collect();
    if !broken.is_empty() && !steering.save(SAVE_WAIT) {
        output::note("the last seconds were not saved: the daemon has no recorder, or did not write in time");
    }
    broken.extend(ended);
    Ok(Course { minutes, end, judged, broken })
}

/// What counts are told against.
struct Watch {
    begin: Instant,
    machine: Machine,
    process: Option<DaemonProcess>,
    first: StatusMessage,
    met: Option<Met>,
    rss_mb: Option<f64>,
    stolen_begin: Option<Stolen>,
    stolen_minute: Option<Stolen>,
}

impl Watch {
    fn new(first: StatusMessage, process: Option<DaemonProcess>) -> Self {
        let machine = Machine::this();
        let stolen = Stolen::read(&machine);
        Self {
            begin: Instant::now(),
            met: process.as_ref().and_then(DaemonProcess::met),
            rss_mb: process.as_ref().and_then(DaemonProcess::rss_mb),
            process,
            first,
            stolen_begin: stolen,
            stolen_minute: stolen,
            machine,
        }
    }

    /// The minute that is over.
    fn minute(&mut self, steering: &mut Steering<'_>, minute: u64) -> Measures {
        let status = steering.status().unwrap_or_default();
        let timing = TimingSummary::of_last_minute(&status);
        let stolen = Stolen::read(&self.machine);
        let mut measures =
            self.measures(steering, &timing.unwrap_or_else(|| TimingSummary::of_status(&status)));
        measures.minute = minute;
        measures.steal_percent = share(stolen, self.stolen_minute);
        self.stolen_minute = stolen;
        if minute == 1 {
            self.rss_mb = measures.rss_mb;
            measures.rss_growth_mb = measures.rss_mb.map(|_| 0.0);
        }
        measures
    }

    /// The soak so far.
    fn now(&self, steering: &mut Steering<'_>) -> Measures {
        let status = steering.status().unwrap_or_default();
        self.measures(steering, &TimingSummary::of_status(&status))
    }

    fn measures(&self, steering: &mut Steering<'_>, timing: &TimingSummary) -> Measures {
        let status = steering.status().unwrap_or_default();
        let elapsed = self.begin.elapsed();
        let met = self.process.as_ref().and_then(DaemonProcess::met).zip(self.met);
        let rss_mb = self.process.as_ref().and_then(DaemonProcess::rss_mb);
        let load = self.machine.text("/proc/loadavg");
        let tally = steering.tally();
        let missed = status.missed.saturating_sub(self.first.missed);
        Measures {
            minute: elapsed.as_secs() / MINUTE.as_secs(),
            elapsed_s: elapsed.as_secs_f64(),
            // Numbers count skipped periods too.
            cycles: status.cycle.saturating_sub(self.first.cycle).saturating_sub(missed),
            missed,
            lateness_us: timing.lateness_us,
            execution_us: timing.execution_us,
            pose_to_command_us: timing.pose_to_command_us,
            pose_to_driver_us: timing.pose_to_driver_us,
            rss_mb,
            rss_growth_mb: rss_mb.zip(self.rss_mb).map(|(now, before)| now - before),
            alloc_in_cycle: status.loop_allocations.saturating_sub(self.first.loop_allocations),
            page_faults: met.map(|(now, before)| now.page_faults.saturating_sub(before.page_faults)),
            preemptions: met.map(|(now, before)| now.preemptions.saturating_sub(before.preemptions)),
            records_dropped: status.records_dropped.saturating_sub(self.first.records_dropped),
            settled: tally.settled,
            unsettled: tally.unsettled,
            trips: tally.trips,
            causes: tally.causes.clone(),
            steal_percent: share(Stolen::read(&self.machine), self.stolen_begin),
            load_average: load.and_then(|text| text.split_whitespace().next()?.parse().ok()),
        }
    }
}

fn share(now: Option<Stolen>, before: Option<Stolen>) -> Option<f64> {
    now.zip(before).map(|(now, before)| now.percent_since(&before))
}

/// `soak.jsonl`, and standard output where asked for.
struct Lines {
    file: File,
    path: PathBuf,
    json: bool,
}

impl Lines {
    fn create(plan: &Plan) -> anyhow::Result<Self> {
        let file = File::create(&plan.lines).map_err(|error| cannot_create(&plan.lines, &error))?;
        Ok(Self { file, path: plan.lines.clone(), json: plan.json })
    }

    fn write(&mut self, line: &impl Serialize) -> anyhow::Result<()> {
        let text = serde_json::to_string(line).context("a line cannot be written as JSON")?;
        // In one piece, so that a soak that is killed leaves whole lines.
        let written = self.file.write_all(format!("{text}\n").as_bytes());
        written.map_err(|error| {
            Failure::with(Exit::Io, anyhow!("{}: cannot be written: {error}", self.path.display()))
        })?;
        if self.json { output::json(line) } else { Ok(()) }
    }
}
