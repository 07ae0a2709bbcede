//! The rod in time: energy and damping against theory.

#[path = "../src/fixture.rs"]
mod fixture;

use magsteer_hal::description::ManipulatorDescription;
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::Vector3;

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

#[test]
fn logarithmic_decrement_gives_the_damping_ratio_asked_for() {
    let description = fixture::bigmag();
    for damping_ratio in [0.05, 0.2] {
        let mut rod = rod(&description.manipulator, description.gravity);
        assert!(rod.settle(no_field));
        let rest = rod.tip_pose().position;
        let mode = rod.first_mode().expect("has mass");
        rod.set_stepping(Stepping { step: STEP, retardation: mode.retardation(damping_ratio) });
        // Sideways, where only the first mode answers a slow blow for long.
        rod.strike(Vector3::new(0.0, 0.02, 0.0));
        let signal: Vec<f64> = (0..3000)
            .map(|_| {
                assert!(rod.step(no_field).converged);
                rod.tip_pose().position.y - rest.y
            })
            .collect();
        let peaks: Vec<f64> =
            signal.windows(3).filter(|w| w[1] > w[0] && w[1] >= w[2]).map(|w| w[1]).collect();
        // From the second peak on, the faster modes are gone.
        let decrement = (peaks[1] / peaks[2]).ln();
        let found = decrement / (decrement.powi(2) + (2.0 * std::f64::consts::PI).powi(2)).sqrt();
        // The sideways and the downward mode differ by a few per cent in frequency.
        assert!((found / damping_ratio - 1.0).abs() < 0.1, "{found} instead of {damping_ratio}");
    }
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
