//! Secondary tasks: what currents and frames do as far as the magnets do not turn.
//!
//! # Problem
//! Currents answer at once and are limited; frames turn slowly, and how they stand decides what the currents can do. While the currents
//! hold the targets the frames are to move to where this takes less current and leaves more authority, away from snap-through, and not
//! with every noise of the sensors. None of it may turn the magnets.
//!
//! # Terms
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `A`, `B` | columns of currents and of frames of the orientation Jacobian (16), over their ranges | rad |
//! | `x`, `y` | increments of currents and frames over their ranges | |
//! | `K` | `-A^+ B`: currents that undo what frames turn | |
//! | `N` | `1 - A^+ A`: currents that turn nothing | |
//! | `V` | expected power (p1) | A^2 |
//! | `D` | determinant of the residual's Jacobian, which stiffness raises | |
//! | `m` | margin of stability, with gradients `m_x`, `m_y` | |
//!
//! # Method
//! Everything that moves nothing is `x = N a + K y` with `a` and `y` free: `A x + B y = 0` (s1). Of a quantity `f` with gradients `f_x`, `f_y`
//! the steepest ascent in these is `a = f_x`, `y = f_y + K' f_x` (s2), the second the change of `f` with the frames when the currents follow. The tasks:
//! - power: `a` is descent of `V / 2` at the rate of release, which without `epsilon` is the decay of currents; where the frames are told
//!   where to go it is the decay of currents whatever `V`, so that the loop goes as planner and scout have walked before it;
//! - authority: frames turn against the gradient `r` of `ln V` by (s2), at `speed r / sqrt(1 + |r|^2)`: the logarithm and the root keep the law
//!   tame where authority vanishes and `V` is steep;
//! - centring: frames return home at their rate, which also leads them out of settings whose symmetry leaves no gradient;
//! - stiffness: both ascend `D` where it is too small, so that what is lost comes back at its rate;
//! - the guard of the margin, over all of these: what they and the primary task, `x = A^+ dPhi`, would do to `m` is known to first order. Where it
//!   falls faster than `dm/dt = -r (m - m0)` (s3), `a = m_x` makes up for the rest; the turn of frames that are told where to go is not
//!   counted. `D` is a product: it can rise while its lowest factor falls, and near a fold the margin falls within a tenth of a second by
//!   currents that turn nothing.
//!
//! Frames are motors. The speed asked of them is one vector: shortened as a whole where the currents would have to follow it at more than half of
//! their slew, or a frame to exceed its speed; it changes by one common share of what is wanted, the largest that keeps every acceleration. So (s1)
//! holds for what is asked, and noise does not reach them.
//!
//! Source: null-space projection of secondary tasks as in Liégeois, IEEE Trans. Systems, Man, Cybernetics 7(12), 1977; reduced gradient as in Nocedal, Wright:
//! Numerical Optimization, 2nd ed., section 15.3; (s3) is a control barrier function as in Ames et al., IEEE Trans. Automatic Control 62(8), 2017.

use std::collections::BTreeMap;

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

use super::allocation::{Limits, Wish};
use super::config::{ControlConfig, FrameUse};
use crate::math::ThinSvd;

/// Share of the slew of a current that following the frames may take: the rest is the primary task's.
const FOLLOWING_SHARE: f64 = 0.5;

/// Share of the acceleration that the tasks, and braking before the end of a range, count on: the rest is the primary task's.
const ACCELERATION_SHARE: f64 = 0.9;

/// Least square of the margin's slope over the ranges, of currents that turn nothing, by which the guard divides: where they hardly change the
/// margin they are not thrown about for it.
const GUARD_SLOPE_MIN: f64 = 0.05;

