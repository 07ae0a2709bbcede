//! `magsteer run`: the daemon.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use magsteer::config::{Config, Document};
use magsteer::control::Cycle;
use magsteer::daemon::recorder::RecorderPlan;
use magsteer::daemon::{DaemonConfig, LatencySummary, Mode, RunError, RunPlan, RunReport, StopFlag, run};

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::output;
use super::rig_file::{RootArgs, channel_failure, keep_files_private};

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
    /// Folder for flights and the journal, in place of that in [daemon.recorder].
    #[arg(long, value_name = "DIR")]
    record: Option<PathBuf>,
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
        let plan = RunPlan {
            description: &config.description,
            config: &daemon,
            endpoint: &endpoint,
            driver_wait,
            arm: self.arm,
            recorder: self.recorder(&document, &daemon)?,
            companion: None,
            config_digest: 0,
        };
        let stop = Arc::new(StopFlag::new());
        let report = watching(&stop, self.end_with_stdin, || (), || run(&plan, || controller, &stop))?;
        match report {
            Ok(report) => self.tell(&report, &stop),
            Err(RunError::Interrupted) => Ok(exit_of(&stop)),
            Err(RunError::Channel(error)) => Err(channel_failure(error)),
            Err(error) => Err(Failure::with(Exit::Software, error)),
        }
    }

    /// What to record, where the configuration or the command line says.
    fn recorder(&self, document: &Document, daemon: &DaemonConfig) -> anyhow::Result<Option<RecorderPlan>> {
        let Some(mut config) = daemon.recorder.clone() else {
            return match &self.record {
                Some(_) => Err(Failure::usage("--record: the configuration has no table [daemon.recorder]")),
                None => Ok(None),
            };
        };
        self.record.iter().for_each(|folder| config.folder.clone_from(folder));
        Ok(Some(RecorderPlan { config, config_sha256: document.resolved().sha256 }))
    }

    fn tell(&self, report: &RunReport, stop: &StopFlag) -> anyhow::Result<Exit> {
        if self.json {
            output::json(report)?;
        } else {
            output::result(summary(report))?;
        }
        Ok(if report.is_clean() { exit_of(stop) } else { Exit::No })
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
