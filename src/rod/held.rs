//! Statics under wrenches held in the world: the boundary-value problem that the paper's Algorithm 1 solves again and again.
//!
//! # Problem
//! A magnet's wrench is known beforehand and stays where it is while the rod moves. With the base unknowns `x` and the residual at
//! the free tip `r`, both in the units of the residual (EI/L^2 and EI/L), find `r(x) = 0`.
//!
//! # Method
//! Shooting with an explicit Runge-Kutta scheme of fourth order, closed by Levenberg's algorithm as the library of the paper's
//! 25th reference has it (J. Till, V. Aloi, C. Rucker, *Real-time dynamics of soft and continuum robots based on Cosserat rod models*,
//! Int. J. Robot. Res. 38(6), 2019):
//! ```text
//! (J^T J + lambda 1) dx = -J^T r                                       (h1)
//! lambda <- lambda / 2 before every step from a new x, lambda <- 2 lambda after every step that does not lessen |r|   (h2)
//! J_i = (r(x + d e_i) - r(x)) / d,   d = 1e-7 (1 + |x_i|)              (h3)
//! ```
//! (h3) takes six more sweeps an iteration; the columns that a pass carries along give the same `J` in one. Both are offered.
//! Deviations: the unknowns are scaled, so that one `lambda` serves forces and moments; the number of trials is bounded and
//! reaching the bound is an outcome, not an exception.
//!
//! Nothing here allocates, logs or panics.

use magsteer_hal::MAGNETS_MAX;
use nalgebra::{Matrix6, Vector3, Vector6};
use serde::{Deserialize, Serialize};

use crate::magnetics::Wrench;
use crate::math::Triple;

use super::magnet::Magnet;
use super::manipulator::{Manipulator, Part};
use super::section::Section;
use super::solve::{Failure, Outcome};
use super::state::State;
use super::transition::{Columns, PAIRS_CLAMPED};

/// Factor on the damping between two trials, (h2).
const ADAPTATION: f64 = 2.0;
/// Increment of the differences (h3): truncation, 1e-7 times a curvature of order one, is as small as rounding, 1e-15 / 1e-7 times
/// the amplification of shooting.
const INCREMENT: f64 = 1e-7;
/// Step, relative to the unknowns, below which nothing but rounding is left to gain.
const STEP_MIN: f64 = 1e-15;

/// How the residual's derivatives are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ResidualDerivative {
    /// Six sweeps with one unknown changed, (h3).
    Differences,
    /// Variational equations integrated along with the state.
    Variational,
}

/// Options of one solve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOptions {
    /// Scaled residual at which an equilibrium counts as found.
    pub residual_tolerance: f64,
    /// Most trial steps.
    pub iterations_max: u32,
    /// Damping `lambda` to start from.
    pub damping_start: f64,
    /// Where derivatives come from.
    pub derivative: ResidualDerivative,
}

/// The equilibrium under held wrenches. SI, world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldShape {
    /// Base unknowns: internal force (N), then moment (N m) at the clamp.
    pub unknowns: Vector6<f64>,
    /// Tangents of the magnets, unit; zero past the last magnet.
    pub tangents: [Vector3<f64>; MAGNETS_MAX],
}

