//! Units that were mixed up and values that the rig cannot have, found before they become parameters.
//!
//! A current beyond its coil's limit, an angle beyond its frame's range, a magnet farther from the clamp
//! than the rod is long: each is refused by its line, and where a common slip of units would explain it,
//! that is said.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::PartDescription;

use crate::math::csv::Refusal;

use super::sample::Samples;

/// Share by which a sensor may overstate a current's limit.
const CURRENT_SLACK: f64 = 0.05;
/// Degrees by which a sensor may overstate an angle's range.
const ANGLE_SLACK_DEG: f64 = 1.0;
/// Share of the way along the rod, and a length in m, by which clamp and sensor may be apart.
const REACH_SLACK: (f64, f64) = (0.2, 0.01);

/// Refuses samples that the rig cannot have been in.
///
/// # Errors
/// The first such value.
pub fn check_units(samples: &Samples, rig: &HardwareDescription) -> Result<(), Refusal> {
    let reaches = reaches(rig);
    for sample in &samples.samples {
        for (index, coil) in rig.coils.iter().enumerate() {
            let current = sample.actuation.current_a[index];
            if current.abs() > coil.current_max * (1.0 + CURRENT_SLACK) {
                let expected = format!(
                    "at most {} A in magnitude (coil {}): milliamperes in place of amperes?",
                    coil.current_max, coil.name
                );
                return Err(Refusal::new(sample.line, format!("i{index}_a"), current, expected));
            }
        }
        for (index, frame) in rig.frames.iter().enumerate() {
            let angle = sample.actuation.angle_rad[index].to_degrees();
            let (least, most) = (frame.angle_min.to_degrees(), frame.angle_max.to_degrees());
            if !(least - ANGLE_SLACK_DEG..=most + ANGLE_SLACK_DEG).contains(&angle) {
                let expected = format!("{least:.1} to {most:.1} deg, the range of frame {}", frame.name);
                let column = format!("theta_{}_deg", frame.name);
                return Err(Refusal::new(sample.line, column, format!("{angle:.6}"), expected));
            }
        }
        for ((magnet, reading), reach) in rig.magnets().zip(&sample.magnets).zip(&reaches) {
            let Some(position) = reading.and_then(|reading| reading.position) else { continue };
            let base = nalgebra::Vector3::from(rig.manipulator.base_position);
            let distance = (position - base).norm();
            if distance > reach * (1.0 + REACH_SLACK.0) + REACH_SLACK.1 {
                let columns = format!("{0}_x_m, {0}_y_m, {0}_z_m", magnet.name);
                let value = format!("{:?}", [position.x, position.y, position.z]);
                let expected = format!(
                    "within {:.1} mm of the clamp, as far as the rod reaches (this is {distance:.4} m away): \
                    millimetres in place of metres?",
                    reach * 1e3
                );
                return Err(Refusal::new(sample.line, columns, value, expected));
            }
        }
    }
    Ok(())
}

/// True when the angles of a file could be radians under a header in degrees: all small, and not all nearly
/// zero.
#[must_use]
pub fn may_be_radians(samples: &Samples, rig: &HardwareDescription) -> bool {
    let angles = samples.samples.iter().flat_map(|sample| &sample.actuation.angle_rad[..rig.frames.len()]);
    let most = angles.fold(0.0, |most: f64, angle| most.max(angle.to_degrees().abs()));
    (0.5..=std::f64::consts::PI).contains(&most)
}

/// Length of the rod from the clamp to the centre of each magnet, m.
fn reaches(rig: &HardwareDescription) -> Vec<f64> {
    let mut length = 0.0;
    let mut reaches = Vec::new();
    for part in &rig.manipulator.parts {
        match part {
            PartDescription::Section(section) => length += section.length,
            PartDescription::Magnet(magnet) => {
                reaches.push(length + 0.5 * magnet.length);
                length += magnet.length;
            }
        }
    }
    reaches
}
