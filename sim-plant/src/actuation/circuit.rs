//! The coils as coupled circuits: what their voltages make of their currents, charge and heat.
//!
//! | symbol | meaning |
//! |---|---|
//! | `i_c`, `v_c` | current of coil `c`, A; voltage over it, V |
//! | `R_c`, `L_c` | resistance, ohm; inductance, H |
//! | `k_cj`, `M_cj` | coupling coefficient of two coils; mutual inductance `k_cj sqrt(L_c L_j)`, H |
//! | `n_c` | share of the turns that still work, 1 unless some are shorted |
//! | `q_c`, `Q_c` | charge, A s, and heat, J, of a step |
//! | `t` | the step, s |
//!
//! `n_c^2 L_c di_c/dt + sum_j n_c n_j M_cj di_j/dt = v_c - R_c i_c`                              (1)
//!
//! solved exactly at constant `v` and `R` (2). Charge follows exactly from the flux that the step leaves,
//! the heat from the parabola through both ends of the step that holds this charge:
//!
//! `R_c q_c = v_c t - (n_c^2 L_c D_c + sum_j n_c n_j M_cj D_j)`, `D = i(t) - i(0)`                 (3)
//!
//! `Q_c = R_c t (a^2 + a D + D^2/3 + (a + D/2) b/3 + b^2/30)`, `a = i_c(0)`, `b = 6 (q_c/t - a - D/2)` (4)
//!
//! A coil that does not conduct has no current and takes no part in (1). When one stops conducting with
//! current in it, the flux linked with every other coil stays: `sum_j M_cj D_j = M_cx i_x`               (5)
//!
//! Resistances change slowly with temperature. The propagator is rebuilt when one has moved by more than
//! [`RESISTANCE_TOLERANCE`] of itself: until then the step counts with the former ones, in current and heat
//! alike.

use magsteer_hal::COILS_MAX;

use super::propagator::Propagator;

/// By how much, of itself, a resistance moves before the circuits take note: four times smaller than that of
/// copper over a hundredth of a kelvin.
pub const RESISTANCE_TOLERANCE: f64 = 1e-5;

/// One circuit as it is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CircuitValues {
    /// Ohm.
    pub resistance: f64,
    /// H.
    pub inductance: f64,
}

/// All coils of the rig, coupled.
#[derive(Debug, Clone)]
pub struct Circuits {
    count: usize,
    step: f64,
    /// `k_cj sqrt(L_c L_j)` of all turns, by rows.
    described: Vec<f64>,
    /// The matrix of (1) in force; coils that do not conduct are coupled with none.
    inductance: Vec<f64>,
    /// In force, and as last set.
    resistance: [f64; COILS_MAX],
    resistance_set: [f64; COILS_MAX],
    turns: [f64; COILS_MAX],
    conducts: [bool; COILS_MAX],
    current: [f64; COILS_MAX],
    voltage: [f64; COILS_MAX],
    charge: [f64; COILS_MAX],
    heat: [f64; COILS_MAX],
    propagator: Propagator,
    is_stale: bool,
}

impl Circuits {
    /// Without current. `coefficients` is the matrix of the `k_cj` by rows with ones on its diagonal,
    /// positive definite (see [`Couplings`](super::Couplings)); at most [`COILS_MAX`] coils; `step` in s.
    #[must_use]
    pub fn new(coils: &[CircuitValues], coefficients: &[f64], step: f64) -> Self {
        let count = coils.len().min(COILS_MAX);
        let mut described = vec![0.0; count * count];
        for (entry, value) in described.iter_mut().enumerate() {
            let (row, column) = (entry / count, entry % count);
            *value = coefficients[entry] * (coils[row].inductance * coils[column].inductance).sqrt();
        }
        let mut resistance = [0.0; COILS_MAX];
        resistance.iter_mut().zip(coils).for_each(|(into, coil)| *into = coil.resistance);
        Self {
            count,
            step,
            inductance: described.clone(),
            described,
            resistance,
            resistance_set: resistance,
            turns: [1.0; COILS_MAX],
            conducts: [true; COILS_MAX],
            current: [0.0; COILS_MAX],
            voltage: [0.0; COILS_MAX],
            charge: [0.0; COILS_MAX],
            heat: [0.0; COILS_MAX],
            propagator: Propagator::new(count),
            is_stale: true,
        }
    }

    /// Currents, A.
    #[must_use]
    pub fn currents(&self) -> &[f64; COILS_MAX] {
        &self.current
    }

    /// Resistance in force, ohm.
    #[must_use]
    pub fn resistance(&self, coil: usize) -> f64 {
        self.resistance[coil]
    }

    /// Self-inductance of the turns that work, H.
    #[must_use]
    pub fn inductance(&self, coil: usize) -> f64 {
        self.described[coil * self.count + coil] * self.turns[coil].powi(2)
    }

    /// Charge that the last step moved through a coil, A s.
    #[must_use]
    pub fn charge(&self, coil: usize) -> f64 {
        self.charge[coil]
    }

    /// Heat of the last step in a coil, J.
    #[must_use]
    pub fn heat(&self, coil: usize) -> f64 {
        self.heat[coil]
    }

