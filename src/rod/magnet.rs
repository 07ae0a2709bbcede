//! A rigid magnet: the jump of the state across it, and of every column of variations.
//!
//! # Equations
//! Wrench and weight act at the centre c, the wrench at the magnet's *present* pose:
//! ```text
//! c  = p + (l/2) t,   mu = R mu_body                                   (j1)
//! F  = G(c) mu + M g,   T = mu x B(c)                                  (j2)   (10)-(12) of the paper, and weight
//! n+ = n - F,   m+ = m - T - (l/2) t x (n + n+),   p+ = p + l t        (j3)
//! dF = H dc + G dmu + (dG/du) mu                                       (j4)   H = d(G mu)/dc
//! dT = dmu x B + mu x (G dc + dB/du)                                   (j5)
//! dn+ = dn - dF,   dp+ = dp + l dt
//! dm+ = dm - dT - (l/2) dt x (n + n+) - l t x dn + (l/2) t x dF        (j6)
//! ```
//! | symbol | meaning |
//! |---|---|
//! | p, R, n, m | position, rotation, internal force and moment where the magnet begins; with + where it ends |
//! | l, M, mu | length, mass, dipole moment |
//! | B, G, H | field, its gradient, its second gradient contracted with mu |
//! | u | an actuation parameter |
//!
//! Algorithm 1 of the paper lets the rod move but holds the wrenches: dc and dmu are left out of (j4), (j5).

use magsteer_hal::description::MagnetDescription;

use crate::magnetics::{FieldGradient, FieldSample};
use crate::math::{Pair, Triple};

use super::state::{Frame, State};
use super::transition::Columns;

/// How the wrench on a magnet enters the sensitivities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrenches {
    /// A magnet that moves meets another field: the true derivative.
    #[default]
    Following,
    /// Held in the world while the rod moves: the limit of the paper's Algorithm 1.
    Frozen,
}

/// Constants of a magnet.
#[derive(Debug, Clone, PartialEq)]
pub struct Magnet {
    /// Length along the tangent, m.
    pub length: f64,
    /// Mass, kg.
    pub mass: f64,
    /// Dipole moment in body axes, A m^2.
    pub moment_body: Triple,
    /// True when the moment lies along the tangent.
    pub axial: bool,
}

impl Magnet {
    /// A magnet as described.
    #[must_use]
    pub fn new(description: &MagnetDescription) -> Self {
        let [x, y, _] = description.moment_body;
        Self {
            length: description.length,
            mass: description.mass,
            moment_body: description.moment_body.into(),
            axial: x == 0.0 && y == 0.0,
        }
    }

    /// The centre, when the magnet begins at `state`.
    #[inline(always)]
    #[must_use]
    pub fn center(&self, state: &State) -> Triple {
        state.position + state.frame.tangent.scaled(0.5 * self.length) // (j1)
    }

    /// Moves `state` across the magnet and returns the jump of variations. `sample` is the field at the centre.
    #[inline(always)]
    pub fn cross(
        &self,
        state: &mut State,
        gravity: Triple,
        sample: &FieldSample,
        wrenches: Wrenches,
    ) -> Jump {
        let moment = state.frame.to_world(self.moment_body);
        let field = Triple::from(sample.field);
        let force = apply(&sample.gradient, moment);
        let torque = moment.cross(field); // (j2)
        let before = state.force;
        let after = before - force - gravity.scaled(self.mass);
        let jump = self.jump(state, moment, before + after, sample, wrenches);
        let tangent = state.frame.tangent;
        state.moment = state.moment - torque - tangent.cross(before + after).scaled(0.5 * self.length);
        state.force = after;
        state.position = state.position + tangent.scaled(self.length); // (j3)
        Jump { force, torque, ..jump }
    }

    /// As [`Self::cross`], under a force and a torque at the centre that are held in the world.
    #[inline(always)]
    pub fn cross_held(&self, state: &mut State, gravity: Triple, force: Triple, torque: Triple) -> Jump {
        let before = state.force;
        let after = before - force - gravity.scaled(self.mass);
        let jump = self.rigid_jump(&state.frame, before + after);
        let tangent = state.frame.tangent;
        state.moment = state.moment - torque - tangent.cross(before + after).scaled(0.5 * self.length);
        state.force = after;
        state.position = state.position + tangent.scaled(self.length); // (j3)
        jump
    }

