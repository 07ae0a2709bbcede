//! Wrench on magnetic dipoles, and the actuation matrix that maps currents to wrenches.
//!
//! # Terms
//! | symbol | meaning |
//! |---|---|
//! | `mu`, `p` | dipole moment, A m^2, and position, m, of a magnet, world |
//! | `w = (tau, f)` | wrench at the magnet's centre: torque, N m, and force, N, world |
//! | `beta`, `G(beta_grad)` | field for 1 A and its five independent gradient components, [`FieldColumn`] |
//! | `T_beta`, `T_mu`, `T` | current-to-field, field-to-wrench and current-to-wrench maps |
//! | `N_I`, `N_theta`, `M` | number of currents, frame angles, magnets |
//!
//! The source is section III-B, eq. (8)-(13), of the paper named in [`super::multipole`]. `G(.)` and
//! `M(.)` both order the gradient as xx, xy, xz, yy, yz, which the paper leaves unsaid; [`FieldGradient`] names them.

use nalgebra::{DMatrix, DMatrixView, Matrix3x5, SMatrix, SVector, Vector3};

use super::array::ActuatedArray;
use super::sample::{AppliedField, FieldColumn, FieldGradient, FieldSample};

/// A magnet as the field sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dipole {
    /// Centre, m, world.
    pub position: Vector3<f64>,
    /// Moment, A m^2, world.
    pub moment: Vector3<f64>,
}

/// Torque and force on a magnet, about and at its centre, world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wrench {
    /// N m
    pub torque: Vector3<f64>,
    /// N
    pub force: Vector3<f64>,
}

impl Wrench {
    /// Wrench of a field on a dipole, `mu x B` and `grad (mu . B)`.
    #[inline]
    #[must_use]
    pub fn on_dipole(moment: &Vector3<f64>, field: &Vector3<f64>, gradient: &FieldGradient) -> Self {
        Self { torque: moment.cross(field), force: gradient.force(moment) } // (10)
    }

    /// The wrench as the paper stacks it: torque above force.
    #[must_use]
    pub fn stacked(&self) -> SVector<f64, 6> {
        let Self { torque: t, force: f } = self;
        SVector::from([t.x, t.y, t.z, f.x, f.y, f.z])
    }
}

/// A column of the current-to-field map: field above the five independent gradient components. (9)
#[must_use]
pub fn stacked_field(column: &FieldColumn) -> SVector<f64, 8> {
    let FieldColumn { field, gradient: FieldGradient { xx, xy, xz, yy, yz } } = *column;
    SVector::from([field.x, field.y, field.z, xx, xy, xz, yy, yz])
}

/// The map from the five independent gradient components to the force on a dipole, eq. (12).
#[must_use]
pub fn gradient_to_force(moment: &Vector3<f64>) -> Matrix3x5<f64> {
    let (x, y, z) = (moment.x, moment.y, moment.z);
    #[rustfmt::skip]
    let map = Matrix3x5::new( // (12)
          x,   y,   z, 0.0, 0.0,
        0.0,   x, 0.0,   y,   z,
         -z, 0.0,   x,  -z,   y,
    );
    map
}

/// The field-to-wrench map `T_mu` of a dipole, eq. (11), on [`stacked_field`].
#[must_use]
pub fn field_to_wrench(moment: &Vector3<f64>) -> SMatrix<f64, 6, 8> {
    let mut map = SMatrix::<f64, 6, 8>::zeros();
    map.fixed_view_mut::<3, 3>(0, 0).copy_from(&moment.cross_matrix()); // (11)
    map.fixed_view_mut::<3, 5>(3, 3).copy_from(&gradient_to_force(moment));
    map
}

/// The change of all magnets' wrenches with every actuation parameter, magnets held where they are.
///
/// Six rows a magnet, torque above force; the columns of the currents are the actuation matrix `T` of
/// eq. (13), so that `T I` is the wrench itself; the columns of the frame angles are its derivative at
/// the present currents, in place of the recomputation with an incremented angle in Algorithm 1.
#[derive(Debug, Clone)]
pub struct ActuationMatrix {
    /// 6M x (N_I + N_theta).
    columns: DMatrix<f64>,
    coil_count: usize,
    sample: Box<FieldSample>,
}

impl ActuationMatrix {
    /// Allocates for `magnet_count` magnets under arrays of the size of `field`; zero until updated.
    #[must_use]
    pub fn new(magnet_count: usize, field: &ActuatedArray<'_>) -> Self {
        Self {
            columns: DMatrix::zeros(6 * magnet_count, field.parameter_count()),
            coil_count: field.coil_count(),
            sample: Box::default(),
        }
    }

    /// Evaluates at the magnets' present poses; false when one of them lies outside the field model's range.
    /// Allocates nothing.
    ///
    /// # Panics
    /// When the number of magnets, coils or frames differs from that given to [`Self::new`].
    pub fn update(&mut self, field: &ActuatedArray<'_>, magnets: &[Dipole]) -> bool {
        assert_eq!(6 * magnets.len(), self.columns.nrows(), "rows of the actuation matrix");
        assert_eq!(field.parameter_count(), self.columns.ncols(), "columns of the actuation matrix");
        assert_eq!(field.coil_count(), self.coil_count, "coils of the actuation matrix");
        let mut valid = true;
        for (index, magnet) in magnets.iter().enumerate() {
            field.evaluate(&magnet.position, &mut self.sample);
            valid &= self.sample.valid;
            let mut rows = self.columns.rows_mut(6 * index, 6);
            for (mut entry, column) in rows.column_iter_mut().zip(&self.sample.columns) {
                // (13), by (10) on each column: the product of (11) and (9) without its zeros.
                let wrench = Wrench::on_dipole(&magnet.moment, &column.field, &column.gradient);
                entry.copy_from(&wrench.stacked());
            }
        }
        valid
    }

    /// The actuation matrix `T` of eq. (13), 6M x N_I, N m/A and N/A.
    #[must_use]
    pub fn currents(&self) -> DMatrixView<'_, f64> {
        self.columns.columns(0, self.coil_count)
    }

    /// Derivative of the wrenches with the frame angles, 6M x N_theta, N m/rad and N/rad.
    #[must_use]
    pub fn angles(&self) -> DMatrixView<'_, f64> {
        self.columns.columns(self.coil_count, self.columns.ncols() - self.coil_count)
    }
}
