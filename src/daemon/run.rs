//! Puts the daemon together and takes it down: services, threads, the end.
//!
//! ```text
//!  caller's thread            loop thread                        telemetry thread
//!  open services ──────────▶ ports, controller, real time
//!                 ──────────────────────────────────────────────▶ ports
//!  watches both   ◀── ends ── cycles until asked to stop ─ rings ─▶ requests, status, log
//! ```
//!
//! When the loop's thread panics its last command runs out of validity, the driver ramps to zero alone, and this process
//! ends with an error. When the telemetry thread panics the loop ramps down and the process ends with an error.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use magsteer_hal::HardwareDescription;
use magsteer_hal::channels::{ChannelError, DaemonServices, Endpoint, OperatorServices};
use magsteer_hal::operator::{Cause, state};
use rayon::ThreadPool;
use serde::{Deserialize, Serialize};

use super::companion::{Companion, CompanionError, CompanionPlan};
use super::config::{DaemonConfig, RealtimePolicy};
use super::control_loop::{ControlLoop, LoopOptions};
use super::idle::IdleBound;
use super::kernel::{
    RealtimeRequest, ThreadUsage, request_helper_realtime, request_ordinary, request_realtime,
};
use super::log::log;
use super::monitors::MonitorReport;
use super::notify::Notify;
use super::realtime::{RealtimeItem, RealtimeReport};
use super::recorder::{Recorder, RecorderPlan, RecorderState};
use super::runner::{LoopCounters, LoopEnd, LoopRings, StopFlag, run_loop};
use super::statistics::Statistics;
use super::telemetry::{Recording, Telemetry, TelemetryRings};
use super::threads::threads_of;
use super::timing_summary::{TimingHistograms, TimingSummary};
use crate::control::Step;

/// How often the caller's thread looks after the others.
const WATCH: Duration = Duration::from_millis(10);
/// Looks from the loop's begin until every thread has asked the kernel for what it needs: 200 ms.
const LOOKS_UNTIL_SETTLED: u32 = 20;
/// How long one attempt to find the driver takes, so that a signal is noticed between two.
const DRIVER_ATTEMPT: Duration = Duration::from_millis(250);
/// Records kept while the telemetry thread is away: half a second, at least and at most this many.
const RECORDS: (usize, usize) = (256, 4_096);
/// Requests and answers kept.
const REQUESTS: usize = 64;
/// Stack of the loop's thread, bytes: the controller's state lies on the heap, its temporaries here.
const LOOP_STACK: usize = 8 << 20;
/// Signal number noted when a thread of this process died: none that exists.
const THREAD_DIED: i32 = i32::MAX;

/// What to run.
#[derive(Debug, Clone)]
pub struct RunPlan<'a> {
    /// The rig.
    pub description: &'a HardwareDescription,
    /// `[daemon]`.
    pub config: &'a DaemonConfig,
    /// Where the channels are.
    pub endpoint: &'a Endpoint,
    /// How long to wait for a driver.
    pub driver_wait: Duration,
    /// Arm as soon as the rig is ready.
    pub arm: bool,
    /// Flights and journal; `None` for none.
    pub recorder: Option<RecorderPlan>,
    /// The process that records every cycle; `None` for none.
    pub companion: Option<CompanionPlan>,
    /// As [`magsteer_hal::record::RecordBatch::config_digest`].
    pub config_digest: u64,
}

/// Why a daemon did not run to a clean end.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The channels could not be opened.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// A thread could not be started.
    #[error("a thread could not be started: {0}")]
    Thread(#[from] std::io::Error),
    /// The process that is to record does not.
    #[error(transparent)]
    Companion(#[from] CompanionError),
    /// Asked to end before a driver was found.
    #[error("asked to end before a driver was found")]
    Interrupted,
    /// The loop's thread panicked.
    #[error("the control loop panicked; the driver ramps the coils to zero by itself")]
    LoopPanicked,
    /// The telemetry thread panicked.
    #[error("the telemetry thread panicked; the coils were ramped to zero")]
    TelemetryPanicked,
}

/// How a run went.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// State at the end: `idle` after a clean ramp-down.
    pub state: String,
    /// Cause of the last stop or fault, in words.
    pub cause: Option<String>,
    /// Stable code of that cause, 0 without one.
    pub cause_code: u32,
    /// Duration of the last ramp to zero, from order to measured zero; absent when there was none.
    pub ramp_down_ms: Option<f64>,
    /// Largest current measured when that ramp began.
    pub ramp_down_from_a: Option<f64>,
    /// Largest current measured when it ended.
    pub ramp_down_to_a: Option<f64>,
    /// Timing of all cycles.
    #[serde(rename = "loop")]
    pub timing: TimingSummary,
    /// The same cycles, bin by bin.
    pub histograms: TimingHistograms,
    /// Allocations of the loop's thread within its cycles, as [`LoopEnd::allocations`].
    pub alloc_in_cycle: u64,
    /// What the kernel granted.
    pub realtime: RealtimeReport,
    /// What the loop's thread met while it cycled.
    pub loop_thread: ThreadUsage,
    /// Cycle records that the telemetry thread missed.
    pub records_dropped: u64,
    /// Commands that the driver refused since its start.
    pub commands_refused: u64,
    /// Commands that broke a limit since the driver's start; a correct daemon causes none.
    pub limit_breaks: u64,
    /// Flights that the recorder wrote.
    pub flights: Vec<PathBuf>,
    /// What the monitors counted.
    pub monitors: MonitorReport,
    /// How often a monitor would have tripped in passive mode.
    pub would_trip_count: u64,
}

