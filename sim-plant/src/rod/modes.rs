//! The first mode about the present shape, the damping that belongs to it, and rest.
//!
//! | symbol | meaning |
//! |---|---|
//! | `K`, `M` | tangent stiffness at rest, lumped mass |
//! | `E` | the part of `K` in which stress follows strain; Kelvin-Voigt damping is `tau E` |
//! | `w1`, `y` | lowest angular frequency of `K y = w^2 M y` and its shape, `y^T M y = 1` |
//! | `z` | damping ratio, `y^T (tau E) y / (2 w1)` |
//!
//! Inverse iteration `y <- K^-1 M y` finds `w1`; two bending modes of equal frequency do no harm,
//! since any mixture of them is a first mode.

use nalgebra::{Vector3, Vector6};

use super::balance::stack;
use super::chain::Pose;
use super::dynamics::{Rod, Stepping};
use super::element::Share;
use super::energy::EnergyLedger;
use crate::field::Field;

/// Inverse iterations: the gap to the second pair of modes shrinks errors at least tenfold each.
const ITERATIONS: usize = 40;
/// Steps of [`Rod::settle`] before it gives up.
const SETTLE_STEPS_MAX: usize = 20_000;
/// Speed, in m per `1 / w1`, below which the rod counts as resting. A mode that creeps ten times slower
/// than `w1` is then within 1e-8 m of its rest.
const REST: f64 = 1e-9;

/// The lowest mode of a rod about its present shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstMode {
    /// `w1`, rad/s.
    pub angular_frequency: f64,
    /// `y^T E y / w1^2`: 1 when the stiffness is all elastic, else gravity or preload has a share.
    pub elastic_share: f64,
}

impl FirstMode {
    /// Kelvin-Voigt time constant, s, that gives the mode a damping ratio.
    #[must_use]
    pub fn retardation(&self, damping_ratio: f64) -> f64 {
        2.0 * damping_ratio / (self.angular_frequency * self.elastic_share)
    }
}

impl Rod {
    /// The lowest mode about the present shape, without field. `None` when nothing that moves has
    /// mass, or when the shape is not a stable equilibrium.
    #[must_use]
    pub fn first_mode(&mut self) -> Option<FirstMode> {
        self.mode_from(&Self::lean)
    }

    /// The lowest mode in which bodies move along a direction (world), for a rod that is symmetric about a plane along or
    /// across it; else as [`Self::first_mode`].
    #[must_use]
    pub fn first_mode_along(&mut self, direction: &Vector3<f64>) -> Option<FirstMode> {
        self.mode_from(&|pose| {
            let shift = pose.rotation.inverse() * direction;
            stack(&shift, &Vector3::zeros())
        })
    }

    fn mode_from(&mut self, start: &dyn Fn(&Pose) -> Vector6<f64>) -> Option<FirstMode> {
        if self.moving_mass() <= 0.0 {
            return None;
        }
        let (squared, shape) = self.lowest_mode(Share { material: 1.0, geometric: 1.0 }, start)?;
        self.fill_static_tangent(Share { material: 1.0, geometric: 0.0 });
        let elastic = dot(&shape, &self.tangent.multiply(&shape));
        (squared > 0.0 && squared.is_finite())
            .then(|| FirstMode { angular_frequency: squared.sqrt(), elastic_share: elastic / squared })
    }

    /// Leans in every direction, so that no mode is missed.
    fn lean(_: &Pose) -> Vector6<f64> {
        Vector6::new(1.0, 0.7, 0.1, 0.0, 0.0, 0.01)
    }

    /// `w1^2` and `y` of a tangent at rest, from a start an entry a body.
    fn lowest_mode(
        &mut self,
        share: Share,
        start: &dyn Fn(&Pose) -> Vector6<f64>,
    ) -> Option<(f64, Vec<Vector6<f64>>)> {
        let masses: Vec<_> = self.chain.bodies.iter().map(super::chain::Body::mass_diagonal).collect();
        let by_mass = |shape: &[Vector6<f64>]| -> Vec<Vector6<f64>> {
            shape.iter().zip(&masses).map(|(entry, mass)| entry.component_mul(mass)).collect()
        };
        self.fill_static_tangent(share);
        if !self.tangent.factorise() {
            return None;
        }
        let mut shape: Vec<_> = self.motions.iter().map(|motion| start(&motion.pose)).collect();
        for _ in 0..ITERATIONS {
            let mut next = by_mass(&shape);
            self.tangent.solve(&mut next);
            let scale = 1.0 / dot(&next, &by_mass(&next)).sqrt();
            shape = next.into_iter().map(|entry| entry * scale).collect();
        }
        Some((dot(&shape, &self.tangent.multiply(&shape)), shape))
    }

    /// Lets the rod come to rest in a field that stays as it is, by strong damping, and returns whether
    /// it did. Only stable equilibria are found. The stepping is as before afterwards; the energy ledger starts anew.
    ///
    /// The first mode of the elastic stiffness alone, which is stable whatever loads the rod on its way, is damped
    /// critically; faster ones creep with the time constant `2 / w1`.
    pub fn settle(&mut self, field: impl Fn(&Vector3<f64>) -> Field) -> bool {
        let before = self.stepping();
        self.halt();
        if self.moving_mass() <= 0.0 {
            return false;
        }
        let Some((squared, _)) = self.lowest_mode(Share { material: 1.0, geometric: 0.0 }, &Self::lean)
        else {
            return false;
        };
        let mode = FirstMode { angular_frequency: squared.sqrt(), elastic_share: 1.0 };
        let frequency = mode.angular_frequency;
        if !(frequency > 0.0 && frequency.is_finite()) {
            return false;
        }
        self.set_stepping(Stepping { step: 0.1 / frequency, retardation: mode.retardation(1.0) });
        self.set_friction_off(true);
        let mut rests = false;
        for _ in 0..SETTLE_STEPS_MAX {
            let solve = self.step(&field);
            rests = solve.converged && self.speed_max() < REST * frequency;
            if rests {
                break;
            }
        }
        self.halt();
        self.set_friction_off(false);
        self.set_stepping(before);
        self.ledger = EnergyLedger::default();
        rests
    }
}

fn dot(left: &[Vector6<f64>], right: &[Vector6<f64>]) -> f64 {
    left.iter().zip(right).map(|(left, right)| left.dot(right)).sum()
}
