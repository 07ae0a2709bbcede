//! Does a recorded run again: the same ticks, messages and requests into the same loop, and compares what it
//! commands, bit for bit.
//!
//! Terms: *the same loop* is supervisor, controller and gate, built from the recorded configuration or from
//! another one; a *difference* is a cycle whose command, state or cause is not the recorded one.
//!
//! Method: the loop reads no clock and no channel, so what its hardware returned and what it was asked decide
//! all that it does. After the first difference its state is another one; nothing behind it says anything, so
//! the replay ends there.
//!
//! # Limits
//! Bit equality holds for one build of the program on one kind of machine: another compiler, or a system
//! library with another sine, may round differently.

use std::path::PathBuf;
use std::time::Duration;

use magsteer_hal::record::NONE;
use magsteer_hal::{AdmittedCommand, Hardware, Reading, Sensed, Stamp, WriteError};
use serde::Serialize;

use super::convert::Sizes;
use super::cycle::Cycle;
use super::error::RecordingError;
use super::reader::{Recording, follows};
use super::value::Number;
use crate::config::{Config, Document, Problems};
use crate::control::{Cycle as Controller, Step};
use crate::daemon::{ControlLoop, CycleRecord, LoopOptions, Mode, Tick, cycle_message, taken_request};

/// Stack of the threads that share a controller's work, bytes: as in the daemon.
const WORKER_STACK: usize = 8 << 20;
/// Fields that must be equal: what was commanded, and what the daemon made of the cycle.
const COMPARED: [&str; 7] =
    ["order", "epoch", "command_pose_stamp_ns", "commanded_a", "commanded_rad", "state", "cause"];
/// Fields that nobody computes: times of the machine, counts of its allocator, and what the driver wrote.
const MACHINE: [&str; 7] =
    ["execution_ns", "read_ns", "control_ns", "decide_ns", "write_ns", "record_ns", "allocations"];

/// A recording that cannot be done again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// It cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The configuration is refused.
    #[error(transparent)]
    Config(#[from] Problems),
    /// No cycle.
    #[error("{}: holds no cycle", path.display())]
    Empty {
        /// The recording.
        path: PathBuf,
    },
    /// It begins in the middle of a run.
    #[error(
        "{}: begins with cycle {first}, after the run did: what the loop had become by then is not known",
        path.display()
    )]
    LateBegin {
        /// The recording.
        path: PathBuf,
        /// Number of its first cycle.
        first: u64,
    },
    /// Cycles are missing.
    #[error("{}: cycles between {before} and {after} are missing", path.display())]
    Hole {
        /// The recording.
        path: PathBuf,
        /// Number of the last cycle before the hole.
        before: u64,
        /// Number of the first one after it.
        after: u64,
    },
    /// Another rig.
    #[error("the configuration describes another rig than the one recorded: {what}")]
    OtherRig {
        /// What differs.
        what: &'static str,
    },
    /// The controller's threads.
    #[error("a thread could not be started: {0}")]
    Thread(#[from] rayon::ThreadPoolBuildError),
}

/// A field of the first difference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FieldDifference {
    /// Its name, with the index of the entry where it has several.
    pub field: String,
    /// What was recorded.
    pub recorded: String,
    /// What came out now.
    pub replayed: String,
    /// True for what decides: commands, state, cause.
    pub decides: bool,
}

/// The first cycle that came out differently.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// Its number.
    pub cycle: u64,
    /// Since the first cycle.
    pub time_s: f64,
    /// What differs, that which decides first.
    pub fields: Vec<FieldDifference>,
}

/// How a replay went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReplayReport {
    /// Cycles that came out equal.
    pub equal: u64,
    /// Commands among them.
    pub commands: u64,
    /// Requests taken.
    pub requests: u64,
    /// Cycles in which a stop or a fault began.
    pub trips: u64,
    /// The first that did not; `None` when all did.
    pub difference: Option<Difference>,
}

