//! Magnets: their poses, and the wrenches of the coils' field and of each other.
//!
//! Two magnets that can move against each other are two dipoles. Their wrenches are those of one pair of half-way
//! poses, the same for both, so that force and moment add up to nothing: what one gains, the other loses. Magnets that
//! are rigidly joined only strain themselves, and are left out.
//!
//! The coils' field is sampled once a step, at the predicted half-way pose; the dipole's torque follows the iteration. The
//! magnets' own fields are cheap and follow the iteration as a whole.

use nalgebra::Vector3;

use super::balance::stack;
use super::chain::{Chain, Pose};
use super::dynamics::Rod;
use crate::field::{Dipole, Wrench};

/// The pairs of magnets that can move against each other, and their wrenches.
#[derive(Debug, Clone)]
pub(super) struct Pairs {
    all: Vec<(usize, usize)>,
    is_active: bool,
    /// At the half-way poses of the running iteration, an entry a magnet.
    dipoles: Vec<Dipole>,
    wrenches: Vec<Wrench>,
}

impl Pairs {
    /// All pairs of the chain, not active.
    pub(super) fn new(chain: &Chain) -> Self {
        let count = chain.magnets.len();
        let apart = |i: usize, j: usize| chain.magnets[i].body != chain.magnets[j].body;
        let zero = Vector3::zeros();
        Self {
            all: (0..count)
                .flat_map(|i| (i + 1..count).map(move |j| (i, j)))
                .filter(|(i, j)| apart(*i, *j))
                .collect(),
            is_active: false,
            dipoles: vec![Dipole { position: zero, moment: zero }; count],
            wrenches: vec![Wrench { force: zero, torque: zero }; count],
        }
    }

    pub(super) fn set_active(&mut self, is_active: bool) {
        self.is_active = is_active;
    }

    fn active(&self) -> &[(usize, usize)] {
        if self.is_active { &self.all } else { &[] }
    }

    /// Wrenches of the dipoles on each other.
    fn evaluate(&mut self) {
        let zero = Vector3::zeros();
        self.wrenches.fill(Wrench { force: zero, torque: zero });
        if !self.is_active {
            return;
        }
        for &(i, j) in &self.all {
            let (first, second) = (&self.dipoles[i], &self.dipoles[j]);
            let on_second = first.wrench_on(second);
            // The reaction needs the first's own field alone; its force is known.
            let torque_on_first = first.moment.cross(&second.field_at(&first.position).flux);
            self.wrenches[j].force += on_second.force;
            self.wrenches[j].torque += on_second.torque;
            self.wrenches[i].force -= on_second.force;
            self.wrenches[i].torque += torque_on_first;
        }
    }
}

impl Rod {
    /// Pose of a magnet's centre.
    ///
    /// # Panics
    /// When `index` is not below [`Self::magnet_count`].
    #[must_use]
    pub fn magnet_pose(&self, index: usize) -> Pose {
        let magnet = &self.chain.magnets[index];
        let body = magnet.body.map_or(self.chain.clamp_of_magnets(), |body| self.motions[body].pose);
        Pose { position: body.along(magnet.offset), ..body }
    }

    pub(super) fn half_pose_of_magnet(&self, index: usize) -> Pose {
        let magnet = &self.chain.magnets[index];
        let body = magnet.body.map_or(self.chain.clamp_of_magnets(), |body| self.motions[body].half);
        Pose { position: body.along(magnet.offset), ..body }
    }

    /// Force and moment of the magnets about their bodies' centres of mass, added to the residual.
    pub(super) fn add_magnets(&mut self) {
        self.place_dipoles();
        self.pairs.evaluate();
        for index in 0..self.chain.magnets.len() {
            let Some(body) = self.chain.magnets[index].body else { continue };
            let coils = self.wrench_of_coils(index);
            let pairs = &self.pairs.wrenches[index];
            let wrench = self.about_body(index, &(coils.force + pairs.force), &(coils.torque + pairs.torque));
            self.residual[body] += stack(&wrench.force, &wrench.torque);
        }
    }

