//! `magsteer run`: the daemon.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use magsteer::config::{Config, Document};
use magsteer::control::Cycle;
use magsteer::daemon::kernel::leave_cpu;
use magsteer::daemon::recorder::RecorderPlan;
use magsteer::daemon::{
    CompanionPlan, DaemonConfig, LatencySummary, Mode, RunError, RunPlan, RunReport, StopFlag, config_digest,
    run,
};
use magsteer_hal::channels::Endpoint;

use super::ending::{exit_of, exit_told, watching};
use super::exit::{Exit, Failure};
use super::output;
use super::rig_file::{RootArgs, channel_failure, keep_files_private};
#[cfg(feature = "record")]
use super::run_files::RunFiles;

/// Run the daemon of a rig until it is told to end.
///
/// Starts idle; arm and go start the steering. SIGINT, SIGTERM and SIGHUP ramp all currents to zero, then the process
/// ends with 130 or 143; with 1 when a fault was latched by then.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer sim-plant config/bigmag-planar.toml &\n  \
    magsteer run config/bigmag-planar.toml --arm\n\nStates change on standard error, a line each.")]
pub struct Run {
    /// Configuration file (TOML).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Arm as soon as the rig is ready; `go` is still needed to steer.
    #[arg(long)]
    arm: bool,
    /// For commissioning: monitors judge, log and count, but do not act, whatever the file says. The driver's own watch,
    /// over-current, lost authority and the emergency stop act all the same.
    #[arg(long)]
    passive: bool,
    /// How long to wait for a driver, s.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    wait_s: f64,
    /// Record every cycle, by a process of its own, into this folder; without DIR into a dated one below `runs`. Flights,
    /// the journal, the resolved configuration and the report of the run go there too.
    #[cfg(feature = "record")]
    #[arg(long, value_name = "DIR", num_args = 0..=1, default_missing_value = "")]
    record: Option<PathBuf>,
    /// What to say of the run in its recording.
    #[cfg(feature = "record")]
    #[arg(long, value_name = "TEXT", default_value = "", requires = "record")]
    description: String,
    /// Folder for flights and the journal, in place of that in [daemon.recorder].
    #[arg(long, value_name = "DIR")]
    flights: Option<PathBuf>,
    #[command(flatten)]
    root: RootArgs,
    /// Also end when standard input closes, for a daemon that must not outlive who started it.
    #[arg(long)]
    end_with_stdin: bool,
    /// At the end, print one JSON object with state, cause, ramp-down and timing.
    #[arg(long)]
    json: bool,
}

impl Run {
    pub fn run(&self) -> anyhow::Result<Exit> {
        keep_files_private();
        let wait = Duration::try_from_secs_f64(self.wait_s);
        let driver_wait = wait.map_err(|error| Failure::usage(format_args!("--wait-s: {error}")))?;
        let (document, config) = Config::load(&self.file)?;
        let mut daemon = document.require("daemon", &config.daemon)?.clone();
        if self.passive {
            daemon.mode = Mode::Passive;
        }
        let controller = controller(&document, &config)?;
        let endpoint = self.root.endpoint(&config.description.rig)?;
        let files = self.files(&document)?;
        let plan = RunPlan {
            description: &config.description,
            config: &daemon,
            endpoint: &endpoint,
            driver_wait,
            arm: self.arm,
            recorder: self.recorder(&document, &daemon, &files)?,
            companion: files.companion(&endpoint)?,
            config_digest: config_digest(&document.resolved().sha256),
        };
        // Threads hand this down: those that wait for signals, sweep, write files and record are all to come.
        if let Some(refused) = daemon.cpu.and_then(leave_cpu).filter(|item| !item.granted) {
            let why = refused.why_not.as_deref().unwrap_or_default();
            output::note(format_args!("the loop's CPU is not left to it alone, but {}: {why}", refused.got));
        }
        let stop = Arc::new(StopFlag::new());
        let report = watching(&stop, self.end_with_stdin, || (), || run(&plan, || controller, &stop))?;
        if report.is_err() {
            files.discard();
        }
        match report {
            Ok(report) => {
                // Told first, and written whether it was told or not: neither a full disk nor a closed output takes the other.
                let exit = self.tell(&report, &stop);
                files.end(&report)?;
                exit
            }
            Err(RunError::Interrupted) => Ok(exit_of(&stop)),
            Err(RunError::Channel(error)) => Err(channel_failure(error)),
            Err(error @ RunError::Companion(_)) => Err(Failure::with(Exit::CannotCreate, error)),
            Err(error) => Err(Failure::with(Exit::Software, error)),
        }
    }

    /// Flights and journal: where the configuration or the command line says.
    fn recorder(
        &self,
        document: &Document,
        daemon: &DaemonConfig,
        kept: &Kept,
    ) -> anyhow::Result<Option<RecorderPlan>> {
        let Some(mut config) = daemon.recorder.clone() else {
            return match &self.flights {
                Some(_) => Err(Failure::usage("--flights: the configuration has no table [daemon.recorder]")),
                None => Ok(None),
            };
        };
        if let Some(folder) = self.flights.as_deref().or(kept.folder()) {
            folder.clone_into(&mut config.folder);
        }
        Ok(Some(RecorderPlan { config, config_sha256: document.resolved().sha256 }))
    }

