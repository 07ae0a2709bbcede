//! The rod's state at the points of the quadrature, from a second, cheaper walk along a section.

use crate::math::Triple;
use crate::rod::section::{Node, Section};
use crate::rod::state::State;

/// Points of the Gauss-Legendre rule on a span.
pub(super) const POINTS: usize = 4;

/// Where a point lies within a section cut into steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    step: usize,
    /// Share of the step before it.
    share: f64,
}

impl Place {
    /// The place at `share` of a section of `segments` steps.
    pub(super) fn new(share: f64, segments: usize) -> Self {
        let steps = share * segments as f64;
        let step = (steps as usize).min(segments - 1);
        Self { step, share: steps - step as f64 }
    }
}

/// What the second variation asks of a cross-section; world.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sample {
    /// Tangent, unit.
    pub tangent: Triple,
    /// `v = p'`.
    pub velocity: Triple,
    /// Internal force, N.
    pub force: Triple,
    /// Internal moment, N m.
    pub moment: Triple,
}

impl Section {
    /// The section's samples at `places`, which ascend, when it begins at `state` under `gravity` (m/s^2).
    pub(super) fn sample(&self, state: &State, gravity: Triple, places: &[Place], samples: &mut [Sample]) {
        match (self.extensible, self.curved) {
            (false, false) => self.sample_as::<false, false>(state, gravity, places, samples),
            (true, false) => self.sample_as::<true, false>(state, gravity, places, samples),
            (false, true) => self.sample_as::<false, true>(state, gravity, places, samples),
            (true, true) => self.sample_as::<true, true>(state, gravity, places, samples),
        }
    }

    fn sample_as<const EXTENSIBLE: bool, const CURVED: bool>(
        &self,
        state: &State,
        gravity: Triple,
        places: &[Place],
        samples: &mut [Sample],
    ) {
        let weight = self.weight_of_half_step(gravity);
        let mut node = self.enter(state);
        let mut travel = Triple::default();
        let mut wanted = places.iter().zip(samples).peekable();
        for step in 0..self.segments {
            let before = node;
            self.step::<EXTENSIBLE, CURVED>(&mut node, &mut travel, weight);
            while let Some((place, sample)) = wanted.next_if(|(place, _)| place.step == step) {
                *sample = self.between::<EXTENSIBLE, CURVED>(&before, &node, place.share);
            }
        }
    }

    /// Cubic Hermite interpolation of tangent and moment within a step: as accurate as the scheme itself, of
    /// fourth order.
    #[inline(always)]
    fn between<const EXTENSIBLE: bool, const CURVED: bool>(
        &self,
        before: &Node,
        after: &Node,
        share: f64,
    ) -> Sample {
        let rates = [before, after].map(|node| self.rates::<EXTENSIBLE, CURVED>(node));
        let rest = 1.0 - share;
        // Rates are per half a step.
        let (out, back) = (2.0 * share * rest * rest, -2.0 * share * share * rest);
        let (here, there) = ((1.0 + 2.0 * share) * rest * rest, share * share * (3.0 - 2.0 * share));
        let blend = |y0: Triple, y1: Triple, f0: Triple, f1: Triple| {
            y0.scaled(here) + y1.scaled(there) + f0.scaled(out) + f1.scaled(back)
        };
        let tangent = blend(before.t, after.t, rates[0].t, rates[1].t);
        let tangent = tangent.scaled(1.0 / tangent.norm());
        let mu = blend(before.mu, after.mu, rates[0].mu, rates[1].mu);
        let nu = before.nu.scaled(rest) + after.nu.scaled(share); // (r2)
        Sample {
            tangent,
            velocity: self.velocity(tangent, nu),
            force: nu.scaled(1.0 / self.force_scale),
            moment: mu.scaled(1.0 / self.moment_scale),
        }
    }
}
