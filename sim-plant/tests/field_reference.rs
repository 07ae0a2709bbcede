//! The true field against numbers of other tools: `tests/reference/field_cases.json`.
//!
//! The entries are strings with 18 significant digits, made with mpmath and checked against magpylib; the axis of
//! loops and coils is z there.

use magsteer_sim_plant::field::Dipole;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

/// What is promised, relative to the greatest component.
const RELATIVE_MAX: f64 = 1e-9;

fn cases() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/field_cases.json");
    let text = std::fs::read_to_string(path).expect("the reference is there");
    serde_json::from_str(&text).expect("the reference is JSON")
}

fn number(value: &Value) -> f64 {
    value.as_str().expect("numbers are strings").parse().expect("a number")
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|row, _| number(&value[row]))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| number(&value[row][column]))
}

/// Largest difference of a component over the largest component.
fn off<const R: usize, const C: usize>(
    found: nalgebra::SMatrix<f64, R, C>,
    expected: nalgebra::SMatrix<f64, R, C>,
) -> f64 {
    (found - expected).amax() / expected.amax()
}

#[test]
fn two_dipoles_agree_with_the_reference_in_field_gradient_force_and_torque() {
    let case = &cases()["dipole_dipole"];
    let first = Dipole { position: Vector3::new(0.2, -0.1, 0.3), moment: vector(&case["m1"]) };
    // The offset stands in the reference's words.
    let offset = Vector3::new(0.03, 0.01, 0.04);
    let second = Dipole { position: first.position + offset, moment: vector(&case["m2"]) };
    let field = first.field_at(&second.position);
    let wrench = first.wrench_on(&second);
    for (what, deviation) in [
        ("field", off(field.flux, vector(&case["B"]))),
        ("gradient", off(field.gradient, matrix(&case["gradB"]))),
        ("force", off(wrench.force, vector(&case["force_on_m2"]))),
        ("torque", off(wrench.torque, vector(&case["torque_on_m2"]))),
    ] {
        assert!(deviation < RELATIVE_MAX, "{what}: {deviation:e}");
    }
}
