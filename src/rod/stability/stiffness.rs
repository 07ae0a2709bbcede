//! The stiffness with which all that lies beyond a cross-section resists its displacement.

use crate::math::Triple;

/// A displacement of a cross-section, or a wrench on it: by position, then by rotation. World.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pose {
    /// dp, or a force.
    pub position: Triple,
    /// phi, or a moment.
    pub rotation: Triple,
}

/// A symmetric 6 x 6 matrix by rows: three forces, three moments.
pub(super) type Stiffness = [Pose; 6];

/// A matrix of three rows.
pub(super) type Square = [[f64; 3]; 3];

impl Pose {
    /// The six components in order.
    #[inline(always)]
    pub(super) fn array(self) -> [f64; 6] {
        let (p, r) = (self.position, self.rotation);
        [p.x, p.y, p.z, r.x, r.y, r.z]
    }

    /// The pose of these six components.
    #[inline(always)]
    pub(super) fn from_array([px, py, pz, rx, ry, rz]: [f64; 6]) -> Self {
        Self { position: Triple::new(px, py, pz), rotation: Triple::new(rx, ry, rz) }
    }

    /// The wrench at the start of a rigid arm, from the wrench at its end.
    #[inline(always)]
    pub(super) fn pulled_back(self, arm: Triple) -> Self {
        Self { position: self.position, rotation: self.rotation + arm.cross(self.position) }
    }

    /// The displacement of the end of a rigid arm, from that of its start.
    #[inline(always)]
    pub(super) fn pushed_on(self, arm: Triple) -> Self {
        Self { position: self.position + self.rotation.cross(arm), rotation: self.rotation }
    }
}

/// The stiffness seen at the start of a rigid arm: `A^T K A`.
#[inline(always)]
pub(super) fn pulled_back(stiffness: &Stiffness, arm: Triple) -> Stiffness {
    let half = stiffness.map(|row| row.pulled_back(arm));
    transposed(&transposed(&half).map(|column| column.pulled_back(arm)))
}

#[inline(always)]
pub(super) fn transposed(matrix: &Stiffness) -> Stiffness {
    let rows = matrix.map(Pose::array);
    core::array::from_fn(|j| Pose::from_array(core::array::from_fn(|i| rows[i][j])))
}

/// `[v]x`.
#[inline(always)]
pub(super) fn skew(v: Triple) -> Square {
    [[0.0, -v.z, v.y], [v.z, 0.0, -v.x], [-v.y, v.x, 0.0]]
}

/// `(a . b) 1 - (a b^T + b a^T) / 2`.
#[inline(always)]
pub(super) fn sway(a: Triple, b: Triple) -> Square {
    let trace = a.dot(b);
    let (a, b) = (a.array(), b.array());
    let mut matrix = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            matrix[i][j] = -0.5 * (a[i] * b[j] + b[i] * a[j]);
        }
        matrix[i][i] += trace;
    }
    matrix
}
