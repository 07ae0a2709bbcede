//! The simulated plant and the daemon as processes of a rig of their own, for tests that kill them.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use magsteer::config::Config;
use magsteer_hal::channels::{Endpoint, OperatorClient, PrivateRoot};
use magsteer_hal::operator::{OperatorRequest, StatusMessage, state, verb};
use magsteer_hal::{MAGNETS_MAX, Stamp};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Bound on every wait, only so that a failure ends: nothing is judged by it.
pub const PATIENCE: Duration = Duration::from_secs(40);
/// How long an operator waits for an answer before it asks again.
const ANSWER_WAIT: Duration = Duration::from_millis(400);
/// A status older than this is a former daemon's, or one of a daemon that does not run now.
const STATUS_AGE_MAX: Duration = Duration::from_millis(500);
/// A ramp from there takes several cycles, A.
const STEERING: f64 = 1.0;

/// Two cores do not run several rigs at 1 kHz at once: one test of a process at a time.
static ALONE: Mutex<()> = Mutex::new(());

/// A rig under a root of its own, with the shipped planar configuration.
pub struct World {
    pub file: PathBuf,
    pub config: Config,
    pub endpoint: Endpoint,
    pub root: PrivateRoot,
    _alone: Option<MutexGuard<'static, ()>>,
}

impl World {
    pub fn new() -> Self {
        Self::of(Some(ALONE.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    /// One beside others, for tests that start several at once and say how many.
    pub fn beside() -> Self {
        Self::of(None)
    }

    fn of(alone: Option<MutexGuard<'static, ()>>) -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        let (_, config) = Config::load(&file).expect("shipped");
        let root = PrivateRoot::create("ms").expect("shared memory is there");
        let endpoint = root.endpoint(&config.description.rig).expect("short and own");
        Self { file, config, endpoint, root, _alone: alone }
    }

    pub fn plant(&self) -> Process {
        Process::start(self, "sim-plant", &[])
    }

    pub fn daemon(&self) -> Process {
        Process::start(self, "run", &["--wait-s", "30"])
    }

    pub fn operator(&self) -> Operator {
        Operator::open(&self.endpoint)
    }

    /// Where daemons of this rig put flights and journal.
    pub fn recordings(&self) -> PathBuf {
        self.root.path().join("recordings")
    }

    /// Longest way from the last obeyed command to zero in every coil, ms, from a current in A, of a plant that is never
    /// held up: the command's validity, the current at the allowed slew, and an allowance for what follows the set point.
    pub fn watchdog_ms(&self, current: f64) -> f64 {
        /// Two wake-ups of the plant of 1 ms; then the amplifiers of 200 Hz lag a ramp of 300 A/s by 0.24 A, which falls
        /// below the 0.01 A that count as zero within 3 ms.
        const ALLOWANCE_MS: f64 = 6.0;
        let coils = self.config.description.coils.iter();
        let slowest = coils.fold(f64::INFINITY, |least, coil| least.min(coil.slew_max));
        let daemon = self.config.daemon.as_ref().expect("shipped with a daemon");
        daemon.command_validity_ms + 1e3 * current / slowest + ALLOWANCE_MS
    }
}

/// A child that ends with this process: it holds the other end of the child's standard input.
pub struct Process {
    child: Child,
    log: PathBuf,
}

/// How a child ended.
pub struct End {
    pub code: Option<i32>,
    /// The object printed; null when there is none.
    pub report: Value,
    /// What it said on standard error.
    pub said: String,
}

impl Process {
    pub fn start(world: &World, name: &str, arguments: &[&str]) -> Self {
        let log = world.root.path().join(format!("{name}-{}.log", Stamp::now().nanoseconds()));
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.arg(name).arg(&world.file).arg("--root").arg(world.root.path());
        command.args(["--json", "--end-with-stdin"]).args(arguments);
        if name == "run" {
            command.arg("--flights").arg(world.recordings());
        }
        Self::spawn(&mut command, log)
    }

    pub fn spawn(command: &mut Command, log: PathBuf) -> Self {
        let messages = File::create(&log).expect("own directory");
        let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(messages);
        Self { child: command.spawn().expect("the program is built"), log }
    }

    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    pub fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.child), signal).expect("the child is there");
    }

    /// SIGKILL; returns when it is dead.
    pub fn kill(mut self) {
        self.child.kill().expect("the child is there");
        self.child.wait().expect("a child");
    }

