//! All coils with their amplifiers, windings and current sensors, whatever is wrong with them.
//!
//! In a step each bridge puts a voltage over its coil: that of its controller, which sees the measured
//! current of the step before; or, when it is stuck, what it holds; or, cut off, that of the supply against
//! the current, through the bridge's diodes, until the current is gone and they block. Then the circuits take
//! the step, and its heat warms the windings.

use magsteer_hal::COILS_MAX;
use magsteer_hal::HardwareDescription;

use super::amplifier::Amplifier;
use super::circuit::{CircuitValues, Circuits};
use super::condition::{CoilCondition, Held};
use super::coupling::Couplings;
use super::sensor::{CurrentSensorCharacter, CurrentSensors};
use super::winding::{Winding, WindingCharacter};

/// What coils and amplifiers are like.
#[derive(Debug, Clone, PartialEq)]
pub struct CoilsSettings {
    /// Of the current controllers, rad/s.
    pub bandwidth: f64,
    /// The current sensors.
    pub sensor: CurrentSensorCharacter,
    /// The windings.
    pub winding: WindingCharacter,
    /// Which coils share flux; for as many coils as the description has.
    pub couplings: Couplings,
}

/// One coil and its bridge.
#[derive(Debug, Clone)]
struct Coil {
    amplifier: Amplifier,
    winding: Winding,
    /// Described resistance, ohm.
    resistance: f64,
    condition: CoilCondition,
    /// What the bridge put on in the last step, V; 0 while it is cut.
    voltage: f64,
    /// Voltage or current of a bridge that is stuck.
    held: f64,
}

/// Coils and amplifiers at work.
#[derive(Debug, Clone)]
pub struct Coils {
    coils: Vec<Coil>,
    circuits: Circuits,
    sensors: CurrentSensors,
    measured: [f64; COILS_MAX],
}

impl Coils {
    /// Without current, as warm as their surroundings. `step` in s; sensor errors come from `seed`.
    #[must_use]
    pub fn new(description: &HardwareDescription, settings: &CoilsSettings, step: f64, seed: u64) -> Self {
        let coils: Vec<Coil> = description
            .coils
            .iter()
            .map(|coil| Coil {
                amplifier: Amplifier::new(coil, settings.bandwidth, step),
                winding: Winding::new(settings.winding, step),
                resistance: coil.resistance,
                condition: CoilCondition::Healthy,
                voltage: 0.0,
                held: 0.0,
            })
            .collect();
        let values: Vec<CircuitValues> = coils
            .iter()
            .zip(&description.coils)
            .map(|(coil, described)| CircuitValues {
                resistance: coil.true_resistance(),
                inductance: described.inductance,
            })
            .collect();
        let circuits = Circuits::new(&values, settings.couplings.matrix(), step);
        let mut sensors = CurrentSensors::new(settings.sensor, coils.len(), seed);
        let mut measured = [0.0; COILS_MAX];
        sensors.measure(&circuits.currents()[..coils.len()], &mut measured);
        Self { coils, circuits, sensors, measured }
    }

    /// Follows set points, A, for one step, or cuts all bridges.
    pub fn follow(&mut self, wanted: &[f64; COILS_MAX], is_cut: bool) {
        let mut voltages = [0.0; COILS_MAX];
        for (index, coil) in self.coils.iter_mut().enumerate() {
            let measured = self.measured[index];
            if is_cut {
                coil.amplifier.rest(measured);
                coil.voltage = 0.0;
                let supply = coil.amplifier.supply();
                voltages[index] = self.circuits.voltage_to_zero(index).clamp(-supply, supply);
            } else {
                self.circuits.set_conducting(index, coil.condition != CoilCondition::Open);
                coil.voltage = coil.driven_voltage(wanted[index], measured);
                voltages[index] = coil.voltage;
            }
        }
        self.circuits.advance(&voltages);
        for (index, coil) in self.coils.iter_mut().enumerate() {
            // Less than the supply was enough: the current has come to zero, and the diodes block. What other
            // coils induced meanwhile goes over to them.
            if is_cut && voltages[index].abs() < coil.amplifier.supply() {
                self.circuits.set_conducting(index, false);
            }
            coil.winding.heat(self.circuits.heat(index));
            self.circuits.set_resistance(index, coil.true_resistance());
        }
        let count = self.coils.len();
        self.sensors.measure(&self.circuits.currents()[..count], &mut self.measured[..count]);
    }

    /// Sets what is wrong with a coil; a condition that it already has changes nothing.
    pub fn set_condition(&mut self, index: usize, condition: CoilCondition) {
        let coil = &mut self.coils[index];
        if coil.condition == condition {
            return;
        }
        coil.condition = condition;
        coil.held = match condition {
            CoilCondition::StuckAmplifier { holds: Held::Current } => self.measured[index],
            _ => coil.voltage,
        };
        coil.amplifier.set_turns(condition.turns());
        self.circuits.set_turns(index, condition.turns());
        self.circuits.set_resistance(index, coil.true_resistance());
        if condition == CoilCondition::Open {
            self.circuits.set_conducting(index, false);
        }
    }

    /// True currents, A.
    #[must_use]
    pub fn currents(&self) -> &[f64; COILS_MAX] {
        self.circuits.currents()
    }

    /// Currents as the sensors say, A.
    #[must_use]
    pub fn measured(&self) -> &[f64; COILS_MAX] {
        &self.measured
    }

    /// The current, A, with which a coil of all its turns would make the field of this one.
    #[must_use]
    pub fn field_current(&self, index: usize) -> f64 {
        self.circuits.currents()[index] * self.coils[index].condition.turns()
    }

    /// Temperature of a winding, K.
    #[must_use]
    pub fn temperature(&self, index: usize) -> f64 {
        self.coils[index].winding.temperature()
    }

    /// How many coils there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.coils.len()
    }

    /// The circuits, for their energies.
    #[must_use]
    pub fn circuits(&self) -> &Circuits {
        &self.circuits
    }
}

impl Coil {
    /// Ohm, of the turns that work, as warm as they are.
    fn true_resistance(&self) -> f64 {
        self.resistance * self.condition.turns() * self.winding.resistance_ratio()
    }

    fn driven_voltage(&mut self, wanted: f64, measured: f64) -> f64 {
        match self.condition {
            CoilCondition::StuckAmplifier { holds: Held::Current } => {
                self.amplifier.follow(self.held, measured)
            }
            CoilCondition::StuckAmplifier { holds: Held::Voltage } => {
                // The controller does not know that nobody listens.
                self.amplifier.follow(wanted, measured);
                self.held
            }
            CoilCondition::Healthy | CoilCondition::Open | CoilCondition::ShortedTurns { .. } => {
                self.amplifier.follow(wanted, measured)
            }
        }
    }
}
