//! What the points say about the centreline: feet, residuals, weights, gathered a station.
//!
//! | symbol | meaning |
//! |---|---|
//! | `x` | a point |
//! | `P`, `T`, `r` | centreline, tangent and radius at the station nearest to its foot |
//! | `q`, `n` | offset of `x` from the centreline across the tangent; `q / abs(q)` |
//! | `v` | unit direction towards the middle of the viewers, across the tangent |
//! | `sigma` | noise of a point |
//! | `w(e)` | Tukey's biweight, `(1 - (e / g)^2)^2` within the gate `g`, 0 beyond |
//!
//! ```text
//! e = |q| - r - sigma^2 / (2 r)      residual of the surface, row -n . dP       (1)
//! e = q - r v                        residual of the axis, rows -(1 - T T^T) dP (2)
//! ```
//!
//! (1) is exact: the part seen of a round rod is a strip, and its distance from the axis, not its middle,
//! tells where the axis is. The last term is the mean of `|q|` beyond `r` that noise across the surface
//! makes. (2) takes every point for the one nearest to the viewers. That is off by up to the radius, but
//! draws the centreline in from afar, and to the far side of the strip; it serves until (1) can take over.
//! Points of which `n` faces away from the viewers count in neither.
//!
//! All points of one station share its derivatives: their weights are added up first, so that the cost of the
//! normal equations does not grow with the number of points.

use nalgebra::{Matrix3, Vector3};

use super::normal::NormalEquations;
use super::stations::{Centreline, Layout};

/// Gate over standard deviation at which Tukey's biweight is 95 % efficient for normal errors.
pub(super) const TUKEY: f64 = 4.685;
/// Every so many stations is tried in the search for a foot.
const COARSE: usize = 8;
/// Steps from station to station towards a foot.
const WALK_MAX: usize = 12;
/// A surface seen may face away from the viewers by this sine, 20 degrees: noise tilts what is seen at the
/// edge.
const AWAY: f64 = -0.35;

/// A point and the station nearest to its foot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub at: Vector3<f64>,
    pub station: usize,
    /// False when its foot lies beyond base or tip or next to a change of radius, or the surface there faces
    /// away.
    pub counts: bool,
}

/// How points come to their stations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Feet {
    /// Search along the whole rod.
    Search,
    /// Walk on from the last one.
    Walk,
    /// Stay, and stay in or out: nothing then steps to and fro between two iterations, which could go on for
    /// ever.
    Keep,
}

/// Which residual, and how strictly.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// The gate `g`, m.
    pub gate: f64,
    /// True for (2), false for (1).
    pub to_axis: bool,
    pub feet: Feet,
    /// Last station that is taken for found.
    pub horizon: usize,
    /// Every so many points.
    pub stride: usize,
}

/// Sums of one station.
#[derive(Debug, Clone, Copy)]
struct Sums {
    weight: Matrix3<f64>,
    pull: Vector3<f64>,
    inliers: usize,
}

const NOTHING: Sums = Sums {
    weight: Matrix3::new(0., 0., 0., 0., 0., 0., 0., 0., 0.),
    pull: Vector3::new(0., 0., 0.),
    inliers: 0,
};

/// Sums of every station and of all.
#[derive(Debug, Clone)]
pub(super) struct Gathered {
    sums: Vec<Sums>,
    /// `v`; zero when there are no viewers, or they look along the rod.
    towards: Vec<Vector3<f64>>,
    middle: Option<Vector3<f64>>,
    noise: f64,
    /// Points within the gate.
    pub inliers: usize,
    /// Their squared residuals, m^2.
    pub squares: f64,
}

impl Gathered {
    pub fn new(stations: usize, viewers: &[[f64; 3]], noise: f64) -> Self {
        let sum: Vector3<f64> = viewers.iter().map(|viewer| Vector3::from(*viewer)).sum();
        let middle = (!viewers.is_empty()).then(|| sum / viewers.len() as f64);
        Self {
            sums: vec![NOTHING; stations],
            towards: vec![Vector3::zeros(); stations],
            middle,
            noise,
            inliers: 0,
            squares: 0.0,
        }
    }

    /// Points within the gate that have their feet next to a station.
    pub fn inliers_at(&self, station: usize) -> usize {
        self.sums[station].inliers
    }

    /// Gathers what `points` say of a centreline.
    pub fn gather(&mut self, points: &mut [Seen], layout: &Layout, centreline: &Centreline, view: &View) {
        self.sums.fill(NOTHING);
        (self.inliers, self.squares) = (0, 0.0);
        if view.feet != Feet::Keep {
            self.face_viewers(centreline);
        }
        for point in points.iter_mut().step_by(view.stride) {
            if view.feet == Feet::Search {
                point.station = nearest_coarse(&point.at, centreline, view.horizon);
            }
            if view.feet != Feet::Keep {
                point.station = walk(point, layout, centreline, view.horizon);
                point.counts = self.may_count(point, layout, centreline);
            }
            if point.counts {
                self.add(point, layout, centreline, view);
            }
        }
    }

