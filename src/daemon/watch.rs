//! What is judged in every cycle: ages, the driver's state, the model's health, overruns; and which
//! cause follows from it.
//!
//! What is absent: any decision about what to send.

use std::time::Duration;

use magsteer_hal::message::driver_state;
use magsteer_hal::operator::Cause;
use magsteer_hal::{HardwareDescription, Stamp};

use super::causes::is_monitor;
use super::config::{DaemonConfig, Limits, Mode};
use super::monitors::{MonitorReport, Monitors, Sample};
use super::overruns::OverrunBucket;
use super::state::State;
use super::trust::{Astray, Trust};
use crate::control::{Verdict, margin_allowed};

/// The driver as its newest feedback shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriverView {
    /// When the feedback was true.
    pub stamp: Stamp,
    /// One of [`driver_state`].
    pub state: u32,
    /// The driver's own fault code, 0 for none.
    pub fault: u32,
    /// Epoch that it obeys.
    pub epoch: u64,
    /// Sequence of the command that it echoes.
    pub echoed: u64,
    /// The driver's own life: another number after each of its starts.
    pub life: u64,
    /// Greatest measured current, A.
    pub current_max: f64,
    /// True when a measured current lies beyond its coil's limit and margin.
    pub over_current: bool,
}

/// What the supervisor sees of a cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// The cycle's moment.
    pub now: Stamp,
    /// Periods missed before this cycle.
    pub missed: u64,
    /// Exposure of the newest valid poses.
    pub pose_stamp: Option<Stamp>,
    /// Life of the sensor that sent them.
    pub pose_life: Option<u64>,
    /// Greatest angle between a magnet's measured direction and the model's, rad.
    pub pose_error: f64,
    /// Newest valid feedback.
    pub driver: Option<DriverView>,
    /// How far what was measured lies off what was commanded.
    pub astray: Astray,
    /// True when feedback was refused because it speaks of another rig.
    pub description_mismatch: bool,
    /// True when the model's equilibrium was found in this cycle.
    pub model_converged: bool,
    /// True when every magnet lies within the field model's range.
    pub field_valid: bool,
    /// Margin of stability of the model's last equilibrium.
    pub margin: f64,
    /// What is known of the way to the target.
    pub verdict: Verdict,
    /// True when the controller's request is finite.
    pub request_finite: bool,
    /// True when the previous command could not be sent.
    pub write_failed: bool,
    /// True when there is nothing left to go back along.
    pub trail_ended: bool,
    /// True when every current commanded last is zero.
    pub commanded_zero: bool,
    /// For the monitors.
    pub sample: Sample,
}

impl Observation {
    /// Age of the poses; `None` before the first.
    #[must_use]
    pub fn pose_age(&self) -> Option<Duration> {
        self.pose_stamp.map(|stamp| self.now.since(stamp))
    }

    pub(super) fn fresh_driver(&self, limit: Duration) -> Option<&DriverView> {
        self.driver.as_ref().filter(|driver| self.now.since(driver.stamp) <= limit)
    }
}

/// How far above its limit the margin of stability ends a warning: the noise of measured currents moves it by
/// half of that.
const WARNING_BAND: f64 = 0.03;

/// Memory of how long something has been wrong.
#[derive(Debug, Clone)]
pub struct Watch {
    limits: Limits,
    overruns: OverrunBucket,
    model_unusable_since: Option<Stamp>,
    write_failing_since: Option<Stamp>,
    unstable_since: Option<Stamp>,
    warns_of_stability: bool,
    /// Least margin of stability that the present motion may come to.
    margin_allowed: f64,
    trust: Trust,
    monitors: Monitors,
    mode: Mode,
}

/// The worst causes of a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Found {
    /// What stops the daemon.
    pub acts: Option<Cause>,
    /// What would, were it not passive.
    pub judged: Option<Cause>,
}

impl Found {
    fn add(&mut self, mode: Mode, cause: Option<Cause>) {
        match cause {
            Some(cause) if mode == Mode::Passive && is_monitor(cause) => {
                self.judged = self.judged.max(Some(cause))
            }
            _ => self.acts = self.acts.max(cause),
        }
    }
}

