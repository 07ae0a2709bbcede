//! What `magsteer shape` prints. The keys of [`Answer`] are stable: other programs test against them.

use magsteer::rod::{MagnetPass, Outcome, Pass, Solution, Stability};
use nalgebra::Matrix3;
use serde::Serialize;

/// An equilibrium, or how far the search for it came.
#[derive(Debug, Serialize)]
pub struct Answer {
    pub converged: bool,
    pub iterations: u32,
    /// Forces in units of EI/L^2, moments of EI/L.
    pub residual: f64,
    pub elapsed_us: f64,
    /// Sum of all loads on the manipulator.
    pub base_force_n: [f64; 3],
    /// Moment of all loads about the clamp.
    pub base_moment_nm: [f64; 3],
    pub tip_position_m: [f64; 3],
    pub tip_tangent: [f64; 3],
    pub magnets: Vec<MagnetAnswer>,
    pub jacobian: JacobianAnswer,
    /// 1 for the unloaded manipulator, 0 where the equilibrium ceases to be stable, negative beyond; `null` without an equilibrium. Share
    /// of the weakest deformation's strain energy that the loads leave.
    pub stability_margin: Option<f64>,
    /// Number of ways in which the manipulator would leave the equilibrium by itself; `null` without an equilibrium.
    pub unstable_modes: Option<u32>,
    /// Shooting passes, those of the way from rest included.
    pub passes: u32,
    /// Why no equilibrium was found.
    pub failure: Option<String>,
}

/// One magnet in equilibrium.
#[derive(Debug, Serialize)]
pub struct MagnetAnswer {
    pub name: String,
    /// Centre, world.
    pub position_m: [f64; 3],
    pub tangent: [f64; 3],
    /// By rows, from body to world; the third column is the tangent.
    pub rotation: [[f64; 3]; 3],
    pub field_t: [f64; 3],
    /// All that acts at the centre: magnetic force and weight.
    pub force_n: [f64; 3],
    /// The magnetic part of it, eq. (10).
    pub magnetic_force_n: [f64; 3],
    pub torque_nm: [f64; 3],
    /// False outside the range of a coil's field model.
    pub field_valid: bool,
}

/// Derivatives of the magnets' tangents.
#[derive(Debug, Serialize)]
pub struct JacobianAnswer {
    pub columns: Vec<String>,
    pub rows: Vec<String>,
    /// The true derivative: a magnet that moves meets another field.
    pub exact: Vec<Vec<f64>>,
    /// The paper's Algorithm 1 in the limit of small steps: the wrenches stay as they are while the rod moves.
    pub frozen_wrench: Vec<Vec<f64>>,
}

/// One actuation parameter.
#[derive(Debug)]
pub struct Column {
    pub name: String,
    /// What the model's derivative is multiplied by: radians in the unit of the name.
    pub unit: f64,
}

/// Why no equilibrium was found, and how far the loads had risen.
fn failure(solution: &Solution) -> Option<String> {
    let Outcome::NotConverged { why } = solution.outcome else { return None };
    let [gravity, load] = solution.load_reached.map(|fraction| fraction * 100.0);
    Some(format!("{why}, with {gravity:.1} % of gravity and {load:.1} % of the other loads applied"))
}

impl MagnetAnswer {
    fn new(name: &str, at: &MagnetPass) -> Self {
        Self {
            name: name.to_owned(),
            position_m: at.position().into(),
            tangent: at.tangent().into(),
            rotation: by_rows(&at.rotation()),
            field_t: at.field().into(),
            force_n: (at.force() + at.weight()).into(),
            magnetic_force_n: at.force().into(),
            torque_nm: at.torque().into(),
            field_valid: at.field_is_valid(),
        }
    }
}

impl Answer {
    /// The equilibrium in `pass`.
    pub fn new(
        names: &[&str],
        solution: &Solution,
        pass: &Pass,
        stability: Stability,
        elapsed_us: f64,
        jacobian: JacobianAnswer,
    ) -> Self {
        let magnets = names.iter().zip(pass.magnets());
        Self {
            converged: solution.converged(),
            iterations: solution.iterations,
            residual: solution.residual,
            elapsed_us,
            base_force_n: pass.base_force().into(),
            base_moment_nm: pass.base_moment().into(),
            tip_position_m: pass.tip_position().into(),
            tip_tangent: pass.tip_tangent().into(),
            magnets: magnets.map(|(name, at)| MagnetAnswer::new(name, at)).collect(),
            jacobian,
            stability_margin: solution.converged().then_some(stability.margin),
            unstable_modes: solution.converged().then_some(stability.unstable_modes),
            passes: solution.passes,
            failure: failure(solution),
        }
    }

