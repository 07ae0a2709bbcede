//! The rod in time: frequencies, energy and damping against theory.

#[path = "../src/fixture.rs"]
mod fixture;

use magsteer_hal::description::{ManipulatorDescription, SectionDescription};
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

fn plain(section: SectionDescription) -> Rod {
    rod(&fixture::cantilever(section).manipulator, [0.0; 3])
}

/// Amplitude at an angular frequency of a signal sampled every [`STEP`], through a Hann window.
fn spectrum(signal: &[f64], frequency: f64) -> f64 {
    let count = signal.len() as f64;
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (index, value) in signal.iter().enumerate() {
        let place = index as f64;
        let window = 1.0 - (2.0 * std::f64::consts::PI * place / count).cos();
        let (sine, cosine) = (frequency * place * STEP).sin_cos();
        real += window * value * cosine;
        imaginary += window * value * sine;
    }
    real.hypot(imaginary)
}

/// The strongest angular frequency within a tenth of `expected`.
fn peak_near(signal: &[f64], expected: f64) -> f64 {
    let candidates = (0..=2000).map(|index| expected * (0.9 + 1e-4 * f64::from(index)));
    candidates.max_by(|a, b| spectrum(signal, *a).total_cmp(&spectrum(signal, *b))).expect("not empty")
}

#[test]
fn plain_cantilever_vibrates_at_the_first_two_frequencies_of_the_beam() {
    let section = fixture::rubber();
    let scale = (section.bending_stiffness / section.mass_per_length).sqrt() / section.length.powi(2);
    let mut rod = plain(section);
    rod.strike(Vector3::new(0.01, 0.0, 0.0));
    let signal: Vec<f64> = (0..8000)
        .map(|_| {
            assert!(rod.step(no_field).converged);
            rod.tip_pose().position.x
        })
        .collect();
    // Roots of cos(x) cosh(x) = -1, squared.
    for root in [1.875_104_069_f64, 4.694_091_133] {
        let expected = root.powi(2) * scale;
        let found = peak_near(&signal, expected);
        assert!((found / expected - 1.0).abs() < 0.01, "{found} rad/s instead of {expected}");
    }
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
