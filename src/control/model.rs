//! The statics that the controller believes in, kept at the present actuation by a few shooting passes a cycle.
//!
//! Currents and angles change little between two cycles, so that the base unknowns of the last one, carried along their derivative
//! with the actuation, are a good guess: one pass a cycle mostly keeps up. A pass that comes close enough gives tangents and Jacobian of this cycle; else the last
//! good Jacobian stays in use and its age is reported, for the supervisor to judge.
//!
//! Magnetic stiffness can make an equilibrium lose its stability long before a current meets its limit: the rod snaps through. The
//! determinant of the residual's Jacobian, 1 at rest and 0 there, is the margin. Its gradient with the actuation comes
//! from one extra pass a cycle, for one parameter after another, so that the allocation can keep away.

use magsteer_hal::{Actuation, HardwareDescription, MAGNETS_MAX};
use nalgebra::{Vector3, Vector6};

use super::cycle::ModelReport;
use crate::magnetics::{ActuatedArray, AppliedField, CoilArray, FieldSample, PARAMETERS_MAX, PosedArray};
use crate::rod::{Manipulator, Pass, PassMode, TipLoad};

/// Scaled residual below which a pass's sensitivities are used: the distance to equilibrium is then some 1e-4 of the
/// rod's full deflection, far below the sensor's noise.
const RESIDUAL_USABLE: f64 = 1e-3;
/// Scaled residual above which another pass is spent in the same cycle: below, what is left is some 1e-5 of the rod's
/// full deflection, which is the error of its mesh.
const RESIDUAL_SETTLED: f64 = 1e-4;

/// Share of a parameter's range by which it is moved to see how the margin changes: far above rounding, far below curvature.
const PROBE_SHARE: f64 = 1e-3;

/// Array and manipulator at the present actuation.
#[derive(Debug)]
pub struct Model {
    array: CoilArray,
    posed: PosedArray,
    manipulator: Manipulator,
    pass: Pass,
    unknowns: Vector6<f64>,
    /// Actuation that `unknowns` and `pass` belong to, while the last cycle converged.
    followed: Option<Actuation>,
    passes_max: u32,
    coils: usize,
    frames: usize,
    good: Good,
    margin: Margin,
}

/// Margin of stability and how it changes with the actuation.
#[derive(Debug)]
struct Margin {
    value: f64,
    gradient: Vec<f64>,
    /// Parameter probed next.
    cursor: usize,
    /// Step of each parameter, A or rad.
    steps: Vec<f64>,
    posed: PosedArray,
    pass: Pass,
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

/// Tangents and Jacobian of the last pass that was close enough to equilibrium.
#[derive(Debug)]
struct Good {
    unknowns: Vector6<f64>,
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
        let unknowns = pass.unknowns();
        let currents = description.coils.iter().map(|coil| coil.current_max);
        let angles = description.frames.iter().map(|frame| frame.angle_max - frame.angle_min);
        let steps: Vec<f64> = currents.chain(angles).map(|range| range * PROBE_SHARE).collect();
        let margin = Margin {
            value: pass.determinant(),
            gradient: vec![0.0; steps.len()],
            cursor: 0,
            steps,
            posed: posed.clone(),
            pass: pass.clone(),
        };
        Self {
            margin,
            coils: array.coil_count(),
            frames: array.frame_count(),
            array,
            posed,
            manipulator,
            pass,
            unknowns,
            followed: None,
            passes_max,
            good: Good {
                unknowns,
                tangents: [Vector3::zeros(); MAGNETS_MAX],
                jacobian: [[[0.0; PARAMETERS_MAX]; 3]; MAGNETS_MAX],
                age: None,
            },
        }
    }

    /// Follows the model to `actuation` by at most the configured number of passes.
    pub fn follow(&mut self, actuation: &Actuation) -> ModelReport {
        self.array.pose_into(&actuation.angle_rad[..self.frames], &mut self.posed);
        self.predict(actuation);
        let field = self.posed.actuated(&actuation.current_a[..self.coils]);
        let mut passes = 0;
        let mut residual = f64::NAN;
        while passes < self.passes_max {
            self.manipulator.pass(
                &field,
                &TipLoad::NONE,
                &self.unknowns,
                PassMode::default(),
                &mut self.pass,
            );
            passes += 1;
            residual = self.pass.residual();
            let Some(step) = self.pass.newton_step().filter(|_| residual.is_finite()) else {
                self.unknowns = self.good.unknowns;
                break;
            };
            if residual <= RESIDUAL_USABLE {
                self.good.unknowns = self.unknowns;
            }
            self.unknowns += step;
            if residual <= RESIDUAL_SETTLED {
                break;
            }
        }
        let converged = residual <= RESIDUAL_USABLE;
        self.followed = converged.then_some(*actuation);
        if converged {
            self.keep();
            self.probe_margin(actuation);
        } else {
            self.good.age = self.good.age.map(|age| age.saturating_add(1));
        }
        ModelReport {
            converged,
            residual,
            passes,
            jacobian_age: self.good.age.unwrap_or(u32::MAX),
            margin: self.margin.value,
            field_valid: self.pass.field_valid(),
        }
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

    /// Margin of stability of the last good equilibrium: 1 for the rod at rest, 0 where it snaps through.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.margin.value
    }

    /// Change of the margin with every actuation parameter, 1/A and 1/rad; each entry at most as many cycles old
    /// as there are parameters.
    #[must_use]
    pub fn margin_gradient(&self) -> &[f64] {
        &self.margin.gradient
    }

    /// Moves the unknowns to where the last pass expects the equilibrium at `actuation`, to first order.
    fn predict(&mut self, actuation: &Actuation) {
        let Some(followed) = &self.followed else { return };
        for (coil, (to, from)) in
            actuation.current_a[..self.coils].iter().zip(&followed.current_a).enumerate()
        {
            self.unknowns += self.pass.unknowns_derivative(coil) * (to - from);
        }
        for (frame, (to, from)) in
            actuation.angle_rad[..self.frames].iter().zip(&followed.angle_rad).enumerate()
        {
            self.unknowns += self.pass.unknowns_derivative(self.coils + frame) * (to - from);
        }
    }

    /// Renews the margin, and one entry of its gradient by a pass beside the present actuation.
    fn probe_margin(&mut self, actuation: &Actuation) {
        let margin = &mut self.margin;
        margin.value = self.pass.determinant();
        if margin.steps.is_empty() {
            return;
        }
        let parameter = margin.cursor;
        margin.cursor = (parameter + 1) % margin.steps.len();
        let step = margin.steps[parameter];
        let mut beside = *actuation;
        if parameter < self.coils {
            beside.current_a[parameter] += step;
        } else {
            beside.angle_rad[parameter - self.coils] += step;
        }
        self.array.pose_into(&beside.angle_rad[..self.frames], &mut margin.posed);
        let field = Unsteered(margin.posed.actuated(&beside.current_a[..self.coils]));
        // First to the equilibrium at the present actuation, then along its tangent to the one beside.
        let Some(correction) = self.pass.newton_step() else { return };
        let unknowns = self.pass.unknowns() + correction + self.pass.unknowns_derivative(parameter) * step;
        self.manipulator.pass(&field, &TipLoad::NONE, &unknowns, PassMode::default(), &mut margin.pass);
        let change = (margin.pass.determinant() - margin.value) / step;
        if change.is_finite() {
            margin.gradient[parameter] = change;
        }
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
