//! The rod's shape from points on its surface, by robust least squares on the centreline.
//!
//! 1. **Load**: points that are not finite are left out, and of a cloud beyond the capacity every n-th is
//!    taken.
//! 2. **Begin**: from the shape found before, or, without one or when that does not show every magnet, *grow*
//!    from the base: the part of the rod believed known is lengthened in [`GROWTH_STAGES`] stages, each time
//!    with those points (some hundreds, evenly chosen) that have their feet on it. What that misses is tried
//!    once more with more points and a wider gate.
//! 3. **Draw in**: a few iterations on some hundreds of points with a wide gate, towards the axis as the
//!    viewers see it.
//! 4. **Refine**: Gauss-Newton on the distance from the surface, Tukey's weights, until steps are small
//!    against what noise leaves uncertain.
//! 5. **Judge**: share of the points on the surface found; for each magnet the longest stretch without points
//!    on the way, and the standard deviation of its tangent.
//!
//! The rod's parameters are those of the model; what is expected of them beforehand enters as further rows,
//! so that a hidden stretch is bridged by the smoothest curve and not by whatever the polynomial does.

use nalgebra::Vector3;

use super::accumulate::{Feet, Gathered, Seen, TUKEY, View};
use super::frame::Frame;
use super::model::Model;
use super::normal::NormalEquations;
use super::orientation::AxisAngle;
use super::outcome::{MagnetEstimate, Quality, Reconstruction, Unreconstructed};
use super::outline::pieces;
use super::settings::{CloudSettings, SettingsError};
use super::stations::{Centreline, Layout};
use crate::description::ManipulatorDescription;
use crate::message::{MAGNETS_MAX, MagnetPose};

/// Stages of growth from the base to the tip.
const GROWTH_STAGES: usize = 10;
/// Most iterations of each stage.
const GROWTH_ITERATIONS: usize = 6;
/// A stage ends when a step is less than this many of its own standard deviations.
const GROWN: f64 = 1.0;
/// The second attempt's boldness, should the first fail.
const BOLDER: usize = 3;
/// Points that growing and drawing in make do with, about.
const FEW: usize = 300;
/// Least iterations that draw the centreline in before the gate narrows.
const DRAWING_ITERATIONS: usize = 2;
/// By how much the gate narrows at a time.
const NARROWING: f64 = 0.5;
/// The gate narrows when a step is less than this many of its own standard deviations.
const DRAWN: f64 = 4.0;
/// The iteration rests when a step is less than this share of its own standard deviation.
const REST: f64 = 0.05;
/// Below this share, or after half the iterations allowed, points keep their stations.
const NEAR: f64 = 1.0;
/// Least number of points.
const POINTS_MIN: usize = 20;
/// Stretches along the rod in which points are counted to tell seen from hidden.
const BINS: usize = 40;
/// A stretch is seen when it has this share of the points of an average one.
const SEEN_SHARE: f64 = 0.2;

/// Reconstructs one rod from cloud after cloud.
#[derive(Debug, Clone)]
pub struct CloudShape {
    settings: CloudSettings,
    layout: Layout,
    model: Model,
    centreline: Centreline,
    parameters: Vec<f64>,
    step: Vec<f64>,
    kept: Vec<f64>,
    equations: NormalEquations,
    gathered: Gathered,
    points: Vec<Seen>,
    /// The stretch that each station is in.
    bins: Vec<usize>,
    is_seen: [bool; BINS],
    is_known: bool,
}

