//! What stands at the head of a flight: who, what rig, why, and what its columns are.

use std::fs;

use magsteer_hal::operator::{cause, state};
use serde::{Deserialize, Serialize};

/// One value of every record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Column {
    /// Name, its unit last.
    pub name: String,
    /// [`Self::COUNT`] or [`Self::NUMBER`].
    #[serde(rename = "type")]
    pub kind: String,
    /// What it is.
    pub meaning: String,
}

impl Column {
    /// An unsigned whole number; all bits set stands for "none".
    pub const COUNT: &'static str = "u64";
    /// A double; not a number stands for "none".
    pub const NUMBER: &'static str = "f64";
}

/// Why a flight was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// A trip into `SafeStop`.
    SafeStop,
    /// A fault without a ramp before it.
    Fault,
    /// An operator asked for it.
    Operator,
    /// The loop ended while it held authority: its thread died.
    LoopDied,
}

impl Reason {
    /// As a word of data.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::SafeStop => "safe-stop",
            Self::Fault => "fault",
            Self::Operator => "operator",
            Self::LoopDied => "loop-died",
        }
    }
}

/// The machine that a flight was recorded on, as it says itself; empty where it says nothing.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Machine {
    /// Name of the host.
    pub host: String,
    /// Release and version of the kernel.
    pub kernel: String,
    /// Model of the processor.
    pub processor: String,
    /// Processors that this process may use.
    pub processors: usize,
}

impl Machine {
    /// This one.
    #[must_use]
    pub fn this() -> Self {
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default().trim().to_owned();
        let kernel = ["osrelease", "version"].map(|name| read(&format!("/proc/sys/kernel/{name}")));
        let processors = read("/proc/cpuinfo");
        let model = processors.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
        Self {
            host: read("/proc/sys/kernel/hostname"),
            kernel: kernel.join(" "),
            processor: model.map_or_else(String::new, |(_, model)| model.to_owned()),
            processors: std::thread::available_parallelism().map_or(0, usize::from),
        }
    }
}

/// The head of a flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the program that wrote it.
    pub program: String,
    /// Name of the rig.
    pub rig: String,
    /// Fingerprint of the rig's description, hexadecimal.
    pub description_fingerprint: String,
    /// SHA-256 of the configuration, resolved.
    pub config_sha256: String,
    /// Configured rate of the loop.
    pub rate_hz: f64,
    /// When the daemon started, RFC 3339.
    pub started: String,
    /// Its process.
    pub pid: u32,
    /// Where it ran.
    pub machine: Machine,
    /// Why the flight was written.
    pub reason: Reason,
    /// Cycle of the trip or of the order.
    pub trigger_cycle: u64,
    /// When it began, `CLOCK_MONOTONIC`.
    pub trigger_ns: u64,
    /// The same by the clock on the wall, RFC 3339.
    pub trigger_time: String,
    /// State code before it.
    pub from: u32,
    /// State code after it.
    pub to: u32,
    /// Cause code; 0 without one.
    pub cause: u32,
    /// Worst cause until the flight was written; 0 without one.
    pub worst_cause: u32,
    /// Records in the file.
    pub records: u64,
    /// Cycle records that never came to the recorder, since the daemon's start.
    pub records_dropped: u64,
    /// Names of the coils, in their order.
    pub coils: Vec<String>,
    /// Names of the frames, in their order.
    pub frames: Vec<String>,
    /// Names of the magnets, base to tip.
    pub magnets: Vec<String>,
    /// Greatest current that a coil may carry.
    pub current_max_a: f64,
    /// What every record holds, in its order.
    pub columns: Vec<Column>,
}

impl Header {
    /// The trip in words: `active -> safe-stop: no fresh poses (cause 200)`.
    #[must_use]
    pub fn words(&self) -> String {
        let mut words = match self.reason {
            Reason::Operator => format!("saved by an operator while {}", state::name(self.to)),
            Reason::LoopDied => format!("the loop died while {}", state::name(self.to)),
            Reason::SafeStop | Reason::Fault => {
                format!("{} -> {}", state::name(self.from), state::name(self.to))
            }
        };
        if self.cause != 0 {
            words += &format!(": {} (cause {})", cause::text(self.cause), self.cause);
        }
        if self.worst_cause > self.cause {
            words += &format!(", then {} (cause {})", cause::text(self.worst_cause), self.worst_cause);
        }
        words
    }
}
