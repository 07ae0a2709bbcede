//! The rod as its surface shows it: pieces with arc lengths and radii, from the description.

use crate::description::{ManipulatorDescription, PartDescription};

/// A section or a magnet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Piece {
    /// Arc length at which it begins, m.
    pub start: f64,
    /// m
    pub length: f64,
    /// m
    pub radius: f64,
    /// False for a magnet.
    pub is_flexible: bool,
    /// `EI`, N m^2; infinite for a magnet.
    pub stiffness: f64,
    /// Magnets beyond it.
    pub magnets_beyond: usize,
}

impl Piece {
    pub fn end(&self) -> f64 {
        self.start + self.length
    }

    pub fn middle(&self) -> f64 {
        self.start + self.length / 2.0
    }
}

/// The pieces of a manipulator from base to tip.
pub(super) fn pieces(manipulator: &ManipulatorDescription) -> Vec<Piece> {
    let is_magnet = |part: &&PartDescription| matches!(part, PartDescription::Magnet(_));
    let mut magnets_beyond = manipulator.parts.iter().filter(is_magnet).count();
    let mut start = 0.0;
    let piece = |part: &PartDescription| {
        let (length, radius, is_flexible, stiffness) = match part {
            PartDescription::Section(section) => {
                (section.length, section.radius, true, section.bending_stiffness)
            }
            PartDescription::Magnet(magnet) => (magnet.length, magnet.radius, false, f64::INFINITY),
        };
        magnets_beyond -= usize::from(!is_flexible);
        let piece = Piece { start, length, radius, is_flexible, stiffness, magnets_beyond };
        start += length;
        piece
    };
    manipulator.parts.iter().map(piece).collect()
}
