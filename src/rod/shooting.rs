//! The pass: statics, Newton step and Jacobian of the magnets in one sweep from base to tip.
//!
//! # Problem
//! The clamp fixes position and rotation; the tip fixes force and moment. With the base unknowns
//! `xi = (n0, m0)` and the actuation `u`, integrate to the tip and demand
//! ```text
//! r(xi, u) = (n(L) - F_tip, m(L) - M_tip) = 0                          (s1)
//! dxi   = -(dr/dxi)^-1 r                                               (s2)   Newton's step
//! dxi/du = -(dr/dxi)^-1 dr/du                                          (s3)
//! dy/du at equilibrium = dy/du + (dy/dxi) (dxi/du)                     (s4)   any pose y
//! ```
//! All derivatives are those of the discrete scheme, so they agree with differences of full re-solves on any mesh.
//!
//! # Method
//! The columns `d/dxi` (three pairs) and `d/du` (blocks of four pairs) are carried along the chain as
//! `transition` says. The parameters' columns begin at the first magnet. (s2) and (s3) are solved in the units of
//! the residual, EI/L^2 and EI/L, in which the straight unloaded rod's `dr/dxi` has entries of order one.

use nalgebra::Vector6;

use crate::magnetics::{AppliedField, FieldSample, PARAMETERS_MAX};
use crate::math::{Lu, Pair, Scalar, Triple};

use super::magnet::{Jump, Magnet};
use super::manipulator::{Manipulator, Part};
use super::pass::{JacobianRows, MagnetPass, PAIRS_BLOCK, Pass, PassMode, TipLoad};
use super::section::Section;
use super::state::State;
use super::transition::{
    Columns, LANES_AXIAL, LANES_CLAMPED, LANES_FULL, PAIRS_AXIAL, PAIRS_CLAMPED, PAIRS_FULL, Rows,
};

impl Manipulator {
    /// One pass with the base unknowns `unknowns` (force N, moment N m, world) under the present actuation of `field`.
    /// Never allocates or panics; a state that is not finite shows in [`Pass::residual`].
    pub fn pass(
        &self,
        field: &impl AppliedField,
        load: &TipLoad,
        unknowns: &Vector6<f64>,
        mode: PassMode,
        pass: &mut Pass,
    ) {
        self.pass_under(self.gravity, field, load, unknowns, mode, pass);
    }

    /// As [`Manipulator::pass`], under a gravity of its own.
    pub(super) fn pass_under(
        &self,
        gravity: Triple,
        field: &impl AppliedField,
        load: &TipLoad,
        unknowns: &Vector6<f64>,
        mode: PassMode,
        pass: &mut Pass,
    ) {
        pass.gravity = gravity;
        pass.unknowns = *unknowns;
        pass.poses = mode.poses;
        pass.parameters = field.parameter_count().min(PARAMETERS_MAX);
        if mode.poses || !self.axial {
            self.sweep::<true>(field, mode, pass);
        } else {
            self.sweep::<false>(field, mode, pass);
        }
        self.close(load, pass);
    }

    /// Integrates from base to tip with all columns.
    fn sweep<const FULL: bool>(&self, field: &impl AppliedField, mode: PassMode, pass: &mut Pass) {
        let xi = &pass.unknowns;
        let mut state = State {
            position: self.base_position,
            frame: self.base_frame,
            force: Triple::new(xi[0], xi[1], xi[2]),
            moment: Triple::new(xi[3], xi[4], xi[5]),
        };
        let blocks = pass.parameters.div_ceil(2 * PAIRS_BLOCK);
        pass.base = Columns::at_clamp();
        let mut magnet_index = 0;
        for (index, part) in self.parts.iter().enumerate() {
            pass.states[index] = state;
            match part {
                Part::Section(section) if index == 0 => {
                    section.leave_clamp::<FULL>(&mut state, pass.gravity, &mut pass.base);
                }
                Part::Section(section) => {
                    // Before the first magnet the parameters have no effect yet.
                    let active = if magnet_index == 0 { 0 } else { blocks };
                    let actuation = &mut pass.actuation[..active];
                    section.carry::<FULL>(&mut state, pass.gravity, &mut pass.base, actuation);
                }
                Part::Magnet(magnet) => {
                    let first = magnet_index == 0;
                    field.evaluate(&magnet.center(&state).into(), &mut pass.sample);
                    cross_magnet::<FULL>(magnet, magnet_index, first, &mut state, mode, pass);
                    magnet_index += 1;
                }
            }
        }
        if magnet_index == 0 {
            pass.actuation[..blocks].fill(Columns::default());
        }
        pass.states[self.parts.len()] = state;
    }

