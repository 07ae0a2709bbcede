//! Energy: what is stored, what came in, and where it went.
//!
//! Symbols are those of [`super::dynamics`]. Multiply (ii) by `d` and (iii) by `R T`, and sum over the bodies. The left sides
//! are `dK + x/2 sum (m |v1 - v0|^2 + (W1 - W0)^T J (W1 - W0))` exactly, `dK` the change of kinetic energy. On the right
//! stands the work of gravity and of the field, exactly too, less that of the stresses (iv):
//!
//! `dU + h (x/2 + tau/t) de^T C de`                                                        (v)
//!
//! an element, `dU` the change of elastic energy and `de` that of the strains, but for the third power of what the
//! element turns within a step. So
//!
//! `work of the coils = d(kinetic + elastic + gravity + pairs + contact) + damping + contact + friction + numerical`     (vi)
//!
//! where `tau/t` of (v) is the damping's share and every term with `x` the numerical one. What is missing from (vi) is no entry
//! of the ledger: it is the measure of its truth.

use nalgebra::Vector3;

use super::chain::Body;
use super::dynamics::{DISSIPATION, Rod};
use super::element::{Element, Strain};

/// Stored energy, J. Gravity counts from the world's origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// Of motion.
    pub kinetic: f64,
    /// Of strain.
    pub elastic: f64,
    /// Of height.
    pub gravity: f64,
    /// Of the magnets in each other's fields, when they feel them.
    pub pairs: f64,
    /// In the wall that the rod touches.
    pub contact: f64,
}

impl Energy {
    /// The sum.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.gravity + self.pairs + self.contact
    }
}

/// Work and losses of all steps so far, J. Blows ([`Rod::strike`]) are not in it; [`Rod::settle`] starts it anew.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnergyLedger {
    /// Done by the coils' field on the magnets.
    pub coils: f64,
    /// Lost in the rubber.
    pub damping: f64,
    /// Lost in the wall that the rod touches.
    pub contact: f64,
    /// Lost by sliding along it.
    pub friction: f64,
    /// Lost to the integration's own dissipation, and by stopping where a step found no solution.
    pub numerical: f64,
}

impl EnergyLedger {
    /// All losses.
    #[must_use]
    pub fn lost(&self) -> f64 {
        self.damping + self.contact + self.friction + self.numerical
    }

    /// Loss by the dissipation in velocity and spin, given their change in the step.
    pub(super) fn add_inertia_loss(&mut self, body: &Body, velocity: &Vector3<f64>, spin: &Vector3<f64>) {
        let square = body.mass * velocity.norm_squared() + spin.dot(&body.angular_momentum(spin));
        self.numerical += 0.5 * DISSIPATION * square;
    }

    /// Losses (v) of an element, given the change of its strains in the step and `tau / t`.
    pub(super) fn add_strain_loss(&mut self, element: &Element, change: &Strain, time_constants: f64) {
        let square = 2.0 * element.energy(change);
        self.damping += time_constants * square;
        self.numerical += 0.5 * DISSIPATION * square;
    }
}

impl Rod {
    /// Stored energy at the present state.
    #[must_use]
    pub fn energy(&self) -> Energy {
        let mut energy = Energy {
            kinetic: 0.0,
            elastic: 0.0,
            gravity: 0.0,
            pairs: self.energy_of_pairs(),
            contact: self.energy_of_contact(),
        };
        for (body, motion) in self.chain.bodies.iter().zip(&self.motions) {
            let spin = motion.spin;
            energy.kinetic += 0.5 * body.mass * motion.velocity.norm_squared()
                + 0.5 * spin.dot(&body.angular_momentum(&spin));
            energy.gravity -= body.mass * self.gravity.dot(&motion.pose.position);
        }
        for (element, strain) in self.chain.elements.iter().zip(&self.strains) {
            energy.elastic += element.energy(strain);
        }
        energy
    }

    /// Work and losses of all steps since construction or [`Self::settle`].
    #[must_use]
    pub fn ledger(&self) -> EnergyLedger {
        self.ledger
    }

    /// Enters the work of the step that was just solved.
    pub(super) fn account_work(&mut self) {
        self.ledger.coils += self.work_of_coils();
        let (damping, friction) = self.losses_of_contact();
        self.ledger.contact += damping;
        self.ledger.friction += friction;
    }
}
