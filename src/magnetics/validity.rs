//! Whether a point lies where the coils' series hold, and if not, at which coil and by how much.
//!
//! A multipole series holds only outside its source: close to the face it turns over and changes sign, with no
//! other warning. Each coil therefore states the least local x (distance along its axis from the expansion
//! point) at which its coefficients may be used.

use std::fmt;

use nalgebra::Vector3;

use super::array::PosedArray;

/// A point lies outside the range of a coil's series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutsideModel {
    /// Index of the coil.
    pub coil: usize,
    /// Local x of the point, m; not a number when the point is not.
    pub local_x: f64,
    /// Least local x at which the coil's series holds, m.
    pub valid_from_x: f64,
}

impl OutsideModel {
    /// How much further along the coil's axis the point would have to be, m.
    #[must_use]
    pub fn shortfall(&self) -> f64 {
        self.valid_from_x - self.local_x
    }
}

impl fmt::Display for OutsideModel {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { coil, local_x, valid_from_x } = self;
        write!(
            formatter,
            "coils[{coil}]: local x = {:.2} mm: must be at least {:.2} mm, {:.2} mm more, for the field model to hold",
            local_x * 1e3,
            valid_from_x * 1e3,
            self.shortfall() * 1e3,
        )
    }
}

impl PosedArray {
    /// Every coil whose series does not hold at `point` (m, world); empty exactly when a sample there is `valid`.
    pub fn outside(&self, point: Vector3<f64>) -> impl Iterator<Item = OutsideModel> + '_ {
        self.valid_from_x().iter().enumerate().filter_map(move |(coil, &valid_from_x)| {
            let pose = self.coil_pose(coil);
            let local_x = pose.axis.dot(&(point - pose.origin));
            let holds = local_x >= valid_from_x;
            (!holds).then_some(OutsideModel { coil, local_x, valid_from_x })
        })
    }
}
