//! What people see of the loop: the status message and a line for each change of state.

use std::fmt;
use std::time::Duration;

use magsteer_hal::message::{Header, MAGNETS_MAX, PoseMessage};
use magsteer_hal::operator::{Cause, LoopTiming, StatusMessage, recorder, state, verdict};
use magsteer_hal::{HardwareDescription, Stamp};

use super::cycle_record::CycleRecord;
use super::statistics::{MinuteStatistics, MinuteTiming, Statistics};
use crate::control::{Equilibrium, Verdict};

/// Over how long the rate of the loop is measured.
const RATE_WINDOW: Duration = Duration::from_secs(1);

/// Gathers cycles into the next status message.
#[derive(Debug)]
pub struct StatusView {
    rate_hz: f64,
    description_fingerprint: u64,
    magnet_count: u32,
    coil_count: u32,
    pose_parameter_count: u32,
    newest: Option<CycleRecord>,
    missed: u64,
    lateness_max: Duration,
    window_begin: Stamp,
    window_cycles: u64,
    rate_measured_hz: f64,
    statistics: Statistics,
    minutes: MinuteStatistics,
    timing: LoopTiming,
    last_minute: LoopTiming,
}

impl StatusView {
    /// A view of a loop on this rig.
    #[must_use]
    pub fn new(description: &HardwareDescription, rate_hz: f64) -> Self {
        let count = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
        Self {
            rate_hz,
            description_fingerprint: description.fingerprint(),
            magnet_count: count(description.magnets().count()),
            coil_count: count(description.coils.len()),
            pose_parameter_count: count(description.frames.len()),
            newest: None,
            missed: 0,
            lateness_max: Duration::ZERO,
            window_begin: Stamp::default(),
            window_cycles: 0,
            rate_measured_hz: 0.0,
            statistics: Statistics::new(rate_hz),
            minutes: MinuteStatistics::new(rate_hz),
            timing: LoopTiming::default(),
            last_minute: LoopTiming::default(),
        }
    }

    /// Takes over one cycle.
    pub fn take(&mut self, record: &CycleRecord) {
        if self.newest.is_none() {
            self.window_begin = record.tick.now;
        }
        self.window_cycles += 1;
        let timing = record.timing();
        self.statistics.record(&timing);
        self.minutes.record(record.tick.now, &timing);
        self.missed += record.tick.missed;
        self.lateness_max = self.lateness_max.max(record.tick.lateness);
        let window = record.tick.now.since(self.window_begin);
        if window >= RATE_WINDOW {
            self.rate_measured_hz = self.window_cycles as f64 / window.as_secs_f64();
            self.window_begin = record.tick.now;
            self.window_cycles = 0;
            // Quantiles are read from thousands of counters: once a second, not once a message.
            self.timing = self.statistics.summary().into();
            self.last_minute =
                self.minutes.last().copied().map_or_else(LoopTiming::default, LoopTiming::from);
        }
        self.newest = Some(*record);
    }

    /// Timing of a minute, once, when it is over.
    pub fn take_minute(&mut self) -> Option<MinuteTiming> {
        self.minutes.take_over()
    }

    /// Timing of the minute that is not over yet.
    #[must_use]
    pub fn rest_of_minute(&self) -> Option<MinuteTiming> {
        self.minutes.rest()
    }

    /// State code of the newest cycle.
    #[must_use]
    pub fn state(&self) -> u32 {
        self.newest.as_ref().map_or(state::BOOT, |record| record.decision.state)
    }

    /// Number of the newest cycle; `None` before the first.
    #[must_use]
    pub fn cycle(&self) -> Option<u64> {
        self.newest.as_ref().map(|record| record.tick.number)
    }

    /// State and cause in words, for a service manager.
    #[must_use]
    pub fn line(&self) -> StateLine {
        let cause = self.newest.as_ref().and_then(|record| record.decision.cause);
        StateLine { state: self.state(), cause }
    }

