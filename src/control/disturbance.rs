//! The bias of the model: by how much the magnets point elsewhere than the statics say, learnt from late and
//! noisy measurements.
//!
//! | symbol | meaning |
//! |---|---|
//! | `p` | tangent that the model predicts for the measured actuation, as the rod would have answered by now |
//! | `m` | measured tangent, true some `age` ago |
//! | `b` | bias: the shortest rotation from `p` to `m` as a rotation vector, rad, world; one a magnet |
//! | `T` | time constant of its estimate, s |
//! | `f`, `z` | frequency, Hz, and damping ratio of the rod's first mode where nothing loads it |
//! | `s`, `c` | share of its stiffness that loads leave; how much of that softening is counted on |
//!
//! The statics know where the rod comes to rest, and not how it gets there. Predictions are therefore passed
//! through the rod's first mode and remembered; a pose is compared with the prediction of its own moment,
//! however late it comes:
//! ```text
//! x'' + 2 z w x' + s^c w^2 x = s^c w^2 p,    w = 2 pi f
//! ```
//! Loads leave the mode's mass and damping as they are and of its stiffness a share `s`, the margin of
//! stability: near a snap-through the rod answers `1 / s` times as late, and to take that for bias would drive
//! it on into the snap. How far that is counted on, `c`, is a choice: a bias that lies the way of the lag is
//! learnt later, which costs time where references are fast. What then differs is the model's error, and
//! whatever else turns the magnets, not the rod's motion. It is filtered with `T` over the time between
//! exposures, whatever their rate. Tangents out of line by more than is credible move the
//! estimate no more than the credible would: a jump, or a sensor that lies for a while, shifts it slowly.
//! Predictions that leap as no rod can, since currents or angles are measured wrongly or the model has lost
//! its way, teach nothing and are not to be steered by until a time `T` has passed without.
//!
//! The controller then steers the corrected prediction `R(b) p`, at present and without noise, to the
//! reference: internal model control, a Smith predictor for a static model (Morari, Zafiriou: Robust Process
//! Control, 1989, chapters 2 and 3). The loop around the sensor closes through the model's error alone, so
//! that a late sensor makes it slower to learn and not unstable; actuators at their limits are the model's
//! too, and nothing winds up.

use magsteer_hal::{MAGNETS_MAX, PoseMessage};
use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use magsteer_hal::invalid::Checks;

use super::past::Past;
use super::step::Directions;
use crate::math::{angle_between, logarithm};

/// Longest time between exposures that counts, in time constants: after a pause one tangent is still only
/// one.
const PAUSE_MAX: f64 = 0.5;
/// Greatest speed of a prediction that is believed, rad/s: four times what references are usually given.
const SPEED_MAX: f64 = 1000.0_f64.to_radians();
/// What noise of the measured actuation adds to it from one cycle to the next, rad: 10 mA turn the magnets by
/// 0.3 degrees at most.
const NOISE_MAX: f64 = 1.0_f64.to_radians();

/// Least and greatest share of its stiffness that the mode is taken to keep; what is no number counts as the least.
const STIFFNESS: [f64; 2] = [0.05, 20.0];
/// Phase below which an oscillation is a straight line to all digits.
const PHASE_MIN: f64 = 1e-9;

/// `[control.disturbance]`: how the model's bias is learnt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisturbanceConfig {
    /// Gain with which the corrected prediction follows the reference, 1/s, > 0.
    pub tracking_per_s: f64,
    /// Time constant of the estimate, ms, > 0.
    pub time_constant_ms: f64,
    /// Frequency of the manipulator's first mode where nothing loads it, Hz, > 0.
    pub mode_frequency_hz: f64,
    /// Its damping ratio there, above 0 and below 1.
    pub mode_damping_ratio: f64,
    /// How much of the mode's softening by loads is counted on, 0 to 1: 1 where ways come near snap-throughs, 0 where references are fast.
    pub mode_softening: f64,
    /// By how much the field lags behind the measured actuation, as eddy currents make it, ms, 0 to 400.
    pub delay_ms: f64,
    /// Greatest difference between a tangent and its estimate that counts in full, deg, > 0.
    pub innovation_max_deg: f64,
}