/// Does `recording` again with the loop of `document`, or with the recorded one.
///
/// # Errors
/// When the recording cannot be read or lacks cycles, or the configuration is refused.
pub fn replay(recording: &Recording, document: Option<&Document>) -> Result<ReplayReport, ReplayError> {
    let recorded;
    let document = match document {
        Some(document) => document,
        None => {
            recorded = recorded_document(recording)?;
            &recorded
        }
    };
    let config = Config::from_document(document)?;
    let mut again = Again::new(recording, document, &config)?;
    match again.workers()? {
        Some(pool) => pool.install(|| again.run(recording)),
        None => again.run(recording),
    }
}

/// The recorded configuration.
///
/// # Errors
/// When it is no text of a configuration.
pub fn recorded_document(recording: &Recording) -> Result<Document, Problems> {
    Document::from_text(format!("{} (recorded)", recording.path().display()), recording.config_text())
}

/// [`Hardware`] that returns what was read once.
#[derive(Debug)]
struct Playback {
    sensed: Sensed,
    write_fails: bool,
}

impl Hardware for Playback {
    fn read(&mut self, _: Stamp) -> Sensed {
        self.sensed
    }

    fn write(&mut self, _: &AdmittedCommand, _: Stamp) -> Result<(), WriteError> {
        if self.write_fails { Err(WriteError::Transport) } else { Ok(()) }
    }
}

/// The loop that does it again.
struct Again {
    control_loop: ControlLoop<Playback, Controller>,
    sizes: Sizes,
    report: ReplayReport,
}

impl Again {
    fn new(recording: &Recording, document: &Document, config: &Config) -> Result<Self, ReplayError> {
        let (rig, info) = (&config.description, recording.info());
        let sizes =
            Sizes { coils: rig.coils.len(), frames: rig.frames.len(), magnets: rig.magnets().count() };
        let recorded = info.sizes();
        let counts = [
            (sizes.coils == recorded.coils, "its number of coils"),
            (sizes.frames == recorded.frames, "its number of frames"),
            (sizes.magnets == recorded.magnets, "its number of magnets"),
        ];
        if let Some((_, what)) = counts.into_iter().find(|(is_same, _)| !is_same) {
            return Err(ReplayError::OtherRig { what });
        }
        let mut daemon = document.require("daemon", &config.daemon)?.clone();
        let control = document.require("control", &config.control)?;
        let manipulator = document.require("rod", &config.manipulator)?;
        let first = recording.cycles()?.next().transpose()?;
        let first = first.ok_or_else(|| ReplayError::Empty { path: recording.path().to_owned() })?;
        // The command line of a run may have made it passive, whatever its configuration says.
        daemon.mode = if first.passive == 1 { Mode::Passive } else { Mode::Active };
        let controller = Controller::new(control, rig, manipulator.clone());
        let hardware = Playback {
            sensed: Sensed { pose: Reading::never(), feedback: Reading::never() },
            write_fails: false,
        };
        let options = LoopOptions { realtime_missing: info.realtime_missing, token_seed: 0 };
        let report = ReplayReport { equal: 0, commands: 0, requests: 0, trips: 0, difference: None };
        Ok(Self {
            control_loop: ControlLoop::new(hardware, controller, rig, &daemon, options),
            sizes,
            report,
        })
    }

    fn workers(&mut self) -> Result<Option<std::sync::Arc<rayon::ThreadPool>>, ReplayError> {
        Ok(self.control_loop.controller_mut().start_workers(WORKER_STACK)?)
    }

    fn run(mut self, recording: &Recording) -> Result<ReplayReport, ReplayError> {
        let mut before: Option<u64> = None;
        let mut begin_ns = None;
        for cycle in recording.cycles()? {
            let cycle = cycle?;
            if !follows(before, &cycle) {
                let path = recording.path().to_owned();
                return Err(match before {
                    None => ReplayError::LateBegin { path, first: cycle.number },
                    Some(before) => ReplayError::Hole { path, before, after: cycle.number },
                });
            }
            before = Some(cycle.number);
            let begin_ns = *begin_ns.get_or_insert(cycle.now_ns);
            let fields = self.differences(&cycle);
            if !fields.is_empty() {
                let time_s = Duration::from_nanos(cycle.now_ns.saturating_sub(begin_ns)).as_secs_f64();
                self.report.difference = Some(Difference { cycle: cycle.number, time_s, fields });
                break;
            }
            self.report.equal += 1;
            self.report.commands += u64::from(cycle.order != NONE);
            self.report.requests += u64::from(cycle.request_verb != 0);
            self.report.trips += u64::from(cycle.transition_cause >= 200);
        }
        Ok(self.report)
    }

