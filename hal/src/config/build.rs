//! From the tables to the description: every value is checked, then converted to SI.

use std::f64::consts::PI;

use crate::description::{
    CoilDescription, ExtensibleStiffness, FrameDescription, HardwareDescription, MagnetDescription,
    ManipulatorDescription, PartDescription, Rows3, SectionDescription, Workspace, is_rig_name,
};
use crate::invalid::{Checks, Invalid};
use crate::message::{COILS_MAX, MAGNETS_MAX, POSE_PARAMETERS_MAX};

use super::rotation::{
    product, rotation_about_y, rotation_about_z, rotation_from_x, shortest_rotation_from_z,
};
use super::tables::{
    CoilConfig, CoilPlacement, CoilTypeConfig, FrameConfig, HardwareConfig, MagnetConfig, ManipulatorConfig,
    PartConfig, RigConfig, SectionConfig, StiffnessSectionConfig,
};

/// Highest multipole order that both sides evaluate.
pub const ORDER_MAX: usize = 10;

// Ranges of physical quantities are some hundred times wider than the rigs known to need them: they are there
// to catch values in a wrong unit, not to say what a laboratory may build.

/// No rig is larger, mm.
const EXTENT_MAX_MM: f64 = 1e4;
/// Least and most of a coil's greatest current, A.
const CURRENT_A: (f64, f64) = (1e-3, 1e3);
/// Longest time from zero to a coil's greatest current, s.
const RISE_MAX_S: f64 = 10.0;
/// Most of a coil's first coefficient, T m^3 / A: a hundred times that of an iron core of BigMag.
const DIPOLE_MAX: f64 = 3e-4;
/// A curve of 0.1 mm radius.
const PRECURVATURE_MAX_PER_M: f64 = 1e4;

impl HardwareConfig {
    /// Validates every value and converts to SI.
    ///
    /// # Errors
    /// Every value that is out of its range, contradicts another or exceeds a capacity.
    pub fn build(&self) -> Result<HardwareDescription, Vec<Invalid>> {
        let mut checks = Checks::new();
        self.rig.check(&mut checks);
        let frames = self.frames(&mut checks);
        let coils = self.coils(&mut checks);
        let manipulator = self.manipulator.build(&mut checks);
        checks.into_result(HardwareDescription {
            rig: self.rig.name.clone(),
            workspace: Workspace {
                center: self.rig.workspace_center_mm.map(millimetres),
                radius: millimetres(self.rig.workspace_diameter_mm) / 2.0,
            },
            gravity: self.rig.gravity_m_per_s2,
            frames,
            coil_types: self.coil_types.keys().cloned().collect(),
            coils,
            manipulator,
        })
    }

    fn frames(&self, checks: &mut Checks) -> Vec<FrameDescription> {
        checks.require(
            self.frames.len() <= POSE_PARAMETERS_MAX,
            "frames",
            format!("{} entries", self.frames.len()),
            format!("at most {POSE_PARAMETERS_MAX} entries"),
        );
        unique("frames", self.frames.iter().map(|frame| frame.name.as_str()), checks);
        let build = |(index, frame): (usize, &FrameConfig)| frame.build(&format!("frames[{index}]"), checks);
        self.frames.iter().enumerate().map(build).collect()
    }

    fn coils(&self, checks: &mut Checks) -> Vec<CoilDescription> {
        for (name, coil_type) in &self.coil_types {
            coil_type.check(&format!("coil_types.{name}"), checks);
        }
        checks.require(
            self.coils.len() <= COILS_MAX,
            "coils",
            format!("{} entries", self.coils.len()),
            format!("at most {COILS_MAX} entries"),
        );
        unique("coils", self.coils.iter().map(|coil| coil.name.as_str()), checks);
        let build = |(index, coil): (usize, &CoilConfig)| self.coil(&format!("coils[{index}]"), coil, checks);
        self.coils.iter().enumerate().filter_map(build).collect()
    }

