//! State and unknowns of one body; symbols and equation (i) are those of `dynamics`.

use nalgebra::Vector3;

use super::chain::Pose;
use super::rotation::exponential;

/// State and unknowns of one body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    pub(super) pose: Pose,
    /// `v`, world.
    pub(super) velocity: Vector3<f64>,
    /// `W`, body axes.
    pub(super) spin: Vector3<f64>,
    /// `d` of the running or last step.
    pub(super) shift: Vector3<f64>,
    /// `T` of the running or last step.
    pub(super) turn: Vector3<f64>,
    /// `d` and `T` of the step before, for the prediction.
    pub(super) shift_before: Vector3<f64>,
    pub(super) turn_before: Vector3<f64>,
    pub(super) shift_before_that: Vector3<f64>,
    pub(super) turn_before_that: Vector3<f64>,
    /// Half-way through the step.
    pub(super) half: Pose,
    /// At the end of the step.
    pub(super) end: Pose,
}

impl Motion {
    /// At rest in `pose`.
    pub(super) fn at_rest(pose: Pose) -> Self {
        let zero = Vector3::zeros();
        Self {
            pose,
            velocity: zero,
            spin: zero,
            shift: zero,
            turn: zero,
            shift_before: zero,
            turn_before: zero,
            shift_before_that: zero,
            turn_before_that: zero,
            half: pose,
            end: pose,
        }
    }

    /// Predicts that the step moves nothing.
    pub(super) fn start_from_no_motion(&mut self) {
        (self.shift, self.turn) = (Vector3::zeros(), Vector3::zeros());
        self.place();
    }

    /// Lets the next prediction be that of constant velocity.
    pub(super) fn expect_to_go_on(&mut self, step: f64) {
        (self.shift, self.turn) = (self.velocity * step, self.spin * step);
        (self.shift_before, self.turn_before) = (self.shift, self.turn);
        (self.shift_before_that, self.turn_before_that) = (self.shift, self.turn);
    }

    /// Puts the half-way and the end pose where the unknowns say.
    #[inline(always)]
    pub(super) fn place(&mut self) {
        let half = exponential(&(self.turn * 0.5));
        self.half =
            Pose { position: self.pose.position + self.shift * 0.5, rotation: self.pose.rotation * half };
        self.end = Pose { position: self.pose.position + self.shift, rotation: self.half.rotation * half };
    }

    /// Velocity and spin at the end of the step.
    #[inline(always)]
    pub(super) fn velocities_after(&self, step: f64, share: f64) -> (Vector3<f64>, Vector3<f64>) {
        let after = |increment: &Vector3<f64>, before: &Vector3<f64>| {
            (increment / step - before * (1.0 - share)) / share // (i)
        };
        (after(&self.shift, &self.velocity), after(&self.turn, &self.spin))
    }
}
