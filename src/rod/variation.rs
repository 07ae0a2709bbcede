//! Variations of a section's state, carried over one Runge-Kutta step: the rates (r6) and the step (r7) of
//! `section`, linearised.
//!
//! Columns travel side by side in the lanes of one register ([`Columnar`]): they all undergo the same arithmetic.

use crate::math::{Columnar, Pair, Scalar, Triple};

/// Linearisation of the rates at one stage, every number once for each column that travels along.
/// Each sort of section reads its own part; the compiler drops the rest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage<V> {
    pub t_factor: Triple<V>,
    pub mu_factor: Triple<V>,
    pub nu_factor: Triple<V>,
    /// By unit forces x, y, z, none.
    pub m_by_force: [Triple<V>; 2],
    pub p_by_force: [Triple<V>; 2],
    pub stretch_nu: Triple<V>,
    pub lateral: Triple<V>,
    pub t_weight: Triple<V>,
    pub sigma_weight: V,
    pub t: Triple<V>,
    pub d1: Triple<V>,
    pub d2: Triple<V>,
    pub d1_factor: Triple<V>,
    pub twist: V,
    pub torsion: V,
    pub u1: V,
    pub u2: V,
}

/// Variations of the scaled state, some columns at a time; `p` is three times the travel in half steps.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Column<V> {
    pub p: Triple<V>,
    pub t: Triple<V>,
    pub mu: Triple<V>,
    pub d1: Triple<V>,
}

impl<V: Columnar> Column<V> {
    /// Columns out of pairs of columns; zero past the last.
    #[inline(always)]
    pub(super) fn of_pairs<const P: usize>(pairs: [Column<Pair>; P]) -> Self {
        Self {
            p: Triple::of_pairs(pairs.map(|pair| pair.p)),
            t: Triple::of_pairs(pairs.map(|pair| pair.t)),
            mu: Triple::of_pairs(pairs.map(|pair| pair.mu)),
            d1: Triple::of_pairs(pairs.map(|pair| pair.d1)),
        }
    }

    /// One pair of the columns.
    #[inline(always)]
    pub(super) fn pair(&self, index: usize) -> Column<Pair> {
        Column {
            p: self.p.pair(index),
            t: self.t.pair(index),
            mu: self.mu.pair(index),
            d1: self.d1.pair(index),
        }
    }

    /// The step (r7), linearised. `FORCE` says which of the unit forces x, y, z, none these columns belong to: the
    /// first of them (0), those after as many as travel together (1), anything else for no force. `FULL` carries the
    /// variation of d1.
    #[inline(always)]
    pub(super) fn step<const EXTENSIBLE: bool, const FULL: bool, const CURVED: bool, const FORCE: usize>(
        &mut self,
        stages: &[Stage<V>; 4],
    ) {
        self.stepped::<EXTENSIBLE, FULL>(|y, stage, onto| {
            let stage = &stages[stage];
            let (m, p) = if FORCE < 2 {
                (Some(stage.m_by_force[FORCE]), Some(stage.p_by_force[FORCE]))
            } else {
                (None, None)
            };
            y.moved::<EXTENSIBLE, FULL, CURVED>(stage, m, p, onto)
        });
    }

    /// As [`Self::step`], of columns with a variation of the force of their own at each stage, N.
    #[inline(always)]
    pub(super) fn step_under<const EXTENSIBLE: bool, const CURVED: bool>(
        &mut self,
        stages: &[Stage<V>; 4],
        forces: &[Triple<V>; 4],
    ) {
        self.stepped::<EXTENSIBLE, true>(|y, stage, onto| {
            let force = forces[stage];
            let stage = &stages[stage];
            let m = by_force(&stage.m_by_force, force);
            let p = by_force(&stage.p_by_force, force);
            y.moved::<EXTENSIBLE, true, CURVED>(stage, Some(m), Some(p), onto)
        });
    }

    /// The step (r7); `moved(y, stage, onto)` is `onto` and the rates at a variation `y` and a stage, with the rate of
    /// travel alone.
    #[inline(always)]
    fn stepped<const EXTENSIBLE: bool, const FULL: bool>(
        &mut self,
        moved: impl Fn(&Self, usize, &Self) -> Self,
    ) {
        let y1 = *self;
        let y2 = moved(&y1, 0, &y1);
        let y3 = moved(&y2, 1, &y1);
        let y4 = moved(&y3, 2, &y1);
        let third = |a, b, c, d| combine_columns(a, b, c, d);
        let sum = Self {
            p: y1.p,
            t: third(y1.t, y2.t, y3.t, y4.t),
            mu: third(y1.mu, y2.mu, y3.mu, y4.mu),
            d1: if FULL { third(y1.d1, y2.d1, y3.d1, y4.d1) } else { y1.d1 },
        };
        let y5 = moved(&y4, 3, &sum);
        let p = if EXTENSIBLE {
            y1.p + (y2.p + y3.p) + (y4.p + y5.p)
        } else {
            let middle = y2.t + y3.t;
            y1.p + (y1.t + y4.t) + (middle + middle)
        };
        *self = Self { p, ..y5 };
    }

