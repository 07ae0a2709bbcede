//! The parameters, and the rig's tables with them applied.

use magsteer_hal::config::{HardwareConfig, PartConfig};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// How far nominal values are trusted: standard deviations; 0 holds the value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Priors {
    /// Of every elastic stiffness, relative.
    pub modulus: f64,
    /// Of every magnet's moment, relative.
    pub moment: f64,
    /// Of every coil's field per ampere, relative.
    pub gain: f64,
    /// Of each coordinate of the clamp, m.
    pub base_position: f64,
    /// Of each component of the clamp's rotation vector, rad.
    pub base_rotation: f64,
}

/// Which stiffnesses share one factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stiffness {
    /// All sections.
    Common,
    /// The sections of each material; those given by their stiffness are one more.
    PerMaterial,
}

/// One parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parameter {
    /// Logarithm of a factor on the stiffness of a group of sections.
    Modulus {
        /// Index of the group.
        group: usize,
    },
    /// Logarithm of a factor on a magnet's moment.
    Moment {
        /// Index of the magnet, base to tip.
        magnet: usize,
    },
    /// Logarithm of a factor on a coil's field per ampere.
    Gain {
        /// Index of the coil.
        coil: usize,
    },
    /// Shift of the clamp along a world axis, m.
    BasePosition {
        /// 0 to 2.
        axis: usize,
    },
    /// Component of the rotation vector that turns the clamp from where it nominally is, world, rad.
    BaseRotation {
        /// 0 to 2.
        axis: usize,
    },
}

/// Sections that share one factor.
#[derive(Debug, Clone, PartialEq)]
struct Group {
    name: String,
    sections: Vec<usize>,
}

/// The free parameters of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameters {
    nominal: HardwareConfig,
    groups: Vec<Group>,
    free: Vec<Parameter>,
    deviations: Vec<f64>,
    names: Vec<String>,
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl Parameters {
    /// Those of `nominal` that the priors leave free.
    #[must_use]
    pub fn new(nominal: &HardwareConfig, priors: &Priors, stiffness: Stiffness) -> Self {
        let mut parameters = Self {
            nominal: nominal.clone(),
            groups: groups(nominal, stiffness),
            free: Vec::new(),
            deviations: Vec::new(),
            names: Vec::new(),
        };
        for group in 0..parameters.groups.len() {
            let name = format!("modulus {}", parameters.groups[group].name);
            parameters.add(Parameter::Modulus { group }, priors.modulus, name);
        }
        let magnets = nominal.manipulator.parts.iter().filter_map(|part| match part {
            PartConfig::Magnet(magnet) => Some(magnet),
            PartConfig::Section(_) | PartConfig::StiffnessSection(_) => None,
        });
        for (index, magnet) in magnets.enumerate() {
            // A moment of zero has no factor.
            let deviation = if magnet.moment_body_a_m2 == [0.0; 3] { 0.0 } else { priors.moment };
            parameters.add(Parameter::Moment { magnet: index }, deviation, format!("moment {}", magnet.name));
        }
        for (coil, described) in nominal.coils.iter().enumerate() {
            parameters.add(Parameter::Gain { coil }, priors.gain, format!("gain {}", described.name));
        }
        for (axis, letter) in AXES.iter().enumerate() {
            let name = format!("base position {letter}");
            parameters.add(Parameter::BasePosition { axis }, priors.base_position, name);
        }
        for (axis, letter) in AXES.iter().enumerate() {
            let name = format!("base rotation {letter}");
            parameters.add(Parameter::BaseRotation { axis }, priors.base_rotation, name);
        }
        parameters
    }

    fn add(&mut self, parameter: Parameter, deviation: f64, name: String) {
        if deviation > 0.0 {
            self.free.push(parameter);
            self.deviations.push(deviation);
            self.names.push(name);
        }
    }

    /// The free parameters, in the order of every vector of them.
    #[must_use]
    pub fn free(&self) -> &[Parameter] {
        &self.free
    }

    /// Standard deviations of their priors, in the units of [`Parameter`].
    #[must_use]
    pub fn deviations(&self) -> &[f64] {
        &self.deviations
    }

    /// Their names, for people.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Sections that a group's factor acts on, counted from the base.
    ///
    /// # Panics
    /// When there is no such group.
    #[must_use]
    pub fn sections(&self, group: usize) -> &[usize] {
        &self.groups[group].sections
    }

    /// The clamp's rotation vector among `values`, rad.
    #[must_use]
    pub fn base_rotation(&self, values: &[f64]) -> Vector3<f64> {
        self.triple(values, |parameter| match parameter {
            Parameter::BaseRotation { axis } => Some(axis),
            _ => None,
        })
    }

    /// The rig's tables with these values.
    #[must_use]
    pub fn applied(&self, values: &[f64]) -> HardwareConfig {
        let mut hardware = self.nominal.clone();
        for (parameter, value) in self.free.iter().zip(values) {
            match *parameter {
                Parameter::Modulus { group } => self.stiffen(&mut hardware, group, value.exp()),
                Parameter::Moment { magnet } => magnetise(&mut hardware, magnet, value.exp()),
                Parameter::Gain { coil } => {
                    let coil = &mut hardware.coils[coil];
                    coil.gain = Some(coil.gain.unwrap_or(1.0) * value.exp());
                }
                Parameter::BasePosition { axis } => {
                    hardware.manipulator.base_position_mm[axis] += value * 1e3
                }
                Parameter::BaseRotation { .. } => {}
            }
        }
        let turn = self.base_rotation(values);
        if turn != Vector3::zeros() {
            turn_base(&mut hardware, &turn);
        }
        hardware
    }

    fn stiffen(&self, hardware: &mut HardwareConfig, group: usize, factor: f64) {
        let manipulator = &mut hardware.manipulator;
        let sections = manipulator.parts.iter_mut().filter(|part| !matches!(part, PartConfig::Magnet(_)));
        let mut materials = Vec::new();
        for (index, part) in sections.enumerate() {
            if !self.groups[group].sections.contains(&index) {
                continue;
            }
            match part {
                PartConfig::Section(section) => materials.push(section.material.clone()),
                PartConfig::StiffnessSection(section) => {
                    section.bending_n_m2 *= factor;
                    section.torsion_n_m2 *= factor;
                    for stiffness in [&mut section.shear_n, &mut section.axial_n].into_iter().flatten() {
                        *stiffness *= factor;
                    }
                }
                PartConfig::Magnet(_) => {}
            }
        }
        for (name, material) in &mut manipulator.materials {
            if materials.contains(name) {
                material.young_modulus_mpa *= factor;
            }
        }
    }

    fn triple(&self, values: &[f64], axis: impl Fn(Parameter) -> Option<usize>) -> Vector3<f64> {
        let mut triple = Vector3::zeros();
        for (parameter, value) in self.free.iter().zip(values) {
            if let Some(axis) = axis(*parameter) {
                triple[axis] = *value;
            }
        }
        triple
    }
}

