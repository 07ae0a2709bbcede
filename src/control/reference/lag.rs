//! First-order lags of directions and angles.
//!
//! | symbol | meaning |
//! |---|---|
//! | `T` | time constant, s |
//! | `E` | `exp(-period / T)` |
//!
//! Over a period in which the input goes evenly from `x0` to `x1`, a lag comes to `E y + a x0 + b x1` with `b
//! = 1 - (1 - E) T / period` and `a = 1 - E - b`: exact, whatever the period. The weights are positive, so
//! that the output never leaves what the input spans: it neither overshoots nor is faster or accelerated more
//! than the input. On the sphere the weighted mean is taken along great circles, two at a time.

use nalgebra::Vector3;

use crate::math::{along_great_circle, logarithm};

/// Weights of one period.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lag {
    /// `a / (a + E)`, then `b`.
    shares: [f64; 2],
}

impl Lag {
    /// The weights for `period`, s, > 0, and a time constant, s, >= 0.
    pub(super) fn new(time_constant: f64, period: f64) -> Self {
        let ratio = period / time_constant.max(f64::MIN_POSITIVE);
        let keep = (-ratio).exp();
        // Below a ratio of 1e-6 its first-order term is exact to rounding where the quotient is not.
        let new = if ratio < 1e-6 { 0.5 * ratio } else { 1.0 + (-ratio).exp_m1() / ratio };
        let old = (1.0 - keep - new).max(0.0);
        let rest = old + keep;
        Self { shares: [if rest > 0.0 { old / rest } else { 0.0 }, new.clamp(0.0, 1.0)] }
    }

    /// The output at the end of a period in which the input goes from `before` to `after`.
    pub(super) fn direction(
        &self,
        output: &Vector3<f64>,
        before: &Vector3<f64>,
        after: &Vector3<f64>,
    ) -> Vector3<f64> {
        let towards = |from: &Vector3<f64>, to: &Vector3<f64>, share: f64| {
            along_great_circle(from, &(logarithm(from, to) * share), &Vector3::zeros()).0
        };
        let [old, new] = self.shares;
        towards(&towards(output, before, old), after, new)
    }

    /// The same for an angle.
    pub(super) fn angle(&self, output: f64, before: f64, after: f64) -> f64 {
        let [old, new] = self.shares;
        let between = output + (before - output) * old;
        between + (after - between) * new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Goal: of a ramp the lag is the exact response, in one period or in many.
    #[test]
    fn ramp_is_followed_exactly() {
        let (time_constant, end) = (0.03_f64, 0.2_f64);
        let exact = end - time_constant * (1.0 - (-end / time_constant).exp());
        for count in [1, 7, 2000] {
            let period = end / f64::from(count);
            let lag = Lag::new(time_constant, period);
            let (mut angle, mut direction) = (0.0, Vector3::x());
            let at = |time: f64| Vector3::new(time.cos(), time.sin(), 0.0);
            for number in 0..count {
                let (before, after) = (f64::from(number) * period, f64::from(number + 1) * period);
                angle = lag.angle(angle, before, after);
                direction = lag.direction(&direction, &at(before), &at(after));
            }
            assert!((angle - exact).abs() < 1e-12, "{count}: {angle}");
            assert!((direction.y.atan2(direction.x) - exact).abs() < 1e-12, "{count}");
        }
    }

    /// Goal: without a time constant the output is the input; with a very long one it stays.
    #[test]
    fn extreme_time_constants_are_safe() {
        assert_eq!(Lag::new(0.0, 1e-3).angle(5.0, 1.0, 2.0), 2.0);
        let slow = Lag::new(1e12, 1e-3).angle(5.0, 1.0, 2.0);
        assert!((slow - 5.0).abs() < 1e-12, "{slow}");
    }
}