impl Watch {
    /// Nothing wrong so far.
    #[must_use]
    pub fn new(config: &DaemonConfig, rig: &HardwareDescription) -> Self {
        let limits = config.limits();
        let overruns = OverrunBucket::new(limits.overrun_fraction, limits.overrun_capacity);
        Self {
            limits,
            overruns,
            model_unusable_since: None,
            write_failing_since: None,
            unstable_since: None,
            warns_of_stability: false,
            margin_allowed: limits.stability_hold,
            trust: Trust::new(limits),
            monitors: Monitors::new(config.monitors.limits(), rig),
            mode: config.mode,
        }
    }

    /// Takes one cycle's observation.
    pub fn observe(&mut self, seen: &Observation) {
        self.overruns.take(seen.missed);
        let model_usable = seen.model_converged && seen.field_valid;
        self.model_unusable_since = since(self.model_unusable_since, !model_usable, seen.now);
        self.write_failing_since = since(self.write_failing_since, seen.write_failed, seen.now);
        // Not a number is no margin.
        let stable = seen.margin >= self.limits.stability_stop;
        let quiet_at = self.limits.stability_warn + if self.warns_of_stability { WARNING_BAND } else { 0.0 };
        self.warns_of_stability = seen.margin < quiet_at;
        self.unstable_since = since(self.unstable_since, !stable, seen.now);
        let model_error = seen.model_converged.then_some(seen.pose_error);
        self.monitors.take(&seen.sample, seen.now, model_error, seen.verdict);
        self.trust.observe(seen, self.monitors.doubt());
    }

    /// A motion begins: what it may lose depends on the margin with which it begins.
    pub fn note_motion(&mut self, seen: &Observation) {
        self.margin_allowed = margin_allowed(self.limits.stability_hold, seen.margin);
    }

    /// True when the margin of stability has fallen below what the present motion may come to.
    #[must_use]
    pub fn is_near_snap(&self, seen: &Observation) -> bool {
        seen.model_converged && seen.margin < self.margin_allowed
    }

    /// True when the newest poses are those of a rod that is where the model has it.
    #[must_use]
    pub fn believes_poses(&self) -> bool {
        self.trust.pose_is_believed()
    }

    /// True when the margin of stability is to be warned of.
    #[must_use]
    pub fn warns_of_stability(&self) -> bool {
        self.warns_of_stability
    }

    /// Remembers which life of driver and sensor granted authority: another one has to be armed anew.
    pub fn note_grant(&mut self, seen: &Observation) {
        self.trust.note_grant(seen);
        self.monitors.note_grant();
    }

    /// The worst causes that stop the daemon in `state`; `epoch` is the one it holds.
    #[must_use]
    pub fn trip(&self, state: &State, epoch: u64, seen: &Observation) -> Found {
        let mut found = Found::default();
        found.add(self.mode, self.disabling_cause(state, seen));
        // While a stop holds currents they are watched as those of a steering loop are.
        let holds = matches!(state, State::SafeStop { hold_until, .. } if seen.now < *hold_until);
        if state.holds_authority() || holds {
            self.authority_causes(epoch, seen).into_iter().for_each(|cause| found.add(self.mode, cause));
        }
        if matches!(state, State::Active | State::Holding { .. }) {
            self.steering_causes(state, seen).into_iter().for_each(|cause| found.add(self.mode, cause));
        }
        found
    }

    fn disabling_cause(&self, state: &State, seen: &Observation) -> Option<Cause> {
        let driver = seen.driver.as_ref()?;
        if *state == State::Boot {
            return None;
        }
        if driver.over_current {
            return Some(Cause::OverCurrent);
        }
        if driver.fault != 0 {
            return Some(Cause::DriverFault);
        }
        let cut = state.holds_authority() && driver.state == driver_state::DISABLED;
        cut.then_some(Cause::DriverDisabled)
    }

