//! Parameter errors: how the plant differs from what both sides believe of it.
//!
//! The modulus error is applied as given. The moment of each magnet and the field per ampere of each coil are
//! off by exactly the given share, up or down with equal chance; each coil's axis is tilted by exactly the
//! given angle and its place shifted by exactly the given distance, in directions of equal chance. All is
//! drawn from the seed: a controller meets the stated error in full, in a pattern that it cannot know.

use std::f64::consts::TAU;

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Stream of the plant's seed from which the errors are drawn.
const RANDOM_STREAM: u64 = 0;

/// Sizes of the errors; shares are of the described values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorMagnitudes {
    /// Added to every elastic stiffness.
    pub modulus: f64,
    /// Added to or taken from each magnet's moment.
    pub moment: f64,
    /// Added to or taken from each coil's field per ampere.
    pub coil_gain: f64,
    /// Angle between each coil's axis and the described one, rad.
    pub coil_axis: f64,
    /// Distance of each coil from the described place, m.
    pub coil_position: f64,
}

/// How one coil differs from its description.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoilError {
    /// Field per ampere over the described one.
    pub gain: f64,
    /// Rotation vector of the axis, rad, in the coil's described frame; across its x axis.
    pub tilt: Vector3<f64>,
    /// Shift, m, in the coil's described frame.
    pub offset: Vector3<f64>,
}

impl CoilError {
    /// A coil as described.
    pub const NONE: Self =
        Self { gain: 1.0, tilt: Vector3::new(0.0, 0.0, 0.0), offset: Vector3::new(0.0, 0.0, 0.0) };
}

/// The plant's true parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueParameters {
    /// The manipulator as it is.
    pub manipulator: ManipulatorDescription,
    /// Errors of each coil.
    pub coils: Vec<CoilError>,
}

impl ErrorMagnitudes {
    /// Draws the true parameters.
    #[must_use]
    pub fn apply(&self, description: &HardwareDescription, seed: u64) -> TrueParameters {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RANDOM_STREAM);
        let mut factor = |share: f64| if random.random_bool(0.5) { 1.0 + share } else { 1.0 - share };
        let mut manipulator = description.manipulator.clone();
        let stiffer = 1.0 + self.modulus;
        for part in &mut manipulator.parts {
            match part {
                PartDescription::Section(section) => {
                    section.bending_stiffness *= stiffer;
                    section.torsion_stiffness *= stiffer;
                    if let Some(stretch) = &mut section.extensible {
                        stretch.shear *= stiffer;
                        stretch.axial *= stiffer;
                    }
                }
                PartDescription::Magnet(magnet) => {
                    let factor = factor(self.moment);
                    magnet.moment_body = magnet.moment_body.map(|component| component * factor);
                }
            }
        }
        let gains: Vec<f64> = description.coils.iter().map(|_| factor(self.coil_gain)).collect();
        // Drawn after all signs, so that a seed keeps its pattern of those.
        let coil = |gain| CoilError {
            gain,
            tilt: across(&mut random) * self.coil_axis,
            offset: direction(&mut random) * self.coil_position,
        };
        let coils = gains.into_iter().map(coil).collect();
        TrueParameters { manipulator, coils }
    }
}

/// A unit vector across x, of equal chance all round.
fn across(random: &mut ChaCha8Rng) -> Vector3<f64> {
    let (sine, cosine) = random.random_range(0.0..TAU).sin_cos();
    Vector3::new(0.0, cosine, sine)
}

/// A unit vector of equal chance in every direction: its x is uniform (Archimedes).
fn direction(random: &mut ChaCha8Rng) -> Vector3<f64> {
    let x: f64 = random.random_range(-1.0..1.0);
    across(random) * (1.0 - x * x).sqrt() + Vector3::x() * x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    const NO_ERRORS: ErrorMagnitudes =
        ErrorMagnitudes { modulus: 0.0, moment: 0.0, coil_gain: 0.0, coil_axis: 0.0, coil_position: 0.0 };

    #[test]
    fn errors_have_the_stated_size_and_a_sign_from_the_seed() {
        let description = fixture::bigmag();
        let errors = ErrorMagnitudes {
            modulus: 0.1,
            moment: 0.05,
            coil_gain: 0.02,
            coil_axis: 0.01,
            coil_position: 5e-4,
        };
        let mut patterns = std::collections::BTreeSet::new();
        for seed in 0..20 {
            let parameters = errors.apply(&description, seed);
            assert_eq!(parameters, errors.apply(&description, seed));
            let parts = parameters.manipulator.parts.iter().zip(&description.manipulator.parts);
            let mut pattern = Vec::new();
            for (off, described) in parts {
                match (off, described) {
                    (PartDescription::Section(off), PartDescription::Section(described)) => {
                        assert!((off.bending_stiffness / described.bending_stiffness - 1.1).abs() < 1e-12);
                        assert!((off.torsion_stiffness / described.torsion_stiffness - 1.1).abs() < 1e-12);
                    }
                    (PartDescription::Magnet(off), PartDescription::Magnet(described)) => {
                        let ratio = off.moment_body[2] / described.moment_body[2];
                        assert!(((ratio - 1.0).abs() - 0.05).abs() < 1e-12);
                        pattern.push(ratio > 1.0);
                    }
                    _ => panic!("parts changed their kind"),
                }
            }
            for coil in parameters.coils {
                assert!(((coil.gain - 1.0).abs() - 0.02).abs() < 1e-12);
                assert!((coil.tilt.norm() - 0.01).abs() < 1e-12 && coil.tilt.x == 0.0);
                assert!((coil.offset.norm() - 5e-4).abs() < 1e-12);
                pattern.push(coil.gain > 1.0);
            }
            patterns.insert(pattern);
        }
        // 20 draws out of 256 patterns.
        assert!(patterns.len() > 15);
    }

    #[test]
    fn no_errors_leave_the_description_as_it_is() {
        let description = fixture::bigmag();
        let parameters = NO_ERRORS.apply(&description, 7);
        assert_eq!(parameters.manipulator, description.manipulator);
        assert_eq!(parameters.coils, [CoilError::NONE; 6]);
    }

    /// Goal: the signs that a seed gave before coils could be tilted and shifted are still the same.
    #[test]
    fn placements_are_drawn_after_the_signs() {
        let description = fixture::bigmag();
        let signs = ErrorMagnitudes { moment: 0.05, coil_gain: 0.02, ..NO_ERRORS };
        let all = ErrorMagnitudes { coil_axis: 0.01, coil_position: 5e-4, ..signs };
        let gains = |errors: ErrorMagnitudes, seed| -> Vec<f64> {
            errors.apply(&description, seed).coils.iter().map(|coil| coil.gain).collect()
        };
        assert_eq!(gains(all, 1), [0.98, 1.02, 1.02, 0.98, 1.02, 1.02]);
        for seed in 0..20 {
            assert_eq!(gains(signs, seed), gains(all, seed));
        }
    }

    #[test]
    fn shifts_point_everywhere_alike() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut sum = Vector3::zeros();
        let mut squares = Vector3::zeros();
        for _ in 0..3000 {
            let direction = direction(&mut random);
            assert!((direction.norm() - 1.0).abs() < 1e-12);
            sum += direction / 3000.0;
            squares += direction.component_mul(&direction) / 3000.0;
        }
        // Standard deviations: 1 / sqrt(3 * 3000) = 0.011 of the means, 0.0055 of the squares.
        assert!(sum.amax() < 0.04 && squares.add_scalar(-1.0 / 3.0).amax() < 0.02, "{sum} {squares}");
    }
}
