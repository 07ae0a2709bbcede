//! Equilibria worth measuring: random currents and angles that the rod bears.
//!
//! **Problem.** Parameters show where the rod is bent by all coils and in all directions, near to what it
//! will be asked to do. Currents drawn at random snap it through, now or on the way.
//!
//! **Method.** Each draw is uniform within a share of every range. It is taken when the model reaches its
//! equilibrium from rest without losing stability, and also along the straight line from the draw before,
//! by the same branch; when the determinant of the residual's Jacobian (1 at rest, 0 where the rod snaps
//! through) stays above a margin all along; when every magnet stays where the field model holds; and when a
//! quarter more current would turn no magnet far: so a rod that is softer or more magnetic than the model
//! by some ten percent bears the draw as well. A draw that fails is lessened towards zero currents, then
//! another one is made. The same seed gives the same draws.

use magsteer_hal::{Actuation, HardwareDescription};
use nalgebra::{Vector3, Vector6};

use crate::magnetics::{AppliedField, CoilArray, FieldSample};
use crate::math::SplitMix;
use crate::rod::{Manipulator, Pass, PassMode, TipLoad};

/// Points looked at on the way from one draw to the next.
const WAYPOINTS: u32 = 12;
/// Factor on a draw that failed, and how often it is applied before another draw is made.
const LESSENED: (f64, u32) = (0.7, 6);
/// Factor on all currents under which a draw must be stable too, and the angle by which it may turn a
/// magnet, rad.
const OVERLOAD: (f64, f64) = (1.25, 0.26);
/// Draws for each equilibrium that is wanted, on the average, before giving up.
const DRAWS_MAX: usize = 50;
/// Angle by which tangents reached by two ways may differ, rad: of the tolerance of a solve, not of another
/// branch.
const SAME_BRANCH: f64 = 1e-4;

/// What is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExcitationRequest {
    /// How many equilibria.
    pub count: usize,
    /// Everything random follows from it.
    pub seed: u64,
    /// Share of each coil's greatest current, above 0 and at most 1.
    pub current_share: f64,
    /// Greatest magnitude of an angle, rad, within each frame's range.
    pub angle_max: f64,
    /// Least determinant, above 0 and below 1.
    pub determinant_min: f64,
}

/// Not enough draws that the rod bears.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{found} of {wanted} equilibria found in {draws} draws: currents must be lower, or the margin")]
pub struct TooFewSafe {
    /// Found so far.
    pub found: usize,
    /// Wanted.
    pub wanted: usize,
    /// Draws made.
    pub draws: usize,
}

/// Draws equilibria, each to be reached from the one before, the first from rest, by changing everything in
/// proportion.
///
/// # Errors
/// When too few draws are safe.
pub fn excitations(
    rig: &HardwareDescription,
    manipulator: &Manipulator,
    request: &ExcitationRequest,
) -> Result<Vec<Actuation>, TooFewSafe> {
    let mut drawer = Drawer::new(rig, manipulator, request);
    let mut stream = SplitMix::new(request.seed);
    let mut found: Vec<Actuation> = Vec::with_capacity(request.count);
    let draws_max = DRAWS_MAX * request.count;
    for _ in 0..draws_max {
        if found.len() == request.count {
            break;
        }
        let from = found.last().copied().unwrap_or_default();
        let mut drawn = drawer.draw(&mut stream);
        for _ in 0..=LESSENED.1 {
            if drawer.is_safe(&from, &drawn) {
                found.push(drawn);
                break;
            }
            drawn.current_a.iter_mut().for_each(|current| *current *= LESSENED.0);
        }
    }
    if found.len() == request.count {
        Ok(found)
    } else {
        Err(TooFewSafe { found: found.len(), wanted: request.count, draws: draws_max })
    }
}

/// The array as a field that nothing steers: a pass through it carries no columns.
struct Unsteered<F>(F);