    /// `onto` and the rates (r6), linearised; of the travel the rate alone. `m` and `p` are what a force does.
    #[inline(always)]
    fn moved<const EXTENSIBLE: bool, const FULL: bool, const CURVED: bool>(
        &self,
        at: &Stage<V>,
        m: Option<Triple<V>>,
        p: Option<Triple<V>>,
        onto: &Self,
    ) -> Self {
        let mut moved = Self { p: Triple::default(), d1: onto.d1, ..*self };
        let mut lateral = None;
        if EXTENSIBLE {
            let sigma = at.stretch_nu.dot(self.t);
            lateral = Some(at.lateral.scaled(sigma));
            moved.p = at.t_weight.scaled(sigma) + self.t.scaled(at.sigma_weight);
            if let Some(p) = p {
                moved.p = moved.p + p;
            }
        }
        moved.mu = plus(plus(onto.mu, m), lateral);
        moved.mu = at.nu_factor.cross_plus(self.t, moved.mu);
        moved.t = self.mu.cross_plus(at.t_factor, at.mu_factor.cross_plus(self.t, onto.t));
        if FULL {
            let d2 = self.t.cross(at.d1) + at.t.cross(self.d1);
            let torsion = at.twist * (self.t.dot(at.mu_factor) + at.t_factor.dot(self.mu));
            moved.d1 = self.mu.cross_plus(at.d1_factor, at.mu_factor.cross_plus(self.d1, onto.d1));
            moved.d1 = moved.d1 + at.d2.scaled(torsion) + d2.scaled(at.torsion);
            if CURVED {
                moved.t = moved.t + self.d1.scaled(at.u2) - d2.scaled(at.u1);
                moved.d1 = moved.d1 - self.t.scaled(at.u2);
            }
        }
        moved
    }
}

#[inline(always)]
fn plus<V: Scalar>(sum: Triple<V>, more: Option<Triple<V>>) -> Triple<V> {
    more.map_or(sum, |more| sum + more)
}

/// What (r7) has without the last rate, which has its third already.
#[inline(always)]
fn combine_columns<V: Columnar>(y1: Triple<V>, y2: Triple<V>, y3: Triple<V>, y4: Triple<V>) -> Triple<V> {
    ((y2 + y3) + (y3 + y4) - y1).scaled(V::splat(1.0 / 3.0))
}

/// What a force does, by what unit forces do.
#[inline(always)]
fn by_force<V: Columnar>(unit_forces: &[Triple<V>; 2], force: Triple<V>) -> Triple<V> {
    let column = |axis: usize| {
        let Triple { x, y, z } = unit_forces[axis / (2 * V::PAIRS)].pair(axis / 2 % V::PAIRS);
        Triple::new(x.lane(axis % 2), y.lane(axis % 2), z.lane(axis % 2)).in_all::<V>()
    };
    column(0).scaled(force.x) + column(1).scaled(force.y) + column(2).scaled(force.z)
}

#[cfg(test)]
mod tests {
    use super::Column;
    use crate::math::{Columnar, Pair, Quad, Triple};
    use crate::rod::section::{Node, Section};
    use magsteer_hal::description::{ExtensibleStiffness, SectionDescription};

    fn section() -> Section {
        let description = SectionDescription {
            length: 8e-3,
            radius: 1.5e-3,
            bending_stiffness: 2e-5,
            torsion_stiffness: 1.4e-5,
            mass_per_length: 7e-3,
            precurvature: [3.0, -5.0, 8.0],
            extensible: Some(ExtensibleStiffness { shear: 12.0, axial: 30.0 }),
        };
        Section::new(&description, 2e-3)
    }

    /// Four columns of some pairs, none of them alike.
    fn pairs() -> [Column<Pair>; 2] {
        let triple = |first: f64| {
            let pair = |value: f64| Pair::new(value.sin(), value.cos());
            Triple::new(pair(first), pair(first + 0.7), pair(first + 1.9))
        };
        [0.0, 5.0].map(|first| Column {
            p: triple(first),
            t: triple(first + 1.0),
            mu: triple(first + 2.0),
            d1: triple(first + 3.0),
        })
    }

