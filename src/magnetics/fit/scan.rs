//! Every order, how well each foretells readings that it has not seen, and the choice of one.
//!
//! # Method
//! - The readings are brought into one order by their values, so that neither the fit nor the folds depend on
//!   the file's.
//! - *Folds*: reading i belongs to fold i mod 10; each fold is foretold from the other nine. Neighbours of a
//!   left-out reading stay in, so that folds tell noise from signal, not how far the series carries.
//! - *Regions*: the readings nearest to the coil, those furthest, those off the plane of the rest, or those
//!   of an array's outer shell, are foretold from all others. They tell how far the series carries; they are
//!   reported and do not choose.
//! - *Choice*: the lowest order whose mean squares exceed those of the best, fold by fold, by no more than
//!   two standard errors of their ratio's mean logarithm. Noise that is in both does not count; ratios, since
//!   a series that is too short goes wrong in few places, by much; two errors, since the best of ten is the
//!   best by luck in part. Higher orders fit noise, and it is high orders that go wrong first outside the
//!   measured volume. What is below a millionth of the field is rounding.
//! - Where origins are fitted, they are settled for each order by all readings, and left free to first order
//!   in each fold.

use magsteer_hal::config::ORDER_MAX;
use nalgebra::{DMatrix, Vector3};

use crate::magnetics::multipole::{CoilPose, Multipole};

use super::design::{self, all_moved};
use super::error::FitError;
use super::found::{CoilFit, FieldFit, FitRequest, OrderChoice, OrderReport, RegionReport};
use super::origin;
use super::range::{self, Comparison};
use super::readings::Reading;
use super::regions::regions;
use super::triangle::Triangle;

/// Parts that are left out in turn.
const FOLDS: usize = 10;
/// Mean squares below this, relative to that of the field, are rounding.
const SQUARE_ROUNDING: f64 = 1e-12;
/// Orders past the chosen one that the range of validity is judged by: one alone may err alike.
const NEXT_ORDERS: usize = 3;
/// Standard errors by which an order may be worse than the best and still count as good.
const ERRORS_MAX: f64 = 2.0;
/// An origin with a larger standard deviation is not known, m.
const ORIGIN_DEVIATION_MAX: f64 = 0.01;

/// One order, fitted, with what the choice needs.
struct Candidate {
    report: OrderReport,
    deviations: Vec<Vec<f64>>,
    covariance: Vec<DMatrix<f64>>,
    origin_deviations: Option<Vec<f64>>,
    noise: f64,
    /// Mean square of each left-out fold, T^2.
    fold_squares: Vec<f64>,
}

/// Readings in an order of their own, and how they are parted.
struct Arrangement<'a> {
    readings: Vec<&'a Reading>,
    poses: &'a [CoilPose],
    fit_origin: bool,
    regions: Vec<(&'static str, Vec<bool>)>,
}

/// Fits every coil's series to readings of the field of all.
///
/// `poses` has one coil for each current of a reading.
///
/// # Errors
/// What the readings do not determine.
///
/// # Panics
/// When a reading has not as many currents as there are poses, or an order of 0 or above [`ORDER_MAX`] is
/// asked for.
pub fn fit(poses: &[CoilPose], readings: &[Reading], request: &FitRequest) -> Result<FieldFit, FitError> {
    assert!(readings.iter().all(|reading| reading.currents.len() == poses.len()), "one pose a current");
    if let OrderChoice::Exactly(order) = request.order {
        assert!((1..=ORDER_MAX).contains(&order), "order {order}: must be 1 to {ORDER_MAX}");
    }
    for coil in 0..poses.len() {
        if readings.iter().all(|reading| reading.currents[coil] == 0.0) {
            return Err(FitError::Undriven { coil });
        }
    }
    let arrangement = Arrangement::new(poses, readings, request.fit_origin);
    let mut candidates = Vec::new();
    let mut undetermined = Vec::new();
    for order in 1..=ORDER_MAX {
        match arrangement.candidate(order) {
            Ok(candidate) => candidates.push(candidate),
            // Nothing else is asked for: the other orders need not be tried.
            Err(error) if request.order == OrderChoice::Exactly(order) => return Err(error),
            Err(error) => undetermined.push((order, error)),
        }
    }
    let why_not = |order: usize| {
        let found = undetermined.iter().find(|(other, _)| *other == order);
        found.map(|(_, error)| error.clone())
    };
    let chosen = match request.order {
        OrderChoice::Auto => {
            let comparable = candidates.iter().filter(|candidate| !candidate.fold_squares.is_empty()).count();
            // One order alone cannot be compared with any.
            if comparable < 2 {
                let readings = readings.len();
                let few = FitError::too_few(2, readings, arrangement.unknowns(2), FOLDS);
                return Err(why_not(1).or_else(|| why_not(2)).unwrap_or(few));
            }
            arrangement.lowest_as_good_as_best(&candidates)
        }
        OrderChoice::Exactly(order) => {
            let found = candidates.iter().position(|candidate| candidate.report.order == order);
            found.expect("an order that cannot be fitted was refused above")
        }
    };
    Ok(arrangement.report(&candidates, chosen, undetermined, request.share))
}

