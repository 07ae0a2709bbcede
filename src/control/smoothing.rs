//! Measured currents as the model sees them: through a low-pass, since near a snap-through the model magnifies their noise.
//!
//! What a current turns the magnets by grows as the inverse of the margin of stability: 2 mA of white noise in six coils move magnets by
//! hundredths of a degree where the rod is stiff, and at a margin of 0.1 by half a degree and the margin itself by 0.03, from one cycle to
//! the next. The rod does not follow that, and a margin is no warning while it flickers. First order,
//! ```text
//! T c' = I - c
//! ```
//! | symbol | meaning |
//! |---|---|
//! | `I`, `c` | measured currents and what the model sees, A |
//! | `T` | time constant, s; zero takes the currents as they are measured |
//!
//! The model then lags behind the field by `T`, which the estimate of its bias counts on.

use magsteer_hal::{Actuation, COILS_MAX};

/// The low-pass of one rig.
#[derive(Debug, Clone)]
pub(super) struct SmoothedCurrents {
    /// s
    time_constant: f64,
    /// `c`; unknown before the first measurement.
    state: Option<[f64; COILS_MAX]>,
}

impl SmoothedCurrents {
    /// A low-pass with this time constant, s, that has seen nothing.
    pub(super) const fn new(time_constant: f64) -> Self {
        Self { time_constant, state: None }
    }

    /// What the model sees `period` seconds after the call before; angles are as they were measured.
    pub(super) fn take(&mut self, measured: &Actuation, period: f64) -> Actuation {
        let kept = if self.time_constant > 0.0 { (-period / self.time_constant).exp() } else { 0.0 };
        let state = self.state.get_or_insert(measured.current_a);
        for (state, current) in state.iter_mut().zip(&measured.current_a) {
            let smoothed = current + (*state - current) * kept;
            // What is no number is passed on, and is not remembered.
            *state = if smoothed.is_finite() { smoothed } else { *current };
        }
        Actuation { current_a: *state, ..*measured }
    }
}

#[cfg(test)]
mod tests {
    use magsteer_hal::Actuation;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::SmoothedCurrents;

    fn measured(current: f64) -> Actuation {
        let mut measured = Actuation::default();
        measured.current_a[0] = current;
        measured.angle_rad[0] = 10.0 * current;
        measured
    }

    /// Goal: the answer to a step is the exponential of the time that has passed, in one period or in many, from the first measurement
    /// on; without a time constant everything is as it was measured, and angles always are.
    #[test]
    fn a_step_is_answered_with_the_time_constant_whatever_the_rate() {
        const T: f64 = 0.01;
        for cycles in [1, 7, 1000] {
            let mut smoothed = SmoothedCurrents::new(T);
            assert_eq!(smoothed.take(&measured(3.0), 0.0), measured(3.0));
            let time = 0.017;
            let mut seen = Actuation::default();
            for _ in 0..cycles {
                seen = smoothed.take(&measured(-1.0), time / f64::from(cycles));
            }
            let expected = -1.0 + 4.0 * (-time / T).exp();
            assert!((seen.current_a[0] - expected).abs() < 1e-12, "{cycles} cycles: {}", seen.current_a[0]);
            assert_eq!(seen.angle_rad, measured(-1.0).angle_rad);
        }
        let mut as_measured = SmoothedCurrents::new(0.0);
        for current in [2.0, -5.0, 0.25] {
            assert_eq!(as_measured.take(&measured(current), 1e-3), measured(current));
        }
    }

    /// Goal: white noise comes out with the deviation that theory has for it, and a ramp late by the time constant.
    #[test]
    fn noise_is_lessened_as_theory_says_and_ramps_are_late_by_the_time_constant() {
        const T: f64 = 0.01;
        const PERIOD: f64 = 1e-3;
        const NOISE: f64 = 2e-3;
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut smoothed = SmoothedCurrents::new(T);
        let mut squares = 0.0;
        let cycles = 100_000;
        for _ in 0..cycles {
            let noise = NOISE * 3.0_f64.sqrt() * random.random_range(-1.0..1.0);
            squares += smoothed.take(&measured(noise), PERIOD).current_a[0].powi(2);
        }
        let kept = (-PERIOD / T).exp();
        let (found, expected) =
            ((squares / f64::from(cycles)).sqrt(), NOISE * ((1.0 - kept) / (1.0 + kept)).sqrt());
        assert!((found / expected - 1.0).abs() < 0.03, "{found} A, {expected} A expected");

        let mut smoothed = SmoothedCurrents::new(T);
        let mut seen = 0.0;
        for cycle in 0..1000 {
            seen = smoothed.take(&measured(5.0 * f64::from(cycle) * PERIOD), PERIOD).current_a[0];
        }
        let late = 999.0 * PERIOD - seen / 5.0;
        // Half a period less or more is the sampling's.
        assert!((late - T).abs() <= 0.5 * PERIOD, "{late} s late");
    }

    /// Goal: what is no number is not remembered.
    #[test]
    fn measurements_that_are_no_numbers_leave_nothing_behind() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut smoothed = SmoothedCurrents::new(0.01);
            for current in [bad, 1.0, bad] {
                let _ = smoothed.take(&measured(current), 1e-3);
            }
            let seen = smoothed.take(&measured(1.0), 1e-3).current_a[0];
            assert!((seen - 1.0).abs() < 1e-12, "{bad}: {seen}");
        }
    }
}