/// `[control.secondary]`: what moves the frames while the currents hold the targets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondaryConfig {
    /// RMS of the orientation disturbance that the currents shall be able to undo, deg, 0 to 30; (p1). With 0 power alone counts.
    pub disturbance_deg: f64,
    /// Greatest speed at which frames turn towards less expected power, deg/s, 0 (never) to 1000. Half of it where `V` falls to
    /// half within 69 deg.
    pub conditioning_max_deg_per_s: f64,
    /// Rate at which frames return home, 1/s, 0 (never) to 100.
    pub frame_centering_per_s: f64,
    /// Home of every frame by name, deg, within its range.
    pub frame_home_deg: BTreeMap<String, f64>,
    /// Turn of a frame that the allocation holds for as dear as the greatest current of a coil, deg, 0.1 to 360: small, so that
    /// frames help to turn the magnets only where currents are exhausted.
    pub frame_share_deg: f64,
}

impl SecondaryConfig {
    /// Adds every value out of its range.
    pub fn check(&self, checks: &mut Checks) {
        checks.within("control.secondary.disturbance_deg", self.disturbance_deg, 0.0, 30.0);
        let speed = self.conditioning_max_deg_per_s;
        checks.within("control.secondary.conditioning_max_deg_per_s", speed, 0.0, 1e3);
        checks.within("control.secondary.frame_centering_per_s", self.frame_centering_per_s, 0.0, 100.0);
        checks.within("control.secondary.frame_share_deg", self.frame_share_deg, 0.1, 360.0);
        for (name, angle_deg) in &self.frame_home_deg {
            checks.within(format!("control.secondary.frame_home_deg.{name}"), *angle_deg, -360.0, 360.0);
        }
    }

    /// Home of each frame of `description`, rad.
    pub(super) fn home(&self, description: &HardwareDescription) -> impl Iterator<Item = f64> {
        let home = |name| self.frame_home_deg.get(name).map_or(0.0, |home: &f64| home.to_radians());
        description.frames.iter().map(move |frame| home(&frame.name))
    }

    /// What does not fit the rig of `description`, keyed from the root of the file.
    #[must_use]
    pub fn check_rig(&self, description: &HardwareDescription) -> Vec<Invalid> {
        let mut checks = Checks::new();
        let key = "control.secondary.frame_home_deg";
        for frame in &description.frames {
            let Some(angle_deg) = self.frame_home_deg.get(&frame.name) else {
                let value = format!("nothing for {}", frame.name);
                checks.require(false, key, value, "an angle for each frame");
                continue;
            };
            let [least, most] = [frame.angle_min, frame.angle_max].map(f64::to_degrees);
            checks.within(format!("{key}.{}", frame.name), *angle_deg, least, most);
        }
        for name in self.frame_home_deg.keys() {
            let known = description.frames.iter().any(|frame| frame.name == *name);
            checks.require(known, format!("{key}.{name}"), name, "an angle of one of the rig's frames");
        }
        checks.into_result(()).err().unwrap_or_default()
    }
}

/// `[control.margin_guard]`: how fast the margin of stability may fall, as far as currents that turn nothing can hold it; (s3).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MarginGuardConfig {
    /// Margin `m0` towards which it may fall, -1 to 1; below that it is raised.
    pub floor: f64,
    /// Rate `r` of its fall, 1/s, 1e-3 to 1e3.
    pub rate_per_s: f64,
}

impl MarginGuardConfig {
    /// Adds every value out of its range.
    pub fn check(&self, checks: &mut Checks) {
        checks.within("control.margin_guard.floor", self.floor, -1.0, 1.0);
        checks.within("control.margin_guard.rate_per_s", self.rate_per_s, 1e-3, 1e3);
    }
}

/// What the tasks of the frames want.
#[derive(Debug, Clone)]
struct FrameTasks {
    /// rad/s
    conditioning: f64,
    /// 1/s
    centering: f64,
    /// rad
    home: Vec<f64>,
    /// Greatest acceleration, rad/s^2.
    acceleration: f64,
}

/// The secondary tasks of one rig.
#[derive(Debug, Clone)]
pub(super) struct SecondaryTasks {
    coils: usize,
    rows: usize,
    release: f64,
    determinant_wanted: f64,
    determinant_rate: f64,
    ratio_max: f64,
    /// None while the frames are held.
    frames: Option<FrameTasks>,
    guard: Option<MarginGuardConfig>,
    /// Speed of the frames in the last cycle, rad/s.
    speed: Vec<f64>,
    /// `A` by rows.
    columns: Vec<f64>,
    authority: ThinSvd,
    /// `K` by columns.
    follow: Vec<f64>,
    column: Vec<f64>,
    /// `x_pref`, currents then frames, over their ranges.
    preferred: Vec<f64>,
    away: Vec<f64>,
    /// `A^+ dPhi`.
    primary: Vec<f64>,
}

