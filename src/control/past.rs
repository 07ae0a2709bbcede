//! Directions remembered with their times, so that a late measurement meets what belongs to its moment.

use nalgebra::Vector3;

use super::step::Directions;

/// Remembered entries: at one a millisecond, half a second of the past at any rate.
const LENGTH: usize = 512;
/// Least time between two remembered entries, s.
const STEP: f64 = 1e-3;

/// A ring of directions; times count from the first.
#[derive(Debug, Clone)]
pub(super) struct Past {
    ring: Vec<Moment>,
    newest: usize,
    present: Moment,
    /// Before this all was as it was then.
    origin: Moment,
}

/// Directions at a time, s.
#[derive(Debug, Clone, Copy, Default)]
struct Moment {
    time: f64,
    directions: Directions,
}

impl Past {
    /// Nothing but zero vectors.
    pub(super) fn new() -> Self {
        let nothing = Moment::default();
        Self { ring: vec![nothing; LENGTH], newest: 0, present: nothing, origin: nothing }
    }

    /// Makes `directions` the present and all of the past.
    pub(super) fn fill(&mut self, directions: &Directions) {
        self.present.directions = *directions;
        self.origin = self.present;
        self.ring[self.newest] = self.present;
    }

    /// Goes on by `period` seconds to `directions`.
    pub(super) fn push(&mut self, directions: &Directions, period: f64) {
        self.present = Moment { time: self.present.time + period, directions: *directions };
        if self.present.time - self.ring[self.newest].time >= STEP {
            self.newest = (self.newest + 1) % LENGTH;
            self.ring[self.newest] = self.present;
        }
    }

    /// The directions of `age` seconds ago, unit, along the chord between those remembered; as far back as is
    /// remembered.
    pub(super) fn at(&self, age: f64) -> Directions {
        let wanted = self.present.time - age;
        let mut after = &self.present;
        for back in 0..LENGTH {
            let before = &self.ring[(self.newest + LENGTH - back) % LENGTH];
            if before.time <= self.origin.time {
                return between(&self.origin, after, wanted);
            }
            if before.time <= wanted {
                return between(before, after, wanted);
            }
            after = before;
        }
        after.directions
    }
}

fn between(before: &Moment, after: &Moment, time: f64) -> Directions {
    let span = after.time - before.time;
    let share = if span > 0.0 { ((time - before.time) / span).clamp(0.0, 1.0) } else { 1.0 };
    let mut found = Directions::default();
    for ((found, before), after) in found.iter_mut().zip(&before.directions).zip(&after.directions) {
        let (before, after) = (Vector3::from(*before), Vector3::from(*after));
        let chord = before + (after - before) * share;
        *found = chord.try_normalize(1e-6).unwrap_or(after).into();
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::angle_between;

    fn at(angle: f64) -> Directions {
        let mut directions = Directions::default();
        directions[1] = [angle.cos(), angle.sin(), 0.0];
        directions
    }

    fn angle_from(past: &Past, age: f64, angle: f64) -> f64 {
        angle_between(&Vector3::from(past.at(age)[1]), &Vector3::from(at(angle)[1]))
    }

    /// Goal: what was true at any moment within memory is found, whatever the rate; what never was stays
    /// zero.
    #[test]
    fn past_is_what_was_true_then() {
        for period in [1e-4, 1e-3, 1e-2] {
            let mut past = Past::new();
            past.fill(&at(0.0));
            // Ten seconds at 0.3 rad/s: the ring goes round many times.
            let count = (10.0_f64 / period).round();
            for number in 1..=count as usize {
                past.push(&at(0.3 * period * number as f64), period);
            }
            for age in [0.0, 0.4 * period, period, 0.0316, 0.1, 0.49] {
                // The chord of one remembered step, and rounding of a sum of 10^5 periods.
                assert!(angle_from(&past, age, 3.0 - 0.3 * age) < 1e-6, "{period}, {age}");
            }
            assert_eq!(past.at(0.1)[0], [0.0; 3]);
        }
    }

    /// Goal: before a new beginning all was as it was then.
    #[test]
    fn filling_replaces_the_past() {
        let mut past = Past::new();
        past.fill(&at(0.0));
        (0..50).for_each(|number| past.push(&at(0.01 * f64::from(number)), 1e-3));
        past.fill(&at(1.0));
        past.push(&at(1.2), 1e-3);
        assert!(angle_from(&past, 0.0, 1.2) < 1e-12);
        assert!(angle_from(&past, 1e-3, 1.0) < 1e-12);
        assert!(angle_from(&past, 0.02, 1.0) < 1e-12);
        assert!(angle_from(&past, 9.0, 1.0) < 1e-12);
    }
}
