//! From sources to coils that our array can have, and back.
//!
//! Our array has one series a coil, valid in front of the coil's face, and no field without currents. A file
//! that holds anything else is refused with the coil's name: leaving a source out would be a wrong field that
//! nobody sees.

use magsteer_hal::HardwareDescription;
use magsteer_hal::config::ORDER_MAX;
use magsteer_hal::message::COILS_MAX;
use nalgebra::Vector3;

use super::calibration::{Calibration, CoilSources};
use super::read::{A_COEFF, B_COEFF, COIL_LIST, POSITION, SOURCE_LIST};
use super::source::Source;
use crate::magnetics::array::PosedArray;
use crate::magnetics::multipole::{CoilPose, Multipole};
use crate::math::csv::Refusal;

/// No source is further from the workspace's centre, m.
const DISTANCE_MAX: f64 = 10.0;
/// Field that a coil may make at the workspace's centre, T/A: a thousand times below or above what such
/// systems have, of 0.1 to 20 mT/A, with room on both sides.
const FIELD_PER_AMPERE: [f64; 2] = [2e-6, 0.2];

/// A coil as our array has it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlacedCoil {
    /// Name.
    pub name: String,
    /// Expansion point and axis.
    pub pose: CoilPose,
    /// `a_n` per ampere, n = 1 first, T m^(n+2) / A.
    pub coefficients: Vec<f64>,
    /// Least distance in front of the expansion point, along the axis, that the calibrated box has, m.
    pub box_from_x: f64,
    /// Field at the centre of the calibrated box, T/A, world.
    pub field_at_center: Vector3<f64>,
}

/// The coils of a calibration.
///
/// # Errors
/// The first coil that our array cannot have, and what in it; the background; units that cannot be right.
pub fn placed_coils(calibration: &Calibration) -> Result<Vec<PlacedCoil>, Refusal> {
    let count = calibration.coils.len();
    if count > COILS_MAX {
        let expected = format!("at most {COILS_MAX} coils");
        return Err(Refusal::new(1, COIL_LIST, format!("{count} coils"), expected));
    }
    if let Some(background) = &calibration.background {
        let expected = "left out: this array has no field without currents";
        return Err(Refusal::new(background.line, &background.name, "a field without currents", expected));
    }
    calibration.coils.iter().map(|coil| place(calibration, coil)).collect()
}

fn place(calibration: &Calibration, coil: &CoilSources) -> Result<PlacedCoil, Refusal> {
    let [source] = coil.sources.as_slice() else {
        let names: Vec<&str> = coil.sources.iter().map(|source| source.name.as_str()).collect();
        let value = format!("{} sources ({})", names.len(), names.join(", "));
        let key = format!("{}.{SOURCE_LIST}", coil.name);
        return Err(Refusal::new(coil.line, key, value, "one source: a coil of this array has one series"));
    };
    let source = source.trimmed();
    let refuse = |key: &str, value: String, expected: String| {
        Refusal::new(source.line, format!("{}.{}.{key}", coil.name, source.name), value, expected)
    };
    if !source.rising.is_empty() {
        let expected = "empty or zero: terms that rise from the source belong to no coil of this array";
        return Err(refuse(A_COEFF, format!("of order {}", source.rising.len()), expected.to_owned()));
    }
    let order = source.falling.len();
    if !(1..=ORDER_MAX).contains(&order) {
        let value = if order == 0 { "without a term".to_owned() } else { format!("of order {order}") };
        return Err(refuse(B_COEFF, value, format!("of order 1 to {ORDER_MAX}")));
    }
    let center = calibration.center();
    let distance = (center - source.position).norm();
    if distance > DISTANCE_MAX {
        let value = format!("{distance} m from the workspace's centre");
        return Err(refuse(POSITION, value, format!("at most {DISTANCE_MAX} m from it: in m, not in mm?")));
    }
    let faces = source.direction.dot(&(center - source.position)) >= 0.0;
    let source = if faces { source.clone() } else { source.turned_round() };
    let pose = CoilPose { origin: source.position, axis: source.direction };
    let local_x = |point: Vector3<f64>| pose.axis.dot(&(point - pose.origin));
    let box_from_x = calibration.corners().map(local_x).fold(f64::INFINITY, f64::min);
    if box_from_x <= 0.0 {
        let value = format!("with a corner of the workspace {:.1} mm behind it", -box_from_x * 1e3);
        let expected = "with all of the workspace in front of it: a series holds on that side alone";
        return Err(refuse(POSITION, value, expected.to_owned()));
    }
    let coefficients = source.series();
    let field_at_center = Multipole::new(&coefficients).evaluate(&pose, &center).column.field;
    let [least, greatest] = FIELD_PER_AMPERE;
    let strength = field_at_center.norm();
    if !(least..=greatest).contains(&strength) {
        let value = format!("{strength:.3e} T/A at the workspace's centre");
        let expected = format!("from {least:e} to {greatest} T/A there: in m, A and T?");
        return Err(refuse(B_COEFF, value, expected));
    }
    Ok(PlacedCoil { name: coil.name.clone(), pose, coefficients, box_from_x, field_at_center })
}

impl Calibration {
    /// The calibration of an array where its frames now are. Its box is the cube inside the rig's workspace:
    /// the format has no spheres, and every point of that cube lies in ours.
    #[must_use]
    pub fn of_array(rig: &HardwareDescription, array: &PosedArray) -> Self {
        let half_edge = rig.workspace.radius / 3_f64.sqrt();
        let coils = rig.coils.iter().enumerate().map(|(index, coil)| {
            let CoilPose { origin, axis } = array.coil_pose(index);
            let source = Source::of_series("Src_0", origin, axis, &coil.coefficients);
            CoilSources { name: coil.name.clone(), line: 0, sources: vec![source] }
        });
        Self {
            name: rig.rig.clone(),
            workspace: rig.workspace.center.map(|center| [center - half_edge, center + half_edge]),
            coils: coils.collect(),
            background: None,
            ends_with_line_end: true,
        }
    }
}