    fn coil(&self, key: &str, coil: &CoilConfig, checks: &mut Checks) -> Option<CoilDescription> {
        let place = self.place(key, coil, checks);
        let gain = coil.gain.unwrap_or(1.0);
        checks.within(format!("{key}.gain"), gain, 0.01, 100.0);
        let frame = coil.frame.as_ref().and_then(|name| {
            let found = self.frames.iter().position(|frame| frame.name == *name);
            let names: Vec<&str> = self.frames.iter().map(|frame| frame.name.as_str()).collect();
            let expected = format!("the name of a frame ({})", names.join(", "));
            checks.require(found.is_some(), format!("{key}.frame"), name, expected);
            found
        });
        let coil_type = self.coil_types.get(&coil.coil_type);
        let names: Vec<&str> = self.coil_types.keys().map(String::as_str).collect();
        let expected = format!("the name of a coil type ({})", names.join(", "));
        checks.require(coil_type.is_some(), format!("{key}.type"), &coil.coil_type, expected);
        let coil_type = coil_type?;
        let (rotation, position) = place?;
        Some(CoilDescription {
            name: coil.name.clone(),
            coil_type: coil.coil_type.clone(),
            coefficients: coil_type.coefficients_si.iter().map(|coefficient| coefficient * gain).collect(),
            valid_from_x: millimetres(coil_type.valid_from_x_mm),
            rotation,
            position,
            frame,
            current_max: coil_type.current_max_a,
            slew_max: coil_type.slew_max_a_per_s,
            resistance: coil_type.resistance_ohm,
            inductance: coil_type.inductance_h,
            supply_voltage: coil_type.supply_v,
        })
    }

    /// Rotation and expansion point (m) of a coil at frame angle zero.
    fn place(&self, key: &str, coil: &CoilConfig, checks: &mut Checks) -> Option<(Rows3, [f64; 3])> {
        let Some(placement) = coil.placement() else {
            let given = coil.placement_keys().into_iter().filter(|(_, is_given)| *is_given);
            let given: Vec<&str> = given.map(|(name, _)| name).collect();
            let value = if given.is_empty() {
                "placed by nothing".to_owned()
            } else {
                format!("placed by {}", given.join(", "))
            };
            let expected = "placed by azimuth_deg, elevation_deg and distance_mm, or by position_mm and axis";
            checks.require(false, key, value, expected);
            return None;
        };
        match placement {
            CoilPlacement::Aimed { azimuth_deg, elevation_deg, distance_mm } => {
                checks.within(format!("{key}.distance_mm"), distance_mm, 1.0, EXTENT_MAX_MM);
                checks.within(format!("{key}.azimuth_deg"), azimuth_deg, -360.0, 360.0);
                checks.within(format!("{key}.elevation_deg"), elevation_deg, -90.0, 90.0);
                let rotation = product(
                    rotation_about_z(azimuth_deg.to_radians()),
                    rotation_about_y(elevation_deg.to_radians()),
                );
                let center = self.rig.workspace_center_mm.map(millimetres);
                let distance = millimetres(distance_mm);
                Some((rotation, [0, 1, 2].map(|row| center[row] - rotation[row][0] * distance)))
            }
            CoilPlacement::Free { position_mm, axis } => {
                checks.length_within(format!("{key}.position_mm"), &position_mm, EXTENT_MAX_MM);
                let axis = unit(&format!("{key}.axis"), axis, checks);
                Some((rotation_from_x(axis), position_mm.map(millimetres)))
            }
        }
    }
}

impl RigConfig {
    fn check(&self, checks: &mut Checks) {
        let holds = is_rig_name(&self.name);
        let expected = "1 to 40 lower-case letters, digits and hyphens";
        checks.require(holds, "rig.name", format!("{:?}", self.name), expected);
        checks.length_within("rig.workspace_center_mm", &self.workspace_center_mm, EXTENT_MAX_MM);
        checks.within("rig.workspace_diameter_mm", self.workspace_diameter_mm, 1.0, EXTENT_MAX_MM);
        checks.length_within("rig.gravity_m_per_s2", &self.gravity_m_per_s2, 100.0);
    }
}

impl FrameConfig {
    fn build(&self, key: &str, checks: &mut Checks) -> FrameDescription {
        checks.within(format!("{key}.angle_min_deg"), self.angle_min_deg, -360.0, 360.0);
        checks.within(format!("{key}.angle_max_deg"), self.angle_max_deg, self.angle_min_deg, 360.0);
        checks.within(format!("{key}.speed_max_deg_per_s"), self.speed_max_deg_per_s, 1e-3, 1e4);
        checks.length_within(format!("{key}.pivot_mm"), &self.pivot_mm, EXTENT_MAX_MM);
        FrameDescription {
            name: self.name.clone(),
            axis: unit(&format!("{key}.axis"), self.axis, checks),
            pivot: self.pivot_mm.map(millimetres),
            angle_min: self.angle_min_deg.to_radians(),
            angle_max: self.angle_max_deg.to_radians(),
            speed_max: self.speed_max_deg_per_s.to_radians(),
        }
    }
}

