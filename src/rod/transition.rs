//! Variations carried along the chain.
//!
//! # Terms
//! A **column** is the derivative of a cross-section's state with one quantity: a base unknown (internal force or
//! moment at the clamp) or an actuation parameter. Its rows are position `dp`, rotation `phi`, moment `dm` and force
//! `dn`; `phi` is the rotation vector in *body* axes, so `dt = phi2 d1 - phi1 d2`, and the third one is the twist.
//!
//! # Method
//! A section's equations are linear in the variations and see nothing of the parameters. Within a section only
//! its own **transition** is integrated: the derivatives of its end with the force, moment and rotation at its start.
//! Any number of columns is then carried over by one product a section, so that parameters cost little.
//! At the clamp there is no rotation, and the transition *is* the derivative with the base unknowns.
//!
//! The frame is made orthonormal again at the end of a section (Runge-Kutta steps keep it only to their order), and
//! so are its variations: derivatives are those of the discrete scheme, on any mesh.

use crate::math::{Columnar, Lanes, Pair, Scalar, Triple};

use super::section::{Node, Section};
use super::state::{Frame, State};
use super::variation::Column;

/// Pairs of columns of a transition from the clamp: by force and moment.
pub const PAIRS_CLAMPED: usize = 3;
/// Pairs of columns when twist is left out: by force, moment and two rotations.
pub const PAIRS_AXIAL: usize = 4;
/// Pairs of columns with twist: by force, moment and three rotations; the last column is empty.
pub const PAIRS_FULL: usize = 5;

/// How many [`Lanes`] the pairs take up.
pub const LANES_CLAMPED: usize = PAIRS_CLAMPED.div_ceil(Lanes::PAIRS);
/// How many [`Lanes`] the pairs take up.
pub const LANES_AXIAL: usize = PAIRS_AXIAL.div_ceil(Lanes::PAIRS);
/// How many [`Lanes`] the pairs take up.
pub const LANES_FULL: usize = PAIRS_FULL.div_ceil(Lanes::PAIRS);
/// How many [`Lanes`] have a column by a force among them.
const FORCED: usize = 2 / Lanes::PAIRS;

/// A row for each axis, `P` pairs of columns.
pub type Rows<const P: usize> = [[Pair; P]; 3];

/// Derivatives of a section's end with force (columns 0 to 2), moment (3 to 5) and rotation in body
/// axes (6, 7 and 8) at its start. The end's force varies as the start's.
#[derive(Debug, Clone)]
pub struct Transition<const P: usize> {
    /// Position, relative to the start.
    pub position: Rows<P>,
    /// Rotation in the end's body axes; the third row is zero when twist is left out.
    pub rotation: Rows<P>,
    /// Moment.
    pub moment: Rows<P>,
}

/// `P` pairs of columns at a cross-section.
#[derive(Debug, Clone)]
pub struct Columns<const P: usize> {
    /// dp, m per unit.
    pub position: Rows<P>,
    /// Rotation vector in body axes, rad per unit.
    pub rotation: Rows<P>,
    /// dm, N m per unit.
    pub moment: Rows<P>,
    /// dn, N per unit.
    pub force: Rows<P>,
}

impl<const P: usize> Default for Columns<P> {
    fn default() -> Self {
        let zero = [[Pair::default(); P]; 3];
        Self { position: zero, rotation: zero, moment: zero, force: zero }
    }
}

impl Columns<PAIRS_CLAMPED> {
    /// The columns of the base unknowns at the clamp: force x, y, z, then moment x, y, z.
    #[must_use]
    pub fn at_clamp() -> Self {
        let (none, low, high) = (Pair::default(), Pair::new(1.0, 0.0), Pair::new(0.0, 1.0));
        Self {
            force: [[low, none, none], [high, none, none], [none, low, none]],
            moment: [[none, high, none], [none, none, low], [none, none, high]],
            ..Self::default()
        }
    }

    /// Carries the columns of the clamp over a section that starts there.
    #[inline]
    pub fn leave_clamp(&mut self, transition: &Transition<PAIRS_CLAMPED>) {
        self.position = transition.position;
        self.rotation = transition.rotation;
        self.moment = transition.moment;
    }
}

impl<const P: usize> Columns<P> {
    /// Carries the columns over a section.
    #[inline]
    pub fn cross_section<const Q: usize>(&mut self, transition: &Transition<Q>) {
        let starts = [
            self.force[0],
            self.force[1],
            self.force[2],
            self.moment[0],
            self.moment[1],
            self.moment[2],
            self.rotation[0],
            self.rotation[1],
            self.rotation[2],
        ];
        let twisting = Q == PAIRS_FULL;
        let zero = [Pair::default(); P];
        for axis in 0..3 {
            accumulate(&mut self.position[axis], &transition.position[axis], &starts, twisting);
            self.moment[axis] = zero;
            accumulate(&mut self.moment[axis], &transition.moment[axis], &starts, twisting);
        }
        for axis in 0..if twisting { 3 } else { 2 } {
            self.rotation[axis] = zero;
            accumulate(&mut self.rotation[axis], &transition.rotation[axis], &starts, twisting);
        }
    }
}