    /// Does one cycle; empty when what decides is equal.
    fn differences(&mut self, cycle: &Cycle) -> Vec<FieldDifference> {
        let record = self.cycle(cycle);
        let replayed = Cycle::of_message(&cycle_message(&record), self.sizes);
        let is_equal = replayed.order == cycle.order
            && replayed.epoch == cycle.epoch
            && replayed.command_pose_stamp_ns == cycle.command_pose_stamp_ns
            && (replayed.state, replayed.cause) == (cycle.state, cycle.cause)
            && same_bits(&replayed.commanded_a, &cycle.commanded_a)
            && same_bits(&replayed.commanded_rad, &cycle.commanded_rad);
        if is_equal { Vec::new() } else { listed(cycle, &replayed) }
    }

    fn cycle(&mut self, cycle: &Cycle) -> CycleRecord {
        let hardware = self.control_loop.hardware_mut();
        hardware.sensed = Sensed {
            pose: Reading {
                last: cycle.pose(),
                fresh: cycle.pose_fresh == 1,
                refused: cycle.pose_refusal().absent(),
            },
            feedback: Reading {
                last: cycle.feedback(),
                fresh: cycle.feedback_fresh == 1,
                refused: cycle.feedback_refusal().absent(),
            },
        };
        // Something was to be sent, and nothing was.
        hardware.write_fails = cycle.directive != 0 && cycle.order == NONE;
        if let Some(request) = taken_request(&cycle.request()) {
            // The loop took the one before in the cycle before.
            let _ = self.control_loop.request(request);
        }
        self.control_loop.cycle(Tick {
            number: cycle.number,
            deadline: Stamp::from_nanoseconds(cycle.deadline_ns),
            now: Stamp::from_nanoseconds(cycle.now_ns),
            lateness: Duration::from_nanos(cycle.lateness_ns),
            missed: cycle.missed,
        })
    }
}

fn same_bits(one: &[f64], other: &[f64]) -> bool {
    one.len() == other.len() && one.iter().zip(other).all(|(one, other)| one.to_bits() == other.to_bits())
}

/// Every field that differs, that which decides first.
fn listed(recorded: &Cycle, replayed: &Cycle) -> Vec<FieldDifference> {
    let (recorded, replayed) = (recorded.numbers(), replayed.numbers());
    let mut found = Vec::new();
    for (field, (recorded, replayed)) in Cycle::FIELDS.iter().zip(recorded.iter().zip(&replayed)) {
        if MACHINE.contains(&field.name) {
            continue;
        }
        for index in 0..recorded.len().max(replayed.len()) {
            let (was, is) = (recorded.get(index), replayed.get(index));
            if was.map(bits) != is.map(bits) {
                let has_one = recorded.len() == 1 && replayed.len() == 1;
                let entry = if has_one { String::new() } else { format!("[{index}]") };
                found.push(FieldDifference {
                    field: format!("{}{entry}", field.name),
                    recorded: words(was),
                    replayed: words(is),
                    decides: COMPARED.contains(&field.name),
                });
            }
        }
    }
    found.sort_by_key(|difference| !difference.decides);
    found
}

fn bits(number: &Number) -> u64 {
    match number {
        Number::Count(count) => *count,
        Number::Real(real) => real.to_bits(),
    }
}

fn words(number: Option<&Number>) -> String {
    match number {
        None => "nothing".to_owned(),
        Some(Number::Count(count)) => count.to_string(),
        Some(Number::Real(real)) => format!("{real:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::{COMPARED, Cycle, MACHINE};

    #[test]
    fn fields_that_are_compared_or_left_out_are_fields() {
        for name in COMPARED.iter().chain(&MACHINE) {
            assert!(Cycle::FIELDS.iter().any(|field| field.name == *name), "{name}");
        }
    }
}