    fn authority_causes(&self, epoch: u64, seen: &Observation) -> [Option<Cause>; 7] {
        let Some(driver) = seen.fresh_driver(self.limits.feedback_stop) else {
            // Nothing else can be told without it.
            return [Some(Cause::FeedbackStale), None, None, None, None, None, None];
        };
        let obeys = driver.epoch == epoch && driver.state == driver_state::DRIVEN;
        let lost = !obeys || self.trust.driver_restarted(seen);
        // Before the driver's own watchdog acts, which would be taken for lost authority.
        let failing = lasted(self.write_failing_since, seen.now, self.limits.command_validity / 2);
        [
            self.trust.is_astray().then_some(Cause::NotFollowing),
            self.monitors.actuation_cause(),
            lost.then_some(Cause::AuthorityLost),
            self.trust.echo_stands_still(seen).then_some(Cause::FeedbackStale),
            seen.description_mismatch.then_some(Cause::DescriptionMismatch),
            failing.then_some(Cause::CommandNotSent),
            self.overruns.is_full().then_some(Cause::Overruns),
        ]
    }

    fn steering_causes(&self, state: &State, seen: &Observation) -> [Option<Cause>; 7] {
        let not_finite = state.is_engaged() && !seen.request_finite;
        let without_model = lasted(self.model_unusable_since, seen.now, self.limits.model_stop);
        let unstable = lasted(self.unstable_since, seen.now, self.limits.stability_stop_time);
        [
            not_finite.then_some(Cause::RequestNotFinite),
            without_model.then(|| model_cause(seen)),
            unstable.then_some(Cause::StabilityLost),
            self.trust.sensor_restarted(seen).then_some(Cause::SensorRestarted),
            // That there are none acts in every mode, that they are doubtful does not.
            seen.pose_age().is_none_or(|age| age > self.limits.pose_stop).then_some(Cause::PoseStale),
            self.lacks_poses(seen, self.limits.pose_stop),
            self.monitors.steering_cause(seen.now),
        ]
    }

    /// Why there are no poses that were true within `limit` and can be believed.
    fn lacks_poses(&self, seen: &Observation, limit: Duration) -> Option<Cause> {
        if self.trust.poses_within(seen, limit) {
            return None;
        }
        let is_fresh = seen.pose_age().is_some_and(|age| age <= limit);
        let doubted = self.trust.disbelief(seen.now).filter(|_| is_fresh);
        Some(doubted.unwrap_or(Cause::PoseStale))
    }

    /// Why there are no poses to start from: whatever the mode, they are believed.
    #[must_use]
    fn lacks_poses_to_start(&self, seen: &Observation) -> Option<Cause> {
        self.lacks_poses(seen, self.limits.pose_hold)
    }

    /// Why the loop holds for want of poses. A passive daemon does not hold for those that it doubts.
    #[must_use]
    pub fn lost_sensing(&self, seen: &Observation) -> Option<Cause> {
        self.lacks_poses_to_start(seen).filter(|cause| self.mode == Mode::Active || !is_monitor(*cause))
    }

    /// Why the daemon may not take authority now.
    #[must_use]
    pub fn forbids_arming(&self, realtime_missing: bool, seen: &Observation) -> Option<Cause> {
        if realtime_missing {
            return Some(Cause::RealtimeMissing);
        }
        if let Some(cause) = self.forbids_leaving_boot(seen) {
            return Some(cause);
        }
        if let Some(cause) = self.lacks_poses_to_start(seen) {
            return Some(cause);
        }
        if self.monitors.is_hot() {
            return Some(Cause::CoilOverheated);
        }
        let driver = seen.driver.as_ref()?;
        // A claim also puts cut amplifiers back to work; what cut them was reset before.
        let waiting = matches!(driver.state, driver_state::IDLE | driver_state::DISABLED);
        let idle = waiting && driver.current_max < self.limits.ramp_done;
        (!idle).then_some(Cause::DriverBusy)
    }

    /// Why the daemon may not start to steer now.
    #[must_use]
    pub fn forbids_steering(&self, seen: &Observation) -> Option<Cause> {
        if let Some(cause) = self.lacks_poses_to_start(seen) {
            return Some(cause);
        }
        (!seen.model_converged || !seen.field_valid).then(|| model_cause(seen))
    }