fn groups(hardware: &HardwareConfig, stiffness: Stiffness) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    let sections = hardware.manipulator.parts.iter().filter(|part| !matches!(part, PartConfig::Magnet(_)));
    for (index, part) in sections.enumerate() {
        let name = match (stiffness, part) {
            (Stiffness::Common, _) => "of all sections",
            (Stiffness::PerMaterial, PartConfig::Section(section)) => section.material.as_str(),
            (Stiffness::PerMaterial, _) => "of sections given by stiffness",
        };
        match groups.iter_mut().find(|group| group.name == name) {
            Some(group) => group.sections.push(index),
            None => groups.push(Group { name: name.to_owned(), sections: vec![index] }),
        }
    }
    groups
}

fn magnetise(hardware: &mut HardwareConfig, index: usize, factor: f64) {
    let magnets = hardware.manipulator.parts.iter_mut().filter_map(|part| match part {
        PartConfig::Magnet(magnet) => Some(magnet),
        PartConfig::Section(_) | PartConfig::StiffnessSection(_) => None,
    });
    for magnet in magnets.skip(index).take(1) {
        magnet.moment_body_a_m2 = magnet.moment_body_a_m2.map(|component| component * factor);
    }
}

/// Turns the clamp by a rotation vector in the world.
fn turn_base(hardware: &mut HardwareConfig, turn: &Vector3<f64>) {
    // What cannot be built has been refused before a fit begins.
    let Ok(description) = hardware.build() else { return };
    let rows = description.manipulator.base_rotation;
    let nominal = Matrix3::from_fn(|row, column| rows[row][column]);
    let turned = Rotation3::from_scaled_axis(*turn).matrix() * nominal;
    let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| turned[(row, column)]));
    hardware.manipulator.set_base_rotation(&rows);
}
