//! The loop's thread: waits for each deadline, runs the cycle, measures it, hands it on.
//!
//! The only traffic with other threads is through wait-free rings and one atomic number. A ring that is
//! full makes the loop count what it could not hand on, never wait.

use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU64, Ordering};
use std::time::Duration;

use magsteer_hal::operator::{Cause, state};
use magsteer_hal::{Hardware, Stamp};
use rtrb::{Consumer, Producer};

use super::allocation::allocations_of_thread;
use super::clock::{Clock, Pace};
use super::control_loop::ControlLoop;
use super::cycle_record::CycleRecord;
use super::kernel::{self, ThreadUsage};
use super::monitors::MonitorReport;
use super::phases::StopWatch;
use super::state::{Answer, Request, Verb};
use super::statistics::Statistics;
use super::timing_summary::{TimingHistograms, TimingSummary};
use crate::control::Step;

/// Asks a running daemon to ramp down and end; may be set from any thread.
#[derive(Debug, Default)]
pub struct StopFlag(AtomicI32);

impl StopFlag {
    /// Not asked yet.
    #[must_use]
    pub const fn new() -> Self {
        Self(AtomicI32::new(0))
    }

    /// Asks to end because of `signal`, a positive number; the first one stays.
    pub fn request(&self, signal: i32) {
        // When another signal came first there is nothing to do.
        let _ = self.0.compare_exchange(0, signal.max(1), Ordering::AcqRel, Ordering::Acquire);
    }

    /// The signal that asked first; `None` when nobody did.
    #[must_use]
    pub fn requested(&self) -> Option<i32> {
        match self.0.load(Ordering::Acquire) {
            0 => None,
            signal => Some(signal),
        }
    }
}

/// The loop's ends of the rings.
#[derive(Debug)]
pub struct LoopRings {
    /// Requests to the loop.
    pub requests: Consumer<Request>,
    /// Their answers.
    pub answers: Producer<Answer>,
    /// One record a cycle.
    pub records: Producer<CycleRecord>,
}

/// Counts that other threads may read while the loop runs.
#[derive(Debug, Default)]
pub struct LoopCounters {
    /// Records that found their ring full.
    pub records_dropped: AtomicU64,
    /// Answers that found their ring full.
    pub answers_dropped: AtomicU64,
    /// See [`LoopEnd::allocations`].
    pub allocations: AtomicU64,
    /// Real time is enforced and was not granted.
    pub realtime_missing: AtomicBool,
}

/// A ramp to zero, from the cycle that began it to the one that saw zero measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RampDown {
    /// How long it took.
    pub duration: Duration,
    /// Largest current measured at its begin, A.
    pub current_begin: f64,
    /// Largest current measured at its end, A; `None` when the driver did not report that in time.
    pub current_end: Option<f64>,
}

/// What a loop came to when it ended.
#[derive(Debug, Clone, PartialEq)]
pub struct LoopEnd {
    /// Timing of all cycles.
    pub timing: TimingSummary,
    /// The same cycles, bin by bin.
    pub histograms: TimingHistograms,
    /// Allocations of the loop's thread within its cycles, beyond the transport's one a message sent; counted
    /// from the second message on, since the first one forms the connection. 0 in a program whose
    /// allocator does not count.
    pub allocations: u64,
    /// What the loop's thread met while it cycled.
    pub usage: ThreadUsage,
    /// Last ramp to zero, if there was one.
    pub ramp_down: Option<RampDown>,
    /// State code at the end.
    pub state: u32,
    /// Cause of the last stop or fault.
    pub cause: Option<Cause>,
    /// Commands that the driver refused since its start, as it says.
    pub commands_refused: u64,
    /// Commands that broke a limit since the driver's start, as it says.
    pub limit_breaks: u64,
    /// What the monitors counted.
    pub monitors: MonitorReport,
    /// How often a monitor would have tripped in passive mode.
    pub would_trip_count: u64,
}

/// Counts what the loop's thread allocates in its cycles beyond what the transport does.
#[derive(Debug, Default)]
struct AllocationWatch {
    before: u64,
    connected: bool,
}

