//! A walk and what it is told by: waypoints, bounds, obstacles, postures. Who walks is in `walker`.

use magsteer_hal::POSE_PARAMETERS_MAX;
use serde::Serialize;

use crate::control::reference::ReferenceTarget;
use crate::control::step::{Directions, Equilibrium};

/// A point on a way: where the magnets shall point and how the frames shall stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// Unit tangents, world.
    pub directions: Directions,
    /// Frame angles, rad.
    pub frame_angles: [f64; POSE_PARAMETERS_MAX],
}

impl Waypoint {
    /// The same as a target of the loop.
    #[must_use]
    pub fn target(&self) -> ReferenceTarget {
        ReferenceTarget { directions: self.directions, frame_angles: Some(self.frame_angles) }
    }
}

/// What a walk must not exceed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Margin of stability on the whole way.
    pub margin_min: f64,
    /// Error at the end, rad.
    pub tolerance: f64,
}

/// What ends a walk before its goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Obstacle {
    /// Currents at their limits do not turn the magnets farther.
    OutOfReach,
    /// The margin of stability falls below what is asked.
    NearSnapThrough,
    /// The branch of equilibria ends: the rod would snap through.
    BranchEnds,
    /// A magnet leaves the range of the field model.
    OutsideField,
}

impl Obstacle {
    /// As a word of data.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::OutOfReach => "out-of-reach",
            Self::NearSnapThrough => "near-snap-through",
            Self::BranchEnds => "branch-ends",
            Self::OutsideField => "outside-field",
        }
    }

    /// In words.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::OutOfReach => "the currents reach their limits",
            Self::NearSnapThrough => "the margin of stability becomes too small",
            Self::BranchEnds => "the equilibrium ends: the rod would snap through",
            Self::OutsideField => "a magnet leaves the range of the field model",
        }
    }
}

/// Why a walk ended before its goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Stop {
    /// By an obstacle, after a share of the way.
    Obstacle(Obstacle, f64),
    /// Because nobody cared for it any more.
    Dropped,
}

/// How a walk went: extremes over its stations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walked {
    /// Greatest magnitude of a current, A.
    pub current_max: f64,
    /// Least margin of stability.
    pub margin_min: f64,
    /// Greatest expected power (p1), A^2.
    pub expected_max: f64,
}

impl Walked {
    /// A walk without a station yet.
    pub const NOWHERE: Self = Self { current_max: 0.0, margin_min: f64::INFINITY, expected_max: 0.0 };

    /// Both, one after the other.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            current_max: self.current_max.max(next.current_max),
            margin_min: self.margin_min.min(next.margin_min),
            expected_max: self.expected_max.max(next.expected_max),
        }
    }
}

/// An equilibrium of the model under its actuation.
#[derive(Debug, Clone, Copy)]
pub struct Posture {
    /// Actuation, and what the clamp carries.
    pub equilibrium: Equilibrium,
    /// Tangents, world.
    pub directions: Directions,
    /// Margin of stability.
    pub margin: f64,
    /// Expected power (p1), A^2.
    pub expected: f64,
    /// Ratio of the largest to the smallest singular value of the Jacobian in the currents.
    pub condition: f64,
}

/// A walk under way, for a [`super::Walker`] to advance.
#[derive(Debug, Clone, Copy)]
pub struct Walk {
    pub(super) from: Waypoint,
    pub(super) goal: Waypoint,
    pub(super) bounds: Bounds,
    pub(super) stations: u32,
    /// The station that is walked to, from 1.
    pub(super) station: u32,
    /// Its directions.
    pub(super) there: Directions,
    pub(super) effort: Effort,
    pub(super) walked: Walked,
}

/// What one station has cost so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    pub(super) arrived: bool,
    /// Calls of the model for the present actuation.
    pub(super) follows: u32,
    pub(super) allocations: u32,
    /// Greatest change of a current in the last allocation, A.
    pub(super) change: f64,
}

impl Effort {
    pub(super) const NONE: Self = Self { arrived: false, follows: 0, allocations: 0, change: f64::INFINITY };
    pub(super) const ARRIVED: Self = Self { arrived: true, ..Self::NONE };
}

impl Walk {
    /// Share of the way at the station that is walked to.
    #[must_use]
    pub fn share(&self) -> f64 {
        f64::from(self.station) / f64::from(self.stations)
    }

    /// True between two stations' ends: the last step reached one.
    pub(super) const fn is_at_station(&self) -> bool {
        self.effort.arrived && self.station > 0
    }

    /// Extremes over the stations so far.
    #[must_use]
    pub const fn walked(&self) -> Walked {
        self.walked
    }
}

/// Where a step has brought a walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Advance {
    /// On the way.
    Walking,
    /// At its goal.
    Arrived,
    /// Nowhere further.
    Ended(Obstacle),
}
