//! What a reconstruction from a point cloud is told beforehand.

use super::outline::{Piece, pieces};
use crate::description::{ManipulatorDescription, PartDescription};

/// m/s^2, to tell the size of a weight.
const GRAVITY: f64 = 9.81;

/// Points that a reconstruction takes unless told otherwise.
pub const CAPACITY: usize = 4096;

/// How the centreline is parametrised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CentrelineKind {
    /// One polynomial in space from base to tip, the paper's `P(s)`, of this degree, 3 to 12. Unit speed is
    /// asked of it, not given; the rigidity of magnets is beyond it.
    Polynomial {
        /// Degree.
        degree: usize,
    },
    /// For each flexible section a polynomial of this degree, 0 to 6, in each of two bending curvatures;
    /// magnets are straight. Unit speed by construction.
    Curvature {
        /// Degree.
        degree: usize,
    },
}

/// Settings of [`super::CloudShape`].
#[derive(Debug, Clone, PartialEq)]
pub struct CloudSettings {
    /// How the centreline is parametrised.
    pub kind: CentrelineKind,
    /// Most points taken of a cloud; of a larger one every n-th, evenly, is taken.
    pub capacity: usize,
    /// Standard deviation of a point's distance from the surface, m, > 0.
    pub noise: f64,
    /// Positions of the cameras, m, world; a point of the surface faces every one of them. May be empty: then
    /// the clamp alone tells on which side of the seen surface the axis lies.
    pub viewers: Vec<[f64; 3]>,
    /// Standard deviation of the curvature expected beforehand, 1/m, > 0; matters where the rod is hidden.
    pub curvature: f64,
    /// Standard deviation of the force on a magnet, of weight, field and motion together, N, > 0: expected
    /// beforehand, it says how much a section's curvature may change along it. Matters where the rod is
    /// hidden, and for [`CentrelineKind::Curvature`] alone.
    pub force: f64,
    /// Longest stretch between base and a magnet's far end that may be hidden, m, for the magnet to count as
    /// seen.
    pub unseen_max: f64,
    /// Largest standard deviation of a magnet's tangent, rad, as estimated from points and noise, for the
    /// magnet to count as seen.
    pub tangent_deviation_max: f64,
    /// Least share of the points that lies on the surface found, 0 to 1.
    pub inlier_share_min: f64,
    /// Most iterations on all points, growth from the base not counted.
    pub iterations_max: usize,
}

impl CloudSettings {
    /// Settings for a manipulator seen with `noise` (m) by `viewers` (m, world). The rest is for a soft rod
    /// that is bent by its magnets: a turn of 140 degrees along the rod as the standard deviation of the
    /// curvature, twice the weight of the heaviest magnet as that of the force on one (what bends the rod so
    /// much, when none has weight), a quarter of the rod hidden in one stretch at most, tangents to 2.5
    /// degrees, half the points on the surface.
    #[must_use]
    pub fn new(
        kind: CentrelineKind,
        manipulator: &ManipulatorDescription,
        noise: f64,
        viewers: &[[f64; 3]],
    ) -> Self {
        let length = pieces(manipulator).last().map_or(0.0, Piece::end);
        let curvature = 140.0_f64.to_radians() / length;
        let (mut heaviest, mut stiffest) = (0.0_f64, 0.0_f64);
        for part in &manipulator.parts {
            match part {
                PartDescription::Section(section) => stiffest = stiffest.max(section.bending_stiffness),
                PartDescription::Magnet(magnet) => heaviest = heaviest.max(magnet.mass),
            }
        }
        Self {
            kind,
            capacity: CAPACITY,
            noise,
            viewers: viewers.to_vec(),
            curvature,
            force: if heaviest > 0.0 { 2.0 * GRAVITY * heaviest } else { stiffest * curvature / length },
            unseen_max: length / 4.0,
            tangent_deviation_max: 2.5_f64.to_radians(),
            inlier_share_min: 0.5,
            iterations_max: 30,
        }
    }
}

/// Why a reconstruction cannot be set up.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The manipulator has no extent.
    #[error("the manipulator has no length")]
    NoLength,
    /// A piece without thickness has no surface to see.
    #[error("part {part} has radius {radius} m: must be finite and > 0")]
    Radius {
        /// Index of the part.
        part: usize,
        /// Its radius, m.
        radius: f64,
    },
    /// Nothing bends.
    #[error("the manipulator has no flexible section")]
    Rigid,
    /// The degree of the centreline.
    #[error("degree {actual} of the centreline: must be from {least} to {most}")]
    Degree {
        /// As set.
        actual: usize,
        /// Least that is supported.
        least: usize,
        /// Most that is supported.
        most: usize,
    },
    /// A number out of its range.
    #[error("{what} = {actual}: must be {expected}")]
    Value {
        /// Which setting.
        what: &'static str,
        /// As set.
        actual: f64,
        /// What would be right.
        expected: &'static str,
    },
}

impl CloudSettings {
    /// # Errors
    /// The first setting that is out of its range.
    pub(super) fn check(&self) -> Result<(), SettingsError> {
        let (actual, least, most) = match self.kind {
            CentrelineKind::Polynomial { degree } => (degree, 3, 12),
            CentrelineKind::Curvature { degree } => (degree, 0, 6),
        };
        if actual < least || actual > most {
            return Err(SettingsError::Degree { actual, least, most });
        }
        let positive = |what, actual: f64| {
            let expected = "finite and > 0";
            if actual.is_finite() && actual > 0.0 {
                Ok(())
            } else {
                Err(SettingsError::Value { what, actual, expected })
            }
        };
        positive("noise", self.noise)?;
        positive("curvature", self.curvature)?;
        positive("force", self.force)?;
        positive("unseen_max", self.unseen_max)?;
        positive("tangent_deviation_max", self.tangent_deviation_max)?;
        positive("iterations_max", self.iterations_max as f64)?;
        positive("capacity", self.capacity as f64)?;
        let share = self.inlier_share_min;
        if !(0.0..=1.0).contains(&share) {
            let expected = "from 0 to 1";
            return Err(SettingsError::Value { what: "inlier_share_min", actual: share, expected });
        }
        for viewer in self.viewers.iter().flatten() {
            if !viewer.is_finite() {
                return Err(SettingsError::Value { what: "viewers", actual: *viewer, expected: "finite" });
            }
        }
        Ok(())
    }
}
