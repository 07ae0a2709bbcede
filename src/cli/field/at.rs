//! `magsteer field at`: field and gradient of the coil array at a point.

use std::path::PathBuf;

use clap::Args;
use magsteer::config::Config;
use magsteer::magnetics::{AppliedField, CoilArray, FieldSample};
use nalgebra::Vector3;
use serde::Serialize;

use crate::cli::actuation::{ActuationArgs, finite};
use crate::cli::exit::Exit;
use crate::cli::{output, shipped};

/// Field and gradient at a point.
///
/// Ends with 0, or with 1 when the point lies outside the range of a coil's field model: then the numbers
/// mean nothing.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer field at 0.02 0.01 -0.015 --currents 2,-1,0,0,1.5,0 --angles-deg 30,-45 --json"
)]
pub struct At {
    /// x of the point, m, world.
    #[arg(value_name = "X_M", allow_hyphen_values = true, value_parser = finite)]
    x: f64,
    /// y of the point, m, world.
    #[arg(value_name = "Y_M", allow_hyphen_values = true, value_parser = finite)]
    y: f64,
    /// z of the point, m, world.
    #[arg(value_name = "Z_M", allow_hyphen_values = true, value_parser = finite)]
    z: f64,
    /// Configuration file; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    actuation: ActuationArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `field_t`, `gradient_t_per_m` and `valid`.
#[derive(Serialize)]
struct Answer {
    field_t: [f64; 3],
    /// Rows of dB_i/dx_j.
    gradient_t_per_m: [[f64; 3]; 3],
    valid: bool,
    position_m: [f64; 3],
    /// Names of the coils whose field model does not hold at the point.
    outside_range_of: Vec<String>,
}

impl At {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let rig = Config::from_document(&shipped::config(self.config.as_deref())?)?.description;
        let actuation = self.actuation.for_rig(&rig)?;
        let point = Vector3::new(self.x, self.y, self.z);
        let posed = CoilArray::new(&rig).posed(&actuation.angles);
        let mut sample = FieldSample::default();
        posed.actuated(&actuation.currents).evaluate(&point, &mut sample);
        let mut outside_range_of = Vec::new();
        for outside in posed.outside(point) {
            let name = &rig.coils[outside.coil].name;
            output::note(format_args!("coil {name}: {outside}"));
            outside_range_of.push(name.clone());
        }
        let gradient = sample.gradient.matrix();
        let answer = Answer {
            field_t: sample.field.into(),
            gradient_t_per_m: [0, 1, 2].map(|row| [0, 1, 2].map(|column| gradient[(row, column)])),
            valid: sample.valid,
            position_m: point.into(),
            outside_range_of,
        };
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.table())?;
        }
        Ok(if answer.valid { Exit::Success } else { Exit::No })
    }
}

impl Answer {
    fn table(&self) -> String {
        let row = |values: &[f64; 3], scale: f64| {
            // Six decimals are shown: what rounds to nothing must not show a sign.
            let shown = |value: f64| if (value * scale).abs() < 5e-7 { 0.0 } else { value * scale };
            let [x, y, z] = values.map(shown);
            format!("{x:12.6} {y:12.6} {z:12.6}\n")
        };
        let gradient: String = self.gradient_t_per_m.iter().map(|values| row(values, 1.0)).collect();
        let doubt =
            if self.valid { "" } else { "outside the field model's range: the numbers mean nothing\n" };
        format!("field, mT\n{}gradient dB_i/dx_j, T/m\n{gradient}{doubt}", row(&self.field_t, 1e3))
    }
}