    fn assert_near(four: &Column<Quad>, two: &[Column<Pair>; 2]) {
        for (index, expected) in two.iter().enumerate() {
            let found = four.pair(index);
            let parts = [
                (found.p, expected.p),
                (found.t, expected.t),
                (found.mu, expected.mu),
                (found.d1, expected.d1),
            ];
            for (found, expected) in parts {
                for (found, expected) in [(found.x, expected.x), (found.y, expected.y), (found.z, expected.z)]
                {
                    for lane in 0..2 {
                        // One rounding or two a product: columns of order one differ by some of the last digits.
                        let difference = (found.lane(lane) - expected.lane(lane)).abs();
                        assert!(difference < 1e-13, "{difference}");
                    }
                }
            }
        }
    }

    /// Goal: what a build for a wider processor carries four at a time is what any build carries two at a time.
    #[test]
    fn four_columns_step_as_two_pairs_do_whatever_the_section() {
        fn check<const EXTENSIBLE: bool, const FULL: bool, const CURVED: bool>() {
            let section = section();
            let mut node = Node {
                t: Triple::new(0.6, 0.0, 0.8),
                d1: Triple::new(0.0, 1.0, 0.0),
                mu: Triple::new(0.3, -0.2, 0.1),
                nu: Triple::new(-0.05, 0.2, 0.12),
            };
            let (mut beside, mut travel, weight) = (node, Triple::default(), Triple::new(0.0, 0.0, -0.01));
            let (mut two, mut unforced) = (pairs(), pairs());
            let (mut four, mut four_unforced) = (Column::of_pairs(two), Column::of_pairs(unforced));
            for _ in 0..section.segments {
                let stages =
                    section.step_linearised::<Pair, EXTENSIBLE, CURVED>(&mut node, &mut travel, weight);
                two[0].step::<EXTENSIBLE, FULL, CURVED, 0>(&stages);
                two[1].step::<EXTENSIBLE, FULL, CURVED, 1>(&stages);
                unforced.iter_mut().for_each(|pair| pair.step::<EXTENSIBLE, FULL, CURVED, 2>(&stages));
                let stages =
                    section.step_linearised::<Quad, EXTENSIBLE, CURVED>(&mut beside, &mut travel, weight);
                four.step::<EXTENSIBLE, FULL, CURVED, 0>(&stages);
                four_unforced.step::<EXTENSIBLE, FULL, CURVED, 2>(&stages);
            }
            assert_near(&four, &two);
            assert_near(&four_unforced, &unforced);
            // The first pair is moved by unit forces, so that the two are not the same by being nothing.
            assert_ne!(four.pair(0).mu, four_unforced.pair(0).mu);
        }
        check::<false, false, false>();
        check::<true, false, false>();
        check::<false, true, true>();
        check::<true, true, true>();
    }

    /// Goal: a force of a column's own acts as the unit forces do, in every lane.
    #[test]
    fn columns_under_forces_of_their_own_add_up_from_unit_forces() {
        let section = section();
        let node = Node {
            t: Triple::new(0.0, 0.6, 0.8),
            d1: Triple::new(1.0, 0.0, 0.0),
            mu: Triple::new(0.2, 0.1, -0.3),
            nu: Triple::new(0.1, -0.1, 0.05),
        };
        let (force, weight) = (Triple::new(0.3, -0.7, 1.1), Triple::default());
        let by = |numbers: Triple| Triple::of_columns(numbers, numbers.scaled(-2.0));
        let stages =
            section.step_linearised::<Pair, true, true>(&mut { node }, &mut Triple::default(), weight);
        let mut two = Column::default();
        two.step_under::<true, true>(&stages, &[by(force); 4]);
        let stages =
            section.step_linearised::<Quad, true, true>(&mut { node }, &mut Triple::default(), weight);
        let mut four = Column::<Quad>::default();
        four.step_under::<true, true>(&stages, &[Triple::of_pairs([by(force), by(force)]); 4]);
        assert_near(&four, &[two, two]);
        let mut units = Column::<Quad>::default();
        units.step::<true, true, true, 0>(&stages);
        let (xy, z) = (units.pair(0).mu, units.pair(1).mu);
        let sum = xy.x.low() * force.x + xy.x.high() * force.y + z.x.low() * force.z;
        assert!((sum - two.mu.x.low()).abs() < 1e-15 + 1e-13 * sum.abs(), "{sum} {:?}", two.mu.x);
        assert!(sum.abs() > 0.0 && Quad::PAIRS == 2);
    }
}
