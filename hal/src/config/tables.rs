//! The keys of the tables, with unit and range.
//!
//! Every key is required unless it is an `Option`: no default is hidden in code.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The tables of the file that describe the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HardwareConfig {
    /// `[rig]`
    pub rig: RigConfig,
    /// `[[frames]]`
    #[serde(default)]
    pub frames: Vec<FrameConfig>,
    /// `[coil_types.NAME]`
    #[serde(default)]
    pub coil_types: BTreeMap<String, CoilTypeConfig>,
    /// `[[coils]]`
    #[serde(default)]
    pub coils: Vec<CoilConfig>,
    /// `[manipulator]`
    pub manipulator: ManipulatorConfig,
}

/// `[rig]`: name, workspace and gravity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigConfig {
    /// Lower-case letters, digits and hyphens; part of every channel's name.
    pub name: String,
    /// Centre of the spherical workspace, mm, world; within 10 m of the origin, as every position.
    pub workspace_center_mm: [f64; 3],
    /// Diameter of the workspace, mm, 1 to 10000.
    pub workspace_diameter_mm: f64,
    /// Acceleration of gravity, m/s^2, world; at most 100.
    pub gravity_m_per_s2: [f64; 3],
}

/// One of `[[frames]]`: turns coils about an axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameConfig {
    /// Name, as coils refer to it; unique.
    pub name: String,
    /// Axis, world; normalised here.
    pub axis: [f64; 3],
    /// A point on the axis, mm, world.
    pub pivot_mm: [f64; 3],
    /// Least angle, deg, -360 to 360.
    pub angle_min_deg: f64,
    /// Greatest angle, deg, above the least.
    pub angle_max_deg: f64,
    /// Greatest speed, deg/s, 0.001 to 10000.
    pub speed_max_deg_per_s: f64,
}

/// One of `[coil_types.NAME]`: field and circuit of coils built alike.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoilTypeConfig {
    /// `a_k` of eq. (4) for 1 A, k = 1 first, T m^(k+2) / A; 1 to 10 of them, the first at most 3e-4.
    pub coefficients_si: Vec<f64>,
    /// Least local x at which the series is valid, mm, 0.1 to 1000.
    pub valid_from_x_mm: f64,
    /// Greatest magnitude of the current, A, 0.001 to 1000.
    pub current_max_a: f64,
    /// Greatest rate of the commanded current, A/s, up to 1e6; the greatest current takes 10 s at most.
    pub slew_max_a_per_s: f64,
    /// Resistance, ohm, 0.001 to 1000.
    pub resistance_ohm: f64,
    /// Inductance, H, 1e-7 to 10.
    pub inductance_h: f64,
    /// Supply voltage of the amplifier, V, 0.1 to 5000.
    pub supply_v: f64,
}

/// One of `[[coils]]`: where a coil is, in one of two ways ([`CoilPlacement`]).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoilConfig {
    /// Name, for people; unique.
    pub name: String,
    /// One of `coil_types`.
    #[serde(rename = "type")]
    pub coil_type: String,
    /// Rotation about z, deg, -360 to 360.
    pub azimuth_deg: Option<f64>,
    /// Rotation about y, applied first, deg, -90 to 90.
    pub elevation_deg: Option<f64>,
    /// Expansion point to the workspace centre, mm, 1 to 10000.
    pub distance_mm: Option<f64>,
    /// Expansion point at frame angle zero, mm, world.
    pub position_mm: Option<[f64; 3]>,
    /// Axis at frame angle zero, from the coil towards the workspace, world; normalised here.
    pub axis: Option<[f64; 3]>,
    /// One of `frames`; absent for a coil fixed to the world.
    pub frame: Option<String>,
    /// Field per ampere over that of its type, 0.01 to 100; 1 when absent.
    pub gain: Option<f64>,
}

/// Where a coil is at frame angle zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CoilPlacement {
    /// Its axis points from `c + R (-distance, 0, 0)` to the workspace centre `c`,
    /// `R = rotz(azimuth) roty(elevation)`.
    Aimed {
        /// Rotation about z, deg.
        azimuth_deg: f64,
        /// Rotation about y, applied first, deg.
        elevation_deg: f64,
        /// Expansion point to the workspace centre, mm.
        distance_mm: f64,
    },
    /// Anywhere, pointing anywhere.
    Free {
        /// Expansion point, mm, world.
        position_mm: [f64; 3],
        /// Axis of any length, world.
        axis: [f64; 3],
    },
}

