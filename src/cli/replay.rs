//! `magsteer replay`: does a recorded run again and compares what is commanded, bit for bit.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Args;
use magsteer::config::Document;
use magsteer::recording::{Difference, Recording, ReplayError, ReplayReport, recorded_document, replay};
use serde::Serialize;

use super::exit::{Exit, Failure};
use super::output;
use super::runs::refused_recording;

/// Fields of a difference that are printed for people.
const FIELDS_SHOWN: usize = 12;

/// Feed a recording's ticks, messages and requests to the same control loop and compare its commands.
///
/// Ends with 0 when every command came out bit for bit; with --check, with 1 at the first cycle that did not.
/// With 65 when cycles are missing in the recording, since what the loop was by then is not known.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer replay runs/run-20261122-141500 --check\n  \
    magsteer replay runs/run-20261122-141500 --set control.disturbance.tracking_per_s=10")]
pub struct Replay {
    /// Folder of the run, or its recording.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// End with 1 when a command differs.
    #[arg(long)]
    check: bool,
    /// Another configuration of the same rig, in place of the recorded one.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Another number in the configuration, as control.disturbance.tracking_per_s=10; may be given several
    /// times.
    #[arg(long, value_name = "KEY=NUMBER")]
    set: Vec<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `equal`, `commands`, `difference` and `is_complete`.
#[derive(Serialize)]
struct Answer<'a> {
    file: &'a std::path::Path,
    #[serde(flatten)]
    report: &'a ReplayReport,
    /// The recorder's word that the run's last cycle is there; null when it did not come to say.
    is_complete: Option<bool>,
}

impl Replay {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let recording = Recording::open(&self.run).map_err(refused_recording)?;
        let document = self.document(&recording)?;
        let report = replay(&recording, Some(&document)).map_err(refused)?;
        let metadata = recording.metadata().map_err(refused_recording)?;
        let is_complete = metadata
            .get("magsteer-end")
            .and_then(|end| end.get("is_complete"))
            .map(|is_complete| is_complete == "true");
        if self.json {
            output::json(&Answer { file: recording.path(), report: &report, is_complete })?;
        } else {
            output::result(words(&report))?;
        }
        if is_complete != Some(true) {
            output::note("the recording ends before the run did");
        }
        Ok(if report.difference.is_some() && self.check { Exit::No } else { Exit::Success })
    }

    /// The configuration to do it with.
    fn document(&self, recording: &Recording) -> anyhow::Result<Document> {
        let mut document = match &self.config {
            Some(file) => Document::load(file)?,
            None => recorded_document(recording).map_err(Failure::data)?,
        };
        for change in &self.set {
            let refuse = |why: &str| Failure::usage(format_args!("--set {change}: {why}"));
            let (key, value) = change.split_once('=').ok_or_else(|| refuse("must be KEY=NUMBER"))?;
            let value: f64 = value.trim().parse().map_err(|_| refuse("must be KEY=NUMBER"))?;
            let key = key.trim();
            let number = document.number(key).ok_or_else(|| refuse("no number stands at that key"))?;
            document.set_number(key, number.with_value(value));
        }
        Ok(document)
    }
}

fn words(report: &ReplayReport) -> String {
    let ReplayReport { equal, commands, requests, trips, difference } = report;
    match difference {
        None => format!(
            "{equal} cycles came out bit for bit: {commands} commands, {requests} requests, {trips} stops and faults\n"
        ),
        Some(difference) => format!("{equal} cycles came out bit for bit\n{}", first(difference)),
    }
}

fn first(difference: &Difference) -> String {
    let Difference { cycle, time_s, fields } = difference;
    let mut text = format!("cycle {cycle}, {time_s:.3} s after the first, is the first that differs:\n");
    text += &format!("  {:28} {:>26} {:>26}\n", "", "recorded", "replayed");
    for field in fields.iter().take(FIELDS_SHOWN) {
        text += &format!("  {:28} {:>26} {:>26}\n", field.field, field.recorded, field.replayed);
    }
    if let Some(more) = fields.len().checked_sub(FIELDS_SHOWN).filter(|more| *more > 0) {
        text += &format!("  and {more} more\n");
    }
    text
}

/// A recording that cannot be done again, with its exit code.
fn refused(error: ReplayError) -> anyhow::Error {
    match error {
        ReplayError::Recording(error) => refused_recording(error),
        ReplayError::Config(problems) => problems.into(),
        ReplayError::Thread(_) => Failure::with(Exit::Software, anyhow!("{error}")),
        ReplayError::Empty { .. }
        | ReplayError::LateBegin { .. }
        | ReplayError::Hole { .. }
        | ReplayError::OtherRig { .. } => Failure::with(Exit::Data, anyhow!("{error}")),
    }
}
