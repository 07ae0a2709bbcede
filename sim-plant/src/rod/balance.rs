//! The rod's balance of forces within a step, and the tangent that steers its iteration.
//!
//! Symbols and equation numbers are those of [`super::dynamics`]. Forces and moments are gathered in
//! world axes and turned into each body's axes half-way through the step: there the tangent hardly
//! changes while the rod moves, so that it can be kept.

use nalgebra::{Matrix3, Matrix6, UnitQuaternion, Vector3, Vector6};

use super::chain::Pose;
use super::dynamics::{DISSIPATION, Rod};
use super::element::{EndTangent, Link, Share, blocks};
use super::motion::Motion;
use super::rotation::{matrix, skew};

impl Rod {
    /// Out-of-balance force and moment of every body, in its axes half-way through the step, with
    /// the sign of the right-hand side.
    pub(super) fn fill_residual(&mut self) {
        let step = self.stepping.step;
        let share = (1.0 + DISSIPATION) / 2.0;
        for ((body, motion), residual) in self.chain.bodies.iter().zip(&self.motions).zip(&mut self.residual)
        {
            let (velocity, spin) = motion.velocities_after(step, share);
            let force = (self.gravity - (velocity - motion.velocity) / step) * body.mass; // (ii)
            let before = motion.pose.rotation * body.angular_momentum(&motion.spin);
            let after = motion.end.rotation * body.angular_momentum(&spin);
            let moment = (before - after) / step; // (iii)
            *residual = stack(&force, &moment);
        }
        self.add_elements();
        self.add_magnets();
        self.add_contacts();
        for (motion, residual) in self.motions.iter().zip(&mut self.residual) {
            let to_body = motion.half.rotation.inverse();
            let (force, moment) = split(residual);
            *residual = stack(&(to_body * force), &(to_body * moment));
        }
    }

    fn add_elements(&mut self) {
        let rate_share = self.rate_share();
        let mut left_half = self.chain.clamp;
        let mut left_end = self.chain.clamp;
        let mut left_arm = Vector3::zeros();
        for (index, element) in self.chain.elements.iter().enumerate() {
            let body = &self.chain.bodies[index];
            let motion = &self.motions[index];
            let tangent = motion.half.rotation * Vector3::z();
            let right_arm = tangent * body.proximal;
            let half = Link::between(
                &left_half.position,
                &left_half.rotation,
                &(motion.half.position + right_arm),
                &motion.half.rotation,
            );
            let end = Link::between(
                &left_end.position,
                &left_end.rotation,
                &motion.end.along(body.proximal),
                &motion.end.rotation,
            );
            let strain = self.strains[index].towards(&element.strain(&end), 0.5 + rate_share);
            let gradient = element.gradient(&half, &element.stress(&strain)); // (iv)
            let force = half.frame * gradient.force;
            let moment_left = half.frame * gradient.moment_i - left_arm.cross(&force);
            let moment_right = half.frame * gradient.moment_j + right_arm.cross(&force);
            if index > 0 {
                self.residual[index - 1] += stack(&force, &-moment_left);
            }
            self.residual[index] -= stack(&force, &moment_right);
            left_arm = tangent * body.distal;
            left_half = Pose { position: motion.half.position + left_arm, rotation: motion.half.rotation };
            left_end = Pose { position: motion.end.along(body.distal), rotation: motion.end.rotation };
        }
    }

    /// `x / 2 + tau / t` of (iv).
    fn rate_share(&self) -> f64 {
        DISSIPATION / 2.0 + self.stepping.retardation / self.stepping.step
    }

    pub(super) fn fill_tangent_of_step(&mut self) {
        let share = Share { material: 0.5 + self.rate_share(), geometric: 0.5 };
        self.fill_elastic_tangent(share, |motion| motion.half);
        let scale = 2.0 / ((1.0 + DISSIPATION) * self.stepping.step.powi(2));
        for (index, body) in self.chain.bodies.iter().enumerate() {
            self.tangent.add_diagonal(index, &Matrix6::from_diagonal(&(body.mass_diagonal() * scale)));
        }
        for (magnet, field) in self.chain.magnets.iter().zip(&self.fields) {
            let Some(index) = magnet.body else { continue };
            let flux = self.motions[index].half.rotation.inverse() * field.flux;
            let turning = skew(&flux) * skew(&magnet.moment_body) * -0.5;
            let zero = Matrix3::zeros();
            self.tangent.add_diagonal(index, &blocks(&zero, &zero, &zero, &turning));
        }
        self.add_contacts_to_tangent();
    }

    /// Elastic tangent at rest, without inertia, damping and magnets.
    pub(super) fn fill_static_tangent(&mut self, share: Share) {
        self.tangent_is_kept = false;
        self.fill_elastic_tangent(share, |motion| motion.pose);
    }

    fn fill_elastic_tangent(&mut self, share: Share, pose_of: impl Fn(&Motion) -> Pose) {
        self.tangent.clear();
        let mut left = self.chain.clamp;
        let mut left_offset = 0.0;
        for (index, element) in self.chain.elements.iter().enumerate() {
            let body = &self.chain.bodies[index];
            let right = pose_of(&self.motions[index]);
            let link = Link::between(
                &left.along(left_offset),
                &left.rotation,
                &right.along(body.proximal),
                &right.rotation,
            );
            let stress = element.stress(&element.strain(&link));
            let EndTangent { ii, ij, ji, jj } = element.tangent(&link, &stress, share);
            let force = skew(&(stress.force_like * share.geometric));
            let i = EndMap::new(&link, &left.rotation, left_offset, &-force);
            let j = EndMap::new(&link, &right.rotation, body.proximal, &force);
            if index > 0 {
                self.tangent.add_diagonal(index - 1, &(i.both(&ii, &i) + i.arm));
                self.tangent.add_coupling(index, &i.both(&ij, &j), &j.both(&ji, &i));
            }
            self.tangent.add_diagonal(index, &(j.both(&jj, &j) + j.arm));
            left = right;
            left_offset = body.distal;
        }
    }
}

/// Takes small motions of a body (displacement and rotation in body axes) to those of an element's end
/// in the element's axes.
struct EndMap {
    map: Matrix6<f64>,
    /// Stiffness of the end's force turning with its arm about the centre of mass.
    arm: Matrix6<f64>,
}

impl EndMap {
    fn new(link: &Link, rotation: &UnitQuaternion<f64>, offset: f64, force: &Matrix3<f64>) -> Self {
        let turn = link.frame.tr_mul(&matrix(rotation));
        let arm = skew(&(turn.column(2) * offset));
        let zero = Matrix3::zeros();
        let moment = turn.tr_mul(&(force * arm * turn));
        Self { map: blocks(&turn, &(-arm * turn), &zero, &turn), arm: blocks(&zero, &zero, &zero, &moment) }
    }

    fn both(&self, middle: &Matrix6<f64>, right: &Self) -> Matrix6<f64> {
        self.map.tr_mul(&(middle * right.map))
    }
}

pub(super) fn stack(force: &Vector3<f64>, moment: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}

pub(super) fn split(both: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (Vector3::new(both[0], both[1], both[2]), Vector3::new(both[3], both[4], both[5]))
}
