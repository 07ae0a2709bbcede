//! Every order, how well each foretells readings that it has not seen, and the choice of one.
//!
//! # Method
//! - The readings are brought into one order by their values, so that neither the fit nor the folds depend on the file's.
//! - *Folds*: reading i belongs to fold i mod 10; each fold is foretold from the other nine. Neighbours of a left-out reading stay in, so
//!   that folds tell noise from signal, not how far the series carries.
//! - *Regions*: the readings nearest to the coil, those furthest, those off the plane of the rest, or those of an array's outer shell, are foretold
//!   from all others. They tell how far the series carries; they are reported and do not choose.
//! - *Choice*: the lowest order whose mean square over the folds exceeds that of the best by no more than one standard error of the
//!   difference, taken fold by fold: noise that is in both does not count. Higher orders fit noise, and it is high orders that go
//!   wrong first outside the measured volume. Differences below a millionth of the field are rounding.
//! - Where origins are fitted, they are settled for each order by all readings, and left free to first order in each fold.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::magnetics::multipole::{CoilPose, Multipole};
use magsteer_hal::config::ORDER_MAX;

use super::design::{self, all_moved};
use super::error::FitError;
use super::origin;
use super::range::{self, Comparison, ValidRange};
use super::readings::Reading;
use super::triangle::Triangle;

/// Parts that are left out in turn.
const FOLDS: usize = 10;
/// Share of the measured depth that makes a region.
const REGION_SHARE: f64 = 0.15;
/// Mean squares closer than this to each other, relative to that of the field, are alike.
const SQUARE_ROUNDING: f64 = 1e-12;
/// Orders past the chosen one that the range of validity is judged by: one alone may err alike.
const NEXT_ORDERS: usize = 3;
/// An origin with a larger standard deviation is not known, m.
const ORIGIN_DEVIATION_MAX: f64 = 0.01;

/// Which order to give back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderChoice {
    /// The lowest that foretells as well as the best.
    Auto,
    /// This one, 1 to [`ORDER_MAX`].
    Exactly(usize),
}

/// What is asked of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitRequest {
    /// Which order to give back.
    pub order: OrderChoice,
    /// Whether the expansion points may move along the axes.
    pub fit_origin: bool,
    /// Greatest relative error that the range of validity admits, 0 to 1.
    pub share: f64,
}

/// One coil's series and how well it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct CoilFit {
    /// `a_k` for 1 A, k = 1 first, T m^(k+2) / A.
    pub coefficients: Vec<f64>,
    /// Standard deviation of each.
    pub deviations: Vec<f64>,
    /// Their covariance, by rows.
    pub covariance: Vec<Vec<f64>>,
    /// Local x of the expansion point, m, from where the pose has it; zero unless fitted.
    pub origin: f64,
    /// Its standard deviation, m; `None` unless fitted.
    pub origin_deviation: Option<f64>,
    /// How near to the expansion point the series may be used.
    pub range: ValidRange,
}

/// One order of the scan.
#[derive(Debug, Clone, PartialEq)]
pub struct OrderReport {
    /// Number of terms P.
    pub order: usize,
    /// RMS norm of all readings, T.
    pub rms_norm: f64,
    /// RMS of each component, T.
    pub rms: [f64; 3],
    /// Largest magnitude of a residual, T.
    pub largest: f64,
    /// The same as `rms_norm`, of readings left out in folds; `None` where a fold leaves too little to fit.
    pub holdout_rms_norm: Option<f64>,
    /// The same of each region of [`FieldFit::regions`], left out as a whole.
    pub region_rms_norms: Vec<Option<f64>>,
    /// Origin of each coil, m; zero unless fitted.
    pub origins: Vec<f64>,
    /// Condition number of the scaled columns.
    pub condition: f64,
    /// Each coil's coefficients, as in [`CoilFit`].
    pub coefficients: Vec<Vec<f64>>,
}

/// A part of the measured volume that is left out as a whole.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionReport {
    /// What it is, for people.
    pub name: &'static str,
    /// Readings in it.
    pub readings: usize,
}

/// Coefficients of every coil at the chosen order.
#[derive(Debug, Clone, PartialEq)]
pub struct FieldFit {
    /// The chosen order P.
    pub order: usize,
    /// One a pose.
    pub coils: Vec<CoilFit>,
    /// RMS norm of all readings, T.
    pub rms_norm: f64,
    /// Standard deviation of one component's noise, T, from what the fit leaves.
    pub noise: f64,
    /// Condition number of the covariance of the unknowns, each scaled by its column: that of the scaled columns, squared.
    pub covariance_condition: f64,
    /// Every order that the readings determine.
    pub orders: Vec<OrderReport>,
    /// Regions left out.
    pub regions: Vec<RegionReport>,
    /// Why orders are not in [`Self::orders`].
    pub undetermined: Vec<(usize, FitError)>,
}

