//! Where along their axes the coils' expansion points are.
//!
//! # Method
//! The coefficients are linear, the origins are not. For given origins the coefficients follow (5); the least
//! squares of coefficients and origins together, linearised about them, gives the origins' step (variable
//! projection after Kaufman, BIT 15, 1975), halved until it descends. One coil's search starts in every
//! valley of a row of origins and keeps the deepest end; an array's, which would have too many rows to try,
//! starts at the poses given.
//!
//! To first order, moving the expansion point of a series of order P adds one term of order P + 1. An origin
//! is therefore as hard to find as one more order, and cannot be found where that term is lost in the noise.

use nalgebra::DVector;

use crate::magnetics::multipole::{CoilPose, Multipole};

use super::design::{self, all_moved};
use super::error::FitError;
use super::readings::Reading;
use super::triangle::{Deficient, Triangle};

/// Origins further from the pose than this are not searched, m: the length of a coil.
const ORIGIN_MAX: f64 = 0.05;
/// Distance between the starts of one coil's search, m.
const START_STEP: f64 = 0.002;
/// No reading is let nearer to an expansion point than this, m: the series has a pole there.
const CLEARANCE: f64 = 0.005;
const ITERATIONS_MAX: usize = 40;
const HALVINGS_MAX: usize = 12;
/// Steps shorter than this end the search, m.
const STEP_DONE: f64 = 1e-10;
/// A step that no longer descends may be this long, m, when rounding is to blame.
const STEP_ROUNDING: f64 = 1e-6;

/// Coefficients at given origins, and what they leave.
pub(super) struct Linear {
    /// Coefficients by coil, then by term.
    pub solution: DVector<f64>,
    /// Sum of the squared residuals, T^2.
    pub squares: f64,
}

/// Fits (5) at given poses.
///
/// # Errors
/// Coefficients that the readings do not determine.
pub(super) fn linear(readings: &[&Reading], poses: &[CoilPose], order: usize) -> Result<Linear, FitError> {
    let triangle = Triangle::of(design::rows(readings, poses, order, None));
    let solution = triangle.solve().map_err(|deficient| undetermined(deficient, poses.len(), order))?;
    let squares = triangle.squares(&solution);
    Ok(Linear { solution, squares })
}

/// The error for a column of the design.
pub(super) fn undetermined(Deficient(column): Deficient, coils: usize, order: usize) -> FitError {
    match column.checked_sub(coils * order) {
        Some(coil) => {
            FitError::OriginUndetermined { order, coil, reason: "its column depends on the others" }
        }
        None => FitError::Undetermined { order, coil: column / order, term: column % order + 1 },
    }
}

/// The series of each coil.
pub(super) fn series(solution: &DVector<f64>, coils: usize, order: usize) -> Vec<Multipole> {
    design::split(solution.as_slice(), coils, order).iter().map(|a| Multipole::new(a)).collect()
}

/// The origins that leave the least sum of squares.
///
/// # Errors
/// Origins or coefficients that the readings do not determine.
pub(super) fn settle(readings: &[&Reading], poses: &[CoilPose], order: usize) -> Result<Vec<f64>, FitError> {
    let mut best: Option<(f64, Vec<f64>)> = None;
    let mut refused = None;
    for start in starts(readings, poses, order)? {
        match descend(readings, poses, order, start) {
            Ok((squares, origins)) if best.as_ref().is_none_or(|(least, _)| squares < *least) => {
                best = Some((squares, origins));
            }
            Ok(_) => {}
            Err(error) => refused = refused.or(Some(error)),
        }
    }
    let reason = "every expansion point within 50 mm lies at a reading";
    let nowhere = FitError::OriginUndetermined { order, coil: 0, reason };
    best.map(|(_, origins)| origins).ok_or(refused.unwrap_or(nowhere))
}

