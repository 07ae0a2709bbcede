//! Rotation matrices, by rows, from angles and directions.

use crate::description::Rows3;

/// Right-handed about y by `angle`, rad.
pub(super) fn rotation_about_y(angle: f64) -> Rows3 {
    let (sine, cosine) = angle.sin_cos();
    [[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]
}

/// Right-handed about z by `angle`, rad.
pub(super) fn rotation_about_z(angle: f64) -> Rows3 {
    let (sine, cosine) = angle.sin_cos();
    [[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]]
}

/// The rotation `rotz(azimuth) roty(elevation)` that takes x to the unit vector `axis`; azimuth zero for a
/// vertical one.
pub(super) fn rotation_from_x(axis: [f64; 3]) -> Rows3 {
    let [x, y, z] = axis;
    let across = x.hypot(y);
    let (cosine, sine) = if across > 0.0 { (x / across, y / across) } else { (1.0, 0.0) };
    [[x, -sine, -z * cosine], [y, cosine, -z * sine], [z, 0.0, across]]
}

/// Rodrigues' formula for the rotation about `z x t` that takes z to `t`; half a turn about x for `t = -z`.
pub(super) fn shortest_rotation_from_z(t: [f64; 3]) -> Rows3 {
    let [x, y, z] = t;
    if z <= -1.0 + 1e-12 {
        return [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
    }
    let scale = 1.0 / (1.0 + z);
    [[1.0 - x * x * scale, -x * y * scale, x], [-x * y * scale, 1.0 - y * y * scale, y], [-x, -y, z]]
}

/// `left` after `right`.
pub(super) fn product(left: Rows3, right: Rows3) -> Rows3 {
    let entry = |row: usize, column: usize| (0..3).map(|k| left[row][k] * right[k][column]).sum();
    [0, 1, 2].map(|row| [0, 1, 2].map(|column| entry(row, column)))
}
