//! Allocation: from a wanted velocity of the error's rows to increments of currents and frame angles.
//!
//! | symbol | meaning |
//! |---|---|
//! | `J` | orientation Jacobian (16), rows per ampere and per radian |
//! | `s` | range of each actuation parameter: greatest current; of a frame its greatest turn, or its share |
//! | `x` | increment over range |
//! | `dPhi` | wanted orientation step |
//!
//! Method `bounded`: minimise `|J s x - dPhi|^2 + d |x - x_pref|^2` within the limits on value and rate. `x_pref` lies in the null space of
//! `J s`: it is what the secondary tasks want (`secondary.rs`). A frame's range is its share: small, so that the currents turn the magnets as long as they can.
//! Method `truncated-svd`: eqs. (18) and (19) over parameters scaled by their whole ranges, then the whole step shortened until the first limit is met; no secondary
//! tasks. Scaling is a deviation from (18), which mixes amperes and radians.

use magsteer_hal::{Actuation, HardwareDescription, POSE_PARAMETERS_MAX};
use serde::{Deserialize, Serialize};

use super::config::{ControlConfig, FrameUse};
use super::secondary::{SecondaryTasks, stopping_speed};
use crate::math::{BoundedLeastSquares, BoundedProblem, ThinSvd};

/// How increments are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AllocationKind {
    /// Least squares within the limits.
    Bounded,
    /// The paper's truncated pseudoinverse.
    TruncatedSvd,
}

/// Limits of one actuation parameter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    least: f64,
    most: f64,
    /// Rate that steering may use; 0 for what it may not move.
    pub(super) rate: f64,
    /// Rate that the parameter is capable of.
    speed: f64,
    /// Range by which the parameter is scaled.
    pub(super) range: f64,
    /// Of its rate; infinite where it is no matter.
    acceleration: f64,
}

/// What one cycle wants.
#[derive(Debug, Clone, Copy)]
pub struct Wish<'a> {
    /// Orientation Jacobian by rows, rad/A and rad/rad.
    pub jacobian: &'a [f64],
    /// Orientation step of each row, rad.
    pub step: &'a [f64],
    /// Present currents and angles.
    pub admitted: &'a Actuation,
    /// Time since the previous cycle, s.
    pub period: f64,
    /// Determinant of the residual's Jacobian.
    pub determinant: f64,
    /// Its change with each parameter, 1/A and 1/rad.
    pub determinant_gradient: &'a [f64],
    /// Margin of stability and its change with each parameter, 1/A and 1/rad; none where it is not followed.
    pub margin: Option<(f64, &'a [f64])>,
    /// Expected power (p1), A^2, and the change of its logarithm with each parameter, 1/A and 1/rad; none where it is not followed.
    pub expected_power: Option<(f64, &'a [f64])>,
    /// Where the frames shall be at the end of the cycle, rad: they go there as far as their speed lets them, and the currents undo
    /// what that does to the magnets. `None` where the frames are the allocation's own.
    pub frame_angles: Option<&'a [f64; POSE_PARAMETERS_MAX]>,
}

/// What an allocation did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allocated {
    /// Ratio of the largest to the smallest singular value in use of the scaled Jacobian, of its currents alone by `bounded`.
    pub condition: f64,
    /// Parameters at a limit.
    pub saturated: u32,
}

/// Allocator for one rig.
#[derive(Debug, Clone)]
pub struct Allocation {
    kind: AllocationKind,
    damping: f64,
    ratio_max: f64,
    coils: usize,
    limits: Vec<Limits>,
    solver: BoundedLeastSquares,
    secondary: SecondaryTasks,
    svd: ThinSvd,
    scaled: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    increment: Vec<f64>,
    /// The wanted step less what prescribed turns of the frames do.
    step: Vec<f64>,
}

impl Allocation {
    /// An allocator for `rows` rows of error on the rig of `description`.
    #[must_use]
    pub fn new(config: &ControlConfig, description: &HardwareDescription, rows: usize) -> Self {
        let currents = description.coils.iter().map(|coil| Limits {
            least: -coil.current_max,
            most: coil.current_max,
            rate: coil.slew_max,
            speed: coil.slew_max,
            range: coil.current_max,
            acceleration: f64::INFINITY,
        });
        let held = config.frame_angles == FrameUse::Hold;
        let secondary = config.secondary.as_ref().filter(|_| config.allocation == AllocationKind::Bounded);
        let angles = description.frames.iter().map(|frame| Limits {
            least: frame.angle_min,
            most: frame.angle_max,
            rate: if held { 0.0 } else { frame.speed_max },
            speed: frame.speed_max,
            range: secondary.map_or(frame.angle_max.abs().max(frame.angle_min.abs()), |secondary| {
                secondary.frame_share_deg.to_radians()
            }),
            acceleration: config.reference_frame_acceleration_max_deg_per_s2.to_radians(),
        });
        let limits: Vec<Limits> = currents.chain(angles).collect();
        let unknowns = limits.len();
        Self {
            kind: config.allocation,
            damping: config.damping,
            ratio_max: config.singular_ratio_max,
            coils: description.coils.len(),
            limits,
            solver: BoundedLeastSquares::new(rows, unknowns),
            secondary: SecondaryTasks::new(config, description, rows),
            svd: ThinSvd::new(rows, unknowns),
            scaled: vec![0.0; rows * unknowns],
            lower: vec![0.0; unknowns],
            upper: vec![0.0; unknowns],
            increment: vec![0.0; unknowns],
            step: vec![0.0; rows],
        }
    }

