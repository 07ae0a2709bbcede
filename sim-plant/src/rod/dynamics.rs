//! One step of the rod in time.
//!
//! | symbol | meaning |
//! |---|---|
//! | `t` | the step, s |
//! | `p`, `q`, `v`, `W` | a body's centre of mass, rotation, velocity (world) and angular velocity (body axes) |
//! | `d`, `T` | unknowns of a step: displacement (world) and rotation vector (body axes) |
//! | `m`, `J` | mass and inertia |
//! | `x` | numerical dissipation, 0 for none |
//! | `tau` | Kelvin-Voigt time constant, s: stress follows `strain + tau d(strain)/dt` |
//!
//! With index 0 at the step's beginning, 1 at its end, and `half` at the pose half-way between:
//!
//! ```text
//! d / t = a v1 + (1 - a) v0,  T / t = a W1 + (1 - a) W0,  a = (1 + x) / 2       (i)
//! m (v1 - v0) / t = force(half) + m g                                          (ii)
//! (R1 J W1 - R0 J W0) / t = torque(half)                                       (iii)
//! stress = C [ (strain0 + strain1) / 2 + (x / 2 + tau / t) (strain1 - strain0) ] (iv)
//! ```
//!
//! Multiplying (ii) by `d` and (iii) by `R T` gives the change of kinetic energy and `x/2 |v1 - v0|^2`
//! on the left; on the right the work of (iv) is the change of elastic energy, less a square of the
//! strain's change, up to the third power of the step's rotation. So energy falls whenever no field
//! acts, and both squares together keep it falling through a whole oscillation. A mode of angular
//! frequency `w` gets a damping ratio of `x w t / 2` from `x`: 3e-4 at 50 rad/s and half a
//! millisecond; modes faster than the step lose 4 % a step instead of ringing on.
//!
//! The field at each magnet is sampled once a step, at the predicted half-way pose (off by the cube
//! of the step); the torque of the dipole follows the iteration.

use magsteer_hal::description::ManipulatorDescription;
use nalgebra::{Vector3, Vector6};

use super::balance::split;
use super::block_tridiagonal::BlockTridiagonal;
use super::chain::{Chain, Meshing, Pose};
use super::contact::{Contact, Contacts};
use super::element::{Link, Strain};
use super::energy::EnergyLedger;
use super::magnets::Pairs;
use super::motion::Motion;
use crate::field::Field;

/// Numerical dissipation `x`.
pub(super) const DISSIPATION: f64 = 0.02;
/// Newton iterations of one step; reaching this is reported.
const ITERATIONS_MAX: usize = 20;
/// A step that does not converge is halved up to this many times, to a 16th: at most 640 iterations in all.
const HALVINGS_MAX: usize = 4;
/// Largest correction, m, that is still left out; rotations count as the motion of a point one
/// [`LEVER`] away.
const CORRECTION_MAX: f64 = 1e-11;
/// A correction of this size, m, within one step means that the iteration diverges.
const CORRECTION_ABSURD: f64 = 10.0;
/// m a radian.
const LEVER: f64 = 1e-2;
/// Share of a correction that one by a tangent of the same iteration leaves: measured at 1e-3 where the shipped rod moves fastest.
const FRESH: f64 = 1e-2;
/// A kept tangent is renewed when an iteration shrinks the correction by less than this factor.
const SLOW: f64 = 0.1;

/// How the rod is advanced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stepping {
    /// `t`, s.
    pub step: f64,
    /// `tau`, s.
    pub retardation: f64,
}

/// How a plant's rod is cut and damped, and what acts on it beside the coils.
#[derive(Debug, Clone, PartialEq)]
pub struct RodSettings {
    /// How finely it is cut.
    pub meshing: Meshing,
    /// Damping ratio of the first mode about rest.
    pub first_mode_damping_ratio: f64,
    /// Whether magnets feel each other.
    pub magnet_interaction: bool,
    /// The wall about it, if any.
    pub contact: Option<Contact>,
}

/// How a step was solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Solve {
    /// False when even the shortest part of the step found no solution; the rod then stays where it
    /// was, at rest.
    pub converged: bool,
    /// Newton iterations taken, those of halved steps included.
    pub iterations: usize,
}

/// The rod: constants behind `chain`, everything else changes with time.
#[derive(Debug, Clone)]
pub struct Rod {
    pub(super) chain: Chain,
    /// m/s^2, world.
    pub(super) gravity: Vector3<f64>,
    pub(super) stepping: Stepping,
    pub(super) motions: Vec<Motion>,
    /// At the beginning of the step, an entry an element.
    pub(super) strains: Vec<Strain>,
    /// Of the coils at each magnet, half-way through the step.
    pub(super) fields: Vec<Field>,
    /// Magnets and what they do to each other.
    pub(super) pairs: Pairs,
    /// The wall about it, if any.
    pub(super) contacts: Option<Contacts>,
    /// Work and losses since construction or [`Self::settle`].
    pub(super) ledger: EnergyLedger,
    /// Out-of-balance forces of the bodies, then the corrections that they ask for.
    pub(super) residual: Vec<Vector6<f64>>,
    pub(super) tangent: BlockTridiagonal,
    /// False when the tangent must be renewed before it is used.
    pub(super) tangent_is_kept: bool,
}

