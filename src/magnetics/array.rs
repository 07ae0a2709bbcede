//! The coil array: coils on turning frames, its field at a point, and how that changes with each actuation parameter.
//!
//! # Terms
//! | symbol | meaning |
//! |---|---|
//! | `I_j`, `theta_f` | current of coil j, A; angle of frame f, rad |
//! | `w`, `q` | unit axis of a frame and a point on it (its pivot), world |
//! | `B_f`, `G_f`, `H_f` | field, gradient and second gradient of all coils on frame f at their currents |
//! | `t` | `w x (p - q)`, the velocity of a point carried by the frame, per rad/s |
//!
//! # Method
//! A frame turns the expansion point and the axis of its coils about `w` through `q`, eq. (8). Linear in the
//! currents, the columns of the currents are the fields of each coil for 1 A, eq. (9). Turning a source by
//! `dtheta` is seen at a fixed point as: go back by the turn, take the field there, turn it. To first order
//!
//! - `dB/dtheta = w x B_f - G_f t`
//! - `dG/dtheta = [w]x G_f - G_f [w]x - H_f t`
//!
//! which is exact and needs no differencing of angles. Nothing here allocates after construction.

use std::ops::AddAssign;

use magsteer_hal::description::{CoilDescription, FrameDescription, HardwareDescription};
use magsteer_hal::{COILS_MAX, POSE_PARAMETERS_MAX};
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

use super::multipole::{CoilField, CoilGroup, CoilPose, Multipole};
use super::sample::{AppliedField, FieldColumn, FieldGradient, FieldSample, FieldSecondGradient};
use crate::math::{Columnar, Lanes};

/// Coils that are evaluated together.
const WIDTH: usize = Lanes::WIDTH;
const GROUPS_MAX: usize = COILS_MAX.div_ceil(WIDTH);
/// Every group's lanes have their place among the coils.
const _: () = assert!(COILS_MAX.is_multiple_of(WIDTH));

/// Where coils fixed to the world gather their field: one place past the frames'.
const FIXED: usize = POSE_PARAMETERS_MAX;

/// A coil array at frame angles zero, as the description gives it; makes [`PosedArray`]s.
#[derive(Debug, Clone, PartialEq)]
pub struct CoilArray {
    rest: PosedArray,
}

/// A coil array at given frame angles.
#[derive(Debug, Clone, PartialEq)]
pub struct PosedArray {
    coil_count: usize,
    frame_count: usize,
    groups: [CoilGroup; GROUPS_MAX],
    /// Frame of each coil, or [`FIXED`].
    frame_of: [usize; COILS_MAX],
    valid_from_x: [f64; COILS_MAX],
    frames: [Frame; POSE_PARAMETERS_MAX],
}

/// A posed array carrying currents: a field that can be applied.
#[derive(Debug, Clone, Copy)]
pub struct ActuatedArray<'a> {
    posed: &'a PosedArray,
    currents: [f64; COILS_MAX],
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Frame {
    axis: Vector3<f64>,
    pivot: Vector3<f64>,
}

