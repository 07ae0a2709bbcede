//! Measurements of the field.

use nalgebra::Vector3;

/// How the columns of a file are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// One coil, in its own frame: x along its axis into the workspace, the expansion point at zero.
    OneCoil,
    /// An array of coils, in the world.
    Array,
}

/// One measured field.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Line of the file, 1 first.
    pub line: usize,
    /// Place of the probe, m; world, or the coil's frame.
    pub position: Vector3<f64>,
    /// Current in each coil, A.
    pub currents: Vec<f64>,
    /// Field, T, in the axes of `position`.
    pub field: Vector3<f64>,
}

/// All readings of a file, in SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// How the file was laid out.
    pub layout: Layout,
    /// Line of the header, 1 first.
    pub header_line: usize,
    /// Names of the columns, in the file's order.
    pub columns: Vec<String>,
    /// The readings, in the file's order; at least one.
    pub readings: Vec<Reading>,
    /// False when the last line has no end: then its last value may have been cut short.
    pub ends_with_line_end: bool,
}

impl Readings {
    /// Number of coils with a current in each reading.
    #[must_use]
    pub fn coil_count(&self) -> usize {
        self.readings.first().map_or(0, |reading| reading.currents.len())
    }

    /// Name of the column that holds a coil's current.
    #[must_use]
    pub fn current_column(&self, coil: usize) -> String {
        match self.layout {
            Layout::OneCoil => "current_a".to_owned(),
            Layout::Array => format!("i{coil}"),
        }
    }
}