impl CoilConfig {
    /// The keys that say where the coil is, each with whether it is given.
    #[must_use]
    pub fn placement_keys(&self) -> [(&'static str, bool); 5] {
        [
            ("azimuth_deg", self.azimuth_deg.is_some()),
            ("elevation_deg", self.elevation_deg.is_some()),
            ("distance_mm", self.distance_mm.is_some()),
            ("position_mm", self.position_mm.is_some()),
            ("axis", self.axis.is_some()),
        ]
    }

    /// Where the coil is; `None` unless all keys of one way are given and none of the other.
    #[must_use]
    pub fn placement(&self) -> Option<CoilPlacement> {
        match (self.azimuth_deg, self.elevation_deg, self.distance_mm, self.position_mm, self.axis) {
            (Some(azimuth_deg), Some(elevation_deg), Some(distance_mm), None, None) => {
                Some(CoilPlacement::Aimed { azimuth_deg, elevation_deg, distance_mm })
            }
            (None, None, None, Some(position_mm), Some(axis)) => {
                Some(CoilPlacement::Free { position_mm, axis })
            }
            _ => None,
        }
    }
}

/// `[manipulator]`: the clamp and the chain of parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ManipulatorConfig {
    /// Clamped end, mm, world.
    pub base_position_mm: [f64; 3],
    /// Tangent at the clamp, world; normalised here. The clamp's rotation is the shortest one that takes z there.
    pub base_tangent: [f64; 3],
    /// Rotation of the clamp about its tangent, deg.
    pub base_roll_deg: f64,
    /// `[manipulator.materials.NAME]`
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialConfig>,
    /// `[[manipulator.parts]]` from base to tip, each with either `section` or `magnet`.
    pub parts: Vec<PartConfig>,
}

/// One of `[manipulator.materials.NAME]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialConfig {
    /// Young's modulus, MPa, 0.001 to 1e6.
    pub young_modulus_mpa: f64,
    /// Poisson's ratio, 0 to 0.5.
    pub poisson_ratio: f64,
    /// Density, kg/m^3, 10 to 30000, or 0.
    pub density_kg_per_m3: f64,
}

/// One of `[[manipulator.parts]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PartConfig {
    /// A flexible section of a material.
    Section(SectionConfig),
    /// A flexible section given by its stiffness.
    StiffnessSection(StiffnessSectionConfig),
    /// A rigid magnet.
    Magnet(MagnetConfig),
}

/// `section = {...}`: a round section of a material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SectionConfig {
    /// One of `manipulator.materials`.
    pub material: String,
    /// Length, mm, 0.1 to 10000.
    pub length_mm: f64,
    /// Diameter, mm, 0.01 to 1000.
    pub diameter_mm: f64,
    /// True when the section may stretch and shear, false for a Kirchhoff rod.
    pub extensible: bool,
    /// Curvature about body x and y, and twist, of the unloaded section, 1/m, at most 10000; absent when
    /// straight.
    pub precurvature_per_m: Option<[f64; 3]>,
}

/// `stiffness_section = {...}`: a section whose stiffness was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StiffnessSectionConfig {
    /// Length, mm, 0.1 to 10000.
    pub length_mm: f64,
    /// Diameter, mm, 0.01 to 1000.
    pub diameter_mm: f64,
    /// EI, N m^2, 1e-14 to 100.
    pub bending_n_m2: f64,
    /// GJ, N m^2, 1e-14 to 100.
    pub torsion_n_m2: f64,
    /// GA, N, 1e-6 to 1e9; given with `axial_n` or not at all (inextensible).
    pub shear_n: Option<f64>,
    /// EA, N, 1e-6 to 1e9.
    pub axial_n: Option<f64>,
    /// Mass per length, kg/m, 0 to 10.
    pub mass_kg_per_m: f64,
    /// As in `section`.
    pub precurvature_per_m: Option<[f64; 3]>,
}

/// `magnet = {...}`: a rigid cylinder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagnetConfig {
    /// Name, as targets refer to it; unique.
    pub name: String,
    /// Length along the tangent, mm, 0.1 to 10000.
    pub length_mm: f64,
    /// Diameter, mm, 0.01 to 1000.
    pub diameter_mm: f64,
    /// Density, kg/m^3, 10 to 30000, or 0.
    pub density_kg_per_m3: f64,
    /// Dipole moment in body axes, A m^2, at most 10; body z is the tangent towards the tip.
    pub moment_body_a_m2: [f64; 3],
}
