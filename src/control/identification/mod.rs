//! Identification: what the rig is, from equilibria that it was seen in.
//!
//! **Problem.** The controller's model believes in a modulus, in moments, in the field per ampere of every
//! coil and in a place of the clamp. All of them are known to some percent, and the model is off by degrees
//! where the rod is soft. Poses measured at rest under known currents and angles tell more: not everything
//! of everything, and not without noise.
//!
//! **Terms.**
//!
//! | word | meaning |
//! |---|---|
//! | sample | currents, angles and the magnets' measured tangents (and positions) while the rod was at rest |
//! | parameter x | logarithm of a factor on moduli, moments, gains; shift (m) and rotation vector (rad) of the clamp, world |
//! | prior P | how far the nominal value is trusted: a standard deviation s each; 0 holds the parameter |
//! | block | what is left of a magnet's tangent or position in one sample, over its noise |
//! | determined | a direction of parameters in which the data say more than the prior does |
//!
//! **Method.**
//! - `parse`, `plausible`: CSV to [`Sample`]s; every refusal names line, column, value and what would be
//!   right.
//! - `parameters`: which there are, and the rig's tables with them applied: the model of the fit is built
//!   from the very tables that an overlay then states.
//! - `equilibria`: the statics at every sample, by shooting from rest or from the previous equilibrium,
//!   with derivatives from the pass's sensitivities: none by differencing.
//! - `fit`: the parameters of greatest probability (MAP), by Levenberg and Marquardt on
//!   `sum rho(|r|) + sum (x/s)^2`, rho Huber's: a block beyond k noise deviations pulls with no more than k.
//! - `noise`: deviations of the noise from what the fit leaves, where they are not stated.
//! - `excitation`: equilibria worth measuring, drawn from a seed, that the rod bears.
//! - `report`, `found`: estimates, their covariance `(J'WJ + P^-1)^-1`, and the directions that the data
//!   leave to the prior.
//!
//! Some directions no equilibrium shows: all moments greater by as much as all gains are smaller; a turn of
//! a straight rod with axial magnets about its own tangent at the clamp; and in a weightless world a common
//! scale of modulus and moments, which weight makes visible.
//!
//! **Source.** D. W. Marquardt, SIAM J. Appl. Math. 11, 1963; P. J. Huber, E. M. Ronchetti, *Robust
//! Statistics*, 2nd ed., section 7.3; A. Tarantola, *Inverse Problem Theory*, 2005, section 3.2, for the
//! covariance.
//!
//! What is absent: files, and physics that the controller's model leaves out. What that does to the poses
//! (magnets that pull on each other, coils that stand askew) is absorbed by the estimates as far as it can
//! be, and the rest of it counts as noise.

mod equilibria;
mod error;
mod excitation;
mod fit;
mod found;
mod noise;
mod parameters;
mod parse;
mod plausible;
mod report;
mod sample;

#[cfg(test)]
mod tests;

pub use error::IdentifyError;
pub use excitation::{ExcitationRequest, TooFewSafe, excitations};
pub use fit::{Iteration, identify};
pub use found::{Estimate, Identified, Outlier, Rms, Undetermined};
pub use noise::{Noise, NoiseLevel};
pub use parameters::{Parameter, Parameters, Priors, Stiffness};
pub use parse::{columns, parse};
pub use plausible::{check_units, may_be_radians};
pub use sample::{MagnetReading, Quantity, Sample, Samples};

/// What is asked of an identification.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IdentifyRequest {
    /// How far nominal values are trusted.
    pub priors: Priors,
    /// Which stiffnesses share one factor.
    pub stiffness: Stiffness,
    /// The sensor's noise.
    pub noise: Noise,
    /// k: noise deviations beyond which a block is an outlier, which pulls with no more than k.
    pub outlier_sigma: f64,
}
