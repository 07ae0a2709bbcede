//! A wide swing under gravity, against an integration of the same rod that shares neither coordinates nor time step.
//!
//! The shipped rod is let go straight and level under four times its weight, and swings through more than a right angle. Its
//! material damps it. The oracle is a chain of links, extrapolated in their number.

#[path = "../src/fixture.rs"]
mod fixture;
#[path = "rod_oracles/links.rs"]
mod links;
mod validation;

use links::Links;
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use validation::Row;

const GRAVITY: f64 = 4.0 * 9.81;
/// Every so many s the tips are compared, so many times.
const EVERY: f64 = 5e-3;
const TIMES: usize = 70;

type Path = Vec<[f64; 2]>;

/// Tip of the chain of links.
fn by_links(cuts: usize, step: f64, tau: f64) -> Path {
    let mut links = Links::new(&fixture::bigmag().manipulator, cuts, GRAVITY, tau);
    let steps = (EVERY / step).round() as usize;
    (0..TIMES)
        .map(|_| {
            (0..steps).for_each(|_| links.step(step));
            links.tip()
        })
        .collect()
}

/// The links' path without the error that falls with the square of their number.
fn oracle(tau: f64) -> Path {
    let (coarse, fine) = (by_links(12, 5e-4, tau), by_links(24, 5e-4, tau));
    let extrapolate = |(coarse, fine): (&[f64; 2], &[f64; 2])| {
        [0, 1].map(|axis| fine[axis] + (fine[axis] - coarse[axis]) / 3.0)
    };
    coarse.iter().zip(&fine).map(extrapolate).collect()
}

/// Tip of the rod, from its clamp.
fn by_rod(element_mm: f64, step: f64, tau: f64) -> Path {
    let description = fixture::bigmag().manipulator;
    let meshing = Meshing { element_length_max: element_mm * 1e-3 };
    let mut rod = Rod::new(&description, [0.0, 0.0, -GRAVITY], meshing, Stepping { step, retardation: tau });
    let steps = (EVERY / step).round() as usize;
    (0..TIMES)
        .map(|_| {
            (0..steps).for_each(|_| assert!(rod.step(|_| Field::zero()).converged));
            let tip = rod.tip_pose().position;
            assert!(tip.y.abs() < 1e-9, "a plane swing stays in its plane");
            [tip.x - description.base_position[0], tip.z - description.base_position[2]]
        })
        .collect()
}

/// Greatest distance, mm.
fn apart(first: &Path, second: &Path) -> f64 {
    first.iter().zip(second).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max) * 1e3
}

#[test]
fn links_are_exact_enough_to_judge() {
    let tau = 2e-3;
    let judged = oracle(tau);
    let finer = by_links(24, 2.5e-4, tau);
    let time = apart(&by_links(24, 5e-4, tau), &finer);
    let coarser: Path = {
        let (coarse, fine) = (by_links(6, 5e-4, tau), by_links(12, 5e-4, tau));
        coarse
            .iter()
            .zip(&fine)
            .map(|(c, f)| [0, 1].map(|axis| f[axis] + (f[axis] - c[axis]) / 3.0))
            .collect()
    };
    let space = apart(&coarser, &judged);
    println!("time {time} mm, space {space} mm");
    assert!(time < 1e-5, "{time} mm");
    assert!(space < 0.01, "{space} mm");
}

#[test]
fn wide_swing_follows_the_independent_integration() {
    let mut rows = Vec::new();
    for tau in [2e-3, 15e-3] {
        let judged = oracle(tau);
        let lowest = judged.iter().map(|tip| tip[1]).fold(f64::INFINITY, f64::min);
        assert!(lowest < -40e-3, "{lowest} m");
        let tau_ms = tau * 1e3;
        let shipped = apart(&by_rod(2.5, 5e-4, tau), &judged);
        rows.push(Row::new(
            format!("swing with tau = {tau_ms} ms, shipped mesh and step"),
            shipped,
            0.5,
            "mm",
        ));
        let finer = apart(&by_rod(1.25, 2.5e-4, tau), &judged);
        rows.push(Row::new(format!("swing with tau = {tau_ms} ms, both halved"), finer, 0.1, "mm"));
        let finest = apart(&by_rod(0.625, 6.25e-5, tau), &judged);
        rows.push(Row::new(
            format!("swing with tau = {tau_ms} ms, a quarter and an eighth"),
            finest,
            0.05,
            "mm",
        ));
    }
    validation::hold("rod.md", "swing", &rows);
}
