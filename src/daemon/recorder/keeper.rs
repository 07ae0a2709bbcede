//! The telemetry thread's end of the recorder: encodes every cycle into the ring, sees trips, words events.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use magsteer_hal::operator::{Cause, StatusMessage, recorder, state, verb};
use magsteer_hal::{HardwareDescription, Stamp};

use super::columns::Columns;
use super::config::RecorderConfig;
use super::files::{EVENTS_MAX, Files, Folder, Job, RecorderState, Store};
use super::header::{Header, Machine};
use super::journal::{Entry, event};
use super::minutes::Minute;
use super::ring::Ring;
use super::trigger::{AFTER, Trigger, Trip};
use super::wall::{rfc_3339, wall_time};
use crate::daemon::cycle_record::CycleRecord;
use crate::daemon::log::log;
use crate::daemon::statistics::MinuteTiming;

/// One ring records while the other is written.
const RINGS: usize = 2;
/// Most memory for both rings, bytes.
const MEMORY_MAX: usize = 512 << 20;
/// How long the end of a daemon waits for its files.
const END_PATIENCE: Duration = Duration::from_secs(10);
const END_POLL: Duration = Duration::from_millis(5);

/// What to record and where.
#[derive(Debug, Clone)]
pub struct RecorderPlan {
    /// `[daemon.recorder]`.
    pub config: RecorderConfig,
    /// SHA-256 of the configuration, resolved.
    pub config_sha256: String,
}

/// The recorder of one run.
#[derive(Debug)]
pub struct Recorder {
    columns: Columns,
    /// The one that records; `None` while both are being written.
    ring: Option<Ring>,
    /// Rings that were written.
    rings: Receiver<Ring>,
    trigger: Trigger,
    /// `None` once the run has ended.
    jobs: Option<Sender<Job>>,
    files: JoinHandle<()>,
    state: Arc<RecorderState>,
    /// The head of every flight, but for what it is about.
    head: Header,
    newest: Option<CycleRecord>,
}

impl Recorder {
    /// Allocates and touches the rings, starts the files thread, and notes the start in the journal.
    ///
    /// # Errors
    /// When the system refuses the thread.
    pub fn start(
        plan: &RecorderPlan,
        description: &HardwareDescription,
        rate_hz: f64,
    ) -> std::io::Result<Self> {
        let path = plan.config.folder.clone();
        let flights_max = plan.config.flights_max as usize;
        let recorder = Self::with_store(Folder { path, flights_max }, plan, description, rate_hz)?;
        let detail = recorder.in_words(plan);
        log(format_args!("{detail}"));
        recorder.event(Entry { event: event::START.to_owned(), detail: Some(detail), ..Entry::default() });
        Ok(recorder)
    }

    /// As [`Self::start`], into any store, and says nothing.
    pub(super) fn with_store(
        store: impl Store + 'static,
        plan: &RecorderPlan,
        description: &HardwareDescription,
        rate_hz: f64,
    ) -> std::io::Result<Self> {
        let columns = Columns::new(description);
        let capacity = capacity(&plan.config, rate_hz, columns.record_bytes());
        let (jobs, todo) = channel();
        let (back, rings) = channel();
        for _ in 1..RINGS {
            // Less memory means fewer rings; `in_words` says so.
            Ring::new(columns.record_bytes(), capacity).map(|ring| back.send(ring));
        }
        let ring = Ring::new(columns.record_bytes(), capacity);
        let flight_bytes = ring.as_ref().map_or(0, Ring::size) as u64;
        let state = Arc::new(RecorderState::default());
        let files = Files::new(store, todo, back, Arc::clone(&state), flight_bytes);
        let head = head(plan, description, rate_hz, &columns);
        let files = std::thread::Builder::new().name("magsteer-files".to_owned()).spawn(|| files.serve())?;
        let trigger = Trigger::new(plan.config.reach());
        Ok(Self { columns, ring, rings, trigger, jobs: Some(jobs), files, state, head, newest: None })
    }

    fn in_words(&self, plan: &RecorderPlan) -> String {
        let folder = plan.config.folder.display();
        let Some(ring) = &self.ring else {
            return format!("recorder: no memory for records; journal in {folder}");
        };
        let record_bytes = self.columns.record_bytes();
        let records = ring.size() / record_bytes.max(1);
        let before = records as f64 / self.head.rate_hz - AFTER.as_secs_f64();
        format!(
            "recorder: {before:.1} s before a trip and {} s after it, {records} records of {record_bytes} bytes, {:.1} MB in {RINGS} \
             rings; flights and journal in {folder}",
            AFTER.as_secs_f64(),
            (RINGS * ring.size()) as f64 * 1e-6,
        )
    }