    /// The message to publish now; `None` before the first cycle. `records_dropped`: cycles that never came
    /// here; `loop_allocations`: as the loop's thread counts them.
    pub fn message(&mut self, records_dropped: u64, loop_allocations: u64) -> Option<StatusMessage> {
        let record = self.newest.as_ref()?;
        let lateness_max = std::mem::take(&mut self.lateness_max);
        let (decision, outcome) = (&record.decision, &record.outcome);
        let mut message = StatusMessage {
            header: Header { source_stamp_ns: record.tick.now.nanoseconds(), ..Header::default() },
            state: decision.state,
            cause: decision.cause.map_or(0, Cause::code),
            cycle: record.tick.number,
            missed: self.missed,
            rate_hz: self.rate_hz,
            rate_measured_hz: self.rate_measured_hz,
            lateness_us: microseconds(record.tick.lateness),
            lateness_max_us: microseconds(lateness_max.max(record.tick.lateness)),
            pose_age_us: record.pose_age().map_or(-1.0, microseconds),
            feedback_age_us: record.feedback_age().map_or(-1.0, microseconds),
            timing: self.timing,
            last_minute: self.last_minute,
            records_dropped,
            loop_allocations,
            stability_margin: outcome.model.margin,
            magnet_count: self.magnet_count,
            coil_count: self.coil_count,
            pose_parameter_count: self.pose_parameter_count,
            model_converged: u32::from(outcome.model.converged),
            target_verdict: verdict_code(&decision.verdict),
            stability_low: u32::from(decision.stability_low),
            // Filled in by whoever has a recorder.
            recorder: recorder::OFF,
            recorder_error: 0,
            flights: 0,
            recorder_lost: 0,
            passive: u32::from(decision.passive),
            would_trip: decision.judgements.worst.map_or(0, Cause::code),
            would_trip_count: decision.judgements.count,
            safe_action: decision.safe_action.code(),
            coil_hot: u32::from(decision.coil_hot),
            coil_heat: decision.coil_heat,
            target_direction: record.target.directions,
            desired_direction: outcome.desired,
            measured_direction: outcome.measured,
            predicted_direction: outcome.predicted,
            coil_gain: outcome.gains,
            modelled: outcome.equilibrium.actuation,
            base_force_n: outcome.equilibrium.base_force,
            base_moment_n_m: outcome.equilibrium.base_moment,
            measured_position_m: positions(record.input.pose.as_ref()),
            description_fingerprint: self.description_fingerprint,
            measured: record.input.measured,
            admitted: record.admitted,
        };
        if record.feedback.is_none() {
            message.measured = magsteer_hal::Actuation::default();
        }
        Some(message)
    }
}

/// Where the model of the daemon is that told its status.
#[must_use]
pub const fn equilibrium(status: &StatusMessage) -> Equilibrium {
    Equilibrium {
        actuation: status.modelled,
        base_force: status.base_force_n,
        base_moment: status.base_moment_n_m,
    }
}

/// Centres of the magnets that were seen; zero for the others.
fn positions(poses: Option<&PoseMessage>) -> [[f64; 3]; MAGNETS_MAX] {
    let mut positions = [[0.0; 3]; MAGNETS_MAX];
    let seen = poses.iter().flat_map(|poses| poses.magnets.iter().take(poses.magnet_count as usize));
    for (position, magnet) in positions.iter_mut().zip(seen).filter(|(_, magnet)| magnet.valid == 1) {
        *position = magnet.position_m;
    }
    positions
}

const fn verdict_code(known: &Verdict) -> u32 {
    match known {
        Verdict::Unchecked => verdict::UNCHECKED,
        Verdict::Checking => verdict::CHECKING,
        Verdict::Clear { .. } => verdict::CLEAR,
        Verdict::OutOfReach { .. } => verdict::OUT_OF_REACH,
        Verdict::Refused { .. } => verdict::REFUSED,
    }
}

fn microseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e6
}

/// State and cause in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StateLine {
    state: u32,
    cause: Option<Cause>,
}

impl fmt::Display for StateLine {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}", state::name(self.state))?;
        self.cause.map_or(Ok(()), |cause| write!(formatter, ": {} (cause {})", cause.text(), cause.code()))
    }
}

/// A change of state, as a line of the log.
#[derive(Debug, Clone, Copy)]
pub struct TransitionLine<'a>(pub &'a CycleRecord);

impl fmt::Display for TransitionLine<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let record = self.0;
        let Some(transition) = record.decision.transition else {
            return Ok(());
        };
        let (from, to) = (state::name(transition.from), state::name(transition.to));
        let seconds = record.tick.now.nanoseconds() as f64 * 1e-9;
        write!(formatter, "{seconds:.3} s, cycle {}: {from} -> {to}", record.tick.number)?;
        if let Some(cause) = transition.cause {
            write!(formatter, ": {} (cause {})", cause.text(), cause.code())?;
        }
        let reasons = [record.pose_refused, record.feedback_refused];
        for reason in reasons.into_iter().flatten() {
            write!(formatter, "; {reason}")?;
        }
        Ok(())
    }
}