    /// Residual, Newton step and Jacobians at the tip.
    fn close(&self, load: &TipLoad, pass: &mut Pass) {
        let tip = pass.tip();
        let force = tip.force - load.force.into();
        let moment = tip.moment - load.moment.into();
        let (force_inverse, moment_inverse) = (1.0 / self.force_unit, 1.0 / self.moment_unit);
        let force = force.scaled(force_inverse);
        let moment = moment.scaled(moment_inverse);
        pass.residual = [force.x, force.y, force.z, moment.x, moment.y, moment.z]; // (s1)
        let Ok(lu) = Lu::new(self.scaled_jacobian(&pass.base)) else {
            pass.jacobian = None;
            pass.newton_step = None;
            pass.determinant = 0.0;
            return;
        };
        pass.jacobian = Some(lu);
        pass.determinant = lu.determinant();
        let step = lu.solve(&pass.residual);
        let units: [f64; 6] =
            core::array::from_fn(|i| if i < 3 { self.force_unit } else { self.moment_unit });
        pass.newton_step = Some(Vector6::from_fn(|i, _| -step[i] * units[i])); // (s2)
        let blocks = pass.parameters.div_ceil(2 * PAIRS_BLOCK);
        for block in 0..blocks {
            let columns = &pass.actuation[block];
            let scale = |row: &[Pair; PAIRS_BLOCK], unit: f64| row.map(|pair| pair * Pair::splat(unit));
            let right: [[Pair; PAIRS_BLOCK]; 6] = core::array::from_fn(|i| {
                if i < 3 {
                    scale(&columns.force[i], force_inverse)
                } else {
                    scale(&columns.moment[i - 3], moment_inverse)
                }
            });
            let mut unknowns = lu.solve_columns(&right);
            for (row, unit) in unknowns.iter_mut().zip(units) {
                *row = scale(row, -unit); // (s3)
            }
            for (kept, row) in pass.unknowns_rows.iter_mut().zip(&unknowns) {
                let kept = kept[block * 2 * PAIRS_BLOCK..].iter_mut();
                for (entry, value) in kept.zip(row.iter().flat_map(|pair| [pair.low(), pair.high()])) {
                    *entry = value;
                }
            }
            for magnet in &mut pass.magnets {
                magnet.finish(block, &unknowns, pass.poses);
            }
        }
    }

    /// dr/dxi in units of the residual.
    #[inline(always)]
    pub(super) fn scaled_jacobian(&self, base: &Columns<PAIRS_CLAMPED>) -> [[f64; 6]; 6] {
        let lever = self.moment_unit / self.force_unit;
        let shrink = 1.0 / lever;
        core::array::from_fn(|i| {
            let row = if i < 3 { &base.force[i] } else { &base.moment[i - 3] };
            let (by_force, by_moment) = if i < 3 { (1.0, lever) } else { (shrink, 1.0) };
            [
                row[0].low() * by_force,
                row[0].high() * by_force,
                row[1].low() * by_force,
                row[1].high() * by_moment,
                row[2].low() * by_moment,
                row[2].high() * by_moment,
            ]
        })
    }
}

/// Carries state and columns across a magnet and notes what is known there.
#[inline(always)]
fn cross_magnet<const FULL: bool>(
    magnet: &Magnet,
    index: usize,
    first: bool,
    state: &mut State,
    mode: PassMode,
    pass: &mut Pass,
) {
    let parameters = pass.parameters;
    let blocks = parameters.div_ceil(2 * PAIRS_BLOCK);
    let out = &mut pass.magnets[index];
    out.center = magnet.center(state);
    out.frame = state.frame;
    out.field = pass.sample.field;
    out.gradient = pass.sample.gradient;
    out.second_gradient = pass.sample.second_gradient;
    out.field_valid = pass.sample.valid;
    let jump = magnet.cross(state, pass.gravity, &pass.sample, mode.wrenches);
    out.force = jump.force;
    out.weight = pass.gravity.scaled(magnet.mass);
    out.torque = jump.torque;
    out.rotation_by_base = pass.base.rotation;
    jump.carry::<FULL, PAIRS_CLAMPED>(&mut pass.base, &mut out.center_by_base);
    for block in 0..blocks {
        let columns = &mut pass.actuation[block];
        if first {
            *columns = Columns::default();
        }
        out.rotation_by_parameters[block] = columns.rotation;
        if first {
            out.center_by_parameters[block] = columns.position;
        } else {
            jump.carry::<FULL, PAIRS_BLOCK>(columns, &mut out.center_by_parameters[block]);
        }
        actuate(&jump, columns, &pass.sample, block * 2 * PAIRS_BLOCK, parameters);
    }
}

#[inline(always)]
fn actuate(
    jump: &Jump,
    columns: &mut Columns<PAIRS_BLOCK>,
    sample: &FieldSample,
    offset: usize,
    parameters: usize,
) {
    for k in 0..PAIRS_BLOCK {
        let first = offset + 2 * k;
        if first < parameters {
            jump.actuate(columns, k, sample, first, first + 1 < parameters);
        }
    }
}

