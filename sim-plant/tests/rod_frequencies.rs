//! Natural frequencies of the rod against beams that are not cut into elements.
//!
//! The midpoint rule lengthens a period: a mode of angular frequency `w` swings at `2/t atan(w t / 2)`, slower by
//! `(w t)^2 / 12`, when the step is `t`. What is left beside that is the mesh's.

#[path = "rod_oracles/beam.rs"]
mod beam;
#[path = "../src/fixture.rs"]
mod fixture;
mod validation;

use std::f64::consts::FRAC_PI_2;

use beam::{Theory, bending_frequencies, torsion_frequency};
use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};
use nalgebra::Vector3;
use validation::Row;

/// The shipped step and mesh of the plant.
const STEP: f64 = 5e-4;
const MESHING: Meshing = Meshing { element_length_max: 2.5e-3 };

/// Amplitude at an angular frequency of a signal sampled every `step`, through a Hann window.
fn spectrum(signal: &[f64], step: f64, frequency: f64) -> f64 {
    let count = signal.len() as f64;
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (index, value) in signal.iter().enumerate() {
        let place = index as f64;
        let window = 1.0 - (2.0 * std::f64::consts::PI * place / count).cos();
        let (sine, cosine) = (frequency * place * step).sin_cos();
        real += window * value * cosine;
        imaginary += window * value * sine;
    }
    real.hypot(imaginary)
}

/// The strongest angular frequency within a twentieth of `expected`, to 1e-6 of it.
fn peak_near(signal: &[f64], step: f64, expected: f64) -> f64 {
    let (mut centre, mut spacing) = (expected, expected * 0.05 / 20.0);
    for _ in 0..5 {
        let candidates = (-20..=20).map(|index| centre + spacing * f64::from(index));
        let strength = candidates.map(|candidate| (spectrum(signal, step, candidate), candidate));
        centre = strength.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(centre, |best| best.1);
        spacing /= 10.0;
    }
    centre
}

/// Share by which the midpoint rule slows a mode.
fn slowed(w: f64, step: f64) -> f64 {
    (w * step / 2.0).atan() / (w * step / 2.0) - 1.0
}

/// A rod without gravity or damping.
fn rod(manipulator: &ManipulatorDescription, step: f64) -> Rod {
    Rod::new(manipulator, [0.0; 3], MESHING, Stepping { step, retardation: 0.0 })
}

/// Tip deflection after a weak blow.
fn bent(manipulator: &ManipulatorDescription, step: f64, seconds: f64) -> Vec<f64> {
    let mut rod = rod(manipulator, step);
    rod.strike(Vector3::new(0.0, 0.01, 0.0));
    let start = rod.tip_pose().position.y;
    (0..(seconds / step) as usize)
        .map(|_| {
            assert!(rod.step(|_| Field::zero()).converged);
            rod.tip_pose().position.y - start
        })
        .collect()
}

/// Tip twist after a weak turning blow.
fn twisted(manipulator: &ManipulatorDescription, step: f64, seconds: f64) -> Vec<f64> {
    let mut rod = rod(manipulator, step);
    rod.strike_turning(1.0);
    let start = rod.tip_pose().rotation;
    (0..(seconds / step) as usize)
        .map(|_| {
            assert!(rod.step(|_| Field::zero()).converged);
            (start.inverse() * rod.tip_pose().rotation).scaled_axis().z
        })
        .collect()
}

fn plain() -> ManipulatorDescription {
    fixture::cantilever(fixture::rubber()).manipulator
}

/// The plain cantilever with the shipped magnet at its tip.
fn tipped() -> ManipulatorDescription {
    let mut description = plain();
    let magnet = fixture::bigmag().manipulator.parts[1].clone();
    description.parts.push(magnet);
    description
}

