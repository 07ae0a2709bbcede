//! The shipped rig and controller, and random numbers, that several tests share.

use magsteer_hal::config::HardwareConfig;
use magsteer_hal::{Actuation, HardwareDescription};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::control::ControlConfig;
use crate::rod::{Manipulator, RodConfig};

const SHIPPED: &str = include_str!("../../../config/bigmag-planar.toml");
const RIG_TABLES: [&str; 5] = ["rig", "frames", "coil_types", "coils", "manipulator"];

/// BigMag, its manipulator on the shipped mesh, and its controller.
pub struct Rig {
    pub description: HardwareDescription,
    pub manipulator: Manipulator,
    pub control: ControlConfig,
}

impl Rig {
    pub fn shipped() -> Self {
        let mut file: toml::Table = SHIPPED.parse().expect("shipped");
        let control: ControlConfig = file["control"].clone().try_into().expect("shipped");
        let rod: RodConfig = file["rod"].clone().try_into().expect("shipped");
        file.retain(|table, _| RIG_TABLES.contains(&table));
        let hardware: HardwareConfig = file.try_into().expect("shipped");
        let description = hardware.build().expect("shipped");
        let manipulator = rod.build(&description).expect("shipped");
        Self { description, manipulator, control }
    }

    pub fn coils(&self) -> usize {
        self.description.coils.len()
    }

    pub fn parameters(&self) -> usize {
        self.coils() + self.description.frames.len()
    }

    /// Least and greatest value and greatest rate of every parameter, A and rad.
    pub fn limits(&self) -> Vec<[f64; 3]> {
        let coils = self.description.coils.iter();
        let coils = coils.map(|coil| [-coil.current_max, coil.current_max, coil.slew_max]);
        let frames = self.description.frames.iter();
        coils.chain(frames.map(|frame| [frame.angle_min, frame.angle_max, frame.speed_max])).collect()
    }

    /// Currents and angles with these values.
    pub fn actuation(&self, values: &[f64]) -> Actuation {
        let mut actuation = Actuation::default();
        let (currents, angles) = values.split_at(self.coils());
        actuation.current_a[..currents.len()].copy_from_slice(currents);
        actuation.angle_rad[..angles.len()].copy_from_slice(angles);
        actuation
    }

    /// Values of currents and angles in the rig's order.
    pub fn values(&self, actuation: &Actuation) -> Vec<f64> {
        let angles = self.parameters() - self.coils();
        let currents = actuation.current_a[..self.coils()].iter();
        currents.chain(&actuation.angle_rad[..angles]).copied().collect()
    }
}

pub fn seeded(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// `count` numbers up to `size` in magnitude.
pub fn numbers(count: usize, size: f64, random: &mut ChaCha8Rng) -> Vec<f64> {
    (0..count).map(|_| random.random_range(-size..=size)).collect()
}

/// A size between `least` and `most`, every decade as likely.
pub fn any_size(least: f64, most: f64, random: &mut ChaCha8Rng) -> f64 {
    random.random_range(least.ln()..most.ln()).exp()
}
