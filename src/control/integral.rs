//! Proportional-integral law in physical units, with anti-windup by back-calculation.
//!
//! The error is an angle, the output a velocity of the error's rows: `v = v_reference + k_p e + i`, `di/dt = k_i e + k_p (v_achieved - v)`. The
//! last term draws the integral back when limits keep the actuators from following (Astrom, Murray: Feedback Systems, 2nd ed., section 11.4).

/// State of the law for a number of rows.
#[derive(Debug, Clone)]
pub struct ProportionalIntegral {
    /// 1/s
    proportional: f64,
    /// 1/s^2
    integral: f64,
    /// rad/s
    state: Vec<f64>,
}

impl ProportionalIntegral {
    /// A law for `rows` rows with gains in 1/s and 1/s^2.
    #[must_use]
    pub fn new(rows: usize, proportional: f64, integral: f64) -> Self {
        Self { proportional, integral, state: vec![0.0; rows] }
    }

    /// Forgets what was integrated.
    pub fn reset(&mut self) {
        self.state.fill(0.0);
    }

    /// Adds the law's output for `error` (rad) to `velocity` (rad/s), which holds the reference's.
    pub fn add_velocity(&self, error: &[f64], velocity: &mut [f64]) {
        for ((velocity, error), state) in velocity.iter_mut().zip(error).zip(&self.state) {
            *velocity += self.proportional * error + state;
        }
    }

    /// Integrates over `period` (s), given what was asked for and what the limits allowed, rad/s.
    pub fn integrate(&mut self, error: &[f64], asked: &[f64], achieved: &[f64], period: f64) {
        if self.integral == 0.0 {
            return;
        }
        for (row, state) in self.state.iter_mut().enumerate() {
            let lost = achieved[row] - asked[row];
            let change = (self.integral * error[row] + self.proportional * lost) * period;
            if change.is_finite() {
                *state += change;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs an integrator driven by the law towards 1 rad against a constant drift, its velocity limited; the overshoot.
    fn overshoot(limit: f64, law: &mut ProportionalIntegral) -> (f64, f64) {
        let (mut position, mut most) = (0.0_f64, 0.0_f64);
        for _ in 0..20_000 {
            let error = [1.0 - position];
            let mut asked = [0.0];
            law.add_velocity(&error, &mut asked);
            let achieved = [asked[0].clamp(-limit, limit)];
            law.integrate(&error, &asked, &achieved, 1e-3);
            position += (achieved[0] - 0.05) * 1e-3;
            most = most.max(position);
        }
        (most - 1.0, position)
    }

    /// Goal: the integral removes a steady error that the proportional part leaves.
    #[test]
    fn integral_removes_a_steady_error() {
        let (_, with) = overshoot(f64::INFINITY, &mut ProportionalIntegral::new(1, 5.0, 4.0));
        let (_, without) = overshoot(f64::INFINITY, &mut ProportionalIntegral::new(1, 5.0, 0.0));
        assert!((with - 1.0).abs() < 1e-6);
        // Drift over gain: 0.05 / 5 rad.
        assert!((without - 0.99).abs() < 1e-6);
    }

    /// Goal: a long saturation leaves no charge that would have to be worked off by overshooting.
    #[test]
    fn saturation_does_not_wind_up() {
        let mut law = ProportionalIntegral::new(1, 5.0, 4.0);
        let (overshot, settled) = overshoot(0.2, &mut law);
        assert!(overshot < 0.01, "{overshot}");
        assert!((settled - 1.0).abs() < 1e-3);
    }
}