    /// How the recorder fares.
    #[must_use]
    pub fn state(&self) -> Arc<RecorderState> {
        Arc::clone(&self.state)
    }

    /// Takes over one cycle.
    pub fn take(&mut self, record: &CycleRecord) {
        if self.ring.is_none() {
            self.ring = self.rings.try_recv().ok();
        }
        if let Some(ring) = &mut self.ring {
            self.columns.encode(record, ring.push());
        }
        self.note(record);
        if let Some(trip) = self.trigger.take(record) {
            self.hand_over(&trip);
        }
        self.newest = Some(*record);
    }

    /// An operator asks for a flight: written half a second from now.
    ///
    /// # Errors
    /// [`Cause::NotRecording`] when there is nothing to write.
    pub fn order(&mut self) -> Result<(), Cause> {
        match (&self.newest, &self.ring) {
            (Some(newest), Some(_)) => {
                self.trigger.order(newest);
                Ok(())
            }
            _ => Err(Cause::NotRecording),
        }
    }

    /// Notes that a request was refused; `verb` is one of [`verb`].
    pub fn refused(&self, verb: u32, cause: Cause) {
        let request = Some(verb::name(verb).to_owned());
        self.event(Entry { request, ..caused(event::REFUSED, Some(cause)) });
    }

    /// Notes that the process that records every cycle has died.
    pub fn recording_lost(&self, detail: &str) {
        let event = event::RECORDING_LOST.to_owned();
        self.event(Entry { event, detail: Some(detail.to_owned()), ..Entry::default() });
    }

    /// Notes the timing of a minute that is over now.
    pub fn minute(&self, MinuteTiming { timing, histograms }: MinuteTiming) {
        let Some(jobs) = &self.jobs else { return };
        let time = rfc_3339(SystemTime::now());
        let minute = Minute { time, rig: self.head.rig.clone(), pid: self.head.pid, timing, histograms };
        // Without the files thread there is nowhere to put it; the next event tells.
        let _ = jobs.send(Job::Minute(Box::new(minute)));
    }

    /// The run has ended: writes what is due, waits for the files, but not for ever.
    pub fn end(mut self) {
        let newest = self.newest;
        if let Some(trip) = newest.as_ref().and_then(|newest| self.trigger.end(newest)) {
            self.hand_over(&trip);
        }
        let cause = newest.as_ref().and_then(|newest| newest.decision.cause);
        let state = newest.as_ref().map_or(state::BOOT, |newest| newest.decision.state);
        let to = Some(state::name(state).to_owned());
        self.event(Entry { to, ..caused(event::STOP, cause) });
        self.jobs = None;
        let begin = Instant::now();
        while !self.files.is_finished() && begin.elapsed() < END_PATIENCE {
            std::thread::sleep(END_POLL);
        }
        if !self.files.is_finished() {
            log(format_args!("recorder: files are still being written; what is left is lost"));
        }
    }

    /// Puts the events of a cycle into the journal.
    fn note(&self, record: &CycleRecord) {
        let at = |entry: Entry| Entry {
            cycle: Some(record.tick.number),
            monotonic_ns: record.tick.now.nanoseconds(),
            ..entry
        };
        if let Some(transition) = record.decision.transition {
            let reasons = [record.pose_refused, record.feedback_refused];
            let reasons: Vec<String> =
                reasons.into_iter().flatten().map(|reason| reason.to_string()).collect();
            self.event(at(Entry {
                from: Some(state::name(transition.from).to_owned()),
                to: Some(state::name(transition.to).to_owned()),
                detail: (!reasons.is_empty()).then(|| reasons.join("; ")),
                ..caused(event::TRANSITION, transition.cause)
            }));
        }
        if let Some(cause) = record.decision.given_up {
            self.event(at(caused(event::GIVEN_UP, Some(cause))));
        }
    }