impl Default for HeldShape {
    fn default() -> Self {
        Self { unknowns: Vector6::zeros(), tangents: [Vector3::zeros(); MAGNETS_MAX] }
    }
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldSolution {
    /// Whether an equilibrium was found.
    pub outcome: Outcome,
    /// Trial steps.
    pub iterations: u32,
    /// Integrations from base to tip, those for derivatives included.
    pub sweeps: u32,
    /// Scaled residual left.
    pub residual: f64,
}

impl HeldSolution {
    /// True when an equilibrium was found.
    #[must_use]
    pub fn converged(&self) -> bool {
        self.outcome == Outcome::Converged
    }
}

/// One integration from base to tip.
#[derive(Clone, Copy)]
struct Swept {
    /// In units of the residual.
    residual: Vector6<f64>,
    tangents: [Triple; MAGNETS_MAX],
}

impl Manipulator {
    /// Solves for the equilibrium under `wrenches`, one a magnet from base to tip, from the base unknowns `guess` (N, N m). Leaves the best
    /// shape found in `shape`.
    pub fn solve_held(
        &self,
        wrenches: &[Wrench],
        guess: &Vector6<f64>,
        options: &HeldOptions,
        shape: &mut HeldShape,
    ) -> HeldSolution {
        let units = self.unknown_units();
        let mut unknowns = guess.component_div(&units);
        let mut best = self.sweep_held(wrenches, guess);
        let mut length = best.residual.norm();
        let mut solution =
            HeldSolution { outcome: Outcome::Converged, iterations: 0, sweeps: 1, residual: length };
        let mut lambda = options.damping_start;
        loop {
            if length <= options.residual_tolerance {
                break;
            }
            if !length.is_finite() {
                solution.outcome = Outcome::NotConverged { why: Failure::NotFinite };
                break;
            }
            let jacobian = match options.derivative {
                ResidualDerivative::Differences => self.differenced(wrenches, &unknowns, &best.residual),
                ResidualDerivative::Variational => self.varied(wrenches, &unknowns.component_mul(&units)),
            };
            solution.sweeps += if options.derivative == ResidualDerivative::Differences { 6 } else { 1 };
            lambda /= ADAPTATION; // (h2)
            let found = self.lessen(
                wrenches,
                &Linearised { jacobian, unknowns, residual: best.residual },
                options,
                &mut lambda,
                &mut solution,
            );
            match found {
                Ok((moved, swept)) => (unknowns, best) = (moved, swept),
                Err(why) => {
                    solution.outcome = Outcome::NotConverged { why };
                    break;
                }
            }
            length = best.residual.norm();
        }
        solution.residual = length;
        shape.unknowns = unknowns.component_mul(&units);
        shape.tangents = best.tangents.map(Into::into);
        solution
    }

    /// Trial steps with rising damping until one lessens the residual.
    fn lessen(
        &self,
        wrenches: &[Wrench],
        at: &Linearised,
        options: &HeldOptions,
        lambda: &mut f64,
        solution: &mut HeldSolution,
    ) -> Result<(Vector6<f64>, Swept), Failure> {
        let units = self.unknown_units();
        let normal = at.jacobian.tr_mul(&at.jacobian);
        let right = -at.jacobian.tr_mul(&at.residual);
        loop {
            if solution.iterations == options.iterations_max {
                return Err(Failure::IterationsExhausted);
            }
            solution.iterations += 1;
            let damped = normal + Matrix6::from_diagonal_element(*lambda);
            let step = damped.cholesky().ok_or(Failure::SingularJacobian)?.solve(&right); // (h1)
            if step.norm() <= STEP_MIN * (1.0 + at.unknowns.norm()) {
                return Err(Failure::Stalled);
            }
            let moved = at.unknowns + step;
            let swept = self.sweep_held(wrenches, &moved.component_mul(&units));
            solution.sweeps += 1;
            // False as well for a residual that is not a number.
            if swept.residual.norm() < at.residual.norm() {
                return Ok((moved, swept));
            }
            *lambda *= ADAPTATION; // (h2)
        }
    }

    /// Units of the base unknowns, which are those of the residual.
    fn unknown_units(&self) -> Vector6<f64> {
        Vector6::from_fn(|row, _| if row < 3 { self.force_unit } else { self.moment_unit })
    }

    /// dr/dx by differences (h3).
    fn differenced(
        &self,
        wrenches: &[Wrench],
        unknowns: &Vector6<f64>,
        residual: &Vector6<f64>,
    ) -> Matrix6<f64> {
        let units = self.unknown_units();
        let mut jacobian = Matrix6::zeros();
        for column in 0..6 {
            let increment = INCREMENT * (1.0 + unknowns[column].abs());
            let mut beside = *unknowns;
            beside[column] += increment;
            let swept = self.sweep_held(wrenches, &beside.component_mul(&units));
            jacobian.set_column(column, &((swept.residual - residual) / increment));
        }
        jacobian
    }

