//! The reference: a limited path, rounded off by two equal lags, with its velocity.
//!
//! The limited path still leaps in acceleration where it starts, cruises, brakes and ends. Two lags with time
//! constant `T` round that off; they keep its straight way, its limits and its end. The velocity of the
//! second lag, `log_r(x) / T` with `x` the first one's output, feeds the controller forward. A target given
//! while on the way changes neither directions nor velocities at that moment; where a reference comes too
//! fast for the new target to be reached without passing it, it passes it within its limits and comes back.

use magsteer_hal::{HardwareDescription, MAGNETS_MAX, POSE_PARAMETERS_MAX};
use nalgebra::Vector3;

use super::lag::Lag;
use super::limited::{LimitedPath, Limits};
use crate::control::config::ControlConfig;
use crate::control::step::Directions;
use crate::math::logarithm;

/// Longest inner step, s: the path of a slow loop is then that of a quick one.
const STEP_MAX: f64 = 1e-3;
/// Longest time that one call moves on, s; a loop that stood still longer goes on from where it was.
const PERIOD_MAX: f64 = 0.1;

/// How fast a reference goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Pacing {
    /// Of every magnet's direction.
    pub turn: Limits,
    /// Of every frame angle.
    pub frames: Vec<Limits>,
    /// Time constant of each of the two lags, s, >= 0.
    pub time_constant: f64,
}

impl Pacing {
    /// The pacing of `[control]` for the frames of a rig.
    #[must_use]
    pub fn new(config: &ControlConfig, description: &HardwareDescription) -> Self {
        let acceleration = config.reference_frame_acceleration_max_deg_per_s2.to_radians();
        let frames = &description.frames;
        Self {
            turn: Limits {
                speed: config.reference_speed_max_deg_per_s.to_radians(),
                acceleration: config.reference_acceleration_max_deg_per_s2.to_radians(),
            },
            frames: frames.iter().map(|frame| Limits { speed: frame.speed_max, acceleration }).collect(),
            time_constant: config.reference_time_constant_ms * 1e-3,
        }
    }
}

/// Where a reference is to go.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReferenceTarget {
    /// Desired tangents; what is no direction leaves its magnet where it is.
    pub directions: Directions,
    /// Goals of the frame angles, rad; `None` leaves the frames alone. With goals, directions and frames
    /// share one time scale.
    pub frame_angles: Option<[f64; POSE_PARAMETERS_MAX]>,
}

impl From<Directions> for ReferenceTarget {
    /// Directions alone: frames are left to the loop.
    fn from(directions: Directions) -> Self {
        Self { directions, frame_angles: None }
    }
}

/// Smoothed directions and frame angles with their velocities.
#[derive(Debug, Clone)]
pub struct Reference {
    magnets: usize,
    time_constant: f64,
    path: LimitedPath,
    /// Outputs of the two lags.
    direction: [[Vector3<f64>; MAGNETS_MAX]; 2],
    angle: [[f64; POSE_PARAMETERS_MAX]; 2],
    steers_frames: bool,
}

impl Reference {
    /// A reference for so many magnets.
    #[must_use]
    pub fn new(magnets: usize, pacing: &Pacing) -> Self {
        Self {
            magnets,
            time_constant: pacing.time_constant,
            path: LimitedPath::new(magnets, pacing.turn, pacing.frames.clone()),
            direction: [[Vector3::zeros(); MAGNETS_MAX]; 2],
            angle: [[0.0; POSE_PARAMETERS_MAX]; 2],
            steers_frames: false,
        }
    }

    /// Puts directions and frames at rest here.
    pub fn reset(&mut self, directions: &[Vector3<f64>; MAGNETS_MAX], angles: &[f64; POSE_PARAMETERS_MAX]) {
        self.path.direction = *directions;
        self.path.velocity = [Vector3::zeros(); MAGNETS_MAX];
        self.direction = [*directions; 2];
        self.reset_frames(angles);
    }

    /// Puts the frames at rest here: for frames that others turned while the target named no goals for them.
    pub fn reset_frames(&mut self, angles: &[f64; POSE_PARAMETERS_MAX]) {
        self.path.angle = *angles;
        self.path.rate = [0.0; POSE_PARAMETERS_MAX];
        self.angle = [*angles; 2];
        self.steers_frames = false;
    }

    /// Moves on by `period` seconds towards `target`, at most by 0.1 s.
    pub fn advance(&mut self, target: &ReferenceTarget, period: f64) {
        self.steers_frames = target.frame_angles.is_some();
        let period = period.min(PERIOD_MAX);
        if period.is_nan() || period <= 0.0 {
            return;
        }
        // Rounding must not make a step of one period into two.
        let steps = (period / STEP_MAX - 1e-9).ceil().max(1.0);
        let step = period / steps;
        let lag = Lag::new(self.time_constant, step);
        for _ in 0..steps as usize {
            self.step(target, &lag, step);
        }
    }

    fn step(&mut self, target: &ReferenceTarget, lag: &Lag, period: f64) {
        let (from, angle_from) = (self.path.direction, self.path.angle);
        self.path.step(&target.directions, target.frame_angles.as_ref(), period);
        for magnet in 0..self.magnets {
            let (mut before, mut after) = (from[magnet], self.path.direction[magnet]);
            for stage in &mut self.direction {
                let next = lag.direction(&stage[magnet], &before, &after);
                (before, after) = (stage[magnet], next);
                stage[magnet] = next;
            }
        }
        if !self.steers_frames {
            return;
        }
        for frame in 0..POSE_PARAMETERS_MAX {
            let (mut before, mut after) = (angle_from[frame], self.path.angle[frame]);
            for stage in &mut self.angle {
                let next = lag.angle(stage[frame], before, after);
                (before, after) = (stage[frame], next);
                stage[frame] = next;
            }
        }
    }

    /// Present directions.
    #[must_use]
    pub fn directions(&self) -> Directions {
        let mut found = Directions::default();
        for (entry, direction) in found.iter_mut().zip(&self.direction[1]).take(self.magnets) {
            *entry = (*direction).into();
        }
        found
    }

    /// Velocity of the direction of one magnet, 1/s, tangent to the sphere.
    #[must_use]
    pub fn velocity(&self, magnet: usize) -> Vector3<f64> {
        if self.time_constant > 0.0 {
            let [first, second] = &self.direction;
            logarithm(&second[magnet], &first[magnet]) / self.time_constant
        } else {
            self.path.velocity[magnet]
        }
    }

    /// Present frame angles, rad; `None` while the target names no goals for them.
    #[must_use]
    pub fn frame_angles(&self) -> Option<[f64; POSE_PARAMETERS_MAX]> {
        self.steers_frames.then_some(self.angle[1])
    }

    /// Velocities of the frame angles, rad/s; zero while the target names no goals for them.
    #[must_use]
    pub fn frame_velocity(&self) -> [f64; POSE_PARAMETERS_MAX] {
        if !self.steers_frames {
            return [0.0; POSE_PARAMETERS_MAX];
        }
        if self.time_constant > 0.0 {
            let [first, second] = &self.angle;
            std::array::from_fn(|frame| (first[frame] - second[frame]) / self.time_constant)
        } else {
            self.path.rate
        }
    }
}

#[cfg(test)]
mod tests;