/// Adds one row of the product of a transition and the columns.
#[inline(always)]
fn accumulate<const P: usize, const Q: usize>(
    row: &mut [Pair; P],
    factors: &[Pair; Q],
    starts: &[[Pair; P]; 9],
    twisting: bool,
) {
    let mut sum = *row;
    for k in 0..4 {
        let (low, high) = (factors[k].splat_low(), factors[k].splat_high());
        let [by_low, by_high] = [&starts[2 * k], &starts[2 * k + 1]];
        for column in 0..P {
            sum[column] = if Pair::FUSED {
                high.times_plus(by_high[column], low.times_plus(by_low[column], sum[column]))
            } else {
                sum[column] + (low * by_low[column] + high * by_high[column])
            };
        }
    }
    if twisting {
        let low = factors[Q - 1].splat_low();
        for column in 0..P {
            sum[column] += low * starts[8][column];
        }
    }
    *row = sum;
}

impl Section {
    /// Integrates the section from `state` to its end under `gravity` (m/s^2) and returns its transition.
    /// `P` is [`PAIRS_CLAMPED`], [`PAIRS_AXIAL`] or [`PAIRS_FULL`], `G` how many lanes they take up; `FULL` carries twist.
    pub fn advance<
        const EXTENSIBLE: bool,
        const FULL: bool,
        const CURVED: bool,
        const P: usize,
        const G: usize,
    >(
        &self,
        state: &mut State,
        gravity: Triple,
    ) -> Transition<P> {
        let mut node = self.enter(state);
        let mut travel = Triple::default();
        let weight = self.weight_of_half_step(gravity);
        let mut lanes = in_lanes::<P, G>(&self.unit_columns(&state.frame));
        for _ in 0..self.segments {
            let stages = self.step_linearised::<Lanes, EXTENSIBLE, CURVED>(&mut node, &mut travel, weight);
            lanes[0].step::<EXTENSIBLE, FULL, CURVED, 0>(&stages);
            if FORCED == 2 {
                lanes[1].step::<EXTENSIBLE, FULL, CURVED, 1>(&stages);
            }
            for column in &mut lanes[FORCED..] {
                column.step::<EXTENSIBLE, FULL, CURVED, 2>(&stages);
            }
        }
        self.leave(node, travel, gravity, state);
        self.finish::<FULL, P>(&in_pairs(&lanes), (node.t, node.d1), &state.frame)
    }

    /// As [`Self::advance`] with twist. The last column, empty there, is the derivative with the logarithm of
    /// gravity.
    pub fn advance_weighed<const EXTENSIBLE: bool, const CURVED: bool>(
        &self,
        state: &mut State,
        gravity: Triple,
    ) -> Transition<PAIRS_FULL> {
        let mut node = self.enter(state);
        let mut travel = Triple::default();
        let weight = self.weight_of_half_step(gravity);
        let half = gravity.scaled(-self.mass_per_length * self.half_step); // of the force over half a step, by (r2)
        let mut lanes = in_lanes::<PAIRS_FULL, LANES_FULL>(&self.unit_columns(&state.frame));
        let last = LANES_FULL - 1;
        for index in 0..self.segments {
            let stages = self.step_linearised::<Lanes, EXTENSIBLE, CURVED>(&mut node, &mut travel, weight);
            lanes[0].step::<EXTENSIBLE, true, CURVED, 0>(&stages);
            if FORCED == 2 {
                lanes[1].step::<EXTENSIBLE, true, CURVED, 1>(&stages);
            }
            for column in &mut lanes[FORCED..last] {
                column.step::<EXTENSIBLE, true, CURVED, 2>(&stages);
            }
            let halves = 2.0 * index as f64;
            let forces = [halves, halves + 1.0, halves + 1.0, halves + 2.0].map(|count| {
                // The last pair of columns, an odd one, begins its lanes.
                Triple::of_pairs([Triple::of_columns(Triple::default(), half.scaled(count))])
            });
            lanes[last].step_under::<EXTENSIBLE, CURVED>(&stages, &forces);
        }
        self.leave(node, travel, gravity, state);
        self.finish::<true, PAIRS_FULL>(&in_pairs(&lanes), (node.t, node.d1), &state.frame)
    }

    /// As [`Self::advance`], without variations.
    pub fn traverse<const EXTENSIBLE: bool, const CURVED: bool>(&self, state: &mut State, gravity: Triple) {
        let mut node = self.enter(state);
        let mut travel = Triple::default();
        let weight = self.weight_of_half_step(gravity);
        for _ in 0..self.segments {
            self.step::<EXTENSIBLE, CURVED>(&mut node, &mut travel, weight);
        }
        self.leave(node, travel, gravity, state);
    }