impl RunReport {
    /// True when the run ended at rest, not in a fault.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.state != state::name(state::FAULT)
    }

    fn new(end: &LoopEnd, realtime: RealtimeReport, records_dropped: u64, flights: Vec<PathBuf>) -> Self {
        Self {
            state: state::name(end.state).to_owned(),
            cause: end.cause.map(|cause| cause.text().to_owned()),
            cause_code: end.cause.map_or(0, Cause::code),
            ramp_down_ms: end.ramp_down.map(|ramp| ramp.duration.as_secs_f64() * 1e3),
            ramp_down_from_a: end.ramp_down.map(|ramp| ramp.current_begin),
            ramp_down_to_a: end.ramp_down.and_then(|ramp| ramp.current_end),
            timing: end.timing,
            histograms: end.histograms.clone(),
            alloc_in_cycle: end.allocations,
            realtime,
            loop_thread: end.usage,
            records_dropped,
            commands_refused: end.commands_refused,
            limit_breaks: end.limit_breaks,
            flights,
            monitors: end.monitors,
            would_trip_count: end.would_trip_count,
        }
    }
}

/// Runs the daemon until `stop` is requested, with the controller that `make_controller` builds in the loop's thread.
///
/// # Errors
/// When no driver appears in time, the channels fail, or a thread of the daemon dies.
pub fn run<S: Step + Send>(
    plan: &RunPlan<'_>,
    make_controller: impl FnOnce() -> S + Send,
    stop: &StopFlag,
) -> Result<RunReport, RunError> {
    let mut notify = Notify::from_environment();
    notify.status("waiting for a driver");
    let services = find_driver(plan, stop)?;
    let operators = OperatorServices::create(plan.endpoint)?;
    let (loop_rings, telemetry_rings) = rings(plan.config);
    // Its memory is there before the loop's thread locks what there is.
    let recorder = plan.recorder.as_ref();
    let recorder = recorder
        .map(|recorder| Recorder::start(recorder, plan.description, plan.config.rate_hz))
        .transpose()?;
    let recorded = recorder.as_ref().map(Recorder::state);
    // It listens before the first cycle runs.
    let companion = plan.companion.as_ref().map(Companion::start).transpose()?;
    let recording = Recording { recorder, companion, config_digest: plan.config_digest };
    let counters = LoopCounters::default();
    let realtime = OnceLock::new();
    // Held until all threads have ended.
    let idle = plan.config.idle_latency_us.map(IdleBound::hold);
    let idle_item = idle.as_ref().map(|idle| &idle.item);
    std::thread::scope(|scope| {
        let loop_thread = std::thread::Builder::new()
            .name("magsteer-loop".to_owned())
            .stack_size(LOOP_STACK)
            .spawn_scoped(scope, || {
                let mut controller = make_controller();
                let workers = controller
                    .start_workers(LOOP_STACK)
                    .map_err(|error| RunError::Thread(std::io::Error::other(error)))?;
                let pool = workers.as_deref();
                let run = || -> Result<LoopEnd, RunError> {
                    // Before memory is locked, so that it is locked too.
                    let statistics = Statistics::new(plan.config.rate_hz);
                    let control_loop =
                        prepare_loop(plan, services, controller, (pool, idle_item), (&realtime, &counters))?;
                    Ok(run_loop(control_loop, plan.config.pace(), statistics, loop_rings, &counters, stop))
                };
                // Entered once: the loop becomes one of the pool's threads, and a cycle hands work to the others at little cost.
                match pool {
                    Some(pool) => pool.install(run),
                    None => run(),
                }
            })?;
        let telemetry_thread =
            std::thread::Builder::new().name("magsteer-comms".to_owned()).spawn_scoped(scope, || {
                tell_refused(&request_ordinary(plan.config.cpu));
                let server = operators.into_server()?;
                Telemetry::new(
                    server,
                    telemetry_rings,
                    plan.description,
                    plan.config,
                    plan.arm,
                    recording,
                    notify,
                )
                .serve(&counters, stop);
                Ok(())
            });
        let telemetry_thread = telemetry_thread.inspect_err(|_| stop.request(THREAD_DIED))?;
        let mut threads = Vec::new();
        let mut looks = 0;
        while !loop_thread.is_finished() {
            looks += u32::from(realtime.get().is_some());
            if looks == LOOKS_UNTIL_SETTLED {
                threads = threads_of(Path::new("/proc/self"));
                threads.iter().for_each(|thread| log(format_args!("thread {thread}")));
            }
            if telemetry_thread.is_finished() {
                stop.request(THREAD_DIED);
            }
            std::thread::sleep(WATCH);
        }
        let end: Result<LoopEnd, RunError> = loop_thread.join().map_err(|_| RunError::LoopPanicked)?;
        let told: Result<(), ChannelError> =
            telemetry_thread.join().map_err(|_| RunError::TelemetryPanicked)?;
        told?;
        let dropped = counters.records_dropped.load(Ordering::Relaxed);
        let granted = realtime.get().cloned().unwrap_or_default();
        let realtime = RealtimeReport { threads, ..granted };
        let flights = recorded.as_deref().map(RecorderState::paths).unwrap_or_default();
        Ok(RunReport::new(&end?, realtime, dropped, flights))
    })
}

