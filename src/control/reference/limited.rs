//! A path to a target on which everything moves within its limits, along one straight way, and arrives
//! together.
//!
//! | symbol | meaning |
//! |---|---|
//! | `g_i`, `v_i` | what is left of coordinate `i` (a direction's logarithm, an angle's difference), and its velocity |
//! | `V_i`, `A_i` | its limits of speed and acceleration |
//! | `d` | `max_i norm(g_i) / A_i`: what is left, as the time squared that the slowest to brake needs, s^2 |
//! | `q` | rate at which everything that is left is to shrink, 1/s |
//!
//! Method: every coordinate wants the velocity `q g_i`, with one `q` for all: `q d = sqrt(2 d - e^2)`, which
//! is braking at the limit, below `d = e^2` the tangent `d / e`, and never more than `1 / max_i (norm(g_i) /
//! V_i)`. Velocities change towards that by one common share of the difference, the largest that keeps every
//! `A_i`. From rest all velocities therefore stay proportional to what is left: the way is straight and ends
//! for all at once. A new target changes what is wanted and no velocity. The share leaves a coordinate that
//! is turned back less than its own limit while another turns farther: all limits hold, and the way bends
//! smoothly into the new one.
//!
//! For one coordinate this is the proximate time-optimal servomechanism (M. L. Workman, dissertation,
//! Stanford 1987).

use magsteer_hal::{MAGNETS_MAX, POSE_PARAMETERS_MAX};
use nalgebra::Vector3;

use crate::control::step::Directions;
use crate::math::{along_great_circle, logarithm};

/// Time constant `e` with which the last of a way is gone, s: what makes the root's infinite slope at its end
/// harmless.
const END_TIME: f64 = 5e-3;
/// The same at least in steps: with four the step's own recursion has its poles at 0.78 and -0.16.
const END_STEPS: f64 = 4.0;
/// Share of the acceleration that braking counts on; the rest is left to what discretisation and a bent way
/// need.
const BRAKING_SHARE: f64 = 0.95;

/// Greatest speed and acceleration of a coordinate: rad/s, rad/s^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// rad/s, > 0
    pub speed: f64,
    /// rad/s^2, > 0
    pub acceleration: f64,
}

/// Directions and frame angles on their way.
#[derive(Debug, Clone)]
pub(super) struct LimitedPath {
    magnets: usize,
    turn: Limits,
    frames: Vec<Limits>,
    pub(super) direction: [Vector3<f64>; MAGNETS_MAX],
    /// Tangent to the sphere, 1/s.
    pub(super) velocity: [Vector3<f64>; MAGNETS_MAX],
    pub(super) angle: [f64; POSE_PARAMETERS_MAX],
    pub(super) rate: [f64; POSE_PARAMETERS_MAX],
}

/// What is left of each coordinate when the step ends, were its velocity to stay.
struct Left {
    direction: [Vector3<f64>; MAGNETS_MAX],
    angle: [f64; POSE_PARAMETERS_MAX],
}

impl LimitedPath {
    pub(super) fn new(magnets: usize, turn: Limits, frames: Vec<Limits>) -> Self {
        Self {
            magnets,
            turn,
            frames,
            direction: [Vector3::zeros(); MAGNETS_MAX],
            velocity: [Vector3::zeros(); MAGNETS_MAX],
            angle: [0.0; POSE_PARAMETERS_MAX],
            rate: [0.0; POSE_PARAMETERS_MAX],
        }
    }

    /// Moves on by `period` seconds, > 0. Without goals the frames stay.
    pub(super) fn step(
        &mut self,
        target: &Directions,
        goals: Option<&[f64; POSE_PARAMETERS_MAX]>,
        period: f64,
    ) {
        let frames = goals.map_or(0, |_| self.frames.len());
        let left = self.left(target, goals, period);
        let shrink = self.shrink_rate(&left, frames, period);
        let share = self.share(&left, frames, shrink, period);
        for magnet in 0..self.magnets {
            let old = self.velocity[magnet];
            let new = old + (left.direction[magnet] * shrink - old) * share;
            let way = (old + new) * (0.5 * period);
            (self.direction[magnet], self.velocity[magnet]) =
                along_great_circle(&self.direction[magnet], &way, &new);
        }
        for frame in 0..frames {
            let old = self.rate[frame];
            let new = old + (left.angle[frame] * shrink - old) * share;
            self.angle[frame] += (old + new) * (0.5 * period);
            self.rate[frame] = new;
        }
    }

    fn left(&self, target: &Directions, goals: Option<&[f64; POSE_PARAMETERS_MAX]>, period: f64) -> Left {
        let mut left = Left { direction: [Vector3::zeros(); MAGNETS_MAX], angle: [0.0; POSE_PARAMETERS_MAX] };
        for (magnet, entry) in left.direction.iter_mut().enumerate().take(self.magnets) {
            let from = &self.direction[magnet];
            // What is no direction is no target: the magnet stays.
            let to = Vector3::from(target[magnet]).try_normalize(f64::MIN_POSITIVE).unwrap_or(*from);
            let whole = if to.x.is_finite() { logarithm(from, &to) } else { Vector3::zeros() };
            *entry = whole - self.velocity[magnet] * period;
        }
        let Some(goals) = goals else { return left };
        for (frame, entry) in left.angle.iter_mut().enumerate().take(self.frames.len()) {
            let goal = if goals[frame].is_finite() { goals[frame] } else { self.angle[frame] };
            *entry = goal - self.angle[frame] - self.rate[frame] * period;
        }
        left
    }

    /// The rate `q`.
    fn shrink_rate(&self, left: &Left, frames: usize, period: f64) -> f64 {
        let (mut braking, mut cruising) = (0.0_f64, 0.0_f64);
        let mut pace = |length: f64, limits: &Limits| {
            braking = braking.max(length / (BRAKING_SHARE * limits.acceleration));
            cruising = cruising.max(length / limits.speed);
        };
        for entry in &left.direction[..self.magnets] {
            pace(entry.norm(), &self.turn);
        }
        for (entry, limits) in left.angle[..frames].iter().zip(&self.frames) {
            pace(entry.abs(), limits);
        }
        let end = END_TIME.max(END_STEPS * period);
        let rate = if braking > end * end { (2.0 * braking - end * end).sqrt() / braking } else { 1.0 / end };
        // Nothing is left to cruise: 1 / 0 is no limit.
        rate.min(1.0 / cruising)
    }

    /// Largest common share of the wanted changes of velocity that keeps every acceleration.
    fn share(&self, left: &Left, frames: usize, shrink: f64, period: f64) -> f64 {
        let mut share = 1.0_f64;
        let mut keep = |change: f64, limits: &Limits| {
            let most = limits.acceleration * period;
            if change > most {
                share = share.min(most / change);
            }
        };
        for (entry, velocity) in left.direction.iter().zip(&self.velocity).take(self.magnets) {
            keep((entry * shrink - velocity).norm(), &self.turn);
        }
        for ((entry, rate), limits) in left.angle.iter().zip(&self.rate).zip(&self.frames).take(frames) {
            keep((entry * shrink - rate).abs(), limits);
        }
        share
    }
}
