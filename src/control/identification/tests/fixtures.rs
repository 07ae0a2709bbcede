//! Samples made by the model itself.

use magsteer_hal::config::HardwareConfig;
use magsteer_hal::{Actuation, HardwareDescription};
use nalgebra::Vector3;

use crate::control::identification::equilibria::Model;
use crate::control::identification::excitation::{ExcitationRequest, excitations};
use crate::control::identification::{
    IdentifyRequest, MagnetReading, Noise, NoiseLevel, Parameter, Parameters, Priors, Sample, Stiffness,
};
use crate::math::{SplitMix, orthonormal_complement};
use crate::rod::RodConfig;

const SHIPPED: &str = include_str!("../../../../config/bigmag-planar.toml");
const RIG_TABLES: [&str; 5] = ["rig", "frames", "coil_types", "coils", "manipulator"];

/// BigMag and its manipulator as tables, on the shipped mesh.
pub struct Rig {
    pub hardware: HardwareConfig,
    pub description: HardwareDescription,
    pub rod: RodConfig,
}

impl Rig {
    pub fn shipped() -> Self {
        let mut file: toml::Table = SHIPPED.parse().expect("shipped");
        let rod: RodConfig = file["rod"].clone().try_into().expect("shipped");
        file.retain(|table, _| RIG_TABLES.contains(&table));
        let hardware: HardwareConfig = file.try_into().expect("shipped");
        Self { description: hardware.build().expect("shipped"), hardware, rod }
    }

    pub fn parameters(&self, priors: &Priors) -> Parameters {
        Parameters::new(&self.hardware, priors, Stiffness::Common)
    }

    /// Currents and angles that the rod bears.
    pub fn excitations(&self, count: usize, seed: u64) -> Vec<Actuation> {
        let manipulator = self.rod.build(&self.description).expect("shipped");
        let request =
            ExcitationRequest { count, seed, current_share: 0.4, angle_max: 0.5, determinant_min: 0.5 };
        excitations(&self.description, &manipulator, &request).expect("the rod bears that")
    }

    /// Noiseless samples of a rig with these values of the parameters.
    pub fn samples(&self, parameters: &Parameters, values: &[f64], at: &[Actuation]) -> Vec<Sample> {
        let mut model = Model::new(parameters, &self.rod, values).expect("near the shipped rig");
        let sample = |(index, actuation): (usize, &Actuation)| {
            let mut sample = Sample { line: index + 2, actuation: *actuation, magnets: Vec::new() };
            let modelled =
                model.at(&sample, None).unwrap_or_else(|| panic!("snaps through: {values:?} {actuation:?}"));
            let magnets = modelled.magnets.iter();
            sample.magnets = magnets
                .map(|magnet| {
                    Some(MagnetReading { tangent: magnet.tangent, position: Some(magnet.position) })
                })
                .collect();
            sample
        };
        at.iter().enumerate().map(sample).collect()
    }
}

/// Priors as the command has them.
pub const PRIORS: Priors =
    Priors { modulus: 0.2, moment: 0.1, gain: 0.03, base_position: 2e-3, base_rotation: 0.035 };

/// A request with stated noise.
pub fn stated(orientation: f64, position: f64) -> IdentifyRequest {
    IdentifyRequest {
        priors: PRIORS,
        stiffness: Stiffness::Common,
        noise: Noise { orientation: NoiseLevel::Stated(orientation), position: NoiseLevel::Stated(position) },
        outlier_sigma: 4.0,
    }
}

/// Turns each tangent by two normal angles and shifts each coordinate.
pub fn blur(samples: &mut [Sample], orientation: f64, position: f64, stream: &mut SplitMix) {
    for reading in samples.iter_mut().flat_map(|sample| sample.magnets.iter_mut().flatten()) {
        let [first, second] = orthonormal_complement(&reading.tangent);
        let turned = reading.tangent + (first * stream.normal() + second * stream.normal()) * orientation;
        reading.tangent = turned.normalize();
        if let Some(center) = &mut reading.position {
            *center += Vector3::from_fn(|_, _| stream.normal()) * position;
        }
    }
}

/// Values drawn from the priors, `share` of their deviations.
pub fn drawn(parameters: &Parameters, share: f64, stream: &mut SplitMix) -> Vec<f64> {
    parameters.deviations().iter().map(|deviation| share * deviation * stream.normal()).collect()
}

/// The same without what no equilibrium shows: a turn of a straight rod's clamp about its tangent, and
/// moments that are greater by as much as all coils are weaker. The prior puts these to nothing.
pub fn visible(parameters: &Parameters, mut values: Vec<f64>) -> Vec<f64> {
    let scale = parameters.free().iter().map(|of| match of {
        Parameter::Moment { .. } => 1.0,
        Parameter::Gain { .. } => -1.0,
        _ => 0.0,
    });
    let scale: Vec<f64> = scale.collect();
    let product = |values: &[f64]| -> f64 {
        let pairs = values.iter().zip(&scale).zip(parameters.deviations());
        pairs.map(|((value, scale), deviation)| value * scale / deviation.powi(2)).sum()
    };
    let share = product(&values) / product(&scale);
    for ((value, scale), of) in values.iter_mut().zip(&scale).zip(parameters.free()) {
        *value -= share * scale;
        if *of == (Parameter::BaseRotation { axis: 0 }) {
            *value = 0.0;
        }
    }
    values
}
