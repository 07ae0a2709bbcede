//! Gains of the coils, learnt while the loop runs: what of the model's error is one number a coil.
//!
//! # Problem
//! The bias says where the magnets are, and not why. A rod that is stiffer than its model is bent less by every current; corrected by
//! the bias the loop arrives, but the model beside it is bent farther than the rod and nearer to its snap-through. Margin of stability,
//! scout and guide then judge a rod that is not there. What modulus, moments and amplifiers have in common is how far a current bends
//! the rod: to first order their errors are one gain a coil, close to the same for all.
//!
//! # Method
//! | symbol | meaning |
//! |---|---|
//! | `g_j`, `x_j = ln g_j` | field of coil `j` over that of its description |
//! | `y` | `x` with which the tangents were predicted |
//! | `P`, `P_0` | covariance of `x`, and before anything was seen |
//! | `e`, `h` | one component of measured less predicted tangent, and its change with `x` |
//! | `s`, `T_s` | RMS of what gains do not explain, rad, and how long it lasts, s |
//! | `l` | angle from where the rod is taken to be to where it would rest, rad |
//! | `dt`, `T_f` | time between exposures; time after which what was learnt may be otherwise, s |
//!
//! The model's exact Jacobian holds the sensitivities, since a gain and its current enter as a product:
//! ```text
//! dt/dx_j = I_j dt/dI_j                                              (k1)
//! P   <- P + (P_0 - P) dt / T_f                                      (k2)
//! R    = 2 (s^2 + l^2) T_s / dt                                      (k3)
//! x   <- x + K (e - h' (x - y)),   P <- P - K h' P,   K = P h / (h' P h + R)   (k4)
//! ```
//! (k4) is the Kalman filter of constants, one component after another (D. Simon: Optimal State Estimation, 2006, section 6.1). What it
//! takes for noise is an error of the model that lasts: (k3) is white noise with the spectral density at zero frequency of an
//! exponentially correlated error. While the rod moves, `l` makes what is seen count for less.
//! Where the rod is near a snap-through (k1) is large, and little of a gain's error is seen well: where it matters most.
//!
//! A sensor that lies, a coil that is broken or a wall in the way is not to be learnt, since the monitors behind the loop look for a model
//! that stays away from what is measured. So errors beyond what is credible teach nothing, and gains stay within three standard deviations
//! of `P_0`.
//!
//! What is absent: an allocation after construction, the bias (see `disturbance`), which goes on correcting what is left.

use magsteer_hal::invalid::Checks;
use magsteer_hal::{COILS_MAX, MAGNETS_MAX};
use nalgebra::{DMatrix, DVector, Vector3};
use serde::{Deserialize, Serialize};

use super::disturbance::Sighting;
use super::model::Model;

/// Standard deviations of the prior within which gains stay.
const DEVIATIONS_MAX: f64 = 3.0;

/// `[control.gains]`: how the gains of the coils are learnt.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainsConfig {
    /// Standard deviation of what all gains have in common before anything was seen, relative, 0 to 0.5: of the moments over the modulus.
    pub common_deviation: f64,
    /// Standard deviation of each coil's gain by itself, relative, 0 to 0.5.
    pub own_deviation: f64,
    /// RMS of the tangents' errors that no gain explains, deg, 0.01 to 90.
    pub error_deg: f64,
    /// Greatest error, across one of two axes, that teaches anything, deg, 0.01 to 180.
    pub error_max_deg: f64,
    /// How long such an error lasts, ms, 1 to 1e6.
    pub error_time_constant_ms: f64,
    /// Time after which what was learnt may be otherwise, s, 0.1 to 1e6.
    pub forgetting_time_s: f64,
}

impl GainsConfig {
    /// Adds every value out of its range.
    pub fn check(&self, checks: &mut Checks) {
        checks.within("control.gains.common_deviation", self.common_deviation, 0.0, 0.5);
        checks.within("control.gains.own_deviation", self.own_deviation, 0.0, 0.5);
        checks.within("control.gains.error_deg", self.error_deg, 0.01, 90.0);
        checks.within("control.gains.error_max_deg", self.error_max_deg, 0.01, 180.0);
        checks.within("control.gains.error_time_constant_ms", self.error_time_constant_ms, 1.0, 1e6);
        checks.within("control.gains.forgetting_time_s", self.forgetting_time_s, 0.1, 1e6);
    }
}