impl<F: AppliedField> AppliedField for Unsteered<F> {
    fn parameter_count(&self) -> usize {
        0
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        self.0.evaluate(point, sample);
    }
}

struct Drawer<'a> {
    rig: &'a HardwareDescription,
    manipulator: &'a Manipulator,
    request: &'a ExcitationRequest,
    array: CoilArray,
    pass: Pass,
    /// The equilibrium from rest.
    rest: Pass,
}

impl<'a> Drawer<'a> {
    fn new(
        rig: &'a HardwareDescription,
        manipulator: &'a Manipulator,
        request: &'a ExcitationRequest,
    ) -> Self {
        let pass = Pass::new(manipulator);
        Self { rig, manipulator, request, array: CoilArray::new(rig), rest: pass.clone(), pass }
    }

    fn draw(&self, stream: &mut SplitMix) -> Actuation {
        let mut drawn = Actuation::default();
        for (current, coil) in drawn.current_a.iter_mut().zip(&self.rig.coils) {
            *current = (2.0 * stream.unit() - 1.0) * self.request.current_share * coil.current_max;
        }
        for (angle, frame) in drawn.angle_rad.iter_mut().zip(&self.rig.frames) {
            let wanted = (2.0 * stream.unit() - 1.0) * self.request.angle_max;
            *angle = wanted.max(frame.angle_min).min(frame.angle_max);
        }
        drawn
    }

    /// True when the rod bears what was drawn, and more, and the way there.
    fn is_safe(&mut self, from: &Actuation, to: &Actuation) -> bool {
        if !self.is_reached_from_rest(from) {
            return false;
        }
        let start = self.rest.unknowns();
        let mut more = *to;
        more.current_a.iter_mut().for_each(|current| *current *= OVERLOAD.0);
        self.is_reached_from_rest(to)
            && self.is_reached_along(from, to, start, SAME_BRANCH)
            && self.is_reached_along(to, &more, self.rest.unknowns(), OVERLOAD.1)
    }

    fn is_reached_from_rest(&mut self, at: &Actuation) -> bool {
        let posed = self.array.posed(&at.angle_rad[..self.rig.frames.len()]);
        let field = Unsteered(posed.actuated(&at.current_a[..self.rig.coils.len()]));
        let solution =
            self.manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut self.rest);
        solution.converged() && !solution.lost_stability && self.is_stable(&self.rest)
    }

    /// True when the way from an equilibrium is stable, and ends within an angle of the one reached from
    /// rest last.
    fn is_reached_along(
        &mut self,
        from: &Actuation,
        to: &Actuation,
        start: Vector6<f64>,
        within: f64,
    ) -> bool {
        let mut unknowns = start;
        for step in 1..=WAYPOINTS {
            let share = f64::from(step) / f64::from(WAYPOINTS);
            let at = between(from, to, share);
            let posed = self.array.posed(&at.angle_rad[..self.rig.frames.len()]);
            let field = Unsteered(posed.actuated(&at.current_a[..self.rig.coils.len()]));
            let mode = PassMode::default();
            let solution = self.manipulator.solve(&field, &TipLoad::NONE, &unknowns, mode, &mut self.pass);
            if !solution.converged() || !self.is_stable(&self.pass) {
                return false;
            }
            unknowns = self.pass.unknowns();
        }
        let pairs = self.pass.magnets().iter().zip(self.rest.magnets());
        pairs.into_iter().all(|(along, rest)| (along.tangent() - rest.tangent()).norm() < within)
    }

    fn is_stable(&self, pass: &Pass) -> bool {
        pass.determinant() >= self.request.determinant_min && pass.field_valid()
    }
}

fn between(from: &Actuation, to: &Actuation, share: f64) -> Actuation {
    let mut there = *from;
    let parameters = there.current_a.iter_mut().chain(&mut there.angle_rad);
    for (parameter, end) in parameters.zip(to.current_a.iter().chain(&to.angle_rad)) {
        *parameter += (end - *parameter) * share;
    }
    there
}
