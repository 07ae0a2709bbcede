//! A uniform field with a uniform gradient, `B(p) = B0 + G p`: stands in for an array when a rod is checked alone.

use nalgebra::Vector3;

use super::sample::{AppliedField, FieldColumn, FieldGradient, FieldSample, FieldSecondGradient};

/// `B(p) = B0 + G p` with `p` from the world's origin. Its parameters are the eight numbers
/// B0x, B0y, B0z, Gxx, Gxy, Gxz, Gyy, Gyz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AffineField {
    /// Field at the origin, T.
    pub field: Vector3<f64>,
    /// Gradient, T/m.
    pub gradient: FieldGradient,
}

impl AppliedField for AffineField {
    fn parameter_count(&self) -> usize {
        8
    }

    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample) {
        sample.field = self.field + self.gradient.matrix() * point;
        sample.gradient = self.gradient;
        sample.second_gradient = FieldSecondGradient::default();
        sample.valid = true;
        let none = FieldGradient::default();
        let gradients = [
            FieldGradient { xx: 1.0, ..none },
            FieldGradient { xy: 1.0, ..none },
            FieldGradient { xz: 1.0, ..none },
            FieldGradient { yy: 1.0, ..none },
            FieldGradient { yz: 1.0, ..none },
        ];
        for axis in 0..3 {
            let field = Vector3::ith(axis, 1.0);
            sample.columns[axis] = FieldColumn { field, gradient: none };
        }
        for (column, gradient) in sample.columns[3..8].iter_mut().zip(gradients) {
            *column = FieldColumn { field: gradient.matrix() * point, gradient };
        }
    }
}