/// The estimate of one rig.
#[derive(Debug)]
pub(super) struct Gains {
    /// `x`.
    logarithms: DVector<f64>,
    /// `y`.
    predicted_with: DVector<f64>,
    covariance: DMatrix<f64>,
    prior: DMatrix<f64>,
    /// Greatest magnitude of a logarithm.
    most: f64,
    error_squared: f64,
    error_max: f64,
    error_time: f64,
    forgetting_time: f64,
    /// `h`, and `P h`.
    sensitivity: DVector<f64>,
    covaried: DVector<f64>,
}

impl Gains {
    /// An estimate for so many coils, of which nothing is known but the prior.
    pub(super) fn new(config: &GainsConfig, coils: usize) -> Self {
        let [common, own] =
            [config.common_deviation, config.own_deviation].map(|deviation| deviation.powi(2));
        let prior =
            DMatrix::from_fn(coils, coils, |row, column| common + if row == column { own } else { 0.0 });
        Self {
            logarithms: DVector::zeros(coils),
            predicted_with: DVector::zeros(coils),
            covariance: prior.clone(),
            prior,
            most: DEVIATIONS_MAX * (common + own).sqrt(),
            error_squared: config.error_deg.to_radians().powi(2),
            error_max: config.error_max_deg.to_radians(),
            error_time: config.error_time_constant_ms * 1e-3,
            forgetting_time: config.forgetting_time_s,
            sensitivity: DVector::zeros(coils),
            covaried: DVector::zeros(coils),
        }
    }

    /// Learns from what poses showed beside `model`, which is at its equilibrium under `currents` (A).
    pub(super) fn learn(
        &mut self,
        model: &Model,
        currents: &[f64; COILS_MAX],
        seen: &[Option<Sighting>; MAGNETS_MAX],
    ) {
        let span = seen.iter().flatten().map(|sighting| sighting.span).fold(0.0, f64::max);
        let share = (span / self.forgetting_time).min(1.0);
        self.covariance *= 1.0 - share;
        self.covariance.zip_apply(&self.prior, |entry, prior| *entry += share * prior); // (k2)
        self.predicted_with.copy_from(&self.logarithms);
        for (magnet, sighting) in seen.iter().enumerate() {
            let Some(sighting) = sighting.filter(|sighting| sighting.span > 0.0) else { continue };
            let jacobian = model.tangent_jacobian(magnet);
            let error_squared = self.error_squared + sighting.lag.powi(2);
            let variance = 2.0 * error_squared * self.error_time / sighting.span; // (k3)
            let off = sighting.measured - sighting.predicted;
            for axis in across(&sighting.predicted) {
                let columns = self.sensitivity.iter_mut().zip(currents).enumerate();
                for (coil, (entry, current)) in columns {
                    let column = Vector3::new(jacobian[0][coil], jacobian[1][coil], jacobian[2][coil]);
                    *entry = axis.dot(&column) * current; // (k1)
                }
                self.update(axis.dot(&off), variance);
            }
        }
        let most = self.most;
        self.logarithms.apply(|logarithm| *logarithm = logarithm.clamp(-most, most));
    }

    /// (k4) for `h` as it stands.
    fn update(&mut self, error: f64, variance: f64) {
        self.covaried.gemv(1.0, &self.covariance, &self.sensitivity, 0.0);
        let total = self.sensitivity.dot(&self.covaried) + variance;
        let learnt_since =
            self.sensitivity.dot(&self.logarithms) - self.sensitivity.dot(&self.predicted_with);
        // Also false for what is not a number.
        let is_credible = error.abs() <= self.error_max && learnt_since.is_finite();
        if !(is_credible && total.is_finite() && total > 0.0) {
            return;
        }
        self.logarithms.axpy((error - learnt_since) / total, &self.covaried, 1.0);
        self.covariance.ger(-1.0 / total, &self.covaried, &self.covaried, 1.0);
    }

    /// The gains that the model shall believe in, 1 past the last coil.
    pub(super) fn gains(&self) -> [f64; COILS_MAX] {
        let mut gains = [1.0; COILS_MAX];
        for (gain, logarithm) in gains.iter_mut().zip(&self.logarithms) {
            *gain = logarithm.exp();
        }
        gains
    }
}

/// Two unit vectors across a direction and each other.
fn across(direction: &Vector3<f64>) -> [Vector3<f64>; 2] {
    // The axis farthest from it, so that nothing cancels.
    let axis = Vector3::ith(direction.iamin(), 1.0);
    let one = direction.cross(&axis).normalize();
    [one, direction.cross(&one)]
}

#[cfg(test)]
mod tests;
