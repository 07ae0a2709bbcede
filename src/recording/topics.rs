//! Views of a cycle in the standard messages of ROS, with the names of CRTK: a thinned copy for viewers; the
//! whole of it stands in [`super::Cycle`].
//!
//! Source of the names: Collaborative Robotics Toolkit, *Robot API, motion*
//! (<https://crtk-robotics.readthedocs.io>).

use magsteer_hal::operator::{cause, state, verb};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::cdr::Encoder;
use super::cycle::Cycle;
use super::info::Info;

/// Frame of every pose.
const FRAME: &str = "world";
/// Nothing changed: the code of a state that is not there.
const NO_STATE: u32 = u32::MAX;

/// How much an event matters; values of `rcl_interfaces/msg/Log`.
pub mod level {
    /// As expected.
    pub const INFO: u8 = 20;
    /// A stop that nobody asked for, or something lost.
    pub const WARN: u8 = 30;
    /// A fault.
    pub const ERROR: u8 = 40;
}

/// A name that ROS allows.
pub fn ros_name(name: &str) -> String {
    let allowed = |letter: char| if letter.is_ascii_alphanumeric() { letter } else { '_' };
    name.chars().map(allowed).collect()
}

/// Seconds and nanoseconds since 1970.
fn time(encoder: &mut Encoder, wall_ns: u64) {
    let seconds = u32::try_from(wall_ns / 1_000_000_000).unwrap_or(u32::MAX);
    encoder.u32(seconds);
    encoder.u32((wall_ns % 1_000_000_000) as u32);
}

fn header(encoder: &mut Encoder, wall_ns: u64) {
    time(encoder, wall_ns);
    encoder.text(FRAME);
}

/// Names of the joints: currents end in `_a`, angles in `_rad`.
pub fn joint_names(info: &Info) -> Vec<String> {
    let coils = info.coils.iter().map(|coil| format!("{}_a", ros_name(coil)));
    coils.chain(info.frames.iter().map(|frame| format!("{}_rad", ros_name(frame)))).collect()
}

/// `sensor_msgs/msg/JointState` of currents and angles.
pub fn joints(encoder: &mut Encoder, wall_ns: u64, names: &[String], currents: &[f64], angles: &[f64]) {
    header(encoder, wall_ns);
    encoder.length(names.len());
    names.iter().for_each(|name| encoder.text(name));
    encoder.length(currents.len() + angles.len());
    currents.iter().chain(angles).for_each(|value| encoder.f64(*value));
    // Neither velocities nor efforts.
    encoder.length(0);
    encoder.length(0);
}

/// `geometry_msgs/msg/PoseStamped`.
pub fn pose(encoder: &mut Encoder, wall_ns: u64, position_m: &[f64; 3], orientation_xyzw: &[f64; 4]) {
    header(encoder, wall_ns);
    position_m.iter().chain(orientation_xyzw).for_each(|value| encoder.f64(*value));
}

/// The measured orientation turned the shortest way until its z points along `direction`.
pub fn turned_to(orientation_xyzw: &[f64; 4], direction: &[f64; 3]) -> [f64; 4] {
    let [x, y, z, w] = *orientation_xyzw;
    let measured = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let wanted = Vector3::from(*direction);
    let turn = UnitQuaternion::rotation_between(&(measured * Vector3::z()), &wanted);
    // Opposite directions: any half turn will do.
    let turn = turn.unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&(measured * Vector3::x_axis()), std::f64::consts::PI)
    });
    let turned = turn * measured;
    [turned.i, turned.j, turned.k, turned.w]
}

/// `rcl_interfaces/msg/Log`.
pub fn log(encoder: &mut Encoder, wall_ns: u64, level: u8, rig: &str, text: &str) {
    time(encoder, wall_ns);
    encoder.u8(level);
    encoder.text(rig);
    encoder.text(text);
    // No source file, function or line.
    encoder.text("");
    encoder.text("");
    encoder.u32(0);
}

/// What happened in a cycle, each with its level; `before` is the cycle before it.
pub fn events(cycle: &Cycle, before: Option<&Cycle>) -> Vec<(u8, String)> {
    let mut events = Vec::new();
    let caused = |code: u32| match code {
        0 => String::new(),
        code => format!(": {} (cause {code})", cause::text(code)),
    };
    if cycle.request_verb != 0 {
        let name = match cycle.request_verb {
            magsteer_hal::record::own_verb::TERMINATE => "terminate",
            other => verb::name(other),
        };
        events.push((level::INFO, format!("request {name} (number {})", cycle.request_id)));
    }
    for (id, code) in cycle.answer_id.iter().zip(&cycle.answer_cause).filter(|(_, code)| **code != 0) {
        events.push((level::WARN, format!("request number {id} refused{}", caused(*code))));
    }
    if cycle.transition_to != NO_STATE {
        let (from, to) = (state::name(cycle.transition_from), state::name(cycle.transition_to));
        let level = match cycle.transition_to {
            state::FAULT => level::ERROR,
            state::SAFE_STOP => level::WARN,
            _ => level::INFO,
        };
        events.push((level, format!("{from} -> {to}{}", caused(cycle.transition_cause))));
    }
    if cycle.given_up != 0 {
        events.push((level::WARN, format!("target given up{}", caused(cycle.given_up))));
    }
    let counted = before.map_or(0, |before| before.would_trip_count);
    if cycle.would_trip_count > counted {
        events.push((level::WARN, format!("passive: would have tripped{}", caused(cycle.would_trip))));
    }
    events
}

#[cfg(test)]
mod tests {
    use magsteer_hal::MagnetPose;

    use super::{ros_name, turned_to};

    /// Goal: body z of the turned orientation is the direction asked for, opposite ones among them, and what
    /// need not turn does not.
    #[test]
    fn an_orientation_is_turned_until_its_z_points_where_it_should() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let measured = [half, 0.0, 0.0, half];
        for direction in [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [1.0, 0.0, 0.0]] {
            let orientation_xyzw = turned_to(&measured, &direction);
            let tangent = MagnetPose { orientation_xyzw, ..MagnetPose::default() }.tangent();
            let off = tangent.iter().zip(direction).map(|(is, wanted)| (is - wanted).abs());
            assert!(off.fold(0.0, f64::max) < 1e-12, "{direction:?}: {tangent:?}");
        }
        let unturned = turned_to(&measured, &[0.0, -1.0, 0.0]);
        assert!(unturned.iter().zip(measured).all(|(is, was)| (is - was).abs() < 1e-12));
    }

    #[test]
    fn names_become_such_that_ros_allows() {
        assert_eq!(ros_name("air-top.1"), "air_top_1");
    }
}
