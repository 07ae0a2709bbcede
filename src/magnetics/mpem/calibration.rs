//! What a calibration file holds.

use nalgebra::Vector3;

use super::source::Source;

/// A calibration of an array.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// `System_Name`.
    pub name: String,
    /// `Workspace_Dimensions`: least and greatest x, y and z of the calibrated box, m, world.
    pub workspace: [[f64; 2]; 3],
    /// Coils in the order of `Coil_List`, which is that of their currents.
    pub coils: Vec<CoilSources>,
    /// Field without currents, where the file has one.
    pub background: Option<CoilSources>,
    /// False when the last line has no end: then its last value may have been cut short.
    pub ends_with_line_end: bool,
}

/// A coil and its sources.
#[derive(Debug, Clone, PartialEq)]
pub struct CoilSources {
    /// Name.
    pub name: String,
    /// Line of the file at which it stands, 1 first; 0 when it comes from no file.
    pub line: usize,
    /// Sources in the order of `Source_List`.
    pub sources: Vec<Source>,
}

impl Calibration {
    /// Centre of the calibrated box, m, world.
    #[must_use]
    pub fn center(&self) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.workspace[axis].iter().sum::<f64>() / 2.0)
    }

    /// The eight corners of the calibrated box, m, world.
    pub(super) fn corners(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        (0..8_usize).map(|corner| Vector3::from_fn(|axis, _| self.workspace[axis][corner >> axis & 1]))
    }
}
