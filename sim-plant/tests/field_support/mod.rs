//! What the field's tests share: reference numbers, fields in space, and relative deviations.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use magsteer_sim_plant::field::{Axial, Superposition, Winding};
use nalgebra::{Matrix3, SMatrix, Vector3};
use serde_json::Value;

/// The winding in the note of `coil_grid.csv`.
pub const GRID_WINDING: Winding =
    Winding { inner_radius: 0.024, outer_radius: 0.046, length: 0.05, turns: 1700.0 };
/// That of the shipped rig's air cores.
pub const AIR_CORE: Winding =
    Winding { inner_radius: 0.045, outer_radius: 0.063, length: 0.043, turns: 642.0 };

/// The text of a file of reference data.
pub fn reference(name: &str) -> String {
    let path = format!("{}/../tests/reference/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// `field_cases.json`.
pub fn cases() -> Value {
    serde_json::from_str(&reference("field_cases.json")).expect("the reference is JSON")
}

pub fn number(value: &Value) -> f64 {
    value.as_str().expect("numbers are strings").parse().expect("a number")
}

pub fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|row, _| number(&value[row]))
}

pub fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| number(&value[row][column]))
}

/// Flux and gradient at `point` of a field about `axis` through the origin, given by `x` and the distance
/// `r`.
pub fn in_space(
    field: impl Fn(f64, f64) -> Axial,
    axis: &Vector3<f64>,
    point: &Vector3<f64>,
) -> (Vector3<f64>, Matrix3<f64>) {
    let x = axis.dot(point);
    let offset = point - axis * x;
    let mut sum = Superposition::zero();
    sum.add(&field(x, offset.norm()), 1.0, axis, &offset);
    (sum.flux(), sum.gradient())
}

/// Largest difference of a component over the largest component.
pub fn off<const R: usize, const C: usize>(found: SMatrix<f64, R, C>, expected: SMatrix<f64, R, C>) -> f64 {
    (found - expected).amax() / expected.amax()
}
