//! Rows of the orientation Jacobian (16), two a magnet: exact, or by the paper's Algorithm 1.

use nalgebra::Vector3;

use super::algorithm_1::Algorithm1;
use super::error::OrientationError;
use super::model::Model;

/// Rows of the exact orientation Jacobian of one magnet.
pub(super) fn exact_rows(
    model: &Model,
    error: &OrientationError,
    magnet: usize,
    desired: &Vector3<f64>,
    rows: &mut [f64],
) {
    let map = error.map(&model.tangent(magnet), desired);
    let tangent_rows = model.tangent_jacobian(magnet);
    for (row, entries) in rows.chunks_exact_mut(tangent_rows[0].len().max(1)).enumerate() {
        for (column, entry) in entries.iter_mut().enumerate() {
            *entry = (0..3).map(|axis| map[(row, axis)] * tangent_rows[axis][column]).sum();
        }
    }
}

/// Rows of Algorithm 1's orientation Jacobian of one magnet.
pub(super) fn differenced_rows(
    algorithm_1: &Algorithm1,
    error: &OrientationError,
    magnet: usize,
    desired: &Vector3<f64>,
    rows: &mut [f64],
) {
    let parameters = algorithm_1.parameter_count();
    let present = algorithm_1.tangent(magnet);
    for parameter in 0..parameters {
        let stepped = algorithm_1.stepped_tangent(magnet, parameter);
        let change = error.change(&present, &stepped, desired) / algorithm_1.step(parameter); // (15)
        for (row, entry) in rows.iter_mut().skip(parameter).step_by(parameters).enumerate() {
            *entry = change[row]; // (16)
        }
    }
}
