//! All monitors together: what they see of a cycle, and what they make of it.

use std::time::Duration;

use magsteer_hal::message::Header;
use magsteer_hal::operator::Cause;
use magsteer_hal::{Absent, Actuation, HardwareDescription, PoseMessage, Stamp};
use serde::{Deserialize, Serialize};

use super::config::MonitorLimits;
use super::following::Following;
use super::heat::Heat;
use super::poses::PoseSanity;
use super::progress::Progress;
use super::sequence::{Counter, SequenceCounts};
use crate::control::{Directions, Verdict};

/// What the monitors see of a cycle beyond what everybody sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Newest valid poses.
    pub pose: Option<PoseMessage>,
    /// True when they came in this cycle.
    pub pose_is_fresh: bool,
    /// Time between them and the ones before, when they are fresh.
    pub pose_interval: Duration,
    /// Why poses were refused in this cycle.
    pub pose_refused: Option<Absent>,
    /// Header of the newest valid feedback, when it came in this cycle.
    pub feedback: Option<Header>,
    /// Why feedback was refused in this cycle.
    pub feedback_refused: Option<Absent>,
    /// Newest measured currents and angles.
    pub measured: Option<Actuation>,
    /// Currents and angles commanded last.
    pub commanded: Actuation,
    /// Measured directions as the controller has them.
    pub seen_by_controller: Directions,
    /// Directions that it steers to in the end.
    pub target: Directions,
    /// Actuation parameters at a limit of value or rate.
    pub saturated: u32,
    /// True while the loop is closed.
    pub engaged: bool,
}

/// What the monitors counted.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct MonitorReport {
    /// Greatest heat of a coil so far; 1 is its limit.
    pub coil_heat_max: f64,
    /// Messages of poses.
    pub poses: SequenceCounts,
    /// Messages of feedback.
    pub feedback: SequenceCounts,
    /// Messages of poses that were outside of the workspace or too fast.
    pub poses_doubted: u64,
}

/// Memory of all monitors.
#[derive(Debug, Clone)]
pub struct Monitors {
    limits: MonitorLimits,
    following: Following,
    heat: Heat,
    poses: PoseSanity,
    progress: Progress,
    pose_counter: Counter,
    feedback_counter: Counter,
    poses_doubted: u64,
    heat_max: f64,
    previous: Option<Stamp>,
    doubt: Option<Cause>,
}

impl Monitors {
    /// Nothing seen so far.
    #[must_use]
    pub fn new(limits: MonitorLimits, rig: &HardwareDescription) -> Self {
        Self {
            limits,
            following: Following::default(),
            heat: Heat::default(),
            poses: PoseSanity::new(rig),
            progress: Progress::default(),
            pose_counter: Counter::default(),
            feedback_counter: Counter::default(),
            poses_doubted: 0,
            heat_max: 0.0,
            previous: None,
            doubt: None,
        }
    }

    /// Takes one cycle. `model_error` is the greatest angle between measured and predicted directions, rad, where the
    /// model found an equilibrium.
    pub fn take(&mut self, sample: &Sample, now: Stamp, model_error: Option<f64>, verdict: Verdict) {
        let elapsed = self.previous.map_or(Duration::ZERO, |previous| now.since(previous));
        self.previous = Some(now);
        let fresh_pose = sample.pose.filter(|_| sample.pose_is_fresh);
        self.pose_counter.take(fresh_pose.as_ref().map(|pose| &pose.header), sample.pose_refused);
        self.feedback_counter.take(sample.feedback.as_ref(), sample.feedback_refused);
        self.doubt = fresh_pose.and_then(|pose| self.poses.take(&self.limits, &pose));
        self.poses_doubted += u64::from(self.doubt.is_some());
        if let Some(measured) = &sample.measured {
            self.following.take(&self.limits, measured, &sample.commanded, elapsed);
            // Over a pause the current was what it is now, as far as anybody knows.
            self.heat.take(&self.limits, &measured.current_a, elapsed.as_secs_f64());
            self.heat_max = self.heat_max.max(self.heat.greatest());
        }
        self.progress.take(&self.limits, sample, model_error, verdict, now, elapsed);
    }

    /// What went astray before is no concern of a new holder of authority; heat is.
    pub fn note_grant(&mut self) {
        self.following = Following::default();
        self.progress = Progress::default();
    }

    /// Why the poses of this cycle cannot be a rod's.
    #[must_use]
    pub const fn doubt(&self) -> Option<Cause> {
        self.doubt
    }

    /// What is wrong with currents and angles, for whoever holds authority; the worst.
    #[must_use]
    pub fn actuation_cause(&self) -> Option<Cause> {
        let overheated = (self.heat() >= 1.0).then_some(Cause::CoilOverheated);
        let open = self.following.is_open(&self.limits).then_some(Cause::CoilOpen);
        let off = self.following.is_off(&self.limits).then_some(Cause::NotFollowing);
        overheated.max(open).max(off)
    }

    /// What is wrong with the steering; the worst.
    #[must_use]
    pub fn steering_cause(&self, now: Stamp) -> Option<Cause> {
        let stuck = self.progress.is_missing(&self.limits, now).then_some(Cause::NotProgressing);
        let off = self.progress.model_is_off(&self.limits).then_some(Cause::ModelOff);
        stuck.max(off)
    }

    /// Heat of the hottest coil; 1 is its limit.
    #[must_use]
    pub fn heat(&self) -> f64 {
        self.heat.greatest()
    }

    /// True while the heat of a coil is to be warned of, and authority is not to be taken.
    #[must_use]
    pub fn is_hot(&self) -> bool {
        self.heat() > self.limits.heat_warn
    }

    /// True while measured and predicted directions differ by more than they may for long.
    #[must_use]
    pub fn model_is_off(&self, model_error: f64) -> bool {
        model_error > self.limits.model_error
    }

    /// What was counted so far.
    #[must_use]
    pub fn report(&self) -> MonitorReport {
        MonitorReport {
            coil_heat_max: self.heat_max,
            poses: self.pose_counter.counts(),
            feedback: self.feedback_counter.counts(),
            poses_doubted: self.poses_doubted,
        }
    }
}
