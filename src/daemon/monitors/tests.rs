//! Each monitor alone: what it finds, when, and what it lets pass.

use std::time::Duration;

use magsteer_hal::message::Header;
use magsteer_hal::operator::Cause;
use magsteer_hal::scripted::example_description;
use magsteer_hal::{Absent, Actuation, MAGNETS_MAX, MagnetPose, PoseMessage, Stamp};

use super::bank::{Monitors, Sample};
use crate::control::Verdict;
use crate::daemon::config::tests::shipped;

const PERIOD: Duration = Duration::from_millis(1);

/// Monitors with the shipped limits, fed once a millisecond.
struct Bench {
    monitors: Monitors,
    now: Stamp,
    sample: Sample,
    model_error: Option<f64>,
    verdict: Verdict,
    /// Messages of poses come every so many cycles.
    pose_every: u64,
    cycles: u64,
}

impl Bench {
    fn new() -> Self {
        Self {
            monitors: Monitors::new(shipped().monitors.limits(), &example_description()),
            now: Stamp::from_nanoseconds(1_000_000_000),
            sample: Sample { measured: Some(Actuation::default()), engaged: true, ..Sample::default() },
            model_error: Some(0.0),
            verdict: Verdict::Clear { margin_min: 0.7, current_max: 2.0 },
            pose_every: 5,
            cycles: 0,
        }
    }

    fn cycle(&mut self) {
        self.now = self.now.after(PERIOD);
        self.cycles += 1;
        let pose_is_fresh = self.cycles.is_multiple_of(self.pose_every);
        self.sample.pose_is_fresh = pose_is_fresh && self.sample.pose.is_some();
        self.sample.pose_interval =
            if pose_is_fresh { PERIOD * self.pose_every as u32 } else { Duration::ZERO };
        if let Some(pose) = self.sample.pose.as_mut().filter(|_| pose_is_fresh) {
            pose.header.source_stamp_ns = self.now.nanoseconds();
            pose.header.sequence += 1;
        }
        self.monitors.take(&self.sample, self.now, self.model_error, self.verdict);
    }

    /// Cycles in which something is judged, at most `most`.
    fn until(
        &mut self,
        most: u64,
        wanted: impl Fn(&Monitors, Stamp) -> Option<Cause>,
    ) -> Option<(u64, Cause)> {
        (1..=most).find_map(|cycle| {
            self.cycle();
            wanted(&self.monitors, self.now).map(|cause| (cycle, cause))
        })
    }

    fn actuation(&mut self, most: u64) -> Option<(u64, Cause)> {
        self.until(most, |monitors, _| monitors.actuation_cause())
    }

    fn steering(&mut self, most: u64) -> Option<(u64, Cause)> {
        self.until(most, Monitors::steering_cause)
    }

    fn set(&mut self, commanded: f64, measured: f64) {
        self.sample.commanded.current_a[2] = commanded;
        self.sample.measured.as_mut().expect("given").current_a[2] = measured;
    }
}

fn poses(angle: f64, x: f64) -> PoseMessage {
    let half = 0.5 * angle;
    let magnet = MagnetPose {
        position_m: [x, 0.0, 0.0],
        orientation_xyzw: [0.0, half.sin(), 0.0, half.cos()],
        valid: 1,
        ..MagnetPose::default()
    };
    PoseMessage { magnet_count: 2, magnets: [magnet; MAGNETS_MAX], ..PoseMessage::default() }
}

/// Goal: a broken wire is found at a twentieth of an ampere above the least command, and not taken for one that carries.
#[test]
fn open_coil_is_found_at_small_steady_currents() {
    for commanded in [0.1, -0.1, 0.2, -3.0] {
        let mut bench = Bench::new();
        bench.set(commanded, 0.004);
        let (after, cause) = bench.actuation(1_000).expect("found");
        assert_eq!((after, cause), (302, Cause::CoilOpen), "{commanded} A");
        bench = Bench::new();
        bench.set(commanded, 0.98 * commanded + 0.004);
        let found = bench.actuation(5_000);
        assert_eq!(found, None, "{commanded} A");
    }
}

