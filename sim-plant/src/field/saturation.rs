//! How the field of an iron core falls short of its proportion to the current.
//!
//! The flux of current `i` is that of the series times `f(i)`, an odd, smooth, growing function with a knee
//! at `i_k`:
//!
//! `f(i) = i / [1 + (i / i_k)^4]^(1/4)`                                                       (F11)
//!
//! Its loss, `1 - f(i) / i`, is `(i / i_k)^4 / 4` for small currents: below 1e-3 up to a quarter of the knee,
//! 16 % at the knee. Its slope `[1 + (i / i_k)^4]^(-5/4)` falls to 42 % at the knee, and `f` tends to `i_k`
//! far beyond.
//!
//! The exponent is a choice, not a measurement: it gives a core that is linear for long and then bends within
//! a factor of two in current, as soft iron does. Hysteresis and the part of the field that the winding makes
//! without its core are left out.

/// Whether a coil has a core that saturates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Saturation {
    /// The field is in proportion to the current.
    None,
    /// `i_k`, A: the current at which the two straight lines of (F11) meet.
    Knee(f64),
}

impl Saturation {
    /// The current (A) that would make the field of `current` in a coil that does not saturate.
    #[must_use]
    pub fn effective_current(self, current: f64) -> f64 {
        match self {
            Self::None => current,
            Self::Knee(knee) => {
                let square = (current / knee) * (current / knee);
                current / (1.0 + square * square).sqrt().sqrt() // (F11)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The knee of the shipped rig's iron cores, A.
    const KNEE: f64 = 12.5;

    fn loss(current: f64) -> f64 {
        1.0 - Saturation::Knee(KNEE).effective_current(current) / current
    }

    #[test]
    fn shipped_cores_lose_little_at_three_amperes_and_some_at_eight() {
        assert!(loss(3.0) < 2e-3, "{}", loss(3.0));
        assert!((0.03..0.05).contains(&loss(8.0)), "{}", loss(8.0));
        assert!(loss(KNEE / 4.0) < 1e-3);
        assert!((loss(KNEE) - (1.0 - 0.5_f64.powf(0.25))).abs() < 1e-15);
    }

    #[test]
    fn flux_is_odd_and_grows_with_the_current_at_a_slope_that_falls() {
        let core = Saturation::Knee(KNEE);
        let mut slope_last = 1.0 + 1e-9;
        for step in 0..400 {
            let current = 0.1 * f64::from(step);
            assert_eq!(core.effective_current(-current), -core.effective_current(current));
            let slope = (core.effective_current(current + 0.1) - core.effective_current(current)) / 0.1;
            assert!(slope > 0.0 && slope < slope_last, "at {current} A");
            // Rounding of the difference alone.
            slope_last = slope + 1e-12;
        }
        assert_eq!(Saturation::None.effective_current(7.0), 7.0);
    }
}