/// Follows one valley down; returns the sum of squares at its bottom and the origins there.
fn descend(
    readings: &[&Reading],
    poses: &[CoilPose],
    order: usize,
    start: Vec<f64>,
) -> Result<(f64, Vec<f64>), FitError> {
    let mut origins = start;
    let mut found = linear(readings, &all_moved(poses, &origins), order)?;
    for _ in 0..ITERATIONS_MAX {
        let step = step(readings, poses, order, &origins, &found)?;
        let longest = step.iter().fold(0.0_f64, |most, by| most.max(by.abs()));
        if longest < STEP_DONE {
            return Ok((found.squares, origins));
        }
        let mut scale = (ORIGIN_MAX / 4.0 / longest).min(1.0);
        let mut descended = None;
        for _ in 0..HALVINGS_MAX {
            let tried: Vec<f64> = origins.iter().zip(&step).map(|(at, by)| at + scale * by).collect();
            let moved = all_moved(poses, &tried);
            if is_clear(readings, &moved) {
                let linear = linear(readings, &moved, order)?;
                if linear.squares < found.squares {
                    descended = Some((tried, linear));
                    break;
                }
            }
            scale /= 2.0;
        }
        match descended {
            Some((tried, linear)) => (origins, found) = (tried, linear),
            None if longest < STEP_ROUNDING => return Ok((found.squares, origins)),
            None => return Err(lost(&step, order, "the search found no valley")),
        }
        if let Some(coil) = origins.iter().position(|origin| origin.abs() > ORIGIN_MAX) {
            let reason = "the search left the 50 mm around the pose";
            return Err(FitError::OriginUndetermined { order, coil, reason });
        }
    }
    let step = step(readings, poses, order, &origins, &found)?;
    Err(lost(&step, order, "the search did not end"))
}

/// The coil whose origin moves most is the one to name.
fn lost(step: &[f64], order: usize, reason: &'static str) -> FitError {
    let far = step
        .iter()
        .map(|by| by.abs())
        .enumerate()
        .fold((0, 0.0), |most, (coil, by)| if by > most.1 { (coil, by) } else { most });
    FitError::OriginUndetermined { order, coil: far.0, reason }
}

/// One coil: the lowest of each valley in a row of origins. An array: where the poses are.
fn starts(readings: &[&Reading], poses: &[CoilPose], order: usize) -> Result<Vec<Vec<f64>>, FitError> {
    if poses.len() != 1 {
        return Ok(vec![vec![0.0; poses.len()]]);
    }
    let steps = (ORIGIN_MAX / START_STEP).round() as i32;
    let mut row = Vec::new();
    for index in -steps..=steps {
        let origin = f64::from(index) * START_STEP;
        let moved = all_moved(poses, &[origin]);
        if is_clear(readings, &moved) {
            row.push((linear(readings, &moved, order)?.squares, origin));
        }
    }
    let is_lowest = |index: usize| {
        let (before, after) = (index.checked_sub(1), index + 1);
        let is_below = |other: Option<&(f64, f64)>| other.is_none_or(|(squares, _)| row[index].0 <= *squares);
        is_below(before.and_then(|before| row.get(before))) && is_below(row.get(after))
    };
    Ok((0..row.len()).filter(|index| is_lowest(*index)).map(|index| vec![row[index].1]).collect())
}

fn is_clear(readings: &[&Reading], poses: &[CoilPose]) -> bool {
    let near = |reading: &&Reading, pose: &CoilPose| (reading.position - pose.origin).norm() < CLEARANCE;
    !readings.iter().any(|reading| poses.iter().any(|pose| near(reading, pose)))
}

/// The origins' part of the linearised least squares.
fn step(
    readings: &[&Reading],
    poses: &[CoilPose],
    order: usize,
    origins: &[f64],
    found: &Linear,
) -> Result<Vec<f64>, FitError> {
    let series = series(&found.solution, poses.len(), order);
    let rows = design::rows(readings, &all_moved(poses, origins), order, Some(&series));
    let solution =
        Triangle::of(rows).solve().map_err(|deficient| undetermined(deficient, poses.len(), order))?;
    Ok(solution.rows(poses.len() * order, poses.len()).iter().copied().collect())
}
