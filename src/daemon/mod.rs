//! The daemon: runs the controller at a fixed rate against whatever drives the coils, and guards it.
//!
//! Start reading in `control_loop.rs`. What is absent: physics, and any waiting for a message.
//!
//! | file | does |
//! |---|---|
//! | `control_loop` | one cycle: read, step, supervise, gate, write, record |
//! | `trail` | the way that the actuation came, for a retreat along it |
//! | `cycle_record` | what is known of a cycle when it has ended |
//! | `wire`, `record_feed` | the same as it is published, in batches, for whoever records |
//! | `companion` | the process that records a run, as the daemon's child |
//! | `config` | the `[daemon]` table |
//! | `state` | the states with their diagram, requests, answers |
//! | `supervisor` | decides the state and what the cycle may send |
//! | `watch` | what is judged in a cycle, and which cause follows from it |
//! | `trust` | whether driver and sensor can be believed, though what they say is fresh and well formed |
//! | `causes` | what each cause makes of the daemon |
//! | `monitors` | slow and narrow judgements: heat, open coils, implausible poses, want of progress |
//! | `overruns` | whether the loop missed too many periods |
//! | `passive` | what monitors would have done, in passive mode |
//! | `clock` | absolute deadlines, missed periods |
//! | `kernel` | the one file that asks the kernel for real time, and reads back what it granted |
//! | `allocation` | counts how often each thread allocates |
//! | `realtime`, `idle` | what was asked of it and what holds; how deep idle CPUs may sleep |
//! | `phases` | where in a cycle its time goes |
//! | `receipt` | how long it takes from poses to the driver, as the driver stamped it |
//! | `threads` | the scheduling of every thread of a process, read back |
//! | `statistics`, `timing_summary` | lossless histograms of timing by run and minute; their quantiles |
//! | `runner` | the loop's thread |
//! | `telemetry`, `view` | the other thread: requests and status |
//! | `operator_request`, `log` | what an operator's message asks of the loop; lines about the loop |
//! | `recorder` | the last seconds of every cycle, written out after a trip; the journal of events |
//! | `notify` | what the service manager is told; its watchdog is fed by the loop's progress alone |
//! | `journal` | where log lines go, with priorities and fields |
//! | `target` | targets and tangents as people write and read them |
//! | `target_rules` | which targets a rig can take |
//! | `lockstep` | the loop under stepped time: plays an experiment faster than real time |
//! | `run_digest` | a run in 64 bits, to see whether two are the same |
//! | `step_response` | judges how the loop answered a step of its targets |
//! | `run` | puts the threads together and takes them down |

mod allocation;
mod causes;
mod clock;
mod companion;
mod config;
mod control_loop;
#[cfg(test)]
mod control_loop_tests;
mod cycle_record;
pub mod idle;
mod journal;
pub mod kernel;
pub mod lockstep;
mod log;
mod monitors;
mod notify;
mod operator_request;
mod overruns;
mod passive;
mod phases;
pub mod realtime;
mod receipt;
mod record_feed;
pub mod recorder;
mod run;
mod run_digest;
mod runner;
mod state;
mod statistics;
pub mod step_response;
mod supervisor;
#[cfg(test)]
mod supervisor_tests;
pub mod target;
mod target_rules;
mod telemetry;
pub mod threads;
mod timing_summary;
mod trail;
mod trust;
pub mod view;
mod watch;
mod wire;

pub use allocation::{CountingAllocator, allocations_of_thread, is_counting};
pub use causes::{Response, holds_currents, is_monitor, response};
pub use clock::{Clock, Pace, Schedule, Tick};
pub use companion::{ATTACHED, Companion, CompanionError, CompanionPlan};
pub use config::{DaemonConfig, Limits, Mode, RealtimePolicy, SafeAction};
pub use control_loop::{ControlLoop, LoopOptions, Occupied};
pub use cycle_record::CycleRecord;
pub use monitors::{MonitorLimits, MonitorReport, Monitors, MonitorsConfig, Sample, SequenceCounts};
pub use notify::Notify;
pub use operator_request::{RigCounts, verb_of};
pub use passive::Judgements;
pub use phases::{Phase, PhaseTimes, PhaseWatch, StopWatch, Untimed};
pub use receipt::Receipt;
pub use run::{RunError, RunPlan, RunReport, run};
pub use run_digest::RunDigest;
pub use runner::{LoopCounters, LoopEnd, LoopRings, RampDown, StopFlag, run_loop};
pub use state::{Answer, Directive, Request, State, Transition, Verb};
pub use statistics::{
    CycleTiming, MinuteStatistics, MinuteTiming, Statistics, latency_histogram, latency_summary,
};
pub use supervisor::{Decision, Supervisor};
pub use timing_summary::{Bin, LatencySummary, PhaseSummary, TimingHistograms, TimingSummary};
pub use trust::Astray;
pub use watch::{DriverView, Found, Observation};
pub use wire::{config_digest, cycle_message, taken_request};
