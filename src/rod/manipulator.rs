//! The manipulator as constants: parts cut into steps, gravity, clamp and units of the residual.

use magsteer_hal::description::PartDescription;
use magsteer_hal::invalid::{Checks, Invalid};
use magsteer_hal::{HardwareDescription, MAGNETS_MAX};

use crate::math::Triple;

use super::config::SolverOptions;
use super::magnet::Magnet;
use super::section::Section;
use super::state::Frame;

/// One part of the chain.
#[derive(Debug, Clone, PartialEq)]
pub enum Part {
    /// Flexible.
    Section(Section),
    /// Rigid.
    Magnet(Magnet),
}

/// A clamped chain of sections and magnets. Constants only: all state is in a [`super::Pass`].
#[derive(Debug, Clone, PartialEq)]
pub struct Manipulator {
    pub(super) parts: Vec<Part>,
    pub(super) base_position: Triple,
    pub(super) base_frame: Frame,
    pub(super) gravity: Triple,
    pub(super) options: SolverOptions,
    /// Unit of forces in the scaled residual, EI/L^2, N.
    pub(super) force_unit: f64,
    /// Unit of moments in the scaled residual, EI/L, N m.
    pub(super) moment_unit: f64,
    /// False when twist matters to the tangents: a section is precurved, or a moment off the tangent.
    pub(super) axial: bool,
    magnets: usize,
}

impl Manipulator {
    /// The manipulator of `description`, its sections cut into steps of at most `segment_length_max` (m).
    ///
    /// # Errors
    /// No flexible section, more magnets than [`MAGNETS_MAX`], a length or stiffness that is not
    /// finite and > 0, a step that is not.
    pub fn new(
        description: &HardwareDescription,
        segment_length_max: f64,
        options: SolverOptions,
    ) -> Result<Self, Vec<Invalid>> {
        check(description, segment_length_max)?;
        let chain = &description.manipulator;
        let parts: Vec<Part> = chain
            .parts
            .iter()
            .map(|part| match part {
                PartDescription::Section(section) => Part::Section(Section::new(section, segment_length_max)),
                PartDescription::Magnet(magnet) => Part::Magnet(Magnet::new(magnet)),
            })
            .collect();
        let sections = || {
            parts
                .iter()
                .filter_map(|part| if let Part::Section(section) = part { Some(section) } else { None })
        };
        let length: f64 = sections().map(|section| section.length).sum();
        // Mean compliance, so that a short stiff section does not set the scale.
        let compliance: f64 = sections().map(|section| section.length / section.bending_stiffness).sum();
        let moment_unit = 1.0 / compliance;
        let axial = parts.iter().all(|part| match part {
            Part::Section(section) => !section.curved,
            Part::Magnet(magnet) => magnet.axial,
        });
        Ok(Self {
            base_position: chain.base_position.into(),
            base_frame: Frame::from_rows(&chain.base_rotation),
            gravity: description.gravity.into(),
            options,
            force_unit: moment_unit / length,
            moment_unit,
            axial,
            magnets: description.magnets().count(),
            parts,
        })
    }

    /// Number of magnets.
    #[must_use]
    pub fn magnet_count(&self) -> usize {
        self.magnets
    }

    /// Units of the scaled residual: force EI/L^2 (N) and moment EI/L (N m), of the mean compliance.
    #[must_use]
    pub fn residual_units(&self) -> (f64, f64) {
        (self.force_unit, self.moment_unit)
    }

    /// The flexible sections from base to tip.
    pub fn sections(&self) -> impl Iterator<Item = &Section> {
        self.parts.iter().filter_map(|part| match part {
            Part::Section(section) => Some(section),
            Part::Magnet(_) => None,
        })
    }
}

fn check(description: &HardwareDescription, segment_length_max: f64) -> Result<(), Vec<Invalid>> {
    let mut checks = Checks::new();
    checks.positive("segment_length_max", segment_length_max);
    let magnets = description.magnets().count();
    checks.require(
        magnets <= MAGNETS_MAX,
        "manipulator.parts",
        format!("{magnets} magnets"),
        format!("at most {MAGNETS_MAX} magnets"),
    );
    let parts = &description.manipulator.parts;
    let flexible = parts.iter().any(|part| matches!(part, PartDescription::Section(_)));
    checks.require(flexible, "manipulator.parts", "no section", "at least one flexible section");
    for (index, part) in parts.iter().enumerate() {
        let key = |name: &str| format!("manipulator.parts[{index}].{name}");
        match part {
            PartDescription::Section(section) => {
                checks.positive(key("length"), section.length);
                checks.positive(key("bending_stiffness"), section.bending_stiffness);
                checks.positive(key("torsion_stiffness"), section.torsion_stiffness);
                checks.finite(key("precurvature"), &section.precurvature);
                if let Some(extensible) = section.extensible {
                    checks.positive(key("shear"), extensible.shear);
                    checks.positive(key("axial"), extensible.axial);
                }
            }
            PartDescription::Magnet(magnet) => {
                checks.positive(key("length"), magnet.length);
                checks.finite(key("moment_body"), &magnet.moment_body);
            }
        }
    }
    checks.into_result(())
}
