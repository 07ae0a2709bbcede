//! The scout: nothing is led to unseen, a stream of targets gets through, stopping needs no looking.

use magsteer_hal::invalid::Checks;
use magsteer_hal::{Actuation, MagnetPose, PoseMessage};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};

use super::fixtures::Rig;
use crate::control::{
    Cycle, CycleInput, CycleOutcome, Directions, ReferenceTarget, Step, Verdict, margin_allowed,
};

const PERIOD: f64 = 1e-3;

/// A loop whose rod is its model, without delay.
struct Ideal {
    cycle: Cycle,
    admitted: Actuation,
    pose: PoseMessage,
    target: ReferenceTarget,
}

impl Ideal {
    /// Steering, at rest without currents.
    fn new(rig: &Rig) -> Self {
        let mut ideal = Self {
            cycle: Cycle::new(&rig.control, &rig.description, rig.manipulator.clone()),
            admitted: Actuation::default(),
            pose: PoseMessage::default(),
            target: ReferenceTarget::default(),
        };
        ideal.step(false);
        ideal.target = ideal.step(false).desired.into();
        ideal
    }

    fn step(&mut self, engaged: bool) -> CycleOutcome {
        let outcome = self.cycle.step(&CycleInput {
            period: PERIOD,
            pose: Some(self.pose),
            pose_is_fresh: self.pose.magnet_count > 0,
            pose_age: 0.0,
            measured: self.admitted,
            admitted: self.admitted,
            target: self.target,
            engaged,
        });
        self.admitted = outcome.request;
        self.pose = poses(&outcome.predicted);
        outcome
    }

    /// Cycles until there is a verdict; how many, and the last one.
    fn judged(&mut self) -> (u32, CycleOutcome) {
        for cycle in 1..10_000 {
            let outcome = self.step(true);
            if outcome.verdict != Verdict::Checking {
                return (cycle, outcome);
            }
        }
        panic!("no verdict");
    }
}

fn poses(directions: &Directions) -> PoseMessage {
    let mut pose = PoseMessage { magnet_count: 2, ..PoseMessage::default() };
    for (magnet, direction) in pose.magnets.iter_mut().zip(directions).take(2) {
        let direction = Vector3::from(*direction);
        let turn = Rotation3::rotation_between(&Vector3::z(), &direction).expect("not opposite");
        let [x, y, z, w] = UnitQuaternion::from_rotation_matrix(&turn).coords.into();
        *magnet = MagnetPose { orientation_xyzw: [x, y, z, w], valid: 1, ..MagnetPose::default() };
    }
    pose
}

fn planar(angles_deg: [f64; 2]) -> ReferenceTarget {
    let mut directions = Directions::default();
    for (direction, angle) in directions.iter_mut().zip(angles_deg) {
        let (sine, cosine) = angle.to_radians().sin_cos();
        *direction = [sine, 0.0, cosine];
    }
    directions.into()
}

/// Goal: while a way is looked at the target before is in force and the reference does not leave it; then the new one is.
#[test]
fn reference_waits_for_the_verdict() {
    let mut ideal = Ideal::new(&Rig::shipped());
    let before = ideal.target;
    assert_eq!(ideal.step(true).in_force, before);
    ideal.target = planar([80.0, 95.0]);
    let first = ideal.step(true);
    assert_eq!((first.verdict, first.in_force), (Verdict::Checking, before));
    let (cycles, outcome) = ideal.judged();
    assert!((3..200).contains(&cycles), "{cycles}");
    assert!(matches!(outcome.verdict, Verdict::Clear { margin_min, .. } if margin_min > 0.1), "{outcome:?}");
    assert_eq!(outcome.in_force, ideal.target);
}

/// Goal: targets that come faster than they can be looked at neither starve nor pass unseen: each in force was asked for, and the
/// newest is in force soon after the stream ends.
#[test]
fn stream_of_targets_gets_through() {
    let mut ideal = Ideal::new(&Rig::shipped());
    let (mut asked, mut in_force) = (vec![ideal.target], Vec::new());
    for cycle in 0..400 {
        let ahead = 0.02 * f64::from(cycle);
        ideal.target = planar([100.0 - ahead, 100.0 + 0.5 * ahead]);
        asked.push(ideal.target);
        let outcome = ideal.step(true);
        assert!(asked.contains(&outcome.in_force), "cycle {cycle}");
        in_force.push(outcome.in_force);
    }
    in_force.dedup();
    assert!(in_force.len() > 10, "only {} targets got through", in_force.len());
    let (cycles, outcome) = ideal.judged();
    assert!(cycles < 100 && outcome.in_force == ideal.target, "{cycles}");
}

/// Goal: a target that is the present reference, as an operator's hold sets it, is in force at once, also while another is looked at.
#[test]
fn stopping_needs_no_looking() {
    let mut ideal = Ideal::new(&Rig::shipped());
    ideal.target = planar([70.0, 90.0]);
    ideal.judged();
    for _ in 0..60 {
        ideal.step(true);
    }
    ideal.target = planar([110.0, 70.0]);
    let outcome = ideal.step(true);
    assert_eq!(outcome.verdict, Verdict::Checking);
    ideal.target = outcome.desired.into();
    let stopped = ideal.step(true);
    assert!(matches!(stopped.verdict, Verdict::Clear { .. }), "{stopped:?}");
    assert_eq!(stopped.in_force, ideal.target);
}

/// Goal: a loop that does not steer, or has no scout, judges nothing and leads to the target at once.
#[test]
fn nothing_is_judged_without_a_scout_or_without_steering() {
    let mut rig = Rig::shipped();
    let mut ideal = Ideal::new(&rig);
    ideal.target = planar([80.0, 95.0]);
    assert_eq!(ideal.step(false).verdict, Verdict::Unchecked);
    rig.control.scout = None;
    let mut ideal = Ideal::new(&rig);
    ideal.target = planar([80.0, 95.0]);
    let outcome = ideal.step(true);
    assert_eq!((outcome.verdict, outcome.in_force), (Verdict::Unchecked, ideal.target));
}

#[test]
fn motion_from_below_the_limit_may_lose_half_of_its_margin() {
    assert_eq!(margin_allowed(0.15, 0.9), 0.15);
    assert_eq!(margin_allowed(0.15, 0.2), 0.1);
    assert_eq!(margin_allowed(0.15, 0.08), 0.04);
    assert_eq!(margin_allowed(0.15, -0.5), -0.75);
    assert_eq!(margin_allowed(0.15, f64::NAN), 0.15);
}

#[test]
fn each_bad_value_is_named_by_its_key() {
    let shipped = Rig::shipped().control.scout.expect("shipped");
    for (key, value) in
        [("steps_per_s", 9.0), ("station_deg", 0.0), ("margin_min", f64::NAN), ("tolerance_deg", 0.0)]
    {
        let mut config = shipped.clone();
        let field = match key {
            "steps_per_s" => &mut config.steps_per_s,
            "station_deg" => &mut config.station_deg,
            "margin_min" => &mut config.margin_min,
            _ => &mut config.tolerance_deg,
        };
        *field = value;
        let mut checks = Checks::new();
        config.check(&mut checks);
        let found = checks.into_result(()).expect_err("refused");
        let keys: Vec<&str> = found.iter().map(|invalid| invalid.key.as_str()).collect();
        assert_eq!(keys, [format!("control.scout.{key}")]);
    }
}
