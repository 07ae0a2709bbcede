//! The current controller of an amplifier: which voltage it sets for a set point and a measured current.
//!
//! | symbol | meaning |
//! |---|---|
//! | `s`, `m` | set point and measured current, A |
//! | `v`, `V` | voltage over the coil, supply voltage, V |
//! | `x` | the controller's integral, V |
//! | `w` | bandwidth of the closed loop, rad/s |
//! | `R`, `L` | resistance and inductance that the controller is tuned to: those of the description |
//! | `n` | share of the coil's turns that work |
//! | `t` | the step, s |
//!
//! A proportional-integral controller whose zero cancels the coil's pole:
//!
//! `v = x + K (s - m)`, cut to `[-V, V]`                                                         (6)
//!
//! `x <- x + (1 - d) (v - x)`,  `d = exp(-R t / L)`                                              (7)
//!
//! `K = n R (1 - exp(-w t / n^2)) / (1 - exp(-R t / (n L)))`                                     (8)
//!
//! In (7) the voltage is the one that was possible: while the supply is short, the integral is where a
//! controller that asked for no more would have it, and the loop leaves saturation without overshoot (Hanus,
//! Kinnaert, Henrotte: Conditioning technique, a general anti-windup and bumpless transfer method, Automatica
//! 23(6), 1987). With the described coil the current approaches its set point by exactly `exp(-w t)` a step,
//! as long as the supply suffices. A coil that is warmer, or other coils that couple into it, are
//! disturbances; the integral removes what lasts, with the coil's own time constant.
//!
//! (8) is the mean voltage over a step of a loop that is continuous: it takes the true inductance, so that
//! shorted turns make the loop faster by `1/n^2`, as they would a real one, and not unstable at long steps.

use magsteer_hal::description::CoilDescription;

/// The controller of one coil.
#[derive(Debug, Clone)]
pub struct Amplifier {
    resistance: f64,
    time_constant: f64,
    supply: f64,
    bandwidth: f64,
    step: f64,
    /// `K`
    gain: f64,
    /// `1 - d`
    approach: f64,
    /// `x`
    integral: f64,
}

impl Amplifier {
    /// For a coil without current. `bandwidth` in rad/s, `step` in s.
    #[must_use]
    pub fn new(coil: &CoilDescription, bandwidth: f64, step: f64) -> Self {
        let time_constant = coil.inductance / coil.resistance;
        let mut amplifier = Self {
            resistance: coil.resistance,
            time_constant,
            supply: coil.supply_voltage,
            bandwidth,
            step,
            gain: 0.0,
            approach: -(-step / time_constant).exp_m1(),
            integral: 0.0,
        };
        amplifier.set_turns(1.0);
        amplifier
    }

    /// Takes account of the share of the coil's turns that work, above 0 up to 1: nature does, not the
    /// controller.
    pub fn set_turns(&mut self, share: f64) {
        let closed = -(-self.bandwidth * self.step / share.powi(2)).exp_m1();
        let open = -(-self.step / (self.time_constant * share)).exp_m1();
        self.gain = share * self.resistance * closed / open; // (8)
    }

    /// Greatest voltage, V.
    #[must_use]
    pub fn supply(&self) -> f64 {
        self.supply
    }

    /// The voltage, V, for the next step, from set point and measured current, A.
    pub fn follow(&mut self, setpoint: f64, measured: f64) -> f64 {
        let wanted = self.integral + self.gain * (setpoint - measured);
        let voltage = wanted.clamp(-self.supply, self.supply); // (6)
        self.integral += self.approach * (voltage - self.integral); // (7)
        voltage
    }

