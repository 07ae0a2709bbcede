//! What an identification found, and how much of it the data said.

use magsteer_hal::config::HardwareConfig;
use nalgebra::DMatrix;

use super::parameters::Parameter;
use super::sample::Quantity;

/// One parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// Its name, for people.
    pub name: String,
    /// Value, in the units of [`Parameter`]; nominally 0.
    pub value: f64,
    /// Its standard deviation after the data, for noise that is independent and as large everywhere.
    pub deviation: f64,
    /// The same from how much the samples disagree: holds also where the model misses something, which
    /// pulls all that was measured of one sample together, and of some samples more than of others.
    pub deviation_between_samples: f64,
    /// Its standard deviation before them.
    pub prior_deviation: f64,
}

impl Estimate {
    /// Deviation after the data over that before: 1 when they said nothing.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.deviation / self.prior_deviation
    }

    /// By how many prior deviations it moved.
    #[must_use]
    pub fn moved(&self) -> f64 {
        self.value / self.prior_deviation
    }
}

/// A direction of parameters that the data leave to the prior.
#[derive(Debug, Clone, PartialEq)]
pub struct Undetermined {
    /// Deviation along it after the data over that before.
    pub ratio: f64,
    /// The parameters that make it up (index, share in prior deviations), the greatest first.
    pub parts: Vec<(usize, f64)>,
}

/// A block that the fit does not believe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the sample.
    pub sample: usize,
    /// Index of the magnet.
    pub magnet: usize,
    /// What was measured.
    pub quantity: Quantity,
    /// How far off, in noise deviations.
    pub sigma: f64,
}

/// RMS distance of model and measurement, over the blocks that are no outliers in the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rms {
    /// Angle between tangents, rad; `None` where none was used.
    pub angle: Option<f64>,
    /// Distance between centres, m; `None` where none was measured.
    pub distance: Option<f64>,
}

/// Everything found.
#[derive(Debug, Clone, PartialEq)]
pub struct Identified {
    /// The free parameters.
    pub estimates: Vec<Estimate>,
    /// Covariance of all of them, in the units of [`Parameter`].
    pub covariance: DMatrix<f64>,
    /// The rig's tables with the estimates applied.
    pub hardware: HardwareConfig,
    /// True when the search ended in a minimum.
    pub converged: bool,
    /// Steps that it took.
    pub iterations: usize,
    /// Deviations of the noise that were used: of each tilt of a tangent, rad, and each coordinate, m.
    pub noise: [f64; 2],
    /// Weighted sum of the squares of what is left of the measurements, in noise deviations.
    pub chi_square: f64,
    /// Equations less the parameters that the data determine.
    pub degrees_of_freedom: f64,
    /// With the nominal parameters.
    pub rms_before: Rms,
    /// With the estimates.
    pub rms_after: Rms,
    /// The greatest first.
    pub outliers: Vec<Outlier>,
    /// Indices of the samples for which the model has no stable equilibrium; they were not used.
    pub lost: Vec<usize>,
    /// The least determined first.
    pub undetermined: Vec<Undetermined>,
}
