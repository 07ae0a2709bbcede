//! A coil's circuit and the amplifier that holds its current.
//!
//! | symbol | meaning |
//! |---|---|
//! | `i`, `v` | current, A; voltage over the coil, V |
//! | `R`, `L` | resistance, ohm; inductance, H |
//! | `V` | supply voltage, V |
//! | `w` | bandwidth of the current controller, rad/s |
//! | `t` | the step, s |
//!
//! `L di/dt = v - R i`, solved exactly over a step at constant `v`. The amplifier sets the voltage with
//! which the current would approach its set point by the factor `exp(-w t)`, cut to `[-V, V]`: a
//! first-order closed loop until the supply runs out. When cut off, the coil discharges through the
//! bridge's diodes against the supply and stays at zero.

use magsteer_hal::description::CoilDescription;

/// One coil with its amplifier.
#[derive(Debug, Clone)]
pub struct Amplifier {
    resistance: f64,
    supply: f64,
    /// `exp(-R t / L)`
    decay: f64,
    /// `exp(-w t)`
    approach: f64,
    current: f64,
    voltage: f64,
}

impl Amplifier {
    /// At zero current. `bandwidth` in rad/s, `step` in s.
    #[must_use]
    pub fn new(coil: &CoilDescription, bandwidth: f64, step: f64) -> Self {
        Self {
            resistance: coil.resistance,
            supply: coil.supply_voltage,
            decay: (-coil.resistance * step / coil.inductance).exp(),
            approach: (-bandwidth * step).exp(),
            current: 0.0,
            voltage: 0.0,
        }
    }

    /// Present current, A.
    #[must_use]
    pub fn current(&self) -> f64 {
        self.current
    }

    /// Voltage over the last step, V.
    #[must_use]
    pub fn voltage(&self) -> f64 {
        self.voltage
    }

    /// Follows a set point, A, for one step.
    pub fn follow(&mut self, setpoint: f64) {
        let wanted = setpoint + (self.current - setpoint) * self.approach;
        // Exact solution at constant v: i1 = v/R + (i0 - v/R) decay, solved for v.
        let voltage = self.resistance * (wanted - self.current * self.decay) / (1.0 - self.decay);
        self.voltage = voltage.clamp(-self.supply, self.supply);
        self.current = self.after(self.voltage);
    }

    /// Lets the coil discharge, cut off from its amplifier, for one step.
    pub fn discharge(&mut self) {
        self.voltage = -self.supply.copysign(self.current);
        let next = self.after(self.voltage);
        // The diodes block once the current has come to zero.
        if next * self.current <= 0.0 {
            (self.current, self.voltage) = (0.0, 0.0);
        } else {
            self.current = next;
        }
    }

    fn after(&self, voltage: f64) -> f64 {
        let steady = voltage / self.resistance;
        steady + (self.current - steady) * self.decay
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    const STEP: f64 = 5e-4;

    fn amplifier(bandwidth: f64) -> Amplifier {
        Amplifier::new(&fixture::bigmag().coils[0], bandwidth, STEP)
    }

    #[test]
    fn small_steps_follow_with_the_configured_time_constant() {
        let bandwidth = 300.0;
        let mut amplifier = amplifier(bandwidth);
        for step in 1..=40 {
            amplifier.follow(0.1);
            let expected = 0.1 * (1.0 - (-bandwidth * STEP * f64::from(step)).exp());
            assert!((amplifier.current() - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn saturated_supply_charges_the_coil_with_its_own_time_constant() {
        // 5 ohm, 0.1 H, 48 V: 9.6 A in the end, 20 ms.
        let mut amplifier = amplifier(1e6);
        for step in 1..=20 {
            amplifier.follow(100.0);
            let expected = 9.6 * (1.0 - (-f64::from(step) * STEP / 0.02).exp());
            assert!((amplifier.current() - expected).abs() < 1e-12);
            assert_eq!(amplifier.voltage(), 48.0);
        }
    }

    #[test]
    fn voltage_never_exceeds_the_supply() {
        let mut amplifier = amplifier(5000.0);
        for step in 0..2000 {
            amplifier.follow(8.0 * (f64::from(step) * 0.05).sin().signum());
            assert!(amplifier.voltage().abs() <= 48.0);
        }
    }

    #[test]
    fn a_coil_cut_off_discharges_against_the_supply_and_stays_at_zero() {
        let mut amplifier = amplifier(1e6);
        (0..400).for_each(|_| amplifier.follow(8.0));
        // From i: zero after L/R ln(1 + i R / V).
        let expected = 0.02 * (1.0 + amplifier.current() * 5.0 / 48.0).ln();
        let steps = (expected / STEP).ceil() as usize;
        for step in 1..=steps {
            assert!(amplifier.current() > 0.0, "already zero before step {step}");
            amplifier.discharge();
        }
        assert_eq!(amplifier.current(), 0.0);
        amplifier.discharge();
        assert_eq!(amplifier.current(), 0.0);
    }
}
