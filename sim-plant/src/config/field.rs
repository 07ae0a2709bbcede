//! `[plant.field.TYPE]`.

use std::collections::BTreeMap;

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;
use serde::{Deserialize, Serialize};

use crate::field::{CoilTruth, Saturation, Winding};

/// No coil is wider, mm.
const RADIUS_MAX_MM: f64 = 5e3;

/// One of `[plant.field.TYPE]`, TYPE as in `[coil_types]`: what the coils of that type are in truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CoilTruthConfig {
    /// `"multipole"`: the series of `[coil_types]`, exactly.
    Multipole,
    /// The same series behind a core that saturates.
    Core(CoreConfig),
    /// A winding without a core.
    Winding(WindingShapeConfig),
}

/// `winding = {...}`: uniformly wound; its face is the plane x = 0 of the coil's frame, its body behind it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindingShapeConfig {
    /// Inner radius, mm, 0.1 to 5000.
    pub inner_radius_mm: f64,
    /// Outer radius, mm, above the inner one, up to 5000.
    pub outer_radius_mm: f64,
    /// Length along the axis, mm, 0.1 to 5000.
    pub length_mm: f64,
    /// Turns in all, 1 to 1e6.
    pub turns: f64,
}

/// `core = {...}`: the series of `[coil_types]`, of whose flux the core takes a part away.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoreConfig {
    /// The current at the knee, A, 0.01 to 10000: 16 % of the field are lost there, 1e-3 at a quarter of it.
    pub saturation_knee_a: f64,
}

/// What each coil of the rig is in truth, in its order. A type without coils is passed over; a coil without a
/// truth is refused, and so is a truth that no coil type of the rig asks for.
pub(super) fn truths(
    types: &BTreeMap<String, CoilTruthConfig>,
    description: &HardwareDescription,
    checks: &mut Checks,
) -> Vec<CoilTruth> {
    let known = description.coil_types.join(", ");
    for (name, config) in types {
        let key = format!("plant.field.{name}");
        let expected = format!("the name of a coil type ({known})");
        checks.require(description.coil_types.contains(name), &key, "a truth of no coil type", expected);
        config.check(&key, checks);
    }
    for name in &description.coil_types {
        let has_coils = description.coils.iter().any(|coil| coil.coil_type == *name);
        let key = format!("plant.field.{name}");
        let expected =
            "given: what the coils of this type are in truth, one of \"multipole\", `core` and `winding`";
        checks.require(!has_coils || types.contains_key(name), key, "nothing", expected);
    }
    let coils = description.coils.iter();
    coils.filter_map(|coil| types.get(&coil.coil_type)).map(CoilTruthConfig::truth).collect()
}

impl CoilTruthConfig {
    fn check(&self, key: &str, checks: &mut Checks) {
        match self {
            Self::Multipole => {}
            Self::Core(core) => {
                checks.within(format!("{key}.core.saturation_knee_a"), core.saturation_knee_a, 1e-2, 1e4);
            }
            Self::Winding(winding) => winding.check(&format!("{key}.winding"), checks),
        }
    }

    /// Only for values that were checked.
    fn truth(&self) -> CoilTruth {
        match self {
            Self::Winding(winding) => CoilTruth::Winding(Winding {
                inner_radius: winding.inner_radius_mm * 1e-3,
                outer_radius: winding.outer_radius_mm * 1e-3,
                length: winding.length_mm * 1e-3,
                turns: winding.turns,
            }),
            Self::Multipole => CoilTruth::Multipole(Saturation::None),
            Self::Core(core) => CoilTruth::Multipole(Saturation::Knee(core.saturation_knee_a)),
        }
    }
}

impl WindingShapeConfig {
    fn check(&self, key: &str, checks: &mut Checks) {
        checks.within(format!("{key}.inner_radius_mm"), self.inner_radius_mm, 0.1, RADIUS_MAX_MM);
        let outer = self.outer_radius_mm;
        let holds = outer > self.inner_radius_mm && outer <= RADIUS_MAX_MM;
        let expected = format!("above inner_radius_mm and at most {RADIUS_MAX_MM}");
        checks.require(holds, format!("{key}.outer_radius_mm"), outer, expected);
        checks.within(format!("{key}.length_mm"), self.length_mm, 0.1, 5e3);
        checks.within(format!("{key}.turns"), self.turns, 1.0, 1e6);
    }
}
