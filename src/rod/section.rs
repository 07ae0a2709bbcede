//! A flexible section: one Runge-Kutta step of the rod's equations and its exact linearisation.
//!
//! # Equations
//! A Cosserat rod under gravity, in world axes, `'` = d/ds:
//! ```text
//! p'  = v = (1 + b (t.n)) t + n / GA            (r1)   b = 1/EA - 1/GA; v = t for a Kirchhoff section
//! n'  = -rhoA g                                 (r2)   so n is linear in s and known in closed form
//! m'  = -v x n = (1 + b (t.n)) n x t            (r3)   since n x n = 0
//! di' = w x di                                  (r4)
//! w   = m / EI + (1/GJ - 1/EI) (t.m) t + R u*   (r5)   equal bending stiffness about both transverse axes
//! ```
//! (r5) inserted in (r4): `t' = m x t / EI - u1 d2 + u2 d1`, so that position, tangent, force and moment of a
//! straight section close on themselves: twist needs no room in their sensitivities.
//!
//! | symbol | meaning |
//! |---|---|
//! | s, h | arc length, its step, m |
//! | p, t, d1, d2 | position; tangent and transverse axes, columns of R |
//! | n, m | internal force and moment, N, N m |
//! | u*  | curvature and twist of the unloaded section, body axes, 1/m |
//! | EI, GJ, GA, EA, rhoA | stiffnesses, mass per length |
//!
//! # Scaled variables
//! With `mu = m h / (2 EI)`, `nu = n h^2 / (4 EI)` and rates per half a step, every constant factor leaves the
//! four stages of the classical Runge-Kutta step:
//! ```text
//! rates:  T = mu x t - u1 d2 + u2 d1      M = sigma nu x t      sigma = 1 + b' (t.nu)          (r6)
//!         D = mu x d1 + (c' (t.mu) + u3) d2 - u2 t              P = sigma t + a' nu
//! y2 = y + f(y),  y3 = y + f(y2),  y4 = y + 2 f(y3),  y+ = (y2 + 2 y3 + y4 - y)/3 + f(y4)/3     (r7)
//! ```
//! (r7) is the classical scheme, rearranged so that no stage's rate has to be kept.

use magsteer_hal::description::SectionDescription;

use crate::math::{Columnar, Pair, Triple};

use super::state::State;
use super::variation::Stage;

/// Constants of a section cut into equal steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Number of steps.
    pub segments: usize,
    /// Length, m.
    pub length: f64,
    /// Bending stiffness, N m^2.
    pub bending_stiffness: f64,
    /// Mass per unit length, kg/m.
    pub mass_per_length: f64,
    /// Half of a step, m.
    pub(super) half_step: f64,
    /// `mu / m`.
    pub(super) moment_scale: f64,
    /// `nu / n`.
    pub(super) force_scale: f64,
    /// `c' = EI/GJ - 1`.
    twist: f64,
    /// `b'`.
    stretch: f64,
    /// `a'`.
    shear: f64,
    /// `u*` times half a step.
    curvature: Triple,
    /// True when it can stretch and shear.
    pub extensible: bool,
    /// True when it is precurved or pretwisted.
    pub curved: bool,
}

impl Section {
    /// Cuts a section into the fewest equal steps that are no longer than `segment_length_max` (m).
    #[must_use]
    pub fn new(description: &SectionDescription, segment_length_max: f64) -> Self {
        // A length that is a multiple of the step up to rounding must not get a step more.
        let segments = ((description.length / segment_length_max) * (1.0 - 1e-12)).ceil().max(1.0);
        let step = description.length / segments;
        let stiffness = description.bending_stiffness;
        let force_scale = step * step / (4.0 * stiffness);
        let (stretch, shear) = description.extensible.map_or((0.0, 0.0), |extensible| {
            let compliance = 1.0 / extensible.shear;
            ((1.0 / extensible.axial - compliance) / force_scale, compliance / force_scale)
        });
        Self {
            segments: segments as usize,
            length: description.length,
            bending_stiffness: stiffness,
            mass_per_length: description.mass_per_length,
            half_step: 0.5 * step,
            moment_scale: step / (2.0 * stiffness),
            force_scale,
            twist: stiffness / description.torsion_stiffness - 1.0,
            stretch,
            shear,
            curvature: Triple::from(description.precurvature).scaled(0.5 * step),
            extensible: description.extensible.is_some(),
            curved: description.precurvature.iter().any(|component| *component != 0.0),
        }
    }

