//! The daemon keeps away from snap-through: on a rig whose law does not, a target beyond one is refused
//! before anything moves, and without the scout the watch over the margin keeps the rod on its branch. The
//! referee is the plant's truth.
#![cfg(feature = "sim")]

mod rig_support;

use std::collections::VecDeque;

use magsteer::control::{Directions, Verdict};
use magsteer::daemon::{CycleRecord, Verb};
use magsteer_hal::operator::{Cause, state};
use magsteer_sim_plant::SimulatedRig;
use rig_support::{Bench, Setup};

/// Where the rod stands, and where it does not come to without a snap: angles of both magnets from z, deg.
const BEFORE_DEG: [f64; 2] = [80.0, 90.0];
const BEYOND_DEG: [f64; 2] = [60.0, 90.0];
/// Over how long a turn counts as a jump, cycles of 1 ms.
const WINDOW: usize = 200;
/// Turn within that time that no reference leads to, deg.
const JUMP_DEG: f64 = 20.0;

fn planar(angles_deg: [f64; 2]) -> Directions {
    let mut directions = Directions::default();
    for (direction, angle) in directions.iter_mut().zip(angles_deg) {
        *direction = [angle.to_radians().sin(), 0.0, angle.to_radians().cos()];
    }
    directions
}

fn angle_deg(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    let norm = |vector: [f64; 3]| vector.iter().map(|entry| entry * entry).sum::<f64>().sqrt();
    let [apart, along] = [-1.0, 1.0].map(|sign| norm([0, 1, 2].map(|axis| one[axis] + sign * other[axis])));
    2.0 * apart.atan2(along).to_degrees()
}

/// True tangents of both magnets.
fn truth(rig: &SimulatedRig) -> [[f64; 3]; 2] {
    let pose = rig.plant().truth();
    [pose.magnets[0].tangent(), pose.magnets[1].tangent()]
}

/// What happened after a target was set.
#[derive(Debug, Default)]
struct Passed {
    /// Greatest turn of a magnet within the window while the daemon held the coils, deg, truth, by which the
    /// reference did not turn.
    jump_deg: f64,
    /// Farthest that a magnet was from where it was at the beginning, deg, truth.
    moved_deg: f64,
    /// The same of the reference.
    led_deg: f64,
    /// Cycles in which the reference moved before there was a verdict.
    led_unseen: u32,
    /// What became of the target.
    given_up: Option<Cause>,
    /// When, ms.
    given_up_ms: Option<usize>,
    /// At the end.
    state: u32,
    cause: Option<Cause>,
    verdict: Verdict,
    /// Extremes.
    margin_min: f64,
    warned: bool,
    current_change_a: f64,
    error_deg: f64,
}

/// A bench that steers at [`BEFORE_DEG`].
fn standing(setup: &Setup) -> Bench {
    let mut bench = Bench::new(setup);
    bench.run(0.3, |_, _| ());
    bench.request(Verb::Arm);
    bench.run(0.2, |_, _| ());
    bench.request(Verb::Go);
    bench.run(0.1, |_, _| ());
    for target in [[90.0, 90.0], BEFORE_DEG] {
        let passed = pass(&mut bench, target, 2.0);
        assert!(passed.error_deg < 1.0 && passed.state == state::ACTIVE, "{passed:?}");
    }
    bench
}

/// Sets a target and watches.
fn pass(bench: &mut Bench, target_deg: [f64; 2], seconds: f64) -> Passed {
    watch(bench, Verb::SetTarget(planar(target_deg).into()), target_deg, seconds)
}