impl CoilArray {
    /// Precomputes the array of a validated description.
    ///
    /// # Panics
    /// When the description exceeds a capacity of `magsteer_hal` or names a frame that it does not have;
    /// validation has refused both.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        let HardwareDescription { coils, frames, .. } = description;
        assert!(coils.len() <= COILS_MAX, "{} coils: must be at most {COILS_MAX}", coils.len());
        assert!(frames.len() <= POSE_PARAMETERS_MAX, "{} frames: too many", frames.len());
        let mut rest = PosedArray {
            coil_count: coils.len(),
            frame_count: frames.len(),
            groups: [CoilGroup::default(); GROUPS_MAX],
            frame_of: [FIXED; COILS_MAX],
            valid_from_x: [f64::NEG_INFINITY; COILS_MAX],
            frames: [Frame::default(); POSE_PARAMETERS_MAX],
        };
        for (frame, description) in rest.frames.iter_mut().zip(frames) {
            *frame = Frame::new(description);
        }
        for (index, coil) in coils.iter().enumerate() {
            assert!(coil.frame.is_none_or(|frame| frame < frames.len()), "coil {index}: no such frame");
            rest.insert(index, coil);
        }
        Self { rest }
    }

    /// Number of coils N_I.
    #[must_use]
    pub fn coil_count(&self) -> usize {
        self.rest.coil_count
    }

    /// Number of frames N_theta.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.rest.frame_count
    }

    /// The array at frame angles `angles` (rad, one a frame in the description's order). Allocates nothing.
    /// Frames without an angle stay at zero; angles past the last frame are not read.
    #[must_use]
    pub fn posed(&self, angles: &[f64]) -> PosedArray {
        let mut posed = self.rest.clone();
        self.pose_into(angles, &mut posed);
        posed
    }

    /// As [`Self::posed`], into an array made earlier by this one: moves the coils and copies nothing else.
    pub fn pose_into(&self, angles: &[f64], posed: &mut PosedArray) {
        let mut rotations = [Rotation3::identity(); POSE_PARAMETERS_MAX];
        for ((rotation, frame), &angle) in rotations.iter_mut().zip(&self.rest.frames).zip(angles) {
            *rotation = Rotation3::from_axis_angle(&Unit::new_unchecked(frame.axis), angle);
        }
        for coil in 0..self.rest.coil_count {
            let frame = self.rest.frame_of[coil];
            if frame == FIXED {
                continue;
            }
            let (rotation, pivot) = (rotations[frame], self.rest.frames[frame].pivot);
            let at_zero = self.rest.coil_pose(coil);
            let pose = CoilPose {
                origin: pivot + rotation * (at_zero.origin - pivot),
                axis: rotation * at_zero.axis,
            };
            posed.groups[coil / WIDTH].set_pose(coil % WIDTH, &pose);
        }
    }

    /// Lets every coil of an array made earlier by this one make `gains` (one a coil in the description's order) times its described
    /// field, wherever it is posed from now on. Coils without a gain keep theirs; gains past the last coil are not read.
    pub fn amplify_into(&self, gains: &[f64], posed: &mut PosedArray) {
        let gains = &gains[..gains.len().min(self.rest.coil_count)];
        let groups = posed.groups.iter_mut().zip(&self.rest.groups);
        for ((group, unit), gains) in groups.zip(gains.chunks(WIDTH)) {
            group.set_scaled_series(unit, gains);
        }
    }
}

impl Frame {
    fn new(description: &FrameDescription) -> Self {
        Self { axis: description.axis.into(), pivot: description.pivot.into() }
    }

    /// Derivatives of the frame's field and gradient with its angle, from what its coils make together.
    // Called: woven into the loop over the few frames, it is widened to eight of them where AVX-512 allows.
    #[inline(never)]
    fn column(&self, point: &Vector3<f64>, made: &Gathered) -> FieldColumn {
        let w = &self.axis;
        let velocity = w.cross(&(point - self.pivot));
        let gradient = made.gradient.matrix();
        // G is symmetric, so that -G [w]x is the transpose of [w]x G.
        let turned = w.cross_matrix() * gradient;
        let turned: Matrix3<f64> = turned + turned.transpose();
        let carried = made.second_gradient.contract(&velocity);
        FieldColumn {
            field: w.cross(&made.field) - gradient * velocity,
            gradient: FieldGradient {
                xx: turned[(0, 0)] - carried.xx,
                xy: turned[(0, 1)] - carried.xy,
                xz: turned[(0, 2)] - carried.xz,
                yy: turned[(1, 1)] - carried.yy,
                yz: turned[(1, 2)] - carried.yz,
            },
        }
    }
}

impl PosedArray {
    /// Number of coils N_I.
    #[must_use]
    pub fn coil_count(&self) -> usize {
        self.coil_count
    }

    /// Number of frames N_theta.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }

    /// Where a coil is at these frame angles.
    ///
    /// # Panics
    /// When `coil` is not less than [`COILS_MAX`].
    #[must_use]
    pub fn coil_pose(&self, coil: usize) -> CoilPose {
        self.groups[coil / WIDTH].pose(coil % WIDTH)
    }

