//! What is asked of a fit and what it finds.

use nalgebra::Vector3;

use crate::magnetics::multipole::{CoilPose, Multipole};

use super::design::moved;
use super::error::FitError;
use super::range::ValidRange;
use super::readings::Reading;

/// Which order to give back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OrderChoice {
    /// The lowest that foretells as well as the best.
    Auto,
    /// This one, 1 to [`ORDER_MAX`](magsteer_hal::config::ORDER_MAX).
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
    /// Condition number of the covariance of the unknowns, each scaled by its column: that of the scaled
    /// columns, squared.
    pub covariance_condition: f64,
    /// Every order that the readings determine.
    pub orders: Vec<OrderReport>,
    /// Regions left out.
    pub regions: Vec<RegionReport>,
    /// Why orders are not in [`Self::orders`].
    pub undetermined: Vec<(usize, FitError)>,
}

impl OrderReport {
    /// Field, T, of the fitted coils at a reading's place and currents; `poses` are those that were fitted
    /// with.
    #[must_use]
    pub fn field(&self, poses: &[CoilPose], reading: &Reading) -> Vector3<f64> {
        let coils = poses.iter().zip(&self.origins).zip(&self.coefficients).zip(&reading.currents);
        coils
            .map(|(((pose, origin), coefficients), current)| {
                let pose = moved(pose, *origin);
                Multipole::new(coefficients).evaluate(&pose, &reading.position).column.field * *current
            })
            .sum()
    }
}
