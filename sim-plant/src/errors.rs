//! Parameter errors: how the plant differs from what both sides believe of it.
//!
//! The modulus error is applied as given. The moment of each magnet and the field per ampere of each
//! coil are off by exactly the given share, up or down with equal chance, drawn from the seed: a
//! controller meets the stated error in full, in a pattern that it cannot know.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Stream of the plant's seed from which the errors are drawn.
const RANDOM_STREAM: u64 = 0;

/// Shares of the described values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorMagnitudes {
    /// Added to every elastic stiffness.
    pub modulus: f64,
    /// Added to or taken from each magnet's moment.
    pub moment: f64,
    /// Added to or taken from each coil's field per ampere.
    pub coil_gain: f64,
}

/// The plant's true parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueParameters {
    /// The manipulator as it is.
    pub manipulator: ManipulatorDescription,
    /// Field per ampere of each coil, over the described one.
    pub coil_gains: Vec<f64>,
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
        let coil_gains = description.coils.iter().map(|_| factor(self.coil_gain)).collect();
        TrueParameters { manipulator, coil_gains }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn errors_have_the_stated_size_and_a_sign_from_the_seed() {
        let description = fixture::bigmag();
        let errors = ErrorMagnitudes { modulus: 0.1, moment: 0.05, coil_gain: 0.02 };
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
            for gain in parameters.coil_gains {
                assert!(((gain - 1.0).abs() - 0.02).abs() < 1e-12);
                pattern.push(gain > 1.0);
            }
            patterns.insert(pattern);
        }
        // 20 draws out of 256 patterns.
        assert!(patterns.len() > 15);
    }

    #[test]
    fn no_errors_leave_the_description_as_it_is() {
        let description = fixture::bigmag();
        let none = ErrorMagnitudes { modulus: 0.0, moment: 0.0, coil_gain: 0.0 };
        let parameters = none.apply(&description, 7);
        assert_eq!(parameters.manipulator, description.manipulator);
        assert_eq!(parameters.coil_gains, [1.0; 6]);
    }
}
