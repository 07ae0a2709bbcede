//! Equilibria as they were measured.

use magsteer_hal::Actuation;
use nalgebra::Vector3;

/// What was measured of a magnet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MagnetReading {
    /// Tangent, unit, world.
    pub tangent: Vector3<f64>,
    /// Centre, m, world; `None` when only orientations were measured.
    pub position: Option<Vector3<f64>>,
}

/// One equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Line of the file, 1 first.
    pub line: usize,
    /// Measured currents and angles.
    pub actuation: Actuation,
    /// The magnets from base to tip; `None` for one that was not seen.
    pub magnets: Vec<Option<MagnetReading>>,
}

/// Which sort of measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Two rows.
    Tangent,
    /// Three rows.
    Position,
}

/// All equilibria of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Samples {
    /// Line of the header, 1 first.
    pub header_line: usize,
    /// The samples, in the file's order; at least one.
    pub samples: Vec<Sample>,
    /// False when the last line has no end: then its last value may have been cut short.
    pub ends_with_line_end: bool,
}

impl Sample {
    /// Numbers that were measured of it and count: two a tangent, three a position.
    #[must_use]
    pub fn equations(&self) -> usize {
        self.magnets.iter().flatten().map(|magnet| if magnet.position.is_some() { 5 } else { 2 }).sum()
    }
}