    /// What a rigid part does to variations under wrenches that do not vary; `forces` is `n + n+`.
    #[inline(always)]
    fn rigid_jump(&self, frame: &Frame, forces: Triple) -> Jump {
        let half = 0.5 * self.length;
        let mut jump = Jump {
            arm: frame.tangent.scaled(half),
            center_by_rotation: [frame.d2.scaled(-half), frame.d1.scaled(half)],
            ..Jump::default()
        };
        for (by, dc) in jump.moment_by_rotation.iter_mut().zip(jump.center_by_rotation) {
            *by = forces.cross(dc); // (j6), third term
        }
        jump
    }

    #[inline(always)]
    fn jump(
        &self,
        state: &State,
        moment: Triple,
        forces: Triple,
        sample: &FieldSample,
        wrenches: Wrenches,
    ) -> Jump {
        let frame = &state.frame;
        let mut jump = Jump { dipole: moment, ..self.rigid_jump(frame, forces) };
        let arm = jump.arm;
        if wrenches == Wrenches::Frozen {
            return jump;
        }
        let field = Triple::from(sample.field);
        let stiffness = sample.second_gradient.contract(&moment.into());
        let [gradient_x, gradient_y, gradient_z] = columns(&sample.gradient);
        let force_by_position = columns(&stiffness);
        jump.force_by_position = force_by_position;
        for (axis, gradient) in [gradient_x, gradient_y, gradient_z].into_iter().enumerate() {
            let torque = moment.cross(gradient);
            jump.moment_by_position[axis] = arm.cross(force_by_position[axis]) - torque;
        }
        for (axis, unit) in [frame.d1, frame.d2, frame.tangent].into_iter().enumerate() {
            let dmu = unit.cross(moment);
            let mut force = apply(&sample.gradient, dmu);
            let mut torque = dmu.cross(field);
            if let Some(dc) = jump.center_by_rotation.get(axis) {
                force = force + apply(&stiffness, *dc); // (j4)
                torque = torque + moment.cross(apply(&sample.gradient, *dc)); // (j5)
            }
            jump.force_by_rotation[axis] = force;
            jump.moment_by_rotation[axis] = jump.moment_by_rotation[axis] + arm.cross(force) - torque;
        }
        jump
    }
}

/// Linear map of variations across a magnet, and the wrench there.
#[derive(Debug, Clone, Copy, Default)]
pub struct Jump {
    /// Magnetic force, N.
    pub force: Triple,
    /// Magnetic torque, N m.
    pub torque: Triple,
    /// Half the magnet, from its start to its centre, m.
    arm: Triple,
    dipole: Triple,
    /// dc with rotations about d1 and d2; twist does not move the centre.
    center_by_rotation: [Triple; 2],
    force_by_position: [Triple; 3],
    force_by_rotation: [Triple; 3],
    moment_by_position: [Triple; 3],
    moment_by_rotation: [Triple; 3],
}

impl Jump {
    /// Carries columns across the magnet; leaves in `center` the variation of its centre.
    /// `FULL` regards twist.
    #[inline(always)]
    pub fn carry<const FULL: bool, const P: usize>(
        &self,
        columns: &mut Columns<P>,
        center: &mut super::transition::Rows<P>,
    ) {
        let arm_twice = self.arm.scaled(2.0).splat();
        let by_rotation = self.center_by_rotation.map(Triple::splat);
        let force_by_position = self.force_by_position.map(Triple::splat);
        let force_by_rotation = self.force_by_rotation.map(Triple::splat);
        let moment_by_position = self.moment_by_position.map(Triple::splat);
        let moment_by_rotation = self.moment_by_rotation.map(Triple::splat);
        for k in 0..P {
            let dp = column(&columns.position, k);
            let dn = column(&columns.force, k);
            let phi = [columns.rotation[0][k], columns.rotation[1][k], columns.rotation[2][k]];
            let dc = by_rotation[0].scaled(phi[0]) + by_rotation[1].scaled(phi[1]);
            let mut force = product(&force_by_position, [dp.x, dp.y, dp.z])
                + force_by_rotation[0].scaled(phi[0])
                + force_by_rotation[1].scaled(phi[1]);
            let mut moment = product(&moment_by_position, [dp.x, dp.y, dp.z])
                + moment_by_rotation[0].scaled(phi[0])
                + moment_by_rotation[1].scaled(phi[1]);
            if FULL {
                force = force + force_by_rotation[2].scaled(phi[2]);
                moment = moment + moment_by_rotation[2].scaled(phi[2]);
            }
            moment = column(&columns.moment, k) + moment + dn.cross(arm_twice);
            set(center, k, dp + dc);
            set(&mut columns.position, k, dp + dc + dc);
            set(&mut columns.force, k, dn - force);
            set(&mut columns.moment, k, moment);
        }
    }