impl DisturbanceConfig {
    /// Adds every value out of its range.
    pub fn check(&self, checks: &mut Checks) {
        checks.within("control.disturbance.tracking_per_s", self.tracking_per_s, 1e-3, 1e3);
        checks.within("control.disturbance.time_constant_ms", self.time_constant_ms, 1e-3, 1e6);
        checks.within("control.disturbance.mode_frequency_hz", self.mode_frequency_hz, 1e-3, 1e6);
        checks.within("control.disturbance.mode_damping_ratio", self.mode_damping_ratio, 1e-3, 0.999);
        checks.within("control.disturbance.mode_softening", self.mode_softening, 0.0, 1.0);
        checks.within("control.disturbance.delay_ms", self.delay_ms, 0.0, 400.0);
        checks.within("control.disturbance.innovation_max_deg", self.innovation_max_deg, 1e-3, 180.0);
    }
}

/// One cycle's share of what the estimate learns from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prediction<'a> {
    /// Tangents of the model at the measured actuation.
    pub(super) tangents: &'a Directions,
    /// False while the model has not caught up with the actuation.
    pub(super) converged: bool,
    /// The model's margin of stability.
    pub(super) margin: f64,
    /// Time since the previous cycle, s.
    pub(super) period: f64,
}

/// What one pose showed of a magnet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighting {
    /// Tangent that the model predicted for then, as the rod would have answered.
    pub(super) predicted: Vector3<f64>,
    /// Tangent that was measured.
    pub(super) measured: Vector3<f64>,
    /// Angle from there to where the model has it rest now, rad.
    pub(super) lag: f64,
    /// Time since the exposure before, s; what counts of it.
    pub(super) span: f64,
}

/// The estimate.
#[derive(Debug, Clone)]
pub struct Disturbance {
    magnets: usize,
    time_constant: f64,
    innovation_max: f64,
    /// By how much what was predicted comes after what is measured; negative where predictions come late, s.
    delay: f64,
    softening: f64,
    mode: Mode,
    past: Past,
    /// Time since the first prediction, s.
    elapsed: f64,
    /// When the model had last not caught up, or leapt.
    astray: f64,
    newest: Directions,
    magnet: [Estimate; MAGNETS_MAX],
    /// What a pose showed in this cycle; none of a magnet that it did not show, or that teaches nothing.
    sightings: [Option<Sighting>; MAGNETS_MAX],
}

/// What is known of one magnet.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    bias: Vector3<f64>,
    /// Exposure of the newest tangent that counted; none before the first.
    exposed: Option<f64>,
}

impl Disturbance {
    /// An estimate for so many magnets, of which nothing is known. `lag` is by how much its
    /// predictions lag behind the measured actuation, s.
    #[must_use]
    pub fn new(config: &DisturbanceConfig, lag: f64, magnets: usize) -> Self {
        Self {
            magnets,
            time_constant: config.time_constant_ms * 1e-3,
            innovation_max: config.innovation_max_deg.to_radians(),
            delay: config.delay_ms * 1e-3 - lag,
            softening: config.mode_softening,
            mode: Mode::new(config.mode_frequency_hz, config.mode_damping_ratio),
            past: Past::new(),
            elapsed: 0.0,
            astray: f64::NEG_INFINITY,
            newest: Directions::default(),
            magnet: [Estimate { bias: Vector3::zeros(), exposed: None }; MAGNETS_MAX],
            sightings: [None; MAGNETS_MAX],
        }
    }

    /// Takes one cycle's prediction; call it every cycle.
    pub(super) fn predict(&mut self, prediction: &Prediction<'_>) {
        self.elapsed += prediction.period;
        self.sightings = [None; MAGNETS_MAX];
        if !prediction.converged || self.has_leapt(prediction) {
            self.astray = self.elapsed;
        }
        self.newest = *prediction.tangents;
        let [least, most] = STIFFNESS;
        let margin = if prediction.margin.is_nan() { least } else { prediction.margin };
        let stiffness = margin.clamp(least, most).powf(self.softening);
        let answered = self.mode.answer(prediction.tangents, self.magnets, stiffness, prediction.period);
        self.past.push(&answered, prediction.period);
    }

    /// True when predictions have been believable for long enough to be steered by.
    pub(super) fn is_sound(&self) -> bool {
        self.elapsed - self.astray > self.time_constant
    }

    fn has_leapt(&self, prediction: &Prediction<'_>) -> bool {
        let most = SPEED_MAX * prediction.period + NOISE_MAX;
        let pairs = self.newest.iter().zip(prediction.tangents).take(self.magnets);
        pairs.map(|(before, now)| (Vector3::from(*before), Vector3::from(*now))).any(|(before, now)| {
            // Nothing comes before the first.
            before != Vector3::zeros() && angle_between(&before, &now) > most
        })
    }

