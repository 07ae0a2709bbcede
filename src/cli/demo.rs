//! `magsteer demo`: plant and daemon as two processes, the planar experiment, a table and two pictures.

use std::ffi::OsStr;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use clap::Args;
use magsteer::config::{Config, Document, Experiment};
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{RunReport, StopFlag};
use magsteer_hal::HardwareDescription;
use magsteer_hal::channels::{Endpoint, PrivateRoot};
use magsteer_hal::operator::{state, verb};
use serde::Serialize;

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::output;
use super::play::{Played, Session, table, timing_line};
use super::rig_file::channel_failure;
use super::run_folder::{cannot_create, dated};
use super::shipped;
use super::sim_plant::PlantReport;

/// How long plant and daemon may take to appear.
const START_WAIT: Duration = Duration::from_secs(20);
/// How long the rig may take until it can be armed.
const READY_WAIT: Duration = Duration::from_secs(5);
/// How long to wait for the daemon between two looks at the children and at signals.
const LOOK: Duration = Duration::from_millis(250);
/// How long a child may take to ramp down and end.
const END_WAIT: Duration = Duration::from_secs(10);

/// Steer two magnets on a simulated rig: plant and daemon as two processes that meet in shared memory alone.
///
/// Plays the planar experiment in real time, judges every step by the plant's true poses, and draws two pictures. Ends with 0
/// when every step settled, with 1 when one did not.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer demo\n  magsteer demo --config config/bigmag-planar-camera.toml --json"
)]
pub struct Demo {
    /// Configuration; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Experiment; config/experiments/planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    experiment: Option<PathBuf>,
    /// Folder for this run's files; a dated one below `runs` when left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys of `demo --json`; `plant` stands beside them.
#[derive(Serialize)]
struct Answer<'a> {
    all_settled: bool,
    steps: Vec<&'a StepResponse>,
    #[serde(rename = "loop")]
    timing: &'a magsteer::daemon::TimingSummary,
    files: &'a [PathBuf],
    judged_by_truth: bool,
    daemon: &'a RunReport,
    plant: &'a PlantReport,
}

impl Demo {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let document = shipped::config(self.config.as_deref())?;
        let config = Config::from_document(&document)?;
        let experiment =
            shipped::experiment(self.experiment.as_deref(), &config.description).map_err(Failure::data)?;
        let folder = self.folder()?;
        let stop = Arc::new(StopFlag::new());
        let (played, daemon, plant) = watching(
            &stop,
            false,
            || (),
            || {
                let mut rig = Rig::start(&document, &config, &folder)?;
                let played = rig.play(&experiment, &config.description, &stop);
                let reports = rig.end();
                reports.iter().for_each(|(daemon, _)| tell_flights(daemon));
                // Why it could not be played says more than what the children made of that.
                let played = played?;
                let (daemon, plant) = reports?;
                anyhow::Ok((played, daemon, plant))
            },
        )??;
        let Some(played) = played else { return Ok(interrupted(&stop, &daemon, &plant)) };
        let files = draw(&folder, &config, &played)?;
        self.print(&played, &daemon, &plant, &files)?;
        let is_sound = played.all_settled() && daemon.is_clean() && plant.limit_breaks == 0;
        Ok(if is_sound { Exit::Success } else { Exit::No })
    }

    /// Makes the folder for this run.
    fn folder(&self) -> anyhow::Result<PathBuf> {
        let folder = self.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(dated("demo")));
        std::fs::create_dir_all(&folder).map_err(|error| cannot_create(&folder, &error))?;
        Ok(folder)
    }

    fn print(
        &self,
        played: &Played,
        daemon: &RunReport,
        plant: &PlantReport,
        files: &[PathBuf],
    ) -> anyhow::Result<()> {
        if !daemon.realtime.is_granted() {
            output::note(format_args!("the daemon ran without all of real time: {}", daemon.realtime));
        }
        if self.json {
            return output::json(&Answer {
                all_settled: played.all_settled(),
                steps: played.steps.iter().map(|step| &step.response).collect(),
                timing: &daemon.timing,
                files,
                judged_by_truth: played.judged_by_truth,
                daemon,
                plant,
            });
        }
        let mut text = format!("{}\n{}", table(played), timing_line(&daemon.timing));
        text += &format!(
            "plant: {} commands beyond a limit, largest current {:.2} A\n",
            plant.limit_breaks, plant.current_max_a
        );
        for file in files {
            text += &format!("{}\n", file.display());
        }
        text += if played.all_settled() { "every step settled\n" } else { "NOT every step settled\n" };
        Ok(output::result(text)?)
    }
}

