//! The control cycle around a rod that rests in the equilibrium of an earlier command: the simplest loop whose gain margin is known.
//!
//! With `u+ = u + T k a e`, where the error `e` is that of `D` cycles ago and `a` an eigenvalue of the map from a wanted to an achieved step,
//! the roots of `z^(D+1) - z^D + T k a` reach the unit circle at `T k |a| = 2 sin((pi/2 - |arg a|) / (2 D + 1))`.

use std::collections::VecDeque;
use std::f64::consts::FRAC_PI_2;

use magsteer::control::{
    ControlConfig, Cycle, CycleInput, CycleOutcome, Directions, FeedbackKind, JacobianKind, Step,
};
use magsteer::rod::Pass;
use magsteer_hal::{Actuation, MagnetPose, PoseMessage};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

use crate::statics::{Rig, State};

/// Period, s.
const PERIOD: f64 = 4e-3;
/// Cycles between a command and its effect.
const DELAY: usize = 10;
/// Cycles of one trial.
const CYCLES: usize = 700;
/// Step of the first magnet's target, rad: small, so that the loop stays linear.
const STEP: f64 = 2e-3;

pub struct DelayedRig<'a> {
    rig: &'a Rig,
    state: &'a State,
    control: ControlConfig,
}

impl<'a> DelayedRig<'a> {
    /// A loop about `state` with the proportional law alone: nothing that acts in the null space.
    pub fn new(rig: &'a Rig, state: &'a State, jacobian: JacobianKind) -> Self {
        let mut control = rig.control.clone();
        control.jacobian = jacobian;
        (control.current_release_per_s, control.determinant_rate_per_s) = (0.0, 0.0);
        control.damping = 1e-9;
        control.feedback = FeedbackKind::DelayedReference;
        // Steps of the target are to reach the law as they are.
        (control.reference_speed_max_deg_per_s, control.reference_acceleration_max_deg_per_s2) = (1e5, 1e7);
        control.reference_time_constant_ms = 0.0;
        control.response_delay_ms = 0.0;
        let algorithm_1 = control.algorithm_1.as_mut().expect("shipped");
        algorithm_1.problems_per_cycle_max = 9;
        // Nearly the limit of small steps.
        (algorithm_1.current_step_a, algorithm_1.angle_step_deg) = (0.02, 0.2);
        algorithm_1.residual_tolerance = 1e-9;
        Self { rig, state, control }
    }

    /// Greatest stable gain, 1/s, in theory.
    pub fn greatest_gain(size: f64, argument: f64) -> f64 {
        let angle = (FRAC_PI_2 - argument.abs()) / (2 * DELAY + 1) as f64;
        2.0 * angle.sin() / (PERIOD * size)
    }

    /// The same by trial, to 2 %.
    pub fn measured_greatest_gain(&self) -> f64 {
        let expected = Self::greatest_gain(1.0, 0.0);
        let (mut stable, mut unstable) = (0.1 * expected, 4.0 * expected);
        while unstable > 1.02 * stable {
            let middle = (stable * unstable).sqrt();
            if self.converges(middle) {
                stable = middle;
            } else {
                unstable = middle;
            }
        }
        stable
    }

    /// True when an error at the beginning is smaller at the end.
    fn converges(&self, gain: f64) -> bool {
        let control = ControlConfig { proportional_per_s: gain, ..self.control.clone() };
        let manipulator = self.rig.manipulator.clone();
        let mut cycle = Cycle::new(&control, &self.rig.description, manipulator);
        let mut pass = self.state.pass.clone();
        let start = self.state.actuation;
        self.lead(&mut cycle, &pass);
        let mut target = tangents(&pass);
        let first = Vector3::from(target[0]);
        target[0] = (first + Vector3::new(first.z, 0.0, -first.x) * STEP).normalize().into();
        let mut on_their_way: VecDeque<Actuation> = std::iter::repeat_n(start, DELAY).collect();
        let mut admitted = start;
        let mut errors = Vec::with_capacity(CYCLES);
        for _ in 0..CYCLES {
            on_their_way.push_back(admitted);
            let present = on_their_way.pop_front().expect("never empty");
            if self.rig.follow(&present, &mut pass).is_none() {
                return false;
            }
            let outcome = cycle.step(&input(&pass, present, admitted, target, true));
            admitted = outcome.request;
            let error = distance(&tangents(&pass), &target);
            // Grown for certain, and soon no longer linear.
            if error > 10.0 * STEP {
                return false;
            }
            errors.push(error);
        }
        let most = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
        most(&errors[CYCLES - 200..]) < most(&errors[200..400]).max(0.02 * STEP)
    }

    /// Brings the cycle's model to the state, from rest.
    fn lead(&self, cycle: &mut Cycle, pass: &Pass) -> CycleOutcome {
        let part = |share: f64| {
            let mut part = self.state.actuation;
            part.current_a.iter_mut().for_each(|current| *current *= share);
            part
        };
        for number in 1..=100 {
            let present = part(f64::from(number) / 100.0);
            cycle.step(&input(pass, present, present, Directions::default(), false));
        }
        let present = self.state.actuation;
        let outcome = cycle.step(&input(pass, present, present, Directions::default(), false));
        assert!(outcome.model.converged && outcome.model.jacobian_age == 0, "{:?}", outcome.model);
        outcome
    }
}

fn tangents(pass: &Pass) -> Directions {
    let mut directions = Directions::default();
    for (direction, magnet) in directions.iter_mut().zip(pass.magnets()) {
        *direction = magnet.tangent().into();
    }
    directions
}

fn distance(one: &Directions, other: &Directions) -> f64 {
    let apart =
        one.iter().zip(other).map(|(one, other)| (Vector3::from(*one) - Vector3::from(*other)).norm());
    apart.fold(0.0, f64::max)
}

fn input(
    pass: &Pass,
    present: Actuation,
    admitted: Actuation,
    target: Directions,
    engaged: bool,
) -> CycleInput {
    let mut pose = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
    for (seen, magnet) in pose.magnets.iter_mut().zip(pass.magnets()) {
        let rotation = Rotation3::from_matrix_unchecked(magnet.rotation());
        let [x, y, z, w] = UnitQuaternion::from_rotation_matrix(&rotation).coords.into();
        let position_m = magnet.position().into();
        *seen = MagnetPose { position_m, orientation_xyzw: [x, y, z, w], valid: 1, ..MagnetPose::default() };
    }
    CycleInput {
        period: PERIOD,
        pose: Some(pose),
        pose_is_fresh: true,
        pose_age: 0.0,
        measured: present,
        admitted,
        target: target.into(),
        engaged,
    }
}
