//! `magsteer record`: writes down every cycle of a running daemon.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use magsteer::config::Config;
use magsteer::daemon::{ATTACHED, StopFlag, config_digest};
use magsteer::recording::{Info, RecordReport, RecorderError, RecordingError, RecordingPlan, Why, record};

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::output;
use super::rig_file::{RootArgs, channel_failure, keep_files_private};
use super::run_files::RunFiles;
use super::shipped;

/// How long a daemon that was told to end at the same time may take to ramp down.
const COMPANION_GRACE: Duration = Duration::from_secs(5);

/// Record every cycle of a running daemon as MCAP, until its loop or this command ends.
///
/// What is recorded begins when this command is started; `magsteer run --record` records from the first
/// cycle. The loop does not notice: neither when this process is slow, nor when it is killed. Ends with 0
/// when the loop's end was recorded and no cycle on the way was lost, with 1 when cycles were lost, with 74
/// when the disk did not take them, with 130 after Ctrl-C.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer record config/bigmag-planar.toml --out runs/today --description \"before the new magnet\""
)]
pub struct Record {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// Folder for the recording; a dated one below `runs` when left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// What to say of the run in the recording.
    #[arg(long, value_name = "TEXT", default_value = "")]
    description: String,
    /// How long to wait for a daemon, s.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    wait_s: f64,
    #[command(flatten)]
    root: RootArgs,
    /// Print one JSON object at the end.
    #[arg(long)]
    json: bool,
    /// Say on standard output when it listens, and end when standard input closes: for a daemon that starts
    /// it.
    #[arg(long, hide = true)]
    as_companion: bool,
}

impl Record {
    pub fn run(&self) -> anyhow::Result<Exit> {
        keep_files_private();
        let wait = Duration::try_from_secs_f64(self.wait_s);
        let wait = wait.map_err(|error| Failure::usage(format_args!("--wait-s: {error}")))?;
        let document = shipped::config(self.file.as_deref())?;
        let config = Config::from_document(&document)?;
        let rate_hz = document.require("daemon", &config.daemon)?.rate_hz;
        let endpoint = self.root.endpoint(&config.description.rig)?;
        let files = RunFiles::begin(self.out.as_deref(), &document, &self.description)?;
        let resolved = document.resolved();
        let plan = RecordingPlan {
            file: files.recording(),
            info: Info::here(&config.description, rate_hz, &resolved.sha256, &self.description),
            config_digest: config_digest(&resolved.sha256),
            config_text: resolved.text,
            grace: if self.as_companion { COMPANION_GRACE } else { Duration::ZERO },
        };
        let stop = Arc::new(StopFlag::new());
        let attached = || self.say_attached(&files);
        let report = watching(
            &stop,
            self.as_companion,
            || (),
            || record(&endpoint, wait, plan, &stop, attached, &|words| output::note(words)),
        )?;
        if report.is_err() && !self.as_companion {
            files.discard();
        }
        self.tell(&report.map_err(failure)?, &stop)
    }

    fn say_attached(&self, files: &RunFiles) {
        if self.as_companion {
            // Whoever started this process learns of a closed output by its silence.
            let _ = output::result(format_args!("{ATTACHED}\n"));
        } else {
            output::note(format_args!("recording to {}", files.recording().display()));
        }
    }

    fn tell(&self, report: &RecordReport, stop: &StopFlag) -> anyhow::Result<Exit> {
        if self.json {
            output::json(report)?;
        } else if !self.as_companion {
            output::result(words(report))?;
        }
        if let Some(error) = &report.error {
            return Err(Failure::with(Exit::Io, anyhow!("{error}; {} cycles are lost", report.lost)));
        }
        if report.lost > 0 {
            output::error(format_args!("{} cycles were lost on the way", report.lost));
            return Ok(Exit::No);
        }
        Ok(match report.ended {
            Why::LoopEnded => Exit::Success,
            Why::Asked => exit_of(stop),
            Why::DaemonGone => Exit::No,
        })
    }
}

fn words(report: &RecordReport) -> String {
    let ended = match report.ended {
        Why::LoopEnded => "the loop ended",
        Why::Asked => "ended as asked",
        Why::DaemonGone => "the daemon is gone",
    };
    let complete = if report.is_complete { ", every cycle of the run" } else { "" };
    format!(
        "{}: {} cycles{complete}, {} lost, {:.1} MB; {ended}\n",
        report.file.display(),
        report.cycles,
        report.lost,
        report.bytes as f64 * 1e-6
    )
}

/// A recording that did not come about, with its exit code.
fn failure(error: RecorderError) -> anyhow::Error {
    let exit = match error {
        RecorderError::Channel(error) => return channel_failure(error),
        RecorderError::Recording(RecordingError::Create { .. }) => Exit::CannotCreate,
        RecorderError::Recording(_) => Exit::Io,
        RecorderError::OtherConfig => Exit::Data,
        RecorderError::Thread(_) | RecorderError::WriterPanicked => Exit::Software,
    };
    Failure::with(exit, anyhow!("{error}"))
}
