//! Estimates as a TOML file that extends the configuration they were made from.
//!
//! Tables merge key by key, so that of a table only what was estimated is written. Arrays of tables replace
//! as a whole: all coils are written where a gain was free, all parts where a moment was, or a stiffness
//! that stands in a part.

use std::path::Path;

use magsteer::control::identification::{Identified, IdentifyRequest, NoiseLevel, Parameter};
use magsteer_hal::config::{ManipulatorConfig, PartConfig};

use super::identify::Subject;
use super::identify_answer::parameters;
use crate::cli::overlay::{coil_entry, key, nominal_entry, path_from, quoted};

/// The whole file.
pub(super) fn text(subject: &Subject, found: &Identified, request: &IdentifyRequest, out: &Path) -> String {
    let is_free = |is: fn(&Parameter) -> bool| found.estimates.iter().any(|estimate| is(&estimate.parameter));
    let (nominal, hardware) = (&subject.config.hardware, &found.hardware);
    let mut text = head(subject, found, request);
    text += &format!("\nextends = {}\n", quoted(&path_from(out, &subject.config_file)));
    if is_free(|of| matches!(of, Parameter::BasePosition { .. } | Parameter::BaseRotation { .. })) {
        text += &clamp(&hardware.manipulator);
    }
    for (name, material) in &hardware.manipulator.materials {
        if nominal.manipulator.materials.get(name) != Some(material) {
            text += &format!(
                "\n[manipulator.materials.{}]\nyoung_modulus_mpa = {:?}\n",
                key(name),
                material.young_modulus_mpa
            );
        }
    }
    if nominal.manipulator.parts != hardware.manipulator.parts {
        text += &hardware.manipulator.parts.iter().map(part_entry).collect::<String>();
    }
    if nominal.coils != hardware.coils {
        text += &hardware.coils.iter().map(coil_entry).collect::<String>();
    }
    if subject.simulates_itself {
        text += &nominal_entry(&path_from(out, &subject.config_file));
    }
    text
}

/// Where the numbers come from, as comments.
fn head(subject: &Subject, found: &Identified, request: &IdentifyRequest) -> String {
    let mut text =
        String::from("# Identified parameters, made by `magsteer tune identify` from equilibria in\n");
    for (file, sha256) in &subject.data {
        let file = file.display().to_string().replace(['\n', '\r'], " ");
        text += &format!("#   {file}, SHA-256 {sha256}\n");
    }
    let how = |level| if level == NoiseLevel::Estimated { "estimated" } else { "stated" };
    let [orientation, position] = found.noise;
    text += &format!(
        "# {} samples, {} without an equilibrium, {} outliers; noise of a tilt {:.3} deg ({}), of a coordinate {:.4} mm ({})\n\
         # chi-square {:.1} at {:.1} degrees of freedom",
        subject.samples.len(),
        found.lost.len(),
        found.outliers.len(),
        orientation.to_degrees(),
        how(request.noise.orientation),
        position * 1e3,
        how(request.noise.position),
        found.chi_square,
        found.degrees_of_freedom,
    );
    if let (Some(before), Some(after)) = (found.rms_before.angle, found.rms_after.angle) {
        text += &format!("; RMS of tangents {:.3} -> {:.3} deg", before.to_degrees(), after.to_degrees());
    }
    text += "\n#\n# nominal -> estimate +- standard deviation, by samples (deviation after the data over that before)\n";
    for parameter in parameters(subject, found) {
        text += &format!(
            "# {}: {:.5} -> {:.5} +- {:.5}, {:.5} {} ({:.3})\n",
            parameter.name.replace(['\n', '\r'], " "),
            parameter.nominal,
            parameter.estimate,
            parameter.standard_deviation,
            parameter.standard_deviation_between_samples,
            parameter.unit,
            parameter.posterior_over_prior
        );
    }
    text
}

fn clamp(manipulator: &ManipulatorConfig) -> String {
    format!(
        "\n[manipulator]\nbase_position_mm = {:?}\nbase_tangent = {:?}\nbase_roll_deg = {:?}\n",
        manipulator.base_position_mm, manipulator.base_tangent, manipulator.base_roll_deg
    )
}

/// One of `[[manipulator.parts]]`.
fn part_entry(part: &PartConfig) -> String {
    let precurvature = |of: Option<[f64; 3]>| {
        of.map_or_else(String::new, |curvature| format!(", precurvature_per_m = {curvature:?}"))
    };
    let content = match part {
        PartConfig::Section(section) => format!(
            "section = {{ material = {}, length_mm = {:?}, diameter_mm = {:?}, extensible = {}{} }}",
            quoted(&section.material),
            section.length_mm,
            section.diameter_mm,
            section.extensible,
            precurvature(section.precurvature_per_m)
        ),
        PartConfig::StiffnessSection(section) => {
            let optional = |key: &str, value: Option<f64>| {
                value.map_or_else(String::new, |value| format!(", {key} = {value:?}"))
            };
            format!(
                "stiffness_section = {{ length_mm = {:?}, diameter_mm = {:?}, bending_n_m2 = {:?}, torsion_n_m2 = {:?}{}{}, mass_kg_per_m = {:?}{} }}",
                section.length_mm,
                section.diameter_mm,
                section.bending_n_m2,
                section.torsion_n_m2,
                optional("shear_n", section.shear_n),
                optional("axial_n", section.axial_n),
                section.mass_kg_per_m,
                precurvature(section.precurvature_per_m)
            )
        }
        PartConfig::Magnet(magnet) => format!(
            "magnet = {{ name = {}, length_mm = {:?}, diameter_mm = {:?}, density_kg_per_m3 = {:?}, moment_body_a_m2 = {:?} }}",
            quoted(&magnet.name),
            magnet.length_mm,
            magnet.diameter_mm,
            magnet.density_kg_per_m3,
            magnet.moment_body_a_m2
        ),
    };
    format!("\n[[manipulator.parts]]\n{content}\n")
}
