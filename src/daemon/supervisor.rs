//! Decides in every cycle which state the daemon is in and what the cycle may send.
//!
//! Method: first the trips, worst cause first; then the request of the operator, if any; then the progress
//! that needs no request (a claim confirmed, a ramp ended, sensing back). Latch first: the state changes
//! here and now, telling anyone is another thread's work.
//!
//! What is absent: a clock, a channel, a log, an allocation. Nothing leaves `Fault` without a reset, and
//! nothing enters `Active` without a `go`, but for a return from a brief loss of sensing.

use std::time::Duration;

use magsteer_hal::HardwareDescription;
use magsteer_hal::Stamp;
use magsteer_hal::message::driver_state;
use magsteer_hal::operator::Cause;

use crate::control::plan::Obstacle;
use crate::control::{ReferenceTarget, Verdict};

use super::causes::{Response, holds_currents, response};
use super::config::{DaemonConfig, Mode, SafeAction};
use super::monitors::MonitorReport;
use super::passive::Judgements;
use super::state::{ANSWERS_MAX, Answer, Answers, Directive, NearSnap, Request, State, Transition, Verb};
use super::target_rules::TargetRules;
use super::watch::{DriverView, Observation, Watch};

mod requests;

/// What the supervisor decided in one cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// What may be sent.
    pub directive: Directive,
    /// Epoch in whose name; 0 without authority.
    pub epoch: u64,
    /// State code after the cycle.
    pub state: u32,
    /// Cause of the last stop or fault, or of staying in `Boot`.
    pub cause: Option<Cause>,
    /// Set when the state changed.
    pub transition: Option<Transition>,
    /// Answers to requests, in their order.
    pub answers: [Option<Answer>; ANSWERS_MAX],
    /// Target accepted in this cycle.
    pub target: Option<ReferenceTarget>,
    /// True when the operator's hold began in this cycle: the reference is to be frozen.
    pub froze: bool,
    /// Why the target was given up in this cycle: what it is replaced by is where the reference is, or was going before.
    pub given_up: Option<Cause>,
    /// What is known of the way to the target set last; a refusal stays until another one is set.
    pub verdict: Verdict,
    /// True while the margin of stability is to be warned of.
    pub stability_low: bool,
    /// True in passive mode.
    pub passive: bool,
    /// What monitors came to in passive mode.
    pub judgements: Judgements,
    /// What a trip does with the currents.
    pub safe_action: SafeAction,
    /// Heat of the hottest coil, 1 at its limit.
    pub coil_heat: f64,
    /// True while it is to be warned of.
    pub coil_hot: bool,
}

/// The state machine of the daemon.
#[derive(Debug, Clone)]
pub struct Supervisor {
    state: State,
    watch: Watch,
    /// Cause of the last stop or fault, cleared by reset and by arming; or why a target was given up, cleared by the next one.
    cause: Option<Cause>,
    /// What is known of the way to the target set last.
    verdict: Verdict,
    /// Epoch claimed last; 0 once it was given up.
    epoch: u64,
    /// Until when a release is repeated.
    release_until: Stamp,
    target_rules: TargetRules,
    /// Until when the newest of a stream of targets is valid; `None` where the target is not one of a stream.
    stream_until: Option<Stamp>,
    realtime_missing: bool,
    ending: bool,
    safe_action: SafeAction,
    judgements: Judgements,
}

