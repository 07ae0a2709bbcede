//! The command line of `magsteer soak`; starts and ends what is soaked.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use magsteer::config::{Config, Document, Experiment};
use magsteer::daemon::{RunReport, StopFlag};
use magsteer_hal::channels::Endpoint;

use super::course::{self, Course, Plan};
use super::load::Load;
use super::measures::clock;
use super::process::DaemonProcess;
use super::provenance::Provenance;
use super::report::{LINES, Report};
use super::steering::Steering;
use super::thresholds::Thresholds;
use crate::cli::doctor::Machine;
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure, cannot_create};
use crate::cli::output;
use crate::cli::pair::Pair;
use crate::cli::rig_file::channel_failure;
use crate::cli::run_folder::dated;
use crate::cli::shipped;
use crate::cli::sim_faults;
use crate::cli::sim_plant::PlantReport;

/// How long to look for a daemon.
const DAEMON_WAIT: Duration = Duration::from_secs(2);
/// How long a daemon that was attached to may take to ramp down.
const RAMP_WAIT: Duration = Duration::from_secs(5);

/// Steer for hours, measure all the while, and stop at the first broken threshold.
///
/// Starts the simulated rig and the daemon as processes of their own, or attaches to a daemon that runs. Ends
/// with 0 when every threshold held to the end; with 1 when one was broken, after the last 10 s were saved
/// and the coils ramped to zero, or when steering ended; with 130 or 143 after a signal.
#[derive(Debug, Args)]
#[command(
    after_help = "A metric that is not known here breaks its threshold. A wrong name lists the known ones.\n\nExample:\n  \
    magsteer soak config/bigmag-planar.toml --hours 8 \\\n    \
    --fail-on 'missed>0,lateness_p9999_us>200,rss_growth_mb>5,alloc_in_cycle>0,trips>0,unsettled>0'"
)]
pub struct Soak {
    /// Configuration file (TOML).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// How long.
    #[arg(long, value_name = "H", value_parser = positive, required_unless_present = "minutes", conflicts_with = "minutes")]
    hours: Option<f64>,
    /// The same in minutes.
    #[arg(long, value_name = "M", value_parser = positive)]
    minutes: Option<f64>,
    /// Experiment whose steps are played over and over; config/experiments/planar.toml when left out, or the
    /// copy of it in this program.
    #[arg(long, value_name = "FILE")]
    experiment: Option<PathBuf>,
    /// Faults by script (TOML), timed from the start of the simulated rig; after a trip the daemon is reset
    /// and armed again.
    #[arg(long, value_name = "PLAN", conflicts_with = "attach")]
    fault_plan: Option<PathBuf>,
    /// Soak the daemon of this rig that runs already; it goes on afterwards, at rest.
    #[arg(long)]
    attach: bool,
    /// Threads of ordinary priority that keep the machine busy meanwhile.
    #[arg(long, value_name = "N", default_value_t = 0)]
    load: u32,
    /// What must not be: METRIC COMPARISON NUMBER, between commas. Counts, since the begin, are
    /// checked all the time; times each minute over the daemon's last whole one, and at the end over the whole of the
    /// daemon's run: with `--attach` also over what came before.
    #[arg(long, value_name = "LIST")]
    fail_on: Option<Thresholds>,
    /// Folder for this soak's files; a dated one below `runs` when left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Directory under which the rig's processes meet; $MAGSTEER_ROOT or /dev/shm/magsteer-UID when left out.
    #[arg(long, value_name = "DIR", requires = "attach")]
    root: Option<PathBuf>,
    /// Print one JSON object a minute, and one at the end.
    #[arg(long)]
    json: bool,
}

/// What daemon and plant said at their end.
type Reports = (RunReport, PlantReport);
/// How it went, unless it was broken off before it began; the reports of processes that were started for it.
type Soaked = (Option<Course>, Option<Reports>);

/// What was read before anything was started.
struct Subject {
    document: Document,
    config: Config,
    experiment: Experiment,
    folder: PathBuf,
}

