//! Plant and daemon as two child processes that meet in shared memory alone, for commands that bring their
//! own rig.

use std::ffi::OsStr;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use magsteer::config::{Config, Document};
use magsteer::daemon::{RunReport, StopFlag};
use magsteer_hal::channels::{Endpoint, PrivateRoot};
use magsteer_hal::operator::state;

use super::exit::{Exit, Failure, cannot_create};
use super::play::Session;
use super::rig_file::channel_failure;
use super::sim_plant::PlantReport;

/// Private roots are made with this name, under which `doctor` finds those of commands that were killed.
const ROOT_HINT: &str = "magsteer-demo";
/// How long plant and daemon may take to appear.
const START_WAIT: Duration = Duration::from_secs(20);
/// How long to wait for the daemon between two looks at the children and at signals.
const LOOK: Duration = Duration::from_millis(250);
/// How long a child may take to ramp down and end.
const END_WAIT: Duration = Duration::from_secs(10);

/// Plant and daemon as child processes, under a root directory of their own, which goes when both have ended.
pub struct Pair {
    // In the order in which they are to end should something fail on the way.
    daemon: Process,
    plant: Process,
    endpoint: Endpoint,
    _root: PrivateRoot,
}

impl Pair {
    /// Starts both. `plant_arguments`: more for the plant's command line; `records`: every cycle is recorded too.
    ///
    /// # Errors
    /// When the folder cannot be written, no root can be made, or a process does not start.
    pub fn start(
        document: &Document,
        config: &Config,
        folder: &Path,
        plant_arguments: &[&OsStr],
        records: bool,
    ) -> anyhow::Result<Self> {
        // Both processes read the very same text: the merged file, kept beside the results.
        let file = folder.join("config.toml");
        std::fs::write(&file, document.resolved().text).map_err(|error| cannot_create(&file, &error))?;
        let root = PrivateRoot::create(ROOT_HINT).map_err(channel_failure)?;
        let endpoint = root.endpoint(&config.description.rig).map_err(channel_failure)?;
        let plant = Process::start("sim-plant", &file, root.path(), folder, plant_arguments)?;
        let has_flights = config.daemon.as_ref().is_some_and(|daemon| daemon.recorder.is_some());
        let flights: &[&OsStr] = if has_flights { &["--flights".as_ref(), folder.as_ref()] } else { &[] };
        let record: &[&OsStr] = if records { &["--record".as_ref(), folder.as_ref()] } else { &[] };
        let daemon = Process::start("run", &file, root.path(), folder, &[flights, record].concat())?;
        Ok(Self { daemon, plant, endpoint, _root: root })
    }

    /// Waits until the daemon is idle; `None` when told to stop meanwhile.
    ///
    /// # Errors
    /// When it is not in time, or a process has ended.
    pub fn ready(&mut self, stop: &StopFlag) -> anyhow::Result<Option<Session>> {
        let begin = Instant::now();
        let mut session = None;
        while stop.requested().is_none() {
            self.still_run()?;
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

    /// Fails, with its last words, when a process has ended.
    ///
    /// # Errors
    /// See above.
    pub fn still_run(&mut self) -> anyhow::Result<()> {
        self.plant.still_runs()?;
        self.daemon.still_runs()
    }

    /// Where both meet.
    pub fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// The daemon's process.
    pub fn daemon_pid(&self) -> u32 {
        self.daemon.child.id()
    }

    /// Adds where the children's own words stand.
    pub fn explain(&self, error: anyhow::Error) -> anyhow::Error {
        let logs = [&self.plant, &self.daemon].map(|process| process.log.display().to_string());
        Failure::with(Exit::of(&error), anyhow!("{error:#}; see {} and {}", logs[0], logs[1]))
    }

    /// Stops the daemon, then the plant: each ramps down, reports and ends.
    ///
    /// # Errors
    /// When one ended without its report.
    pub fn end(mut self) -> anyhow::Result<(RunReport, PlantReport)> {
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
