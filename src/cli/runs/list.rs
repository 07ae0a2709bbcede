//! `magsteer runs list`: the recordings and flights of a folder and of the folders in it.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use magsteer::daemon::recorder::{FLIGHT_SUFFIX, FlightLabel, PARTIAL_SUFFIX};
use serde::Serialize;

use crate::cli::events::unreadable;
use crate::cli::exit::Exit;
use crate::cli::output;

/// Where run folders are made.
const RUNS: &str = "runs";

/// List the recordings and flights of a folder and of the folders in it, the newest last.
///
/// Ends with 0, though there may be none, or with 66 when there is no such folder.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer runs list --json")]
pub struct List {
    /// Where to look.
    #[arg(value_name = "FOLDER", default_value = RUNS)]
    folder: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Answer {
    #[cfg(feature = "record")]
    recordings: Vec<super::recording::RecordingLine>,
    flights: Vec<Line>,
}

impl Answer {
    /// For people.
    fn text(&self) -> String {
        #[cfg(feature = "record")]
        let recordings: String = self.recordings.iter().map(super::recording::RecordingLine::text).collect();
        #[cfg(not(feature = "record"))]
        let recordings = String::new();
        recordings + &self.flights.iter().map(Line::text).collect::<String>()
    }
}

/// One flight; what its head does not tell is null.
#[derive(Serialize)]
struct Line {
    file: PathBuf,
    /// "complete"; "cut" when its length is not what its head says; "unfinished" when its writer did not come
    /// to the end; "unreadable".
    status: &'static str,
    time: Option<String>,
    rig: Option<String>,
    reason: Option<&'static str>,
    cause_code: Option<u32>,
    /// Why it was written, or why it cannot be read.
    words: String,
    records: Option<u64>,
    duration_s: Option<f64>,
    size_mb: Option<f64>,
}

impl List {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let mut paths = flights_in(&self.folder).map_err(|error| unreadable(&self.folder, &error))?;
        let folders = folders_in(&self.folder);
        for folder in &folders {
            // A folder of others that may not be read has no flights of ours.
            paths.extend(flights_in(folder).unwrap_or_default());
        }
        let mut flights: Vec<Line> = paths.into_iter().map(Line::new).collect();
        flights.sort_by(|one, other| (&one.time, &one.file).cmp(&(&other.time, &other.file)));
        let answer = Answer {
            #[cfg(feature = "record")]
            recordings: {
                let folders: Vec<PathBuf> = std::iter::once(self.folder.clone()).chain(folders).collect();
                super::recording::recordings_in(&folders)
            },
            flights,
        };
        if self.json {
            output::json(&answer)?;
            return Ok(Exit::Success);
        }
        let text = answer.text();
        if text.is_empty() {
            output::note(format_args!("{}: neither recordings nor flights", self.folder.display()));
        }
        output::result(text)?;
        Ok(Exit::Success)
    }
}

impl Line {
    fn new(file: PathBuf) -> Self {
        match FlightLabel::read(&file) {
            Ok(FlightLabel { header, bytes, whole }) => Self {
                status: match (file.to_string_lossy().ends_with(PARTIAL_SUFFIX), whole) {
                    (true, _) => "unfinished",
                    (false, true) => "complete",
                    (false, false) => "cut",
                },
                words: header.words(),
                reason: Some(header.reason.name()),
                cause_code: Some(header.cause),
                records: Some(header.records),
                duration_s: Some(header.records as f64 / header.rate_hz),
                size_mb: Some(bytes as f64 * 1e-6),
                time: Some(header.trigger_time),
                rig: Some(header.rig),
                file,
            },
            Err(error) => Self {
                status: "unreadable",
                words: error.to_string(),
                reason: None,
                cause_code: None,
                records: None,
                duration_s: None,
                size_mb: None,
                time: None,
                rig: None,
                file,
            },
        }
    }

    fn text(&self) -> String {
        let (Some(time), Some(duration), Some(size)) = (&self.time, self.duration_s, self.size_mb) else {
            return format!("unreadable: {}\n", self.words);
        };
        let status = if self.status == "complete" { String::new() } else { format!(" ({})", self.status) };
        format!(
            "{time}  {duration:>5.1} s  {size:>6.1} MB  {}{status}  {}\n",
            self.file.display(),
            self.words
        )
    }
}

fn flights_in(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let is_flight = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.ends_with(FLIGHT_SUFFIX) || name.ends_with(PARTIAL_SUFFIX)
    };
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder)? {
        paths.extend(Some(entry?.path()).filter(is_flight));
    }
    Ok(paths)
}

fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.is_dir()).collect()
}