    /// What is kept of the run beside flights and journal.
    #[cfg(feature = "record")]
    fn files(&self, document: &Document) -> anyhow::Result<Kept> {
        let named = |folder: &PathBuf| (!folder.as_os_str().is_empty()).then(|| folder.clone());
        let begin = |folder: &PathBuf| RunFiles::begin(named(folder).as_deref(), document, &self.description);
        let files = self.record.as_ref().map(begin).transpose()?;
        if let Some(files) = &files {
            output::note(format_args!("recording to {}", files.recording().display()));
        }
        Ok(Kept(files))
    }

    /// This build records nothing.
    #[cfg(not(feature = "record"))]
    fn files(&self, _: &Document) -> anyhow::Result<Kept> {
        Ok(Kept)
    }

    fn tell(&self, report: &RunReport, stop: &StopFlag) -> anyhow::Result<Exit> {
        let told = if self.json {
            output::json(report)
        } else {
            output::result(summary(report)).map_err(anyhow::Error::from)
        };
        let exit = exit_told(stop, told)?;
        Ok(if report.is_clean() { exit } else { Exit::No })
    }
}

/// What is kept of a run.
#[cfg(feature = "record")]
struct Kept(Option<RunFiles>);

#[cfg(feature = "record")]
impl Kept {
    fn folder(&self) -> Option<&Path> {
        self.0.as_ref().map(RunFiles::folder)
    }

    fn companion(&self, endpoint: &Endpoint) -> anyhow::Result<Option<CompanionPlan>> {
        self.0.as_ref().map(|files| files.companion(endpoint)).transpose()
    }

    /// Leaves nothing of a run that came to nothing.
    fn discard(&self) {
        self.0.iter().for_each(RunFiles::discard);
    }

    fn end(&self, report: &RunReport) -> anyhow::Result<()> {
        self.0.as_ref().map_or(Ok(()), |files| files.end(report))
    }
}

/// This build keeps flights and the journal alone.
#[cfg(not(feature = "record"))]
struct Kept;

#[cfg(not(feature = "record"))]
impl Kept {
    fn folder(&self) -> Option<&Path> {
        None
    }

    fn companion(&self, _: &Endpoint) -> anyhow::Result<Option<CompanionPlan>> {
        Ok(None)
    }

    fn discard(&self) {}

    fn end(&self, _: &RunReport) -> anyhow::Result<()> {
        Ok(())
    }
}

/// The controller that the configuration describes.
fn controller(document: &Document, config: &Config) -> anyhow::Result<Cycle> {
    let control = document.require("control", &config.control)?;
    let manipulator = document.require("rod", &config.manipulator)?;
    Ok(Cycle::new(control, &config.description, manipulator.clone()))
}

fn summary(report: &RunReport) -> String {
    let timing = &report.timing;
    let cause = report.cause.as_deref().map_or(String::new(), |cause| format!(": {cause}"));
    let ramp = match (report.ramp_down_ms, report.ramp_down_from_a, report.ramp_down_to_a) {
        (Some(duration), Some(from), Some(to)) => {
            format!("last ramp-down: {duration:.1} ms, measured {from:.3} A to {to:.3} A\n")
        }
        (Some(_), Some(from), None) => {
            format!("last ramp-down: ordered at {from:.3} A, and the driver was not heard to reach zero\n")
        }
        _ => String::new(),
    };
    let row = |name: &str, latency: &LatencySummary| {
        let LatencySummary { p50, p99, p999, p9999, max } = latency;
        format!("{name:18} {p50:>10.1} {p99:>10.1} {p999:>10.1} {p9999:>10.1} {max:>10.1}\n")
    };
    let phases = &timing.phases_us;
    let rows = [
        row("lateness", &timing.lateness_us),
        row("execution", &timing.execution_us),
        row("  read", &phases.read),
        row("  control", &phases.control),
        row("  decide", &phases.decide),
        row("  write", &phases.write),
        row("  record", &phases.record),
        row("pose age", &timing.pose_age_us),
        row("pose to command", &timing.pose_to_command_us),
        row("pose to driver", &timing.pose_to_driver_us),
        row("round trip", &timing.round_trip_us),
    ];
    let flights: String =
        report.flights.iter().map(|flight| format!("flight: {}\n", flight.display())).collect();
    format!(
        "ended {}{cause}\n{ramp}{flights}{} cycles at {} Hz, {} periods missed\n{:18} {:>10} {:>10} {:>10} {:>10} {:>10}\n{}",
        report.state,
        timing.cycles,
        timing.rate_hz,
        timing.missed,
        "us",
        "p50",
        "p99",
        "p99.9",
        "p99.99",
        "max",
        rows.concat(),
    )
}
