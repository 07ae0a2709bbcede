//! The `[rod]` table of the configuration: mesh and solver.

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::{Checks, Invalid};
use serde::{Deserialize, Serialize};

use super::manipulator::Manipulator;

/// Most steps that one section may be cut into.
const SEGMENTS_MAX: f64 = 10_000.0;

/// `[rod]`: mesh and solver of the statics.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RodConfig {
    /// Longest Runge-Kutta step, mm, 0.001 to 1000. Each section is cut into the fewest equal steps that are
    /// no longer.
    pub segment_length_max_mm: f64,
    /// Scaled residual at which an equilibrium counts as found, 1e-14 to 1e-2.
    /// Forces are in units of EI/L^2, moments of EI/L.
    pub residual_tolerance: f64,
    /// Most Newton iterations of one solve, 1 to 1000.
    pub iterations_max: u32,
    /// Greatest rotation of any part's end in one step of a continuation from rest, deg, 0.1 to 90.
    pub rotation_step_max_deg: f64,
    /// Most shooting passes of one continuation from rest, 1 to 1000000.
    pub passes_max: u32,
}

impl RodConfig {
    /// The manipulator of `description` on this mesh.
    ///
    /// # Errors
    /// Every refused value of this table, and parts of the description that statics cannot be made of.
    pub fn build(&self, description: &HardwareDescription) -> Result<Manipulator, Vec<Invalid>> {
        let mut checks = Checks::new();
        checks.within("rod.segment_length_max_mm", self.segment_length_max_mm, 1e-3, 1e3);
        checks.within("rod.residual_tolerance", self.residual_tolerance, 1e-14, 1e-2);
        checks.within("rod.iterations_max", f64::from(self.iterations_max), 1.0, 1000.0);
        checks.within("rod.rotation_step_max_deg", self.rotation_step_max_deg, 0.1, 90.0);
        checks.within("rod.passes_max", f64::from(self.passes_max), 1.0, 1e6);
        let options = SolverOptions {
            residual_tolerance: self.residual_tolerance,
            iterations_max: self.iterations_max,
            rotation_step_max: self.rotation_step_max_deg.to_radians(),
            passes_max: self.passes_max,
        };
        if !checks.is_clean() {
            return checks.into_result(()).and(Err(Vec::new()));
        }
        let segment_length_max = self.segment_length_max_mm * 1e-3;
        let manipulator = Manipulator::new(description, segment_length_max, options)?;
        for section in manipulator.sections() {
            let steps = section.length / segment_length_max;
            checks.require(
                steps <= SEGMENTS_MAX,
                "rod.segment_length_max_mm",
                self.segment_length_max_mm,
                format!("long enough for {SEGMENTS_MAX} steps in a section"),
            );
        }
        checks.into_result(manipulator)
    }
}

/// Validated options of the solver, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverOptions {
    /// Scaled residual at which an equilibrium counts as found.
    pub residual_tolerance: f64,
    /// Most Newton iterations of one solve.
    pub iterations_max: u32,
    /// Greatest rotation of any part's end in one step of a continuation, rad.
    pub rotation_step_max: f64,
    /// Most shooting passes of one continuation.
    pub passes_max: u32,
}