/// Asks for something and watches; errors are from the target.
fn watch(bench: &mut Bench, verb: Verb, target_deg: [f64; 2], seconds: f64) -> Passed {
    let target = planar(target_deg);
    bench.request(verb);
    let mut passed = Passed { margin_min: f64::INFINITY, ..Passed::default() };
    let mut window: VecDeque<[[[f64; 3]; 2]; 2]> = VecDeque::new();
    let mut begin: Option<([[f64; 3]; 2], CycleRecord)> = None;
    let mut cycle = 0;
    bench.run(seconds, |record, rig| {
        let tangents = truth(rig);
        let desired = [record.outcome.desired[0], record.outcome.desired[1]];
        let (from, first) = begin.get_or_insert((tangents, *record));
        let holds = (state::ARMED..=state::HOLDING).contains(&record.decision.state);
        window.push_back([tangents, desired]);
        if window.len() > WINDOW {
            window.pop_front();
        }
        for magnet in 0..2 {
            let turned = angle_deg(&tangents[magnet], &window[0][0][magnet]);
            let asked = angle_deg(&desired[magnet], &window[0][1][magnet]);
            if holds {
                passed.jump_deg = passed.jump_deg.max(turned - asked);
            }
            passed.moved_deg = passed.moved_deg.max(angle_deg(&tangents[magnet], &from[magnet]));
            let led = angle_deg(&desired[magnet], &first.outcome.desired[magnet]);
            passed.led_unseen += u32::from(led > 0.01 && record.outcome.verdict == Verdict::Checking);
            passed.led_deg = passed.led_deg.max(led);
        }
        if let Some(cause) = record.decision.given_up {
            (passed.given_up, passed.given_up_ms) = (Some(cause), passed.given_up_ms.or(Some(cycle)));
        }
        let currents = record.admitted.current_a.iter().zip(&first.admitted.current_a);
        let change = currents.fold(0.0_f64, |most, (now, then)| most.max((now - then).abs()));
        passed.current_change_a = passed.current_change_a.max(change);
        passed.margin_min = passed.margin_min.min(record.outcome.model.margin);
        passed.warned |= record.decision.stability_low;
        passed.error_deg =
            (0..2).map(|magnet| angle_deg(&tangents[magnet], &target[magnet])).fold(0.0, f64::max);
        (passed.state, passed.cause, passed.verdict) =
            (record.decision.state, record.decision.cause, record.decision.verdict);
        cycle += 1;
    });
    passed
}

/// The demonstration, with or without what guards against snapping.
fn setup(scout: bool, watch: bool) -> Setup {
    let mut setup = Setup::shipped("bigmag-snap.toml");
    if !scout {
        setup.config.control.as_mut().expect("has a controller").scout = None;
    }
    if !watch {
        let daemon = setup.config.daemon.as_mut().expect("has a daemon");
        (daemon.stability_hold, daemon.stability_stop) = (-10.0, -10.0);
    }
    setup
}

/// Goal: what the guards are for: the rod of this rig does snap on the way, while the daemon still steers.
#[test]
fn unguarded_rod_snaps_through() {
    let passed = pass(&mut standing(&setup(false, false)), BEYOND_DEG, 2.0);
    println!("unguarded: {passed:?}");
    assert!(passed.jump_deg > JUMP_DEG, "{passed:?}");
    assert_eq!(passed.given_up, None);
}

/// Goal: the scout refuses the target before the reference moves, names the cause, and the loop goes on
/// steering where it was.
///
/// Proves SR-25.
#[test]
fn target_beyond_a_snap_through_is_refused_before_anything_moves() {
    let mut bench = standing(&setup(true, true));
    let passed = pass(&mut bench, BEYOND_DEG, 2.0);
    println!("scouted: {passed:?}");
    assert_eq!(passed.given_up, Some(Cause::TargetCrossesSnapThrough));
    assert!(matches!(passed.verdict, Verdict::Refused { .. }), "{passed:?}");
    assert_eq!((passed.state, passed.cause), (state::ACTIVE, passed.given_up));
    assert_eq!(passed.led_unseen, 0);
    // The reference rests; the magnets tremble by the noise of the sensors and currents alone.
    assert!(passed.led_deg < 0.1 && passed.moved_deg < 0.3, "{passed:?}");
    assert!(passed.margin_min > 0.5 && !passed.warned, "{passed:?}");
    // A target on this side is reached as if nothing had been asked.
    let passed = pass(&mut bench, [75.0, 80.0], 2.0);
    assert!(passed.error_deg < 1.0 && passed.given_up.is_none(), "{passed:?}");
    assert!(matches!(passed.verdict, Verdict::Clear { .. }), "{passed:?}");
}

