//! A fibre in the rod's core that feels curvature at stations along it, as by Bragg gratings.
//!
//! `k_i = kappa(s_i) + o_i + e_i`: the true curvature at station `i`, an offset that a station keeps (drawn
//! once from the seed, what calibration leaves over), and noise of each exposure; all normal and independent,
//! about body x and y and, when the fibre tells twist, about the tangent. Stations lie in the middle of equal
//! stretches from base to tip.

use magsteer_hal::PoseMessage;
use magsteer_hal::description::{ManipulatorDescription, PartDescription};
use magsteer_hal::shape::{CurvatureError, CurvatureShape};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::rod::Rod;

/// Stream of the plant's seed from which the fibre draws.
const RANDOM_STREAM: u64 = 3;

/// What a fibre is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FibreCharacter {
    /// Stations along the whole rod.
    pub stations: usize,
    /// Standard deviation of a reading's noise, 1/m.
    pub noise: f64,
    /// Standard deviation of a station's lasting offset, 1/m.
    pub offset: f64,
    /// Whether it tells twist; one that does not reports zero.
    pub measures_twist: bool,
}

/// A fibre at work.
#[derive(Debug, Clone)]
pub(super) struct Fibre {
    noise: f64,
    measures_twist: bool,
    random: ChaCha8Rng,
    stations: Vec<f64>,
    offsets: Vec<[f64; 3]>,
    readings: Vec<[f64; 3]>,
    shape: CurvatureShape,
}

impl Fibre {
    /// # Errors
    /// When a section has no station.
    pub fn new(
        character: FibreCharacter,
        manipulator: &ManipulatorDescription,
        seed: u64,
    ) -> Result<Self, CurvatureError> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(RANDOM_STREAM);
        let length = length(manipulator);
        let count = character.stations;
        let stations: Vec<f64> =
            (0..count).map(|index| length * (index as f64 + 0.5) / count as f64).collect();
        let offsets = (0..count).map(|_| normals(&mut random).map(|draw| draw * character.offset)).collect();
        Ok(Self {
            noise: character.noise,
            measures_twist: character.measures_twist,
            random,
            shape: CurvatureShape::new(manipulator, &stations)?,
            readings: vec![[0.0; 3]; count],
            stations,
            offsets,
        })
    }

    /// One exposure; `None` when it is lost.
    pub fn feel(&mut self, rod: &Rod, dropout_probability: f64) -> Option<PoseMessage> {
        let lost = self.random.random_bool(dropout_probability);
        let stations = self.stations.iter().zip(&self.offsets);
        for ((s, offset), reading) in stations.zip(&mut self.readings) {
            let (curvature, noise) = (rod.centreline_curvature(*s), normals(&mut self.random));
            *reading = [0, 1, 2].map(|axis| curvature[axis] + offset[axis] + self.noise * noise[axis]);
            if !self.measures_twist {
                reading[2] = 0.0;
            }
        }
        let found = self.shape.reconstruct(&self.readings);
        if lost { None } else { found.ok() }
    }
}

/// m
pub(super) fn length(manipulator: &ManipulatorDescription) -> f64 {
    let length = |part: &PartDescription| match part {
        PartDescription::Section(section) => section.length,
        PartDescription::Magnet(magnet) => magnet.length,
    };
    manipulator.parts.iter().map(length).sum()
}

fn normals(random: &mut ChaCha8Rng) -> [f64; 3] {
    [0; 3].map(|_| StandardNormal.sample(random))
}