#[test]
fn oracle_agrees_with_closed_forms() {
    let section = fixture::rubber();
    let scale = (section.bending_stiffness / section.mass_per_length).sqrt() / section.length.powi(2);
    let found = bending_frequencies(&plain(), Theory::EulerBernoulli, 2);
    // Roots of cos(x) cosh(x) = -1, squared.
    for (root, found) in [1.875_104_068_711_961_f64, 4.694_091_132_974_175].into_iter().zip(found) {
        assert!((found / (root.powi(2) * scale) - 1.0).abs() < 1e-9);
    }
    let polar = section.mass_per_length * section.radius.powi(2) / 2.0;
    let expected = FRAC_PI_2 / section.length * (section.torsion_stiffness / polar).sqrt();
    assert!((torsion_frequency(&plain()) / expected - 1.0).abs() < 1e-9);
    // A point with mass and rotary inertia at the tip, its frequency equation written out.
    let (mass, inertia) = (2.0 * section.mass_per_length * section.length, 1e-9);
    let mut description = plain();
    let length = 1e-12;
    description.parts.push(PartDescription::Magnet(magsteer_hal::description::MagnetDescription {
        name: "tip".to_owned(),
        length,
        radius: (4.0 * inertia / mass).sqrt(),
        mass,
        moment_body: [0.0; 3],
    }));
    for w in bending_frequencies(&description, Theory::EulerBernoulli, 2) {
        let x = (w / scale).sqrt();
        let (m, j) = (
            mass / (section.mass_per_length * section.length),
            inertia / (section.mass_per_length * section.length.powi(3)),
        );
        let (s, c, sh, ch) = (x.sin(), x.cos(), x.sinh(), x.cosh());
        let balance = 1.0 + c * ch + m * x * (c * sh - s * ch) - j * x.powi(3) * (c * sh + s * ch)
            + m * j * x.powi(4) * (1.0 - c * ch);
        assert!(balance.abs() < 1e-6 * ch, "{x}: {balance}");
    }
}

#[test]
fn frequencies_are_those_of_the_beam() {
    let mut rows = Vec::new();
    let mut compare = |what: &str, found: f64, expected: f64, bar: f64| {
        rows.push(Row::new(what, 100.0 * (found / expected - 1.0), bar, "%"));
    };
    for (name, manipulator, seconds) in [
        ("plain cantilever", plain(), 4.0),
        ("cantilever with a magnet at its tip", tipped(), 10.0),
        ("shipped rod, straight", fixture::bigmag().manipulator, 10.0),
    ] {
        let signal = bent(&manipulator, STEP, seconds);
        let expected = bending_frequencies(&manipulator, Theory::Rayleigh, 2);
        let classic = bending_frequencies(&manipulator, Theory::EulerBernoulli, 2);
        for (mode, (expected, classic)) in expected.into_iter().zip(classic).enumerate() {
            let found = peak_near(&signal, STEP, expected);
            let mode = mode + 1;
            compare(&format!("{name}, bending {mode}, Rayleigh's beam"), found, expected, 0.5);
            compare(&format!("{name}, bending {mode}, Euler and Bernoulli's beam"), found, classic, 0.5);
            let slow = expected * (1.0 + slowed(expected, STEP));
            compare(
                &format!("{name}, bending {mode}, Rayleigh's beam under the midpoint rule"),
                found,
                slow,
                0.05,
            );
        }
        let expected = torsion_frequency(&manipulator);
        // Nothing but its own thin rubber turns at the end of the plain cantilever: fast enough for the shipped step to slow
        // it by 2.5 %. The rods with magnets, and the plain one at half the step, are within one per cent.
        let coarse = if name == "plain cantilever" { 3.0 } else { 1.0 };
        for (step, bar) in [(STEP, coarse), (STEP / 2.0, 1.0), (STEP / 10.0, 0.1)] {
            let slow = expected * (1.0 + slowed(expected, step));
            let found = peak_near(&twisted(&manipulator, step, 0.5), step, slow);
            compare(&format!("{name}, torsion, step {} ms", step * 1e3), found, expected, bar);
            if step == STEP {
                let what = format!("{name}, torsion, step {} ms, under the midpoint rule", step * 1e3);
                compare(&what, found, slow, 0.1);
            }
        }
    }
    validation::hold("rod.md", "frequencies", &rows);
}