/// Says where the daemon wrote what it saw before it tripped.
fn tell_flights(daemon: &RunReport) {
    for flight in &daemon.flights {
        output::note(format_args!(
            "the daemon tripped; its last cycles: magsteer runs show {}",
            flight.display()
        ));
    }
}

/// The end of a demonstration that was broken off.
fn interrupted(stop: &StopFlag, daemon: &RunReport, plant: &PlantReport) -> Exit {
    if !plant.ended_currentless {
        output::error("interrupted, and the plant did not end at zero current");
        return Exit::No;
    }
    let ramp =
        daemon.ramp_down_ms.map_or(String::new(), |duration| format!(", ramped down in {duration:.1} ms"));
    output::note(format_args!("interrupted: every coil is at zero current{ramp}"));
    exit_of(stop)
}

/// Plant and daemon as child processes, under a root directory of their own, which goes when both have ended.
struct Rig {
    // In the order in which they are to end should something fail on the way.
    daemon: Process,
    plant: Process,
    endpoint: Endpoint,
    _root: PrivateRoot,
}

impl Rig {
    fn start(document: &Document, config: &Config, folder: &Path) -> anyhow::Result<Self> {
        // Both processes read the very same text: the merged file, kept beside the results.
        let file = folder.join("config.toml");
        std::fs::write(&file, document.resolved().text).map_err(|error| cannot_create(&file, &error))?;
        let root = PrivateRoot::create("magsteer-demo").map_err(channel_failure)?;
        let endpoint = root.endpoint(&config.description.rig).map_err(channel_failure)?;
        let plant = Process::start("sim-plant", &file, root.path(), folder, &[])?;
        let records = config.daemon.as_ref().is_some_and(|daemon| daemon.recorder.is_some());
        let record: &[&OsStr] = if records { &["--record".as_ref(), folder.as_ref()] } else { &[] };
        let daemon = Process::start("run", &file, root.path(), folder, record)?;
        Ok(Self { daemon, plant, endpoint, _root: root })
    }

    /// Plays the experiment; `None` when it was told to stop on the way.
    fn play(
        &mut self,
        experiment: &Experiment,
        description: &HardwareDescription,
        stop: &StopFlag,
    ) -> anyhow::Result<Option<Played>> {
        let Some(mut session) = self.ready(stop)? else { return Ok(None) };
        session.arm(READY_WAIT)?;
        session.request(verb::GO, "go")?;
        let played = session.play(experiment, description, stop).map_err(|error| self.explain(error))?;
        Ok(stop.requested().is_none().then_some(played))
    }

    /// Waits until the daemon is idle; `None` when told to stop meanwhile.
    fn ready(&mut self, stop: &StopFlag) -> anyhow::Result<Option<Session>> {
        let begin = Instant::now();
        let mut session = None;
        while stop.requested().is_none() {
            self.plant.still_runs()?;
            self.daemon.still_runs()?;
            let reached = match session.take() {
                None => Session::open(&self.endpoint, LOOK),
                Some(session) => Ok(session),
            };
            let reached = reached.and_then(|mut opened: Session| {
                let idle = opened.wait_for(&[state::IDLE], LOOK).map(drop);
                session = Some(opened);
                idle
            });
            match reached {
                Ok(()) => return Ok(session),
                Err(error) if begin.elapsed() > START_WAIT => return Err(self.explain(error)),
                Err(_) => (),
            }
        }
        Ok(None)
    }

