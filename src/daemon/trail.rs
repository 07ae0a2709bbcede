//! The way that the actuation came: what a retreat goes back along.
//!
//! A rod came along this way on one stable branch, so it goes back along it on the same; where the model is nearly singular that is a way
//! that asks nothing of it.
//!
//! Points are kept where currents or frames have changed, and at most one every [`SPACING`]; the oldest are forgotten. What is gone back
//! is forgotten too. What is absent: an allocation after construction.

use std::collections::VecDeque;

use magsteer_hal::Actuation;

/// Least time between two points, and the time in which a retreat goes from one to the next, s.
const SPACING: f64 = 0.01;
/// Points kept: 20 s of a way that changes all the time.
const POINTS_MAX: usize = 2_000;
/// Change of a current that makes a point, A: above what the noise of poses does to currents at rest.
const CHANGE_A: f64 = 0.05;
/// Change of a frame angle that makes a point, rad.
const CHANGE_RAD: f64 = 0.2_f64.to_radians();

/// Commands that were admitted while the loop steered, up to the present ones.
#[derive(Debug)]
pub(super) struct Trail {
    points: VecDeque<Actuation>,
    /// Since the newest point was kept, s.
    since: f64,
    /// Until the newest point is to be reached in a retreat, s.
    left: f64,
}

impl Trail {
    pub(super) fn new() -> Self {
        Self { points: VecDeque::with_capacity(POINTS_MAX), since: 0.0, left: SPACING }
    }

    /// True when there is nothing to go back along.
    pub(super) fn is_at_its_begin(&self) -> bool {
        self.points.is_empty()
    }

    /// A way begins at `admitted`.
    pub(super) fn begin(&mut self, admitted: &Actuation) {
        self.points.clear();
        self.keep(admitted);
    }

    /// The way led on to `admitted` within `period`, s.
    pub(super) fn lead_on(&mut self, admitted: &Actuation, period: f64) {
        self.since += period;
        let is_elsewhere = self.points.back().is_none_or(|last| has_changed(last, admitted));
        if self.since >= SPACING && is_elsewhere {
            self.keep(admitted);
        }
    }

    /// Where a retreat from `admitted` is after `period`, s; where it is already once there is nothing left.
    pub(super) fn back(&mut self, admitted: &Actuation, period: f64) -> Actuation {
        let mut present = *admitted;
        let mut period = period;
        while let Some(point) = self.points.back() {
            if period < self.left {
                let share = period / self.left;
                self.left -= period;
                return between(&present, point, share);
            }
            period -= self.left;
            (present, self.left) = (*point, SPACING);
            self.points.pop_back();
        }
        present
    }

    fn keep(&mut self, admitted: &Actuation) {
        if self.points.len() == POINTS_MAX {
            self.points.pop_front();
        }
        self.points.push_back(*admitted);
        (self.since, self.left) = (0.0, SPACING);
    }
}

fn has_changed(one: &Actuation, other: &Actuation) -> bool {
    let apart = |one: &[f64], other: &[f64], most: f64| {
        one.iter().zip(other).any(|(one, other)| (one - other).abs() >= most)
    };
    apart(&one.current_a, &other.current_a, CHANGE_A) || apart(&one.angle_rad, &other.angle_rad, CHANGE_RAD)
}

/// What lies at `share` of the way from one actuation to another.
fn between(one: &Actuation, other: &Actuation, share: f64) -> Actuation {
    let mut between = *one;
    let parameters = between.current_a.iter_mut().chain(&mut between.angle_rad);
    for (parameter, goal) in parameters.zip(other.current_a.iter().chain(&other.angle_rad)) {
        *parameter += (goal - *parameter) * share;
    }
    between
}

#[cfg(test)]
mod tests {
    use super::{Actuation, CHANGE_A, POINTS_MAX, SPACING, Trail};

    const PERIOD: f64 = 1e-3;

    fn at(current: f64, angle: f64) -> Actuation {
        let mut actuation = Actuation::default();
        (actuation.current_a[0], actuation.angle_rad[1]) = (current, angle);
        actuation
    }

    /// A trail from zero along `way`, a step a period.
    fn along(way: impl Iterator<Item = Actuation>) -> Trail {
        let mut trail = Trail::new();
        trail.begin(&Actuation::default());
        way.for_each(|admitted| trail.lead_on(&admitted, PERIOD));
        trail
    }

    /// Everything that a retreat from `last` goes through.
    fn retreat(trail: &mut Trail, last: Actuation, period: f64) -> Vec<Actuation> {
        let mut way = vec![last];
        while !trail.is_at_its_begin() {
            way.push(trail.back(&way[way.len() - 1], period));
            assert!(way.len() < 100_000, "does not end");
        }
        way
    }

    /// Goal: back along a bent way the actuation stays on it, at the pace at which it came, and ends where it began.
    #[test]
    fn a_retreat_goes_back_along_the_way_at_its_pace() {
        let corner = |step: u32| {
            let step = f64::from(step);
            at(0.02 * step.min(200.0), 1e-3 * (step - 200.0).max(0.0))
        };
        let mut trail = along((1..=500).map(corner));
        let way = retreat(&mut trail, corner(500), PERIOD);
        assert_eq!(way[way.len() - 1], Actuation::default());
        for point in &way {
            // One moves only while the other is at its end of the corner.
            let [current, angle] = [point.current_a[0], point.angle_rad[1]];
            assert!((current - 4.0).abs() < 0.2 || angle < 0.01, "{current} A, {angle} rad");
        }
        for pair in way.windows(2) {
            assert!((pair[1].current_a[0] - pair[0].current_a[0]).abs() < 0.021, "{pair:?}");
        }
        assert!((495..=515).contains(&way.len()), "{} cycles", way.len());
    }

    /// Goal: a slow loop goes back as fast as a quick one.
    #[test]
    fn a_period_may_be_longer_than_the_spacing() {
        let line = |step: u32| at(0.02 * f64::from(step), 0.0);
        let [quick, slow] = [PERIOD, 3.7 * SPACING].map(|period| {
            let mut trail = along((1..=500).map(line));
            (period * retreat(&mut trail, line(500), period).len() as f64, trail)
        });
        assert!((quick.0 - slow.0).abs() < 2.0 * 3.7 * SPACING, "{} s and {} s", quick.0, slow.0);
        assert_eq!(slow.1.points.capacity(), quick.1.points.capacity());
    }

    /// Goal: what trembles at rest is no way, and a way longer than is kept loses its begin and nothing else.
    #[test]
    fn the_newest_part_of_a_long_way_is_kept_and_rest_is_not() {
        let tremble = |step: u32| at(if step.is_multiple_of(2) { 0.9 * CHANGE_A } else { 0.0 }, 0.0);
        assert_eq!(along((0..5_000).map(tremble)).points.len(), 1);
        let line = |step: u32| at(0.01 * f64::from(step), 0.0);
        let steps = 50_000;
        let mut trail = along((1..=steps).map(line));
        let capacity = trail.points.capacity();
        assert_eq!(trail.points.len(), POINTS_MAX);
        let oldest = retreat(&mut trail, line(steps), PERIOD)[..].last().copied().expect("some");
        let expected = 0.01 * (f64::from(steps) - 10.0 * POINTS_MAX as f64);
        assert!((oldest.current_a[0] - expected).abs() < 0.2, "{}", oldest.current_a[0]);
        assert_eq!(trail.points.capacity(), capacity, "nothing was allocated");
    }
}
