//! One control cycle: a pure function of what was sensed, with state of its own.
//!
//! The order of a cycle is that of the paper's Fig. 4: measured tangents (A), wrenches and shape of the model at the
//! measured actuation, its noise smoothed (B), orientation Jacobian (C), new currents and angles (D).
//!
//! Measurements are late: what they are compared with, so that cause and effect belong to one moment, is the
//! business of `feedback`.
//!
//! What is absent: a clock, a channel, an allocation after construction, a lock, a log, a panic.

use std::sync::Arc;

use magsteer_hal::{Actuation, HardwareDescription, MAGNETS_MAX, MagnetPose, PoseMessage};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use rayon::{ThreadPool, ThreadPoolBuildError};

use super::algorithm_1::{Algorithm1, HeldPose, JacobianKind, PoseSource, Present};
use super::allocation::{Allocation, Wish};
use super::config::{ControlConfig, FrameUse};
use super::error::OrientationError;
use super::feedback::{Feedback, Seen};
use super::gains::Gains;
use super::jacobian::{differenced_rows, exact_rows};
use super::model::Model;
use super::reference::{Pacing, Reference, ReferenceTarget};
use super::scout::{Scout, Standing, Verdict};
use super::smoothing::SmoothedCurrents;
use super::step::{CycleInput, CycleOutcome, Directions, ModelReport, Step};
use crate::rod::Manipulator;

/// The controller of one rig.
#[derive(Debug)]
pub struct Cycle {
    currents: SmoothedCurrents,
    model: Model,
    /// In place of the model's exact Jacobian.
    algorithm_1: Option<Algorithm1>,
    /// Poses at which Algorithm 1 freezes the wrenches.
    held_at: PoseSource,
    error: OrientationError,
    reference: Reference,
    scout: Option<Scout>,
    feedback: Feedback,
    /// Where gains are learnt.
    gains: Option<Gains>,
    allocation: Allocation,
    magnets: usize,
    coils: usize,
    measured: [Option<Vector3<f64>>; MAGNETS_MAX],
    rows: Rows,
}

/// Storage of the rows of one cycle, two a magnet.
#[derive(Debug)]
struct Rows {
    /// Orientation Jacobian (16), by rows, rad/A and rad/rad.
    jacobian: Vec<f64>,
    error: Vec<f64>,
    velocity: Vec<f64>,
    achieved: Vec<f64>,
    step: Vec<f64>,
}

impl Cycle {
    /// The controller for the rig of `description`, whose statics are those of `manipulator`.
    #[must_use]
    pub fn new(config: &ControlConfig, description: &HardwareDescription, manipulator: Manipulator) -> Self {
        let magnets = manipulator.magnet_count();
        let coils = description.coils.len();
        let parameters = coils + description.frames.len();
        let rows = 2 * magnets;
        let [first, second, third] = description.manipulator.base_rotation;
        let base = Matrix3::from_rows(&[first.into(), second.into(), third.into()]);
        let chosen = config.algorithm_1.as_ref().filter(|_| config.jacobian == JacobianKind::Algorithm1);
        let mut model = Model::new(description, manipulator.clone(), config.passes_max);
        if let Some(secondary) = config.secondary.as_ref().filter(|_| config.frame_angles == FrameUse::Steer)
        {
            model.follow_expected_power(secondary.disturbance_deg.to_radians());
        }
        if config.margin_guard.is_some() {
            model.follow_margin();
        }
        Self {
            currents: SmoothedCurrents::new(config.measured_current_time_constant()),
            algorithm_1: chosen.map(|chosen| Algorithm1::new(chosen, description, manipulator.clone())),
            held_at: chosen.map_or(PoseSource::Modelled, |chosen| chosen.magnet_poses),
            scout: config.scout.as_ref().map(|scout| Scout::new(scout, config, description, manipulator)),
            model,
            error: OrientationError::new(config.orientation_error, &base),
            reference: Reference::new(magnets, &Pacing::new(config, description)),
            feedback: Feedback::new(config, magnets),
            gains: config
                .gains
                .as_ref()
                .filter(|_| config.jacobian == JacobianKind::Exact)
                .map(|gains| Gains::new(gains, coils, magnets)),
            allocation: Allocation::new(config, description, rows),
            magnets,
            coils,
            measured: [None; MAGNETS_MAX],
            rows: Rows {
                jacobian: vec![0.0; rows * parameters],
                error: vec![0.0; rows],
                velocity: vec![0.0; rows],
                achieved: vec![0.0; rows],
                step: vec![0.0; rows],
            },
        }
    }