    /// Why the daemon does not leave `Boot`.
    #[must_use]
    pub fn forbids_leaving_boot(&self, seen: &Observation) -> Option<Cause> {
        if seen.description_mismatch {
            return Some(Cause::DescriptionMismatch);
        }
        seen.fresh_driver(self.limits.feedback_stop).is_none().then_some(Cause::FeedbackStale)
    }

    /// The table of when causes are over: true while the reason for a fault still holds, so that a reset is refused.
    #[must_use]
    pub fn persists(&self, cause: Cause, seen: &Observation) -> bool {
        let driver = seen.driver.as_ref();
        match cause {
            Cause::PoseStale | Cause::PoseImplausible | Cause::PoseOutsideWorkspace | Cause::PoseTooFast => {
                self.lacks_poses_to_start(seen).is_some()
            }
            Cause::ModelNotConverged => !seen.model_converged,
            Cause::FieldModelInvalid => !seen.field_valid,
            Cause::ModelOff => seen.model_converged && self.monitors.model_is_off(seen.pose_error),
            Cause::Overruns => self.overruns.is_half_full(),
            Cause::FeedbackStale => seen.fresh_driver(self.limits.feedback_stop).is_none(),
            Cause::DescriptionMismatch => seen.description_mismatch,
            Cause::CoilOverheated => self.monitors.is_hot(),
            Cause::RampTimeout => !self.is_at_rest(seen),
            Cause::DriverFault => driver.is_none_or(|driver| driver.fault != 0),
            Cause::OverCurrent => driver.is_none_or(|driver| driver.over_current),
            // Events: over once they happened. What can be seen of them only while current flows is found again.
            Cause::CommandNotSent
            | Cause::RequestNotFinite
            | Cause::AuthorityLost
            | Cause::SensorRestarted
            | Cause::NotFollowing
            | Cause::StabilityLost
            | Cause::CoilOpen
            | Cause::NotProgressing
            | Cause::DriverDisabled
            | Cause::EmergencyStop => false,
            // No fault is latched for these.
            Cause::WrongState
            | Cause::UnknownVerb
            | Cause::TargetInvalid
            | Cause::Busy
            | Cause::NotRecording
            | Cause::OnlyWatched
            | Cause::RealtimeMissing
            | Cause::ArmTimeout
            | Cause::DriverBusy
            | Cause::Ending
            | Cause::TargetCrossesSnapThrough
            | Cause::TargetOutsideField
            | Cause::NearSnapThrough
            | Cause::Retreating
            | Cause::OperatorStop
            | Cause::StreamEnded
            | Cause::Terminated => false,
        }
    }

    /// What the monitors counted.
    #[must_use]
    pub fn report(&self) -> MonitorReport {
        self.monitors.report()
    }

    /// Heat of the hottest coil, 1 at its limit, and whether it is to be warned of.
    #[must_use]
    pub fn heat(&self) -> (f64, bool) {
        (self.monitors.heat(), self.monitors.is_hot())
    }

    /// Whether monitors act.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// True when fresh feedback shows no current in any coil.
    #[must_use]
    pub fn is_at_rest(&self, seen: &Observation) -> bool {
        let driver = seen.fresh_driver(self.limits.feedback_stop);
        driver.is_some_and(|driver| driver.current_max < self.limits.ramp_done)
    }

    /// The limits in force.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }
}

fn model_cause(seen: &Observation) -> Cause {
    if seen.field_valid { Cause::ModelNotConverged } else { Cause::FieldModelInvalid }
}

/// Begin of an unbroken run of `wrong`.
fn since(begin: Option<Stamp>, wrong: bool, now: Stamp) -> Option<Stamp> {
    if wrong { begin.or(Some(now)) } else { None }
}

/// True when something that began then has lasted for longer than `limit`.
pub(super) fn lasted(begin: Option<Stamp>, now: Stamp, limit: Duration) -> bool {
    begin.is_some_and(|begin| now.since(begin) > limit)
}