impl MagnetPass {
    /// The Jacobians of one block of parameters (s4), given `d xi/du`.
    #[inline(always)]
    fn finish(&mut self, block: usize, unknowns: &[[Pair; PAIRS_BLOCK]; 6], poses: bool) {
        let [d1, d2, tangent] = [self.frame.d1, self.frame.d2, self.frame.tangent].map(Triple::splat);
        let offset = block * 2 * PAIRS_BLOCK;
        let row = |axis: usize| {
            let mut row = self.rotation_by_parameters[block][axis];
            add_by_unknowns(&mut row, &self.rotation_by_base[axis], unknowns);
            row
        };
        let (about_d1, about_d2) = (row(0), row(1));
        let twist = if poses { row(2) } else { Default::default() };
        for k in 0..PAIRS_BLOCK {
            let turn = d1.scaled(about_d2[k]) - d2.scaled(about_d1[k]); // dt = phi x t
            store(&mut self.tangent_rows, offset + 2 * k, turn);
        }
        if poses {
            for k in 0..PAIRS_BLOCK {
                let world = d1.scaled(about_d1[k]) + d2.scaled(about_d2[k]) + tangent.scaled(twist[k]);
                store(&mut self.rotation_rows, offset + 2 * k, world);
            }
            let center = total(&self.center_by_parameters[block], &self.center_by_base, unknowns);
            for (k, shift) in center.into_iter().enumerate() {
                store(&mut self.position_rows, offset + 2 * k, shift);
            }
        }
    }
}

/// Derivatives at equilibrium (s4), a vector for each pair of parameters.
#[inline(always)]
pub(super) fn total(
    by_parameters: &Rows<PAIRS_BLOCK>,
    by_base: &Rows<PAIRS_CLAMPED>,
    unknowns: &[[Pair; PAIRS_BLOCK]; 6],
) -> [Triple<Pair>; PAIRS_BLOCK] {
    let mut rows = *by_parameters;
    for (row, base) in rows.iter_mut().zip(by_base) {
        add_by_unknowns(row, base, unknowns);
    }
    core::array::from_fn(|k| Triple::new(rows[0][k], rows[1][k], rows[2][k]))
}

/// Adds `(dy/dxi) (dxi/du)` to a row.
#[inline(always)]
fn add_by_unknowns(
    row: &mut [Pair; PAIRS_BLOCK],
    base: &[Pair; PAIRS_CLAMPED],
    unknowns: &[[Pair; PAIRS_BLOCK]; 6],
) {
    for (k, factors) in base.iter().enumerate() {
        let (low, high) = (factors.splat_low(), factors.splat_high());
        for column in 0..PAIRS_BLOCK {
            let (by_low, by_high) = (unknowns[2 * k][column], unknowns[2 * k + 1][column]);
            row[column] = if Pair::FUSED {
                high.times_plus(by_high, low.times_plus(by_low, row[column]))
            } else {
                row[column] + (low * by_low + high * by_high)
            };
        }
    }
}

#[inline(always)]
fn store(rows: &mut JacobianRows, first: usize, value: Triple<Pair>) {
    for (row, pair) in rows.iter_mut().zip([value.x, value.y, value.z]) {
        row[first] = pair.low();
        row[first + 1] = pair.high();
    }
}

impl Section {
    /// Integrates a section that starts at the clamp.
    #[inline]
    pub(super) fn leave_clamp<const FULL: bool>(
        &self,
        state: &mut State,
        gravity: Triple,
        base: &mut Columns<PAIRS_CLAMPED>,
    ) {
        let transition = match (self.extensible, FULL && self.curved) {
            (false, false) => {
                self.advance::<false, FULL, false, PAIRS_CLAMPED, LANES_CLAMPED>(state, gravity)
            }
            (true, false) => self.advance::<true, FULL, false, PAIRS_CLAMPED, LANES_CLAMPED>(state, gravity),
            (false, true) => self.advance::<false, true, true, PAIRS_CLAMPED, LANES_CLAMPED>(state, gravity),
            (true, true) => self.advance::<true, true, true, PAIRS_CLAMPED, LANES_CLAMPED>(state, gravity),
        };
        base.leave_clamp(&transition);
    }

    /// Integrates a section further on, with all columns.
    #[inline]
    pub(super) fn carry<const FULL: bool>(
        &self,
        state: &mut State,
        gravity: Triple,
        base: &mut Columns<PAIRS_CLAMPED>,
        actuation: &mut [Columns<PAIRS_BLOCK>],
    ) {
        if FULL {
            let transition = match (self.extensible, self.curved) {
                (false, false) => self.advance::<false, true, false, PAIRS_FULL, LANES_FULL>(state, gravity),
                (true, false) => self.advance::<true, true, false, PAIRS_FULL, LANES_FULL>(state, gravity),
                (false, true) => self.advance::<false, true, true, PAIRS_FULL, LANES_FULL>(state, gravity),
                (true, true) => self.advance::<true, true, true, PAIRS_FULL, LANES_FULL>(state, gravity),
            };
            base.cross_section(&transition);
            actuation.iter_mut().for_each(|columns| columns.cross_section(&transition));
        } else {
            let transition = if self.extensible {
                self.advance::<true, false, false, PAIRS_AXIAL, LANES_AXIAL>(state, gravity)
            } else {
                self.advance::<false, false, false, PAIRS_AXIAL, LANES_AXIAL>(state, gravity)
            };
            base.cross_section(&transition);
            actuation.iter_mut().for_each(|columns| columns.cross_section(&transition));
        }
    }
}