    /// Work of the coils' field on all magnets over the step that was just solved, J.
    pub(super) fn work_of_coils(&self) -> f64 {
        let work = |index: usize| {
            let Some(body) = self.chain.magnets[index].body else { return 0.0 };
            let coils = self.wrench_of_coils(index);
            let wrench = self.about_body(index, &coils.force, &coils.torque);
            let motion = &self.motions[body];
            wrench.force.dot(&motion.shift) + wrench.torque.dot(&(motion.half.rotation * motion.turn))
        };
        (0..self.chain.magnets.len()).map(work).sum()
    }

    /// Energy of the magnets in each other's fields at the present poses, J; zero far apart.
    pub(super) fn energy_of_pairs(&self) -> f64 {
        let dipole = |index: usize| {
            let pose = self.magnet_pose(index);
            Dipole { position: pose.position, moment: pose.rotation * self.chain.magnets[index].moment_body }
        };
        let energy = |&(i, j): &(usize, usize)| {
            let (first, second) = (dipole(i), dipole(j));
            -second.moment.dot(&first.field_at(&second.position).flux)
        };
        self.pairs.active().iter().map(energy).sum()
    }

    fn place_dipoles(&mut self) {
        for index in 0..self.chain.magnets.len() {
            let pose = self.half_pose_of_magnet(index);
            let moment = pose.rotation * self.chain.magnets[index].moment_body;
            self.pairs.dipoles[index] = Dipole { position: pose.position, moment };
        }
    }

    fn wrench_of_coils(&self, index: usize) -> Wrench {
        self.fields[index].wrench(&self.pairs.dipoles[index].moment)
    }

    /// A wrench about a magnet's centre, about its body's centre of mass.
    fn about_body(&self, index: usize, force: &Vector3<f64>, torque: &Vector3<f64>) -> Wrench {
        let magnet = &self.chain.magnets[index];
        let rotation =
            magnet.body.map_or(self.chain.clamp_of_magnets(), |body| self.motions[body].half).rotation;
        let arm = rotation * Vector3::new(0.0, 0.0, magnet.offset);
        Wrench { force: *force, torque: torque + arm.cross(force) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::field::Field;
    use crate::fixture;
    use crate::rod::{Meshing, Stepping};

    #[test]
    fn forces_and_moments_of_the_magnets_on_each_other_add_up_to_nothing_in_every_step() {
        let mut description = fixture::bigmag();
        // A third magnet, joined to the second, and one on the clamp.
        let mut magnet = description.manipulator.parts[1].clone();
        if let magsteer_hal::description::PartDescription::Magnet(magnet) = &mut magnet {
            magnet.moment_body = [0.03, 0.01, 0.05];
        }
        description.manipulator.parts.push(magnet.clone());
        description.manipulator.parts.insert(0, magnet);
        let stepping = Stepping { step: 5e-4, retardation: 0.0 };
        let mut rod = Rod::new(
            &description.manipulator,
            [0.0, 0.0, -9.81],
            Meshing { element_length_max: 2.5e-3 },
            stepping,
        );
        rod.set_magnet_interaction(true);
        // All pairs but that of the two that are joined.
        assert_eq!(rod.pairs.all.len(), 5);
        for _ in 0..200 {
            assert!(rod.step(|_| Field::zero()).converged);
            rod.place_dipoles();
            rod.pairs.evaluate();
            let (mut force, mut moment, mut scale, mut torque) =
                (Vector3::zeros(), Vector3::zeros(), 0.0, 0.0);
            for (wrench, dipole) in rod.pairs.wrenches.iter().zip(&rod.pairs.dipoles) {
                force += wrench.force;
                moment += wrench.torque + dipole.position.cross(&wrench.force);
                scale += wrench.force.norm();
                torque += wrench.torque.norm();
            }
            assert!(force.norm() < 1e-14 * scale && moment.norm() < 1e-13 * torque, "{force} {moment}");
        }
    }
}