impl SecondaryTasks {
    /// The tasks of `config` for `rows` rows of error on the rig of `description`.
    pub(super) fn new(config: &ControlConfig, description: &HardwareDescription, rows: usize) -> Self {
        let (coils, frames) = (description.coils.len(), description.frames.len());
        let unknowns = coils + frames;
        let steered = config.secondary.as_ref().filter(|_| config.frame_angles == FrameUse::Steer);
        let tasks = steered.map(|secondary| FrameTasks {
            conditioning: secondary.conditioning_max_deg_per_s.to_radians(),
            centering: secondary.frame_centering_per_s,
            home: secondary.home(description).collect(),
            acceleration: config.reference_frame_acceleration_max_deg_per_s2.to_radians(),
        });
        Self {
            coils,
            rows,
            release: config.current_release_per_s,
            determinant_wanted: config.determinant_wanted,
            determinant_rate: config.determinant_rate_per_s,
            ratio_max: config.singular_ratio_max,
            frames: tasks,
            guard: config.margin_guard,
            speed: vec![0.0; frames],
            columns: vec![0.0; rows * coils],
            authority: ThinSvd::new(rows, coils),
            follow: vec![0.0; coils * frames],
            column: vec![0.0; rows],
            preferred: vec![0.0; unknowns],
            away: vec![0.0; unknowns],
            primary: vec![0.0; coils],
        }
    }

    /// The increments preferred, over the ranges; (s1) holds for them.
    pub(super) fn preferred(&self) -> &[f64] {
        &self.preferred
    }

    /// Ratio of the largest to the smallest singular value in use of `A`.
    pub(super) fn condition(&self) -> f64 {
        self.authority.condition(self.ratio_max)
    }

    /// Frames that stand still.
    pub(super) fn rest(&mut self) {
        self.speed.fill(0.0);
    }

    /// Takes over how the frames are turned, by increments over their ranges in one period.
    pub(super) fn note(&mut self, increment: &[f64], limits: &[Limits], period: f64) {
        let turned = increment[self.coils..].iter().zip(&limits[self.coils..]);
        for (speed, (turned, limits)) in self.speed.iter_mut().zip(turned) {
            *speed = turned * limits.range / period;
        }
    }

    /// Chooses the preferred increments of one cycle from the wanted `step` and the scaled Jacobian `[A B]` by rows, and narrows the box
    /// of the frames to what their acceleration allows.
    pub(super) fn prefer(
        &mut self,
        wish: &Wish<'_>,
        step: &[f64],
        scaled: &[f64],
        limits: &[Limits],
        lower: &mut [f64],
        upper: &mut [f64],
    ) {
        self.decompose(scaled, limits);
        self.release_currents(wish, limits);
        self.preferred[self.coils..].fill(0.0);
        self.stiffen(wish, limits);
        let coils = self.coils;
        if wish.frame_angles.is_none() {
            self.turn_frames(wish, limits);
            self.accelerate(wish.period, &limits[coils..], &mut lower[coils..], &mut upper[coils..]);
        }
        let (currents, frames) = self.preferred.split_at_mut(coils);
        for (turn, follow) in frames.iter().zip(self.follow.chunks_exact(coils.max(1))) {
            for (current, follow) in currents.iter_mut().zip(follow) {
                *current += follow * turn;
            }
        }
        if let (Some(guard), Some((margin, gradient))) = (self.guard, wish.margin) {
            let fall = guard.rate_per_s * (margin - guard.floor) * wish.period; // (s3)
            self.hold_margin(fall, gradient, step, limits);
        }
    }

