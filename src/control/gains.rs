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
//! | `b` | error of a magnet's tangent that no gain explains, rad, world: sag, base, axes of coils; one a magnet |
//! | `P`, `P_0` | covariance of `x` and all `b`, and before anything was seen |
//! | `e` | component along a unit vector `a`, across the predicted tangent, of measured less predicted tangent |
//! | `h` | change of the predicted component with `x` |
//! | `s`, `F` | RMS of `b` by axis, rad; turn of a magnet after which its `b` is another, rad |
//! | `f` | turn of the magnet since `b` was last taken for another, rad |
//! | `n`, `T_n` | RMS of errors that pass, and how long they last, rad, s |
//! | `l` | angle from where the rod is taken to be to where it would rest, rad |
//! | `dt`, `T_f` | time between exposures; time after which what was learnt may be otherwise, s |
//!
//! The model's exact Jacobian holds the sensitivities, since a gain and its current enter as a product:
//! ```text
//! dt/dx_j = I_j dt/dI_j                                                       (k1)
//! P <- P + (P_0 - P) dt / T_f                                                 (k2)
//! b <- r b,   P_bb <- r^2 P_bb + (1 - r^2) s^2,   P_bx <- r P_bx,   r = exp(-f / F)     (k3)
//! e + h' y = h' x + a' b + noise of variance R,   R = 2 (n^2 + l^2) T_n / dt  (k4)
//! ```
//! (k4) is taken in by a Kalman filter, one component after another (D. Simon: Optimal State Estimation, 2006, section 6.1). What no gain
//! explains is the error of a posture: while the rod stands it is the same again and again, and to take each exposure for new knowledge
//! would end in gains that explain a sag. As a part of the state it teaches once; where the rod turns it becomes another (k3), a
//! Gauss-Markov process over turn in place of time. Errors that pass are white noise (k4) with the spectral density at zero frequency of an
//! exponentially correlated one; while the rod moves, `l` makes what is seen count for less.
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

/// Components of a tangent.
const AXES: usize = 3;
/// Least turn that counts, rad: the noise of a model at rest is none.
const TURN_MIN: f64 = 1.0_f64.to_radians();
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
    /// RMS of the tangents' errors that no gain explains, by axis, deg, 0.01 to 90.
    pub error_deg: f64,
    /// Turn of a magnet after which such an error is another, deg, 0.1 to 1e3.
    pub error_turn_deg: f64,
    /// Greatest error, across one of two axes, that teaches anything, deg, 0.01 to 180.
    pub error_max_deg: f64,
    /// RMS of errors that pass, as a rod's swing and a sensor's noise, deg, 0.001 to 90.
    pub noise_deg: f64,
    /// How long such an error lasts, ms, 1 to 1e6.
    pub noise_time_constant_ms: f64,
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
        checks.within("control.gains.error_turn_deg", self.error_turn_deg, 0.1, 1e3);
        checks.within("control.gains.noise_deg", self.noise_deg, 1e-3, 90.0);
        checks.within("control.gains.noise_time_constant_ms", self.noise_time_constant_ms, 1.0, 1e6);
        checks.within("control.gains.forgetting_time_s", self.forgetting_time_s, 0.1, 1e6);
    }
}

/// The estimate of one rig.
#[derive(Debug)]
pub(super) struct Gains {
    coils: usize,
    /// `x`, then `b` of every magnet.
    state: DVector<f64>,
    /// `y`.
    predicted_with: DVector<f64>,
    covariance: DMatrix<f64>,
    prior: DMatrix<f64>,
    /// Tangent of every magnet where its `b` was last taken for another.
    place: [Vector3<f64>; MAGNETS_MAX],
    /// Greatest magnitude of a logarithm.
    most: f64,
    turn: f64,
    noise_squared: f64,
    noise_time: f64,
    error_max: f64,
    forgetting_time: f64,
    /// `h` and `a`, and their product with `P`.
    row: DVector<f64>,
    covaried: DVector<f64>,
}

