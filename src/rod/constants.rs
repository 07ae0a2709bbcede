//! Derivatives of an equilibrium with what the manipulator is: clamp, stiffness, moments, weight.
//!
//! # Problem
//! A pass differentiates with the actuation. Who estimates the manipulator's constants from measured
//! equilibria, or asks how well they must be known, needs the derivatives with those, as exact as the
//! others.
//!
//! # Method
//! As a pass: columns are carried from base to tip, and the condition at the tip is kept by (s3), (s4) of
//! `shooting`. They begin, or are added to, where the constant acts:
//! ```text
//! clamp:    dp = e_k;   phi = R' e_k, a turn about a world axis                                (k1)
//! moment:   dF = F, dT = T at its magnet, per logarithm                                        (k2)
//! gravity:  dn' = -rhoA g in a section, dF = M g at a magnet, per logarithm                    (k3)
//! stiffness, all of a section's by one factor, per logarithm:
//!           d(end) = -(d(end)/dn n + d(end)/dm m + d(end)/dg g), and m, n of the end added     (k4)
//! ```
//! (k4) holds because a section's shape depends on loads over stiffness alone: stiffer by a factor, it
//! takes the same shape under loads that are greater by it. The same is true of the discrete scheme, whose
//! scaled variables are those ratios. n, m are those at the section's start.
//!
//! A sweep of its own after a pass: a control cycle never asks for it and pays nothing.

use nalgebra::{Vector3, Vector6};

use crate::magnetics::AppliedField;
use crate::math::{Pair, Triple};

use super::magnet::{Magnet, Wrenches};
use super::manipulator::{Manipulator, Part};
use super::pass::{PAIRS_BLOCK, Pass};
use super::section::Section;
use super::shooting::total;
use super::state::State;
use super::transition::{Columns, PAIRS_FULL, Rows, Transition};

/// Columns of a block.
const WIDTH: usize = 2 * PAIRS_BLOCK;

/// What the manipulator is, one number at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Constant {
    /// Position of the clamp along a world axis, m.
    BasePosition(usize),
    /// Turn of the clamp about a world axis, rad.
    BaseRotation(usize),
    /// Logarithm of a factor on all stiffnesses of a section; sections count from the base.
    Stiffness(usize),
    /// Logarithm of a factor on the dipole moment of a magnet; magnets count from the base.
    Moment(usize),
    /// Logarithm of a factor on gravity.
    Gravity,
}

/// Derivatives with every constant. Allocated once.
#[derive(Debug, Clone)]
pub struct ByConstants {
    constants: Vec<Constant>,
    columns: Vec<Columns<PAIRS_BLOCK>>,
    /// Variations of centre and rotation of each magnet, block by block, at fixed base unknowns.
    magnets: Vec<Vec<(Rows<PAIRS_BLOCK>, Rows<PAIRS_BLOCK>)>>,
    /// Derivatives at equilibrium, magnet by magnet, then constant by constant.
    tangents: Vec<Vec<Vector3<f64>>>,
    positions: Vec<Vec<Vector3<f64>>>,
    unknowns: Vec<Vector6<f64>>,
}

impl ByConstants {
    /// Storage for the constants of `manipulator`.
    #[must_use]
    pub fn new(manipulator: &Manipulator) -> Self {
        let sections = manipulator.sections().count();
        let magnets = manipulator.magnet_count();
        let base = (0..3).map(Constant::BasePosition).chain((0..3).map(Constant::BaseRotation));
        let chain = (0..sections).map(Constant::Stiffness).chain((0..magnets).map(Constant::Moment));
        let constants: Vec<Constant> = base.chain(chain).chain([Constant::Gravity]).collect();
        let blocks = constants.len().div_ceil(WIDTH);
        let count = constants.len();
        let zero = [[Pair::default(); PAIRS_BLOCK]; 3];
        Self {
            constants,
            columns: vec![Columns::default(); blocks],
            magnets: vec![vec![(zero, zero); blocks]; magnets],
            tangents: vec![vec![Vector3::zeros(); count]; magnets],
            positions: vec![vec![Vector3::zeros(); count]; magnets],
            unknowns: vec![Vector6::zeros(); count],
        }
    }

    /// The constants, in the order of the columns.
    #[must_use]
    pub fn constants(&self) -> &[Constant] {
        &self.constants
    }