    /// Adds the `a` by which the margin of this gradient, 1/A and 1/rad, falls by no more than `fall` in this cycle.
    fn hold_margin(&mut self, fall: f64, gradient: &[f64], step: &[f64], limits: &[Limits]) {
        self.authority.pseudo_solve(step, self.ratio_max, &mut self.primary);
        let primary = self.primary.iter().copied().chain(std::iter::repeat(0.0));
        let moves = self.preferred.iter().zip(primary).map(|(preferred, primary)| preferred + primary);
        let slopes = gradient.iter().zip(limits).map(|(gradient, limits)| gradient * limits.range);
        let change: f64 = slopes.zip(moves).map(|(slope, by)| slope * by).sum();
        let lacking = -fall - change;
        if lacking.is_nan() || lacking <= 0.0 {
            return;
        }
        self.ascend(gradient, limits);
        let currents = &self.away[..self.coils];
        let slope: f64 = currents.iter().map(|entry| entry * entry).sum();
        let length = lacking / slope.max(GUARD_SLOPE_MIN);
        for (preferred, away) in self.preferred.iter_mut().zip(currents) {
            *preferred += away * length;
        }
    }

    /// `A`, and `K` where frames may move.
    fn decompose(&mut self, scaled: &[f64], limits: &[Limits]) {
        let (coils, unknowns) = (self.coils, limits.len());
        let rows = self.columns.chunks_exact_mut(coils.max(1));
        for (columns, row) in rows.zip(scaled.chunks_exact(unknowns.max(1))) {
            columns.copy_from_slice(&row[..coils]);
        }
        self.authority.decompose(&self.columns);
        for (frame, follow) in self.follow.chunks_exact_mut(coils.max(1)).enumerate() {
            if limits[coils + frame].rate > 0.0 {
                for row in 0..self.rows {
                    self.column[row] = -scaled[row * unknowns + coils + frame];
                }
                self.authority.pseudo_solve(&self.column, self.ratio_max, follow);
            } else {
                follow.fill(0.0);
            }
        }
    }

    /// `x = N a`: currents decay, or go down the gradient of `V / 2` where that is known and the frames are the tasks' own; never faster
    /// than from full current.
    fn release_currents(&mut self, wish: &Wish<'_>, limits: &[Limits]) {
        let step = self.release * wish.period;
        let expected_power = wish.expected_power.filter(|_| wish.frame_angles.is_none());
        let currents = &mut self.preferred[..self.coils];
        for (index, (preferred, limits)) in currents.iter_mut().zip(limits).enumerate() {
            let downhill = match expected_power {
                Some((power, gradient)) => 0.5 * power * gradient[index],
                None => wish.admitted.current_a[index],
            };
            *preferred = -downhill * step / limits.range;
        }
        let most = currents.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        if most > step {
            currents.iter_mut().for_each(|entry| *entry *= step / most);
        }
        self.authority.project_to_null_space(self.ratio_max, currents);
    }

    /// Adds `a` and `y` by which a lost determinant is regained at its rate.
    fn stiffen(&mut self, wish: &Wish<'_>, limits: &[Limits]) {
        let lost = self.determinant_wanted - wish.determinant;
        if lost <= 0.0 {
            return;
        }
        self.ascend(wish.determinant_gradient, limits);
        if wish.frame_angles.is_some() {
            // Frames that are told where to go are no task's.
            self.away[self.coils..].fill(0.0);
        }
        let slope: f64 = self.away.iter().map(|entry| entry * entry).sum();
        // A flat determinant would be chased without end: a slope below 1 over the whole range is taken as 1.
        let length = lost.min(self.determinant_wanted) * self.determinant_rate * wish.period / slope.max(1.0);
        for (preferred, away) in self.preferred.iter_mut().zip(&self.away) {
            *preferred += away * length;
        }
    }

    /// `a` and `y` of the steepest ascent (s2) of a quantity with this gradient, 1/A and 1/rad, into `away`.
    fn ascend(&mut self, gradient: &[f64], limits: &[Limits]) {
        for ((away, gradient), limits) in self.away.iter_mut().zip(gradient).zip(limits) {
            *away = if limits.rate > 0.0 { gradient * limits.range } else { 0.0 };
        }
        let (currents, frames) = self.away.split_at_mut(self.coils);
        for (turn, follow) in frames.iter_mut().zip(self.follow.chunks_exact(self.coils.max(1))) {
            *turn +=
                follow.iter().zip(currents.iter()).map(|(follow, current)| follow * current).sum::<f64>();
        }
        self.authority.project_to_null_space(self.ratio_max, currents);
    }