/// Goal: without the scout the watch over the margin warns, then keeps the currents; the rod stays on its
/// branch, and comes back. The margin is the model's: a rod softer than that would have snapped before, which
/// is why the scout goes first.
#[test]
fn watch_over_the_margin_keeps_the_rod_on_its_branch() {
    let mut setup = setup(false, true);
    setup.plant.errors.modulus_relative = 0.10;
    let mut bench = standing(&setup);
    let passed = pass(&mut bench, BEYOND_DEG, 2.0);
    println!("watched: {passed:?}");
    assert_eq!(passed.given_up, Some(Cause::NearSnapThrough));
    assert_eq!((passed.state, passed.cause), (state::HOLDING, Some(Cause::NearSnapThrough)));
    assert!(passed.warned && passed.jump_deg < 0.5 * JUMP_DEG, "{passed:?}");
    let kept = pass(&mut bench, [75.0, 80.0], 2.0);
    println!("and back: {kept:?}");
    assert!(kept.error_deg < 1.0 && kept.state == state::ACTIVE, "{kept:?}");
}

/// Goal: held near its snap-through, the rod goes back along the way that it came without another jump, until the margin is no longer warned of,
/// and is kept there.
///
/// Proves SR-25.
#[test]
fn held_rod_goes_back_along_its_way_until_the_margin_is_wide_again() {
    let mut setup = setup(false, true);
    setup.plant.errors.modulus_relative = 0.10;
    let mut bench = standing(&setup);
    let held = pass(&mut bench, BEYOND_DEG, 2.0);
    assert_eq!((held.state, held.cause), (state::HOLDING, Some(Cause::NearSnapThrough)));
    let kept = watch(&mut bench, Verb::Go, BEFORE_DEG, 0.2);
    assert!(kept.state == state::HOLDING && kept.current_change_a == 0.0, "a go is not enough: {kept:?}");
    let back = watch(&mut bench, Verb::Retreat, BEFORE_DEG, 1.0);
    println!("back: {back:?}");
    assert_eq!((back.state, back.cause), (state::ACTIVE, None));
    assert!(back.jump_deg < 0.5 * JUMP_DEG && back.moved_deg > 1.0, "{back:?}");
    assert!(back.error_deg < kept.error_deg - 1.0, "towards where it came from: {back:?}");
    let there = watch(&mut bench, Verb::Go, BEFORE_DEG, 1.0);
    println!("there: {there:?}");
    assert!(there.moved_deg < 2.0 && there.given_up.is_none() && there.state == state::ACTIVE, "{there:?}");
    let on = pass(&mut bench, [75.0, 80.0], 2.0);
    assert!(on.error_deg < 1.0 && on.state == state::ACTIVE, "{on:?}");
}

/// Goal: no false alarm: through the shipped experiment nothing is refused, warned of or held, whatever the
/// seed and in plants up to 15 % softer and stiffer, on the ways to (60, 90) and (90, 120) too.
#[test]
fn shipped_steps_are_neither_refused_nor_held() {
    let steps =
        [[90.0, 90.0], [70.0, 70.0], [110.0, 70.0], [80.0, 110.0], [60.0, 90.0], [90.0, 60.0], [90.0, 120.0]];
    for (seed, modulus) in [(1, 0.10), (2, 0.10), (3, -0.15), (4, 0.15), (5, -0.15), (6, 0.15)] {
        let mut setup = Setup::shipped("bigmag-planar.toml").seeded(seed);
        setup.plant.errors.modulus_relative = modulus;
        let mut bench = standing(&setup);
        for target in steps {
            let passed = pass(&mut bench, target, 1.5);
            println!("seed {seed}, modulus {modulus}, {target:?}: {passed:?}");
            assert_eq!((passed.given_up, passed.state), (None, state::ACTIVE), "{target:?}: {passed:?}");
            assert_eq!(passed.led_unseen, 0, "{target:?}");
            assert!(matches!(passed.verdict, Verdict::Clear { .. }), "{target:?}: {passed:?}");
        }
    }
}
