//! The process that records a run, as the daemon's child.
//!
//! Problem: a recording must hold every cycle from the first to the last, and nothing that becomes of it, a
//! full disk, a crash, a kill, may touch the loop. Method: the recorder is a process of its own, which the
//! daemon starts before its loop and waits for until it listens; from then on it is looked at, never waited
//! for, until the loop has ended and the last cycles are to be written. A recorder that dies is told of once.

use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use std::os::unix::process::CommandExt;

/// What a recorder prints, on a line of its own, when it listens.
pub const ATTACHED: &str = "attached";
/// How long it may take until it listens.
const ATTACH_PATIENCE: Duration = Duration::from_secs(20);
/// How long it may take to write what is left when the loop has ended.
const END_PATIENCE: Duration = Duration::from_secs(10);
const POLL: Duration = Duration::from_millis(5);

/// How to start a recorder: a program that prints [`ATTACHED`] when it listens, and ends after the last cycle
/// or when its standard input closes.
#[derive(Debug, Clone)]
pub struct CompanionPlan {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<std::ffi::OsString>,
}

/// A recorder that could not be started.
#[derive(Debug, thiserror::Error)]
pub enum CompanionError {
    /// No process.
    #[error("the recorder cannot be started: {0}")]
    Start(#[from] std::io::Error),
    /// It ended, or said nothing.
    #[error("the recorder does not record: it {0} before the loop could start")]
    NotAttached(String),
}

/// The recorder of a run.
#[derive(Debug)]
pub struct Companion {
    child: Child,
    /// The child ends when this closes.
    input: Option<ChildStdin>,
    lines: Receiver<String>,
    /// It was told already that the child has ended.
    ended: bool,
}

impl Companion {
    /// Starts the recorder and waits until it listens.
    ///
    /// # Errors
    /// When it cannot be started, ends, or does not listen within twenty seconds.
    pub fn start(plan: &CompanionPlan) -> Result<Self, CompanionError> {
        let mut child = Command::new(&plan.program)
            .args(&plan.arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            // A terminal's Ctrl-C is for the daemon alone: what it does until it has ended is recorded too.
            .process_group(0)
            .spawn()?;
        let input = child.stdin.take();
        let output = child.stdout.take();
        let (say, lines) = channel();
        let listen = move || {
            for line in
                output.into_iter().flat_map(|output| BufReader::new(output).lines()).map_while(Result::ok)
            {
                if say.send(line).is_err() {
                    break;
                }
            }
        };
        let mut companion = Self { child, input, lines, ended: false };
        std::thread::Builder::new().name("magsteer-child".to_owned()).spawn(listen)?;
        companion.await_attached()?;
        Ok(companion)
    }

    fn await_attached(&mut self) -> Result<(), CompanionError> {
        let begin = Instant::now();
        loop {
            match self.lines.recv_timeout(POLL) {
                Ok(line) if line.trim() == ATTACHED => return Ok(()),
                Ok(_) | Err(_) if begin.elapsed() <= ATTACH_PATIENCE => {
                    if let Some(status) = self.child.try_wait()? {
                        return Err(CompanionError::NotAttached(format!("ended with {status}")));
                    }
                    std::thread::sleep(POLL);
                }
                Ok(_) | Err(_) => {
                    let waited = ATTACH_PATIENCE.as_secs();
                    return Err(CompanionError::NotAttached(format!("was silent for {waited} s")));
                }
            }
        }
    }

    /// In words how the recorder ended, the first time that it is seen to have.
    pub fn newly_dead(&mut self) -> Option<String> {
        if self.ended {
            return None;
        }
        let status = self.child.try_wait().ok().flatten()?;
        self.ended = true;
        Some(format!("the recorder ended with {status}: what follows is not recorded"))
    }

    /// Waits until the recorder has written the last cycle and ended, but not for ever; in words what went
    /// wrong, `None` when nothing did.
    pub fn finish(mut self) -> Option<String> {
        if self.ended {
            return None;
        }
        let begin = Instant::now();
        let mut asked = false;
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => {
                    self.ended = true;
                    return (!status.success()).then(|| format!("the recorder ended with {status}"));
                }
                Ok(None) if begin.elapsed() <= END_PATIENCE => {
                    if !asked && begin.elapsed() > END_PATIENCE / 2 {
                        // The last cycle did not reach it: it writes what it has.
                        self.input = None;
                        asked = true;
                    }
                    std::thread::sleep(POLL);
                }
                Ok(None) => {
                    return Some("the recorder has not ended in time and is left to itself".to_owned());
                }
                Err(error) => return Some(format!("the recorder cannot be waited for: {error}")),
            }
        }
    }
}