impl CoilTypeConfig {
    fn check(&self, key: &str, checks: &mut Checks) {
        let order = self.coefficients_si.len();
        let holds = (1..=ORDER_MAX).contains(&order);
        let expected = format!("1 to {ORDER_MAX} coefficients");
        checks.require(holds, format!("{key}.coefficients_si"), format!("{order} coefficients"), expected);
        checks.finite(format!("{key}.coefficients_si"), &self.coefficients_si);
        if let Some(&dipole) = self.coefficients_si.first().filter(|_| holds) {
            let value = format!("{dipole} in front");
            let expected =
                format!("at most {DIPOLE_MAX} T m^3/A in front, of a field in T, lengths in m and 1 A");
            let is_possible = !dipole.is_finite() || dipole.abs() <= DIPOLE_MAX;
            checks.require(is_possible, format!("{key}.coefficients_si"), value, expected);
        }
        checks.within(format!("{key}.valid_from_x_mm"), self.valid_from_x_mm, 0.1, 1e3);
        checks.within(format!("{key}.current_max_a"), self.current_max_a, CURRENT_A.0, CURRENT_A.1);
        // No coil takes longer from zero to its greatest current than this.
        let slew_min = self.current_max_a.clamp(CURRENT_A.0, CURRENT_A.1) / RISE_MAX_S;
        checks.within(format!("{key}.slew_max_a_per_s"), self.slew_max_a_per_s, slew_min, 1e6);
        checks.within(format!("{key}.resistance_ohm"), self.resistance_ohm, 1e-3, 1e3);
        checks.within(format!("{key}.inductance_h"), self.inductance_h, 1e-7, 10.0);
        checks.within(format!("{key}.supply_v"), self.supply_v, 0.1, 5e3);
    }
}

impl ManipulatorConfig {
    /// Turns the clamp to a rotation from body to world, by its tangent and its roll.
    pub fn set_base_rotation(&mut self, rotation: &Rows3) {
        let tangent = rotation.map(|row| row[2]);
        let without_roll = shortest_rotation_from_z(tangent);
        // The roll's first column is (cos, sin, 0): body x of the one rotation in the axes of the other.
        let [cosine, sine] =
            [0, 1].map(|axis| (0..3).map(|row| without_roll[row][axis] * rotation[row][0]).sum::<f64>());
        self.base_tangent = tangent;
        self.base_roll_deg = sine.atan2(cosine).to_degrees();
    }

    fn build(&self, checks: &mut Checks) -> ManipulatorDescription {
        checks.length_within("manipulator.base_position_mm", &self.base_position_mm, EXTENT_MAX_MM);
        checks.within("manipulator.base_roll_deg", self.base_roll_deg, -360.0, 360.0);
        let tangent = unit("manipulator.base_tangent", self.base_tangent, checks);
        for (name, material) in &self.materials {
            let key = format!("manipulator.materials.{name}");
            checks.within(format!("{key}.young_modulus_mpa"), material.young_modulus_mpa, 1e-3, 1e6);
            checks.within(format!("{key}.poisson_ratio"), material.poisson_ratio, 0.0, 0.5);
            density(&key, material.density_kg_per_m3, checks);
        }
        let build = |(index, part): (usize, &PartConfig)| {
            let key = format!("manipulator.parts[{index}]");
            match part {
                PartConfig::Section(section) => self.section(&format!("{key}.section"), section, checks),
                PartConfig::StiffnessSection(section) => {
                    Some(section.build(&format!("{key}.stiffness_section"), checks))
                }
                PartConfig::Magnet(magnet) => Some(magnet.build(&format!("{key}.magnet"), checks)),
            }
        };
        let parts: Vec<PartDescription> = self.parts.iter().enumerate().filter_map(build).collect();
        self.check_parts(checks);
        ManipulatorDescription {
            base_position: self.base_position_mm.map(millimetres),
            base_rotation: product(
                shortest_rotation_from_z(tangent),
                rotation_about_z(self.base_roll_deg.to_radians()),
            ),
            parts,
        }
    }

    fn check_parts(&self, checks: &mut Checks) {
        let names: Vec<&str> = self
            .parts
            .iter()
            .filter_map(|part| match part {
                PartConfig::Magnet(magnet) => Some(magnet.name.as_str()),
                PartConfig::Section(_) | PartConfig::StiffnessSection(_) => None,
            })
            .collect();
        let sections = self.parts.len() - names.len();
        let key = "manipulator.parts";
        checks.require(sections > 0, key, "no section", "at least one flexible section");
        checks.require(
            names.len() <= MAGNETS_MAX,
            key,
            format!("{} magnets", names.len()),
            format!("at most {MAGNETS_MAX} magnets"),
        );
        unique(key, names.into_iter(), checks);
    }

