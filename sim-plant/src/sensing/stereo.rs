//! A stereo camera: points on the rod's surface, and the shape reconstructed from them.
//!
//! | symbol | meaning |
//! |---|---|
//! | `P(s)`, `T(s)`, `r(s)` | true centreline, its tangent, radius of the surface about it |
//! | `n`, `v_k` | outward normal of the surface at a point, viewing point of camera `k` |
//! | `u` | unit direction from the point to the middle of the cameras |
//! | `a`, `d` | noise across and along the line of sight, m |
//!
//! ```text
//! x = P(s) + r(s) n + a g + (d - a)(g . u) u,   g standard normal        (1)
//! seen when n . (v_k - x) > 0 for every camera k, and s outside the hidden stretch
//! ```
//!
//! `(s, n)` is uniform over the area of the surface. A camera delivers so many points an exposure: as many
//! are drawn that both sides see (fewer when the rod points at the cameras); those in the hidden stretch are
//! then lost, so that a hidden rod gives fewer. Outliers are uniform in the rod's bounding box and a margin
//! about it; they replace the stated share of the points.
//!
//! Noise here is what segmentation and matching leave over; where they fail altogether it is an outlier or
//! hidden. Left out: lens distortion, an error of calibration common to all points, one part of the rod
//! hiding another, the flat faces of magnets and tip.

use magsteer_hal::PoseMessage;
use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use magsteer_hal::shape::{CentrelineKind, CloudSettings, CloudShape, SettingsError};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::fibre::length;
use super::tracker::unseen_message;
use crate::rod::{Pose, Rod};

/// Stream of the plant's seed from which the camera draws.
const RANDOM_STREAM: u64 = 2;
/// Places along the rod from which points are drawn: a quarter of a millimetre apart on a rod of 60 mm, so
/// that the centreline leaves its tangent by less than 1 um.
const PLACES: usize = 240;
/// Draws spent for one point, of which about three are needed when the rod lies across the line of sight; a
/// point that none finds is missing.
const DRAWS_MAX: usize = 20;

/// The stretch of the rod that something hides from the cameras, as shares of its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Occlusion {
    /// Somewhere else in every exposure.
    Random {
        /// Its length.
        share: f64,
    },
    /// Always there.
    Fixed {
        /// Its length.
        share: f64,
        /// Where it begins.
        from: f64,
    },
}

/// What a stereo camera is like.
#[derive(Debug, Clone, PartialEq)]
pub struct StereoCharacter {
    /// Positions of the cameras, m, world.
    pub viewers: Vec<[f64; 3]>,
    /// Points an exposure, outliers included.
    pub points: usize,
    /// `a`, m.
    pub noise_across: f64,
    /// `d`, m.
    pub noise_depth: f64,
    /// Share of the points that are outliers.
    pub outlier_share: f64,
    /// Margin of the outliers' box about the rod, m.
    pub outlier_margin: f64,
    /// What is hidden.
    pub occlusion: Occlusion,
    /// How the reconstruction parametrises the centreline.
    pub centreline: CentrelineKind,
    /// Largest standard deviation of a magnet's tangent, rad, for the magnet to count as seen.
    pub tangent_deviation_max: f64,
}

/// A stereo camera at work.
#[derive(Debug, Clone)]
pub(super) struct Stereo {
    character: StereoCharacter,
    random: ChaCha8Rng,
    length: f64,
    radius_max: f64,
    viewers: Vec<Vector3<f64>>,
    middle: Vector3<f64>,
    radii: Vec<f64>,
    poses: Vec<Pose>,
    cloud: Vec<[f64; 3]>,
    shape: CloudShape,
}

