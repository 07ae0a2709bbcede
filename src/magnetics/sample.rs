//! The field at a point and how it changes: with the point, and with each actuation parameter.

use std::ops::{AddAssign, Mul};

use magsteer_hal::{COILS_MAX, POSE_PARAMETERS_MAX};
use nalgebra::{Matrix3, Vector3};

/// Most actuation parameters (currents and angles together).
pub const PARAMETERS_MAX: usize = COILS_MAX + POSE_PARAMETERS_MAX;

/// The five independent components of a divergence- and curl-free field's gradient,
/// `xy` = dBx/dy = dBy/dx, T/m; the order of eq. (12) and of G(.) in eq. (9). `dBz/dz = -(xx + yy)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FieldGradient {
    /// dBx/dx
    pub xx: f64,
    /// dBx/dy
    pub xy: f64,
    /// dBx/dz
    pub xz: f64,
    /// dBy/dy
    pub yy: f64,
    /// dBy/dz
    pub yz: f64,
}

/// The seven independent second derivatives of such a field, `xxy` = d2Bx/dxdy, T/m^2.
/// The rest follows from symmetry in all indices and from zero traces:
/// `xzz = -(xxx + xyy)`, `yzz = -(xxy + yyy)`, `zzz = -(xxz + yyz)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FieldSecondGradient {
    /// d2Bx/dx2
    pub xxx: f64,
    /// d2Bx/dxdy
    pub xxy: f64,
    /// d2Bx/dxdz
    pub xxz: f64,
    /// d2Bx/dy2
    pub xyy: f64,
    /// d2Bx/dydz
    pub xyz: f64,
    /// d2By/dy2
    pub yyy: f64,
    /// d2By/dydz
    pub yyz: f64,
}

impl FieldGradient {
    /// The symmetric, traceless matrix dB_i/dx_j.
    #[must_use]
    pub fn matrix(&self) -> Matrix3<f64> {
        let Self { xx, xy, xz, yy, yz } = *self;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy)
    }

    /// Force on a dipole, `grad(mu . B) = G mu`, N; the map M(mu) of eq. (12) applied to the gradient.
    #[must_use]
    pub fn force(&self, moment: &Vector3<f64>) -> Vector3<f64> {
        self.matrix() * moment
    }
}

impl FieldSecondGradient {
    /// Derivative of the force `G mu` with the point, `d(G mu)_i/dx_j`, a symmetric traceless matrix, N/m.
    #[must_use]
    pub fn contract(&self, moment: &Vector3<f64>) -> FieldGradient {
        let Self { xxx, xxy, xxz, xyy, xyz, yyy, yyz } = *self;
        let (x, y, z) = (moment.x, moment.y, moment.z);
        FieldGradient {
            xx: xxx * x + xxy * y + xxz * z,
            xy: xxy * x + xyy * y + xyz * z,
            xz: xxz * x + xyz * y - (xxx + xyy) * z,
            yy: xyy * x + yyy * y + yyz * z,
            yz: xyz * x + yyz * y - (xxy + yyy) * z,
        }
    }
}

impl AddAssign for FieldGradient {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.xx += other.xx;
        self.xy += other.xy;
        self.xz += other.xz;
        self.yy += other.yy;
        self.yz += other.yz;
    }
}

impl Mul<f64> for FieldGradient {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        let Self { xx, xy, xz, yy, yz } = self;
        Self { xx: xx * factor, xy: xy * factor, xz: xz * factor, yy: yy * factor, yz: yz * factor }
    }
}

impl AddAssign for FieldSecondGradient {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.xxx += other.xxx;
        self.xxy += other.xxy;
        self.xxz += other.xxz;
        self.xyy += other.xyy;
        self.xyz += other.xyz;
        self.yyy += other.yyy;
        self.yyz += other.yyz;
    }
}

impl Mul<f64> for FieldSecondGradient {
    type Output = Self;

    #[inline]
    fn mul(self, factor: f64) -> Self {
        Self {
            xxx: self.xxx * factor,
            xxy: self.xxy * factor,
            xxz: self.xxz * factor,
            xyy: self.xyy * factor,
            xyz: self.xyz * factor,
            yyy: self.yyy * factor,
            yyz: self.yyz * factor,
        }
    }
}

/// Field and gradient that change with one actuation parameter, per ampere or per radian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldColumn {
    /// dB/du, T/A or T/rad.
    pub field: Vector3<f64>,
    /// dG/du, T/(m A) or T/(m rad).
    pub gradient: FieldGradient,
}

impl Default for FieldColumn {
    fn default() -> Self {
        Self { field: Vector3::zeros(), gradient: FieldGradient::default() }
    }
}

/// The field at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldSample {
    /// B, T, world.
    pub field: Vector3<f64>,
    /// Gradient of B.
    pub gradient: FieldGradient,
    /// Second gradient of B.
    pub second_gradient: FieldSecondGradient,
    /// Change with each parameter: coil currents first, then frame angles. Entries past the
    /// field's parameter count are not written.
    pub columns: [FieldColumn; PARAMETERS_MAX],
    /// False when the point lies outside the model's range of some coil.
    pub valid: bool,
}

impl Default for FieldSample {
    fn default() -> Self {
        Self {
            field: Vector3::zeros(),
            gradient: FieldGradient::default(),
            second_gradient: FieldSecondGradient::default(),
            columns: [FieldColumn::default(); PARAMETERS_MAX],
            valid: true,
        }
    }
}

/// A field that depends on a set of actuation parameters, at their present values.
pub trait AppliedField {
    /// Number of actuation parameters, at most [`PARAMETERS_MAX`].
    fn parameter_count(&self) -> usize;

    /// Evaluates the field, its two gradients and its change with every parameter at `point` (m, world).
    fn evaluate(&self, point: &Vector3<f64>, sample: &mut FieldSample);
}