#[test]
fn open_coil_is_found_though_its_command_crosses_zero_again_and_again() {
    let mut bench = Bench::new();
    let mut found = None;
    for cycle in 0..3_000 {
        bench.set(0.15 * (f64::from(cycle) * 0.02).sin(), 0.0);
        bench.cycle();
        found = found.or(bench.monitors.actuation_cause());
    }
    assert_eq!(found, Some(Cause::CoilOpen));
}

/// Goal: one band from zero to the limit: a current that nobody asked for, one of the wrong gain, and one that the
/// supply cannot give are all off; what the sensors' own errors make of a command is not.
#[test]
fn currents_off_their_commands_are_found_at_zero_between_and_at_the_limit() {
    for (commanded, measured, is_off) in [
        (0.0, 0.3, true),
        (0.0, -0.3, true),
        (0.0, 0.2, false),
        (0.05, -0.25, true),
        (3.0, 2.5, true),
        (3.0, 3.3, false),
        (8.0, 7.3, true),
        (-8.0, -7.3, true),
        (8.0, 7.8, false),
    ] {
        let mut bench = Bench::new();
        bench.set(commanded, measured);
        let found = bench.actuation(1_000);
        assert_eq!(found.is_some(), is_off, "{commanded} A, {measured} A: {found:?}");
        assert!(found.is_none_or(|(after, cause)| after == 302 && cause == Cause::NotFollowing), "{found:?}");
    }
}

/// Goal: the largest step that the slew limit allows, with the lag of amplifiers at their supply's limit, is no sign.
#[test]
fn lag_behind_large_steps_is_no_sign() {
    let mut bench = Bench::new();
    let (mut commanded, mut measured) = (0.0_f64, 0.0_f64);
    for cycle in 0..20_000 {
        let target = if cycle / 500 % 2 == 0 { 8.0 } else { -8.0 };
        commanded += f64::clamp(target - commanded, -0.3, 0.3);
        // A supply of 48 V on 5 ohm and 0.1 H: at most 80 A/s at 8 A, some hundred more at none.
        measured += f64::clamp(commanded - measured, -0.16, 0.16);
        bench.set(commanded, measured);
        bench.cycle();
        let cause = bench.monitors.actuation_cause().filter(|cause| *cause != Cause::CoilOverheated);
        assert_eq!(cause, None, "cycle {cycle}");
    }
}

/// Goal: the limit is 8 deg: motors at full speed stay 5.1 deg behind.
#[test]
fn frames_off_their_commands_are_found_after_their_time() {
    let mut bench = Bench::new();
    bench.sample.commanded.angle_rad[1] = 9_f64.to_radians();
    assert_eq!(bench.actuation(5_000), Some((1_002, Cause::NotFollowing)));
    let mut bench = Bench::new();
    bench.sample.commanded.angle_rad[1] = 7_f64.to_radians();
    assert_eq!(bench.actuation(5_000), None);
}

/// Goal: against the closed form of the law: 8 A reach the limit of 5 A for ever after `tau ln(2.56 / 1.56)`, 5 A and
/// less never do, and a hot coil cools with the same time constant.
#[test]
fn heat_follows_its_law_and_trips_at_its_limit() {
    let mut bench = Bench::new();
    bench.set(8.0, 8.0);
    let expected = 400.0 * (2.56_f64 / 1.56).ln();
    let (after, cause) = bench.actuation(400_000).expect("found");
    assert_eq!(cause, Cause::CoilOverheated);
    assert!((after as f64 * 1e-3 - expected).abs() < 0.01, "{after} ms, not {expected} s");
    assert!(bench.monitors.is_hot());
    bench.set(0.0, 0.0);
    let cooled = (1..).find(|_| {
        bench.cycle();
        !bench.monitors.is_hot()
    });
    let expected = 400.0 * (1.0_f64 / 0.8).ln();
    assert!(
        cooled.is_some_and(|cycles: u32| (f64::from(cycles) * 1e-3 - expected).abs() < 0.02),
        "{cooled:?}"
    );
    let mut bench = Bench::new();
    bench.set(4.99, 4.99);
    assert_eq!(bench.actuation(2_000_000), None);
    assert!(bench.monitors.is_hot(), "warned of");
}