    /// Chooses the increments for one cycle. They are then in [`Self::increment`].
    pub fn allocate(&mut self, wish: &Wish<'_>) -> Allocated {
        let unknowns = self.limits.len();
        for (scaled, row) in self.scaled.chunks_exact_mut(unknowns).zip(wish.jacobian.chunks_exact(unknowns))
        {
            for ((entry, value), limits) in scaled.iter_mut().zip(row).zip(&self.limits) {
                // A parameter that may not move is none: it must not take a share of the step.
                *entry = if limits.rate > 0.0 { value * limits.range } else { 0.0 };
            }
        }
        self.bound(wish);
        self.step.copy_from_slice(wish.step);
        if let Some(angles) = wish.frame_angles {
            self.prescribe(angles, wish);
        }
        let (condition, saturated) = match self.kind {
            AllocationKind::Bounded => self.bounded(wish),
            AllocationKind::TruncatedSvd => self.truncated(),
        };
        if let Some(angles) = wish.frame_angles {
            for frame in self.coils..self.limits.len() {
                self.increment[frame] = self.prescribed(frame, angles, wish);
            }
        }
        self.secondary.note(&self.increment, &self.limits, wish.period);
        for (increment, limits) in self.increment.iter_mut().zip(&self.limits) {
            *increment *= limits.range;
        }
        Allocated { condition, saturated }
    }

    /// To be called while nothing is allocated: the frames then set out from standstill.
    pub fn rest(&mut self) {
        self.secondary.rest();
    }

    /// Increments chosen last, A then rad.
    #[must_use]
    pub fn increment(&self) -> &[f64] {
        &self.increment
    }

    /// The box of this cycle.
    fn bound(&mut self, wish: &Wish<'_>) {
        let present = wish.admitted.current_a[..self.coils].iter().chain(&wish.admitted.angle_rad);
        for (index, (limits, present)) in self.limits.iter().zip(present).enumerate() {
            let rate = |distance: f64| limits.rate.min(stopping_speed(distance, limits.acceleration));
            let [below, above] = [present - limits.least, limits.most - present];
            let lower = (-below).max(-rate(below) * wish.period).min(0.0);
            let upper = above.min(rate(above) * wish.period).max(0.0);
            self.lower[index] = lower / limits.range;
            self.upper[index] = upper / limits.range;
        }
    }

    /// Turn of a frame that was asked for, over its range, within its limits.
    fn prescribed(&self, parameter: usize, angles: &[f64; POSE_PARAMETERS_MAX], wish: &Wish<'_>) -> f64 {
        let (limits, frame) = (&self.limits[parameter], parameter - self.coils);
        let present = wish.admitted.angle_rad[frame];
        let reach = limits.speed * wish.period;
        let turn = (angles[frame].clamp(limits.least, limits.most) - present).clamp(-reach, reach);
        turn / limits.range
    }

    /// Leaves to the currents what turning the frames as asked does to the magnets.
    fn prescribe(&mut self, angles: &[f64; POSE_PARAMETERS_MAX], wish: &Wish<'_>) {
        let unknowns = self.limits.len();
        for parameter in self.coils..unknowns {
            let turn = self.prescribed(parameter, angles, wish) * self.limits[parameter].range;
            let rows = self.scaled.chunks_exact_mut(unknowns).zip(wish.jacobian.chunks_exact(unknowns));
            for (step, (scaled, row)) in self.step.iter_mut().zip(rows) {
                *step -= row[parameter] * turn;
                scaled[parameter] = 0.0;
            }
            self.lower[parameter] = 0.0;
            self.upper[parameter] = 0.0;
        }
    }

    /// Condition and parameters at a limit.
    fn bounded(&mut self, wish: &Wish<'_>) -> (f64, u32) {
        let (lower, upper) = (&mut self.lower, &mut self.upper);
        self.secondary.prefer(wish, &self.step, &self.scaled, &self.limits, lower, upper);
        let report = self.solver.solve(&BoundedProblem {
            matrix: &self.scaled,
            right: &self.step,
            damping: self.damping,
            preferred: self.secondary.preferred(),
            lower: &self.lower,
            upper: &self.upper,
        });
        self.increment.copy_from_slice(self.solver.solution());
        (self.secondary.condition(), report.at_bound)
    }

    fn truncated(&mut self) -> (f64, u32) {
        self.svd.decompose(&self.scaled);
        self.svd.pseudo_solve(&self.step, self.ratio_max, &mut self.increment); // (18), (19)
        let mut fraction = 1.0_f64;
        let mut saturated = 0;
        for ((x, lower), upper) in self.increment.iter().zip(&self.lower).zip(&self.upper) {
            let bound = if *x < 0.0 { *lower } else { *upper };
            if x.abs() > bound.abs() {
                saturated += 1;
                fraction = fraction.min(bound / x);
            }
        }
        for x in &mut self.increment {
            *x *= fraction;
        }
        (self.svd.condition(self.ratio_max), saturated)
    }
}