impl Stereo {
    /// # Errors
    /// When the reconstruction cannot be set up for this manipulator.
    pub fn new(
        character: &StereoCharacter,
        manipulator: &ManipulatorDescription,
        seed: u64,
    ) -> Result<Self, SettingsError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RANDOM_STREAM);
        let noise = character.noise_across.max(character.noise_depth);
        let viewers: Vec<Vector3<f64>> = character.viewers.iter().map(|at| Vector3::from(*at)).collect();
        let settings = CloudSettings {
            capacity: character.points,
            tangent_deviation_max: character.tangent_deviation_max,
            ..CloudSettings::new(character.centreline, manipulator, noise, &character.viewers)
        };
        let length = length(manipulator);
        let radii: Vec<f64> =
            (0..PLACES).map(|place| radius_at(manipulator, place_at(place, length))).collect();
        Ok(Self {
            shape: CloudShape::new(manipulator, settings)?,
            random,
            length,
            radius_max: radii.iter().copied().fold(0.0, f64::max),
            middle: viewers.iter().sum::<Vector3<f64>>() / viewers.len().max(1) as f64,
            viewers,
            radii,
            poses: Vec::with_capacity(PLACES),
            cloud: Vec::with_capacity(character.points),
            character: character.clone(),
        })
    }

    /// One exposure; `None` when it is lost. Magnets that the reconstruction did not find are not valid.
    pub fn see(&mut self, rod: &Rod, dropout_probability: f64) -> Option<PoseMessage> {
        let lost = self.random.random_bool(dropout_probability);
        self.fill_cloud(rod);
        if lost {
            return None;
        }
        match self.shape.reconstruct(&self.cloud) {
            Ok(found) => Some(found.message()),
            Err(_) => Some(unseen_message(rod.magnet_count())),
        }
    }

    fn fill_cloud(&mut self, rod: &Rod) {
        self.poses.clear();
        let length = self.length;
        self.poses.extend((0..PLACES).map(|place| rod.centreline_pose(place_at(place, length))));
        let hidden = match self.character.occlusion {
            Occlusion::Random { share } => {
                let from = self.random.random::<f64>() * (1.0 - share);
                (from, from + share)
            }
            Occlusion::Fixed { share, from } => (from, from + share),
        };
        self.cloud.clear();
        let points = self.character.points;
        let outliers = (self.character.outlier_share * points as f64).round() as usize;
        for _ in outliers..points {
            let Some((share, point)) = self.surface_point() else { continue };
            if share < hidden.0 || share >= hidden.1 {
                self.cloud.push(point.into());
            }
        }
        let margin = Vector3::repeat(self.character.outlier_margin);
        let positions = self.poses.iter().map(|pose| pose.position);
        let low = positions.clone().reduce(|low, at| low.inf(&at)).unwrap_or_default() - margin;
        let high = positions.reduce(|high, at| high.sup(&at)).unwrap_or_default() + margin;
        for _ in 0..outliers {
            let share = Vector3::from([0; 3].map(|_| self.random.random::<f64>()));
            self.cloud.push((low + (high - low).component_mul(&share)).into());
        }
    }

    /// A point that every camera faces, with its share of the length; `None` when draws are spent.
    fn surface_point(&mut self) -> Option<(f64, Vector3<f64>)> {
        for _ in 0..DRAWS_MAX {
            let share: f64 = self.random.random();
            let angle = std::f64::consts::TAU * self.random.random::<f64>();
            let thickness: f64 = self.random.random::<f64>() * self.radius_max;
            let place = ((share * PLACES as f64) as usize).min(PLACES - 1);
            let (pose, radius) = (&self.poses[place], self.radii[place]);
            if thickness > radius {
                continue;
            }
            let (sine, cosine) = angle.sin_cos();
            let normal = pose.rotation * Vector3::new(cosine, sine, 0.0);
            let along = share * self.length - place_at(place, self.length);
            let surface = pose.along(along) + normal * radius;
            if self.viewers.iter().all(|viewer| normal.dot(&(viewer - surface)) > 0.0) {
                return Some((share, surface + self.noise(&surface)));
            }
        }
        None
    }

    fn noise(&mut self, surface: &Vector3<f64>) -> Vector3<f64> {
        let g = Vector3::from([0; 3].map(|_| StandardNormal.sample(&mut self.random)));
        let (across, depth) = (self.character.noise_across, self.character.noise_depth);
        let u = (self.middle - surface).try_normalize(0.0).unwrap_or_default();
        g * across + u * ((depth - across) * g.dot(&u)) // (1)
    }
}

/// Arc length in the middle of a place, m.
fn place_at(place: usize, length: f64) -> f64 {
    length * (place as f64 + 0.5) / PLACES as f64
}

/// m
fn radius_at(manipulator: &ManipulatorDescription, s: f64) -> f64 {
    let mut end = 0.0;
    let mut radius = 0.0;
    for part in &manipulator.parts {
        let (length, own) = match part {
            PartDescription::Section(section) => (section.length, section.radius),
            PartDescription::Magnet(magnet) => (magnet.length, magnet.radius),
        };
        (end, radius) = (end + length, own);
        if s < end {
            break;
        }
    }
    radius
}
