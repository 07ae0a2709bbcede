//! The model's shape under what was measured.

use magsteer::config::Config;
use magsteer::magnetics::{
    ActuatedArray, AppliedField, CoilArray, FieldGradient, FieldSample, FieldSecondGradient,
};
use magsteer::rod::{Manipulator, Pass, PassMode, Station, TipLoad};
use nalgebra::Vector3;

/// The model's shape, followed along the measured actuation: where several equilibria exist for the same currents, the one
/// that the rod came to.
pub struct Shapes<'a> {
    array: CoilArray,
    manipulator: &'a Manipulator,
    pass: Pass,
    has_forces: bool,
}

/// The field of an array that turns magnets but does not pull them: its gradients are left out.
struct TorquesAlone<'a>(ActuatedArray<'a>);

impl AppliedField for TorquesAlone<'_> {
    fn parameter_count(&self) -> usize {
        self.0.parameter_count()
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        self.0.evaluate(point, sample);
        sample.gradient = FieldGradient::default();
        sample.second_gradient = FieldSecondGradient::default();
        let count = self.0.parameter_count();
        sample.columns[..count].iter_mut().for_each(|column| column.gradient = FieldGradient::default());
    }
}

impl<'a> Shapes<'a> {
    /// At rest without currents; `None` for a configuration without a rod.
    pub fn at_rest(config: &'a Config) -> Option<Self> {
        Self::new(config, true)
    }

    /// The same, of a model in which fields turn magnets but do not pull them.
    pub fn without_forces(config: &'a Config) -> Option<Self> {
        Self::new(config, false)
    }

    fn new(config: &'a Config, has_forces: bool) -> Option<Self> {
        let manipulator = config.manipulator.as_ref()?;
        let array = CoilArray::new(&config.description);
        let mut pass = Pass::new(manipulator);
        let posed = array.posed(&vec![0.0; array.frame_count()]);
        let field = posed.actuated(&vec![0.0; array.coil_count()]);
        manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
        Some(Self { array, manipulator, pass, has_forces })
    }

    /// Moves on to the equilibrium under these currents (A) and angles (rad) that lies nearest; false when there is none.
    pub fn follow(&mut self, currents: &[f64], angles: &[f64]) -> bool {
        let posed = self.array.posed(angles);
        let field = posed.actuated(currents);
        let guess = self.pass.unknowns();
        let mode = PassMode::default();
        let solution = if self.has_forces {
            self.manipulator.solve(&field, &TipLoad::NONE, &guess, mode, &mut self.pass)
        } else {
            self.manipulator.solve(&TorquesAlone(field), &TipLoad::NONE, &guess, mode, &mut self.pass)
        };
        solution.converged()
    }

    /// What was solved last.
    pub fn pass(&self) -> &Pass {
        &self.pass
    }

    /// Stations along the centre line, clamp to tip.
    pub fn stations(&self) -> Vec<Station> {
        self.manipulator.shape(&self.pass)
    }
}