impl Soak {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let document = Document::load(&self.file)?;
        let config = Config::from_document(&document)?;
        let experiment = shipped::experiment(self.experiment.as_deref(), &config.description);
        let experiment = experiment.map_err(Failure::data)?;
        if let Some(plan) = &self.fault_plan {
            sim_faults::load(plan, &config.description).map_err(Failure::data)?;
        }
        let folder = self.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(dated("soak")));
        std::fs::create_dir_all(&folder).map_err(|error| cannot_create(&folder, &error))?;
        let subject = Subject { document, config, experiment, folder };
        output::note(self.begin(&subject));
        let stop = Arc::new(StopFlag::new());
        let (course, reports) = watching(
            &stop,
            false,
            || (),
            || {
                let _load = Load::start(self.load)?;
                if self.attach { self.attached(&subject, &stop) } else { self.own_pair(&subject, &stop) }
            },
        )??;
        let Some(course) = course else {
            output::note("interrupted before the daemon steered");
            return Ok(exit_of(&stop));
        };
        self.tell(&subject, &course, reports.as_ref())?;
        if reports.is_some_and(|(_, plant)| !plant.ended_currentless) {
            output::error("the plant did not end at zero current");
            return Ok(Exit::No);
        }
        Ok(match exit_of(&stop) {
            Exit::Success if course.broken.is_empty() => Exit::Success,
            Exit::Success => Exit::No,
            signalled => signalled,
        })
    }

    /// What is about to happen, for who waits for it.
    fn begin(&self, subject: &Subject) -> String {
        let plan = self.plan(&subject.folder);
        let broken_by = self.fail_on.as_ref().map_or_else(String::new, |limits| format!("{limits}, "));
        format!(
            "soaking {} for {} (h:mm:ss), into {}\nends early by: {broken_by}the end of steering, Ctrl-C",
            subject.config.description.rig,
            clock(plan.duration.as_secs_f64()),
            subject.folder.display(),
        )
    }

    /// Soaks a plant and a daemon that live as long as the soak.
    fn own_pair(&self, subject: &Subject, stop: &StopFlag) -> anyhow::Result<Soaked> {
        let faults: Vec<&OsStr> = match &self.fault_plan {
            Some(plan) => vec!["--allow-faults".as_ref(), "--fault-plan".as_ref(), plan.as_os_str()],
            None => Vec::new(),
        };
        let mut pair = Pair::start(&subject.document, &subject.config, &subject.folder, &faults, false)?;
        let course = match pair.ready(stop) {
            Ok(None) => Ok(None),
            Ok(Some(_)) => {
                let (endpoint, pid) = (pair.endpoint().clone(), pair.daemon_pid());
                let process = || Some(DaemonProcess::of(pid));
                let course = self.steering(subject, &endpoint).and_then(|mut steering| {
                    let plan = self.plan(&subject.folder);
                    course::run(&plan, &mut steering, process, || pair.still_run(), stop)
                });
                course.map(Some).map_err(|error| pair.explain(error))
            }
            Err(error) => Err(error),
        };
        let reports = pair.end();
        // Why it could not be soaked says more than what the children made of that.
        let course = course?;
        Ok((course, Some(reports?)))
    }

    /// Soaks a daemon that was there before, and stays.
    fn attached(&self, subject: &Subject, stop: &StopFlag) -> anyhow::Result<Soaked> {
        let rig = &subject.config.description.rig;
        let endpoint = Endpoint::new(rig, self.root.as_deref()).map_err(channel_failure)?;
        let mut steering = self.steering(subject, &endpoint)?;
        let plan = self.plan(&subject.folder);
        let process = || DaemonProcess::of_rig(&endpoint);
        let course = course::run(&plan, &mut steering, process, || Ok(()), stop);
        if !steering.ramp_down(RAMP_WAIT) {
            output::error("the daemon was not seen to come to rest; look at magsteer status");
        }
        Ok((Some(course?), None))
    }

    fn steering<'a>(&self, subject: &'a Subject, endpoint: &Endpoint) -> anyhow::Result<Steering<'a>> {
        let (experiment, rig) = (&subject.experiment, &subject.config.description);
        Steering::open(endpoint, DAEMON_WAIT, experiment, rig, self.fault_plan.is_some())
    }

    fn plan(&self, folder: &Path) -> Plan {
        let hours = self.hours.unwrap_or_default() + self.minutes.unwrap_or_default() / 60.0;
        Plan {
            duration: Duration::from_secs_f64(3_600.0 * hours),
            thresholds: self.fail_on.clone().unwrap_or_default(),
            lines: folder.join(LINES),
            json: self.json,
        }
    }

    /// Writes the files, and prints the last line.
    fn tell(&self, subject: &Subject, course: &Course, reports: Option<&Reports>) -> anyhow::Result<()> {
        let sha256 = subject.document.resolved().sha256;
        let machine = Provenance::of(&Machine::this(), subject.config.daemon.as_ref(), sha256);
        let report = Report::new(course, &machine, reports, &subject.folder);
        let pictures = draw(&subject.folder, course, report.daemon)?;
        report.write(&pictures)?;
        if self.json {
            return output::json(&report.last);
        }
        Ok(output::result(format_args!("{}\nin {}\n", report.markdown(&[]), subject.folder.display()))?)
    }
}

/// A time that is not over at once, nor longer than a year.
fn positive(text: &str) -> Result<f64, &'static str> {
    const LONGEST: f64 = 8_760.0 * 60.0;
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= LONGEST => Ok(value),
        _ => Err("must be a number > 0, of a year at most"),
    }
}

#[cfg(feature = "figures")]
fn draw(folder: &Path, course: &Course, daemon: Option<&RunReport>) -> anyhow::Result<Vec<PathBuf>> {
    super::pictures::draw(folder, &course.minutes, daemon)
}

/// This build draws nothing.
#[cfg(not(feature = "figures"))]
fn draw(_: &Path, _: &Course, _: Option<&RunReport>) -> anyhow::Result<Vec<PathBuf>> {
    Ok(Vec::new())
}

#[cfg(test)]
mod tests {
    use super::positive;

    #[test]
    fn durations_are_positive_and_finite() {
        assert_eq!(positive("0.1"), Ok(0.1));
        for refused in ["0", "-1", "nan", "inf", "1e9", "", "x"] {
            assert!(positive(refused).is_err(), "{refused}");
        }
    }
}
