//! Are the magnets where the field model holds?
//!
//! **Problem.** The multipole series of a coil holds only in front of its face, and a magnet outside the workspace cannot be steered. Both follow
//! from several tables at once, so that no section can check it alone.
//!
//! **Method.** The unloaded manipulator is laid out from its clamp, and each magnet's centre is held against the
//! workspace and against every coil, with the frames where they rest: at angle zero, or at the end of their range that is nearest to it.

use magsteer_hal::description::{HardwareDescription, PartDescription, SectionDescription};
use magsteer_hal::invalid::{Checks, Invalid};
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::magnetics::{CoilArray, PosedArray};

/// Steps along a precurved section; a circle of one turn then closes within 1e-3 of its radius.
const STEPS: usize = 64;

/// Refuses magnets that, unloaded, lie outside the workspace or outside the range of a coil's field model.
pub(super) fn check(description: &HardwareDescription) -> Vec<Invalid> {
    let mut checks = Checks::new();
    let workspace = &description.workspace;
    let coils = CoilArray::new(description).posed(&rest_angles(description));
    let blamed = coil_to_blame(description, &coils);
    if let Some((coil, places)) = &blamed {
        checks.require(false, format!("coils[{coil}]"), places, format!(
            "at least {} mm in front of its face, where its field model holds: is the coil where it is said to be?",
            short(description.coils[*coil].valid_from_x * 1e3)
        ));
    }
    for (index, name, center) in unloaded_magnets(description) {
        let key = format!("manipulator.parts[{index}].magnet");
        let value = format!("{name:?} with its centre at {} mm when unloaded", millimetres(&center));
        let distance = (center - Vector3::from(workspace.center)).norm();
        let expected = format!(
            "inside the workspace: at most {} mm from {} mm",
            short(workspace.radius * 1e3),
            millimetres(&Vector3::from(workspace.center))
        );
        checks.require(distance <= workspace.radius, &key, &value, expected);
        for outside in coils.outside(center) {
            if blamed.is_some() {
                continue;
            }
            let expected = format!(
                "in the range of coil {:?}: at least {} mm in front of its face, not {}",
                description.coils[outside.coil].name,
                short(outside.valid_from_x * 1e3),
                short(outside.local_x * 1e3)
            );
            checks.require(false, &key, &value, expected);
        }
    }
    checks.into_result(()).err().unwrap_or_default()
}

/// The coil from whose range several magnets fall while all are in that of every other, and where they are:
/// then it is the coil, not the magnets, that was put in the wrong place.
fn coil_to_blame(description: &HardwareDescription, coils: &PosedArray) -> Option<(usize, String)> {
    let mut blamed = None;
    let mut places = Vec::new();
    for (_, name, center) in unloaded_magnets(description) {
        for outside in coils.outside(center) {
            if *blamed.get_or_insert(outside.coil) != outside.coil {
                return None;
            }
            places.push(format!("{name:?} at {} mm", short(outside.local_x * 1e3)));
        }
    }
    let coil = blamed.filter(|_| places.len() > 1 && description.coils.len() > 1)?;
    let name = &description.coils[coil].name;
    Some((coil, format!("{name:?} with, when unloaded, {} from its face", places.join(" and "))))
}

/// The angles at which the frames stand before anything turns them: zero, or the end of the range nearest to it.
fn rest_angles(description: &HardwareDescription) -> Vec<f64> {
    description.frames.iter().map(|frame| 0.0_f64.max(frame.angle_min).min(frame.angle_max)).collect()
}

/// Part index, name and centre (m, world) of each magnet when nothing acts on the manipulator.
fn unloaded_magnets(description: &HardwareDescription) -> Vec<(usize, &str, Vector3<f64>)> {
    let manipulator = &description.manipulator;
    let [x, y, z] = manipulator.base_rotation;
    let mut position = Vector3::from(manipulator.base_position);
    let mut rotation = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[x.into(), y.into(), z.into()]));
    let mut magnets = Vec::new();
    for (index, part) in manipulator.parts.iter().enumerate() {
        match part {
            PartDescription::Section(section) => advance(section, &mut position, &mut rotation),
            PartDescription::Magnet(magnet) => {
                let tangent = rotation * Vector3::z();
                magnets.push((index, magnet.name.as_str(), position + tangent * (magnet.length / 2.0)));
                position += tangent * magnet.length;
            }
        }
    }
    magnets
}

/// Follows an unloaded section to its end: `p' = R e_z`, `R' = R [u]x` with the precurvature `u`, by midpoint steps.
fn advance(section: &SectionDescription, position: &mut Vector3<f64>, rotation: &mut Rotation3<f64>) {
    let step = section.length / STEPS as f64;
    let half_turn = Rotation3::new(Vector3::from(section.precurvature) * (step / 2.0));
    for _ in 0..STEPS {
        *rotation *= half_turn;
        *position += *rotation * Vector3::z() * step;
        *rotation *= half_turn;
    }
}

fn millimetres(point: &Vector3<f64>) -> String {
    let [x, y, z] = [point.x, point.y, point.z].map(|component| short(component * 1e3));
    format!("({x}, {y}, {z})")
}

/// Three decimals at most.
fn short(value: f64) -> f64 {
    // The sum turns a negative zero into zero.
    (value * 1e3).round() / 1e3 + 0.0
}
