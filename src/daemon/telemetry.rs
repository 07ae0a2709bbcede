//! The other thread: serves operators, publishes the status, tells the log.
//!
//! It talks to the loop through rings only, and may be late or die without harm to the loop. A request
//! is handed to the loop and answered when the loop answers; one that waits longer than an operator
//! does is dropped without an answer, which counts as not done.

use std::sync::atomic::Ordering;
use std::time::Duration;

use magsteer_hal::channels::{IncomingRequest, OperatorServer};
use magsteer_hal::operator::{Cause, OperatorAnswer, state, verb};
use magsteer_hal::{HardwareDescription, Stamp};
use rtrb::{Consumer, Producer};

use super::companion::Companion;
use super::config::DaemonConfig;
use super::cycle_record::CycleRecord;
use super::journal::{Priority, tell};
use super::log::{log, log_cause, log_transition};
use super::notify::Notify;
use super::operator_request::{RigCounts, verb_of};
use super::record_feed::RecordFeed;
use super::recorder::Recorder;
use super::runner::{LoopCounters, StopFlag};
use super::state::{Answer, Request, Verb};
use super::view::StatusView;

/// How often this thread looks at its rings.
const POLL: Duration = Duration::from_millis(2);
/// An operator waits 200 ms for an answer; a later one has nowhere to go.
const ANSWER_PATIENCE: Duration = Duration::from_millis(200);
/// How long `--arm` tries, and how often.
const ARM_PATIENCE: Duration = Duration::from_secs(10);
const ARM_PAUSE: Duration = Duration::from_millis(200);
/// How often it looks whether the process that records is alive.
const COMPANION_PERIOD: Duration = Duration::from_millis(100);
/// Requests under way at once.
const PENDING_MAX: usize = 32;
/// Number of the request that arms at the start; operators' are counted from the next one.
const ARM_AT_START: u32 = 1;

/// This thread's ends of the rings.
#[derive(Debug)]
pub struct TelemetryRings {
    /// Requests to the loop.
    pub requests: Producer<Request>,
    /// Their answers.
    pub answers: Consumer<Answer>,
    /// One record a cycle.
    pub records: Consumer<CycleRecord>,
}

/// What is kept of the run, and by whom.
#[derive(Debug)]
pub struct Recording {
    /// The flight recorder.
    pub recorder: Option<Recorder>,
    /// The process that records.
    pub companion: Option<Companion>,
    /// As [`magsteer_hal::record::RecordBatch::config_digest`].
    pub config_digest: u64,
}

/// A request that waits for the loop's answer.
#[derive(Debug)]
struct Pending {
    id: u32,
    verb: u32,
    incoming: IncomingRequest,
    since: Stamp,
}

/// `--arm`: asks until the loop is armed once, or patience is out.
#[derive(Debug)]
struct ArmAtStart {
    give_up: Stamp,
    next: Stamp,
}

/// The thread's state.
#[derive(Debug)]
pub struct Telemetry {
    server: OperatorServer,
    rings: TelemetryRings,
    view: StatusView,
    status_period: Duration,
    next_status: Stamp,
    pending: Vec<Pending>,
    next_id: u32,
    arm_at_start: Option<ArmAtStart>,
    counts: RigCounts,
    rig: String,
    recorder: Option<Recorder>,
    feed: RecordFeed,
    companion: Option<Companion>,
    next_look: Stamp,
    notify: Notify,
}

impl Telemetry {
    /// Serves operators of this rig and tells the service manager; `arm`: arms as soon as the rig is ready.
    #[must_use]
    pub fn new(
        server: OperatorServer,
        rings: TelemetryRings,
        description: &HardwareDescription,
        config: &DaemonConfig,
        arm: bool,
        recording: Recording,
        notify: Notify,
    ) -> Self {
        let now = Stamp::now();
        Self {
            server,
            rings,
            view: StatusView::new(description, config.rate_hz),
            status_period: config.status_period(),
            next_status: now,
            pending: Vec::with_capacity(PENDING_MAX),
            next_id: ARM_AT_START + 1,
            arm_at_start: arm.then(|| ArmAtStart { give_up: now.after(ARM_PATIENCE), next: now }),
            counts: RigCounts::of(description),
            rig: description.rig.clone(),
            recorder: recording.recorder,
            feed: RecordFeed::new(recording.config_digest),
            companion: recording.companion,
            next_look: now,
            notify,
        }
    }