    /// Scaled state at the start of the section.
    #[inline(always)]
    pub(super) fn enter(&self, state: &State) -> Node {
        Node {
            t: state.frame.tangent,
            d1: state.frame.d1,
            mu: state.moment.scaled(self.moment_scale),
            nu: state.force.scaled(self.force_scale),
        }
    }

    /// By how much `nu` falls over half a step under `gravity` (m/s^2).
    #[inline(always)]
    pub(super) fn weight_of_half_step(&self, gravity: Triple) -> Triple {
        gravity.scaled(self.mass_per_length * self.half_step * self.force_scale)
    }

    /// One Runge-Kutta step (r7): moves `node` and adds three times the travel in half steps to `travel`.
    #[inline(always)]
    pub(super) fn step<const EXTENSIBLE: bool, const CURVED: bool>(
        &self,
        node: &mut Node,
        travel: &mut Triple,
        weight: Triple,
    ) {
        self.step_linearised::<Pair, EXTENSIBLE, CURVED>(node, travel, weight);
    }

    /// As [`Self::step`]; returns the stages' linearisation.
    #[inline(always)]
    pub(super) fn step_linearised<V: Columnar, const EXTENSIBLE: bool, const CURVED: bool>(
        &self,
        node: &mut Node,
        travel: &mut Triple,
        weight: Triple,
    ) -> [Stage<V>; 4] {
        let y1 = *node;
        let nu_middle = y1.nu - weight;
        let nu_end = nu_middle - weight; // (r2)
        let f1 = self.rates::<EXTENSIBLE, CURVED>(&y1);
        let y2 = y1.moved(&f1, 1.0, nu_middle);
        let f2 = self.rates::<EXTENSIBLE, CURVED>(&y2);
        let y3 = y1.moved(&f2, 1.0, nu_middle);
        let f3 = self.rates::<EXTENSIBLE, CURVED>(&y3);
        let y4 = y1.moved(&f3, 2.0, nu_end);
        let f4 = self.rates::<EXTENSIBLE, CURVED>(&y4);
        *node = Node {
            t: combine(y1.t, y2.t, y3.t, y4.t, f4.t),
            d1: combine(y1.d1, y2.d1, y3.d1, y4.d1, f4.d1),
            mu: combine(y1.mu, y2.mu, y3.mu, y4.mu, f4.mu),
            nu: nu_end,
        };
        *travel = *travel + (f1.p + f4.p) + (f2.p + f3.p).scaled(2.0);
        [
            self.stage::<V, EXTENSIBLE>(&y1, &f1, 1.0, 1.0),
            self.stage::<V, EXTENSIBLE>(&y2, &f2, 1.0, 2.0),
            self.stage::<V, EXTENSIBLE>(&y3, &f3, 2.0, 2.0),
            self.stage::<V, EXTENSIBLE>(&y4, &f4, 1.0 / 3.0, 1.0),
        ]
    }

    /// Torsional stiffness `GJ`, N m^2.
    pub(super) fn torsion_stiffness(&self) -> f64 {
        self.bending_stiffness / (1.0 + self.twist)
    }

    /// Shear and axial stiffness `GA`, `EA`, N; infinite when it can neither shear nor stretch.
    pub(super) fn extensional_stiffness(&self) -> [f64; 2] {
        [self.shear, self.shear + self.stretch].map(|scaled| 1.0 / (scaled * self.force_scale))
    }

    /// `v` (r1) where the tangent is `t` and the scaled force `nu`.
    #[inline(always)]
    pub(super) fn velocity(&self, t: Triple, nu: Triple) -> Triple {
        t.scaled(1.0 + self.stretch * t.dot(nu)) + nu.scaled(self.shear)
    }

    /// The rates (r6).
    #[inline(always)]
    pub(super) fn rates<const EXTENSIBLE: bool, const CURVED: bool>(&self, y: &Node) -> Rates {
        let d2 = y.t.cross(y.d1);
        let lateral = y.nu.cross(y.t);
        let mut rates = Rates {
            p: y.t,
            t: y.mu.cross(y.t),
            d1: y.mu.cross(y.d1),
            mu: lateral,
            d2,
            sigma: 1.0,
            torsion: self.twist * y.t.dot(y.mu),
            lateral,
        };
        if EXTENSIBLE {
            rates.sigma = 1.0 + self.stretch * y.t.dot(y.nu);
            rates.mu = lateral.scaled(rates.sigma);
            rates.p = y.t.scaled(rates.sigma) + y.nu.scaled(self.shear);
        }
        if CURVED {
            let Triple { x: u1, y: u2, z: u3 } = self.curvature;
            rates.t = rates.t + y.d1.scaled(u2) - d2.scaled(u1);
            rates.torsion += u3;
            rates.d1 = rates.d1 - y.t.scaled(u2);
        }
        rates.d1 = rates.d1 + d2.scaled(rates.torsion);
        rates
    }

