//! The statics that the controller believes in, kept at the present actuation by a few shooting passes a cycle.
//!
//! Currents and angles change little between two cycles, so that the last equilibrium, led along its own derivatives, is a good guess
//! and about one pass a cycle keeps up. A pass that comes close enough gives tangents and Jacobian of this cycle; else the last
//! good Jacobian stays in use and its age is reported, for the supervisor to judge. After a jump too large for one cycle the model
//! starts again from the last equilibrium, half as far, until it has caught up; where that branch has ended it begins anew from rest.
//!
//! Magnetic stiffness can make an equilibrium lose its stability long before a current meets its limit: the rod snaps through. The
//! lowest eigenvalue of its second variation, 1 without loads and 0 there, is the margin that every cycle reports.
//!
//! What the allocation raises in the null space of the targets is the determinant of the residual's Jacobian instead, the product of all
//! eigenvalues: 1 without loads and 0 at a snap-through as well, but it counts the deformations that loads stiffen too, on which
//! the loop's swing depends. Of 200 random plants all settle with a determinant of 2 wanted, and 86 % with a margin of 0.5, which fail at
//! (60, 90): there both hold a margin of 0.4, with determinants of 1.9 and 0.8. Its gradient with the actuation, and on request those
//! of the margin and of the expected power, come from one extra pass a cycle, for one parameter after another.

use magsteer_hal::{Actuation, COILS_MAX, HardwareDescription, MAGNETS_MAX};
use nalgebra::{Vector3, Vector6};

use super::algorithm_1::{HeldPose, Present};
use super::probe::Probe;
use super::step::{Equilibrium, ModelReport};
use crate::magnetics::{CoilArray, PARAMETERS_MAX, PosedArray};
use crate::rod::{Manipulator, Pass, PassMode, Stability, TipLoad};

/// Scaled residual below which a pass's sensitivities are used: the distance to equilibrium is then some 1e-4 of the
/// rod's full deflection, far below the sensor's noise.
const RESIDUAL_USABLE: f64 = 1e-3;
/// Scaled residual above which another pass is spent in the same cycle: below, what is left is some 1e-5 of the rod's
/// full deflection, which is the error of its mesh.
const RESIDUAL_SETTLED: f64 = 1e-4;

/// Least share of the ranges that a cycle tries to go, less than a cycle's slew. Where even that fails the branch has ended.
const REACH_MIN: f64 = 1e-3;
/// Share that it tries first on the way back from rest.
const REACH_FROM_REST: f64 = 0.05;

/// Array and manipulator at the present actuation.
#[derive(Debug, Clone)]
pub struct Model {
    array: CoilArray,
    posed: PosedArray,
    manipulator: Manipulator,
    pass: Pass,
    anchor: Anchor,
    passes_max: u32,
    coils: usize,
    frames: usize,
    /// Of the coils' fields over those described.
    gains: [f64; COILS_MAX],
    good: Good,
    stability: Stability,
    probe: Probe,
}

/// The last equilibrium on the model's way, from which every cycle sets out.
#[derive(Debug, Clone)]
struct Anchor {
    actuation: Actuation,
    unknowns: Vector6<f64>,
    /// Change of the unknowns with every parameter.
    derivatives: Vec<Vector6<f64>>,
    /// Range of every parameter, A or rad.
    ranges: Vec<f64>,
    /// Farthest that a cycle goes, as a share of the ranges.
    reach: f64,
    /// Unknowns without currents.
    rest: Vector6<f64>,
}

/// Tangents and Jacobian of the last pass that was close enough to equilibrium.
#[derive(Debug, Clone)]
struct Good {
    tangents: [Vector3<f64>; MAGNETS_MAX],
    jacobian: [[[f64; PARAMETERS_MAX]; 3]; MAGNETS_MAX],
    age: Option<u32>,
}

