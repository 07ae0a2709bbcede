//! What a reconstruction from a point cloud comes to.

use crate::message::{MAGNETS_MAX, MagnetPose, PoseMessage};
use crate::send::count;

/// How well the centreline fits the cloud.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Quality {
    /// Points that were used: finite, within the capacity.
    pub points: usize,
    /// Points left out because a coordinate is not finite.
    pub points_not_finite: usize,
    /// Points left out because of the capacity.
    pub points_over_capacity: usize,
    /// Share of the points used that lies on the surface found.
    pub inlier_share: f64,
    /// RMS distance of those from the surface, m.
    pub residual_rms: f64,
    /// Iterations on all points.
    pub iterations: usize,
    /// True when it started from the shape found before, false when from the base.
    pub is_warm: bool,
}

/// One magnet as the reconstruction has it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MagnetEstimate {
    /// Centre, and orientation by eq. (7). `valid` is 0 when the magnet or the way to it was hidden too far.
    pub pose: MagnetPose,
    /// Standard deviation of the tangent's angle, rad, from points and noise alone.
    pub tangent_deviation: f64,
    /// Longest hidden stretch between the base and the magnet's far end, m.
    pub unseen: f64,
}

/// The magnets as found, with what speaks for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reconstruction {
    /// Entries of `magnets` in use.
    pub magnet_count: usize,
    /// Base to tip.
    pub magnets: [MagnetEstimate; MAGNETS_MAX],
    /// How well the centreline fits.
    pub quality: Quality,
}

impl Reconstruction {
    /// The magnets that were found, base to tip.
    #[must_use]
    pub fn magnets(&self) -> &[MagnetEstimate] {
        &self.magnets[..self.magnet_count]
    }

    /// A message of the poses; its header is still empty.
    #[must_use]
    pub fn message(&self) -> PoseMessage {
        let mut message =
            PoseMessage { magnet_count: count(self.magnet_count, MAGNETS_MAX), ..PoseMessage::default() };
        for (entry, magnet) in message.magnets.iter_mut().zip(self.magnets()) {
            *entry = magnet.pose;
        }
        message
    }
}

/// Why a cloud gave no shape. The next cloud is then tried from the base.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unreconstructed {
    /// Fewer points than a shape needs.
    #[error("{points} usable points: a shape needs at least {needed}")]
    TooFewPoints {
        /// Finite points.
        points: usize,
        /// Least number.
        needed: usize,
    },
    /// Too few of the points lie on any shape found.
    #[error("{:.0} % of the points lie on the surface found: must be at least {:.0} %", 100.0 * .quality.inlier_share, 100.0 * .needed)]
    TooFewInliers {
        /// As far as it came.
        quality: Quality,
        /// Least share.
        needed: f64,
    },
    /// The iteration did not come to rest.
    #[error("not converged after {} iterations", .quality.iterations)]
    NotConverged {
        /// As far as it came.
        quality: Quality,
    },
}