    /// Hands an event to the files thread, or counts it as lost.
    fn event(&self, entry: Entry) {
        let Some(jobs) = &self.jobs else { return };
        if self.state.events_waiting.load(Ordering::Relaxed) >= EVENTS_MAX {
            self.state.events_lost.fetch_add(1, Ordering::Relaxed);
            return;
        }
        let now = Stamp::now();
        let stamp = if entry.monotonic_ns == 0 { now } else { Stamp::from_nanoseconds(entry.monotonic_ns) };
        let entry = Entry {
            time: rfc_3339(wall_time(stamp)),
            monotonic_ns: stamp.nanoseconds(),
            rig: self.head.rig.clone(),
            pid: self.head.pid,
            cycle: entry.cycle.or(self.newest.as_ref().map(|newest| newest.tick.number)),
            ..entry
        };
        self.state.events_waiting.fetch_add(1, Ordering::Relaxed);
        if jobs.send(Job::Event(entry)).is_err() {
            self.state.events_lost.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Gives the ring away, with what it is about at its head.
    fn hand_over(&mut self, trip: &Trip) {
        let (Some(jobs), Some(ring)) = (&self.jobs, self.ring.take()) else {
            self.state.flights_lost.fetch_add(1, Ordering::Relaxed);
            log(format_args!("recorder: no ring is free for the flight of cycle {}", trip.cycle));
            self.event(caused(event::FLIGHT_LOST, Cause::from_code(trip.cause)));
            return;
        };
        let header = Header {
            reason: trip.reason,
            trigger_cycle: trip.cycle,
            trigger_ns: trip.at.nanoseconds(),
            trigger_time: rfc_3339(wall_time(trip.at)),
            from: trip.from,
            to: trip.to,
            cause: trip.cause,
            worst_cause: trip.worst_cause,
            records: ring.count() as u64,
            ..self.head.clone()
        };
        if jobs.send(Job::Flight(Box::new(header), ring)).is_err() {
            self.state.flights_lost.fetch_add(1, Ordering::Relaxed);
        }
        self.ring = self.rings.try_recv().ok();
    }

    /// Fills in what the status says of the recorder.
    pub fn tell(&self, status: &mut StatusMessage) {
        let state = &self.state;
        let events = u32::try_from(state.events_lost.load(Ordering::Relaxed)).unwrap_or(u32::MAX);
        status.recorder_error = state.error.load(Ordering::Relaxed);
        status.recorder = if status.recorder_error == 0 { recorder::RECORDING } else { recorder::FAILING };
        status.flights = state.flights.load(Ordering::Relaxed);
        status.recorder_lost = events.saturating_add(state.flights_lost.load(Ordering::Relaxed));
    }

    /// Cycle records that never came here, as the next flight says.
    pub fn set_dropped(&mut self, dropped: u64) {
        self.head.records_dropped = dropped;
    }
}

fn caused(event: &str, cause: Option<Cause>) -> Entry {
    Entry {
        event: event.to_owned(),
        cause_code: cause.map(Cause::code),
        cause: cause.map(|cause| cause.text().to_owned()),
        ..Entry::default()
    }
}

/// Records of a ring: the configured time before a trip and what follows it, within the bound of memory.
pub(super) fn capacity(config: &RecorderConfig, rate_hz: f64, record_bytes: usize) -> usize {
    let wanted = ((config.reach() + AFTER).as_secs_f64() * rate_hz).ceil() as usize;
    wanted.min(MEMORY_MAX / RINGS / record_bytes.max(1)).max(1)
}

fn head(plan: &RecorderPlan, description: &HardwareDescription, rate_hz: f64, columns: &Columns) -> Header {
    let coils = description.coils.iter();
    Header {
        program: env!("CARGO_PKG_VERSION").to_owned(),
        rig: description.rig.clone(),
        description_fingerprint: format!("{:016x}", description.fingerprint()),
        config_sha256: plan.config_sha256.clone(),
        rate_hz,
        started: rfc_3339(SystemTime::now()),
        pid: std::process::id(),
        machine: Machine::this(),
        reason: super::header::Reason::Operator,
        trigger_cycle: 0,
        trigger_ns: 0,
        trigger_time: String::new(),
        from: state::BOOT,
        to: state::BOOT,
        cause: 0,
        worst_cause: 0,
        records: 0,
        records_dropped: 0,
        current_max_a: coils.clone().fold(0.0, |most, coil| f64::max(most, coil.current_max)),
        coils: coils.map(|coil| coil.name.clone()).collect(),
        frames: description.frames.iter().map(|frame| frame.name.clone()).collect(),
        magnets: description.magnets().map(|magnet| magnet.name.clone()).collect(),
        columns: columns.described().to_vec(),
    }
}
