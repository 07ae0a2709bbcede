//! `[control.algorithm_1]` of the configuration file.

use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::magnetics::PARAMETERS_MAX;
use crate::rod::ResidualDerivative;

/// Where the orientation Jacobian comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JacobianKind {
    /// Sensitivities of the coupled statics, in the pass that solves them.
    Exact,
    /// The paper's Algorithm 1.
    #[serde(rename = "algorithm-1")]
    Algorithm1,
}

/// At which poses the wrenches are frozen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PoseSource {
    /// Those of the model's equilibrium.
    Modelled,
    /// Those that the sensor saw last.
    Measured,
}

/// `[control.algorithm_1]`: read when `control.jacobian` is `"algorithm-1"`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Algorithm1Config {
    /// Step of a current, A, 1e-6 to 10.
    pub current_step_a: f64,
    /// Step of a frame angle, deg, 1e-4 to 45.
    pub angle_step_deg: f64,
    /// `"modelled"` or `"measured"`: the poses at which the wrenches are frozen.
    pub magnet_poses: PoseSource,
    /// True to begin each problem from eq. (14), false to begin from the present shape.
    pub informed_guess: bool,
    /// `"differences"` or `"variational"`: the derivatives of the residual.
    pub residual_derivative: ResidualDerivative,
    /// Damping that Levenberg-Marquardt begins with, 1e-12 to 1e6.
    pub damping_start: f64,
    /// Scaled residual at which a problem counts as solved, 1e-13 to 1e-2. Forces are in units of EI/L^2, moments of EI/L.
    pub residual_tolerance: f64,
    /// Most trial steps of one problem, 1 to 1000.
    pub iterations_max: u32,
    /// Most problems solved in one cycle, the present shape's included.
    pub problems_per_cycle_max: u32,
    /// Age in cycles beyond which a Jacobian counts as none, 1 to 1000000.
    pub age_max_cycles: u32,
    /// Threads that share the problems of a cycle, the loop's own included, 1 to 16.
    pub threads: u32,
}

impl Algorithm1Config {
    /// Refuses every value out of its range.
    pub(in crate::control) fn check(&self, checks: &mut Checks) {
        let mut within = |name: &str, value: f64, least: f64, most: f64| {
            checks.within(format!("control.algorithm_1.{name}"), value, least, most);
        };
        within("current_step_a", self.current_step_a, 1e-6, 10.0);
        within("angle_step_deg", self.angle_step_deg, 1e-4, 45.0);
        within("damping_start", self.damping_start, 1e-12, 1e6);
        within("residual_tolerance", self.residual_tolerance, 1e-13, 1e-2);
        within("iterations_max", f64::from(self.iterations_max), 1.0, 1000.0);
        let problems_max = PARAMETERS_MAX as f64 + 1.0;
        within("problems_per_cycle_max", f64::from(self.problems_per_cycle_max), 1.0, problems_max);
        within("age_max_cycles", f64::from(self.age_max_cycles), 1.0, 1e6);
        within("threads", f64::from(self.threads), 1.0, 16.0);
    }
}
