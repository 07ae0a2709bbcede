//! Limits of coils and frames in fixed-size arrays, as the gate and the driver's guard use them.
//!
//! Data only: the gate and the guard each apply it by a rule of their own, so that a mistake in one
//! is caught by the other.

use crate::description::HardwareDescription;
use crate::message::{Actuation, COILS_MAX, POSE_PARAMETERS_MAX};

/// Limits of one rig. A limit that is not a positive finite number counts as zero: nothing may flow.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Limits {
    pub(crate) coil_count: usize,
    pub(crate) frame_count: usize,
    /// A
    pub(crate) current_max: [f64; COILS_MAX],
    /// A/s
    pub(crate) slew_max: [f64; COILS_MAX],
    /// rad
    pub(crate) angle_min: [f64; POSE_PARAMETERS_MAX],
    /// rad
    pub(crate) angle_max: [f64; POSE_PARAMETERS_MAX],
    /// rad/s
    pub(crate) speed_max: [f64; POSE_PARAMETERS_MAX],
}

impl Limits {
    /// Takes the limits out of a description; entries past the capacities are left out.
    pub(crate) fn new(description: &HardwareDescription) -> Self {
        let mut limits = Self {
            coil_count: description.coils.len().min(COILS_MAX),
            frame_count: description.frames.len().min(POSE_PARAMETERS_MAX),
            current_max: [0.0; COILS_MAX],
            slew_max: [0.0; COILS_MAX],
            angle_min: [0.0; POSE_PARAMETERS_MAX],
            angle_max: [0.0; POSE_PARAMETERS_MAX],
            speed_max: [0.0; POSE_PARAMETERS_MAX],
        };
        for (index, coil) in description.coils.iter().take(COILS_MAX).enumerate() {
            limits.current_max[index] = positive(coil.current_max);
            limits.slew_max[index] = positive(coil.slew_max);
        }
        for (index, frame) in description.frames.iter().take(POSE_PARAMETERS_MAX).enumerate() {
            if frame.angle_min.is_finite() && frame.angle_max >= frame.angle_min {
                limits.angle_min[index] = frame.angle_min;
                limits.angle_max[index] = frame.angle_max;
            }
            limits.speed_max[index] = positive(frame.speed_max);
        }
        limits
    }

    /// The nearest actuation within magnitude and range. An entry that is not a number becomes zero
    /// (currents) or that of `otherwise` (angles); unused entries become zero.
    pub(crate) fn nearest(&self, actuation: &Actuation, otherwise: &Actuation) -> Actuation {
        let mut nearest = Actuation::default();
        for coil in 0..self.coil_count {
            let current = actuation.current_a[coil];
            let limit = self.current_max[coil];
            nearest.current_a[coil] = if current.is_nan() { 0.0 } else { between(current, -limit, limit) };
        }
        for frame in 0..self.frame_count {
            let angle = actuation.angle_rad[frame];
            let angle = if angle.is_nan() { otherwise.angle_rad[frame] } else { angle };
            nearest.angle_rad[frame] = between(angle, self.angle_min[frame], self.angle_max[frame]);
        }
        nearest
    }
}

/// `value` held within `[least, most]`. Unlike [`f64::clamp`] it cannot panic.
pub(crate) fn between(value: f64, least: f64, most: f64) -> f64 {
    value.max(least).min(most)
}

/// `period` in seconds when it is a usable one, else zero: nothing moves.
pub(crate) fn usable_period(period: f64) -> f64 {
    if period.is_finite() { period.max(0.0) } else { 0.0 }
}

fn positive(limit: f64) -> f64 {
    if limit.is_finite() { limit.max(0.0) } else { 0.0 }
}
