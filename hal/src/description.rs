//! The rig as both sides know it: validated, SI, radians, world frame. Data only, no physics.
//!
//! Built from [`crate::config::HardwareConfig`]; whatever can be wrong is refused there. The controller and
//! the simulated plant each make their own model from it.

use sha2::{Digest, Sha256};

/// A 3 x 3 matrix by rows.
pub type Rows3 = [[f64; 3]; 3];

/// Everything that both sides must agree on.
#[derive(Debug, Clone, PartialEq)]
pub struct HardwareDescription {
    /// Name of the rig; part of every channel's name.
    pub rig: String,
    /// Sphere in which magnets may be.
    pub workspace: Workspace,
    /// Acceleration of gravity, m/s^2, world.
    pub gravity: [f64; 3],
    /// Frames that turn coils; their angles are the pose parameters.
    pub frames: Vec<FrameDescription>,
    /// Names of the types of coils, those without a coil too.
    pub coil_types: Vec<String>,
    /// Coils in command order.
    pub coils: Vec<CoilDescription>,
    /// The manipulator.
    pub manipulator: ManipulatorDescription,
}

/// Sphere in which magnets may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Workspace {
    /// Centre, m, world.
    pub center: [f64; 3],
    /// Radius, m.
    pub radius: f64,
}

/// A frame that turns its coils about a fixed axis.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameDescription {
    /// Name, as coils refer to it.
    pub name: String,
    /// Unit axis, world.
    pub axis: [f64; 3],
    /// A point on the axis, m, world.
    pub pivot: [f64; 3],
    /// Least angle, rad.
    pub angle_min: f64,
    /// Greatest angle, rad.
    pub angle_max: f64,
    /// Greatest speed, rad/s.
    pub speed_max: f64,
}

/// An azimuthally symmetric coil. Its local x axis is the coil axis, pointing at the workspace;
/// the local origin is the expansion point on its face.
#[derive(Debug, Clone, PartialEq)]
pub struct CoilDescription {
    /// Name, for people.
    pub name: String,
    /// One of `coil_types`: coils of one type are built alike.
    pub coil_type: String,
    /// Coefficients `a_k` of eq. (4) per ampere, k = 1 first, T m^(k+2) / A.
    pub coefficients: Vec<f64>,
    /// Least local x at which the series is valid, m.
    pub valid_from_x: f64,
    /// Rotation from local to world at frame angle zero.
    pub rotation: Rows3,
    /// Expansion point at frame angle zero, m, world.
    pub position: [f64; 3],
    /// Index into `frames`; `None` for a coil fixed to the world.
    pub frame: Option<usize>,
    /// Greatest magnitude of the current, A.
    pub current_max: f64,
    /// Greatest rate of the commanded current, A/s.
    pub slew_max: f64,
    /// Resistance, ohm.
    pub resistance: f64,
    /// Inductance, H.
    pub inductance: f64,
    /// Supply voltage of its amplifier, V.
    pub supply_voltage: f64,
}

/// A clamped, free-ended chain of flexible sections and rigid magnets, base first.
#[derive(Debug, Clone, PartialEq)]
pub struct ManipulatorDescription {
    /// Clamped end, m, world.
    pub base_position: [f64; 3],
    /// Rotation from body to world at the clamp; the third column is the tangent.
    pub base_rotation: Rows3,
    /// Sections and magnets from base to tip.
    pub parts: Vec<PartDescription>,
}

/// One part of the manipulator.
#[derive(Debug, Clone, PartialEq)]
pub enum PartDescription {
    /// Flexible, round, straight or precurved.
    Section(SectionDescription),
    /// Rigid.
    Magnet(MagnetDescription),
}

/// A flexible section with the same bending stiffness about both transverse axes.
#[derive(Debug, Clone, PartialEq)]
pub struct SectionDescription {
    /// Unstretched length, m.
    pub length: f64,
    /// Radius, m; for pictures and rotary inertia.
    pub radius: f64,
    /// Bending stiffness EI, N m^2.
    pub bending_stiffness: f64,
    /// Torsional stiffness GJ, N m^2.
    pub torsion_stiffness: f64,
    /// Shear and axial stiffness; `None` for an inextensible, unshearable (Kirchhoff) section.
    pub extensible: Option<ExtensibleStiffness>,
    /// Mass per unit length, kg/m.
    pub mass_per_length: f64,
    /// Curvature and twist of the unloaded section in body axes, 1/m.
    pub precurvature: [f64; 3],
}

/// Stiffness of a section that can stretch and shear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExtensibleStiffness {
    /// Shear stiffness GA about both transverse axes, N.
    pub shear: f64,
    /// Axial stiffness EA, N.
    pub axial: f64,
}

/// A rigid, magnetised part.
#[derive(Debug, Clone, PartialEq)]
pub struct MagnetDescription {
    /// Name, as targets refer to it.
    pub name: String,
    /// Length along the tangent, m.
    pub length: f64,
    /// Radius, m.
    pub radius: f64,
    /// Mass, kg.
    pub mass: f64,
    /// Dipole moment in body axes, A m^2; body z is the tangent.
    pub moment_body: [f64; 3],
}

/// Whether a rig may be called so: 1 to 40 lower-case letters, digits and hyphens.
pub(crate) fn is_rig_name(name: &str) -> bool {
    let allowed = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '-';
    (1..=40).contains(&name.len()) && name.chars().all(allowed)
}

impl HardwareDescription {
    /// Magnets from base to tip.
    pub fn magnets(&self) -> impl Iterator<Item = &MagnetDescription> {
        self.manipulator.parts.iter().filter_map(|part| match part {
            PartDescription::Magnet(magnet) => Some(magnet),
            PartDescription::Section(_) => None,
        })
    }

    /// First eight bytes of the SHA-256 of the description, so that two processes can tell
    /// whether they speak of the same rig.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        // `Debug` of f64 is the shortest text that reads back to the same value: a faithful
        // and platform-independent rendering of plain data.
        let digest = Sha256::digest(format!("{self:?}").as_bytes());
        let mut first = [0; 8];
        first.copy_from_slice(&digest[..8]);
        u64::from_be_bytes(first)
    }
}

#[cfg(test)]
mod tests;