    /// Serves until the loop has ended and everything it left was told; `stop` asks the loop to end.
    pub fn serve(&mut self, counters: &LoopCounters, stop: &StopFlag) {
        loop {
            let ended = self.rings.records.is_abandoned();
            let now = Stamp::now();
            let dropped = counters.records_dropped.load(Ordering::Relaxed);
            self.recorder.iter_mut().for_each(|recorder| recorder.set_dropped(dropped));
            self.feed.note(dropped, counters.realtime_missing.load(Ordering::Relaxed));
            self.take_records(now);
            self.feed.look(&mut self.server, now);
            self.look_after_companion(now);
            self.tell_manager(now, stop);
            self.take_answers();
            self.take_requests(now);
            self.try_to_arm(now);
            if ended || now >= self.next_status {
                self.publish(now, counters);
            }
            if ended {
                break;
            }
            std::thread::sleep(POLL.min(self.status_period));
        }
        let dropped = counters.records_dropped.load(Ordering::Relaxed);
        if dropped > 0 {
            log(format_args!("{dropped} cycle records were dropped: this thread was starved"));
        }
        self.end_recording(dropped);
        if let Some(recorder) = self.recorder.take() {
            self.view.rest_of_minute().into_iter().for_each(|minute| recorder.minute(minute));
            recorder.end();
        }
    }

    /// Says once when the process that records has died.
    fn look_after_companion(&mut self, now: Stamp) {
        if now < self.next_look {
            return;
        }
        self.next_look = now.after(COMPANION_PERIOD);
        if let Some(words) = self.companion.as_mut().and_then(Companion::newly_dead) {
            self.tell_lost_recording(&words);
        }
    }

    fn tell_lost_recording(&self, words: &str) {
        tell(Priority::Warning, &[], format_args!("{words}"));
        self.recorder.iter().for_each(|recorder| recorder.recording_lost(words));
    }

    /// Publishes the last cycles and waits until they are recorded, with the publisher still there.
    fn end_recording(&mut self, dropped: u64) {
        self.feed.end(dropped, &mut self.server, Stamp::now());
        if let Some(words) = self.companion.take().and_then(Companion::finish) {
            self.tell_lost_recording(&words);
        }
    }

    fn take_records(&mut self, now: Stamp) {
        while let Ok(record) = self.rings.records.pop() {
            if record.decision.transition.is_some() {
                log_transition(&self.rig, &record);
            }
            if let Some(cause) = record.decision.given_up {
                log_cause(&self.rig, &record, "target given up", cause);
            }
            self.feed.take(&record, &mut self.server, now);
            self.recorder.iter_mut().for_each(|recorder| recorder.take(&record));
            if let Some(cause) = record.decision.judgements.begun {
                log_cause(&self.rig, &record, "passive: would have tripped", cause);
            }
            self.view.take(&record);
            if let (Some(minute), Some(recorder)) = (self.view.take_minute(), &self.recorder) {
                recorder.minute(minute);
            }
        }
    }

    /// Ready, alive and state by what the loop has done; stopping by what it was asked.
    fn tell_manager(&mut self, now: Stamp, stop: &StopFlag) {
        if stop.requested().is_some() {
            self.notify.stopping();
        }
        if let Some(cycle) = self.view.cycle() {
            self.notify.progress(now, cycle);
            self.notify.status(self.view.line());
        }
    }

    fn take_answers(&mut self) {
        while let Ok(answer) = self.rings.answers.pop() {
            if answer.id == ARM_AT_START {
                self.take_own_answer(&answer);
            } else if let Some(index) = self.pending.iter().position(|pending| pending.id == answer.id) {
                let pending = self.pending.swap_remove(index);
                if let (Some(recorder), Some(cause)) = (&self.recorder, answer.refused) {
                    recorder.refused(pending.verb, cause);
                }
                reply(pending.incoming, message(&answer));
            }
        }
    }

