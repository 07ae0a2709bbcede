//! How stiffness and authority change with the actuation, by one extra pass a cycle for one parameter after another.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | `D` | determinant of the residual's Jacobian | |
//! | `V` | expected power (p1) of the present posture | A^2 |
//! | `m` | margin of stability (z5) | |
//! | `u_p` | actuation parameter `p`: a current or a frame angle | A or rad |
//!
//! An equilibrium beside the present one, `u_p` moved by a small step, lies along the present pass's own tangent, so that one pass
//! there yields `dD/du_p`, on request `dm/du_p` and, when it carries columns of parameters, `d ln V/du_p`. With as many cycles as
//! parameters every entry is new; meanwhile the actuation moves by some slew at most, and the entries err by as much of their curvature.

use magsteer_hal::Actuation;
use nalgebra::Vector3;

use super::plan::ExpectedPower;
use crate::magnetics::{ActuatedArray, AppliedField, CoilArray, FieldSample, PosedArray};
use crate::rod::{Manipulator, Pass, PassMode, TipLoad};

/// Share of a parameter's range by which it is moved: far above rounding, far below curvature.
const PROBE_SHARE: f64 = 1e-3;

/// Determinant, expected power, and how they change with the actuation.
#[derive(Debug, Clone)]
pub(super) struct Probe {
    determinant: f64,
    /// Of the determinant, 1/A and 1/rad.
    stiffening: Vec<f64>,
    /// Of the margin, 1/A and 1/rad; empty where it is not followed.
    steadying: Vec<f64>,
    authority: Option<Authority>,
    /// Parameter probed next.
    cursor: usize,
    /// Step of each parameter, A or rad.
    steps: Vec<f64>,
    posed: PosedArray,
    pass: Pass,
}

/// The expected power and its gradient.
#[derive(Debug, Clone)]
struct Authority {
    expected: ExpectedPower,
    /// `V` of the present posture, A^2.
    power: f64,
    /// Of `ln V`, 1/A and 1/rad.
    gradient: Vec<f64>,
    /// Rows of the orientation Jacobian, two a magnet.
    rows: Vec<f64>,
}

/// The array as a field that nothing steers: a pass through it carries no columns of parameters.
struct Unsteered<'a>(ActuatedArray<'a>);

impl AppliedField for Unsteered<'_> {
    fn parameter_count(&self) -> usize {
        0
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        self.0.evaluate(point, sample);
    }
}

impl Probe {
    /// A probe that begins at the equilibrium in `pass`; `ranges` of the parameters in A and rad.
    pub(super) fn new(posed: &PosedArray, pass: &Pass, ranges: &[f64]) -> Self {
        Self {
            determinant: pass.determinant(),
            stiffening: vec![0.0; ranges.len()],
            steadying: Vec::new(),
            authority: None,
            cursor: 0,
            steps: ranges.iter().map(|range| range * PROBE_SHARE).collect(),
            posed: posed.clone(),
            pass: pass.clone(),
        }
    }

    /// From now on follows the margin of stability too.
    pub(super) fn follow_margin(&mut self) {
        self.steadying = vec![0.0; self.steps.len()];
    }

    /// From now on follows the expected power (p1) too, with orientation disturbances of this RMS, rad.
    pub(super) fn follow_authority(&mut self, magnets: usize, coils: usize, disturbance: f64) {
        self.authority = Some(Authority {
            expected: ExpectedPower::new(2 * magnets, coils, disturbance),
            power: 0.0,
            gradient: vec![0.0; self.steps.len()],
            rows: vec![0.0; 2 * magnets * self.steps.len()],
        });
    }

    /// Knows of the determinant what another probe of the same rig knows; of margin and expected power what it knew. Allocates no memory.
    pub(super) fn take_up(&mut self, other: &Self) {
        (self.determinant, self.cursor) = (other.determinant, other.cursor);
        self.stiffening.copy_from_slice(&other.stiffening);
    }

    /// From now on every coil makes `gains` times its described field.
    pub(super) fn believe(&mut self, array: &CoilArray, gains: &[f64]) {
        array.amplify_into(gains, &mut self.posed);
    }

