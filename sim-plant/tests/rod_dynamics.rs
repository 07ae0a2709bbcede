//! The rod in time: energy and damping against theory.

#[path = "../src/fixture.rs"]
mod fixture;
mod validation;

use magsteer_hal::description::ManipulatorDescription;
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::Vector3;
use validation::Row;

/// The default step and mesh of the plant.
const STEP: f64 = 5e-4;
const MESHING: Meshing = Meshing { element_length_max: 2.5e-3 };

fn no_field(_: &Vector3<f64>) -> Field {
    Field::zero()
}

fn rod(manipulator: &ManipulatorDescription, gravity: [f64; 3]) -> Rod {
    Rod::new(manipulator, gravity, MESHING, Stepping { step: STEP, retardation: 0.0 })
}

/// Steps a rod and returns the greatest growth of its energy in one step, relative to what was there
/// to lose, and the energy lost altogether.
fn growth(rod: &mut Rod, rest: f64, steps: usize) -> (f64, f64) {
    let start = rod.energy().total() - rest;
    let (mut last, mut growth) = (start, f64::NEG_INFINITY);
    for _ in 0..steps {
        assert!(rod.step(no_field).converged);
        let now = rod.energy().total() - rest;
        growth = growth.max((now - last) / start);
        last = now;
    }
    (growth, 1.0 - last / start)
}

#[test]
fn energy_never_grows_without_a_field() {
    let description = fixture::bigmag();
    for damping_ratio in [0.0, 0.02, 0.2] {
        for blow in [Vector3::new(0.0, 0.3, 0.2), Vector3::new(0.0, 0.0, -1.5), Vector3::new(0.3, 1.0, 0.0)] {
            let mut rod = rod(&description.manipulator, description.gravity);
            assert!(rod.settle(no_field));
            let rest = rod.energy().total();
            let mode = rod.first_mode().expect("has mass");
            rod.set_stepping(Stepping { step: STEP, retardation: mode.retardation(damping_ratio) });
            rod.strike(blow);
            let (growth, lost) = growth(&mut rod, rest, 4000);
            // The solver leaves corrections under 1e-10 m out.
            assert!(growth <= 1e-9, "{damping_ratio}, {blow}: grew by {growth}");
            assert!(
                lost > 0.0 && (damping_ratio < 0.1 || lost > 0.999),
                "{damping_ratio}, {blow}: lost {lost}"
            );
        }
    }
}

/// What a decaying oscillation shows over its first clean period: damping ratio, and undamped angular frequency.
fn decay(signal: &[f64]) -> (f64, f64) {
    // Each extreme between two samples, from the parabola through three.
    let extremes: Vec<(f64, f64)> = signal
        .windows(3)
        .enumerate()
        .filter(|(_, w)| (w[1] - w[0]) * (w[2] - w[1]) < 0.0)
        .map(|(index, w)| {
            let (slope, bend) = ((w[2] - w[0]) / 2.0, w[2] - 2.0 * w[1] + w[0]);
            ((index + 1) as f64 - slope / bend, w[1] - slope * slope / (2.0 * bend))
        })
        .collect();
    // From the third extreme on, the faster modes are gone.
    let (first, second) = (extremes[2], extremes[4]);
    let decrement = (first.1 / second.1).ln();
    let period = (second.0 - first.0) * STEP;
    let ratio = decrement / decrement.hypot(std::f64::consts::TAU);
    (ratio, std::f64::consts::TAU / period / (1.0 - ratio * ratio).sqrt())
}

#[test]
fn logarithmic_decrement_gives_the_damping_ratio_of_each_plane() {
    let description = fixture::bigmag();
    let mut rows = Vec::new();
    for damping_ratio in [0.02, 0.05, 0.2] {
        for (plane, blow) in [("sideways", Vector3::y()), ("downwards", Vector3::z())] {
            let mut rod = rod(&description.manipulator, description.gravity);
            assert!(rod.settle(no_field));
            let rest = rod.tip_pose().position;
            let mode = rod.first_mode().expect("has mass");
            let retardation = mode.retardation(damping_ratio);
            let own = rod.first_mode_along(&blow).expect("has mass");
            rod.set_stepping(Stepping { step: STEP, retardation });
            // So weak that the swing stays linear.
            rod.strike(blow * 2e-4);
            let signal: Vec<f64> = (0..3000)
                .map(|_| {
                    assert!(rod.step(no_field).converged);
                    (rod.tip_pose().position - rest).dot(&blow)
                })
                .collect();
            let (found, frequency) = decay(&signal);
            // Sideways bending of the sagging rod turns it too: a trace of that faster, overdamped mode is left.
            assert!((frequency / own.angular_frequency - 1.0).abs() < 5e-3);
            // Kelvin-Voigt: `tau w E / 2`, `E` the elastic share of the mode's stiffness, and `x w t / 2` of the integration.
            let expected = 0.5 * frequency * (retardation * own.elastic_share + 0.02 * STEP);
            let off = 100.0 * (found / expected - 1.0);
            rows.push(Row::new(format!("damping ratio {damping_ratio}, {plane}"), off, 1.0, "%"));
        }
    }
    validation::hold("rod.md", "damping", &rows);
}

#[test]
fn a_step_repeats_bit_for_bit() {
    let description = fixture::bigmag();
    let run = || {
        let mut rod = rod(&description.manipulator, description.gravity);
        (0..200).for_each(|_| assert!(rod.step(no_field).converged));
        rod.tip_pose()
    };
    assert_eq!(run(), run());
}
