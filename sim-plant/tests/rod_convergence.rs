//! Convergence of the shipped planar rig's rod with the mesh and with the step: at rest under coil currents, and in a swing.

#[path = "../src/fixture.rs"]
mod fixture;
mod validation;

use magsteer_sim_plant::field::{CoilArray, Field};
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::Vector3;
use validation::Row;

/// The shipped step, s, element, mm, and damping ratio.
const STEP: f64 = 5e-4;
const ELEMENT_MM: f64 = 2.5;
const DAMPING_RATIO: f64 = 0.2;

/// Currents that bend the shipped rod by some 40 degrees, in the plane and out of it, with the frames turned.
const CURRENTS: [f64; 6] = [2.0, -1.6, 1.0, 2.4, 3.0, -2.0];
const ANGLES: [f64; 2] = [0.3, -0.4];

fn resting(element_mm: f64, step: f64) -> Rod {
    let description = fixture::bigmag();
    let meshing = Meshing { element_length_max: element_mm * 1e-3 };
    let undamped = Stepping { step, retardation: 0.0 };
    let mut rod = Rod::new(&description.manipulator, description.gravity, meshing, undamped);
    rod.set_magnet_interaction(true);
    assert!(rod.settle(|_| Field::zero()));
    rod
}

fn damped(mut rod: Rod, step: f64) -> Rod {
    let mode = rod.first_mode().expect("has mass");
    rod.set_stepping(Stepping { step, retardation: mode.retardation(DAMPING_RATIO) });
    rod
}

fn array() -> CoilArray {
    let mut array = CoilArray::as_described(&fixture::bigmag());
    array.actuate(&CURRENTS, &ANGLES);
    array
}

/// Pointing directions of both magnets.
fn tangents(rod: &Rod) -> [Vector3<f64>; 2] {
    [0, 1].map(|index| rod.magnet_pose(index).rotation * Vector3::z())
}

/// Greatest angle between two rods' magnets, deg.
fn apart(first: &[Vector3<f64>; 2], second: &[Vector3<f64>; 2]) -> f64 {
    let angle = |index: usize| first[index].cross(&second[index]).norm().asin().to_degrees();
    angle(0).max(angle(1))
}

/// Rest under the coils' field, found by strong damping.
fn settled(element_mm: f64) -> [Vector3<f64>; 2] {
    let array = array();
    let mut rod = resting(element_mm, STEP);
    assert!(rod.settle(|point| array.at(point)));
    tangents(&rod)
}

/// Where the shipped damping brings the rod in four seconds after the currents come on within 0.1 s: fifteen time constants.
fn driven(step: f64) -> [Vector3<f64>; 2] {
    let mut array = array();
    let mut rod = damped(resting(ELEMENT_MM, step), step);
    for index in 0..(4.0 / step) as u32 {
        let share = (f64::from(index) * step / 0.1).min(1.0);
        array.actuate(&CURRENTS.map(|current| current * share), &ANGLES);
        assert!(rod.step(|point| array.at(point)).converged);
    }
    tangents(&rod)
}

#[test]
fn settled_angles_depend_on_neither_step_nor_mesh() {
    let rest = tangents(&resting(ELEMENT_MM, STEP));
    let shipped = settled(ELEMENT_MM);
    let turned = apart(&rest, &shipped);
    assert!(turned > 25.0, "the currents must bend the rod: {turned} deg");
    let mut rows = Vec::new();
    for (step, bar) in [(1e-3, 0.01), (2.5e-4, 0.01)] {
        let change = apart(&driven(step), &driven(STEP));
        rows.push(Row::new(
            format!("settled angles, step {} instead of 0.5 ms", step * 1e3),
            change,
            bar,
            "deg",
        ));
    }
    rows.push(Row::new(
        "settled angles, driven for 4 s instead of settled",
        apart(&driven(STEP), &shipped),
        0.01,
        "deg",
    ));
    // Against a mesh so fine that its own error is a hundredth of the next.
    let fine = settled(0.3125);
    let meshes = [5.0, 2.5, 1.25];
    let errors = meshes.map(|element_mm| apart(&settled(element_mm), &fine));
    for (element_mm, error) in meshes.into_iter().zip(errors) {
        let what = format!("settled angles, elements of {element_mm} instead of 0.3125 mm");
        rows.push(Row::new(what, error, 0.01 * (element_mm / ELEMENT_MM).powi(2), "deg"));
    }
    let order = (errors[0] / errors[1]).log2();
    rows.push(Row::new("order in the elements' length, beyond 4", order - 4.0, 0.2, ""));
    validation::hold("rod.md", "convergence at rest", &rows);
}

/// Tip positions every 10 ms of half a second's swing, released from the coils' field.
fn swing(element_mm: f64, step: f64) -> Vec<Vector3<f64>> {
    let array = array();
    let mut rod = resting(element_mm, step);
    assert!(rod.settle(|point| array.at(point)));
    let mut rod = damped(rod, step);
    let every = (0.01 / step).round() as usize;
    (0..50)
        .map(|_| {
            (0..every).for_each(|_| assert!(rod.step(|_| Field::zero()).converged));
            rod.tip_pose().position
        })
        .collect()
}

/// Greatest distance between two swings, mm.
fn distance(first: &[Vector3<f64>], second: &[Vector3<f64>]) -> f64 {
    first.iter().zip(second).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) * 1e3
}

#[test]
fn swing_converges_with_the_first_power_of_the_step_and_the_second_of_the_mesh() {
    let path = swing(ELEMENT_MM, STEP);
    let wide = path.iter().map(|tip| (tip - path[0]).norm()).fold(0.0, f64::max) * 1e3;
    assert!(wide > 20.0, "{wide} mm");
    let mut rows = Vec::new();
    let exact = swing(ELEMENT_MM, STEP / 16.0);
    let steps = [1e-3, STEP, STEP / 2.0];
    let errors = steps.map(|step| distance(&swing(ELEMENT_MM, step), &exact));
    for (step, error) in steps.into_iter().zip(errors) {
        rows.push(Row::new(
            format!("swing, step {} instead of 0.03125 ms", step * 1e3),
            error,
            0.05 * step / STEP,
            "mm",
        ));
    }
    rows.push(Row::new("order in the step, beyond 1", (errors[0] / errors[1]).log2() - 1.0, 0.2, ""));
    let exact = swing(0.3125, STEP);
    let meshes = [5.0, 2.5, 1.25];
    let errors = meshes.map(|element_mm| distance(&swing(element_mm, STEP), &exact));
    for (element_mm, error) in meshes.into_iter().zip(errors) {
        rows.push(Row::new(
            format!("swing, elements of {element_mm} instead of 0.3125 mm"),
            error,
            0.2 * (element_mm / ELEMENT_MM).powi(2),
            "mm",
        ));
    }
    rows.push(Row::new(
        "order in the elements' length of the swing, beyond 2",
        (errors[0] / errors[1]).log2() - 2.0,
        0.3,
        "",
    ));
    validation::hold("rod.md", "convergence of a swing", &rows);
}