    /// Cut off: the integral waits where it would hold the measured current, A, when it is put to work again.
    pub fn rest(&mut self, measured: f64) {
        self.integral = (self.resistance * measured).clamp(-self.supply, self.supply);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuation::{CircuitValues, Circuits};
    use crate::fixture;
    use magsteer_hal::COILS_MAX;

    const STEP: f64 = 5e-4;

    /// One coil with its amplifier, measured as it is.
    struct Loop {
        amplifier: Amplifier,
        circuits: Circuits,
        voltage: f64,
    }

    impl Loop {
        fn new(bandwidth: f64, resistance_ratio: f64, turns: f64, step: f64) -> Self {
            let coil = &fixture::bigmag().coils[0];
            let resistance = coil.resistance * resistance_ratio * turns;
            let values = CircuitValues { resistance, inductance: coil.inductance };
            let mut circuits = Circuits::new(&[values], &[1.0], step);
            circuits.set_turns(0, turns);
            let mut amplifier = Amplifier::new(coil, bandwidth, step);
            amplifier.set_turns(turns);
            Self { amplifier, circuits, voltage: 0.0 }
        }

        fn current(&self) -> f64 {
            self.circuits.currents()[0]
        }

        fn follow(&mut self, setpoint: f64) {
            self.voltage = self.amplifier.follow(setpoint, self.current());
            let mut voltages = [0.0; COILS_MAX];
            voltages[0] = self.voltage;
            self.circuits.advance(&voltages);
        }
    }

    #[test]
    fn small_steps_follow_with_the_configured_time_constant() {
        let bandwidth = 300.0;
        let mut driven = Loop::new(bandwidth, 1.0, 1.0, STEP);
        for step in 1..=40 {
            driven.follow(0.1);
            let expected = 0.1 * (1.0 - (-bandwidth * STEP * f64::from(step)).exp());
            assert!((driven.current() - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn saturated_supply_charges_the_coil_with_its_own_time_constant() {
        // 5 ohm, 0.1 H, 48 V: 9.6 A in the end, 20 ms.
        let mut driven = Loop::new(1e6, 1.0, 1.0, STEP);
        for step in 1..=20 {
            driven.follow(100.0);
            let expected = 9.6 * (1.0 - (-f64::from(step) * STEP / 0.02).exp());
            assert!((driven.current() - expected).abs() < 1e-12);
            assert_eq!(driven.voltage, 48.0);
        }
    }

    #[test]
    fn voltage_never_exceeds_the_supply() {
        let mut driven = Loop::new(5000.0, 1.0, 1.0, STEP);
        for step in 0..2000 {
            driven.follow(8.0 * (f64::from(step) * 0.05).sin().signum());
            assert!(driven.voltage.abs() <= 48.0);
        }
    }

    #[test]
    fn a_loop_comes_out_of_saturation_without_overshoot() {
        for step in [5e-5, 5e-4, 2e-3] {
            let mut driven = Loop::new(1257.0, 1.0, 1.0, step);
            let mut was_saturated = false;
            for _ in 0..(0.3 / step) as usize {
                driven.follow(8.0);
                was_saturated |= driven.voltage == 48.0;
                assert!(driven.current() <= 8.0 * (1.0 + 1e-12), "step {step}: {} A", driven.current());
            }
            assert!(was_saturated && (driven.current() - 8.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_warm_coil_gets_its_full_current_all_the_same() {
        let mut driven = Loop::new(1257.0, 1.3, 1.0, STEP);
        (0..600).for_each(|_| driven.follow(5.0));
        // The integral closes with L / R = 20 ms: e^-15 of the deviation of some hundredths.
        assert!((driven.current() - 5.0).abs() < 1e-6, "{}", driven.current());
    }

    #[test]
    fn shorted_turns_make_the_loop_faster_and_never_unstable() {
        for step in [5e-5, 5e-4, 2e-3] {
            for turns in [0.1, 0.3, 0.5, 0.9] {
                let bandwidth = 1257.0;
                let mut driven = Loop::new(bandwidth, 1.0, turns, step);
                let mut off = 0.0_f64;
                for count in 0..(1.0 / step) as usize {
                    driven.follow(0.1);
                    off = (0.1 - driven.current()).abs();
                    let allowed = 0.1 * (-5.0 * count as f64 * step).exp() + 1e-9;
                    assert!(off < allowed, "step {step}, turns {turns}, {count}: {off} A off");
                }
                assert!(off < 1e-6, "step {step}, turns {turns}: {off} A off in the end");
            }
        }
    }

    #[test]
    fn an_amplifier_put_back_to_work_at_a_current_holds_it() {
        let mut driven = Loop::new(1257.0, 1.0, 1.0, STEP);
        (0..600).for_each(|_| driven.follow(3.0));
        driven.amplifier.rest(driven.current());
        driven.follow(3.0);
        assert!((driven.current() - 3.0).abs() < 1e-9);
    }
}