    /// The state at the section's end.
    #[inline(always)]
    fn leave(&self, node: Node, travel: Triple, gravity: Triple, state: &mut State) {
        state.position = state.position + travel.scaled(self.half_step / 3.0);
        state.force = state.force - gravity.scaled(self.mass_per_length * self.length); // (r2)
        state.moment = node.mu.scaled(1.0 / self.moment_scale);
        state.frame = orthonormal(node.t, node.d1);
    }

    /// Variations at the start of the section: none by forces yet, the unit moments, the unit rotations.
    #[inline(always)]
    fn unit_columns<const P: usize>(&self, frame: &Frame) -> [Column<Pair>; P] {
        let unit = self.moment_scale;
        let mut columns = [Column::default(); P];
        columns[1].mu.x = Pair::new(0.0, unit);
        columns[2].mu.y = Pair::new(unit, 0.0);
        columns[2].mu.z = Pair::new(0.0, unit);
        if P > PAIRS_CLAMPED {
            columns[3].t = Triple::of_columns(-frame.d2, frame.d1);
            columns[3].d1 = Triple::of_columns(Triple::default(), -frame.tangent);
        }
        if P > PAIRS_AXIAL {
            columns[4].d1 = Triple::of_columns(frame.d2, Triple::default());
        }
        columns
    }

    /// Brings the columns back to metres and newton metres, and their frames to rotation vectors.
    #[inline(always)]
    fn finish<const FULL: bool, const P: usize>(
        &self,
        columns: &[Column<Pair>; P],
        raw: (Triple, Triple),
        frame: &Frame,
    ) -> Transition<P> {
        let travel_unit = Pair::splat(self.half_step / 3.0);
        let moment_unit = Pair::splat(1.0 / self.moment_scale);
        let (t_raw, d1_raw) = raw;
        let t_norm = 1.0 / t_raw.norm();
        let toward_d1 = frame.d1.scaled(t_norm).splat();
        let toward_d2 = frame.d2.scaled(-t_norm).splat();
        // d1_raw is only nearly orthogonal to the tangent: `along` of it is dropped, `across` remains.
        let along = d1_raw.dot(frame.tangent);
        let across = Pair::splat(1.0 / d1_raw.dot(frame.d1));
        let zero = [[Pair::default(); P]; 3];
        let mut transition = Transition { position: zero, rotation: zero, moment: zero };
        for (k, column) in columns.iter().enumerate() {
            let p = column.p.scaled(travel_unit);
            let m = column.mu.scaled(moment_unit);
            for (axis, value) in [p.x, p.y, p.z].into_iter().enumerate() {
                transition.position[axis][k] = value;
            }
            for (axis, value) in [m.x, m.y, m.z].into_iter().enumerate() {
                transition.moment[axis][k] = value;
            }
            let about_d1 = column.t.dot(toward_d2);
            transition.rotation[0][k] = about_d1;
            transition.rotation[1][k] = column.t.dot(toward_d1);
            if FULL {
                let twist = column.d1.dot(frame.d2.splat()) + Pair::splat(along) * about_d1;
                transition.rotation[2][k] = twist * across;
            }
        }
        transition
    }

    /// Positions and tangents at the ends of the steps, from the section's start at `state`, passed to `visit`.
    pub fn trace(&self, state: &State, gravity: Triple, mut visit: impl FnMut(Triple, Triple)) {
        let mut node = self.enter(state);
        let mut travel = Triple::default();
        let weight = self.weight_of_half_step(gravity);
        for _ in 0..self.segments {
            // The general law serves every sort of section: absent stretch and curvature are zero.
            self.step::<true, true>(&mut node, &mut travel, weight);
            visit(state.position + travel.scaled(self.half_step / 3.0), node.t.scaled(1.0 / node.t.norm()));
        }
    }
}

/// Pairs of columns as they travel.
#[inline(always)]
fn in_lanes<const P: usize, const G: usize>(pairs: &[Column<Pair>; P]) -> [Column<Lanes>; G] {
    core::array::from_fn(|index| {
        let of = |pair: usize| pairs.get(index * Lanes::PAIRS + pair).copied().unwrap_or_default();
        if Lanes::PAIRS == 1 { Column::of_pairs([of(0)]) } else { Column::of_pairs([of(0), of(1)]) }
    })
}

/// The pairs again.
#[inline(always)]
fn in_pairs<V: Columnar, const P: usize, const G: usize>(lanes: &[Column<V>; G]) -> [Column<Pair>; P] {
    core::array::from_fn(|pair| lanes[pair / V::PAIRS].pair(pair % V::PAIRS))
}

/// The frame nearest in tangent to `t`, then in its first axis to `d1`.
#[inline(always)]
fn orthonormal(t: Triple, d1: Triple) -> Frame {
    let tangent = t.scaled(1.0 / t.norm());
    let across = d1 - tangent.scaled(d1.dot(tangent));
    let d1 = across.scaled(1.0 / across.norm());
    Frame { d1, d2: tangent.cross(d1), tangent }
}