    /// What all supplies gave in the last step, J; negative when they took energy back.
    #[must_use]
    pub fn work(&self) -> f64 {
        self.voltage.iter().zip(&self.charge).map(|(voltage, charge)| voltage * charge).sum()
    }

    /// Energy of the magnetic field, `i L i / 2`, J.
    #[must_use]
    pub fn stored_energy(&self) -> f64 {
        let rows = self.inductance.chunks(self.count.max(1)).zip(&self.current);
        let energy = |(row, current): (&[f64], &f64)| {
            let flux: f64 = row.iter().zip(&self.current).map(|(entry, other)| entry * other).sum();
            0.5 * flux * current
        };
        rows.map(energy).sum()
    }

    /// Sets a resistance, ohm, > 0; in force at the latest when it is [`RESISTANCE_TOLERANCE`] away from the
    /// former one.
    pub fn set_resistance(&mut self, coil: usize, resistance: f64) {
        self.resistance_set[coil] = resistance;
        let in_force = self.resistance[coil];
        self.is_stale |= (resistance - in_force).abs() > RESISTANCE_TOLERANCE * in_force;
    }

    /// Sets the share of a coil's turns that work, above 0 up to 1. Its current stays.
    pub fn set_turns(&mut self, coil: usize, share: f64) {
        self.turns[coil] = share;
        self.is_stale = true;
    }

    /// Opens or closes a coil's circuit. Opened, its current is gone at once (5).
    pub fn set_conducting(&mut self, coil: usize, conducts: bool) {
        if self.conducts[coil] == conducts {
            return;
        }
        // Fluxes that the lost current linked with the others, before it is cut out of the matrix.
        self.assemble();
        let mut flux = [0.0; COILS_MAX];
        let lost = self.current[coil];
        for (other, flux) in flux.iter_mut().enumerate().take(self.count).filter(|(other, _)| *other != coil)
        {
            *flux = self.inductance[other * self.count + coil] * lost;
        }
        self.conducts[coil] = conducts;
        self.current[coil] = 0.0;
        self.rebuild();
        if lost != 0.0 {
            let rows = self.propagator.inverse().chunks(self.count);
            for (row, current) in rows.zip(&mut self.current) {
                *current += row.iter().zip(&flux).map(|(entry, flux)| entry * flux).sum::<f64>(); // (5)
            }
            self.current[coil] = 0.0;
        }
    }

    /// True unless the coil's circuit is open.
    #[must_use]
    pub fn conducts(&self, coil: usize) -> bool {
        self.conducts[coil]
    }

    /// The voltage, V, that would bring an uncoupled coil's current to zero by the end of a step.
    #[must_use]
    pub fn voltage_to_zero(&self, coil: usize) -> f64 {
        let exponent = self.resistance[coil] * self.step / self.inductance(coil);
        -self.resistance[coil] * self.current[coil] / exponent.exp_m1()
    }

    /// Advances all currents by a step at the given voltages, V.
    pub fn advance(&mut self, voltages: &[f64; COILS_MAX]) {
        if self.is_stale {
            self.rebuild();
        }
        let count = self.count;
        let used = voltages.iter().zip(&self.conducts).zip(&mut self.voltage).take(count);
        used.for_each(|((voltage, conducts), used)| *used = if *conducts { *voltage } else { 0.0 });
        let before = self.current;
        self.propagator.advance(&before[..count], &self.voltage[..count], &mut self.current[..count]);
        let mut change = [0.0; COILS_MAX];
        for coil in 0..count {
            change[coil] = self.current[coil] - before[coil];
        }
        for coil in 0..count {
            let row = &self.inductance[coil * count..(coil + 1) * count];
            let flux: f64 = row.iter().zip(&change).map(|(entry, change)| entry * change).sum();
            let resistance = self.resistance[coil];
            let charge = (self.voltage[coil] * self.step - flux) / resistance; // (3)
            let (start, rise) = (before[coil], change[coil]);
            let bulge = 6.0 * (charge / self.step - start - 0.5 * rise);
            let square = start * start + start * rise + rise * rise / 3.0;
            let square = square + (start + 0.5 * rise) * bulge / 3.0 + bulge * bulge / 30.0;
            self.charge[coil] = charge;
            self.heat[coil] = resistance * self.step * square; // (4)
        }
    }

    /// The matrix of (1) from turns and circuits that conduct.
    fn assemble(&mut self) {
        for (entry, value) in self.inductance.iter_mut().enumerate() {
            let (row, column) = (entry / self.count, entry % self.count);
            let couples = row == column || (self.conducts[row] && self.conducts[column]);
            let turns = self.turns[row] * self.turns[column];
            *value = if couples { self.described[entry] * turns } else { 0.0 };
        }
    }