impl FitError {
    fn too_few(order: usize, readings: usize, unknowns: usize, least: usize) -> Self {
        let least = least.max(unknowns / 3 + 1);
        Self::TooFew { order, readings, equations: 3 * readings, unknowns, least }
    }
}

impl<'a> Arrangement<'a> {
    fn new(poses: &'a [CoilPose], readings: &'a [Reading], fit_origin: bool) -> Self {
        let mut sorted: Vec<&Reading> = readings.iter().collect();
        let numbers = |reading: &'a Reading| {
            reading.position.iter().chain(&reading.currents).chain(reading.field.iter())
        };
        sorted.sort_by(|a, b| {
            let pairs = numbers(a).zip(numbers(b)).map(|(a, b)| a.total_cmp(b));
            pairs.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        });
        let regions = regions(poses, &sorted);
        Self { readings: sorted, poses, fit_origin, regions }
    }

    fn unknowns(&self, order: usize) -> usize {
        self.poses.len() * (order + usize::from(self.fit_origin))
    }

    /// Fits one order, all readings and without each part.
    fn candidate(&self, order: usize) -> Result<Candidate, FitError> {
        let (coils, count) = (self.poses.len(), self.readings.len());
        let unknowns = self.unknowns(order);
        if 3 * count <= unknowns {
            return Err(FitError::too_few(order, count, unknowns, 0));
        }
        let (origins, series) = if self.fit_origin {
            let origins = origin::settle(&self.readings, self.poses, order)?;
            let linear = origin::linear(&self.readings, &all_moved(self.poses, &origins), order)?;
            (origins, Some(origin::series(&linear.solution, coils, order)))
        } else {
            (vec![0.0; coils], None)
        };
        let poses = all_moved(self.poses, &origins);
        let parts = |members: &dyn Fn(usize) -> bool| {
            let chosen: Vec<&Reading> =
                (0..count).filter(|index| members(*index)).map(|index| self.readings[index]).collect();
            Triangle::of(design::rows(&chosen, &poses, order, series.as_deref()))
        };
        let folds = FOLDS.min(count);
        let triangles: Vec<Triangle> = (0..folds).map(|fold| parts(&|index| index % folds == fold)).collect();
        let whole = Triangle::joined(triangles.iter());
        let refuse = |deficient| origin::undetermined(deficient, coils, order);
        let solution = whole.solve().map_err(refuse)?;
        let spectrum = whole.spectrum().map_err(refuse)?;
        let squares = whole.squares(&solution);
        let variance = squares / (whole.equations() - unknowns) as f64;
        let covariance = spectrum.inverse * variance;
        let deviation = |index: usize| covariance[(index, index)].max(0.0).sqrt();
        let origin_deviations = self
            .fit_origin
            .then(|| (0..coils).map(|coil| deviation(coils * order + coil)).collect::<Vec<f64>>());
        if let Some(coil) =
            origin_deviations.iter().flatten().position(|deviation| *deviation > ORIGIN_DEVIATION_MAX)
        {
            let reason = "its standard deviation exceeds 10 mm";
            return Err(FitError::OriginUndetermined { order, coil, reason });
        }
        let fold_squares = left_out_squares(&triangles);
        let region_rms_norms = self.regions.iter().map(|(_, members)| {
            let (inside, outside) = (parts(&|index| members[index]), parts(&|index| !members[index]));
            let solution = outside.solve().ok()?;
            Some((inside.squares(&solution) * 3.0 / inside.equations() as f64).sqrt())
        });
        let mut report = OrderReport {
            order,
            rms_norm: (squares / count as f64).sqrt(),
            rms: [0.0; 3],
            largest: 0.0,
            holdout_rms_norm: fold_squares.as_ref().map(|squares| root_mean(squares, &triangles)),
            region_rms_norms: region_rms_norms.collect(),
            // Origins' corrections, if any, stand past the coefficients.
            coefficients: design::split(solution.as_slice(), coils, order),
            origins,
            condition: spectrum.condition,
        };
        self.measure(&mut report);
        let block = |coil: usize| covariance.view((coil * order, coil * order), (order, order)).into_owned();
        Ok(Candidate {
            deviations: (0..coils)
                .map(|coil| (0..order).map(|k| deviation(coil * order + k)).collect())
                .collect(),
            covariance: (0..coils).map(block).collect(),
            origin_deviations,
            noise: variance.sqrt(),
            fold_squares: fold_squares.unwrap_or_default(),
            report,
        })
    }

    /// What the fit leaves, by component and at worst.
    fn measure(&self, report: &mut OrderReport) {
        let mut squares = Vector3::zeros();
        for reading in &self.readings {
            let left = reading.field - report.field(self.poses, reading);
            squares += left.component_mul(&left);
            report.largest = report.largest.max(left.norm());
        }
        report.rms = [0, 1, 2].map(|i| (squares[i] / self.readings.len() as f64).sqrt());
    }

    /// Index of the lowest order that is as good as the best, within the standard error of their difference.
    fn lowest_as_good_as_best(&self, candidates: &[Candidate]) -> usize {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let compared = || {
            let pairs = candidates.iter().map(|candidate| &candidate.fold_squares).enumerate();
            pairs.filter(|(_, squares)| !squares.is_empty())
        };
        let Some((best, least)) = compared().min_by(|(_, a), (_, b)| mean(a).total_cmp(&mean(b))) else {
            return 0;
        };
        let field = self.readings.iter().map(|reading| reading.field.norm_squared());
        let rounding = SQUARE_ROUNDING * field.sum::<f64>() / self.readings.len() as f64;
        let is_as_good = |squares: &[f64]| {
            let ratio = |(square, least): (&f64, &f64)| ((square + rounding) / (least + rounding)).ln();
            let ratios: Vec<f64> = squares.iter().zip(least).map(ratio).collect();
            let (by, folds) = (mean(&ratios), ratios.len() as f64);
            let spread: f64 = ratios.iter().map(|ratio| (ratio - by).powi(2)).sum();
            by <= ERRORS_MAX * (spread / (folds - 1.0) / folds).sqrt()
        };
        compared().find(|(_, squares)| is_as_good(squares)).map_or(best, |(index, _)| index)
    }

    fn report(
        &self,
        candidates: &[Candidate],
        chosen: usize,
        undetermined: Vec<(usize, FitError)>,
        share: f64,
    ) -> FieldFit {
        let candidate = &candidates[chosen];
        let OrderReport { order, rms_norm, condition, .. } = candidate.report;
        let next: Vec<&Candidate> = candidates.iter().skip(chosen + 1).take(NEXT_ORDERS).collect();
        let previous = chosen.checked_sub(1).map(|previous| &candidates[previous]);
        let others = if next.is_empty() { previous.into_iter().collect() } else { next };
        // What a low order leaves is not noise: the order that leaves least knows it best.
        let noise = candidates.iter().map(|candidate| candidate.noise).fold(f64::INFINITY, f64::min);
        let series = |candidate: &Candidate, coil: usize| {
            let OrderReport { coefficients, origins, .. } = &candidate.report;
            (Multipole::new(&coefficients[coil]), origins[coil])
        };
        let coil = |coil: usize| CoilFit {
            coefficients: candidate.report.coefficients[coil].clone(),
            deviations: candidate.deviations[coil].clone(),
            covariance: candidate.covariance[coil]
                .row_iter()
                .map(|row| row.iter().copied().collect())
                .collect(),
            origin: candidate.report.origins[coil],
            origin_deviation: candidate.origin_deviations.as_ref().map(|deviations| deviations[coil]),
            range: range::estimate(&Comparison {
                readings: &self.readings,
                pose: self.poses[coil],
                coil,
                alone: self.poses.len() == 1,
                series: series(candidate, coil),
                others: others.iter().map(|other| series(other, coil)).collect(),
                noise,
                share,
            }),
        };
        let counted = |(name, members): &(&'static str, Vec<bool>)| RegionReport {
            name,
            readings: members.iter().filter(|is_member| **is_member).count(),
        };
        FieldFit {
            order,
            coils: (0..self.poses.len()).map(coil).collect(),
            rms_norm,
            noise: candidate.noise,
            covariance_condition: condition * condition,
            orders: candidates.iter().map(|candidate| candidate.report.clone()).collect(),
            regions: self.regions.iter().map(counted).collect(),
            undetermined,
        }
    }
}

/// Root of the mean over all readings, from the mean square of each part.
fn root_mean(squares: &[f64], parts: &[Triangle]) -> f64 {
    let equations: usize = parts.iter().map(Triangle::equations).sum();
    let sum: f64 = squares.iter().zip(parts).map(|(mean, part)| mean * part.equations() as f64).sum();
    (sum / equations as f64).sqrt()
}

/// Mean square of each part as foretold by the others; `None` when the others do not determine the unknowns.
fn left_out_squares(parts: &[Triangle]) -> Option<Vec<f64>> {
    if parts.len() < 2 {
        return None;
    }
    let left_out = |index: usize| {
        let others = parts.iter().enumerate().filter(move |(other, _)| *other != index).map(|(_, part)| part);
        let others = Triangle::joined(others);
        if others.equations() < others.unknowns() {
            return None;
        }
        let solution = others.solve().ok()?;
        Some(parts[index].squares(&solution) * 3.0 / parts[index].equations() as f64)
    };
    (0..parts.len()).map(left_out).collect()
}
