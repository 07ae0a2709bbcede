//! Rods of unit length and stiffness at rest, and the reference data to hold them against.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use magsteer_hal::description::{
    MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription,
};
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::Vector3;
use serde_json::Value;

pub const STEPPING: Stepping = Stepping { step: 5e-4, retardation: 0.0 };
pub const UPRIGHT: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// `rod_cases.json` of the project's reference data (scipy and mpmath, two methods each).
pub fn reference() -> Value {
    let text = include_str!("../../../tests/reference/rod_cases.json");
    serde_json::from_str(text).expect("the reference data is JSON")
}

/// A number, which the data writes as one or, with all its digits, as a string.
pub fn number(value: &Value) -> f64 {
    match value {
        Value::String(text) => match text.as_str() {
            "pi/2" => std::f64::consts::FRAC_PI_2,
            "pi" => std::f64::consts::PI,
            "2*pi" => std::f64::consts::TAU,
            other => other.parse().expect("a number"),
        },
        other => other.as_f64().expect("a number"),
    }
}

pub fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|index, _| number(&value[index]))
}

/// The rows of a case.
pub fn rows(reference: &Value, case: &str) -> Vec<Value> {
    reference[case]["rows"].as_array().expect("rows").clone()
}

/// A point magnet of 1 kg, but for a rotary inertia that keeps it from spinning freely.
pub fn point(moment_body: [f64; 3]) -> PartDescription {
    PartDescription::Magnet(MagnetDescription {
        name: "point".to_owned(),
        length: 1e-9,
        radius: 1e-3,
        mass: 1.0,
        moment_body,
    })
}

pub fn unit_section() -> SectionDescription {
    SectionDescription {
        length: 1.0,
        radius: 0.01,
        bending_stiffness: 1.0,
        torsion_stiffness: 1.0,
        extensible: None,
        mass_per_length: 0.0,
        precurvature: [0.0; 3],
    }
}

/// An unloaded rod whose first section is cut into `elements`.
pub fn unloaded(
    parts: Vec<PartDescription>,
    rotation: [[f64; 3]; 3],
    gravity: [f64; 3],
    elements: usize,
) -> Rod {
    let length = match &parts[0] {
        PartDescription::Section(section) => section.length,
        PartDescription::Magnet(magnet) => magnet.length,
    };
    let description = ManipulatorDescription { base_position: [0.0; 3], base_rotation: rotation, parts };
    let meshing = Meshing { element_length_max: length / elements as f64 };
    Rod::new(&description, gravity, meshing, STEPPING)
}

/// A field that is the same everywhere.
pub fn uniform(flux: Vector3<f64>) -> impl Fn(&Vector3<f64>) -> Field {
    move |_| Field { flux, ..Field::zero() }
}