impl Model {
    /// The model of the rig of `description`, at rest without currents.
    #[must_use]
    pub fn new(description: &HardwareDescription, manipulator: Manipulator, passes_max: u32) -> Self {
        let array = CoilArray::new(description);
        let posed = array.posed(&[0.0; PARAMETERS_MAX]);
        let mut pass = Pass::new(&manipulator);
        manipulator.solve_from_rest(&posed.actuated(&[]), &TipLoad::NONE, PassMode::default(), &mut pass);
        let currents = description.coils.iter().map(|coil| coil.current_max);
        let angles = description.frames.iter().map(|frame| frame.angle_max - frame.angle_min);
        let ranges: Vec<f64> = currents.chain(angles).collect();
        let probe = Probe::new(&posed, &pass, &ranges);
        let mut anchor = Anchor {
            actuation: Actuation::default(),
            unknowns: pass.unknowns(),
            derivatives: vec![Vector6::zeros(); ranges.len()],
            ranges,
            reach: 1.0,
            rest: pass.unknowns(),
        };
        anchor.settle(&Actuation::default(), &pass);
        let stability = manipulator.stability(&mut pass);
        Self {
            stability,
            probe,
            coils: array.coil_count(),
            frames: array.frame_count(),
            array,
            posed,
            manipulator,
            pass,
            anchor,
            passes_max,
            gains: [1.0; COILS_MAX],
            good: Good {
                tangents: [Vector3::zeros(); MAGNETS_MAX],
                jacobian: [[[0.0; PARAMETERS_MAX]; 3]; MAGNETS_MAX],
                age: None,
            },
        }
    }

    /// Follows the model to `actuation` by at most the configured number of passes.
    pub fn follow(&mut self, actuation: &Actuation) -> ModelReport {
        let share = self.anchor.share(self.coils, actuation);
        let there = self.anchor.towards(self.coils, actuation, share);
        let (passes, residual) = self.shoot(&there, share);
        let found = residual <= RESIDUAL_USABLE;
        if found {
            self.anchor.settle(&there, &self.pass);
        } else {
            self.anchor.fall_short(self.coils, &there);
        }
        let converged = found && share == 1.0;
        if converged {
            self.keep();
            self.stability = self.manipulator.stability(&mut self.pass);
            let margin = self.stability.margin;
            self.probe.look(&self.manipulator, &self.array, actuation, &self.pass, margin);
        } else {
            self.good.age = self.good.age.map(|age| age.saturating_add(1));
        }
        ModelReport {
            converged,
            residual,
            passes,
            jacobian_age: self.good.age.unwrap_or(u32::MAX),
            margin: self.stability.margin,
            unstable_modes: self.stability.unstable_modes,
            field_valid: self.pass.field_valid(),
        }
    }

    /// Passes at an actuation that lies a share of the way ahead of the anchor; how many, and the residual of the last.
    fn shoot(&mut self, there: &Actuation, share: f64) -> (u32, f64) {
        if !share.is_finite() {
            return (0, f64::NAN);
        }
        self.array.pose_into(&there.angle_rad[..self.frames], &mut self.posed);
        let field = self.posed.actuated(&there.current_a[..self.coils]);
        let mut unknowns = self.anchor.predicted(self.coils, there);
        let (mut passes, mut residual) = (0, f64::NAN);
        while passes < self.passes_max {
            self.manipulator.pass(&field, &TipLoad::NONE, &unknowns, PassMode::default(), &mut self.pass);
            passes += 1;
            residual = self.pass.residual();
            let Some(step) = self.pass.newton_step().filter(|_| residual.is_finite()) else {
                return (passes, f64::NAN);
            };
            if residual <= RESIDUAL_SETTLED {
                break;
            }
            unknowns += step;
        }
        (passes, residual)
    }

    /// Actuation, base unknowns and magnets' poses of the last equilibrium on the model's way.
    #[must_use]
    pub fn present(&self) -> Present {
        let mut poses = [HeldPose::default(); MAGNETS_MAX];
        for (pose, magnet) in poses.iter_mut().zip(self.pass.magnets()) {
            *pose = HeldPose { position: magnet.position(), rotation: magnet.rotation() };
        }
        Present { actuation: self.anchor.actuation, unknowns: self.anchor.unknowns, poses }
    }

    /// The last equilibrium on its way.
    #[must_use]
    pub fn equilibrium(&self) -> Equilibrium {
        let Anchor { actuation, unknowns, .. } = &self.anchor;
        let [fx, fy, fz, mx, my, mz] = unknowns.data.0[0];
        Equilibrium { actuation: *actuation, base_force: [fx, fy, fz], base_moment: [mx, my, mz] }
    }