    /// Least local x of each coil at which its series holds, m.
    #[must_use]
    pub fn valid_from_x(&self) -> &[f64] {
        &self.valid_from_x[..self.coil_count]
    }

    /// The array with `currents` (A, one a coil in the description's order). Coils without a current carry
    /// none; currents past the last coil are not read.
    #[must_use]
    pub fn actuated(&self, currents: &[f64]) -> ActuatedArray<'_> {
        let mut padded = [0.0; COILS_MAX];
        for (padded, current) in padded.iter_mut().zip(currents) {
            *padded = *current;
        }
        ActuatedArray { posed: self, currents: padded }
    }

    fn insert(&mut self, index: usize, coil: &CoilDescription) {
        let axis = Vector3::from_fn(|row, _| coil.rotation[row][0]);
        let pose = CoilPose { origin: coil.position.into(), axis };
        let group = &mut self.groups[index / WIDTH];
        group.set_series(index % WIDTH, &Multipole::new(&coil.coefficients));
        // The lanes behind may stay without a coil: zero weights, at a place that gives finite numbers.
        for lane in index % WIDTH..WIDTH {
            group.set_pose(lane, &pose);
        }
        self.frame_of[index] = coil.frame.unwrap_or(FIXED);
        self.valid_from_x[index] = coil.valid_from_x;
    }
}

impl ActuatedArray<'_> {
    /// Number of coils N_I: the first columns of a sample belong to their currents, the rest to frame angles.
    #[must_use]
    pub fn coil_count(&self) -> usize {
        self.posed.coil_count
    }
}

impl AppliedField for ActuatedArray<'_> {
    fn parameter_count(&self) -> usize {
        self.posed.coil_count + self.posed.frame_count
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        let posed = self.posed;
        let mut gathered = [Gathered::default(); POSE_PARAMETERS_MAX + 1];
        let mut valid = true;
        let (current_columns, angle_columns) = sample.columns.split_at_mut(posed.coil_count);
        let coils = posed.frame_of.chunks_exact(WIDTH).zip(posed.valid_from_x.chunks_exact(WIDTH));
        let coils = coils.zip(self.currents.chunks_exact(WIDTH)).zip(current_columns.chunks_mut(WIDTH));
        for (group, (((frame_of, valid_from_x), currents), columns)) in posed.groups.iter().zip(coils) {
            let fields = group.evaluate(point);
            for (lane, column) in columns.iter_mut().enumerate() {
                let made = fields.lane(lane);
                *column = made.column; // (9)
                valid &= made.local_x >= valid_from_x[lane];
                if let Some(gathered) = gathered.get_mut(frame_of[lane]) {
                    gathered.add_scaled(&made, currents[lane]);
                }
            }
        }
        let frames = posed.frames[..posed.frame_count].iter().zip(&gathered);
        for ((frame, made), column) in frames.clone().zip(angle_columns) {
            *column = frame.column(point, made);
        }
        let mut total = gathered[FIXED];
        for (_, made) in frames {
            total += *made;
        }
        sample.field = total.field;
        sample.gradient = total.gradient;
        sample.second_gradient = total.second_gradient;
        sample.valid = valid;
    }
}

/// What several coils make together at their currents.
#[derive(Debug, Clone, Copy, Default)]
struct Gathered {
    field: Vector3<f64>,
    gradient: FieldGradient,
    second_gradient: FieldSecondGradient,
}

impl Gathered {
    #[inline(always)]
    fn add_scaled(&mut self, made: &CoilField, current: f64) {
        let CoilField { column, second_gradient, .. } = made;
        self.field += column.field * current;
        self.gradient += column.gradient * current;
        self.second_gradient += *second_gradient * current;
    }
}

impl AddAssign for Gathered {
    fn add_assign(&mut self, other: Self) {
        self.field += other.field;
        self.gradient += other.gradient;
        self.second_gradient += other.second_gradient;
    }
}
