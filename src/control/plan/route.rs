//! Routes: the ways on which a target is tried with one frame setting.

use super::walk::Waypoint;
use crate::control::step::Directions;

/// In which order magnets move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Route {
    /// All together.
    Together,
    /// One magnet alone first, then the rest.
    First(usize),
}

impl Route {
    /// Routes in the order in which they are tried: a group only when none of the one before it arrived.
    pub(super) fn groups(magnets: usize) -> Vec<Vec<Self>> {
        let mut groups = vec![vec![Self::Together]];
        if magnets > 1 {
            groups.push((0..magnets).map(Self::First).collect());
        }
        groups
    }

    /// Waypoints from `from` to `to`, the last one `to`.
    pub(super) fn waypoints(self, from: &Directions, to: &Waypoint) -> Vec<Waypoint> {
        match self {
            Self::Together => vec![*to],
            Self::First(magnet) => {
                let mut directions = *from;
                directions[magnet] = to.directions[magnet];
                vec![Waypoint { directions, ..*to }, *to]
            }
        }
    }
}