#[test]
fn poses_outside_of_the_workspace_are_doubted() {
    let reach = example_description().workspace.radius + 0.02;
    let doubt = |x: f64| {
        let mut bench = Bench::new();
        bench.sample.pose = Some(poses(0.3, x));
        bench.until(10, |monitors, _| monitors.doubt()).map(|(_, cause)| cause)
    };
    assert_eq!(doubt(reach - 1e-6), None);
    assert_eq!(doubt(reach + 1e-6), Some(Cause::PoseOutsideWorkspace));
    assert_eq!(doubt(f64::NAN), Some(Cause::PoseOutsideWorkspace));
}

/// Goal: within 5 ms a magnet turns by at most 5 + 10 deg and moves by at most 5 + 10 mm.
#[test]
fn poses_faster_than_a_rod_are_doubted_and_a_swing_is_not() {
    let doubt = |turn_deg: f64, shift: f64| {
        let mut bench = Bench::new();
        bench.sample.pose = Some(poses(0.3, 0.0));
        bench.until(10, |_, _| None);
        let mut moved = poses(0.3 + turn_deg.to_radians(), shift);
        moved.header = bench.sample.pose.expect("given").header;
        bench.sample.pose = Some(moved);
        bench.until(5, |monitors, _| monitors.doubt()).map(|(_, cause)| cause)
    };
    assert_eq!(doubt(14.9, 0.0149), None);
    assert_eq!(doubt(15.1, 0.0), Some(Cause::PoseTooFast));
    assert_eq!(doubt(0.0, 0.0151), Some(Cause::PoseTooFast));
}

#[test]
fn controller_that_froze_is_found_and_a_rod_at_rest_is_not() {
    let run = |moves: bool, follows: bool| {
        let mut bench = Bench::new();
        let mut found = None;
        for cycle in 0..2_000_u32 {
            let angle = if moves { 0.3 + 1e-3 * f64::from(cycle / 5 % 7) } else { 0.3 };
            let header = bench.sample.pose.map(|pose| pose.header).unwrap_or_default();
            bench.sample.pose = Some(PoseMessage { header, ..poses(angle, 0.0) });
            if follows || cycle == 0 {
                bench.sample.seen_by_controller[0] = [angle.sin(), 0.0, angle.cos()];
            }
            bench.cycle();
            found = found.or(bench.monitors.steering_cause(bench.now).map(|cause| (cycle, cause)));
        }
        found
    };
    let (after, cause) = run(true, false).expect("found");
    assert!(cause == Cause::NotProgressing && (250..280).contains(&after), "{after} {cause:?}");
    assert_eq!(run(true, true), None);
    assert_eq!(run(false, false), None);
}

