//! The rows of eq. (5), for any number of coils.
//!
//! # Terms
//! | symbol | meaning |
//! |---|---|
//! | `p_i`, `I_ij`, `b_i` | place, current in coil j, and field of reading i |
//! | `a_jk` | coefficient k of coil j, per ampere |
//! | `psi_k` | the series' terms of eq. (4), in the frame of the coil |
//! | `x_j`, `e_j`, `G_j` | origin of coil j along its axis; the axis; gradient of its field for 1 A |
//!
//! # Method
//! `sum_jk I_ij grad psi_k(p_i - x_j e_j) a_jk = b_i`: with the currents inside, the coefficients come out
//! per ampere, as eq. (6) wants them, and readings at several currents carry weight by their current. Moving
//! the expansion point by `dx_j` changes the field by `-I_ij G_j e_j dx_j`; these columns stand past the
//! coefficients where origins are fitted.

use magsteer_hal::config::ORDER_MAX;
use nalgebra::{DMatrix, Vector3};

use crate::magnetics::multipole::{CoilPose, Multipole};

use super::readings::Reading;

/// The pose with its expansion point moved along the axis.
pub(super) fn moved(pose: &CoilPose, origin: f64) -> CoilPose {
    CoilPose { origin: pose.origin + pose.axis * origin, axis: pose.axis }
}

/// Poses with every expansion point moved along its axis.
pub(super) fn all_moved(poses: &[CoilPose], origins: &[f64]) -> Vec<CoilPose> {
    poses.iter().zip(origins).map(|(pose, origin)| moved(pose, *origin)).collect()
}

/// `[A b]`: three rows a reading; columns by coil, then by term; then, given the series found so far, one
/// column a coil for its origin; the measured field last.
pub(super) fn rows(
    readings: &[&Reading],
    poses: &[CoilPose],
    order: usize,
    origins_of: Option<&[Multipole]>,
) -> DMatrix<f64> {
    let terms: Vec<Multipole> = (0..order).map(unit_term).collect();
    let columns = poses.len() * order + origins_of.map_or(0, <[_]>::len) + 1;
    let mut rows = DMatrix::zeros(3 * readings.len(), columns);
    for (index, reading) in readings.iter().enumerate() {
        let mut put = |column: usize, vector: &Vector3<f64>| {
            rows.fixed_view_mut::<3, 1>(3 * index, column).copy_from(vector);
        };
        for (coil, (pose, current)) in poses.iter().zip(&reading.currents).enumerate() {
            for (k, term) in terms.iter().enumerate() {
                let field = term.evaluate(pose, &reading.position).column.field;
                put(coil * order + k, &(field * *current)); // (5)
            }
            if let Some(series) = origins_of {
                let gradient = series[coil].evaluate(pose, &reading.position).column.gradient.matrix();
                put(poses.len() * order + coil, &(gradient * pose.axis * -*current));
            }
        }
        put(columns - 1, &reading.field);
    }
    rows
}

/// The series whose only coefficient is that of term `index` (0 first), and is 1.
fn unit_term(index: usize) -> Multipole {
    let mut coefficients = [0.0; ORDER_MAX];
    coefficients[index] = 1.0;
    Multipole::new(&coefficients[..=index])
}

/// Coefficients of each coil, from the head of a solution.
pub(super) fn split(solution: &[f64], coils: usize, order: usize) -> Vec<Vec<f64>> {
    solution.chunks_exact(order).take(coils).map(<[f64]>::to_vec).collect()
}