impl Rod {
    /// The unloaded rod at rest.
    #[must_use]
    pub fn new(
        description: &ManipulatorDescription,
        gravity: [f64; 3],
        meshing: Meshing,
        stepping: Stepping,
    ) -> Self {
        let chain = Chain::new(description, meshing);
        let count = chain.bodies.len();
        let motions = chain.unloaded.iter().map(|pose| Motion::at_rest(*pose)).collect();
        Self {
            gravity: Vector3::from(gravity),
            stepping,
            motions,
            strains: vec![Strain::zero(); count],
            fields: vec![Field::zero(); chain.magnets.len()],
            pairs: Pairs::new(&chain),
            contacts: None,
            ledger: EnergyLedger::default(),
            residual: vec![Vector6::zeros(); count],
            tangent: BlockTridiagonal::new(count),
            tangent_is_kept: false,
            chain,
        }
    }

    /// How the rod is advanced.
    #[must_use]
    pub fn stepping(&self) -> Stepping {
        self.stepping
    }

    /// Changes how the rod is advanced, from the next step on.
    pub fn set_stepping(&mut self, stepping: Stepping) {
        // The prediction extrapolates increments, which scale with the step.
        let scale = stepping.step / self.stepping.step;
        for motion in &mut self.motions {
            for increment in
                [&mut motion.shift, &mut motion.turn, &mut motion.shift_before, &mut motion.turn_before]
            {
                *increment *= scale;
            }
        }
        self.stepping = stepping;
        self.tangent_is_kept = false;
    }

    /// kg, of all that can move.
    #[must_use]
    pub fn moving_mass(&self) -> f64 {
        self.chain.moving_mass()
    }

    /// Whether magnets that are not rigidly joined feel each other's dipole field; they do not at first.
    pub fn set_magnet_interaction(&mut self, is_on: bool) {
        self.pairs.set_active(is_on);
    }

    /// Number of magnets.
    #[must_use]
    pub fn magnet_count(&self) -> usize {
        self.chain.magnets.len()
    }

    /// Pose of the free end.
    #[must_use]
    pub fn tip_pose(&self) -> Pose {
        match (self.motions.last(), self.chain.bodies.last()) {
            (Some(motion), Some(body)) => Pose { position: motion.pose.along(body.distal), ..motion.pose },
            _ => self.chain.clamp,
        }
    }

    /// True unless the field at some magnet lay outside its model in the last step.
    #[must_use]
    pub fn field_was_valid(&self) -> bool {
        self.fields.iter().all(|field| field.valid)
    }

    /// Greatest speed of any body, m/s; rotations count as in the solver's tolerance.
    #[must_use]
    pub fn speed_max(&self) -> f64 {
        let speed = |motion: &Motion| motion.velocity.norm().max(LEVER * motion.spin.norm());
        self.motions.iter().map(speed).fold(0.0, f64::max)
    }

    /// Gives every body a velocity that grows with the square of its distance along the unloaded rod
    /// from the clamp, `tip_velocity` at the last body: a blow for tests of free vibration.
    pub fn strike(&mut self, tip_velocity: Vector3<f64>) {
        let clamp = self.chain.clamp.position;
        let distance = |pose: &Pose| (pose.position - clamp).norm();
        let length = self.chain.unloaded.last().map_or(1.0, distance);
        for (motion, pose) in self.motions.iter_mut().zip(&self.chain.unloaded) {
            motion.velocity += tip_velocity * (distance(pose) / length).powi(2);
            motion.expect_to_go_on(self.stepping.step);
        }
    }

    /// Gives every body a spin about its tangent that grows with its distance along the unloaded rod from
    /// the clamp, `tip_spin` (rad/s) at the last body: a turning blow for tests of free vibration.
    pub fn strike_turning(&mut self, tip_spin: f64) {
        let count = self.motions.len() as f64;
        for (index, motion) in self.motions.iter_mut().enumerate() {
            motion.spin.z += tip_spin * (index + 1) as f64 / count;
            motion.expect_to_go_on(self.stepping.step);
        }
    }

    /// Advances by one step. `field` gives the field at a point (m, world).
    pub fn step(&mut self, field: impl Fn(&Vector3<f64>) -> Field) -> Solve {
        self.predict();
        for index in 0..self.fields.len() {
            self.fields[index] = field(&self.half_pose_of_magnet(index).position);
        }
        let solve = self.iterate();
        if solve.converged {
            self.finish();
            return solve;
        }
        // After a blow the extrapolation may lie too far off, or the step be too long.
        let divided = self.advance_in_parts(HALVINGS_MAX);
        self.tangent_is_kept = false;
        for motion in &mut self.motions {
            motion.expect_to_go_on(self.stepping.step);
        }
        Solve { iterations: solve.iterations + divided.iterations, ..divided }
    }