    fn rebuild(&mut self) {
        self.assemble();
        self.resistance = self.resistance_set;
        self.propagator.rebuild(&self.inductance, &self.resistance[..self.count], self.step);
        self.is_stale = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const COIL: CircuitValues = CircuitValues { resistance: 5.0, inductance: 0.1 };

    fn volts(voltages: &[f64]) -> [f64; COILS_MAX] {
        let mut all = [0.0; COILS_MAX];
        all[..voltages.len()].copy_from_slice(voltages);
        all
    }

    #[test]
    fn an_opened_coil_leaves_the_flux_of_the_others_as_it_was() {
        let coefficients = [1.0, -0.3, 0.1, -0.3, 1.0, 0.2, 0.1, 0.2, 1.0];
        let mut circuits = Circuits::new(&[COIL; 3], &coefficients, 5e-4);
        (0..100).for_each(|_| circuits.advance(&volts(&[30.0, -10.0, 5.0])));
        let flux = |circuits: &Circuits, row: usize| -> f64 {
            let currents = circuits.currents().iter().take(3);
            currents.zip(&coefficients[3 * row..]).map(|(current, entry)| 0.1 * entry * current).sum()
        };
        let before = [0, 2].map(|row| flux(&circuits, row));
        let currents = *circuits.currents();
        circuits.set_conducting(1, false);
        assert_eq!(circuits.currents()[1], 0.0);
        for (row, before) in [0, 2].into_iter().zip(before) {
            assert!((flux(&circuits, row) - before).abs() < 1e-15);
            assert!((circuits.currents()[row] - currents[row]).abs() > 0.01, "coupled currents jump");
        }
        circuits.advance(&volts(&[30.0, -48.0, 5.0]));
        assert_eq!((circuits.currents()[1], circuits.charge(1), circuits.heat(1)), (0.0, 0.0, 0.0));
        circuits.set_conducting(1, true);
        circuits.advance(&volts(&[30.0, -48.0, 5.0]));
        assert!(circuits.currents()[1] < 0.0);
    }

    #[test]
    fn shorted_turns_change_inductance_with_the_square_of_what_is_left() {
        let mut circuits = Circuits::new(&[COIL; 2], &[1.0, 0.2, 0.2, 1.0], 5e-4);
        circuits.set_turns(0, 0.5);
        circuits.set_resistance(0, 2.5);
        assert!((circuits.inductance(0) - 0.025).abs() < 1e-15 && circuits.inductance(1) == 0.1);
        // The other coil open, the shorted one has a time constant of 10 ms.
        circuits.set_conducting(1, false);
        circuits.advance(&volts(&[10.0]));
        let expected = 4.0 * -(-5e-4_f64 / 0.01).exp_m1();
        assert!((circuits.currents()[0] - expected).abs() < 1e-12);
    }

    #[test]
    fn a_resistance_within_the_tolerance_waits_for_the_next_that_is_beyond_it() {
        let mut circuits = Circuits::new(&[COIL; 2], &[1.0, 0.0, 0.0, 1.0], 5e-4);
        circuits.advance(&volts(&[1.0]));
        circuits.set_resistance(0, 5.0 * (1.0 + 0.5 * RESISTANCE_TOLERANCE));
        circuits.advance(&volts(&[1.0]));
        assert_eq!(circuits.resistance(0), 5.0);
        circuits.set_resistance(1, 5.5);
        circuits.advance(&volts(&[1.0]));
        assert_eq!(circuits.resistance(0), 5.0 * (1.0 + 0.5 * RESISTANCE_TOLERANCE));
        assert_eq!(circuits.resistance(1), 5.5);
    }

    /// Goal: no current grows beyond what its supply can drive, whatever the voltages do; with coupling,
    /// beyond what the energy allows: `d(i L i / 2)/dt = i v - i R i` is negative once `|i| > |v| / R`, hence
    /// `|i| <= sqrt(l_max / l_min) sqrt(n) V / R`.
    #[test]
    fn currents_stay_within_supply_over_resistance_at_any_step() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for (coupling, bound) in [(0.0, 9.6), (-0.2, 9.6 * (1.2_f64 / 0.6 * 3.0).sqrt())] {
            for step in [5e-5, 5e-4, 2e-3] {
                let coefficients =
                    [1.0, coupling, coupling, coupling, 1.0, coupling, coupling, coupling, 1.0];
                let mut circuits = Circuits::new(&[COIL; 3], &coefficients, step);
                let mut most = 0.0_f64;
                for _ in 0..20_000 {
                    let voltages = [(); 3].map(|()| if random.random_bool(0.02) { 48.0 } else { -48.0 });
                    let flipped = random.random_bool(0.5);
                    let voltages = voltages.map(|voltage| if flipped { -voltage } else { voltage });
                    for _ in 0..random.random_range(1..40) {
                        circuits.advance(&volts(&voltages));
                        for current in circuits.currents() {
                            most = most.max(current.abs());
                        }
                    }
                }
                assert!(most <= bound * (1.0 + 1e-12) && most > 5.0, "{coupling}, {step}: {most} A");
            }
        }
    }

    #[test]
    fn a_rig_without_coils_advances() {
        let mut circuits = Circuits::new(&[], &[], 5e-4);
        circuits.advance(&[0.0; COILS_MAX]);
        assert_eq!((circuits.work(), circuits.stored_energy()), (0.0, 0.0));
    }
}
