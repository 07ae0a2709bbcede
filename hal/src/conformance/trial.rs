//! One commanding side for one rig: a gate, an authority and the steps that clauses are made of.

use std::time::Duration;

use super::harness::{Rig, Spoil};
use crate::gate::{AdmittedCommand, Authority, Gate};
use crate::hardware::{Hardware, Sensed};
use crate::message::{Actuation, CoilFeedback, driver_state};
use crate::time::Stamp;

/// Time of one cycle.
pub(super) const CYCLE: Duration = Duration::from_millis(1);
/// Part of each coil's greatest current that the suite asks for.
const EFFORT: f64 = 0.25;
/// Token of the suite's claims.
const TOKEN: u64 = 0x6d61_6773;
/// Currents that stay within their tolerance for so many cycles have settled.
const SETTLED_CYCLES: u32 = 10;
/// How long a claim is repeated, as a daemon does.
const CLAIM_TIME: Duration = Duration::from_secs(1);
/// How often the way to rest is waited for between clauses: far longer than it may take, which is a clause's
/// own matter.
const RESTS_MAX: u32 = 10;

/// `Err` with what was found unless `holds`.
pub(super) fn require(holds: bool, detail: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(detail()) }
}

pub(super) struct Trial<'rig, R: Rig> {
    pub(super) rig: &'rig mut R,
    pub(super) gate: Gate,
    pub(super) authority: Authority,
    /// Feedback since the trial's begin, or since a clause took it.
    pub(super) trace: Vec<CoilFeedback>,
    /// When the newest command was sent.
    pub(super) sent: Stamp,
    /// True where the rig tells of every message, whose stamps need not fall on cycles.
    pub(super) hears_all: bool,
}

impl<'rig, R: Rig> Trial<'rig, R> {
    /// Epochs rise with the rig's clock, so that several trials may share a rig.
    pub(super) fn new(rig: &'rig mut R) -> Self {
        let gate = Gate::new(rig.description());
        let epoch = rig.now().nanoseconds().max(1);
        let authority = Authority { epoch, token: TOKEN, validity: rig.validity() };
        let hears_all = rig.heard().is_some();
        Self { rig, gate, authority, trace: Vec::new(), sent: Stamp::default(), hears_all }
    }

    pub(super) fn read(&mut self) -> Sensed {
        let now = self.rig.now();
        self.rig.hardware().read(now)
    }

    /// Lets `duration` pass; the feedback at its end.
    pub(super) fn pass(&mut self, duration: Duration) -> Result<CoilFeedback, String> {
        if self.rig.is_interrupted() {
            return Err("interrupted".to_owned());
        }
        self.rig.advance(duration);
        let reading = self.read().feedback;
        match self.rig.heard() {
            Some(heard) => self.trace.extend(heard.feedback.iter().map(|(message, _)| *message)),
            None => self.trace.extend(reading.last.filter(|_| reading.fresh)),
        }
        match (reading.last, reading.refused) {
            (Some(feedback), None) => Ok(feedback),
            (_, Some(absent)) => Err(format!("feedback was refused: {absent}")),
            (None, None) => Err("no feedback arrived".to_owned()),
        }
    }

    /// Sends, lets a cycle pass; the feedback after it.
    pub(super) fn send(&mut self, command: &AdmittedCommand) -> Result<CoilFeedback, String> {
        let now = self.rig.now();
        self.sent = now;
        self.rig.hardware().write(command, now).map_err(|error| error.to_string())?;
        self.pass(CYCLE)
    }

    /// Sends what `spoil` makes of a drive to where the gate stands, lets a cycle pass; the feedback after
    /// it, or
    /// `None` when the rig cannot be sent such a thing.
    pub(super) fn send_spoilt(&mut self, spoil: Spoil<'_>) -> Result<Option<CoilFeedback>, String> {
        let still = *self.gate.previous();
        let admitted = self.gate.drive(&still, 0.0, self.authority, Stamp::default());
        let command = admitted.map_err(|refused| refused.to_string())?.command;
        self.sent = self.rig.now();
        if !self.rig.send_spoilt(&command, spoil) {
            return Ok(None);
        }
        self.pass(CYCLE).map(Some)
    }