    /// Change of a magnet's tangent with each constant.
    ///
    /// # Panics
    /// When there is no such magnet.
    #[must_use]
    pub fn tangent(&self, magnet: usize) -> &[Vector3<f64>] {
        &self.tangents[magnet]
    }

    /// Change of a magnet's centre with each constant, m per unit.
    ///
    /// # Panics
    /// When there is no such magnet.
    #[must_use]
    pub fn position(&self, magnet: usize) -> &[Vector3<f64>] {
        &self.positions[magnet]
    }

    /// Change of the base unknowns (force N, moment N m) with each constant.
    #[must_use]
    pub fn unknowns(&self) -> &[Vector6<f64>] {
        &self.unknowns
    }

    /// Adds to the column of a constant.
    fn add(&mut self, constant: Constant, change: &Change) {
        let Some(index) = self.constants.iter().position(|known| *known == constant) else { return };
        let columns = &mut self.columns[index / WIDTH];
        let (pair, lane) = (index % WIDTH / 2, index % 2);
        let rows = [&mut columns.position, &mut columns.rotation, &mut columns.moment, &mut columns.force];
        let parts = [change.position, change.rotation, change.moment, change.force];
        for (rows, part) in rows.into_iter().zip(parts) {
            for (row, value) in rows.iter_mut().zip(part.array()) {
                let sum = row[pair].lane(lane) + value;
                row[pair].set_lane(lane, sum);
            }
        }
    }
}

/// Variation of a cross-section; rotation in body axes.
#[derive(Debug, Clone, Copy, Default)]
struct Change {
    position: Triple,
    rotation: Triple,
    moment: Triple,
    force: Triple,
}

impl Manipulator {
    /// Derivatives of the equilibrium in `pass` with every constant. The pass was run under `field`, was
    /// asked for poses and is left as it was, but for its scratch space. False, and nothing meaningful in
    /// `by`, when it had no Newton step.
    pub fn differentiate(&self, field: &impl AppliedField, pass: &mut Pass, by: &mut ByConstants) -> bool {
        debug_assert!(pass.poses, "a pass without poses does not know how the base unknowns twist the rod");
        let mut state = pass.states[0];
        self.hold_clamp(by);
        let (mut sections, mut magnets) = (0, 0);
        for part in &self.parts {
            match part {
                Part::Section(section) => {
                    cross_section(section, sections, &mut state, pass.gravity, by);
                    sections += 1;
                }
                Part::Magnet(magnet) => {
                    field.evaluate(&magnet.center(&state).into(), &mut pass.sample);
                    cross_magnet(magnet, magnets, &mut state, pass, by);
                    magnets += 1;
                }
            }
        }
        self.close_constants(pass, by)
    }

    /// The columns at the clamp (k1).
    fn hold_clamp(&self, by: &mut ByConstants) {
        by.columns.fill(Columns::default());
        let frame = self.base_frame;
        for axis in 0..3 {
            let unit = Triple::from(core::array::from_fn(|row| if row == axis { 1.0 } else { 0.0 }));
            by.add(Constant::BasePosition(axis), &Change { position: unit, ..Change::default() });
            let rotation = Triple::new(frame.d1.dot(unit), frame.d2.dot(unit), frame.tangent.dot(unit));
            by.add(Constant::BaseRotation(axis), &Change { rotation, ..Change::default() });
        }
    }