impl Gains {
    /// An estimate for so many coils and magnets, of which nothing is known but the prior.
    pub(super) fn new(config: &GainsConfig, coils: usize, magnets: usize) -> Self {
        let [common, own] =
            [config.common_deviation, config.own_deviation].map(|deviation| deviation.powi(2));
        let error = config.error_deg.to_radians().powi(2);
        let size = coils + AXES * magnets;
        let prior = DMatrix::from_fn(size, size, |row, column| match (row < coils, column < coils) {
            (true, true) => common + if row == column { own } else { 0.0 },
            _ if row == column => error,
            _ => 0.0,
        });
        Self {
            coils,
            state: DVector::zeros(size),
            predicted_with: DVector::zeros(coils),
            covariance: prior.clone(),
            prior,
            place: [Vector3::zeros(); MAGNETS_MAX],
            most: DEVIATIONS_MAX * (common + own).sqrt(),
            turn: config.error_turn_deg.to_radians(),
            noise_squared: config.noise_deg.to_radians().powi(2),
            noise_time: config.noise_time_constant_ms * 1e-3,
            error_max: config.error_max_deg.to_radians(),
            forgetting_time: config.forgetting_time_s,
            row: DVector::zeros(size),
            covaried: DVector::zeros(size),
        }
    }

    /// Learns from what poses showed beside `model`, which is at its equilibrium under `currents` (A).
    pub(super) fn learn(
        &mut self,
        model: &Model,
        currents: &[f64; COILS_MAX],
        seen: &[Option<Sighting>; MAGNETS_MAX],
    ) {
        let coils = self.coils;
        let span = seen.iter().flatten().map(|sighting| sighting.span).fold(0.0, f64::max);
        let share = (span / self.forgetting_time).min(1.0);
        self.covariance *= 1.0 - share;
        self.covariance.zip_apply(&self.prior, |entry, prior| *entry += share * prior); // (k2)
        self.predicted_with.copy_from(&self.state.rows(0, coils));
        for (magnet, sighting) in seen.iter().enumerate() {
            let Some(sighting) = sighting.filter(|sighting| sighting.span > 0.0) else { continue };
            self.turn_to(magnet, &sighting.predicted);
            let jacobian = model.tangent_jacobian(magnet);
            let variance =
                2.0 * (self.noise_squared + sighting.lag.powi(2)) * self.noise_time / sighting.span; // (k4)
            let off = sighting.measured - sighting.predicted;
            for axis in across(&sighting.predicted) {
                self.row.fill(0.0);
                let columns = self.row.iter_mut().zip(currents).take(coils).enumerate();
                for (coil, (entry, current)) in columns {
                    let column = Vector3::new(jacobian[0][coil], jacobian[1][coil], jacobian[2][coil]);
                    *entry = axis.dot(&column) * current; // (k1)
                }
                let error = axis.dot(&off);
                let seen = error + self.row.rows(0, coils).dot(&self.predicted_with);
                self.row.rows_mut(coils + AXES * magnet, AXES).copy_from(&axis);
                // Also false for what is not a number.
                if error.abs() <= self.error_max {
                    self.update(seen, variance);
                }
            }
        }
        let most = self.most;
        self.state.rows_mut(0, coils).apply(|logarithm| *logarithm = logarithm.clamp(-most, most));
    }

    /// (k3) for a magnet that is seen to point somewhere.
    fn turn_to(&mut self, magnet: usize, tangent: &Vector3<f64>) {
        let turned = (tangent - self.place[magnet]).norm();
        // Also false for what is not a number.
        let counts = turned > TURN_MIN;
        if !counts {
            return;
        }
        self.place[magnet] = *tangent;
        let kept = (-turned / self.turn).exp();
        let first = self.coils + AXES * magnet;
        self.state.rows_mut(first, AXES).scale_mut(kept);
        self.covariance.rows_mut(first, AXES).scale_mut(kept);
        self.covariance.columns_mut(first, AXES).scale_mut(kept);
        for axis in first..first + AXES {
            self.covariance[(axis, axis)] += (1.0 - kept * kept) * self.prior[(axis, axis)];
        }
    }

    /// (k4) for a row as it stands.
    fn update(&mut self, seen: f64, variance: f64) {
        self.covaried.gemv(1.0, &self.covariance, &self.row, 0.0);
        let total = self.row.dot(&self.covaried) + variance;
        let innovation = seen - self.row.dot(&self.state);
        if !(innovation.is_finite() && total.is_finite() && total > 0.0) {
            return;
        }
        self.state.axpy(innovation / total, &self.covaried, 1.0);
        self.covariance.ger(-1.0 / total, &self.covaried, &self.covaried, 1.0);
    }

    /// The gains that the model shall believe in, 1 past the last coil.
    pub(super) fn gains(&self) -> [f64; COILS_MAX] {
        let mut gains = [1.0; COILS_MAX];
        for (gain, logarithm) in gains.iter_mut().zip(&self.state).take(self.coils) {
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