    /// Advances by `stepping.step` starting from no motion, in halves when that fails.
    fn advance_in_parts(&mut self, halvings: usize) -> Solve {
        self.tangent_is_kept = false;
        for motion in &mut self.motions {
            motion.start_from_no_motion();
        }
        let whole = self.iterate();
        if whole.converged {
            self.finish();
            return whole;
        }
        if halvings == 0 {
            self.ledger.numerical += self.energy().kinetic;
            self.halt();
            return whole;
        }
        self.stepping.step *= 0.5;
        let first = self.advance_in_parts(halvings - 1);
        let second = if first.converged { self.advance_in_parts(halvings - 1) } else { first };
        self.stepping.step *= 2.0;
        Solve {
            converged: second.converged,
            iterations: whole.iterations + first.iterations + second.iterations,
        }
    }

    /// Newton's iteration from the unknowns as they are.
    fn iterate(&mut self) -> Solve {
        let mut last = f64::INFINITY;
        for iteration in 1..=ITERATIONS_MAX {
            self.fill_residual();
            let is_fresh = !self.tangent_is_kept;
            if is_fresh {
                self.fill_tangent_of_step();
                self.tangent_is_kept = self.tangent.factorise();
            }
            self.tangent.solve(&mut self.residual);
            let correction = self.correct();
            if !correction.is_finite() || correction > CORRECTION_ABSURD {
                self.tangent_is_kept = false;
                return Solve { converged: false, iterations: iteration };
            }
            let shrinkage = if iteration == 1 { 1.0 } else { (correction / last).min(1.0) };
            // What a tangent of this very iteration leaves need not be measured.
            let left = if is_fresh && !self.is_touching() { shrinkage.min(FRESH) } else { shrinkage };
            self.tangent_is_kept &= is_fresh || iteration == 1 || shrinkage < SLOW;
            // The next correction, about `correction * left`, is left out.
            if correction * left < CORRECTION_MAX {
                return Solve { converged: true, iterations: iteration };
            }
            last = correction;
        }
        self.tangent_is_kept = false;
        Solve { converged: false, iterations: ITERATIONS_MAX }
    }

    /// Extrapolates the unknowns linearly from the last two steps.
    pub(super) fn predict(&mut self) {
        for motion in &mut self.motions {
            let shift = (motion.shift - motion.shift_before) * 3.0 + motion.shift_before_that;
            let turn = (motion.turn - motion.turn_before) * 3.0 + motion.turn_before_that;
            (motion.shift_before_that, motion.turn_before_that) = (motion.shift_before, motion.turn_before);
            (motion.shift_before, motion.turn_before) = (motion.shift, motion.turn);
            (motion.shift, motion.turn) = (shift, turn);
            motion.place();
        }
    }

    /// Adds the solved corrections to the unknowns and returns the largest, m.
    pub(super) fn correct(&mut self) -> f64 {
        let mut largest: f64 = 0.0;
        for (motion, correction) in self.motions.iter_mut().zip(&self.residual) {
            let (shift, turn) = split(correction);
            motion.shift += motion.half.rotation * shift;
            motion.turn += turn;
            motion.place();
            let size = shift.norm().max(LEVER * turn.norm());
            // `max` would drop a NaN.
            largest = if size > largest || !size.is_finite() { size } else { largest };
            if !largest.is_finite() {
                break;
            }
        }
        largest
    }

    /// Makes the end of the step the present.
    fn finish(&mut self) {
        self.account_work();
        let share = (1.0 + DISSIPATION) / 2.0;
        for (motion, body) in self.motions.iter_mut().zip(&self.chain.bodies) {
            let (velocity, spin) = motion.velocities_after(self.stepping.step, share);
            self.ledger.add_inertia_loss(body, &(velocity - motion.velocity), &(spin - motion.spin));
            (motion.velocity, motion.spin) = (velocity, spin);
            motion.pose = motion.end;
            motion.pose.rotation.renormalize_fast();
        }
        self.refresh_strains();
        self.refresh_depths();
    }

    fn refresh_strains(&mut self) {
        let time_constants = self.stepping.retardation / self.stepping.step;
        let mut left = self.chain.clamp;
        for (index, element) in self.chain.elements.iter().enumerate() {
            let body = &self.chain.bodies[index];
            let right = self.motions[index].pose;
            let link =
                Link::between(&left.position, &left.rotation, &right.along(body.proximal), &right.rotation);
            let strain = element.strain(&link);
            self.ledger.add_strain_loss(element, &self.strains[index].difference(&strain), time_constants);
            self.strains[index] = strain;
            left = Pose { position: right.along(body.distal), ..right };
        }
    }

    /// Stops every body where it is.
    pub(super) fn halt(&mut self) {
        for motion in &mut self.motions {
            *motion = Motion::at_rest(motion.pose);
        }
        self.tangent_is_kept = false;
    }
}