    /// Linearisation of the rates at `y`, times `factor`; that of the travel times `weight`.
    #[inline(always)]
    fn stage<V: Columnar, const EXTENSIBLE: bool>(
        &self,
        y: &Node,
        f: &Rates,
        factor: f64,
        weight: f64,
    ) -> Stage<V> {
        let unit = self.force_scale;
        let t = y.t;
        let mut m_by_force = units_cross(t, unit * factor * f.sigma);
        let mut p_by_force = [Triple::default(); 3];
        if EXTENSIBLE {
            let stretch = unit * self.stretch;
            let [shear_x, shear_y, shear_z] = diagonal(weight * unit * self.shear);
            for (column, along) in m_by_force.iter_mut().zip(t.array()) {
                *column = *column + f.lateral.scaled(factor * stretch * along);
            }
            p_by_force = [
                t.scaled(weight * stretch * t.x) + shear_x,
                t.scaled(weight * stretch * t.y) + shear_y,
                t.scaled(weight * stretch * t.z) + shear_z,
            ];
        }
        Stage {
            t_factor: t.scaled(factor).in_all(),
            mu_factor: y.mu.scaled(factor).in_all(),
            nu_factor: y.nu.scaled(factor * f.sigma).in_all(),
            m_by_force: in_pairs(m_by_force),
            p_by_force: in_pairs(p_by_force),
            stretch_nu: y.nu.scaled(self.stretch).in_all(),
            lateral: f.lateral.scaled(factor).in_all(),
            t_weight: t.scaled(weight).in_all(),
            sigma_weight: V::splat(f.sigma * weight),
            t: t.in_all(),
            d1: y.d1.in_all(),
            d2: f.d2.in_all(),
            d1_factor: y.d1.scaled(factor).in_all(),
            twist: V::splat(self.twist),
            torsion: V::splat(f.torsion * factor),
            u1: V::splat(self.curvature.x * factor),
            u2: V::splat(self.curvature.y * factor),
        }
    }
}

/// Scaled state within a section.
#[derive(Debug, Clone, Copy)]
pub(super) struct Node {
    pub t: Triple,
    pub d1: Triple,
    pub mu: Triple,
    pub nu: Triple,
}

impl Node {
    #[inline(always)]
    fn moved(&self, f: &Rates, factor: f64, nu: Triple) -> Self {
        Self {
            t: self.t + f.t.scaled(factor),
            d1: self.d1 + f.d1.scaled(factor),
            mu: self.mu + f.mu.scaled(factor),
            nu,
        }
    }
}

/// Rates per half a step and what they are made of.
pub(super) struct Rates {
    p: Triple,
    pub t: Triple,
    d1: Triple,
    pub mu: Triple,
    d2: Triple,
    sigma: f64,
    torsion: f64,
    /// `nu x t`
    lateral: Triple,
}

#[inline(always)]
fn combine(y1: Triple, y2: Triple, y3: Triple, y4: Triple, f4: Triple) -> Triple {
    ((y2 + y3) + (y3 + y4) - y1 + f4).scaled(1.0 / 3.0) // (r7)
}

/// `factor e_k x t` for the three unit vectors.
#[inline(always)]
fn units_cross(t: Triple, factor: f64) -> [Triple; 3] {
    let t = t.scaled(factor);
    [Triple::new(0.0, -t.z, t.y), Triple::new(t.z, 0.0, -t.x), Triple::new(-t.y, t.x, 0.0)]
}

#[inline(always)]
fn diagonal(entry: f64) -> [Triple; 3] {
    [Triple::new(entry, 0.0, 0.0), Triple::new(0.0, entry, 0.0), Triple::new(0.0, 0.0, entry)]
}

/// The columns x, y, z, none.
#[inline(always)]
fn in_pairs<V: Columnar>([x, y, z]: [Triple; 3]) -> [Triple<V>; 2] {
    let pairs = [Triple::of_columns(x, y), Triple::of_columns(z, Triple::default())];
    let [first, second] = pairs;
    if V::PAIRS == 1 {
        [Triple::of_pairs([first]), Triple::of_pairs([second])]
    } else {
        [Triple::of_pairs(pairs), Triple::default()]
    }
}
