//! How warm a coil gets, and what that does to its resistance.
//!
//! | symbol | meaning |
//! |---|---|
//! | `T`, `T_a` | temperature of the winding, and of its surroundings, K |
//! | `T_0` | temperature at which the described resistance holds, K |
//! | `R_0`, `R` | described resistance, and at `T`, ohm |
//! | `alpha` | temperature coefficient, 1/K; copper 0.00393 at 20 degrees Celsius |
//! | `C`, `Z` | heat capacity, J/K; thermal resistance to the surroundings, K/W |
//! | `P` | heat a second, W |
//!
//! `R = R_0 (1 + alpha (T - T_0))`                                                               (9)
//!
//! `C dT/dt = P - (T - T_a) / Z`                                                                 (10)
//!
//! solved exactly over a step in which `P` is its mean: stable at any step.
//!
//! `T <- T_s + (T - T_s) exp(-t / (Z C))`,  `T_s = T_a + P Z`                                    (11)
//!
//! Left out: a winding has one temperature, neither hot spots nor a core; nothing but the resistance depends
//! on it.

/// What windings are like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindingCharacter {
    /// `T_a`, K.
    pub ambient: f64,
    /// `T_0`, K.
    pub reference: f64,
    /// `alpha`, 1/K.
    pub coefficient: f64,
    /// `Z`, K/W.
    pub thermal_resistance: f64,
    /// `C`, J/K.
    pub heat_capacity: f64,
}

/// One coil's winding.
#[derive(Debug, Clone)]
pub struct Winding {
    character: WindingCharacter,
    step: f64,
    /// `1 - exp(-t / (Z C))`
    approach: f64,
    temperature: f64,
}

impl Winding {
    /// As warm as its surroundings. `step` in s.
    #[must_use]
    pub fn new(character: WindingCharacter, step: f64) -> Self {
        let time_constant = character.thermal_resistance * character.heat_capacity;
        let approach = -(-step / time_constant).exp_m1();
        Self { character, step, approach, temperature: character.ambient }
    }

    /// Temperature, K.
    #[must_use]
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Present resistance over the described one.
    #[must_use]
    pub fn resistance_ratio(&self) -> f64 {
        let character = &self.character;
        1.0 + character.coefficient * (self.temperature - character.reference) // (9)
    }

    /// Takes the heat of a step, J.
    pub fn heat(&mut self, heat: f64) {
        let steady = self.character.ambient + heat / self.step * self.character.thermal_resistance;
        self.temperature += (steady - self.temperature) * self.approach; // (11)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: f64 = 2e-3;
    const CHARACTER: WindingCharacter = WindingCharacter {
        ambient: 293.15,
        reference: 298.15,
        coefficient: 0.00393,
        thermal_resistance: 0.5,
        heat_capacity: 4.0,
    };

    #[test]
    fn constant_heat_warms_by_the_exponential_of_the_thermal_time_constant() {
        let mut winding = Winding::new(CHARACTER, STEP);
        for step in 1..=3000 {
            winding.heat(80.0 * STEP);
            let time = f64::from(step) * STEP;
            let expected = 293.15 + 40.0 * (1.0 - (-time / 2.0).exp());
            assert!((winding.temperature() - expected).abs() < 1e-9, "{time} s");
        }
    }

    #[test]
    fn resistance_is_the_described_one_at_the_reference_and_rises_with_coppers_coefficient() {
        let mut winding = Winding::new(CHARACTER, STEP);
        assert!((winding.resistance_ratio() - (1.0 - 5.0 * 0.00393)).abs() < 1e-12);
        // 10 W: 5 K above the surroundings, which is the reference.
        (0..20_000).for_each(|_| winding.heat(10.0 * STEP));
        assert!((winding.resistance_ratio() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_step_far_longer_than_the_time_constant_ends_at_the_steady_temperature() {
        let character = WindingCharacter { heat_capacity: 1e-6, ..CHARACTER };
        let mut winding = Winding::new(character, STEP);
        for _ in 0..3 {
            winding.heat(80.0 * STEP);
            assert!((winding.temperature() - 333.15).abs() < 1e-9);
        }
    }
}
