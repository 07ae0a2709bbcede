//! `contact` of `[plant.rod]`: a wall that the rod may touch.

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::rod::{Contact, Surface, Wall};

/// Most points of a tube's axis; each costs every step.
const POINTS_MAX: usize = 100;

/// `contact`: `"none"`, `{ plane = { ... } }` or `{ tube = { ... } }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ContactConfig {
    /// Nothing to touch.
    None,
    /// A flat wall.
    Plane(PlaneConfig),
    /// A tube with the rod inside, as a catheter in a vessel.
    Tube(TubeConfig),
}

/// A flat wall; the clamp stands on its free side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneConfig {
    /// A point on it, mm, world.
    pub point_mm: [f64; 3],
    /// Direction of its free side, world; of any length but zero.
    pub normal: [f64; 3],
    /// How it gives way.
    pub surface: SurfaceConfig,
}

/// A tube along a polyline; the clamp is inside. It goes on straight beyond both ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TubeConfig {
    /// Its axis, mm, world; 2 to 100 points, neighbours apart.
    pub points_mm: Vec<[f64; 3]>,
    /// Inner radius, mm, 0.1 to 10000.
    pub radius_mm: f64,
    /// How it gives way.
    pub surface: SurfaceConfig,
}

/// How a wall gives way, and how it brakes what slides along it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceConfig {
    /// Force a length of rod and a depth, kPa (N/m a mm), 0.001 to 10000. A load of 1 N/m sinks 0.01 mm into
    /// 100 kPa, and half of
    /// `rounding_mm` more.
    pub stiffness_kpa: f64,
    /// Depth over which the stiffness sets in, mm, 0.001 to 10.
    pub rounding_mm: f64,
    /// Share by which the wall pushes harder a speed of sinking, s/m, 0 to 1000.
    pub damping_s_per_m: f64,
    /// Coulomb's friction coefficient, 0 to 2.
    pub friction_coefficient: f64,
    /// Speed below which friction is viscous, mm/s, 0.01 to 100: what would stick creeps with less.
    pub creep_speed_mm_per_s: f64,
}

impl ContactConfig {
    pub(super) fn check(&self, description: &HardwareDescription, checks: &mut Checks) {
        let key = "plant.rod.contact";
        match self {
            Self::None => return,
            Self::Plane(plane) => {
                let key = format!("{key}.plane");
                checks.length_within(format!("{key}.point_mm"), &plane.point_mm, 1e4);
                checks.finite(format!("{key}.normal"), &plane.normal);
                let length = Vector3::from(plane.normal).norm();
                let expected = "of a length that is not zero";
                checks.require(
                    length > 0.0,
                    format!("{key}.normal"),
                    format!("{:?}", plane.normal),
                    expected,
                );
                plane.surface.check(&format!("{key}.surface"), checks);
            }
            Self::Tube(tube) => tube.check(&format!("{key}.tube"), checks),
        }
        if checks.is_clean()
            && let Some(contact) = self.contact()
        {
            let base = Vector3::from(description.manipulator.base_position);
            let gap = contact.wall.clearance(&base).gap * 1e3;
            let (key, expected) = match self {
                Self::Tube(_) => {
                    ("plant.rod.contact.tube", "about manipulator.base_position_mm, with a gap >= 0")
                }
                _ => ("plant.rod.contact.plane", "before manipulator.base_position_mm, with a gap >= 0"),
            };
            checks.require(gap >= 0.0, key, format!("a wall with a gap of {gap:.3} mm"), expected);
        }
    }

    /// Only for values that were checked.
    pub(super) fn contact(&self) -> Option<Contact> {
        let metres = |point: &[f64; 3]| Vector3::from(*point) * 1e-3;
        let (wall, surface) = match self {
            Self::None => return None,
            Self::Plane(plane) => {
                let normal = Vector3::from(plane.normal).normalize();
                (Wall::Plane { point: metres(&plane.point_mm), normal }, &plane.surface)
            }
            Self::Tube(tube) => {
                let points = tube.points_mm.iter().map(metres).collect();
                (Wall::Tube { points, radius: tube.radius_mm * 1e-3 }, &tube.surface)
            }
        };
        Some(Contact { wall, surface: surface.surface() })
    }
}

impl TubeConfig {
    fn check(&self, key: &str, checks: &mut Checks) {
        let points = format!("{key}.points_mm");
        let count = self.points_mm.len();
        let expected = format!("2 to {POINTS_MAX} points");
        checks.require((2..=POINTS_MAX).contains(&count), &points, format!("{count} points"), expected);
        for (index, point) in self.points_mm.iter().enumerate() {
            checks.length_within(format!("{points}[{index}]"), point, 1e4);
        }
        for (index, pair) in self.points_mm.windows(2).enumerate() {
            let apart = pair[0] != pair[1];
            checks.require(
                apart,
                format!("{points}[{}]", index + 1),
                format!("{:?}", pair[1]),
                "another point than the last",
            );
        }
        checks.within(format!("{key}.radius_mm"), self.radius_mm, 0.1, 1e4);
        self.surface.check(&format!("{key}.surface"), checks);
    }
}

impl SurfaceConfig {
    fn check(&self, key: &str, checks: &mut Checks) {
        checks.within(format!("{key}.stiffness_kpa"), self.stiffness_kpa, 1e-3, 1e4);
        checks.within(format!("{key}.rounding_mm"), self.rounding_mm, 1e-3, 10.0);
        checks.within(format!("{key}.damping_s_per_m"), self.damping_s_per_m, 0.0, 1e3);
        checks.within(format!("{key}.friction_coefficient"), self.friction_coefficient, 0.0, 2.0);
        checks.within(format!("{key}.creep_speed_mm_per_s"), self.creep_speed_mm_per_s, 0.01, 100.0);
    }

    fn surface(&self) -> Surface {
        Surface {
            stiffness: self.stiffness_kpa * 1e3,
            rounding: self.rounding_mm * 1e-3,
            damping: self.damping_s_per_m,
            friction: self.friction_coefficient,
            creep_speed: self.creep_speed_mm_per_s * 1e-3,
        }
    }
}