    /// Begins with the first parameter.
    pub(super) fn restart(&mut self) {
        self.cursor = 0;
    }

    /// Determinant of the residual's Jacobian at the last equilibrium.
    pub(super) fn determinant(&self) -> f64 {
        self.determinant
    }

    /// Its gradient, 1/A and 1/rad.
    pub(super) fn determinant_gradient(&self) -> &[f64] {
        &self.stiffening
    }

    /// Gradient of the margin of stability, 1/A and 1/rad; none where it is not followed.
    pub(super) fn margin_gradient(&self) -> Option<&[f64]> {
        (!self.steadying.is_empty()).then_some(&self.steadying[..])
    }

    /// `V`, A^2, and the gradient of `ln V`, 1/A and 1/rad; none where it is not followed.
    pub(super) fn expected_power(&self) -> Option<(f64, &[f64])> {
        self.authority.as_ref().map(|authority| (authority.power, &authority.gradient[..]))
    }

    /// Renews determinant and expected power at the equilibrium in `pass`, whose margin is `margin`, and one entry of each gradient.
    pub(super) fn look(
        &mut self,
        manipulator: &Manipulator,
        array: &CoilArray,
        actuation: &Actuation,
        pass: &Pass,
        margin: f64,
    ) {
        let (coils, frames) = (array.coil_count(), array.frame_count());
        self.determinant = pass.determinant();
        if let Some(authority) = &mut self.authority {
            authority.power = authority.evaluate(pass, &actuation.current_a);
        }
        if self.steps.is_empty() {
            return;
        }
        let parameter = self.cursor;
        self.cursor = (parameter + 1) % self.steps.len();
        let step = self.steps[parameter];
        let mut beside = *actuation;
        if parameter < coils {
            beside.current_a[parameter] += step;
        } else {
            beside.angle_rad[parameter - coils] += step;
        }
        array.pose_into(&beside.angle_rad[..frames], &mut self.posed);
        let field = self.posed.actuated(&beside.current_a[..coils]);
        // First to the equilibrium at the present actuation, then along its tangent to the one beside.
        let Some(correction) = pass.newton_step() else { return };
        let unknowns = pass.unknowns() + correction + pass.unknowns_derivative(parameter) * step;
        let (mode, there) = (PassMode::default(), &mut self.pass);
        if let Some(authority) = &mut self.authority {
            manipulator.pass(&field, &TipLoad::NONE, &unknowns, mode, there);
            let change = (authority.evaluate(there, &beside.current_a) / authority.power).ln() / step;
            if change.is_finite() {
                authority.gradient[parameter] = change;
            }
        } else {
            manipulator.pass(&Unsteered(field), &TipLoad::NONE, &unknowns, mode, there);
        }
        let change = (there.determinant() - self.determinant) / step;
        if change.is_finite() {
            self.stiffening[parameter] = change;
        }
        if let Some(steadying) = self.steadying.get_mut(parameter) {
            let change = (manipulator.stability(there).margin - margin) / step;
            if change.is_finite() {
                *steadying = change;
            }
        }
    }
}

impl Authority {
    /// `V` of the equilibrium in `pass`, A^2. Tangents turn in the plane of the first two columns of their magnet's rotation; (p1) is
    /// the same in every such basis.
    fn evaluate(&mut self, pass: &Pass, currents: &[f64]) -> f64 {
        let parameters = self.gradient.len();
        for (magnet, rows) in self.rows.chunks_exact_mut(2 * parameters.max(1)).enumerate() {
            let rotation = pass.magnets()[magnet].rotation();
            let [x, y, z] = pass.tangent_jacobian(magnet);
            for (axis, row) in rows.chunks_exact_mut(parameters).enumerate() {
                let across = rotation.column(axis);
                for (((entry, x), y), z) in row.iter_mut().zip(x).zip(y).zip(z) {
                    *entry = across.x * x + across.y * y + across.z * z;
                }
            }
        }
        self.expected.evaluate(currents, &self.rows, parameters)
    }
}
