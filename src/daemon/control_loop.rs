//! Start reading here: one control cycle, from what was sensed to what is sent.
//!
//! ```text
//! tick ──▶ read ──▶ step ──▶ supervise ──▶ gate ──▶ write ──▶ record
//! ```
//!
//! The deadline of a cycle is the next tick. A cycle that ends later makes the loop skip whole periods; too
//! many of them trip a ramp to zero, and a loop that hangs lets its last command run out of validity, upon
//! which the driver ramps to zero alone.
//!
//! What is absent: a clock (time comes with the tick), a channel, an allocation, a lock, a log, a panic. So
//! the same loop runs in real time over shared memory and in lockstep under stepped time.

use std::time::Duration;

use magsteer_hal::gate::{Gate, Limited};
use magsteer_hal::operator::Cause;
use magsteer_hal::{
    Absent, Actuation, AdmittedCommand, Authority, CoilFeedback, Hardware, HardwareDescription, Sensed, Stamp,
};

use super::clock::Tick;
use super::config::DaemonConfig;
use super::cycle_record::CycleRecord;
use super::monitors::{MonitorReport, Sample};
use super::phases::{Phase, PhaseTimes, PhaseWatch, Untimed};
use super::receipt::Receipts;
use super::state::{Directive, Request, State};
use super::supervisor::{Decision, Supervisor};
use super::trail::Trail;
use super::trust::{self, Astray};
use super::watch::{DriverView, Observation};
use crate::control::{CycleInput, CycleOutcome, Directions, ReferenceTarget, Step};
use crate::math::scramble;

/// After a stall the loop acts as if at most this many periods had passed, so that it never makes up in
/// one step of currents for what it missed.
const PERIODS_PER_STEP_MAX: u32 = 10;

/// A cycle takes one request, and another one already waits for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("another request waits for the next cycle")]
pub struct Occupied;

/// What a loop needs to know that is neither rig nor configuration.
#[derive(Debug, Clone, Copy, Default)]
pub struct LoopOptions {
    /// Real time is enforced and was not granted: refuse to arm.
    pub realtime_missing: bool,
    /// Makes the tokens of this process differ from those of any other.
    pub token_seed: u64,
}

/// The loop's state: hardware, controller, supervisor, gate.
#[derive(Debug)]
pub struct ControlLoop<H, S> {
    hardware: H,
    controller: S,
    supervisor: Supervisor,
    gate: Gate,
    rig: Rig,
    request: Option<Request>,
    target: Option<ReferenceTarget>,
    reference: Directions,
    frozen: Directions,
    trail: Trail,
    previous_now: Option<Stamp>,
    receipts: Receipts,
    /// Exposure of the poses of the previous cycle.
    pose_before: Option<Stamp>,
    write_failed: bool,
    description_mismatch: bool,
}

/// Constants of the rig and the configuration that a cycle uses.
#[derive(Debug)]
struct Rig {
    current_trip: Vec<f64>,
    coil_count: usize,
    frame_count: usize,
    period: Duration,
    validity: Duration,
    token_seed: u64,
}

impl<H: Hardware, S: Step> ControlLoop<H, S> {
    /// A loop in `Boot` with nothing received yet.
    #[must_use]
    pub fn new(
        hardware: H,
        controller: S,
        description: &HardwareDescription,
        config: &DaemonConfig,
        options: LoopOptions,
    ) -> Self {
        let limits = config.limits();
        let trip = |current_max: f64| current_max + config.overcurrent_margin_a;
        let rig = Rig {
            current_trip: description.coils.iter().map(|coil| trip(coil.current_max)).collect(),
            coil_count: description.coils.len(),
            frame_count: description.frames.len(),
            period: config.period(),
            validity: limits.command_validity,
            token_seed: options.token_seed,
        };
        Self {
            hardware,
            controller,
            supervisor: Supervisor::new(config, description, options.realtime_missing),
            gate: Gate::new(description),
            rig,
            request: None,
            target: None,
            reference: Directions::default(),
            frozen: Directions::default(),
            trail: Trail::new(),
            previous_now: None,
            receipts: Receipts::new(),
            pose_before: None,
            write_failed: false,
            description_mismatch: false,
        }
    }

    /// Runs one cycle at `tick`.
    pub fn cycle(&mut self, tick: Tick) -> CycleRecord {
        self.timed_cycle(tick, &mut Untimed)
    }

    /// The same; `watch` is told when each phase of it ends.
    pub fn timed_cycle(&mut self, tick: Tick, watch: &mut impl PhaseWatch) -> CycleRecord {
        let sensed = self.hardware.read(tick.now);
        let input = self.input(&tick, &sensed);
        watch.ended(Phase::Read);
        let outcome = self.controller.step(&input);
        watch.ended(Phase::Control);
        let seen = self.observe(&tick, &sensed, &outcome);
        let request = self.request.take();
        let decision = self.supervisor.step(&seen, request);
        let (command, limited) = self.admit(&decision, &input, &outcome);
        self.follow_wishes(&decision, &input, &outcome);
        watch.ended(Phase::Decide);
        self.write_failed = command.is_some_and(|command| self.hardware.write(&command, tick.now).is_err());
        watch.ended(Phase::Write);
        self.record(tick, input, outcome, (request, decision), &sensed, command, limited)
    }