    /// Adds the residuals gathered at a station, each with the inverse variance that belongs to the gate.
    pub fn add_to(
        &self,
        equations: &mut NormalEquations,
        station: usize,
        centreline: &Centreline,
        gate: f64,
    ) {
        let sums = &self.sums[station];
        if sums.inliers > 0 {
            let inverse_variance = (TUKEY / gate).powi(2);
            let (weight, pull) = (sums.weight * inverse_variance, sums.pull * inverse_variance);
            equations.add_displacement(centreline.shifts(station), &weight, &pull);
        }
    }

    fn face_viewers(&mut self, centreline: &Centreline) {
        let Some(middle) = self.middle else { return };
        let places = centreline.position.iter().zip(&centreline.tangent);
        for (towards, (position, tangent)) in self.towards.iter_mut().zip(places) {
            let direction = middle - position;
            let across = direction - tangent * tangent.dot(&direction);
            let squared = across.norm_squared();
            let is_sideways = squared > 1e-6 * direction.norm_squared();
            *towards = if is_sideways { across / squared.sqrt() } else { Vector3::zeros() };
        }
    }

    fn may_count(&self, point: &Seen, layout: &Layout, centreline: &Centreline) -> bool {
        let index = point.station;
        let tangent = &centreline.tangent[index];
        let offset = point.at - centreline.position[index];
        let along = tangent.dot(&offset);
        let before = if index == 0 { 0.0 } else { layout.spans[index - 1].length };
        let after = layout.spans.get(index).map_or(0.0, |span| span.length);
        let across = offset - tangent * along;
        let faces = across.dot(&self.towards[index]) >= AWAY * across.norm();
        // Beyond base or tip, or the walk did not end.
        layout.stations[index].is_usable && faces && along >= -before && along <= after
    }

    fn add(&mut self, point: &Seen, layout: &Layout, centreline: &Centreline, view: &View) {
        let index = point.station;
        let radius = layout.stations[index].radius;
        let tangent = &centreline.tangent[index];
        let offset = point.at - centreline.position[index];
        let across = offset - tangent * tangent.dot(&offset); // q
        let distance = across.norm();
        if distance < 1e-9 || distance > view.gate + 2.0 * radius {
            return;
        }
        let sums = &mut self.sums[index];
        let squared = if view.to_axis {
            let residual = across - self.towards[index] * radius; // (2)
            let squared = residual.norm_squared();
            let Some(weight) = tukey(squared, view.gate) else { return };
            sums.weight += (Matrix3::identity() - tangent * tangent.transpose()) * weight;
            sums.pull += residual * weight;
            squared
        } else {
            let residual = distance - radius - self.noise.powi(2) / (2.0 * radius); // (1)
            let Some(weight) = tukey(residual * residual, view.gate) else { return };
            let normal = across / distance;
            let scaled = normal * weight;
            sums.weight += scaled * normal.transpose();
            sums.pull += scaled * residual;
            residual * residual
        };
        sums.inliers += 1;
        self.inliers += 1;
        self.squares += squared;
    }
}

/// `w(e)` for `e^2`; `None` beyond the gate.
fn tukey(squared: f64, gate: f64) -> Option<f64> {
    let share = squared / (gate * gate);
    (share < 1.0).then(|| (1.0 - share).powi(2))
}

/// The nearest of every [`COARSE`]th station up to the horizon, and the horizon.
fn nearest_coarse(at: &Vector3<f64>, centreline: &Centreline, horizon: usize) -> usize {
    let mut nearest = (horizon, (at - centreline.position[horizon]).norm_squared());
    for index in (0..horizon).step_by(COARSE) {
        let squared = (at - centreline.position[index]).norm_squared();
        if squared < nearest.1 {
            nearest = (index, squared);
        }
    }
    nearest.0
}

/// Walks from station to station to the one nearest to the foot.
fn walk(point: &Seen, layout: &Layout, centreline: &Centreline, horizon: usize) -> usize {
    let mut index = point.station.min(horizon);
    for _ in 0..WALK_MAX {
        let along = centreline.tangent[index].dot(&(point.at - centreline.position[index]));
        if along > 0.0 && index < horizon && along > 0.5 * layout.spans[index].length {
            index = index.saturating_add(steps(along, layout.spans[index].length)).min(horizon);
        } else if along < 0.0 && index > 0 && -along > 0.5 * layout.spans[index - 1].length {
            index = index.saturating_sub(steps(-along, layout.spans[index - 1].length));
        } else {
            break;
        }
    }
    index
}

/// Whole spans nearest to a distance, at least one; of a point at any finite place, so up to the greatest number.
fn steps(along: f64, span: f64) -> usize {
    ((along / span + 0.5) as usize).max(1)
}
