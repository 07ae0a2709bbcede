//! What `runs list` and `runs show` say of recordings.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use magsteer::recording::{Counts, Ending, Event, Info, RECORDING, Recording, level};
use serde::Serialize;

use super::export::refused_recording;
use crate::cli::exit::Exit;
use crate::cli::output;

/// Events that are shown to people.
const EVENTS: usize = 20;
/// With what a whole file begins and ends.
const MAGIC: [u8; 8] = *b"\x89MCAP0\r\n";

/// One recording in a list; what its head does not tell is null.
#[derive(Serialize)]
pub struct RecordingLine {
    file: PathBuf,
    /// "complete"; "cut" when it has no end, because it is being written or was broken off; "unreadable".
    status: &'static str,
    started: Option<String>,
    rig: Option<String>,
    description: Option<String>,
    size_mb: Option<f64>,
    /// Why it cannot be read.
    error: Option<String>,
}

impl RecordingLine {
    fn new(file: PathBuf) -> Self {
        let size_mb = fs::metadata(&file).ok().map(|metadata| metadata.len() as f64 * 1e-6);
        match Recording::open(&file) {
            Ok(recording) => Self {
                status: if has_end(&file) { "complete" } else { "cut" },
                started: Some(recording.info().started.clone()),
                rig: Some(recording.info().rig.clone()),
                description: Some(recording.description().to_owned()),
                size_mb,
                error: None,
                file,
            },
            Err(error) => Self {
                status: "unreadable",
                started: None,
                rig: None,
                description: None,
                size_mb,
                error: Some(error.to_string()),
                file,
            },
        }
    }

    /// For people.
    pub fn text(&self) -> String {
        let (Some(started), Some(rig), Some(size)) = (&self.started, &self.rig, self.size_mb) else {
            return format!("unreadable: {}\n", self.error.as_deref().unwrap_or_default());
        };
        let status = if self.status == "complete" { String::new() } else { format!(" ({})", self.status) };
        let description = self.description.as_deref().unwrap_or_default().lines().next().unwrap_or_default();
        format!("{started}  {size:>6.1} MB  {}{status}  {rig}  {description}\n", self.file.display())
    }
}

/// True when a file ends as a whole one does.
fn has_end(path: &Path) -> bool {
    let tail = || -> std::io::Result<[u8; 8]> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::End(-8))?;
        let mut tail = [0; 8];
        file.read_exact(&mut tail)?;
        Ok(tail)
    };
    tail().is_ok_and(|tail| tail == MAGIC)
}

/// The recordings of some folders, the newest last.
pub fn recordings_in(folders: &[PathBuf]) -> Vec<RecordingLine> {
    let files = folders.iter().map(|folder| folder.join(RECORDING)).filter(|file| file.is_file());
    let mut lines: Vec<RecordingLine> = files.map(RecordingLine::new).collect();
    lines.sort_by(|one, other| (&one.started, &one.file).cmp(&(&other.started, &other.file)));
    lines
}

/// True for what `show` takes for a recording.
pub fn is_recording(path: &Path) -> bool {
    path.is_dir() || path.extension().is_some_and(|extension| extension == "mcap")
}

/// The stable keys are `rig`, `rate_hz`, `description`, `cycles`, `missed`, `lost`, `duration_s`, `holes`,
/// `whole`, `is_complete` and `events`.
#[derive(Serialize)]
struct Answer<'a> {
    file: &'a Path,
    rig: &'a str,
    rate_hz: f64,
    started: &'a str,
    description: &'a str,
    program: &'a str,
    config_sha256: &'a str,
    machine: &'a magsteer::daemon::recorder::Machine,
    coils: &'a [String],
    frames: &'a [String],
    magnets: &'a [String],
    cycles: u64,
    first_cycle: u64,
    last_cycle: u64,
    /// Periods that the loop missed: together with `cycles` and `lost` those from the first to the last.
    missed: u64,
    /// Cycles that the recording has not.
    lost: u64,
    duration_s: f64,
    holes: u64,
    damaged: u64,
    messages: u64,
    /// The file has its end.
    whole: bool,
    /// The recorder's word that every cycle of the run is there; null when it did not come to say.
    is_complete: Option<bool>,
    events: Vec<EventLine<'a>>,
}

