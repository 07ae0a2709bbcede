//! The rig as a viewer knows it: names, limits, by which angles directions are told, and from where to look
//! at it.

use std::path::PathBuf;

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::PartDescription;
use nalgebra::{Rotation3, Unit, Vector3};
use serde::Serialize;

use crate::config::Config;
use crate::control::FrameUse;

/// Sine of an angle, or length over the workspace's radius, below which coils lie in a plane.
const IN_PLANE: f64 = 1e-3;

/// By which angles a direction is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Angles {
    /// One: from z towards the base's tangent, -180 to 180 deg. For rigs whose coils, base and gravity lie in
    /// one plane.
    Planar,
    /// Two: from z, 0 to 180 deg, and the azimuth about z from x, -180 to 180 deg.
    Spatial,
}

impl Angles {
    /// How many.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Planar => 1,
            Self::Spatial => 2,
        }
    }
}

/// A projection: which world axis points right, and which up.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct View {
    /// As `x-z`.
    pub name: String,
    /// Index of the axis that points right.
    pub right: usize,
    /// Index of the axis that points up.
    pub up: usize,
}

/// Facts of a rig that do not change while it is watched. Lengths in mm and angles in deg, as they are shown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rig {
    /// Its name.
    pub name: String,
    /// Names of the magnets, base to tip.
    pub magnets: Vec<String>,
    /// Names of the coils.
    pub coils: Vec<String>,
    /// Greatest magnitude of each coil's current.
    pub current_max_a: Vec<f64>,
    /// Names of the frames.
    pub frames: Vec<String>,
    /// Least and greatest angle of each frame.
    pub angle_range_deg: Vec<[f64; 2]>,
    /// By which angles directions are told.
    pub angles: Angles,
    /// Angles of the clamp's tangent.
    pub base_angles_deg: Vec<f64>,
    /// For [`Angles::Planar`]: x and y of the horizontal direction at 90 deg.
    pub in_plane: [f64; 2],
    /// Two projections.
    pub views: [View; 2],
    /// Centre of the sphere in which magnets may be.
    pub workspace_center_mm: [f64; 3],
    /// Its radius.
    pub workspace_radius_mm: f64,
    /// Radius of the magnets, for pictures.
    pub magnet_radius_mm: Vec<f64>,
    /// Radius of the first section, for pictures.
    pub section_radius_mm: f64,
    /// The axis about which [`Angles::Planar`] turns, unit, world.
    #[serde(skip)]
    normal: [f64; 3],
    /// [`HardwareDescription::fingerprint`].
    #[serde(skip)]
    pub fingerprint: u64,
    /// Configured rate of the status, Hz; 0 when the file does not say.
    #[serde(skip)]
    pub status_rate_hz: f64,
    /// Folder of the journal; `None` for a daemon without.
    #[serde(skip)]
    pub journal: Option<PathBuf>,
}

impl Rig {
    /// The rig of a configuration.
    #[must_use]
    pub fn new(config: &Config) -> Self {
        let rig = &config.description;
        let tangent = column(&rig.manipulator.base_rotation, 2);
        let normal = Vector3::z().cross(&tangent).try_normalize(IN_PLANE);
        let held = config.control.as_ref().is_none_or(|control| control.frame_angles == FrameUse::Hold);
        let planar = held && normal.is_some_and(|normal| lies_in_plane(rig, &normal));
        let section_radius = rig.manipulator.parts.iter().find_map(|part| match part {
            PartDescription::Section(section) => Some(section.radius),
            PartDescription::Magnet(_) => None,
        });
        let mut facts = Self {
            name: rig.rig.clone(),
            magnets: rig.magnets().map(|magnet| magnet.name.clone()).collect(),
            coils: rig.coils.iter().map(|coil| coil.name.clone()).collect(),
            current_max_a: rig.coils.iter().map(|coil| coil.current_max).collect(),
            frames: rig.frames.iter().map(|frame| frame.name.clone()).collect(),
            angle_range_deg: rig
                .frames
                .iter()
                .map(|frame| [frame.angle_min.to_degrees(), frame.angle_max.to_degrees()])
                .collect(),
            angles: if planar { Angles::Planar } else { Angles::Spatial },
            base_angles_deg: Vec::new(),
            in_plane: normal.map_or([1.0, 0.0], |normal| [normal.y, -normal.x]),
            views: views(&tangent),
            workspace_center_mm: rig.workspace.center.map(millimetres),
            workspace_radius_mm: millimetres(rig.workspace.radius),
            magnet_radius_mm: rig.magnets().map(|magnet| millimetres(magnet.radius)).collect(),
            section_radius_mm: millimetres(section_radius.unwrap_or(0.0)),
            normal: normal.unwrap_or_else(Vector3::y).into(),
            fingerprint: rig.fingerprint(),
            status_rate_hz: config.daemon.as_ref().map_or(0.0, |daemon| daemon.status_rate_hz),
            journal: config.daemon.as_ref().and_then(|daemon| Some(daemon.recorder.as_ref()?.folder.clone())),
        };
        facts.base_angles_deg = facts.angles_deg(&tangent.into()).as_slice().to_vec();
        facts
    }

