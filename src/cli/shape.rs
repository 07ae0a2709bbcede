//! `magsteer shape`: the equilibrium of the manipulator under given currents, fields and loads.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use magsteer::config::Config;
use magsteer::magnetics::{AffineField, AppliedField, CoilArray, FieldGradient};
use magsteer::rod::{Manipulator, Pass, PassMode, TipLoad, Wrenches};
use magsteer_hal::HardwareDescription;
use nalgebra::Vector3;

use super::actuation::{ActuationArgs, Numbers};
use super::exit::Exit;
use super::output;
use super::shape_answer::{Answer, Column, JacobianAnswer, row_names};

/// The equilibrium under given currents and loads: poses, wrenches, Jacobians of the tangents.
///
/// The loads rise from zero, gravity first, so that the equilibrium is the one that the manipulator itself would come to.
/// Ends with 0, or with 1 when no equilibrium was found or a magnet lies outside the field model's range.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    magsteer shape config/bigmag-planar.toml --currents 2,-1,0,0,1.5,0 --angles-deg 10,-20 --json\n  \
    magsteer shape config/reference-two-magnets.toml --uniform-field-t 0.002,-0.003,0.006\n  \
    magsteer shape config/reference-cantilever.toml --tip-force-n 1,0,0")]
pub struct Shape {
    /// Configuration file (TOML).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    actuation: ActuationArgs,
    /// Field at the world's origin, T, in place of the coils' field.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with_all = ["currents", "angles_deg"])]
    uniform_field_t: Option<Numbers<3>>,
    /// Uniform gradient of the field, T/m, in place of the coils' field; zz = -(xx + yy).
    #[arg(long, value_name = "XX,XY,XZ,YY,YZ", allow_hyphen_values = true, conflicts_with_all = ["currents", "angles_deg"])]
    gradient_t_per_m: Option<Numbers<5>>,
    /// Force on the tip, N, world.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    tip_force_n: Option<Numbers<3>>,
    /// Moment on the tip, N m, world.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    tip_moment_nm: Option<Numbers<3>>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Shape {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (document, config) = Config::load(&self.file)?;
        let manipulator = document.require("rod", &config.manipulator)?;
        let rig = &config.description;
        let answer = match self.affine_field() {
            Some(field) => self.answer(rig, manipulator, &field, &affine_columns()),
            None => {
                let actuation = self.actuation.for_rig(rig)?;
                let posed = CoilArray::new(rig).posed(&actuation.angles);
                self.answer(rig, manipulator, &posed.actuated(&actuation.currents), &array_columns(rig))
            }
        };
        if let Some(failure) = &answer.failure {
            output::note(format_args!("no equilibrium was found: {failure}"));
        }
        if answer.unstable_modes.is_some_and(|modes| modes > 0) {
            output::note("the equilibrium is not stable: the manipulator would leave it");
        }
        for magnet in answer.magnets.iter().filter(|magnet| !magnet.field_valid) {
            output::note(format_args!(
                "magnet {} lies outside the range of the coils' field model: the numbers mean nothing",
                magnet.name
            ));
        }
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.table())?;
        }
        Ok(if answer.converged && answer.field_valid() { Exit::Success } else { Exit::No })
    }

    /// The field that stands in for the array, when one was given.
    fn affine_field(&self) -> Option<AffineField> {
        if self.uniform_field_t.is_none() && self.gradient_t_per_m.is_none() {
            return None;
        }
        let Numbers([xx, xy, xz, yy, yz]) = self.gradient_t_per_m.unwrap_or(Numbers([0.0; 5]));
        let gradient = FieldGradient { xx, xy, xz, yy, yz };
        Some(AffineField { field: vector(self.uniform_field_t), gradient })
    }

    /// Solves from rest, then takes the frozen-wrench Jacobian at the equilibrium.
    fn answer(
        &self,
        rig: &HardwareDescription,
        manipulator: &Manipulator,
        field: &impl AppliedField,
        columns: &[Column],
    ) -> Answer {
        let load = TipLoad { force: vector(self.tip_force_n), moment: vector(self.tip_moment_nm) };
        let mut pass = Pass::new(manipulator);
        let start = Instant::now();
        let solution = manipulator.solve_from_rest(field, &load, PassMode::default(), &mut pass);
        let elapsed_us = start.elapsed().as_secs_f64() * 1e6;
        let names: Vec<&str> = rig.magnets().map(|magnet| magnet.name.as_str()).collect();
        let mut frozen = pass.clone();
        let mode = PassMode { poses: false, wrenches: Wrenches::Frozen };
        manipulator.pass(field, &load, &pass.unknowns(), mode, &mut frozen);
        let jacobian = JacobianAnswer {
            columns: columns.iter().map(|column| column.name.clone()).collect(),
            rows: row_names(&names),
            exact: JacobianAnswer::of(&pass, columns),
            frozen_wrench: JacobianAnswer::of(&frozen, columns),
        };
        let stability = manipulator.stability(&mut pass);
        Answer::new(&names, &solution, &pass, stability, elapsed_us, jacobian)
    }
}

fn vector(numbers: Option<Numbers<3>>) -> Vector3<f64> {
    numbers.map_or_else(Vector3::zeros, |Numbers(components)| Vector3::from(components))
}

/// Currents per ampere, then frame angles per degree.
fn array_columns(rig: &HardwareDescription) -> Vec<Column> {
    let currents = (0..rig.coils.len()).map(|index| Column { name: format!("I{index}"), unit: 1.0 });
    let angles = rig
        .frames
        .iter()
        .map(|frame| Column { name: format!("theta_{}_deg", frame.name), unit: 1.0_f64.to_radians() });
    currents.chain(angles).collect()
}

/// The parameters of [`AffineField`], per T and per T/m.
fn affine_columns() -> Vec<Column> {
    let names = ["B0x", "B0y", "B0z", "Gxx", "Gxy", "Gxz", "Gyy", "Gyz"];
    names.into_iter().map(|name| Column { name: name.to_owned(), unit: 1.0 }).collect()
}
