//! How near to its coil a series may be used.
//!
//! **Problem.** A multipole series converges only outside its source. Cut off at order P, fitted in front of
//! the coil and used nearer to it, it turns over and changes sign without a warning. Where it may be used is
//! part of what it is.
//!
//! **Method.** From the middle of the measured depth towards the coil, the range ends at the first of
//! 1. the place where the field on the axis stops growing towards the coil: there the series has turned over;
//! 2. the place where one of the next three orders, fitted to the same readings, differs by more than a share
//!    of the field on the axis, at any distance from the axis up to that of the readings; where there is no
//!    next order, the previous one;
//! 3. one coil alone: the far end of the nearest slab of readings in which the fit leaves more than that
//!    share, beyond noise.
//!
//! Where none of these is met, it ends at half the nearest reading: nothing was measured there that could
//! bear more. (1) and (2) are judged on the series alone, so they also hold between the nearest reading and
//! the coil.

use nalgebra::Vector3;

use crate::magnetics::multipole::{CoilPose, Multipole};

use super::design::moved;
use super::readings::Reading;

/// Distance between the places looked at, m; also what the result is rounded to.
const STEP: f64 = 1e-4;
/// Places from the axis to the reading furthest from it.
const RADII: usize = 6;
/// Slabs into which the measured depth is cut.
const SLABS: usize = 10;

/// How near to the expansion point a series may be used, m along the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValidRange {
    /// Least local x, measured from the expansion point, that can be trusted to the share asked for.
    pub from_x: f64,
    /// Where the field on the axis stops growing towards the coil.
    pub turns_over_x: Option<f64>,
    /// Below this another order differs by more than the share.
    pub orders_differ_x: Option<f64>,
    /// Below this the fit leaves more than the share of the readings, beyond noise.
    pub misfit_x: Option<f64>,
    /// Local x of the nearest reading with a current in the coil.
    pub nearest_reading_x: f64,
}

/// A coil's series with what it can be held against.
pub(super) struct Comparison<'a> {
    /// Every reading.
    pub readings: &'a [&'a Reading],
    /// Pose that origins are counted from.
    pub pose: CoilPose,
    /// Index of the coil.
    pub coil: usize,
    /// Whether the readings are of this coil alone.
    pub alone: bool,
    /// The series and its origin.
    pub series: (Multipole, f64),
    /// Those of other orders.
    pub others: Vec<(Multipole, f64)>,
    /// Standard deviation of one component's noise, T.
    pub noise: f64,
    /// Greatest relative error to be admitted.
    pub share: f64,
}

/// The range of a coil's series.
pub(super) fn estimate(comparison: &Comparison<'_>) -> ValidRange {
    let pose = moved(&comparison.pose, comparison.series.1);
    let driven = || comparison.readings.iter().filter(|reading| reading.currents[comparison.coil] != 0.0);
    let local = |reading: &&&Reading| pose.axis.dot(&(reading.position - pose.origin));
    let mut depths: Vec<f64> = driven().map(|reading| local(&reading)).collect();
    depths.sort_by(f64::total_cmp);
    let nearest = depths.first().copied().unwrap_or(0.0);
    let middle = depths.get(depths.len() / 2).copied().unwrap_or(0.0).max(STEP);
    let radius = driven()
        .map(|reading| ((reading.position - pose.origin) - pose.axis * local(&reading)).norm())
        .fold(0.0, f64::max);
    let last = (nearest / 2.0).max(STEP);
    let steps = ((middle - last) / STEP).max(0.0) as usize;
    let first_from =
        |fails: &dyn Fn(f64) -> bool| (0..=steps).map(|step| middle - step as f64 * STEP).find(|x| fails(*x));
    let turns_over_x = first_from(&|x| has_turned_over(&comparison.series.0, x));
    let differs = |x: f64| {
        let differs = |other| difference(&comparison.series, other, x, radius) > comparison.share;
        comparison.others.iter().any(differs)
    };
    let orders_differ_x = first_from(&differs);
    let misfit_x = if comparison.alone { misfit(comparison, &pose) } else { None };
    let end = [turns_over_x, orders_differ_x, misfit_x].into_iter().flatten().fold(last, f64::max);
    let from_x = (end / STEP).ceil() * STEP;
    ValidRange { from_x, turns_over_x, orders_differ_x, misfit_x, nearest_reading_x: nearest }
}

/// The coil at the origin of its own frame.
fn at_home(origin: f64) -> CoilPose {
    CoilPose { origin: Vector3::new(origin, 0.0, 0.0), axis: Vector3::x() }
}

fn has_turned_over(series: &Multipole, x: f64) -> bool {
    let found = series.evaluate(&at_home(0.0), &Vector3::new(x, 0.0, 0.0)).column;
    let grows_towards_the_coil = found.field.x * found.gradient.xx < 0.0;
    !grows_towards_the_coil
}

/// Largest difference of two series on a disc across the axis, relative to the field on the axis.
/// `x` is counted from the first one's expansion point.
fn difference(series: &(Multipole, f64), other: &(Multipole, f64), x: f64, radius: f64) -> f64 {
    let (home, away) = (at_home(0.0), at_home(other.1 - series.1));
    let field = |point: &Vector3<f64>| series.0.evaluate(&home, point).column.field;
    let at = |index: usize| Vector3::new(x, radius * index as f64 / (RADII - 1) as f64, 0.0);
    let gap = |point: Vector3<f64>| (field(&point) - other.0.evaluate(&away, &point).column.field).norm();
    (0..RADII).map(at).map(gap).fold(0.0, f64::max) / field(&at(0)).norm()
}

/// Far end of the furthest slab whose readings the series misses by more than the share of their field,
/// beyond noise.
fn misfit(comparison: &Comparison<'_>, pose: &CoilPose) -> Option<f64> {
    let local = |reading: &Reading| pose.axis.dot(&(reading.position - pose.origin));
    let mut readings: Vec<&Reading> = comparison.readings.to_vec();
    readings.sort_by(|a, b| local(a).total_cmp(&local(b)));
    let least = readings.len().div_ceil(SLABS);
    let mut slabs: Vec<Vec<&Reading>> = vec![Vec::new()];
    for reading in readings {
        let slab = slabs.last().map_or(&[][..], Vec::as_slice);
        // Readings of one grid plane stay together.
        let is_full =
            slab.len() >= least && slab.last().is_some_and(|last| local(reading) > local(last) + STEP);
        if is_full {
            slabs.push(Vec::new());
        }
        slabs.last_mut().into_iter().for_each(|slab| slab.push(reading));
    }
    let misses = |slab: &Vec<&Reading>| {
        let (mut left, mut field) = (0.0, 0.0);
        for reading in slab {
            let modelled = comparison.series.0.evaluate(pose, &reading.position).column.field;
            left += (reading.field - modelled * reading.currents[comparison.coil]).norm_squared();
            field += reading.field.norm_squared();
        }
        let beyond_noise = left - 3.0 * slab.len() as f64 * comparison.noise.powi(2);
        beyond_noise > comparison.share.powi(2) * field
    };
    let middle = slabs.len().div_ceil(2);
    let far_end = |slab: &Vec<&Reading>| slab.last().map(|reading| local(reading));
    slabs[..middle].iter().rev().find(|slab| misses(slab)).and_then(far_end)
}
