//! The ways of a plan as an experiment that plays them.

use std::fmt::Write;

use magsteer::control::plan::{Plan, Posture, Unreached, Waypoint};
use magsteer_hal::HardwareDescription;

/// Time for frames to get up to speed and slow down again, s.
const FRAME_RAMPS_S: f64 = 0.5;

/// An experiment as TOML text: to each target that a way was found to, and where targets are planned from rest back between them.
/// Each step lasts as long as frames turn and magnets settle, `settle_s`.
pub fn experiment(
    rig: &HardwareDescription,
    rest: &Posture,
    plans: &[Result<Plan, Unreached>],
    returns: bool,
    settle_s: f64,
) -> String {
    let mut text = "# Ways planned by `magsteer plan`: where each magnet shall point, and the frames stand when it does.\n\n\
        description = \"Planned ways to targets in 3-D\"\n\
        axis = [0.0, 1.0, 0.0]\n\
        zero_direction = [0.0, 0.0, 1.0]\n"
        .to_owned();
    let mut before =
        Waypoint { directions: rest.directions, frame_angles: rest.equilibrium.actuation.angle_rad };
    let last = plans.iter().rposition(Result::is_ok);
    for (index, plan) in plans.iter().enumerate() {
        let Ok(plan) = plan else { continue };
        let home = if returns && last != Some(index) { &plan.home[..] } else { &[] };
        let to_target = plan.waypoints.len();
        for (place, waypoint) in plan.waypoints.iter().chain(home).enumerate() {
            let remark = match place + 1 {
                place if place == to_target => format!("target {}", index + 1),
                place if place < to_target => format!("on the way to target {}", index + 1),
                _ => "back to rest".to_owned(),
            };
            text += &step(rig, &before, waypoint, &remark, settle_s);
            before = *waypoint;
        }
    }
    text
}

fn step(rig: &HardwareDescription, from: &Waypoint, to: &Waypoint, remark: &str, settle_s: f64) -> String {
    let directions = rig
        .magnets()
        .zip(&to.directions)
        .map(|(magnet, [x, y, z])| format!("{} = [{x:.9}, {y:.9}, {z:.9}]", magnet.name));
    let frames = || rig.frames.iter().zip(from.frame_angles.iter().zip(&to.frame_angles));
    let angles = frames().map(|(frame, (_, to))| format!("{} = {:.6}", frame.name, to.to_degrees()));
    let turn = frames().map(|(frame, (from, to))| (to - from).abs() / frame.speed_max).fold(0.0, f64::max);
    let ramps = if turn > 0.0 { FRAME_RAMPS_S } else { 0.0 };
    let mut text = format!("\n[[steps]]                               # {remark}\n");
    // Writing to a string does not fail.
    let _ = writeln!(text, "target_direction = {{ {} }}", directions.collect::<Vec<_>>().join(", "));
    if !rig.frames.is_empty() {
        let _ = writeln!(text, "frames_deg = {{ {} }}", angles.collect::<Vec<_>>().join(", "));
    }
    let _ = writeln!(text, "duration_s = {:.2}", turn + ramps + settle_s);
    text
}