impl OrderReport {
    /// Field, T, of the fitted coils at a reading's place and currents; `poses` are those that were fitted with.
    #[must_use]
    pub fn field(&self, poses: &[CoilPose], reading: &Reading) -> Vector3<f64> {
        let coils = poses.iter().zip(&self.origins).zip(&self.coefficients).zip(&reading.currents);
        coils
            .map(|(((pose, origin), coefficients), current)| {
                let pose = design::moved(pose, *origin);
                Multipole::new(coefficients).evaluate(&pose, &reading.position).column.field * *current
            })
            .sum()
    }
}

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
/// When a reading has not as many currents as there are poses, or an order of 0 or above [`ORDER_MAX`] is asked for.
pub fn fit(poses: &[CoilPose], readings: &[Reading], request: &FitRequest) -> Result<FieldFit, FitError> {
    assert!(readings.iter().all(|reading| reading.currents.len() == poses.len()), "one pose a current");
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
            arrangement.lowest_within_one_error(&candidates)
        }
        OrderChoice::Exactly(order) => {
            assert!((1..=ORDER_MAX).contains(&order), "order {order}: must be 1 to {ORDER_MAX}");
            let found = candidates.iter().position(|candidate| candidate.report.order == order);
            match (found, why_not(order)) {
                (Some(index), _) => index,
                (None, Some(error)) => return Err(error),
                (None, None) => unreachable!("an order is determined or has a reason"),
            }
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
        let holdout = fold_squares.as_ref().map(|squares| {
            let sum: f64 =
                squares.iter().zip(&triangles).map(|(mean, part)| mean * part.equations() as f64 / 3.0).sum();
            (sum / count as f64).sqrt()
        });
        let region_rms_norms = self.regions.iter().map(|(_, members)| {
            let (inside, outside) = (parts(&|index| members[index]), parts(&|index| !members[index]));
            let solution = outside.solve().ok()?;
            Some((inside.squares(&solution) * 3.0 / inside.equations() as f64).sqrt())
        });
        let region_rms_norms = region_rms_norms.collect();
        let mut report = OrderReport {
            order,
            rms_norm: (squares / count as f64).sqrt(),
            rms: [0.0; 3],
            largest: 0.0,
            holdout_rms_norm: holdout,
            region_rms_norms,
            coefficients: coefficients(&solution, coils, order),
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

    /// Index of the lowest order that is not worse than the best by more than the standard error of their difference.
    fn lowest_within_one_error(&self, candidates: &[Candidate]) -> usize {
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
            let worse: Vec<f64> = squares.iter().zip(least).map(|(square, least)| square - least).collect();
            let (by, folds) = (mean(&worse), worse.len() as f64);
            let spread: f64 = worse.iter().map(|worse| (worse - by).powi(2)).sum();
            by <= (spread / (folds - 1.0) / folds).sqrt().max(rounding)
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

/// Each coil's coefficients, without the origins' corrections at the end of the solution.
fn coefficients(solution: &DVector<f64>, coils: usize, order: usize) -> Vec<Vec<f64>> {
    design::split(solution.as_slice(), coils, order)
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

/// Parts of the measured volume that are worth leaving out, as marks on the readings.
fn regions(poses: &[CoilPose], readings: &[&Reading]) -> Vec<(&'static str, Vec<bool>)> {
    let mut regions: Vec<(&'static str, Vec<bool>)> = Vec::new();
    if let [pose] = poses {
        let local = |reading: &&Reading| pose.axis.dot(&(reading.position - pose.origin));
        let least = readings.iter().map(local).fold(f64::INFINITY, f64::min);
        let most = readings.iter().map(local).fold(f64::NEG_INFINITY, f64::max);
        let depth = REGION_SHARE * (most - least);
        let mark = |is_member: &dyn Fn(f64) -> bool| {
            readings.iter().map(|reading| is_member(local(reading))).collect()
        };
        regions.push(("nearest to the coil", mark(&|x| x <= least + depth)));
        regions.push(("furthest from the coil", mark(&|x| x >= most - depth)));
        let heights = readings.iter().map(|reading| reading.position.z);
        let plane = median(heights.clone().collect());
        regions.push(("off the plane", heights.map(|z| (z - plane).abs() > 1e-4).collect()));
    } else {
        let center =
            readings.iter().map(|reading| reading.position).sum::<Vector3<f64>>() / readings.len() as f64;
        let distances: Vec<f64> = readings.iter().map(|reading| (reading.position - center).norm()).collect();
        let most = distances.iter().fold(0.0_f64, |most, distance| most.max(*distance));
        let outer = distances.iter().map(|distance| *distance > (1.0 - REGION_SHARE) * most).collect();
        regions.push(("outer shell", outer));
    }
    // At most half may be left out: foretelling the many from the few says little.
    regions.retain(|(_, members)| {
        let count = members.iter().filter(|is_member| **is_member).count();
        count > 0 && 2 * count <= members.len()
    });
    regions
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
