//! One source in place of several: the series about one axis that comes nearest to the field of a coil's
//! sources.
//!
//! **Problem.** Calibrations seldom have one source a coil: three to eight dipoles that need not stand where
//! the coil does are usual, since they also take up what iron nearby does to the field. Our array has one
//! series a coil. What such a series leaves of the calibrated field can only be known by trying.
//!
//! **Terms.** The *samples* are the field of all sources of a coil on a grid that fills the calibrated box;
//! what is *left* is the RMS norm of the residual over that of the samples.
//!
//! **Method.** Coefficients enter linearly and are solved for by QR at every place and direction of the
//! source (variable projection: Golub, Pereyra, SIAM J. Numer. Anal. 10, 1973); place and direction follow
//! by Levenberg-Marquardt with differences. The start is the dipole that explains field and slope at the
//! centre: `|B|` falls as `r^-3`. Order 1 moves the source in all directions; higher ones leave its place on
//! the axis alone, since moving a series along its axis is what its next term does. The order taken is the
//! lowest whose rest is within [`ENOUGH`] of the least, or below [`NOTHING`].

use nalgebra::{DMatrix, DVector, Unit, Vector3};

use super::calibration::{Calibration, CoilSources};
use super::source::Source;
use crate::magnetics::multipole::{CoilPose, Multipole};
use crate::math::csv::Refusal;

/// Samples along each edge of the box.
const GRID: usize = 7;
/// Highest order tried.
const ORDER_TRIED_MAX: usize = 6;
/// Steps of one order.
const ITERATIONS_MAX: usize = 80;
/// A step that lessens the residual by less than this part is the last.
const PROGRESS_MIN: f64 = 1e-7;
/// Change of place (over the distance to the centre) and direction (rad) for differences: half the digits.
const DIFFERENCE: f64 = 1e-7;
/// Damping beyond which no step lessens the residual.
const DAMPING_MAX: f64 = 1e9;
/// A rest this many times the least is as good.
const ENOUGH: f64 = 1.05;
/// A rest of this part of the field is none.
const NOTHING: f64 = 1e-6;

/// What stands for the sources of a coil.
#[derive(Debug, Clone, PartialEq)]
pub struct Substitute {
    /// Name of the coil.
    pub coil: String,
    /// Sources that it had.
    pub source_count: usize,
    /// Part of their field that is left, RMS over the calibrated box.
    pub left: f64,
}

impl Calibration {
    /// The same calibration with one source in place of several, and what stands for what. Coils with one
    /// source of falling terms are as before.
    ///
    /// # Errors
    /// A coil of which more is left than `accepted` (a part of 1), or whose sources make no finite field in
    /// the box.
    pub fn with_one_source_each(&self, accepted: f64) -> Result<(Self, Vec<Substitute>), Refusal> {
        let mut calibration = self.clone();
        let mut substitutes = Vec::new();
        for coil in &mut calibration.coils {
            if coil.sources.len() == 1 && coil.sources[0].trimmed().rising.is_empty() {
                continue;
            }
            let (source, left) = self.one_source(coil)?;
            if left > accepted {
                let value =
                    format!("{:.2} % left by one source in place of {}", 100.0 * left, coil.sources.len());
                let expected = format!("at most {} %, as asked for", 100.0 * accepted);
                return Err(Refusal::new(coil.line, &coil.name, value, expected));
            }
            let source_count = coil.sources.len();
            substitutes.push(Substitute { coil: coil.name.clone(), source_count, left });
            coil.sources = vec![source];
        }
        Ok((calibration, substitutes))
    }

    /// The best single source, and the part of the field that it leaves.
    fn one_source(&self, coil: &CoilSources) -> Result<(Source, f64), Refusal> {
        let samples = Samples::new(self, coil);
        let refuse = |value: &str| {
            let expected = "with a field in the calibrated box that is finite and falls off";
            Refusal::new(coil.line, &coil.name, value, expected)
        };
        let scale = samples.field.norm();
        if !(scale.is_finite() && scale > 0.0) {
            return Err(refuse("without a finite field"));
        }
        let mut pose = self.start(coil).ok_or_else(|| refuse("with a field that does not change"))?;
        let mut tried = Vec::new();
        for order in 1..=ORDER_TRIED_MAX {
            let best = samples.improve(order, pose);
            pose = best.pose;
            tried.push(best);
        }
        let least = tried.iter().map(|fit| fit.residual.norm()).fold(f64::INFINITY, f64::min);
        let enough = (ENOUGH * least).max(NOTHING * scale);
        let taken = tried.into_iter().find(|fit| fit.residual.norm() <= enough);
        let Some(Fitted { pose, coefficients, residual }) = taken else {
            return Err(refuse("with a field that no source explains"));
        };
        let mut source = Source::of_series("Src_0", pose.origin, pose.axis, &coefficients);
        source.line = coil.line;
        Ok((source, residual.norm() / scale))
    }

    /// The dipole that explains the field and its slope at the centre.
    fn start(&self, coil: &CoilSources) -> Option<CoilPose> {
        let center = self.center();
        let edge = self.workspace.iter().map(|[least, greatest]| greatest - least).fold(0.0, f64::max);
        let step = 0.1 * edge;
        let slope = Vector3::from_fn(|axis, _| {
            let mut moved = Vector3::zeros();
            moved[axis] = step;
            (coil.field(&(center + moved)).norm() - coil.field(&(center - moved)).norm()) / (2.0 * step)
        });
        let field = coil.field(&center);
        let towards = Unit::try_new(slope, f64::MIN_POSITIVE)?.into_inner();
        let distance = 3.0 * field.norm() / slope.norm();
        // Of a dipole m at the distance r along -n, B r^3 = 3 n (n . m) - m.
        let along = towards * towards.dot(&field);
        let axis = Unit::try_new(along * 1.5 - field, f64::MIN_POSITIVE)?.into_inner();
        let pose = CoilPose { origin: center + towards * distance.clamp(edge, 100.0 * edge), axis };
        pose.origin.iter().chain(&pose.axis).all(|value| value.is_finite()).then_some(pose)
    }
}

