//! Feedback: what the reference is compared with, and the velocity that the difference asks for.
//!
//! `delayed-reference`: the newest measured tangents, with what was desired when their cause was commanded,
//! `age + response_delay` ago; a proportional-integral law. The delay stands in this loop: the slower the
//! sensor, the smaller the gain must be. `disturbance-estimate`: the model's present tangents, corrected by
//! the bias that measurements show, with what is desired now; a proportional law. No delay stands in this
//! loop. While the prediction cannot be trusted, the reference is followed without correction.

use magsteer_hal::{MAGNETS_MAX, PoseMessage};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::config::ControlConfig;
use super::disturbance::{Disturbance, Prediction, Sighting};
use super::integral::ProportionalIntegral;
use super::past::Past;
use super::step::Directions;

/// What the reference is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeedbackKind {
    /// Measured tangents, with the reference of their cause.
    DelayedReference,
    /// Predicted tangents with the bias that measurements show, with the present reference.
    DisturbanceEstimate,
}

/// What a cycle knows of the magnets.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen<'a> {
    /// Poses that are new in this cycle.
    pub(super) fresh: Option<&'a PoseMessage>,
    /// Age of the newest poses, s.
    pub(super) age: f64,
    /// The model's tangents.
    pub(super) predicted: &'a Directions,
    /// False while the model has not caught up with the actuation.
    pub(super) converged: bool,
    /// The model's margin of stability.
    pub(super) margin: f64,
    /// Time since the previous cycle, s.
    pub(super) period: f64,
}

/// Feedback of one rig.
#[derive(Debug)]
pub(super) struct Feedback {
    law: ProportionalIntegral,
    response_delay: f64,
    desired: Past,
    /// Where the bias is estimated.
    disturbance: Option<Disturbance>,
}

impl Feedback {
    pub(super) fn new(config: &ControlConfig, magnets: usize) -> Self {
        let estimates = config.feedback == FeedbackKind::DisturbanceEstimate;
        let disturbance = config.disturbance.as_ref().filter(|_| estimates);
        let (proportional, integral) = disturbance
            .map_or((config.proportional_per_s, config.integral_per_s2), |chosen| {
                (chosen.tracking_per_s, 0.0)
            });
        Self {
            law: ProportionalIntegral::new(2 * magnets, proportional, integral),
            response_delay: config.response_delay_ms * 1e-3,
            desired: Past::new(),
            disturbance: disturbance
                .map(|chosen| Disturbance::new(chosen, config.measured_current_time_constant(), magnets)),
        }
    }

    /// Takes what a cycle knows of the magnets; call it every cycle.
    pub(super) fn observe(&mut self, seen: &Seen<'_>) {
        let Some(disturbance) = &mut self.disturbance else { return };
        let Seen { predicted: tangents, converged, margin, period, .. } = *seen;
        disturbance.predict(&Prediction { tangents, converged, margin, period });
        if let Some(pose) = seen.fresh {
            disturbance.learn(pose, seen.age);
        }
    }

    /// What the newest poses showed beside the model; `None` where its bias is not estimated.
    pub(super) fn sightings(&self) -> Option<&[Option<Sighting>; MAGNETS_MAX]> {
        self.disturbance.as_ref().map(Disturbance::sightings)
    }

    /// Begins anew with the reference at rest.
    pub(super) fn reset(&mut self, desired: &Directions) {
        self.desired.fill(desired);
        self.law.reset();
    }

    /// Takes over where the reference went.
    pub(super) fn follow(&mut self, desired: &Directions, period: f64) {
        self.desired.push(desired, period);
    }

    /// Where a magnet is taken to be, given its measured and its predicted tangent.
    pub(super) fn actual(
        &self,
        magnet: usize,
        measured: &Vector3<f64>,
        predicted: &Vector3<f64>,
    ) -> Vector3<f64> {
        let corrected = |disturbance: &Disturbance| disturbance.corrected(magnet, predicted);
        self.disturbance.as_ref().map_or(*measured, corrected)
    }

    /// What [`Self::actual`] is compared with, the newest poses being `age` old.
    pub(super) fn desired(&self, age: f64) -> Directions {
        match self.disturbance {
            None => self.desired.at(age + self.response_delay),
            Some(_) => self.desired.at(0.0),
        }
    }

    /// Adds what the errors ask for to the velocities of the rows, which hold the reference's.
    pub(super) fn add_velocity(&self, error: &[f64], velocity: &mut [f64]) {
        if self.disturbance.as_ref().is_none_or(Disturbance::is_sound) {
            self.law.add_velocity(error, velocity);
        }
    }

    /// Learns what the limits left of what was asked for, rad/s, over a period.
    pub(super) fn integrate(&mut self, error: &[f64], asked: &[f64], achieved: &[f64], period: f64) {
        self.law.integrate(error, asked, achieved, period);
    }

    /// Bias of the model: of every magnet the rotation vector from its predicted tangent to where it is taken
    /// to be, rad, world; zero where it is not estimated.
    pub(super) fn bias(&self) -> [[f64; 3]; MAGNETS_MAX] {
        self.disturbance.as_ref().map_or([[0.0; 3]; MAGNETS_MAX], Disturbance::bias)
    }
}