    /// Adds the turn of the frames that authority and centring ask for, and shortens the whole of it to what currents and motors can follow.
    fn turn_frames(&mut self, wish: &Wish<'_>, limits: &[Limits]) {
        if let Some((_, gradient)) = wish.expected_power {
            self.ascend(gradient, limits);
        } else {
            self.away.fill(0.0);
        }
        let Some(tasks) = &self.frames else { return };
        let coils = self.coils;
        let frames = limits[coils..].iter();
        // From a gradient over the ranges to one in 1/rad.
        let square: f64 =
            self.away[coils..].iter().zip(frames.clone()).map(|(r, it)| (r / it.range).powi(2)).sum();
        let pace = tasks.conditioning / (1.0 + square).sqrt();
        let wanted = self.preferred[coils..].iter_mut().zip(&self.away[coils..]).zip(frames);
        for (frame, ((preferred, uphill), limits)) in wanted.enumerate() {
            let home = tasks.home[frame] - wish.admitted.angle_rad[frame];
            let speed = tasks.centering * home - pace * uphill / limits.range;
            *preferred += speed * wish.period / limits.range;
        }
        let share = self.following_share(wish.period, limits);
        self.preferred[coils..].iter_mut().for_each(|turn| *turn *= share);
    }

    /// Share of the turn of the frames that the currents follow within their part of the slew, and that no frame's speed forbids.
    fn following_share(&self, period: f64, limits: &[Limits]) -> f64 {
        let (coils, turns) = (self.coils, &self.preferred[self.coils..]);
        let mut excess = 1.0_f64;
        for (coil, limits) in limits[..coils].iter().enumerate() {
            let follow = self.follow.iter().skip(coil).step_by(coils);
            let change: f64 = follow.zip(turns).map(|(follow, turn)| follow * turn).sum();
            excess = excess.max(change.abs() * limits.range / (FOLLOWING_SHARE * limits.rate * period));
        }
        for (turn, limits) in turns.iter().zip(&limits[coils..]) {
            excess = excess.max(turn.abs() * limits.range / (limits.rate * period));
        }
        if excess.is_finite() { 1.0 / excess } else { 0.0 }
    }

    /// Lets the frames' speeds change towards the wanted turn by one share of the difference, and bounds their increments to what one cycle's
    /// acceleration allows, the ends of their ranges in sight. Values over the ranges, of frames alone.
    fn accelerate(&mut self, period: f64, limits: &[Limits], lower: &mut [f64], upper: &mut [f64]) {
        let Some(tasks) = &self.frames else { return };
        let most = tasks.acceleration * period;
        let turns = &mut self.preferred[self.coils..];
        let mut share = 1.0_f64;
        for ((turn, speed), limits) in turns.iter().zip(&self.speed).zip(limits) {
            let change = (turn * limits.range / period - speed).abs();
            if change > ACCELERATION_SHARE * most {
                share = share.min(ACCELERATION_SHARE * most / change);
            }
        }
        for (frame, (turn, limits)) in turns.iter_mut().zip(limits).enumerate() {
            let before = self.speed[frame];
            let speed = before + (*turn * limits.range / period - before) * share;
            let unit = period / limits.range;
            let [least, greatest] = [lower[frame], upper[frame]];
            lower[frame] = ((before - most) * unit).max(least).min(greatest);
            upper[frame] = ((before + most) * unit).max(least).min(greatest);
            *turn = (speed * unit).max(lower[frame]).min(upper[frame]);
        }
    }
}

/// Greatest speed from which a frame stops within `distance`, rad, at an acceleration, rad/s^2.
pub(super) fn stopping_speed(distance: f64, acceleration: f64) -> f64 {
    (2.0 * ACCELERATION_SHARE * acceleration * distance.max(0.0)).sqrt()
}