impl CloudShape {
    /// A reconstruction of a manipulator; allocates all that it will ever need.
    ///
    /// # Errors
    /// A setting out of its range, or a manipulator without flexible section, length or thickness.
    pub fn new(manipulator: &ManipulatorDescription, settings: CloudSettings) -> Result<Self, SettingsError> {
        settings.check()?;
        let pieces = pieces(manipulator);
        for (part, piece) in pieces.iter().enumerate() {
            if !(piece.radius.is_finite() && piece.radius > 0.0) {
                return Err(SettingsError::Radius { part, radius: piece.radius });
            }
            if !(piece.length.is_finite() && piece.length > 0.0) {
                return Err(SettingsError::NoLength);
            }
        }
        if pieces.is_empty() {
            return Err(SettingsError::NoLength);
        }
        if !pieces.iter().any(|piece| piece.is_flexible) {
            return Err(SettingsError::Rigid);
        }
        let layout = Layout::new(pieces, settings.noise);
        let mut model = Model::new(Frame::of_base(manipulator), &layout, &settings);
        let (stations, parameters) = (layout.stations.len(), model.parameter_count());
        let mut centreline = Centreline::new(stations, parameters);
        model.place(&vec![0.0; parameters], &layout, &mut centreline);
        Ok(Self {
            equations: NormalEquations::new(parameters),
            gathered: Gathered::new(stations, &settings.viewers, settings.noise),
            points: Vec::with_capacity(settings.capacity),
            parameters: vec![0.0; parameters],
            step: vec![0.0; parameters],
            kept: vec![0.0; parameters],
            bins: bins(&layout),
            is_seen: [false; BINS],
            is_known: false,
            settings,
            layout,
            model,
            centreline,
        })
    }

    /// Forgets the shape found before: the next cloud is tried from the base.
    pub fn forget(&mut self) {
        self.is_known = false;
    }

    /// Finds the shape of the rod whose surface `points` (m, world) lie on, but for outliers. The points may
    /// come in any order.
    ///
    /// # Errors
    /// When there are too few points, too few on any one shape, or the iteration does not come to rest.
    pub fn reconstruct(&mut self, points: &[[f64; 3]]) -> Result<Reconstruction, Unreconstructed> {
        let counted = self.load(points);
        if self.points.len() < POINTS_MIN {
            self.is_known = false;
            return Err(Unreconstructed::TooFewPoints { points: self.points.len(), needed: POINTS_MIN });
        }
        if self.is_known {
            let found = self.refine(Quality { is_warm: true, ..counted });
            if is_whole(&found) {
                return found;
            }
        }
        let found = self.reconstruct_from_base(counted);
        self.is_known = is_whole(&found);
        found
    }

    /// Tries from the base, and more boldly when that misses something; the better one counts.
    fn reconstruct_from_base(&mut self, counted: Quality) -> Result<Reconstruction, Unreconstructed> {
        self.grow(1);
        let first = self.refine(counted);
        if is_whole(&first) {
            return first;
        }
        self.kept.copy_from_slice(&self.parameters);
        self.grow(BOLDER);
        let second = self.refine(counted);
        if inlier_share(&second) >= inlier_share(&first) {
            return second;
        }
        self.parameters.copy_from_slice(&self.kept);
        self.model.place(&self.parameters, &self.layout, &mut self.centreline);
        first
    }

    /// The centreline as found last: arc length, position and unit tangent at every station, m, world.
    pub fn centreline(&self) -> impl Iterator<Item = (f64, [f64; 3], [f64; 3])> {
        let places = self.centreline.position.iter().zip(&self.centreline.tangent);
        let stations = self.layout.stations.iter().zip(places);
        stations.map(|(station, (position, tangent))| (station.s, (*position).into(), (*tangent).into()))
    }

    /// Takes over the usable points.
    fn load(&mut self, points: &[[f64; 3]]) -> Quality {
        let capacity = self.settings.capacity;
        let taken = points.len().min(capacity);
        self.points.clear();
        for index in 0..taken {
            // Evenly over a larger cloud.
            let point = &points[(index as u128 * points.len() as u128 / taken as u128) as usize];
            if point.iter().all(|coordinate| coordinate.is_finite()) {
                self.points.push(Seen { at: Vector3::from(*point), station: 0, counts: false });
            }
        }
        Quality {
            points: self.points.len(),
            points_not_finite: taken - self.points.len(),
            points_over_capacity: points.len() - taken,
            ..Quality::default()
        }
    }

    /// The gate within which the final iterations count a point.
    fn narrow(&self) -> f64 {
        TUKEY * self.settings.noise
    }

