//! A field that is the same all round an axis: four numbers in the half plane, then vectors in space.
//!
//! | symbol | meaning |
//! |---|---|
//! | `x`, `d`, `u` | place along the axis `e`, vector from the axis to the point, `u = d . d` |
//! | `b` | component of `B` along the axis |
//! | `q` | radial component over the distance from the axis: smooth and finite on the axis |
//! | `s`, `t` | `dq/dx` and `2 dq/du` |
//!
//! Without sources nearby, `div B = 0` gives `db/dx = -(2 q + u t)`, and `curl B = 0` gives `db/du = s / 2`,
//! so that
//!
//! `B = b e + q d`                                                                        (F9)
//!
//! `G = q (1 - e e^T) + s (e d^T + d e^T) + t d d^T - (2 q + u t) e e^T`
//!
//! is symmetric and traceless whatever the four numbers are.

use nalgebra::{Matrix3, Vector3};

/// Field at a place of the half plane, of the stated current.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Axial {
    /// `b`, T.
    pub along: f64,
    /// `q`, T/m.
    pub radial: f64,
    /// `s`, T/m^2.
    pub slope: f64,
    /// `t`, T/m^3.
    pub bend: f64,
}

/// Sum of axisymmetric fields of several axes, at one point in space.
#[derive(Debug, Clone, Copy)]
pub struct Superposition {
    flux: Vector3<f64>,
    /// Upper triangle of the gradient by rows: xx, xy, xz, yy, yz, zz.
    gradient: [f64; 6],
}

impl Axial {
    /// With `db/dx` (T/m) in place of `t`, which follows from it; on the axis itself `t` plays no part and is
    /// zero.
    #[must_use]
    pub fn from_slopes(along: f64, radial: f64, along_slope: f64, slope: f64, u: f64) -> Self {
        let bend = if u > 0.0 { -(along_slope + 2.0 * radial) / u } else { 0.0 };
        Self { along, radial, slope, bend }
    }

    /// `db/dx`, T/m, at the squared distance `u` (m^2) from the axis.
    #[must_use]
    pub fn along_slope(&self, u: f64) -> f64 {
        -(2.0 * self.radial + u * self.bend)
    }
}

impl Superposition {
    /// No field.
    #[must_use]
    pub fn zero() -> Self {
        Self { flux: Vector3::zeros(), gradient: [0.0; 6] }
    }

    /// Adds `factor` times a field about the unit vector `axis`, at `offset` (`d`, m) from it.
    pub fn add(&mut self, field: &Axial, factor: f64, axis: &Vector3<f64>, offset: &Vector3<f64>) {
        let (q, s, t) = (factor * field.radial, factor * field.slope, factor * field.bend);
        self.flux += axis * (factor * field.along) + offset * q; // (F9)
        // G = q 1 + e f^T + d h^T with f = s d - (3 q + u t) e, h = s e + t d
        let f = offset * s - axis * (3.0 * q + offset.norm_squared() * t);
        let h = axis * s + offset * t;
        let [xx, xy, xz, yy, yz, zz] = &mut self.gradient;
        *xx += q + axis.x * f.x + offset.x * h.x;
        *xy += axis.x * f.y + offset.x * h.y;
        *xz += axis.x * f.z + offset.x * h.z;
        *yy += q + axis.y * f.y + offset.y * h.y;
        *yz += axis.y * f.z + offset.y * h.z;
        *zz += q + axis.z * f.z + offset.z * h.z;
    }

    /// `B`, T.
    #[must_use]
    pub fn flux(&self) -> Vector3<f64> {
        self.flux
    }

    /// `dB_i/dx_j`, T/m.
    #[must_use]
    pub fn gradient(&self) -> Matrix3<f64> {
        let [xx, xy, xz, yy, yz, zz] = self.gradient;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }
}
