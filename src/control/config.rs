//! `[control]` of the configuration file.

use magsteer_hal::invalid::{Checks, Invalid};
use magsteer_hal::{HardwareDescription, POSE_PARAMETERS_MAX};
use serde::{Deserialize, Serialize};

use super::algorithm_1::{Algorithm1Config, JacobianKind};
use super::allocation::AllocationKind;
use super::disturbance::DisturbanceConfig;
use super::error::OrientationErrorKind;
use super::feedback::FeedbackKind;
use super::gains::GainsConfig;
use super::plan::PlanConfig;
use super::scout::ScoutConfig;
use super::secondary::{MarginGuardConfig, SecondaryConfig};

/// `[control]`: the law from error to actuation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlConfig {
    /// `"tangent-plane"`, or `"axis-angle"` for the paper's eq. (17).
    pub orientation_error: OrientationErrorKind,
    /// `"exact"`, or `"algorithm-1"` for the paper's Jacobian by boundary-value problems with frozen wrenches.
    pub jacobian: JacobianKind,
    /// How Algorithm 1 works; needed when it is chosen.
    pub algorithm_1: Option<Algorithm1Config>,
    /// Time constant of the low-pass through which the model sees the measured currents, ms, 0 to 100; 0 takes them as they are.
    pub measured_current_time_constant_ms: f64,
    /// `"delayed-reference"`, or `"disturbance-estimate"` to steer by the model with its bias estimated.
    pub feedback: FeedbackKind,
    /// Proportional gain on measurements, 1/s, > 0; for `"delayed-reference"`.
    pub proportional_per_s: f64,
    /// Integral gain, 1/s^2, >= 0; for `"delayed-reference"`.
    pub integral_per_s2: f64,
    /// How the model's bias is estimated; needed when it is chosen.
    pub disturbance: Option<DisturbanceConfig>,
    /// How the gains of the coils are learnt; without it they are those of the description, and also where the bias is not estimated or
    /// the Jacobian is Algorithm 1's, which knows none.
    pub gains: Option<GainsConfig>,
    /// Greatest speed of each direction's reference, deg/s, > 0. Frame angles keep the speed of the rig's
    /// description.
    pub reference_speed_max_deg_per_s: f64,
    /// Greatest acceleration of each direction's reference, deg/s^2, > 0.
    pub reference_acceleration_max_deg_per_s2: f64,
    /// Greatest acceleration of each frame angle's reference, deg/s^2, > 0.
    pub reference_frame_acceleration_max_deg_per_s2: f64,
    /// Time constant of each of the two lags that round off the reference, ms, >= 0.
    pub reference_time_constant_ms: f64,
    /// By how much the manipulator lags behind a changed actuation (amplifiers, first mode), ms, 0 to 400: measured
    /// poses are compared with what was desired that long before they were true. For `"delayed-reference"`.
    pub response_delay_ms: f64,
    /// `"bounded"`, or `"truncated-svd"` for the paper's eqs. (18) and (19).
    pub allocation: AllocationKind,
    /// Singular values are used while the largest over them stays below this; (19).
    pub singular_ratio_max: f64,
    /// Damping of the bounded allocation, > 0: a direction in which full-scale actuation turns the magnets
    /// by less than the square root of this, in radians, is given up gradually.
    pub damping: f64,
    /// Rate at which currents decay in directions that do not turn the magnets, 1/s, >= 0.
    pub current_release_per_s: f64,
    /// Determinant of the residual's Jacobian below which the actuation stiffens the rod, where the targets leave room, 0 to 10;
    /// 1 is the unloaded rod, 0 a snap-through.
    pub determinant_wanted: f64,
    /// Rate at which a lost determinant is regained, 1/s, >= 0.
    pub determinant_rate_per_s: f64,
    /// `"steer"` to turn the frames, `"hold"` to leave them where they are.
    pub frame_angles: FrameUse,
    /// What moves the frames while the currents hold the targets; needed where frames steer.
    pub secondary: Option<SecondaryConfig>,
    /// What keeps currents that turn nothing from leading fast towards a snap-through; for `allocation = "bounded"`.
    pub margin_guard: Option<MarginGuardConfig>,
    /// Most shooting passes in one cycle, 1 to 20.
    pub passes_max: u32,
    /// How frame angles are planned; needed by what plans.
    pub plan: Option<PlanConfig>,
    /// How the way to a new target is looked at before the reference goes there; without it every target is gone to.
    pub scout: Option<ScoutConfig>,
}