/// Goal: 20 s at a distance without coming nearer by a tenth; coming nearer, a parameter at its limit, a way that ends
/// short, another target and a small distance are all excuses.
#[test]
fn want_of_progress_is_found_and_has_its_excuses() {
    let toward = |angle: f64| [angle.sin(), 0.0, angle.cos()];
    let run = |edit: fn(&mut Bench, u32)| {
        let mut bench = Bench::new();
        bench.sample.target[0] = toward(0.5);
        bench.sample.seen_by_controller[0] = toward(1.0);
        (0..45_000).find_map(|cycle| {
            edit(&mut bench, cycle);
            bench.cycle();
            bench.monitors.steering_cause(bench.now).map(|cause| (cycle, cause))
        })
    };
    assert_eq!(run(|_, _| ()), Some((20_001, Cause::NotProgressing)));
    assert_eq!(run(|bench, _| bench.sample.saturated = 1), None);
    assert_eq!(run(|bench, _| bench.sample.engaged = false), None);
    assert_eq!(run(|bench, _| bench.verdict = Verdict::OutOfReach { progress: 0.5 }), None);
    assert_eq!(run(|bench, _| bench.sample.target[0] = [0.9_f64.sin(), 0.0, 0.9_f64.cos()]), None);
    assert_eq!(run(|bench, cycle| bench.sample.target[0][1] = f64::from(cycle / 15_000) * 1e-3), None);
    // Half of the distance in 45 s.
    let nearer = |bench: &mut Bench, cycle: u32| {
        let angle = 1.0 - 0.25 * f64::from(cycle) / 45_000.0;
        bench.sample.seen_by_controller[0] = [angle.sin(), 0.0, angle.cos()];
    };
    assert_eq!(run(nearer), None);
}

#[test]
fn model_that_stays_off_is_found_and_one_off_now_and_then_is_not() {
    let mut bench = Bench::new();
    bench.model_error = Some(21_f64.to_radians());
    assert_eq!(bench.steering(5_000), Some((2_002, Cause::ModelOff)));
    let mut bench = Bench::new();
    for cycle in 0..20_000 {
        bench.model_error = Some(if cycle % 100 < 45 { 0.5 } else { 0.1 });
        assert_eq!(bench.steering(1), None);
    }
    let mut bench = Bench::new();
    bench.model_error = None;
    assert_eq!(bench.steering(5_000), None, "without an equilibrium there is nothing to compare");
}

#[test]
fn lost_repeated_and_backward_messages_are_counted_apart() {
    let mut bench = Bench::new();
    bench.pose_every = 1;
    bench.sample.pose = Some(poses(0.3, 0.0));
    bench.cycle();
    let sequence = |bench: &mut Bench, to: u64| {
        bench.sample.pose.as_mut().expect("given").header.sequence = to - 1;
        bench.cycle();
    };
    for to in [2, 3, 7, 8, 18] {
        sequence(&mut bench, to);
    }
    bench.sample.pose.as_mut().expect("given").header.epoch = 9;
    sequence(&mut bench, 1);
    bench.sample.feedback = None;
    bench.pose_every = 1_000;
    for refused in [
        Absent::Sequence { last: 4, actual: 4 },
        Absent::Sequence { last: 4, actual: 3 },
        Absent::Sequence { last: 4, actual: 1 },
        Absent::Schema { expected: 1, actual: 2 },
    ] {
        bench.sample.feedback_refused = Some(refused);
        bench.cycle();
    }
    (bench.sample.feedback_refused, bench.sample.feedback) =
        (None, Some(Header { sequence: 5, ..Header::default() }));
    bench.cycle();
    let report = bench.monitors.report();
    assert_eq!((report.poses.skipped, report.poses.restarts, report.poses.refused), (3 + 9, 1, 0));
    let feedback = report.feedback;
    assert_eq!((feedback.repeated, feedback.backward, feedback.refused, feedback.skipped), (1, 2, 1, 0));
}

#[test]
fn evidence_of_currents_is_forgotten_with_a_new_holder_and_heat_is_not() {
    let mut bench = Bench::new();
    bench.set(8.0, 8.0);
    for _ in 0..100_000 {
        bench.cycle();
    }
    let heat = bench.monitors.heat();
    bench.set(8.0, 0.0);
    assert!(bench.actuation(1_000).is_some());
    bench.monitors.note_grant();
    assert_eq!(bench.monitors.actuation_cause(), None);
    assert!(heat > 0.5 && bench.monitors.heat() > 0.99 * heat);
}