    /// A claim under a new epoch, repeated until it is granted or a second has passed, as a daemon does.
    pub(super) fn claim(&mut self) -> Result<CoilFeedback, String> {
        self.authority.epoch = self.rig.now().nanoseconds().max(self.authority.epoch + 1);
        let mut feedback = CoilFeedback::default();
        let start = self.rig.now();
        while self.rig.now().since(start) < CLAIM_TIME {
            let claim = self.gate.claim(self.authority);
            feedback = self.send(&claim)?;
            if feedback.accepted_epoch == self.authority.epoch && feedback.state == driver_state::DRIVEN {
                // Frames go on from where they stand.
                let standing = Actuation { angle_rad: feedback.measured.angle_rad, ..Actuation::default() };
                self.gate.seed(&standing);
                return Ok(feedback);
            }
        }
        let (state, epoch) = (feedback.state, feedback.accepted_epoch);
        Err(format!(
            "claim of epoch {} not granted: state {state}, accepted epoch {epoch}",
            self.authority.epoch
        ))
    }

    /// The currents that the suite drives to: alternating signs, a quarter of each maximum.
    pub(super) fn effort(&self) -> Actuation {
        let mut effort = *self.gate.previous();
        for (index, coil) in self.rig.description().coils.iter().enumerate() {
            let sign = if index % 2 == 0 { 1.0 } else { -1.0 };
            effort.current_a[index] = sign * EFFORT * coil.current_max;
        }
        effort
    }

    /// One driven cycle towards `request`.
    pub(super) fn drive(&mut self, request: &Actuation) -> Result<CoilFeedback, String> {
        let admitted = self
            .gate
            .drive(request, CYCLE.as_secs_f64(), self.authority, Stamp::default())
            .map_err(|refused| refused.to_string())?;
        self.send(&admitted.command)
    }

    /// Claims and drives to the suite's effort until currents are there, or had time to be.
    pub(super) fn drive_up(&mut self) -> Result<CoilFeedback, String> {
        self.claim()?;
        let effort = self.effort();
        self.drive_to(&effort)
    }

    /// Drives to `wanted` until currents are there, or had time to be; the feedback after it.
    pub(super) fn drive_to(&mut self, wanted: &Actuation) -> Result<CoilFeedback, String> {
        let mut feedback = self.drive(wanted)?;
        let mut settled = 0;
        for _ in 0..cycles(self.ramp_time() + self.rig.settling()) {
            feedback = self.drive(wanted)?;
            let is_there = self.require_currents(&feedback, wanted).is_ok();
            settled = if is_there { settled + 1 } else { 0 };
            if settled >= SETTLED_CYCLES {
                break;
            }
        }
        Ok(feedback)
    }

    /// How long the slowest coil takes between zero and the suite's effort, and a little more.
    pub(super) fn ramp_time(&self) -> Duration {
        let slowest =
            self.rig.description().coils.iter().map(|coil| EFFORT * coil.current_max / coil.slew_max);
        Duration::from_secs_f64(slowest.fold(0.0, f64::max)) + CYCLE * 20
    }

    /// Lets currents ramp down and settle without a command; the feedback after it.
    pub(super) fn rest(&mut self) -> Result<CoilFeedback, String> {
        let mut feedback = self.pass(CYCLE)?;
        for _ in 0..cycles(self.ramp_time() + self.rig.settling()) {
            feedback = self.pass(CYCLE)?;
            let is_free = matches!(feedback.state, driver_state::IDLE | driver_state::DISABLED);
            if is_free && self.require_zero(&feedback).is_ok() {
                break;
            }
        }
        Ok(feedback)
    }

    /// Brings a rig that may be disabled, driven or on its way to zero back to idle at zero current.
    pub(super) fn restore(&mut self) -> Result<(), String> {
        // Should authority of a former trial still stand, it lapses meanwhile.
        let feedback = self.rest()?;
        if feedback.state != driver_state::IDLE {
            self.claim()?;
            let release = self.gate.release(self.authority);
            self.send(&release)?;
        }
        let mut at_rest = Err("interrupted".to_owned());
        for _ in 0..RESTS_MAX {
            let rested = self.rest()?;
            at_rest = require_state(&rested, driver_state::IDLE).and_then(|()| self.require_zero(&rested));
            if at_rest.is_ok() {
                break;
            }
        }
        at_rest
    }

    /// That every measured current is that of `expected`.
    pub(super) fn require_currents(
        &self,
        feedback: &CoilFeedback,
        expected: &Actuation,
    ) -> Result<(), String> {
        for index in 0..self.rig.description().coils.len() {
            let tolerance = self.rig.current_tolerance(index);
            let (measured, wanted) = (feedback.measured.current_a[index], expected.current_a[index]);
            require((measured - wanted).abs() <= tolerance, || {
                format!("coil {index} measures {measured} A, expected {wanted} within {tolerance}")
            })?;
        }
        Ok(())
    }

