//! The reference that the loop follows: targets smoothed on the sphere, and remembered for comparison with late measurements.
//!
//! A step of the target would shake the rod at its first mode. Each direction therefore follows its target as a
//! critically damped second-order system on the unit sphere with time constant `T`: `a = log_r(target) / T^2 - 2 w / T`.
//! Its velocity feeds the controller forward, and its past is kept, so that a pose that was true some
//! milliseconds ago is compared with what was desired then.

use magsteer_hal::MAGNETS_MAX;
use nalgebra::Vector3;

use super::cycle::Directions;
use crate::math::logarithm;

/// Remembered references; one a millisecond, so that half a second of the past is known at any rate.
const HISTORY: usize = 512;
/// Least time between two remembered references, s.
const HISTORY_STEP: f64 = 1e-3;

/// Smoothed directions with their velocities and their past.
#[derive(Debug, Clone)]
pub struct Reference {
    time_constant: f64,
    count: usize,
    direction: [Vector3<f64>; MAGNETS_MAX],
    velocity: [Vector3<f64>; MAGNETS_MAX],
    elapsed: f64,
    history: Vec<(f64, Directions)>,
    newest: usize,
}

impl Reference {
    /// A reference for `count` magnets that follows its targets with `time_constant`, s.
    #[must_use]
    pub fn new(count: usize, time_constant: f64) -> Self {
        Self {
            time_constant,
            count,
            direction: [Vector3::zeros(); MAGNETS_MAX],
            velocity: [Vector3::zeros(); MAGNETS_MAX],
            elapsed: 0.0,
            history: vec![(0.0, Directions::default()); HISTORY],
            newest: 0,
        }
    }

    /// Puts the reference at rest at `directions`, past included.
    pub fn reset(&mut self, directions: &[Vector3<f64>; MAGNETS_MAX]) {
        self.direction = *directions;
        self.velocity = [Vector3::zeros(); MAGNETS_MAX];
        let entry = (self.elapsed, self.directions());
        self.history.fill(entry);
    }

    /// Moves on by `period` seconds towards `target`.
    pub fn advance(&mut self, target: &Directions, period: f64) {
        // A loop slower than the filter would make the explicit step unstable: it then jumps to the target in two steps.
        let rate = 1.0 / self.time_constant.max(2.0 * period);
        for magnet in 0..self.count {
            let direction = &mut self.direction[magnet];
            let velocity = &mut self.velocity[magnet];
            let target = Vector3::from(target[magnet]);
            let acceleration = logarithm(direction, &target) * (rate * rate) - *velocity * (2.0 * rate);
            let moved = *velocity + acceleration * period;
            let next = *direction + moved * period;
            let norm = next.norm();
            if norm > 0.5 && norm.is_finite() {
                *direction = next / norm;
                *velocity = moved - *direction * direction.dot(&moved);
            }
        }
        self.elapsed += period;
        if self.elapsed - self.history[self.newest].0 >= HISTORY_STEP {
            self.newest = (self.newest + 1) % HISTORY;
            self.history[self.newest] = (self.elapsed, self.directions());
        }
    }

    /// Present directions.
    #[must_use]
    pub fn directions(&self) -> Directions {
        let mut found = Directions::default();
        for (entry, direction) in found.iter_mut().zip(&self.direction).take(self.count) {
            *entry = (*direction).into();
        }
        found
    }

    /// Velocity of the direction of one magnet, 1/s, tangent to the sphere.
    #[must_use]
    pub fn velocity(&self, magnet: usize) -> Vector3<f64> {
        self.velocity[magnet]
    }

    /// What was desired `age` seconds ago, as far back as is remembered.
    #[must_use]
    pub fn past(&self, age: f64) -> &Directions {
        let wanted = self.elapsed - age;
        let mut index = self.newest;
        for _ in 0..HISTORY - 1 {
            if self.history[index].0 <= wanted {
                break;
            }
            index = (index + HISTORY - 1) % HISTORY;
        }
        &self.history[index].1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::angle_between;

    fn targets(direction: Vector3<f64>) -> Directions {
        let mut targets = Directions::default();
        targets[0] = direction.into();
        targets
    }

    fn at_rest(direction: Vector3<f64>) -> Reference {
        let mut reference = Reference::new(1, 0.05);
        let mut directions = [Vector3::zeros(); MAGNETS_MAX];
        directions[0] = direction;
        reference.reset(&directions);
        reference
    }

    /// Goal: the reference reaches its target without passing it, along the great circle.
    #[test]
    fn reaches_the_target_without_overshoot() {
        let (start, target) = (Vector3::x(), Vector3::z());
        let mut reference = at_rest(start);
        let mut last = f64::INFINITY;
        for _ in 0..1000 {
            reference.advance(&targets(target), 1e-3);
            let direction = Vector3::from(reference.directions()[0]);
            let left = angle_between(&direction, &target);
            assert!(left <= last + 1e-12);
            assert!(direction.y.abs() < 1e-12);
            last = left;
        }
        // Twenty time constants: (1 + 20) exp(-20) of a quarter turn.
        assert!(last < 1e-6);
    }

    /// Goal: the past is what was desired then.
    #[test]
    fn past_is_what_was_desired_then() {
        let mut reference = at_rest(Vector3::x());
        let mut seen = Vec::new();
        for _ in 0..200 {
            reference.advance(&targets(Vector3::z()), 1e-3);
            seen.push(reference.directions());
        }
        let past = Vector3::from(reference.past(0.03)[0]);
        let then = Vector3::from(seen[199 - 30][0]);
        // One remembered step of a movement of a few rad/s.
        assert!(angle_between(&past, &then) < 0.02);
        assert!(angle_between(&past, &Vector3::from(seen[199][0])) > 0.01);
    }
}