    /// Leaves a request for the next cycle.
    ///
    /// # Errors
    /// When another one still waits for that cycle.
    pub fn request(&mut self, request: Request) -> Result<(), Occupied> {
        if self.request.is_some() {
            return Err(Occupied);
        }
        self.request = Some(request);
        Ok(())
    }

    /// The present state.
    #[must_use]
    pub fn state(&self) -> &State {
        self.supervisor.state()
    }

    /// True when the process was told to end and nothing is left to send.
    #[must_use]
    pub fn has_ended(&self, now: Stamp) -> bool {
        self.supervisor.has_ended(now)
    }

    /// What the monitors counted.
    #[must_use]
    pub fn monitors(&self) -> MonitorReport {
        self.supervisor.monitors()
    }

    /// The hardware, for code that looks at it in lockstep.
    pub fn hardware(&self) -> &H {
        &self.hardware
    }

    /// The hardware, for code that steps it in lockstep.
    pub fn hardware_mut(&mut self) -> &mut H {
        &mut self.hardware
    }

    /// The controller, for tests.
    pub fn controller_mut(&mut self) -> &mut S {
        &mut self.controller
    }

    fn input(&mut self, tick: &Tick, sensed: &Sensed) -> CycleInput {
        let elapsed = self.previous_now.map_or(self.rig.period, |previous| tick.now.since(previous));
        self.previous_now = Some(tick.now);
        let state = self.supervisor.state();
        let held = matches!(state, State::Holding { by_operator: true, .. });
        let target = if held { self.frozen.into() } else { self.target.unwrap_or_default() };
        let admitted = *self.gate.previous();
        CycleInput {
            period: elapsed.min(self.rig.period * PERIODS_PER_STEP_MAX).as_secs_f64(),
            pose: sensed.pose.last,
            pose_is_fresh: sensed.pose.fresh,
            pose_age: sensed.pose.age(tick.now).unwrap_or_default().as_secs_f64(),
            measured: sensed.feedback.last.map_or(admitted, |feedback| feedback.measured),
            admitted,
            target,
            engaged: state.is_engaged(),
        }
    }

    fn observe(&mut self, tick: &Tick, sensed: &Sensed, outcome: &CycleOutcome) -> Observation {
        if matches!(sensed.feedback.refused, Some(Absent::Description { .. })) {
            self.description_mismatch = true;
        } else if sensed.feedback.fresh {
            self.description_mismatch = false;
        }
        Observation {
            now: tick.now,
            missed: tick.missed,
            pose_stamp: sensed.pose.last.map(|pose| pose.header.source_stamp()),
            pose_life: sensed.pose.last.map(|pose| pose.header.epoch),
            pose_error: trust::pose_error(outcome),
            astray: sensed.feedback.last.map_or_else(Astray::default, |feedback| {
                Astray::between(&feedback.measured, self.gate.previous())
            }),
            driver: sensed.feedback.last.map(|feedback| self.rig.view(&feedback)),
            description_mismatch: self.description_mismatch,
            model_converged: outcome.model.converged,
            field_valid: outcome.model.field_valid,
            margin: outcome.model.margin,
            verdict: outcome.verdict,
            request_finite: self.rig.is_finite(&outcome.request),
            write_failed: self.write_failed,
            trail_ended: self.trail.is_at_its_begin(),
            commanded_zero: self.gate.is_at_zero(),
            sample: self.sample(sensed, outcome),
        }
    }

    fn sample(&mut self, sensed: &Sensed, outcome: &CycleOutcome) -> Sample {
        let pose_stamp = sensed.pose.last.map(|pose| pose.header.source_stamp());
        let before = std::mem::replace(&mut self.pose_before, pose_stamp);
        let interval = pose_stamp.zip(before).map(|(now, before)| now.since(before));
        Sample {
            pose: sensed.pose.last,
            pose_is_fresh: sensed.pose.fresh,
            pose_interval: interval.unwrap_or_default(),
            pose_refused: sensed.pose.refused,
            feedback: sensed.feedback.last.filter(|_| sensed.feedback.fresh).map(|feedback| feedback.header),
            feedback_refused: sensed.feedback.refused,
            measured: sensed.feedback.last.map(|feedback| feedback.measured),
            commanded: *self.gate.previous(),
            seen_by_controller: outcome.measured,
            target: outcome.in_force.directions,
            saturated: outcome.saturated,
            engaged: self.supervisor.state().is_engaged(),
        }
    }

