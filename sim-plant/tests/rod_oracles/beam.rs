//! Natural frequencies of straight beams with rigid bodies, by transfer matrices: nothing is cut into elements.
//!
//! | symbol | meaning |
//! |---|---|
//! | `y`, `a` | deflection and rotation of the cross-section |
//! | `q`, `m` | transverse force and moment that the part beyond exerts |
//! | `w` | angular frequency |
//! | `A`, `I` | area and second moment of the cross-section; `r` density |
//!
//! A harmonic motion of Timoshenko's beam obeys, along its length,
//!
//! `y' = a + q/GA,  a' = m/EI,  q' = -rA w^2 y,  m' = -q - rI w^2 a`
//!
//! which is Rayleigh's for `1/GA = 0` and Euler and Bernoulli's when `rI` is left out as well. The exponential of the
//! constant matrix carries the state along a section exactly; a rigid body of length `2 b`, mass `M` and inertia `J` adds
//! `-M w^2 (y + b a)` to `q`. Clamped and free ends leave a 2 x 2 determinant, zero at a natural frequency.
//! Torsion is the same with the two states angle and torque.

use magsteer_hal::description::{
    MagnetDescription, ManipulatorDescription, PartDescription, SectionDescription,
};
use nalgebra::{Matrix2, Matrix4};

/// Which beam the sections are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Theory {
    /// No rotary inertia, no shear.
    EulerBernoulli,
    /// Rotary inertia, and shear where a section has a shear stiffness: the equations of the rod.
    Rayleigh,
}

fn bend_section(section: &SectionDescription, theory: Theory, squared: f64) -> Matrix4<f64> {
    let rotary = match theory {
        Theory::EulerBernoulli => 0.0,
        Theory::Rayleigh => section.mass_per_length * section.radius.powi(2) / 4.0,
    };
    let shear = section.extensible.map_or(0.0, |stiffness| 1.0 / stiffness.shear);
    // State y, a, q, m.
    let rate = Matrix4::new(
        0.0,
        1.0,
        shear,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0 / section.bending_stiffness,
        -section.mass_per_length * squared,
        0.0,
        0.0,
        0.0,
        0.0,
        -rotary * squared,
        -1.0,
        0.0,
    );
    (rate * section.length).exp()
}

fn bend_magnet(magnet: &MagnetDescription, squared: f64) -> Matrix4<f64> {
    let half = magnet.length / 2.0;
    let inertia = magnet.mass * (3.0 * magnet.radius.powi(2) + magnet.length.powi(2)) / 12.0;
    let to_centre =
        Matrix4::new(1.0, half, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -half, 1.0);
    let centre = Matrix4::new(
        1.0,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
        0.0,
        0.0,
        -magnet.mass * squared,
        0.0,
        1.0,
        0.0,
        0.0,
        -inertia * squared,
        0.0,
        1.0,
    );
    to_centre * centre * to_centre
}

/// Determinant that vanishes at a natural frequency of bending.
fn bending(description: &ManipulatorDescription, theory: Theory, w: f64) -> f64 {
    let mut transfer = Matrix4::identity();
    for part in &description.parts {
        transfer = match part {
            PartDescription::Section(section) => bend_section(section, theory, w * w),
            PartDescription::Magnet(magnet) => bend_magnet(magnet, w * w),
        } * transfer;
    }
    transfer.fixed_view::<2, 2>(2, 2).into_owned().determinant()
}

/// Torque at the free end for a unit torque at the clamp: zero at a natural frequency of torsion.
fn torsion(description: &ManipulatorDescription, w: f64) -> f64 {
    let mut transfer = Matrix2::identity();
    for part in &description.parts {
        transfer = match part {
            PartDescription::Section(section) => {
                let inertia = section.mass_per_length * section.radius.powi(2) / 2.0;
                (Matrix2::new(0.0, 1.0 / section.torsion_stiffness, -inertia * w * w, 0.0) * section.length)
                    .exp()
            }
            PartDescription::Magnet(magnet) => {
                Matrix2::new(1.0, 0.0, -magnet.mass * magnet.radius.powi(2) / 2.0 * w * w, 1.0)
            }
        } * transfer;
    }
    transfer[(1, 1)]
}

/// The first `count` zeros of `of`, none of them nearer to another than one per cent of the lowest.
fn zeros(of: impl Fn(f64) -> f64, count: usize) -> Vec<f64> {
    let mut found = Vec::new();
    let mut low = 1.0;
    while found.len() < count {
        let high = low * 1.01;
        if of(low).signum() != of(high).signum() {
            let (mut left, mut right) = (low, high);
            for _ in 0..60 {
                let middle = 0.5 * (left + right);
                if of(middle).signum() == of(left).signum() { left = middle } else { right = middle }
            }
            found.push(0.5 * (left + right));
        }
        low = high;
        assert!(low < 1e7, "no frequency found");
    }
    found
}

/// The lowest `count` angular frequencies of bending of a straight manipulator without gravity, rad/s.
pub fn bending_frequencies(description: &ManipulatorDescription, theory: Theory, count: usize) -> Vec<f64> {
    zeros(|w| bending(description, theory, w), count)
}

/// The lowest angular frequency of torsion, rad/s.
pub fn torsion_frequency(description: &ManipulatorDescription) -> f64 {
    zeros(|w| torsion(description, w), 1)[0]
}