    /// Learns from poses that were true `age` seconds ago; call it once for each.
    pub(super) fn learn(&mut self, pose: &PoseMessage, age: f64) {
        let exposed = self.elapsed - age;
        if exposed <= self.astray {
            return;
        }
        // Of poses that are newer than a late prediction the newest prediction is the nearest.
        let past = self.past.at((age + self.delay).max(0.0));
        let estimates = self.magnet.iter_mut().zip(&mut self.sightings).zip(&self.newest);
        for (((estimate, sighting), resting), (magnet, then)) in
            estimates.zip(pose.magnets.iter().zip(&past)).take(self.magnets)
        {
            if magnet.valid != 1 {
                continue;
            }
            let (then, measured) = (Vector3::from(*then), Vector3::from(magnet.tangent()).normalize());
            let seen = rotation_between(&then, &measured);
            if !seen.x.is_finite() || then == Vector3::zeros() {
                continue;
            }
            let Some(before) = estimate.exposed else {
                *estimate = Estimate { bias: seen, exposed: Some(exposed) };
                continue;
            };
            let span = (exposed - before).clamp(0.0, PAUSE_MAX * self.time_constant);
            let innovation = seen - estimate.bias;
            let credible = (self.innovation_max / innovation.norm().max(f64::MIN_POSITIVE)).min(1.0);
            let share = -(-span / self.time_constant).exp_m1();
            estimate.bias += innovation * (credible * share);
            estimate.exposed = Some(exposed.max(before));
            let lag = angle_between(&then, &Vector3::from(*resting));
            *sighting = Some(Sighting { predicted: then, measured, lag, span });
        }
    }

    /// What the poses learnt from in this cycle showed of the magnets.
    pub(super) fn sightings(&self) -> &[Option<Sighting>; MAGNETS_MAX] {
        &self.sightings
    }

    /// A magnet's predicted tangent with the bias.
    pub(super) fn corrected(&self, magnet: usize, predicted: &Vector3<f64>) -> Vector3<f64> {
        Rotation3::new(self.magnet[magnet].bias) * predicted
    }

    /// Bias of every magnet: rotation vector from the prediction to what was measured, rad, world.
    pub(super) fn bias(&self) -> Directions {
        self.magnet.map(|estimate| estimate.bias.into())
    }
}

/// The shortest rotation between two unit vectors, as a rotation vector, rad.
fn rotation_between(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    from.cross(&logarithm(from, to))
}

/// The response of the rod's first mode to where it would rest: `x'' + 2 z w x' + s w^2 x = s w^2 p`, every
/// component alike; `s` is the share of the stiffness that loads leave.
#[derive(Debug, Clone)]
struct Mode {
    /// `w`, rad/s.
    frequency: f64,
    damping: f64,
    /// `x`, and `x' / w`; unknown before the first prediction.
    state: Option<[[Vector3<f64>; 2]; MAGNETS_MAX]>,
}

impl Mode {
    fn new(frequency_hz: f64, damping: f64) -> Self {
        Self { frequency: std::f64::consts::TAU * frequency_hz, damping, state: None }
    }

    /// Where the rod is `period` seconds later, with `resting` and `stiffness` held meanwhile: exact, whatever the period.
    fn answer(&mut self, resting: &Directions, magnets: usize, stiffness: f64, period: f64) -> Directions {
        let at_rest = || resting.map(|tangent| [Vector3::from(tangent), Vector3::zeros()]);
        let state = self.state.get_or_insert_with(at_rest);
        let time = self.frequency * period;
        let [cosine, sine] = oscillation(stiffness - self.damping * self.damping, time);
        let decay = (-self.damping * time).exp();
        let (sine, cosine) = (decay * sine, decay * cosine);
        let mut answered = *resting;
        for ((state, answered), resting) in state.iter_mut().zip(&mut answered).zip(resting).take(magnets) {
            let resting = Vector3::from(*resting);
            let [place, speed] = *state;
            let away = place - resting;
            *state = [
                resting + away * (cosine + self.damping * sine) + speed * sine,
                speed * (cosine - self.damping * sine) - away * (stiffness * sine),
            ];
            *answered = state[0].into();
        }
        answered
    }
}

/// `cos(d t)` and `sin(d t) / d` with `d^2 = square`, which may be negative: the two solutions of `y'' = -square y`.
fn oscillation(square: f64, time: f64) -> [f64; 2] {
    let root = square.abs().sqrt();
    let phase = root * time;
    if phase < PHASE_MIN {
        return [1.0, time];
    }
    let [cosine, sine] = if square > 0.0 { [phase.cos(), phase.sin()] } else { [phase.cosh(), phase.sinh()] };
    [cosine, sine / root]
}

#[cfg(test)]
mod tests;