    /// Variations of force and moment beyond the magnet with the logarithm of its dipole moment.
    pub fn by_moment(&self) -> (Triple, Triple) {
        (-self.force, self.arm.cross(self.force) - self.torque) // (j4) to (j6): dF = F, dT = T
    }

    /// Adds what the parameters `first`, `first + 1` do to the wrench, to the pair of columns `k`.
    #[inline(always)]
    pub fn actuate<const P: usize>(
        &self,
        columns: &mut Columns<P>,
        k: usize,
        sample: &FieldSample,
        first: usize,
        second_is_used: bool,
    ) {
        let low = &sample.columns[first];
        // A parameter past the last is not written by the field: its column must stay zero.
        let high = if second_is_used { sample.columns[first + 1] } else { Default::default() };
        let field = Triple::of_columns(low.field.into(), high.field.into());
        let xx = Pair::new(low.gradient.xx, high.gradient.xx);
        let xy = Pair::new(low.gradient.xy, high.gradient.xy);
        let xz = Pair::new(low.gradient.xz, high.gradient.xz);
        let yy = Pair::new(low.gradient.yy, high.gradient.yy);
        let yz = Pair::new(low.gradient.yz, high.gradient.yz);
        let dipole = self.dipole.splat();
        let force = Triple::new(
            xx * dipole.x + xy * dipole.y + xz * dipole.z,
            xy * dipole.x + yy * dipole.y + yz * dipole.z,
            xz * dipole.x + yz * dipole.y - (xx + yy) * dipole.z,
        );
        let moment = self.arm.splat().cross(force) - dipole.cross(field);
        let force = column(&columns.force, k) - force;
        let moment = column(&columns.moment, k) + moment;
        set(&mut columns.force, k, force);
        set(&mut columns.moment, k, moment);
    }
}

/// `G v`.
#[inline(always)]
fn apply(gradient: &FieldGradient, v: Triple) -> Triple {
    let FieldGradient { xx, xy, xz, yy, yz } = *gradient;
    Triple::new(
        xx * v.x + xy * v.y + xz * v.z,
        xy * v.x + yy * v.y + yz * v.z,
        xz * v.x + yz * v.y - (xx + yy) * v.z,
    )
}

#[inline(always)]
fn columns(gradient: &FieldGradient) -> [Triple; 3] {
    let FieldGradient { xx, xy, xz, yy, yz } = *gradient;
    [Triple::new(xx, xy, xz), Triple::new(xy, yy, yz), Triple::new(xz, yz, -(xx + yy))]
}

#[inline(always)]
fn column<const P: usize>(rows: &[[Pair; P]; 3], k: usize) -> Triple<Pair> {
    Triple::new(rows[0][k], rows[1][k], rows[2][k])
}

#[inline(always)]
fn set<const P: usize>(rows: &mut [[Pair; P]; 3], k: usize, value: Triple<Pair>) {
    rows[0][k] = value.x;
    rows[1][k] = value.y;
    rows[2][k] = value.z;
}

#[inline(always)]
fn product(columns: &[Triple<Pair>; 3], [x, y, z]: [Pair; 3]) -> Triple<Pair> {
    columns[0].scaled(x) + columns[1].scaled(y) + columns[2].scaled(z)
}