    /// dr/dx by variational equations.
    fn varied(&self, wrenches: &[Wrench], unknowns: &Vector6<f64>) -> Matrix6<f64> {
        let base = if self.axial {
            self.carry_held::<false>(wrenches, unknowns)
        } else {
            self.carry_held::<true>(wrenches, unknowns)
        };
        let rows = self.scaled_jacobian(&base);
        Matrix6::from_fn(|row, column| rows[row][column])
    }

    fn carry_held<const FULL: bool>(
        &self,
        wrenches: &[Wrench],
        unknowns: &Vector6<f64>,
    ) -> Columns<PAIRS_CLAMPED> {
        let mut state = self.clamped(unknowns);
        let mut base = Columns::at_clamp();
        let mut center = [[Default::default(); PAIRS_CLAMPED]; 3];
        let mut wrenches = wrenches.iter();
        for (index, part) in self.parts.iter().enumerate() {
            match part {
                Part::Section(section) if index == 0 => {
                    section.leave_clamp::<FULL>(&mut state, self.gravity, &mut base);
                }
                Part::Section(section) => {
                    section.carry::<FULL>(&mut state, self.gravity, &mut base, &mut []);
                }
                Part::Magnet(magnet) => {
                    let [force, torque] = next_wrench(&mut wrenches);
                    let jump = magnet.cross_held(&mut state, self.gravity, force, torque);
                    jump.carry::<FULL, PAIRS_CLAMPED>(&mut base, &mut center);
                }
            }
        }
        base
    }

    /// Integrates from base to tip.
    fn sweep_held(&self, wrenches: &[Wrench], unknowns: &Vector6<f64>) -> Swept {
        let mut state = self.clamped(unknowns);
        let mut tangents = [Triple::default(); MAGNETS_MAX];
        let mut magnets = wrenches.iter().zip(&mut tangents);
        for part in &self.parts {
            match part {
                Part::Section(section) => section.cross(&mut state, self.gravity),
                Part::Magnet(magnet) => magnet.pass_held(&mut state, self.gravity, magnets.next()),
            }
        }
        let force = state.force.scaled(1.0 / self.force_unit);
        let moment = state.moment.scaled(1.0 / self.moment_unit);
        let residual = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        Swept { residual, tangents }
    }

    fn clamped(&self, unknowns: &Vector6<f64>) -> State {
        State {
            position: self.base_position,
            frame: self.base_frame,
            force: Triple::new(unknowns[0], unknowns[1], unknowns[2]),
            moment: Triple::new(unknowns[3], unknowns[4], unknowns[5]),
        }
    }
}

/// The residual around a point, everything scaled.
struct Linearised {
    jacobian: Matrix6<f64>,
    unknowns: Vector6<f64>,
    residual: Vector6<f64>,
}

/// Force and torque of the next magnet; none where none is given.
fn next_wrench<'a>(wrenches: &mut impl Iterator<Item = &'a Wrench>) -> [Triple; 2] {
    wrenches.next().map_or([Triple::default(); 2], |wrench| [wrench.force.into(), wrench.torque.into()])
}

impl Section {
    /// Integrates the section, whatever its sort, without variations.
    fn cross(&self, state: &mut State, gravity: Triple) {
        match (self.extensible, self.curved) {
            (false, false) => self.traverse::<false, false>(state, gravity),
            (true, false) => self.traverse::<true, false>(state, gravity),
            (false, true) => self.traverse::<false, true>(state, gravity),
            (true, true) => self.traverse::<true, true>(state, gravity),
        }
    }
}

impl Magnet {
    /// Crosses the magnet under its held wrench and notes its tangent.
    fn pass_held(&self, state: &mut State, gravity: Triple, held: Option<(&Wrench, &mut Triple)>) {
        let Some((wrench, tangent)) = held else {
            self.cross_held(state, gravity, Triple::default(), Triple::default());
            return;
        };
        *tangent = state.frame.tangent;
        self.cross_held(state, gravity, wrench.force.into(), wrench.torque.into());
    }
}
