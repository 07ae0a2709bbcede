//! One commanding side for one rig: a gate, an authority and the steps that clauses are made of.

use std::time::Duration;

use super::harness::Rig;
use crate::gate::{AdmittedCommand, Authority, Gate};
use crate::hardware::{Hardware, Sensed};
use crate::message::{Actuation, CoilFeedback, driver_state};
use crate::time::Stamp;

/// Time of one cycle.
pub(super) const CYCLE: Duration = Duration::from_millis(1);
/// Validity of the commands.
pub(super) const VALIDITY: Duration = Duration::from_millis(100);
/// Part of each coil's greatest current that the suite asks for.
const EFFORT: f64 = 0.25;

/// What a clause found wrong.
pub(super) type Outcome = Result<(), String>;

/// `Err` with what was found unless `holds`.
pub(super) fn require(holds: bool, detail: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(detail()) }
}

pub(super) struct Trial<'rig, R: Rig> {
    pub(super) rig: &'rig mut R,
    pub(super) gate: Gate,
    pub(super) authority: Authority,
}

impl<'rig, R: Rig> Trial<'rig, R> {
    /// Epochs rise with the rig's clock, so that several trials may share a rig.
    pub(super) fn new(rig: &'rig mut R) -> Self {
        let gate = Gate::new(rig.description());
        let epoch = rig.now().nanoseconds().max(1);
        Self { rig, gate, authority: Authority { epoch, token: 0x6d61_6773, validity: VALIDITY } }
    }

    pub(super) fn read(&mut self) -> Sensed {
        let now = self.rig.now();
        self.rig.hardware().read(now)
    }

    /// Lets `duration` pass; the feedback at its end.
    pub(super) fn pass(&mut self, duration: Duration) -> Result<CoilFeedback, String> {
        self.rig.advance(duration);
        let reading = self.read().feedback;
        match (reading.last, reading.refused) {
            (Some(feedback), None) => Ok(feedback),
            (_, Some(absent)) => Err(format!("feedback was refused: {absent}")),
            (None, None) => Err("no feedback arrived".to_owned()),
        }
    }

    /// Sends, lets a cycle pass; the feedback after it.
    pub(super) fn send(&mut self, command: &AdmittedCommand) -> Result<CoilFeedback, String> {
        let now = self.rig.now();
        self.rig.hardware().write(command, now).map_err(|error| error.to_string())?;
        self.pass(CYCLE)
    }

    /// A claim under a new epoch, repeated until it is granted or a second has passed, as a daemon does.
    pub(super) fn claim(&mut self) -> Result<CoilFeedback, String> {
        self.authority.epoch = self.rig.now().nanoseconds().max(self.authority.epoch + 1);
        let mut feedback = CoilFeedback::default();
        for _ in 0..1000 {
            let claim = self.gate.claim(self.authority);
            feedback = self.send(&claim)?;
            if feedback.accepted_epoch == self.authority.epoch && feedback.state == driver_state::DRIVEN {
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

    /// Claims and drives to the suite's effort until currents had time to get there.
    pub(super) fn drive_up(&mut self) -> Result<CoilFeedback, String> {
        let mut feedback = self.claim()?;
        self.gate.seed(&feedback.measured);
        let effort = self.effort();
        for _ in 0..cycles(self.ramp_time() + self.rig.settling()) {
            feedback = self.drive(&effort)?;
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
        }
        Ok(feedback)
    }

    /// That every measured current is that of `expected`.
    pub(super) fn require_currents(&self, feedback: &CoilFeedback, expected: &Actuation) -> Outcome {
        let tolerance = self.rig.current_tolerance();
        for index in 0..self.rig.description().coils.len() {
            let (measured, wanted) = (feedback.measured.current_a[index], expected.current_a[index]);
            require((measured - wanted).abs() <= tolerance, || {
                format!("coil {index} measures {measured} A, expected {wanted} within {tolerance}")
            })?;
        }
        Ok(())
    }

    pub(super) fn require_zero(&self, feedback: &CoilFeedback) -> Outcome {
        self.require_currents(feedback, &Actuation::default())
    }
}

pub(super) fn require_state(feedback: &CoilFeedback, expected: u32) -> Outcome {
    require(feedback.state == expected, || {
        format!("driver is in state {}, expected {expected}", feedback.state)
    })
}

/// Whole cycles in `duration`, rounded up.
pub(super) fn cycles(duration: Duration) -> u128 {
    duration.as_nanos().div_ceil(CYCLE.as_nanos())
}