    /// That no current of the trace changed faster than slew; the steepest change over ten messages, or all
    /// there are, A/s.
    pub(super) fn require_slew(&self) -> Result<f64, String> {
        /// Over so many messages noise counts little, and a step is still a step.
        const SPAN_MAX: usize = 10;
        let longest = SPAN_MAX.min(self.trace.len().saturating_sub(1));
        let jitter = self.stamp_jitter().as_secs_f64();
        let mut steepest = 0.0_f64;
        for span in 1..=longest {
            for pair in self.trace.windows(span + 1) {
                let (before, now) = (&pair[0], &pair[span]);
                let elapsed = now.header.source_stamp().since(before.header.source_stamp()).as_secs_f64();
                for (index, coil) in self.rig.description().coils.iter().enumerate() {
                    let change = (now.measured.current_a[index] - before.measured.current_a[index]).abs();
                    // Noise of both measurements, and rounding.
                    let tolerance = 2.0 * self.rig.current_tolerance(index);
                    let greatest = coil.slew_max * (elapsed * (1.0 + 1e-9) + jitter) + tolerance;
                    require(change <= greatest, || {
                        format!(
                            "coil {index} changed by {change:.3} A in {:.1} ms, {} A/s allow {:.3} A",
                            elapsed * 1e3,
                            coil.slew_max,
                            greatest
                        )
                    })?;
                    if span == longest && elapsed > 0.0 {
                        steepest = steepest.max(change / elapsed);
                    }
                }
            }
        }
        Ok(steepest)
    }

    /// How far a stamp of feedback may lie off the moment at which its set point was made.
    fn stamp_jitter(&self) -> Duration {
        if self.hears_all { self.feedback_period() } else { Duration::ZERO }
    }

    /// Half of all intervals between messages of the trace are shorter.
    pub(super) fn feedback_period(&self) -> Duration {
        let stamps = self.trace.iter().map(|message| message.header.source_stamp());
        median_interval(&stamps.collect::<Vec<_>>())
    }

    /// Time from `start` until every current is zero, which the slew limit and the coils' settling bound.
    pub(super) fn time_to_zero(&mut self, start: Stamp) -> Result<Duration, String> {
        let mut feedback = *self.trace.last().ok_or("no feedback arrived")?;
        let allowed = self.ramp_time() + self.rig.settling();
        for _ in 0..=cycles(allowed) {
            if self.require_zero(&feedback).is_ok() {
                return Ok(self.zero_since(start));
            }
            feedback = self.pass(CYCLE)?;
        }
        let left = feedback.measured.current_a.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
        let elapsed = milliseconds(feedback.header.source_stamp().since(start));
        let allowed = milliseconds(allowed);
        Err(format!("{left:.3} A are left {elapsed:.0} ms later, slew and settling take {allowed:.0} ms"))
    }

    /// From `start` to the first message from which on every current stays zero.
    fn zero_since(&self, start: Stamp) -> Duration {
        let zeros = self.trace.iter().rev().take_while(|feedback| self.require_zero(feedback).is_ok());
        let first = zeros.last().map_or(start, |feedback| feedback.header.source_stamp());
        first.since(start)
    }

    pub(super) fn require_zero(&self, feedback: &CoilFeedback) -> Result<(), String> {
        self.require_currents(feedback, &Actuation::default())
    }
}

pub(super) fn require_state(feedback: &CoilFeedback, expected: u32) -> Result<(), String> {
    require(feedback.state == expected, || {
        format!("driver is in state {}, expected {expected}", feedback.state)
    })
}

/// Whole cycles in `duration`, rounded up.
pub(super) fn cycles(duration: Duration) -> u128 {
    duration.as_nanos().div_ceil(CYCLE.as_nanos())
}

pub(super) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1e3
}

/// Half of all intervals between stamps are shorter; zero for fewer than two stamps.
pub(super) fn median_interval(stamps: &[Stamp]) -> Duration {
    let mut intervals: Vec<Duration> = stamps.windows(2).map(|pair| pair[1].since(pair[0])).collect();
    intervals.sort_unstable();
    intervals.get(intervals.len() / 2).copied().unwrap_or(Duration::ZERO)
}