    /// The gate within which a point draws the centreline in: twice the greatest radius more.
    fn wide(&self) -> f64 {
        let radius = self.layout.pieces.iter().map(|piece| piece.radius).fold(0.0, f64::max);
        self.narrow() + 2.0 * radius
    }

    /// Finds a first shape, from the base onwards, on `boldness` times as many points and with a gate wider
    /// by its square root.
    fn grow(&mut self, boldness: usize) {
        self.parameters.fill(0.0);
        self.model.place(&self.parameters, &self.layout, &mut self.centreline);
        let last = self.layout.stations.len() - 1;
        let view = View {
            gate: self.wide() * (boldness as f64).sqrt(),
            to_axis: !self.settings.viewers.is_empty(),
            feet: Feet::Search,
            horizon: last,
            stride: self.points.len().div_ceil(FEW * boldness),
        };
        for stage in 1..=GROWTH_STAGES {
            let horizon = last * stage / GROWTH_STAGES;
            let mut feet = Feet::Search;
            for _ in 0..GROWTH_ITERATIONS {
                // A step that fails leaves all as it is; the refinement judges the outcome.
                let step = self.iterate(&View { horizon, feet, ..view }, 1.0);
                if step.is_none_or(|step| step < GROWN) {
                    break;
                }
                feet = Feet::Walk;
            }
        }
    }

    /// Iterates on all points from the present shape and judges where that leads.
    fn refine(&mut self, counted: Quality) -> Result<Reconstruction, Unreconstructed> {
        let mut quality = counted;
        let (narrow, wide) = (self.narrow(), self.wide());
        let horizon = self.layout.stations.len() - 1;
        let has_viewers = !self.settings.viewers.is_empty();
        let stride = self.points.len().div_ceil(FEW);
        let mut view = View { gate: wide, to_axis: has_viewers, feet: Feet::Search, horizon, stride };
        let (mut rests, mut is_kept) = (false, false);
        while quality.iterations < self.settings.iterations_max && !rests {
            let is_late = 2 * quality.iterations >= self.settings.iterations_max;
            // What has not come to rest by then overshoots.
            let Some(step) = self.iterate(&view, if is_late { 0.5 } else { 1.0 }) else { break };
            quality.iterations += 1;
            let is_final = view.gate <= narrow;
            rests = is_final && step < REST;
            is_kept |= is_final && (step < NEAR || is_late);
            view.feet = if is_kept { Feet::Keep } else { Feet::Walk };
            if quality.iterations >= DRAWING_ITERATIONS && (step < DRAWN || is_late) {
                // The points left out so far have no feet yet.
                let feet = if view.stride > 1 { Feet::Search } else { view.feet };
                let gate = narrow.max(NARROWING * view.gate);
                view = View { gate, to_axis: false, feet, stride: 1, ..view };
            }
        }
        quality.inlier_share = self.gathered.inliers as f64 / self.points.len() as f64;
        quality.residual_rms = (self.gathered.squares / self.gathered.inliers.max(1) as f64).sqrt();
        if !rests {
            return Err(Unreconstructed::NotConverged { quality });
        }
        let needed = self.settings.inlier_share_min;
        if quality.inlier_share < needed {
            return Err(Unreconstructed::TooFewInliers { quality, needed });
        }
        Ok(self.report(quality))
    }

    /// Takes `share` of one Gauss-Newton step; returns the whole step's size in standard deviations,
    /// `sqrt(dx^T H dx)`, or `None` when there is no step to take.
    fn iterate(&mut self, view: &View, share: f64) -> Option<f64> {
        self.gathered.gather(&mut self.points, &self.layout, &self.centreline, view);
        if view.gate > self.narrow() {
            self.is_seen.fill(true);
        } else if view.feet != Feet::Keep {
            self.count_seen();
        }
        self.equations.clear();
        for (station, bin) in self.bins.iter().enumerate() {
            if self.is_seen[*bin] {
                self.gathered.add_to(&mut self.equations, station, &self.centreline, view.gate);
            }
        }
        self.model.add_expectation(&self.parameters, &self.centreline, &mut self.equations);
        if !self.equations.factorise() {
            return None;
        }
        self.equations.solve(&mut self.step);
        if self.step.iter().any(|change| !change.is_finite()) {
            return None;
        }
        for (parameter, change) in self.parameters.iter_mut().zip(&self.step) {
            *parameter += share * change;
        }
        self.model.place(&self.parameters, &self.layout, &mut self.centreline);
        Some(self.equations.decrement(&self.step).max(0.0).sqrt())
    }