    /// Takes over targets or gives them up, and freezes the reference when the operator's hold begins.
    fn follow_wishes(&mut self, decision: &Decision, input: &CycleInput, outcome: &CycleOutcome) {
        match decision.given_up {
            // The reference stays; where the frames were to go is given up with it.
            Some(Cause::NearSnapThrough) => self.target = Some(self.reference.into()),
            Some(_) => self.target = Some(outcome.in_force),
            None => {}
        }
        if decision.target.is_some() {
            self.target = decision.target;
        }
        match decision.directive {
            Directive::Follow => {
                self.reference = outcome.desired;
                self.trail.lead_on(self.gate.previous(), input.period);
            }
            Directive::Begin => {
                // Without a target the loop keeps the rod where it was found.
                self.reference = outcome.measured;
                self.target.get_or_insert(outcome.measured.into());
                self.trail.begin(self.gate.previous());
            }
            Directive::Retreat => {
                // Where it ends, the rod is kept.
                self.reference = outcome.desired;
                let frame_angles = Some(self.gate.previous().angle_rad);
                self.target = Some(ReferenceTarget { directions: outcome.desired, frame_angles });
            }
            _ => {}
        }
        if decision.froze || decision.directive == Directive::Retreat {
            self.frozen = self.reference;
        }
    }

    fn admit(
        &mut self,
        decision: &Decision,
        input: &CycleInput,
        outcome: &CycleOutcome,
    ) -> (Option<AdmittedCommand>, Limited) {
        let authority = self.rig.authority(decision.epoch);
        let resting = Actuation { angle_rad: input.measured.angle_rad, ..Actuation::default() };
        let request = match decision.directive {
            Directive::Silent => return (None, Limited::default()),
            Directive::Claim => {
                self.gate.seed(&resting);
                return (Some(self.gate.claim(authority)), Limited::default());
            }
            Directive::Release => return (Some(self.gate.release(authority)), Limited::default()),
            Directive::Disable => return (Some(self.gate.disable(authority)), Limited::default()),
            Directive::RampDown => {
                return (Some(self.gate.ramp_to_zero(input.period, authority)), Limited::default());
            }
            Directive::Rest => Actuation { angle_rad: self.gate.previous().angle_rad, ..resting },
            Directive::Begin => {
                self.gate.seed(&input.measured);
                *self.gate.previous()
            }
            Directive::Hold => *self.gate.previous(),
            Directive::Retreat => self.trail.back(self.gate.previous(), input.period),
            Directive::Follow => outcome.request,
        };
        // Nothing but following is computed from the poses.
        let followed = input.pose.filter(|_| decision.directive == Directive::Follow);
        let pose_stamp = followed.map_or(Stamp::default(), |pose| pose.header.source_stamp());
        match self.gate.drive(&request, input.period, authority, pose_stamp) {
            Ok(admitted) => (Some(admitted.command), admitted.limited),
            // The supervisor trips on a request that is not finite; should one get here, it goes to zero.
            Err(_) => (Some(self.gate.ramp_to_zero(input.period, authority)), Limited::default()),
        }
    }

    #[expect(clippy::too_many_arguments, reason = "one for each step of the cycle")]
    fn record(
        &mut self,
        tick: Tick,
        input: CycleInput,
        outcome: CycleOutcome,
        (request, decision): (Option<Request>, Decision),
        sensed: &Sensed,
        command: Option<AdmittedCommand>,
        limited: Limited,
    ) -> CycleRecord {
        let feedback = sensed.feedback.last.filter(|_| sensed.feedback.fresh);
        let receipt = feedback.and_then(|feedback| self.receipts.take(&feedback));
        let record = CycleRecord {
            tick,
            input,
            outcome,
            decision,
            request,
            feedback: sensed.feedback.last,
            feedback_is_fresh: sensed.feedback.fresh,
            pose_refused: sensed.pose.refused,
            feedback_refused: sensed.feedback.refused,
            order: command.filter(|_| !self.write_failed).map(|command| command.order()),
            limited,
            admitted: *self.gate.previous(),
            target: self.target.unwrap_or_default(),
            receipt,
            execution: Duration::ZERO,
            phases: PhaseTimes::default(),
            allocations: 0,
        };
        if let Some(pose) = record.input.pose.filter(|_| record.answers_fresh_poses()) {
            self.receipts.note_answer(&pose.header);
        }
        record
    }
}

impl Rig {
    fn authority(&self, epoch: u64) -> Authority {
        // Scrambled, so that tokens of two processes do not meet.
        Authority { epoch, token: scramble(self.token_seed ^ epoch), validity: self.validity }
    }

    fn view(&self, feedback: &CoilFeedback) -> DriverView {
        let currents = &feedback.measured.current_a[..self.coil_count];
        let mut over_current = false;
        let mut current_max = 0.0_f64;
        for (current, trip) in currents.iter().zip(&self.current_trip) {
            over_current |= current.abs() > *trip;
            current_max = current_max.max(current.abs());
        }
        DriverView {
            stamp: feedback.header.source_stamp(),
            state: feedback.state,
            fault: feedback.fault,
            epoch: feedback.accepted_epoch,
            echoed: feedback.accepted_sequence,
            life: feedback.header.epoch,
            current_max,
            over_current,
        }
    }

    fn is_finite(&self, request: &Actuation) -> bool {
        let currents = &request.current_a[..self.coil_count];
        let angles = &request.angle_rad[..self.frame_count];
        currents.iter().chain(angles).all(|value| value.is_finite())
    }
}