impl Supervisor {
    /// Starts in `Boot`. `realtime_missing`: real time is enforced and was not granted.
    #[must_use]
    pub fn new(config: &DaemonConfig, rig: &HardwareDescription, realtime_missing: bool) -> Self {
        Self {
            state: State::Boot,
            watch: Watch::new(config, rig),
            target_rules: TargetRules::new(rig),
            stream_until: None,
            cause: None,
            verdict: Verdict::Unchecked,
            epoch: 0,
            release_until: Stamp::default(),
            realtime_missing,
            ending: false,
            safe_action: config.safe_action,
            judgements: Judgements::default(),
        }
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Epoch claimed last, 0 without one.
    #[must_use]
    pub fn epoch(&self) -> u64 {
        self.epoch
    }

    /// What the monitors counted.
    #[must_use]
    pub fn monitors(&self) -> MonitorReport {
        self.watch.report()
    }

    /// Judges one cycle.
    pub fn step(&mut self, seen: &Observation, request: Option<Request>) -> Decision {
        let before = self.state;
        let mut answers = Answers::default();
        let mut target = None;
        self.watch.observe(seen);
        let found = self.watch.trip(&self.state, self.epoch, seen);
        self.judgements.take(found.judged);
        if let Some(cause) = found.acts {
            self.trip(cause, seen.now, &mut answers);
        }
        let given_up = self.give_up(seen);
        match request {
            Some(Request { id, verb: Verb::SetTarget(asked) }) => {
                target = self.set_target(id, &asked, None, seen, &mut answers);
            }
            Some(Request { id, verb: Verb::StreamTarget(asked, valid) }) => {
                target = self.set_target(id, &asked, Some(seen.now.after(valid)), seen, &mut answers);
            }
            Some(request) => self.take(request, seen, &mut answers),
            None => {}
        }
        self.end_stream(seen.now);
        self.end_retreat(seen);
        self.progress(seen, &mut answers);
        self.forget_authority(seen);
        let decision = self.decision(&before, seen, &answers);
        Decision { target, given_up, ..decision }
    }

    /// Why the target has to be given up, if it has: its way was refused, or the rod is too near a snap-through.
    fn give_up(&mut self, seen: &Observation) -> Option<Cause> {
        if !self.state.is_engaged() {
            return None;
        }
        let refused = match (self.verdict, seen.verdict) {
            (Verdict::Refused { .. }, _) => None,
            (_, Verdict::Refused { obstacle: Obstacle::OutsideField, .. }) => Some(Cause::TargetOutsideField),
            (_, Verdict::Refused { .. }) => Some(Cause::TargetCrossesSnapThrough),
            _ => None,
        };
        if !matches!(self.verdict, Verdict::Refused { .. }) {
            self.verdict = seen.verdict;
        }
        let near_snap = self.watch.is_near_snap(seen);
        let given_up = if near_snap { Some(Cause::NearSnapThrough) } else { refused };
        self.cause = given_up.or(self.cause);
        if near_snap {
            let by_operator = matches!(self.state, State::Holding { by_operator: true, .. });
            self.enter_holding(by_operator, false, NearSnap::Kept);
        }
        given_up
    }

    /// Takes a target, one of a stream when it is valid for a while only; `None` when it cannot be used.
    fn set_target(
        &mut self,
        id: u32,
        asked: &ReferenceTarget,
        stream_until: Option<Stamp>,
        seen: &Observation,
        answers: &mut Answers,
    ) -> Option<ReferenceTarget> {
        let target = self.target_rules.usable(asked);
        answers.push(id, target.is_none().then_some(Cause::TargetInvalid));
        if target.is_some() {
            self.stream_until = stream_until;
            self.set_out(seen);
        }
        target
    }

    /// Holds once the newest target of a stream is no longer valid.
    fn end_stream(&mut self, now: Stamp) {
        if self.stream_until.is_none_or(|until| now <= until) {
            return;
        }
        self.stream_until = None;
        let (sensing_lost, near_snap) = match self.state {
            State::Active => (false, NearSnap::No),
            State::Holding { by_operator: false, sensing_lost, near_snap } => (sensing_lost, near_snap),
            _ => return,
        };
        if near_snap == NearSnap::No {
            self.cause = Some(Cause::StreamEnded);
        }
        self.enter_holding(true, sensing_lost, near_snap);
    }

    /// A target was set: what held the one before is over.
    fn set_out(&mut self, seen: &Observation) {
        self.verdict = Verdict::Unchecked;
        self.watch.note_motion(seen);
        if !matches!(self.state, State::SafeStop { .. } | State::Fault { .. }) {
            self.cause = self.cause.filter(|cause| response(*cause) != Response::Refuse);
        }
        if let State::Holding { by_operator, sensing_lost, .. } = self.state {
            self.enter_holding(by_operator, sensing_lost, NearSnap::No);
        }
    }

    /// Ends a retreat where the margin is no longer to be warned of, and is the rod's, and where there is nothing left to go back along.
    fn end_retreat(&mut self, seen: &Observation) {
        let State::Holding { by_operator, sensing_lost, near_snap: NearSnap::Retreating } = self.state else {
            return;
        };
        // A model that snapped and left the rod behind has a wide margin too.
        if seen.model_converged && self.watch.believes_poses() && !self.watch.warns_of_stability() {
            self.set_out(seen);
        } else if seen.trail_ended {
            self.cause = Some(Cause::NearSnapThrough);
            self.enter_holding(by_operator, sensing_lost, NearSnap::Kept);
        }
    }

    /// True when the process was told to end and nothing is left to send.
    #[must_use]
    pub fn has_ended(&self, now: Stamp) -> bool {
        let done = match self.state {
            State::Boot => true,
            State::Idle => self.epoch == 0,
            State::Fault { .. } => now >= self.release_until,
            _ => false,
        };
        self.ending && done
    }

    fn decision(&self, before: &State, seen: &Observation, answers: &Answers) -> Decision {
        let held = |state: &State| matches!(state, State::Holding { by_operator: true, .. });
        let changed = before.code() != self.state.code();
        let waiting = || self.watch.forbids_leaving_boot(seen);
        let cause = if self.state == State::Boot { waiting() } else { self.cause };
        let lost = matches!(self.state, State::Holding { sensing_lost: true, .. });
        let why = if lost { self.watch.lost_sensing(seen) } else { self.cause };
        let transition =
            changed.then(|| Transition { from: before.code(), to: self.state.code(), cause: why });
        let (coil_heat, coil_hot) = self.watch.heat();
        Decision {
            directive: self.directive(before, seen.now),
            epoch: self.epoch,
            state: self.state.code(),
            cause,
            transition,
            answers: answers.given(self.state.code(), self.epoch),
            target: None,
            froze: held(&self.state) && !held(before),
            given_up: None,
            verdict: self.verdict,
            stability_low: self.watch.warns_of_stability(),
            passive: self.watch.mode() == Mode::Passive,
            judgements: self.judgements,
            safe_action: self.safe_action,
            coil_heat,
            coil_hot,
        }
    }

    fn directive(&self, before: &State, now: Stamp) -> Directive {
        let released = if self.epoch == 0 { Directive::Silent } else { Directive::Release };
        match self.state {
            State::Boot => Directive::Silent,
            State::Idle => released,
            State::Arming { .. } => Directive::Claim,
            State::Armed => Directive::Rest,
            State::Active | State::Holding { .. } if *before == State::Armed => Directive::Begin,
            // Without sensing too: it asks nothing of it.
            State::Holding { near_snap: NearSnap::Retreating, .. } => Directive::Retreat,
            state if state.is_engaged() && before.is_engaged() => Directive::Follow,
            // Without sensing, near a snap-through, and in the cycle after, whose request was made without steering.
            State::Active | State::Holding { .. } => Directive::Hold,
            State::SafeStop { cause, .. } if self.cuts(cause) => Directive::Disable,
            State::SafeStop { hold_until, .. } if now < hold_until => Directive::Hold,
            State::SafeStop { .. } => Directive::RampDown,
            State::Fault { cause } if response(cause) == Response::Disable => Directive::Disable,
            State::Fault { .. } => released,
        }
    }

    /// Stops for `cause` unless the episode already has a worse one.
    fn trip(&mut self, cause: Cause, now: Stamp, answers: &mut Answers) {
        if let State::Arming { request_id, .. } = self.state {
            answers.refuse(request_id, cause);
        }
        match (self.state, response(cause)) {
            (State::Fault { cause: present }, _) if present >= cause => {}
            (State::Fault { .. }, _) | (_, Response::Disable) => self.enter_fault(cause, now),
            (State::SafeStop { since, hold_until, cause: present }, _) => {
                let hold_until = if holds_currents(cause) { hold_until } else { hold_until.min(now) };
                self.enter_safe_stop(cause.max(present), since, hold_until);
            }
            _ => self.enter_safe_stop(cause, now, now.after(self.hold_time(cause))),
        }
    }

    /// How long currents are held on account of `cause` before they ramp to zero.
    fn hold_time(&self, cause: Cause) -> Duration {
        let holds = self.safe_action == SafeAction::HoldThenRamp && holds_currents(cause);
        if holds { self.watch.limits().safe_hold } else { Duration::ZERO }
    }

    /// True when a stop for `cause` cuts the amplifiers.
    fn cuts(&self, cause: Cause) -> bool {
        self.safe_action == SafeAction::Disable && response(cause) == Response::Trip
    }

    /// What happens without a request.
    fn progress(&mut self, seen: &Observation, answers: &mut Answers) {
        match self.state {
            State::Boot if self.watch.forbids_leaving_boot(seen).is_none() => self.enter_idle(seen.now),
            State::Arming { since, request_id } => self.await_claim(since, request_id, seen, answers),
            State::Active if self.sensing_lost(seen) => self.enter_holding(false, true, NearSnap::No),
            State::Holding { by_operator, near_snap, .. } => {
                match (by_operator, self.sensing_lost(seen), near_snap) {
                    (false, false, NearSnap::No) => self.enter_active(),
                    (_, sensing_lost, _) => self.enter_holding(by_operator, sensing_lost, near_snap),
                }
            }
            State::SafeStop { since, hold_until, cause } => {
                self.await_rest(since.max(hold_until), cause, seen);
            }
            _ => {}
        }
    }

    fn await_claim(&mut self, since: Stamp, request_id: u32, seen: &Observation, answers: &mut Answers) {
        let echoed = |driver: &DriverView| driver.epoch == self.epoch && driver.state == driver_state::DRIVEN;
        if seen.driver.as_ref().is_some_and(echoed) {
            self.watch.note_grant(seen);
            self.enter_armed();
            answers.push(request_id, None);
        } else if seen.now.since(since) > self.watch.limits().arm_timeout {
            self.enter_idle(seen.now);
            answers.refuse(request_id, Cause::ArmTimeout);
        }
    }

    /// Ends a ramp on what was measured after it began, once zero is also commanded.
    fn await_rest(&mut self, since: Stamp, cause: Cause, seen: &Observation) {
        let measured_since = seen.driver.as_ref().is_some_and(|driver| driver.stamp > since);
        if measured_since && seen.commanded_zero && self.watch.is_at_rest(seen) {
            match response(cause) {
                Response::Refuse | Response::Stop => {
                    self.enter_idle(seen.now);
                    self.cause = Some(cause);
                }
                Response::Trip | Response::Disable => self.enter_fault(cause, seen.now),
            }
        } else if seen.now.since(since) > self.watch.limits().ramp_timeout {
            self.enter_fault(Cause::RampTimeout, seen.now);
        }
    }

    fn sensing_lost(&self, seen: &Observation) -> bool {
        self.watch.lost_sensing(seen).is_some()
    }

    /// A release is repeated until the driver shows that it no longer obeys this epoch, at most for a
    /// command's validity: after that the driver ramps down by itself.
    fn forget_authority(&mut self, seen: &Observation) {
        let releasing = match self.state {
            State::Idle => true,
            State::Fault { cause } => response(cause) != Response::Disable,
            _ => false,
        };
        let gone = |driver: &DriverView| driver.epoch != self.epoch || driver.state == driver_state::IDLE;
        let over = seen.now >= self.release_until || seen.driver.as_ref().is_some_and(gone);
        if releasing && over {
            self.epoch = 0;
        }
    }

    fn enter_idle(&mut self, now: Stamp) {
        self.release_until = now.after(self.watch.limits().command_validity);
        self.state = State::Idle;
    }

    fn enter_arming(&mut self, request_id: u32, now: Stamp) {
        // Rises with every claim on this host, since the clock does.
        self.epoch = now.nanoseconds().max(self.epoch + 1);
        self.cause = None;
        self.judgements.forget();
        self.state = State::Arming { since: now, request_id };
    }

    fn enter_armed(&mut self) {
        self.state = State::Armed;
    }

    fn enter_active(&mut self) {
        self.state = State::Active;
    }

    fn enter_holding(&mut self, by_operator: bool, sensing_lost: bool, near_snap: NearSnap) {
        self.state = State::Holding { by_operator, sensing_lost, near_snap };
    }

    fn enter_safe_stop(&mut self, cause: Cause, since: Stamp, hold_until: Stamp) {
        self.cause = Some(cause);
        self.state = State::SafeStop { since, hold_until, cause };
    }

    fn enter_fault(&mut self, cause: Cause, now: Stamp) {
        if response(cause) == Response::Disable && self.epoch == 0 {
            // A driver that nobody holds takes the order to cut from any later epoch.
            self.epoch = now.nanoseconds().max(1);
        }
        self.release_until = now.after(self.watch.limits().command_validity);
        self.cause = Some(cause);
        self.state = State::Fault { cause };
    }
}