    fn take_requests(&mut self, now: Stamp) {
        self.pending.retain(|pending| now.since(pending.since) <= ANSWER_PATIENCE);
        while let Some(incoming) = self.server.next_request() {
            if incoming.request().verb == verb::SAVE {
                self.save(incoming);
                continue;
            }
            match verb_of(incoming.request(), self.counts) {
                Ok(verb) if self.pending.len() < PENDING_MAX => self.hand_over(verb, incoming, now),
                Ok(_) => self.refuse(incoming, Cause::Busy),
                Err(cause) => self.refuse(incoming, cause),
            }
        }
    }

    fn hand_over(&mut self, verb: Verb, incoming: IncomingRequest, now: Stamp) {
        let id = self.next_id;
        self.next_id = self.next_id.checked_add(1).unwrap_or(ARM_AT_START + 1);
        match self.rings.requests.push(Request { id, verb }) {
            Ok(()) => {
                let verb = incoming.request().verb;
                self.pending.push(Pending { id, verb, incoming, since: now });
            }
            Err(_) => self.refuse(incoming, Cause::Busy),
        }
    }

    /// The loop has no part in this request.
    fn save(&mut self, incoming: IncomingRequest) {
        match self.recorder.as_mut().map_or(Err(Cause::NotRecording), Recorder::order) {
            Ok(()) => {
                let done = Answer { id: 0, refused: None, state: self.view.state(), epoch: 0 };
                reply(incoming, message(&done));
            }
            Err(cause) => self.refuse(incoming, cause),
        }
    }

    fn refuse(&self, incoming: IncomingRequest, cause: Cause) {
        if let Some(recorder) = &self.recorder {
            recorder.refused(incoming.request().verb, cause);
        }
        let refusal = Answer { id: 0, refused: Some(cause), state: self.view.state(), epoch: 0 };
        reply(incoming, message(&refusal));
    }

    fn try_to_arm(&mut self, now: Stamp) {
        let Some(arm) = &mut self.arm_at_start else {
            return;
        };
        if self.view.state() != state::BOOT && now >= arm.next {
            arm.next = now.after(ARM_PAUSE);
            // A full ring means that the loop is not running; the next attempt comes anyway.
            let _ = self.rings.requests.push(Request { id: ARM_AT_START, verb: Verb::Arm });
        }
        if now >= arm.give_up {
            log(format_args!("not armed within {} s; arm by hand", ARM_PATIENCE.as_secs()));
            self.arm_at_start = None;
        }
    }

    fn take_own_answer(&mut self, answer: &Answer) {
        match answer.refused {
            None => self.arm_at_start = None,
            // Anything but a rig that is not ready yet ends the attempts.
            Some(Cause::PoseStale | Cause::DriverBusy | Cause::FeedbackStale | Cause::ArmTimeout) => {}
            Some(cause) if self.arm_at_start.take().is_some() => {
                log(format_args!("not armed: {}", cause.text()));
            }
            Some(_) => {}
        }
    }

    fn publish(&mut self, now: Stamp, counters: &LoopCounters) {
        let dropped = counters.records_dropped.load(Ordering::Relaxed);
        let allocations = counters.allocations.load(Ordering::Relaxed);
        if let Some(mut status) = self.view.message(dropped, allocations) {
            self.recorder.iter().for_each(|recorder| recorder.tell(&mut status));
            // A view that nobody could be shown is no fault of the loop.
            let _ = self.server.publish_status(status, now);
        }
        let next = self.next_status.after(self.status_period);
        self.next_status = if next > now { next } else { now.after(self.status_period) };
    }
}

fn message(answer: &Answer) -> OperatorAnswer {
    OperatorAnswer {
        accepted: u32::from(answer.refused.is_none()),
        cause: answer.refused.map_or(0, Cause::code),
        state: answer.state,
        reserved: 0,
        epoch: answer.epoch,
    }
}

fn reply(incoming: IncomingRequest, answer: OperatorAnswer) {
    // An operator that is gone by now does not need the answer.
    let _ = incoming.answer(answer);
}