impl CoilSources {
    /// Field of all sources at `point` (m, world) for 1 A, T/A.
    #[must_use]
    pub fn field(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.sources.iter().map(|source| source.field(point)).sum()
    }
}

/// The field of a coil in the box.
struct Samples {
    center: Vector3<f64>,
    points: Vec<Vector3<f64>>,
    /// Three components a point, T/A.
    field: DVector<f64>,
}

/// A pose with the coefficients that are best there.
struct Fitted {
    pose: CoilPose,
    coefficients: Vec<f64>,
    residual: DVector<f64>,
}

impl Samples {
    fn new(calibration: &Calibration, coil: &CoilSources) -> Self {
        let points: Vec<Vector3<f64>> = (0..GRID.pow(3))
            .map(|index| {
                Vector3::from_fn(|axis, _| {
                    let [least, greatest] = calibration.workspace[axis];
                    let step = index / GRID.pow(axis as u32) % GRID;
                    least + (greatest - least) * step as f64 / (GRID - 1) as f64
                })
            })
            .collect();
        let field = points.iter().flat_map(|point| <[f64; 3]>::from(coil.field(point)));
        let field = DVector::from_iterator(3 * points.len(), field);
        Self { center: calibration.center(), points, field }
    }

    /// The best coefficients of a source at a pose; `None` where they are not determined.
    fn fit(&self, order: usize, pose: CoilPose) -> Option<Fitted> {
        // Powers of the distance, so that the columns are of like size.
        let distance = (self.center - pose.origin).norm();
        let scales: Vec<f64> = (1..=order as i32).map(|n| distance.powi(n + 2)).collect();
        let mut design = DMatrix::zeros(self.field.len(), order);
        for (term, scale) in scales.iter().enumerate() {
            let mut coefficients = vec![0.0; term + 1];
            coefficients[term] = *scale;
            let series = Multipole::new(&coefficients);
            for (index, point) in self.points.iter().enumerate() {
                let field = series.evaluate(&pose, point).column.field;
                design.fixed_view_mut::<3, 1>(3 * index, term).copy_from(&field);
            }
        }
        let factors = design.clone().qr();
        let mut projected = self.field.clone();
        factors.q_tr_mul(&mut projected);
        let solution = factors.r().solve_upper_triangular(&projected.rows(0, order).clone_owned())?;
        let residual = design * &solution - &self.field;
        let coefficients: Vec<f64> =
            solution.iter().zip(&scales).map(|(value, scale)| value * scale).collect();
        let is_finite = residual.iter().chain(&coefficients).all(|value| value.is_finite());
        is_finite.then_some(Fitted { pose, coefficients, residual })
    }

    /// Moves and turns the source until the residual no longer falls.
    fn improve(&self, order: usize, start: CoilPose) -> Fitted {
        let nothing = Fitted { pose: start, coefficients: vec![0.0; order], residual: -&self.field };
        let Some(mut best) = self.fit(order, start) else { return nothing };
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS_MAX {
            let Some(jacobian) = self.differences(order, &best) else { return best };
            let (normal, slope) = (jacobian.tr_mul(&jacobian), jacobian.tr_mul(&best.residual));
            let mut progress = 0.0;
            while damping < DAMPING_MAX {
                let mut damped = normal.clone();
                for index in 0..damped.nrows() {
                    damped[(index, index)] *= 1.0 + damping;
                }
                let step = damped.cholesky().map(|factors| -factors.solve(&slope));
                let tried = step.and_then(|step| self.fit(order, self.moved(&best.pose, step.as_slice())));
                if let Some(better) = tried.filter(|tried| tried.residual.norm() < best.residual.norm()) {
                    progress = 1.0 - better.residual.norm() / best.residual.norm();
                    best = better;
                    damping = (damping / 10.0).max(1e-12);
                    break;
                }
                damping *= 10.0;
            }
            if progress < PROGRESS_MIN {
                return best;
            }
        }
        best
    }

    /// Columns of the residual's derivative with the pose; see [`Self::moved`] for their order.
    fn differences(&self, order: usize, at: &Fitted) -> Option<DMatrix<f64>> {
        let unknowns = if order == 1 { 5 } else { 4 };
        let column = |index: usize| {
            let mut step = vec![0.0; unknowns];
            step[index] = DIFFERENCE;
            let moved = self.fit(order, self.moved(&at.pose, &step))?;
            Some((moved.residual - &at.residual) / DIFFERENCE)
        };
        let columns: Option<Vec<DVector<f64>>> = (0..unknowns).map(column).collect();
        columns.map(|columns| DMatrix::from_columns(&columns))
    }

    /// A pose moved across its axis (two steps, over the distance to the centre), turned (two, rad) and moved
    /// along its axis (one, which may be left out).
    fn moved(&self, pose: &CoilPose, step: &[f64]) -> CoilPose {
        let distance = (self.center - pose.origin).norm();
        let axis = Unit::new_unchecked(pose.axis);
        let [first, second] = across(&axis);
        let part = |index: usize| step.get(index).copied().unwrap_or(0.0);
        CoilPose {
            origin: pose.origin + (first * part(0) + second * part(1) + pose.axis * part(4)) * distance,
            axis: (pose.axis + first * part(2) + second * part(3)).normalize(),
        }
    }
}

/// Two unit vectors across an axis.
fn across(axis: &Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let first = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    [first, axis.cross(&first)]
}