    /// The statics behind the controller.
    #[must_use]
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// This cycle's share of Algorithm 1, where it is chosen.
    fn share_jacobian(&mut self, input: &CycleInput, report: &mut ModelReport) {
        let present = if report.converged { self.present(input) } else { None };
        let Some(algorithm_1) = &mut self.algorithm_1 else { return };
        algorithm_1.advance(present.as_ref());
        report.jacobian_age = algorithm_1.age().unwrap_or(u32::MAX);
        report.converged &= algorithm_1.is_fresh();
    }

    /// The shape at which Algorithm 1 may begin; `None` without it, or while a pose that it wants is missing.
    fn present(&self, input: &CycleInput) -> Option<Present> {
        self.algorithm_1.as_ref()?;
        let mut present = self.model.present();
        if self.held_at == PoseSource::Measured {
            let magnets = &input.pose.as_ref()?.magnets;
            for (pose, magnet) in present.poses.iter_mut().zip(magnets).take(self.magnets) {
                *pose = seen(magnet)?;
            }
        }
        Some(present)
    }

    /// Learns the coils' gains from fresh poses; the model has them from the next cycle on.
    fn learn_gains(&mut self, present: &Actuation) {
        if let (Some(gains), Some(seen)) = (&mut self.gains, self.feedback.sightings()) {
            gains.learn(&self.model, &present.current_a, seen);
            self.model.set_gains(&gains.gains());
        }
    }

    fn has_jacobian(&self) -> bool {
        let differenced = self.algorithm_1.as_ref().is_none_or(|algorithm_1| algorithm_1.age().is_some());
        differenced && self.model.has_jacobian()
    }

    /// Takes the tangents of the magnets that the sensor saw; the others keep their last.
    fn measure(&mut self, pose: &PoseMessage) {
        for (measured, magnet) in self.measured.iter_mut().zip(&pose.magnets).take(self.magnets) {
            if magnet.valid == 1 {
                *measured = Some(Vector3::from(magnet.tangent()).normalize());
            }
        }
    }

    /// Measured tangent of a magnet; before it was ever seen, the model's.
    fn tangent(&self, magnet: usize) -> Vector3<f64> {
        self.measured[magnet].unwrap_or_else(|| self.model.tangent(magnet))
    }

    /// Where a magnet is taken to be.
    fn actual(&self, magnet: usize) -> Vector3<f64> {
        self.feedback.actual(magnet, &self.tangent(magnet), &self.model.tangent(magnet))
    }

    /// Error and wanted velocity of every row, and the rows of the Jacobian.
    fn fill_rows(&mut self, age: f64) {
        let compared = self.feedback.desired(age);
        let parameters = self.rows.jacobian.len() / self.rows.error.len().max(1);
        let present = self.reference.directions();
        for magnet in 0..self.magnets {
            let error = self.error.rows(&self.actual(magnet), &Vector3::from(compared[magnet]));
            let desired = Vector3::from(present[magnet]);
            let forward = self.error.map(&desired, &desired) * self.reference.velocity(magnet);
            for row in 0..2 {
                let index = 2 * magnet + row;
                self.rows.error[index] = error[row];
                self.rows.velocity[index] = forward[row];
            }
            let target = &mut self.rows.jacobian[2 * magnet * parameters..2 * (magnet + 1) * parameters];
            match &self.algorithm_1 {
                None => exact_rows(&self.model, &self.error, magnet, &desired, target),
                Some(algorithm_1) => differenced_rows(algorithm_1, &self.error, magnet, &desired, target),
            }
        }
        self.feedback.add_velocity(&self.rows.error, &mut self.rows.velocity);
    }

    /// Steers: chooses increments and lets the law know what the limits left of its wish.
    fn steer(&mut self, input: &CycleInput) -> (Actuation, f64, u32) {
        let rows = &mut self.rows;
        for (step, velocity) in rows.step.iter_mut().zip(&rows.velocity) {
            *step = velocity * input.period;
        }
        let allocated = self.allocation.allocate(&Wish {
            jacobian: &rows.jacobian,
            step: &rows.step,
            admitted: &input.admitted,
            period: input.period,
            determinant: self.model.determinant(),
            determinant_gradient: self.model.determinant_gradient(),
            margin: self.model.margin(),
            expected_power: self.model.expected_power(),
            frame_angles: self.reference.frame_angles().as_ref(),
        });
        let increment = self.allocation.increment();
        for (achieved, row) in
            rows.achieved.iter_mut().zip(rows.jacobian.chunks_exact(increment.len().max(1)))
        {
            let step: f64 = row.iter().zip(increment).map(|(entry, change)| entry * change).sum();
            *achieved = step / input.period;
        }
        self.feedback.integrate(&rows.error, &rows.velocity, &rows.achieved, input.period);
        let mut request = input.admitted;
        let parameters = request.current_a[..self.coils].iter_mut().chain(&mut request.angle_rad);
        for (parameter, change) in parameters.zip(increment) {
            *parameter += change;
        }
        (request, allocated.condition, allocated.saturated)
    }