    /// The angles of a direction, deg; none for the zero vector, which stands for no direction.
    #[must_use]
    pub fn angles_deg(&self, direction: &[f64; 3]) -> AnglesDeg {
        let direction = Vector3::from(*direction);
        let length = direction.norm();
        if !length.is_finite() || length < 0.5 {
            return AnglesDeg { values: [0.0; 2], count: 0 };
        }
        let values = match self.angles {
            Angles::Planar => {
                let along = Vector3::from(self.normal).cross(&Vector3::z());
                [direction.dot(&along).atan2(direction.z).to_degrees(), 0.0]
            }
            Angles::Spatial => {
                let across = direction.x.hypot(direction.y);
                [across.atan2(direction.z).to_degrees(), direction.y.atan2(direction.x).to_degrees()]
            }
        };
        AnglesDeg { values, count: self.angles.count() }
    }

    /// The direction of these angles, deg, the inverse of [`Self::angles_deg`]; `None` when they are not as
    /// many as the rig's directions have, not finite or beyond a turn.
    #[must_use]
    pub fn direction(&self, angles_deg: &[f64]) -> Option<[f64; 3]> {
        let usable = |angle: &f64| angle.is_finite() && angle.abs() <= 360.0;
        if angles_deg.len() != self.angles.count() || !angles_deg.iter().all(usable) {
            return None;
        }
        let from_z = angles_deg[0].to_radians();
        let direction = match self.angles {
            Angles::Planar => {
                let axis = Unit::new_normalize(Vector3::from(self.normal));
                Rotation3::from_axis_angle(&axis, from_z) * Vector3::z()
            }
            Angles::Spatial => {
                let azimuth = angles_deg[1].to_radians();
                Vector3::new(from_z.sin() * azimuth.cos(), from_z.sin() * azimuth.sin(), from_z.cos())
            }
        };
        Some(direction.into())
    }
}

/// Angles of one direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AnglesDeg {
    values: [f64; 2],
    count: usize,
}

impl AnglesDeg {
    /// As many as the rig's directions have, or none.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

pub(super) fn millimetres(metres: f64) -> f64 {
    1e3 * metres
}

fn column(rows: &[[f64; 3]; 3], index: usize) -> Vector3<f64> {
    Vector3::from_fn(|row, _| rows[row][index])
}

/// True when coils (at frame angles zero), gravity and unloaded rod lie in the plane through the clamp.
fn lies_in_plane(rig: &HardwareDescription, normal: &Vector3<f64>) -> bool {
    let base = Vector3::from(rig.manipulator.base_position);
    let flat = |vector: Vector3<f64>, scale: f64| vector.dot(normal).abs() <= IN_PLANE * scale;
    let coils = rig.coils.iter().all(|coil| {
        let place = Vector3::from(coil.position) - base;
        flat(place, rig.workspace.radius) && flat(column(&coil.rotation, 0), 1.0)
    });
    let straight = rig.manipulator.parts.iter().all(|part| match part {
        PartDescription::Section(section) => section.precurvature == [0.0; 3],
        PartDescription::Magnet(_) => true,
    });
    let gravity = Vector3::from(rig.gravity);
    coils && straight && flat(gravity, gravity.norm())
}

/// From the side and from above; along both horizontal axes for a rod that stands upright.
fn views(tangent: &Vector3<f64>) -> [View; 2] {
    const NAMES: [&str; 3] = ["x", "y", "z"];
    let view = |right: usize, up: usize| View { name: format!("{}-{}", NAMES[right], NAMES[up]), right, up };
    match tangent.iamax() {
        2 => [view(0, 2), view(1, 2)],
        main => [view(main, 2), view(main, 1 - main)],
    }
}