    fn section(&self, key: &str, section: &SectionConfig, checks: &mut Checks) -> Option<PartDescription> {
        size(key, section.length_mm, section.diameter_mm, checks);
        let precurvature = section.precurvature_per_m.unwrap_or_default();
        checks.length_within(format!("{key}.precurvature_per_m"), &precurvature, PRECURVATURE_MAX_PER_M);
        let material = self.materials.get(&section.material);
        let names: Vec<&str> = self.materials.keys().map(String::as_str).collect();
        let expected = format!("the name of a material ({})", names.join(", "));
        checks.require(material.is_some(), format!("{key}.material"), &section.material, expected);
        let material = material?;
        let young = material.young_modulus_mpa * 1e6;
        let shear = young / (2.0 * (1.0 + material.poisson_ratio));
        let radius = millimetres(section.diameter_mm) / 2.0;
        let area = PI * radius.powi(2);
        let second_moment = PI * radius.powi(4) / 4.0;
        Some(PartDescription::Section(SectionDescription {
            length: millimetres(section.length_mm),
            radius,
            bending_stiffness: young * second_moment,
            torsion_stiffness: shear * 2.0 * second_moment,
            extensible: section
                .extensible
                .then_some(ExtensibleStiffness { shear: shear * area, axial: young * area }),
            mass_per_length: material.density_kg_per_m3 * area,
            precurvature,
        }))
    }
}

impl StiffnessSectionConfig {
    fn build(&self, key: &str, checks: &mut Checks) -> PartDescription {
        size(key, self.length_mm, self.diameter_mm, checks);
        checks.within(format!("{key}.bending_n_m2"), self.bending_n_m2, 1e-14, 100.0);
        checks.within(format!("{key}.torsion_n_m2"), self.torsion_n_m2, 1e-14, 100.0);
        checks.within(format!("{key}.mass_kg_per_m"), self.mass_kg_per_m, 0.0, 10.0);
        let precurvature = self.precurvature_per_m.unwrap_or_default();
        checks.length_within(format!("{key}.precurvature_per_m"), &precurvature, PRECURVATURE_MAX_PER_M);
        for (name, stiffness) in [("shear_n", self.shear_n), ("axial_n", self.axial_n)] {
            if let Some(stiffness) = stiffness {
                checks.within(format!("{key}.{name}"), stiffness, 1e-6, 1e9);
            }
        }
        checks.require(
            self.shear_n.is_some() == self.axial_n.is_some(),
            key,
            "one of shear_n and axial_n",
            "given both shear_n and axial_n, or neither",
        );
        let extensible = self.shear_n.zip(self.axial_n);
        PartDescription::Section(SectionDescription {
            length: millimetres(self.length_mm),
            radius: millimetres(self.diameter_mm) / 2.0,
            bending_stiffness: self.bending_n_m2,
            torsion_stiffness: self.torsion_n_m2,
            extensible: extensible.map(|(shear, axial)| ExtensibleStiffness { shear, axial }),
            mass_per_length: self.mass_kg_per_m,
            precurvature,
        })
    }
}

impl MagnetConfig {
    fn build(&self, key: &str, checks: &mut Checks) -> PartDescription {
        size(key, self.length_mm, self.diameter_mm, checks);
        density(key, self.density_kg_per_m3, checks);
        checks.length_within(format!("{key}.moment_body_a_m2"), &self.moment_body_a_m2, 10.0);
        let length = millimetres(self.length_mm);
        let radius = millimetres(self.diameter_mm) / 2.0;
        PartDescription::Magnet(MagnetDescription {
            name: self.name.clone(),
            length,
            radius,
            mass: self.density_kg_per_m3 * PI * radius.powi(2) * length,
            moment_body: self.moment_body_a_m2,
        })
    }
}

fn millimetres(value: f64) -> f64 {
    value * 1e-3
}

/// Refuses a part of a size that no manipulator's part has.
fn size(key: &str, length_mm: f64, diameter_mm: f64, checks: &mut Checks) {
    checks.within(format!("{key}.length_mm"), length_mm, 0.1, EXTENT_MAX_MM);
    checks.within(format!("{key}.diameter_mm"), diameter_mm, 0.01, 1e3);
}

/// Refuses a density that no solid has; zero stands for a part without weight.
fn density(key: &str, value: f64, checks: &mut Checks) {
    checks.zero_or_within(format!("{key}.density_kg_per_m3"), value, 10.0, 3e4);
}

/// Refuses a name that stands twice.
fn unique<'a>(key: &str, names: impl Iterator<Item = &'a str>, checks: &mut Checks) {
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        checks.require(seen.insert(name), key, format!("name {name:?} twice"), "given unique names");
    }
}

fn unit(key: &str, vector: [f64; 3], checks: &mut Checks) -> [f64; 3] {
    let norm = vector.iter().map(|component| component * component).sum::<f64>().sqrt();
    let holds = norm.is_finite() && norm > 1e-9;
    checks.require(holds, key, format!("{vector:?}"), "a finite vector other than zero");
    vector.map(|component| component / norm)
}