    /// Puts feedback and reference at rest where the magnets are, so that steering starts without a bump.
    fn rest(&mut self, admitted: &Actuation) {
        let mut directions = [Vector3::zeros(); MAGNETS_MAX];
        for (magnet, direction) in directions.iter_mut().enumerate().take(self.magnets) {
            *direction = self.actual(magnet);
        }
        self.reference.reset(&directions, &admitted.angle_rad);
        let reference = self.reference.directions();
        self.allocation.rest();
        self.feedback.reset(&reference);
        if let Some(scout) = &mut self.scout {
            scout.rest(&reference);
        }
    }

    /// Moves the reference on, as far as the way was looked at; tells where to, and what is known of the way to the target.
    fn lead(&mut self, input: &CycleInput, converged: bool) -> (ReferenceTarget, Verdict) {
        let (in_force, verdict) = match &mut self.scout {
            None => (input.target, Verdict::Unchecked),
            Some(scout) => {
                let (reference, bias) = (&self.reference.directions(), &self.feedback.bias());
                let standing =
                    Standing { reference, model: &self.model, converged, period: input.period, bias };
                (scout.lead(&input.target, &standing), scout.verdict())
            }
        };
        if in_force.frame_angles.is_none() {
            // The secondary tasks turn the frames: a later goal sets out from where they are.
            self.reference.reset_frames(&input.admitted.angle_rad);
        }
        self.reference.advance(&in_force, input.period);
        self.feedback.follow(&self.reference.directions(), input.period);
        (in_force, verdict)
    }

    fn directions(&self, of: impl Fn(&Self, usize) -> Vector3<f64>) -> Directions {
        let mut directions = Directions::default();
        for (magnet, direction) in directions.iter_mut().enumerate().take(self.magnets) {
            *direction = of(self, magnet).into();
        }
        directions
    }
}

/// A pose as the sensor saw it.
fn seen(magnet: &MagnetPose) -> Option<HeldPose> {
    let [x, y, z, w] = magnet.orientation_xyzw;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
    (magnet.valid == 1)
        .then(|| HeldPose { position: magnet.position_m.into(), rotation: rotation.into_inner() })
}

impl Step for Cycle {
    fn start_workers(&mut self, stack_bytes: usize) -> Result<Option<Arc<ThreadPool>>, ThreadPoolBuildError> {
        self.algorithm_1.as_mut().map_or(Ok(None), |algorithm_1| algorithm_1.start_workers(stack_bytes))
    }

    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        if let Some(pose) = input.pose.filter(|_| input.pose_is_fresh) {
            self.measure(&pose);
        }
        let present = self.currents.take(&input.measured, input.period);
        let mut report = self.model.follow(&present);
        self.share_jacobian(input, &mut report);
        let predicted = self.directions(|cycle, magnet| cycle.model.tangent(magnet));
        self.feedback.observe(&Seen {
            fresh: input.pose.as_ref().filter(|_| input.pose_is_fresh),
            age: input.pose_age,
            predicted: &predicted,
            converged: report.converged,
            margin: report.margin,
            period: input.period,
        });
        let (gains, equilibrium) = (*self.model.gains(), self.model.equilibrium());
        if input.pose_is_fresh && report.converged {
            self.learn_gains(&present);
        }
        let mut outcome = CycleOutcome {
            request: input.admitted,
            desired: Directions::default(),
            in_force: input.target,
            verdict: Verdict::Unchecked,
            measured: self.directions(|cycle, magnet| cycle.measured[magnet].unwrap_or_default()),
            predicted,
            equilibrium,
            bias: self.feedback.bias(),
            gains,
            model: report,
            condition: 0.0,
            saturated: 0,
        };
        let can_steer = input.engaged && input.pose.is_some() && self.has_jacobian() && input.period > 0.0;
        if can_steer {
            (outcome.in_force, outcome.verdict) = self.lead(input, report.converged);
            self.fill_rows(input.pose_age);
            (outcome.request, outcome.condition, outcome.saturated) = self.steer(input);
        } else {
            self.rest(&input.admitted);
        }
        outcome.desired = self.reference.directions();
        outcome
    }
}