    /// The magnets as they follow from the centreline.
    fn report(&mut self, quality: Quality) -> Reconstruction {
        let magnet_count = self.layout.magnets.len().min(MAGNETS_MAX);
        let mut magnets = [MagnetEstimate::default(); MAGNETS_MAX];
        for (index, magnet) in magnets.iter_mut().take(magnet_count).enumerate() {
            let station = self.layout.magnets[index];
            let unseen = self.longest_unseen(self.layout.magnet_ends[index]);
            let tangent_deviation = self.tangent_deviation(station, &quality);
            let valid = unseen <= self.settings.unseen_max
                && tangent_deviation <= self.settings.tangent_deviation_max;
            let tangent = self.centreline.tangent[station];
            let pose = MagnetPose {
                position_m: self.centreline.position[station].into(),
                orientation_xyzw: AxisAngle::of_tangent(tangent.into(), [0.0, 1.0, 0.0]).orientation_xyzw(),
                valid: u32::from(valid),
                reserved: 0,
            };
            *magnet = MagnetEstimate { pose, tangent_deviation, unseen };
        }
        Reconstruction { magnet_count, magnets, quality }
    }

    /// Square root of the variance of the tangent, summed over both directions in which it can turn.
    fn tangent_deviation(&mut self, station: usize, quality: &Quality) -> f64 {
        let turns = self.centreline.turns(station);
        let variance: f64 =
            (0..3).map(|axis| self.equations.variance(turns.iter().map(|turn| turn[axis]))).sum();
        // Should the points scatter more than stated, so does the tangent.
        variance.sqrt() * (quality.residual_rms / self.settings.noise).max(1.0)
    }

    /// Tells seen stretches from hidden ones by the inliers in them. A few points where dozens are to be
    /// expected are outliers.
    fn count_seen(&mut self) {
        let mut counts = [0_usize; BINS];
        for (station, bin) in self.bins.iter().enumerate() {
            counts[*bin] += self.gathered.inliers_at(station);
        }
        let least = SEEN_SHARE * self.gathered.inliers as f64 / BINS as f64;
        for (is_seen, count) in self.is_seen.iter_mut().zip(counts) {
            *is_seen = count > 0 && count as f64 >= least;
        }
    }

    /// Longest stretch without points up to a station, m.
    fn longest_unseen(&self, station: usize) -> f64 {
        let bin_length = self.layout.length() / BINS as f64;
        let until = (self.layout.stations[station].s / bin_length).round() as usize;
        let (mut run, mut longest) = (0_usize, 0);
        for is_seen in self.is_seen.iter().take(until) {
            run = if *is_seen { 0 } else { run + 1 };
            longest = longest.max(run);
        }
        longest as f64 * bin_length
    }
}

/// True when every magnet was seen.
fn is_whole(found: &Result<Reconstruction, Unreconstructed>) -> bool {
    found.as_ref().is_ok_and(|found| found.magnets().iter().all(|magnet| magnet.pose.valid == 1))
}

/// That of a shape found; of none, less than any.
fn inlier_share(found: &Result<Reconstruction, Unreconstructed>) -> f64 {
    found.as_ref().map_or(-1.0, |found| found.quality.inlier_share)
}

/// The bin of each station.
fn bins(layout: &Layout) -> Vec<usize> {
    let bin = |s: f64| (s / layout.length() * BINS as f64) as usize;
    layout.stations.iter().map(|station| bin(station.s).min(BINS - 1)).collect()
}
