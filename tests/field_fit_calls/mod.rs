//! Calls of `magsteer field fit`, and what they are given.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Output};

use magsteer::magnetics::{AppliedField, CoilArray, FieldSample};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use crate::field_support;

/// A grid about one coil.
pub const GRID: &str = include_str!("../reference/coil_grid.csv");
/// The rig of an array's calibration.
pub const RIG: &str = "config/bigmag-planar.toml";

/// Runs `magsteer field fit`.
pub fn fit(file: &Path, options: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["field", "fit"]).arg(file).args(options).current_dir(env!("CARGO_MANIFEST_DIR"));
    command.output().unwrap()
}

/// What it printed as JSON.
pub fn answer(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What it said of mistakes.
pub fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A calibration of BigMag with turned frames, each coil driven, with noise of 0.05 mT (uniform up to 0.0866
/// mT); and the angles, deg.
pub fn array_csv(rows: usize) -> (String, &'static str) {
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let rig = field_support::bigmag();
    let posed = CoilArray::new(&rig).posed(&[30_f64.to_radians(), (-45_f64).to_radians()]);
    let mut text = "px,py,pz,i0,i1,i2,i3,i4,i5,bx,by,bz\n".to_owned();
    for _ in 0..rows {
        let position = Vector3::from_fn(|_, _| random.random_range(-0.03..0.03));
        let currents: Vec<f64> = (0..6).map(|_| random.random_range(-8.0..8.0)).collect();
        let mut sample = FieldSample::default();
        posed.actuated(&currents).evaluate(&position, &mut sample);
        let field = sample.field + Vector3::from_fn(|_, _| random.random_range(-8.66e-5..8.66e-5));
        let cells: Vec<String> =
            position.iter().chain(&currents).chain(&field).map(|value| format!("{value:.9}")).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    (text, "30,-45")
}