    /// Adds where the children's own words stand.
    fn explain(&self, error: anyhow::Error) -> anyhow::Error {
        let logs = [&self.plant, &self.daemon].map(|process| process.log.display().to_string());
        Failure::with(Exit::of(&error), anyhow!("{error:#}; see {} and {}", logs[0], logs[1]))
    }

    /// Stops the daemon, then the plant: each ramps down, reports and ends.
    fn end(mut self) -> anyhow::Result<(RunReport, PlantReport)> {
        let daemon = self.daemon.end();
        let plant = self.plant.end();
        let daemon = serde_json::from_str(&daemon?).context("the daemon's report cannot be read")?;
        let plant = serde_json::from_str(&plant?).context("the plant's report cannot be read")?;
        Ok((daemon, plant))
    }
}

/// A child that ends when its standard input closes, so that it never outlives this process.
struct Process {
    name: &'static str,
    child: Child,
    input: Option<ChildStdin>,
    log: PathBuf,
}

impl Process {
    fn start(
        name: &'static str,
        config: &Path,
        root: &Path,
        folder: &Path,
        arguments: &[&OsStr],
    ) -> anyhow::Result<Self> {
        let log = folder.join(format!("{name}.log"));
        let messages = std::fs::File::create(&log).map_err(|error| cannot_create(&log, &error))?;
        let program = std::env::current_exe().context("cannot find this program")?;
        let mut child = Command::new(program)
            .arg(name)
            .arg(config)
            .arg("--root")
            .arg(root)
            .args(["--json", "--end-with-stdin"])
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(messages)
            // A terminal's Ctrl-C is for the demonstration alone, which ends daemon and plant in their order.
            .process_group(0)
            .spawn()
            .with_context(|| format!("cannot start {name}"))?;
        let input = child.stdin.take();
        Ok(Self { name, child, input, log })
    }

    /// Fails, with its last words, when the child has ended.
    fn still_runs(&mut self) -> anyhow::Result<()> {
        match self.child.try_wait()? {
            None => Ok(()),
            Some(status) => Err(self.died(status)),
        }
    }

    fn died(&self, status: ExitStatus) -> anyhow::Error {
        let words = std::fs::read_to_string(&self.log).unwrap_or_default();
        let failure = anyhow!("{} ended with {status}: {}", self.name, words.trim());
        Failure::with(Exit::Software, failure)
    }

    /// Asks the child to end, waits, and kills it when that takes too long.
    fn wait(&mut self) -> std::io::Result<ExitStatus> {
        drop(self.input.take());
        let deadline = Instant::now() + END_WAIT;
        while Instant::now() < deadline {
            if let Some(status) = self.child.try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        self.child.kill()?;
        self.child.wait()
    }

    /// Asks the child to end and returns what it printed.
    fn end(&mut self) -> anyhow::Result<String> {
        let status = self.wait()?;
        let mut printed = String::new();
        if let Some(mut output) = self.child.stdout.take() {
            output.read_to_string(&mut printed)?;
        }
        if printed.trim().is_empty() {
            return Err(self.died(status));
        }
        Ok(printed)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Nothing is left to be done about a child that cannot be waited for.
        let _ = self.wait();
    }
}

#[cfg(feature = "figures")]
fn draw(folder: &Path, config: &Config, played: &Played) -> anyhow::Result<Vec<PathBuf>> {
    super::run_pictures::draw(folder, config, played)
}

/// This build draws nothing.
#[cfg(not(feature = "figures"))]
fn draw(_: &Path, _: &Config, _: &Played) -> anyhow::Result<Vec<PathBuf>> {
    Ok(Vec::new())
}