    /// True when every magnet lies in the range of the field model.
    pub fn field_valid(&self) -> bool {
        self.magnets.iter().all(|magnet| magnet.field_valid)
    }

    /// The answer for people.
    pub fn table(&self) -> String {
        let found = if self.converged { "equilibrium" } else { "no equilibrium; where the search ended" };
        let stability = match (self.stability_margin, self.unstable_modes) {
            (Some(margin), Some(0)) => format!("stable, margin {margin:.3}"),
            (Some(margin), Some(modes)) => format!("UNSTABLE in {modes} modes, margin {margin:.3}"),
            _ => "stability unknown".to_owned(),
        };
        let mut text = format!(
            "{found}: {} iterations, residual {:.1e}, {:.0} us, {stability}\n",
            self.iterations, self.residual, self.elapsed_us
        );
        let mut line = |name: &str, values: &[f64; 3], scale: f64, unit: &str| {
            let [x, y, z] = values.map(|value| value * scale);
            text.push_str(&format!("{name:18}{x:12.5} {y:12.5} {z:12.5}  {unit}\n"));
        };
        line("base force", &self.base_force_n, 1e3, "mN");
        line("base moment", &self.base_moment_nm, 1e3, "mN m");
        for magnet in &self.magnets {
            let name = &magnet.name;
            line(&format!("{name} position"), &magnet.position_m, 1e3, "mm");
            line(&format!("{name} tangent"), &magnet.tangent, 1.0, &angle_from_z(&magnet.tangent));
            line(&format!("{name} field"), &magnet.field_t, 1e3, "mT");
            line(&format!("{name} force"), &magnet.force_n, 1e3, "mN, weight included");
            line(&format!("{name} magnetic"), &magnet.magnetic_force_n, 1e3, "mN");
            line(&format!("{name} torque"), &magnet.torque_nm, 1e3, "mN m");
        }
        line("tip position", &self.tip_position_m, 1e3, "mm");
        line("tip tangent", &self.tip_tangent, 1.0, &angle_from_z(&self.tip_tangent));
        text.push_str(&self.jacobian.table());
        text
    }
}

impl JacobianAnswer {
    /// The derivatives of the tangents in `pass`.
    pub fn of(pass: &Pass, columns: &[Column]) -> Vec<Vec<f64>> {
        let row = |row: &[f64]| row.iter().zip(columns).map(|(entry, column)| entry * column.unit).collect();
        let magnets = 0..pass.magnets().len();
        magnets.flat_map(|magnet| pass.tangent_jacobian(magnet).map(row)).collect()
    }

    fn table(&self) -> String {
        if self.rows.is_empty() || self.columns.is_empty() {
            return String::new();
        }
        let mut text = String::from("\nexact Jacobian of the tangents, 1/A, 1/deg, 1/T or 1/(T/m)\n      ");
        for column in &self.columns {
            text.push_str(&format!(" {column:>16}"));
        }
        for (name, row) in self.rows.iter().zip(&self.exact) {
            text.push_str(&format!("\n{name:6}"));
            for entry in row {
                text.push_str(&format!(" {entry:16.6e}"));
            }
        }
        text.push('\n');
        text
    }
}

/// Names of the Jacobian's rows: the components of each magnet's tangent.
pub fn row_names(magnets: &[&str]) -> Vec<String> {
    magnets
        .iter()
        .flat_map(|name| ["tx", "ty", "tz"].map(|component| format!("{name}.{component}")))
        .collect()
}

fn angle_from_z(tangent: &[f64; 3]) -> String {
    let [x, y, z] = *tangent;
    format!("{:.3} deg from z", x.hypot(y).atan2(z).to_degrees())
}

fn by_rows(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| matrix[(row, column)]))
}