/// Waits for the rig's driver in short attempts.
fn find_driver(plan: &RunPlan<'_>, stop: &StopFlag) -> Result<DaemonServices, RunError> {
    let begin = Instant::now();
    let mut told = false;
    loop {
        let left = plan.driver_wait.saturating_sub(begin.elapsed());
        match DaemonServices::open(plan.endpoint, left.min(DRIVER_ATTEMPT)) {
            Ok(services) => return Ok(services),
            Err(ChannelError::Missing { rig, role, root, .. }) if left.is_zero() => {
                let waited = begin.elapsed();
                return Err(ChannelError::Missing { rig, role, root, waited }.into());
            }
            Err(ChannelError::Missing { rig, .. }) => {
                if stop.requested().is_some() {
                    return Err(RunError::Interrupted);
                }
                if !told {
                    log(format_args!(
                        "waiting up to {} s for a driver of rig {rig}",
                        plan.driver_wait.as_secs_f64()
                    ));
                    told = true;
                }
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// Everything that the loop needs, made in its thread; real time comes last, when all is allocated.
fn prepare_loop<S: Step>(
    plan: &RunPlan<'_>,
    services: DaemonServices,
    controller: S,
    (workers, idle): (Option<&ThreadPool>, Option<&RealtimeItem>),
    (realtime, counters): (&OnceLock<RealtimeReport>, &LoopCounters),
) -> Result<ControlLoop<magsteer_hal::channels::DaemonEnd, S>, ChannelError> {
    let hardware = services.into_ports(plan.description)?;
    let mut report = request_realtime(&RealtimeRequest {
        priority: plan.config.priority,
        cpu: plan.config.cpu,
        lock_memory: plan.config.lock_memory,
    });
    report.items.extend(idle.cloned());
    report.items.extend(workers.and_then(|workers| realtime_of(workers, plan.config.priority)));
    let realtime_missing = plan.config.realtime == RealtimePolicy::Enforce && !report.is_granted();
    counters.realtime_missing.store(realtime_missing, Ordering::Relaxed);
    log(format_args!("{} Hz; {report}", plan.config.rate_hz));
    // Set once, here.
    let _ = realtime.set(report);
    let options = LoopOptions { realtime_missing, token_seed: RandomState::new().build_hasher().finish() };
    Ok(ControlLoop::new(hardware, controller, plan.description, plan.config, options))
}

/// Real time for the threads that help the loop's; called in one of them, which has asked for itself.
fn realtime_of(workers: &ThreadPool, priority: u32) -> Option<RealtimeItem> {
    let own = workers.current_thread_index();
    let asked =
        workers.broadcast(|thread| (Some(thread.index()) != own).then(|| request_helper_realtime(priority)));
    let mut answers = asked.into_iter().flatten();
    let first = answers.next()?;
    // The worst answer speaks for all.
    Some(answers.fold(first, |worst, answer| if worst.granted { answer } else { worst }))
}

/// Says which of a thread's wishes the kernel refused; the loop does not depend on them.
fn tell_refused(items: &[RealtimeItem]) {
    for item in items.iter().filter(|item| !item.granted) {
        let why_not = item.why_not.as_deref().unwrap_or_default();
        log(format_args!(
            "telemetry thread: {}: {} (wanted {}: {why_not})",
            item.name, item.got, item.wanted
        ));
    }
}

fn rings(config: &DaemonConfig) -> (LoopRings, TelemetryRings) {
    let half_second = (0.5 * config.rate_hz) as usize;
    let (request_in, request_out) = rtrb::RingBuffer::new(REQUESTS);
    let (answer_in, answer_out) = rtrb::RingBuffer::new(REQUESTS);
    let (record_in, record_out) = rtrb::RingBuffer::new(half_second.clamp(RECORDS.0, RECORDS.1));
    (
        LoopRings { requests: request_out, answers: answer_in, records: record_in },
        TelemetryRings { requests: request_in, answers: answer_out, records: record_out },
    )
}
