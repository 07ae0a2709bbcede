//! `magsteer runs export` and `runs recover`: a recording as a table, and a whole one of one that was cut.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Args, ValueEnum};
use magsteer::recording::{
    Choice, Recording, RecordingError, Recovered, export_csv, export_npz, recording_in, recover,
};
use serde::Serialize;

use crate::cli::exit::{Exit, Failure};
use crate::cli::output;

/// How to write a table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// A line a cycle, a column a number.
    Csv,
    /// An array a field, for NumPy.
    Npz,
}

/// Write the cycles of a recording as a table.
///
/// Every number of every cycle, unless --columns and --every choose: a thousand cycles are about 2.2 MB of CSV. A recording that was
/// cut is exported as far as it is whole.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer runs export runs/run-20261122-141500 --format npz\n  \
    magsteer runs export my-rig/run --format csv --every 10 --columns now_ns,measured_a,magnet.m1.measured --out thin.csv\n  \
    python3 -c 'import numpy; print(numpy.load(\"runs/run-20261122-141500/cycles.npz\")[\"commanded_a\"].shape)'\n\n\
    JSON: file, cycles, columns, size_bytes.")]
pub struct Export {
    /// Folder of the run, or its recording.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Kind of table.
    #[arg(long)]
    format: Format,
    /// File to make; `cycles.csv` or `cycles.npz` beside the recording when left out.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write one cycle of so many: the first, and every N-th from there.
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u64).range(1..))]
    every: u64,
    /// Write these columns alone, in the order of the recording: a quantity of every coil or magnet (measured_a), one column
    /// (coil.air-top.measured_a), or all that a name begins (magnet.m1, magnet.m1.measured). An array of npz is written whole.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `file`, `cycles`, `columns` and `size_bytes`.
#[derive(Serialize)]
struct Answer<'a> {
    file: &'a Path,
    /// Rows.
    cycles: u64,
    /// Numbers of each.
    columns: u64,
    size_bytes: u64,
}

impl Export {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let recording = Recording::open(&self.run).map_err(refused_recording)?;
        let name = match self.format {
            Format::Csv => "cycles.csv",
            Format::Npz => "cycles.npz",
        };
        let file = self.out.clone().unwrap_or_else(|| recording.path().with_file_name(name));
        let choice = Choice { every: self.every, names: self.columns.clone() };
        let exported = match self.format {
            Format::Csv => export_csv(&recording, &file, &choice),
            Format::Npz => export_npz(&recording, &file, &choice),
        };
        let exported = exported.map_err(refused_recording)?;
        let written = std::fs::metadata(&file);
        let size_bytes =
            written.map_err(|error| Failure::with(Exit::Io, anyhow!("{}: {error}", file.display())))?.len();
        let answer = Answer { file: &file, cycles: exported.rows, columns: exported.columns, size_bytes };
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.words(choice == Choice::default()))?;
        }
        Ok(Exit::Success)
    }
}

/// Size from which on the output says how to get less, bytes.
const LARGE: u64 = 50_000_000;

impl Answer<'_> {
    fn words(&self, is_everything: bool) -> String {
        let size = self.size_bytes as f64 * 1e-6;
        let mut text = format!(
            "{}: {} cycles of {} columns, {size:.1} MB\n",
            self.file.display(),
            self.cycles,
            self.columns
        );
        if is_everything && self.size_bytes > LARGE {
            text += "fewer: --every 10 writes one cycle of ten, --columns now_ns,measured_a,magnet.m1 what is named\n";
        }
        text
    }
}

/// Make a whole recording of one that was cut: by a kill, a full disk, a lost machine.
///
/// Every chunk that is whole is copied; the file that was cut is left as it is.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer runs recover runs/run-20261122-141500/recording.mcap")]
pub struct Recover {
    /// The recording that was cut, or its run's folder.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// File to make; `recording-recovered.mcap` beside it when left out.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct RecoveredFile<'a> {
    file: &'a Path,
    #[serde(flatten)]
    recovered: Recovered,
}

impl Recover {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let source = recording_in(&self.file);
        let stem = source.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let beside = || source.with_file_name(format!("{stem}-recovered.mcap"));
        let target = self.out.clone().unwrap_or_else(beside);
        let recovered = recover(&source, &target).map_err(refused_recording)?;
        if self.json {
            output::json(&RecoveredFile { file: &target, recovered })?;
        } else {
            let Recovered { messages, bytes_lost, damaged, was_whole, .. } = recovered;
            let lost = if was_whole {
                "it was whole".to_owned()
            } else {
                format!("{bytes_lost} bytes at the end were no whole chunk")
            };
            let damaged =
                if damaged > 0 { format!(", {damaged} damaged records left out") } else { String::new() };
            output::result(format_args!("{}: {messages} messages; {lost}{damaged}\n", target.display()))?;
        }
        Ok(Exit::Success)
    }
}

/// A recording that cannot be read or written, with its exit code.
pub fn refused_recording(error: RecordingError) -> anyhow::Error {
    let exit = match &error {
        RecordingError::Open { .. } => Exit::NoInput,
        RecordingError::Read { .. } | RecordingError::Write { .. } | RecordingError::Container { .. } => {
            Exit::Io
        }
        RecordingError::Create { .. } => Exit::CannotCreate,
        RecordingError::NotARecording { .. }
        | RecordingError::Version { .. }
        | RecordingError::Cycle { .. }
        | RecordingError::TooLarge { .. } => Exit::Data,
        RecordingError::Column(_) => Exit::Usage,
    };
    // Its text holds that of its cause already.
    Failure::with(exit, anyhow!("{error}"))
}