    /// Goes back to an equilibrium found earlier: the next [`Self::follow`] sets out from there.
    pub fn resume(&mut self, equilibrium: &Equilibrium) {
        let Equilibrium { actuation, base_force, base_moment } = equilibrium;
        self.anchor.actuation = *actuation;
        let unknowns = base_force.iter().chain(base_moment);
        self.anchor.unknowns = Vector6::from_iterator(unknowns.copied());
        self.anchor.derivatives.fill(Vector6::zeros());
        self.anchor.reach = 1.0;
        self.probe.restart();
    }

    /// Goes to where another model of the same rig is: equilibrium, derivatives, stability, stiffness, gains. Allocates no memory.
    pub fn take_up(&mut self, other: &Self) {
        let (anchor, from) = (&mut self.anchor, &other.anchor);
        (anchor.actuation, anchor.unknowns, anchor.reach) = (from.actuation, from.unknowns, from.reach);
        anchor.derivatives.copy_from_slice(&from.derivatives);
        self.good = other.good.clone();
        self.stability = other.stability;
        self.probe.take_up(&other.probe);
        self.believe(&other.gains);
    }

    /// From now on every coil makes `gains` times the field of its description; the equilibrium is led there to first order. Allocates
    /// no memory.
    pub fn set_gains(&mut self, gains: &[f64; COILS_MAX]) {
        let anchor = &mut self.anchor;
        let changes = gains.iter().zip(&self.gains).map(|(to, from)| to / from);
        let coils = anchor.derivatives.iter_mut().zip(&anchor.actuation.current_a).take(self.coils);
        for ((derivative, current), change) in coils.zip(changes) {
            anchor.unknowns += *derivative * (current * (change - 1.0));
            *derivative *= change;
        }
        self.believe(gains);
    }

    fn believe(&mut self, gains: &[f64; COILS_MAX]) {
        self.gains = *gains;
        self.array.amplify_into(&self.gains, &mut self.posed);
        self.probe.believe(&self.array, &self.gains);
    }

    /// What every coil's field is taken to be over that of its description; 1 past the last coil.
    #[must_use]
    pub fn gains(&self) -> &[f64; COILS_MAX] {
        &self.gains
    }

    /// True once a Jacobian was computed.
    #[must_use]
    pub fn has_jacobian(&self) -> bool {
        self.good.age.is_some()
    }

    /// Tangent of a magnet in the last good equilibrium, unit, world.
    #[must_use]
    pub fn tangent(&self, magnet: usize) -> Vector3<f64> {
        self.good.tangents[magnet]
    }

    /// Derivatives of a magnet's tangent with every actuation parameter: rows x, y, z; 1/A and 1/rad.
    #[must_use]
    pub fn tangent_jacobian(&self, magnet: usize) -> [&[f64]; 3] {
        let parameters = self.coils + self.frames;
        self.good.jacobian[magnet].each_ref().map(|row| &row[..parameters])
    }

    /// Stability of the last good equilibrium.
    #[must_use]
    pub fn stability(&self) -> Stability {
        self.stability
    }

    /// Determinant of the residual's Jacobian at the last good equilibrium: 1 for the unloaded rod, 0 where it snaps through.
    #[must_use]
    pub fn determinant(&self) -> f64 {
        self.probe.determinant()
    }

    /// Change of the determinant with every actuation parameter, 1/A and 1/rad; each entry at most as many cycles old
    /// as there are parameters.
    #[must_use]
    pub fn determinant_gradient(&self) -> &[f64] {
        self.probe.determinant_gradient()
    }

    /// From now on follows how the margin of stability changes with the actuation too, at the price of a second test of stability a cycle.
    pub fn follow_margin(&mut self) {
        self.probe.follow_margin();
    }

    /// Margin of stability of the last good equilibrium and its change with every actuation parameter, 1/A and 1/rad, as old as those of
    /// the determinant; none where it is not followed.
    #[must_use]
    pub fn margin(&self) -> Option<(f64, &[f64])> {
        self.probe.margin_gradient().map(|gradient| (self.stability.margin, gradient))
    }