#[derive(Serialize)]
struct EventLine<'a> {
    wall_ns: u64,
    level: &'static str,
    text: &'a str,
}

/// Shows a recording.
pub fn show(path: &Path, json: bool) -> anyhow::Result<Exit> {
    let recording = Recording::open(path).map_err(refused_recording)?;
    let counts = recording.counts().map_err(refused_recording)?;
    let events = recording.events().map_err(refused_recording)?;
    if json {
        output::json(&answer(&recording, &counts, &events))?;
    } else {
        output::result(words(&recording, &counts, &events))?;
    }
    Ok(Exit::Success)
}

fn duration_s(counts: &Counts) -> f64 {
    counts.last_ns.saturating_sub(counts.first_ns) as f64 * 1e-9
}

fn level_name(code: u8) -> &'static str {
    match code {
        level::ERROR => "error",
        level::WARN => "warning",
        _ => "info",
    }
}

fn answer<'a>(recording: &'a Recording, counts: &Counts, events: &'a [Event]) -> Answer<'a> {
    let info: &Info = recording.info();
    let line = |event: &'a Event| EventLine {
        wall_ns: event.wall_ns,
        level: level_name(event.level),
        text: &event.text,
    };
    Answer {
        file: recording.path(),
        rig: &info.rig,
        rate_hz: info.rate_hz,
        started: &info.started,
        description: recording.description(),
        program: &info.program,
        config_sha256: &info.config_sha256,
        machine: &info.machine,
        coils: &info.coils,
        frames: &info.frames,
        magnets: &info.magnets,
        cycles: counts.cycles,
        first_cycle: counts.first_number,
        last_cycle: counts.last_number,
        missed: counts.missed,
        lost: counts.lost(),
        duration_s: duration_s(counts),
        holes: counts.holes,
        damaged: counts.damaged,
        messages: counts.messages,
        whole: counts.ending == Ending::Whole,
        is_complete: counts.is_complete,
        events: events.iter().map(line).collect(),
    }
}

fn words(recording: &Recording, counts: &Counts, events: &[Event]) -> String {
    let info = recording.info();
    let mut text = format!(
        "{}\n{} rig {} at {} Hz, config {:.12}, version {}\n{}, {} processors ({}), kernel {}\n",
        recording.path().display(),
        info.started,
        info.rig,
        info.rate_hz,
        info.config_sha256,
        info.program,
        info.machine.host,
        info.machine.processors,
        info.machine.processor,
        info.machine.kernel,
    );
    if !recording.description().is_empty() {
        text += &format!("{}\n", recording.description().trim_end());
    }
    let state = match (counts.ending, counts.is_complete) {
        (Ending::Cut { at }, _) => format!("cut after {at} bytes: `magsteer runs recover` makes it whole"),
        (Ending::Whole, Some(true)) => "every cycle of the run".to_owned(),
        (Ending::Whole, _) => "not every cycle of the run".to_owned(),
    };
    text += &format!(
        "{} cycles in the {} periods {} to {}, {:.3} s; {} periods missed by the loop, {} cycles lost in {} holes; {state}\n",
        counts.cycles,
        counts.periods(),
        counts.first_number,
        counts.last_number,
        duration_s(counts),
        counts.missed,
        counts.lost(),
        counts.holes
    );
    let skipped = events.len().saturating_sub(EVENTS);
    text += &format!("\n{} events", events.len());
    text += if skipped > 0 { ", the last of them:\n" } else { ":\n" };
    let begin = counts.first_ns.saturating_add(info.wall_offset_ns);
    for event in &events[skipped..] {
        let at = event.wall_ns.saturating_sub(begin) as f64 * 1e-9;
        text += &format!("{at:>10.3} s  {:7}  {}\n", level_name(event.level), event.text);
    }
    text
}