impl AllocationWatch {
    fn begin(&mut self) {
        self.before = allocations_of_thread();
    }

    /// Allocations of the cycle that ends, without those of the message that it sent.
    fn end(&mut self, record: &CycleRecord) -> u64 {
        let sent = record.order.is_some();
        let met = (allocations_of_thread() - self.before).saturating_sub(u64::from(sent));
        let counted = if self.connected { met } else { 0 };
        self.connected |= sent;
        counted
    }
}

/// Measures ramps to zero from one cycle to the next.
#[derive(Debug, Default)]
struct RampWatch {
    begin: Option<(Stamp, f64)>,
    last: Option<RampDown>,
}

impl RampWatch {
    fn take(&mut self, record: &CycleRecord) {
        let Some(transition) = record.decision.transition else {
            return;
        };
        let current = largest_current(record);
        if transition.to == state::SAFE_STOP {
            self.begin = Some((record.tick.now, current));
        } else if let Some((begin, current_begin)) = self.begin.take() {
            let duration = record.tick.now.since(begin);
            let is_confirmed = transition.cause != Some(Cause::RampTimeout);
            self.last =
                Some(RampDown { duration, current_begin, current_end: is_confirmed.then_some(current) });
        }
    }
}

fn largest_current(record: &CycleRecord) -> f64 {
    record.input.measured.current_a.iter().fold(0.0, |largest: f64, current| largest.max(current.abs()))
}

/// Runs cycles until `stop` was asked for and the outputs are at rest. `statistics` comes empty, made before
/// memory was locked.
pub fn run_loop<H: Hardware, S: Step>(
    mut control_loop: ControlLoop<H, S>,
    pace: Pace,
    mut statistics: Statistics,
    mut rings: LoopRings,
    counters: &LoopCounters,
    stop: &StopFlag,
) -> LoopEnd {
    let mut ramps = RampWatch::default();
    let mut allocations = AllocationWatch::default();
    let mut asked_to_end = false;
    let usage_before = kernel::thread_usage();
    let mut clock = Clock::start(pace);
    loop {
        let tick = clock.wait();
        allocations.begin();
        if !asked_to_end && stop.requested().is_some() {
            asked_to_end = control_loop.request(Request { id: 0, verb: Verb::Terminate }).is_ok();
        } else if let Ok(request) = rings.requests.pop() {
            // The loop takes one request a cycle, and this is the only one who leaves any.
            let _ = control_loop.request(request);
        }
        let mut watch = StopWatch::started(tick.now);
        let mut record = control_loop.timed_cycle(tick, &mut watch);
        record.note_times(watch.finish());
        record.allocations = counters.allocations.load(Ordering::Relaxed);
        statistics.record(&record.timing());
        ramps.take(&record);
        hand_on(&mut rings, &record, counters);
        // Read by another thread, written by this one alone.
        counters.allocations.fetch_add(allocations.end(&record), Ordering::Relaxed);
        if control_loop.has_ended(tick.now) {
            let feedback = record.feedback.unwrap_or_default();
            return LoopEnd {
                usage: kernel::thread_usage().since(&usage_before),
                timing: statistics.summary(),
                histograms: statistics.histograms(),
                allocations: counters.allocations.load(Ordering::Relaxed),
                ramp_down: ramps.last,
                state: record.decision.state,
                cause: record.decision.cause,
                commands_refused: feedback.commands_refused,
                limit_breaks: feedback.limit_breaks,
                monitors: control_loop.monitors(),
                would_trip_count: record.decision.judgements.count,
            };
        }
    }
}

fn hand_on(rings: &mut LoopRings, record: &CycleRecord, counters: &LoopCounters) {
    for answer in record.decision.answers.into_iter().flatten() {
        if rings.answers.push(answer).is_err() {
            counters.answers_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
    if rings.records.push(*record).is_err() {
        counters.records_dropped.fetch_add(1, Ordering::Relaxed);
    }
}