/// Whether the frame angles take part in steering.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrameUse {
    /// Frames turn to where the currents have it easier, and help them where they are exhausted.
    Steer,
    /// Frames stay.
    Hold,
}

impl ControlConfig {
    /// Where the frames of `description` stand while nothing steers them, rad: at home where they are steered, else at zero.
    #[must_use]
    pub fn resting_frames(&self, description: &HardwareDescription) -> [f64; POSE_PARAMETERS_MAX] {
        let mut angles = [0.0; POSE_PARAMETERS_MAX];
        let steered = self.secondary.as_ref().filter(|_| self.frame_angles == FrameUse::Steer);
        for (angle, home) in angles.iter_mut().zip(steered.iter().flat_map(|tasks| tasks.home(description))) {
            *angle = home;
        }
        angles
    }

    /// Time constant of the low-pass through which the model sees the measured currents, s.
    pub(super) fn measured_current_time_constant(&self) -> f64 {
        self.measured_current_time_constant_ms * 1e-3
    }

    /// Every value out of its range, keyed from the root of the file; none when the section is usable.
    #[must_use]
    pub fn check(&self) -> Vec<Invalid> {
        let mut checks = Checks::new();
        let smoothing = self.measured_current_time_constant_ms;
        checks.within("control.measured_current_time_constant_ms", smoothing, 0.0, 100.0);
        checks.within("control.proportional_per_s", self.proportional_per_s, 1e-3, 1e3);
        checks.within("control.integral_per_s2", self.integral_per_s2, 0.0, 1e4);
        checks.within("control.reference_speed_max_deg_per_s", self.reference_speed_max_deg_per_s, 0.1, 1e5);
        let [acceleration, frame_acceleration] =
            [self.reference_acceleration_max_deg_per_s2, self.reference_frame_acceleration_max_deg_per_s2];
        checks.within("control.reference_acceleration_max_deg_per_s2", acceleration, 0.1, 1e7);
        checks.within("control.reference_frame_acceleration_max_deg_per_s2", frame_acceleration, 0.1, 1e7);
        checks.within("control.reference_time_constant_ms", self.reference_time_constant_ms, 0.0, 1e4);
        checks.within("control.response_delay_ms", self.response_delay_ms, 0.0, 400.0);
        checks.within("control.singular_ratio_max", self.singular_ratio_max, 1.0, 1e12);
        checks.within("control.damping", self.damping, 1e-12, 1.0);
        checks.within("control.current_release_per_s", self.current_release_per_s, 0.0, 100.0);
        checks.within("control.determinant_wanted", self.determinant_wanted, 0.0, 10.0);
        checks.within("control.determinant_rate_per_s", self.determinant_rate_per_s, 0.0, 1e3);
        checks.within("control.passes_max", f64::from(self.passes_max), 1.0, 20.0);
        let told = self.algorithm_1.is_some() || self.jacobian == JacobianKind::Exact;
        checks.require(told, "control.algorithm_1", "nothing", "given, since `jacobian` is \"algorithm-1\"");
        if let Some(algorithm_1) = &self.algorithm_1 {
            algorithm_1.check(&mut checks);
        }
        if let Some(plan) = &self.plan {
            plan.check(&mut checks);
        }
        let told = self.secondary.is_some() || self.frame_angles == FrameUse::Hold;
        checks.require(told, "control.secondary", "nothing", "given, since `frame_angles` is \"steer\"");
        if let Some(secondary) = &self.secondary {
            secondary.check(&mut checks);
        }
        if let Some(guard) = &self.margin_guard {
            guard.check(&mut checks);
        }
        if let Some(scout) = &self.scout {
            scout.check(&mut checks);
        }
        let told = self.disturbance.is_some() || self.feedback == FeedbackKind::DelayedReference;
        checks.require(
            told,
            "control.disturbance",
            "nothing",
            "given, since `feedback` is \"disturbance-estimate\"",
        );
        if let Some(disturbance) = &self.disturbance {
            disturbance.check(&mut checks);
        }
        if let Some(gains) = &self.gains {
            gains.check(&mut checks);
        }
        checks.into_result(()).err().unwrap_or_default()
    }

    /// What does not fit the rig of `description`, keyed from the root of the file.
    #[must_use]
    pub fn check_rig(&self, description: &HardwareDescription) -> Vec<Invalid> {
        let secondary = self.secondary.iter().flat_map(|secondary| secondary.check_rig(description));
        secondary.chain(self.plan.iter().flat_map(|plan| plan.check_rig(description))).collect()
    }
}