    /// Keeps the condition at the tip.
    fn close_constants(&self, pass: &Pass, by: &mut ByConstants) -> bool {
        let Some(lu) = pass.jacobian else { return false };
        let units = [self.force_unit, self.moment_unit];
        for block in 0..by.columns.len() {
            let columns = &by.columns[block];
            let right: [[Pair; PAIRS_BLOCK]; 6] = core::array::from_fn(|i| {
                let row = if i < 3 { columns.force[i] } else { columns.moment[i - 3] };
                row.map(|pair| pair * (1.0 / units[i / 3]))
            });
            let mut unknowns = lu.solve_columns(&right);
            for (i, row) in unknowns.iter_mut().enumerate() {
                *row = row.map(|pair| pair * -units[i / 3]); // (s3)
            }
            let first = block * WIDTH;
            let here = first..by.constants.len().min(first + WIDTH);
            for index in here.clone() {
                let (pair, lane) = ((index - first) / 2, (index - first) % 2);
                by.unknowns[index] = Vector6::from_fn(|row, _| unknowns[row][pair].lane(lane));
            }
            for (magnet, found) in pass.magnets.iter().enumerate() {
                let (center, rotation) = &by.magnets[magnet][block];
                let center = total(center, &found.center_by_base, &unknowns); // (s4)
                let rotation = total(rotation, &found.rotation_by_base, &unknowns);
                for index in here.clone() {
                    let (pair, lane) = ((index - first) / 2, (index - first) % 2);
                    let of = |triple: &Triple<Pair>| {
                        Triple::new(triple.x.lane(lane), triple.y.lane(lane), triple.z.lane(lane))
                    };
                    let turn = of(&rotation[pair]);
                    let tangent = found.frame.d1.scaled(turn.y) - found.frame.d2.scaled(turn.x);
                    by.tangents[magnet][index] = tangent.into();
                    by.positions[magnet][index] = of(&center[pair]).into();
                }
            }
        }
        true
    }
}

/// Carries all columns over a section and adds what its stiffness and its weight do.
fn cross_section(section: &Section, index: usize, state: &mut State, gravity: Triple, by: &mut ByConstants) {
    let start = *state;
    let transition = match (section.extensible, section.curved) {
        (false, false) => section.advance_weighed::<false, false>(state, gravity),
        (true, false) => section.advance_weighed::<true, false>(state, gravity),
        (false, true) => section.advance_weighed::<false, true>(state, gravity),
        (true, true) => section.advance_weighed::<true, true>(state, gravity),
    };
    for columns in &mut by.columns {
        columns.cross_section(&transition);
    }
    let weight =
        Change { force: gravity.scaled(-section.mass_per_length * section.length), ..by_weight(&transition) };
    by.add(Constant::Gravity, &weight); // (k3)
    let stiffer = by_stiffness(&transition, &start, state.moment);
    by.add(Constant::Stiffness(index), &stiffer);
}

/// Carries all columns across a magnet and adds what its moment and its weight do.
fn cross_magnet(magnet: &Magnet, index: usize, state: &mut State, pass: &Pass, by: &mut ByConstants) {
    let jump = magnet.cross(state, pass.gravity, &pass.sample, Wrenches::Following);
    for (block, columns) in by.columns.iter_mut().enumerate() {
        let (center, rotation) = &mut by.magnets[index][block];
        *rotation = columns.rotation;
        jump.carry::<true, PAIRS_BLOCK>(columns, center);
    }
    let (force, moment) = jump.by_moment();
    by.add(Constant::Moment(index), &Change { force, moment, ..Change::default() }); // (k2)
    let weight = pass.gravity.scaled(magnet.mass);
    let moment = state.frame.tangent.scaled(0.5 * magnet.length).cross(weight);
    by.add(Constant::Gravity, &Change { force: -weight, moment, ..Change::default() }); // (k3)
}

/// Change of a section's end with the logarithm of gravity within it; its force is the caller's.
fn by_weight(transition: &Transition<PAIRS_FULL>) -> Change {
    let of = |rows: &Rows<PAIRS_FULL>| Triple::from(rows.map(|row| row[PAIRS_FULL - 1].high()));
    Change {
        position: of(&transition.position),
        rotation: of(&transition.rotation),
        moment: of(&transition.moment),
        force: Triple::default(),
    }
}

/// (k4), with the moment at the section's end.
fn by_stiffness(transition: &Transition<PAIRS_FULL>, start: &State, end_moment: Triple) -> Change {
    let (n, m) = (start.force, start.moment);
    let of = |rows: &Rows<PAIRS_FULL>| {
        Triple::from(rows.map(|row| {
            row[0].low() * n.x
                + row[0].high() * n.y
                + row[1].low() * n.z
                + row[1].high() * m.x
                + row[2].low() * m.y
                + row[2].high() * m.z
        }))
    };
    let weight = by_weight(transition);
    Change {
        position: -(of(&transition.position) + weight.position),
        rotation: -(of(&transition.rotation) + weight.rotation),
        moment: end_moment - (of(&transition.moment) + weight.moment),
        force: Triple::default(), // (r2): n falls by the weight, whatever the stiffness
    }
}