    /// From now on follows the expected power (p1) too, with orientation disturbances of this RMS, rad. The extra pass of a cycle
    /// then costs about twice as much.
    pub fn follow_expected_power(&mut self, disturbance: f64) {
        self.probe.follow_authority(self.pass.magnets().len(), self.coils, disturbance);
    }

    /// Expected power (p1) of the last good equilibrium, A^2, and the change of its logarithm with every actuation parameter, 1/A and
    /// 1/rad, as old as those of the determinant; none where it is not followed.
    #[must_use]
    pub fn expected_power(&self) -> Option<(f64, &[f64])> {
        self.probe.expected_power()
    }

    fn keep(&mut self) {
        let good = &mut self.good;
        for (magnet, found) in self.pass.magnets().iter().enumerate() {
            good.tangents[magnet] = found.tangent();
            let rows = self.pass.tangent_jacobian(magnet);
            for (kept, row) in good.jacobian[magnet].iter_mut().zip(rows) {
                kept[..row.len()].copy_from_slice(row);
            }
        }
        good.age = Some(0);
    }
}

impl Anchor {
    /// Differences of an actuation from the anchor's, parameter by parameter.
    fn ways<'a>(&'a self, coils: usize, to: &'a Actuation) -> impl Iterator<Item = f64> + 'a {
        let from = &self.actuation;
        let currents = to.current_a[..coils].iter().zip(&from.current_a);
        let angles = to.angle_rad.iter().zip(&from.angle_rad);
        currents.chain(angles).map(|(to, from)| to - from).take(self.ranges.len())
    }

    /// Greatest way of a parameter, as a share of its range; not finite when one of them is not.
    fn length(&self, coils: usize, to: &Actuation) -> f64 {
        let shares = self.ways(coils, to).zip(&self.ranges).map(|(way, range)| (way / range).abs());
        shares.fold(0.0, |most, share| if share <= most { most } else { share })
    }

    /// How much of the way to an actuation is taken in one cycle: 1 for all of it, NaN when there is none.
    fn share(&self, coils: usize, to: &Actuation) -> f64 {
        let length = self.length(coils, to);
        if !length.is_finite() {
            f64::NAN
        } else if length <= self.reach {
            1.0
        } else {
            self.reach / length
        }
    }

    fn towards(&self, coils: usize, to: &Actuation, share: f64) -> Actuation {
        if share == 1.0 {
            return *to;
        }
        let mut there = self.actuation;
        let parameters = there.current_a[..coils].iter_mut().chain(&mut there.angle_rad);
        for (parameter, way) in parameters.zip(self.ways(coils, to)) {
            *parameter += way * share;
        }
        there
    }

    /// Unknowns at an actuation, to first order.
    fn predicted(&self, coils: usize, at: &Actuation) -> Vector6<f64> {
        let changes = self.ways(coils, at).zip(&self.derivatives).map(|(way, derivative)| derivative * way);
        changes.fold(self.unknowns, |sum, change| sum + change)
    }

    /// Moves to the equilibrium that `pass` came close to.
    fn settle(&mut self, at: &Actuation, pass: &Pass) {
        let Some(correction) = pass.newton_step() else { return };
        self.actuation = *at;
        self.unknowns = pass.unknowns() + correction;
        for (parameter, derivative) in self.derivatives.iter_mut().enumerate() {
            *derivative = pass.unknowns_derivative(parameter);
        }
        self.reach = (2.0 * self.reach).min(1.0);
    }

    /// Stays, and goes half as far in the next cycle. Where the branch has ended the rod has snapped, or the model took a way that
    /// the rod did not: it begins anew with the rod at rest, where every way begins.
    fn fall_short(&mut self, coils: usize, of: &Actuation) {
        let length = self.length(coils, of);
        if !length.is_finite() {
            return;
        }
        if length.min(self.reach) > REACH_MIN {
            self.reach = (0.5 * length.min(self.reach)).max(REACH_MIN);
            return;
        }
        self.actuation = Actuation { angle_rad: of.angle_rad, ..Actuation::default() };
        self.unknowns = self.rest;
        self.derivatives.fill(Vector6::zeros());
        self.reach = REACH_FROM_REST;
    }
}