    pub fn runs(&mut self) -> bool {
        self.child.try_wait().expect("a child").is_none()
    }

    pub fn said(&self) -> String {
        std::fs::read_to_string(&self.log).expect("own directory")
    }

    /// Closes its input and waits for the end.
    pub fn end(mut self) -> End {
        drop(self.child.stdin.take());
        self.wait()
    }

    /// Waits for the end.
    pub fn wait(mut self) -> End {
        let log = self.log.clone();
        until(|| (!self.runs()).then_some(()), || std::fs::read_to_string(&log).unwrap_or_default());
        let mut printed = String::new();
        if let Some(mut output) = self.child.stdout.take() {
            std::io::Read::read_to_string(&mut output, &mut printed).expect("text");
        }
        let code = self.child.wait().expect("a child").code();
        let report = serde_json::from_str(&printed).unwrap_or(Value::Null);
        End { code, report, said: self.said() }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended; either way nothing of a failed test is to remain.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An operator of the world's daemon.
pub struct Operator(OperatorClient);

impl Operator {
    pub fn open(endpoint: &Endpoint) -> Self {
        Self(OperatorClient::open(endpoint, PATIENCE).expect("a daemon"))
    }

    /// The daemon's status, when it is a present one.
    pub fn status(&mut self) -> Option<StatusMessage> {
        let now = Stamp::now();
        let status = self.0.newest_status(now)?;
        let age = now.since(Stamp::from_nanoseconds(status.header.publish_stamp_ns));
        (age < STATUS_AGE_MAX).then_some(status)
    }

    /// The newest status however old.
    pub fn last_status(&mut self) -> Option<StatusMessage> {
        self.0.newest_status(Stamp::now())
    }

    /// Waits for a present status.
    pub fn until(&mut self, wanted: impl Fn(&StatusMessage) -> bool) -> StatusMessage {
        let mut last = None;
        until(
            || {
                last = self.status();
                last.filter(|status| wanted(status))
            },
            || "another status".to_owned(),
        )
    }

    pub fn until_state(&mut self, code: u32) -> StatusMessage {
        self.until(|status| status.state == code)
    }

    /// Asks; whether it was done shows in the status. Why not is for messages of failed tests: the code of the cause,
    /// 0 when it was accepted; `None` without an answer.
    pub fn ask(&mut self, verb: u32) -> Option<u32> {
        let request = OperatorRequest { verb, ..OperatorRequest::default() };
        self.0.send(request, ANSWER_WAIT).ok().map(|answer| answer.cause)
    }

    /// Asks for one state after the other until coils carry current. What a machine that stops processes did to the loop
    /// meanwhile is reset, as an operator would.
    pub fn steer(&mut self) -> StatusMessage {
        let steers = |status: &StatusMessage| status.state == state::ACTIVE && current(status) > STEERING;
        let mut last = None;
        until(
            || {
                let status = self.status()?;
                last = Some(status);
                match status.state {
                    state::IDLE => _ = self.ask(verb::ARM),
                    state::ARMED => {
                        self.set_target();
                        self.ask(verb::GO);
                    }
                    state::FAULT => _ = self.ask(verb::RESET),
                    _ => (),
                }
                Some(status).filter(steers)
            },
            || "not steering".to_owned(),
        )
    }

    /// Both magnets at 70 deg from z, in the plane.
    fn set_target(&mut self) {
        let angle = 70_f64.to_radians();
        let mut direction = [[0.0; 3]; MAGNETS_MAX];
        direction[..2].fill([angle.sin(), 0.0, angle.cos()]);
        let request = OperatorRequest {
            verb: verb::SET_TARGET,
            magnet_count: 2,
            direction,
            ..OperatorRequest::default()
        };
        let _ = self.0.send(request, ANSWER_WAIT);
    }
}

/// Largest measured current, A.
pub fn current(status: &StatusMessage) -> f64 {
    status.measured.current_a.iter().fold(0.0, |most, current| most.max(current.abs()))
}

/// Polls until something is there.
pub fn until<T>(mut poll: impl FnMut() -> Option<T>, what: impl Fn() -> String) -> T {
    let begin = Instant::now();
    loop {
        if let Some(found) = poll() {
            return found;
        }
        assert!(begin.elapsed() < PATIENCE, "{}", what());
        std::thread::sleep(Duration::from_millis(5));
    }
}
