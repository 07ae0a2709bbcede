//! What the reference promises: a straight common way within all limits, to the end and not beyond, whatever
//! the loop's rate.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::math::{SplitMix, angle_between};

const TIME_CONSTANT: f64 = 0.04;
const TURN: Limits = Limits { speed: 4.0, acceleration: 30.0 };
const FRAMES: [Limits; 2] =
    [Limits { speed: 0.8, acceleration: 2.5 }, Limits { speed: 0.5, acceleration: 1.0 }];
const PERIOD: f64 = 1e-3;

type Angles = [f64; POSE_PARAMETERS_MAX];

fn pacing() -> Pacing {
    Pacing { turn: TURN, frames: FRAMES.to_vec(), time_constant: TIME_CONSTANT }
}

fn direction(random: &mut ChaCha8Rng) -> Vector3<f64> {
    let mut entry = || random.random_range(-1.0..1.0);
    Vector3::new(entry(), entry(), entry()).normalize()
}

/// Three magnets.
fn directions(random: &mut ChaCha8Rng) -> [Vector3<f64>; MAGNETS_MAX] {
    let mut found = [Vector3::zeros(); MAGNETS_MAX];
    found[..3].fill_with(|| direction(random));
    found
}

fn angles(random: &mut ChaCha8Rng) -> Angles {
    let mut found = [0.0; POSE_PARAMETERS_MAX];
    found[..2].fill_with(|| random.random_range(-2.0..2.0));
    found
}

fn target(directions: &[Vector3<f64>; MAGNETS_MAX], frame_angles: Option<Angles>) -> ReferenceTarget {
    ReferenceTarget { directions: directions.map(Into::into), frame_angles }
}

fn at_rest(directions: &[Vector3<f64>; MAGNETS_MAX], frame_angles: &Angles) -> Reference {
    let mut reference = Reference::new(3, &pacing());
    reference.reset(directions, frame_angles);
    reference
}

/// What is left of the way to a target: three angles on the sphere, two of the frames.
fn left(reference: &Reference, target: &ReferenceTarget) -> [f64; 5] {
    let now = reference.directions();
    let angle =
        |magnet: usize| angle_between(&Vector3::from(now[magnet]), &Vector3::from(target.directions[magnet]));
    let turns = target.frame_angles.unwrap_or_default();
    let frames = reference.frame_angles().unwrap_or(turns);
    [angle(0), angle(1), angle(2), (turns[0] - frames[0]).abs(), (turns[1] - frames[1]).abs()]
}

/// Goal: from rest all directions and frames have covered the same share of their great circles and turns at
/// any moment, none ever turns back, and all end on the target.
#[test]
fn from_rest_all_follow_one_straight_way_and_arrive_together() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for with_frames in [false, true].repeat(10) {
        let (from, to) = (directions(&mut random), directions(&mut random));
        let (angles_from, angles_to) = (angles(&mut random), angles(&mut random));
        let mut reference = at_rest(&from, &angles_from);
        let target = target(&to, with_frames.then_some(angles_to));
        let mut whole = [0.0; 5];
        for magnet in 0..3 {
            whole[magnet] = angle_between(&from[magnet], &to[magnet]);
        }
        let coordinates = if with_frames { 5 } else { 3 };
        (whole[3], whole[4]) = ((angles_to[0] - angles_from[0]).abs(), (angles_to[1] - angles_from[1]).abs());
        let mut before = whole;
        for _ in 0..20_000 {
            reference.advance(&target, PERIOD);
            let now = left(&reference, &target);
            let shares: Vec<f64> = (0..coordinates).map(|index| now[index] / whole[index]).collect();
            for (index, share) in shares.iter().enumerate() {
                assert!((share - shares[0]).abs() < 1e-6, "{shares:?}");
                // To rounding of the angle between unit vectors.
                assert!(now[index] <= before[index] + 1e-14);
            }
            for magnet in 0..3 {
                let normal = from[magnet].cross(&to[magnet]).normalize();
                assert!(Vector3::from(reference.directions()[magnet]).dot(&normal).abs() < 1e-9);
            }
            before = now;
        }
        assert!(before.iter().all(|left| *left < 1e-12), "{before:?}");
    }
}

/// Goal: it is no slower than limits and lags ask: the slowest coordinate's own time at its limits, and a few
/// time constants.
#[test]
fn the_slowest_coordinate_sets_the_pace() {
    let (mut from, mut to) = ([Vector3::zeros(); MAGNETS_MAX], [Vector3::zeros(); MAGNETS_MAX]);
    from[..3].fill(Vector3::x());
    to[..3].fill(Vector3::x());
    let at = |angle: f64| Vector3::new(angle.cos(), angle.sin(), 0.0);
    (to[0], to[1]) = (at(0.3), at(0.1));
    let arrival = |frame_angles: Option<Angles>| {
        let mut reference = at_rest(&from, &[0.0; POSE_PARAMETERS_MAX]);
        let target = target(&to, frame_angles);
        let mut time = 0.0;
        while left(&reference, &target)[0] > 0.003 {
            reference.advance(&target, PERIOD);
            time += PERIOD;
        }
        time
    };
    // To 1 % of the way, where two lags of T need 6.6 T after their input has ended.
    let turning = 2.0 * (0.3 / TURN.acceleration).sqrt();
    let alone = arrival(None);
    assert!(alone > turning && alone < turning + 6.6 * TIME_CONSTANT, "{alone}");
    let mut goals = [0.0; POSE_PARAMETERS_MAX];
    goals[1] = -1.5;
    let slow = 1.5 / FRAMES[1].speed + FRAMES[1].speed / FRAMES[1].acceleration;
    let together = arrival(Some(goals));
    // The last percent at the speed limit's braking: sqrt(2 0.015 / 1) s before the end.
    assert!(together > slow - 0.2 && together < slow + 6.6 * TIME_CONSTANT, "{together} {slow}");
}

/// Goal: whatever the target does, in motion too, speeds and accelerations stay within their limits, and no
/// velocity leaps.
#[test]
fn limits_hold_and_velocities_are_continuous_on_any_retargeting() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut reference = at_rest(&directions(&mut random), &angles(&mut random));
    let mut goal = target(&directions(&mut random), Some(angles(&mut random)));
    let velocities = |reference: &Reference| {
        let frames = reference.frame_velocity();
        ([0, 1, 2].map(|magnet| reference.velocity(magnet)), [frames[0], frames[1]])
    };
    let mut before = velocities(&reference);
    let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
    for _ in 0..100_000 {
        if random.random_bool(0.005) {
            goal = target(&directions(&mut random), Some(angles(&mut random)));
        }
        reference.advance(&goal, PERIOD);
        let now = velocities(&reference);
        for magnet in 0..3 {
            let speed = now.0[magnet].norm();
            // In the tangent plane: what bends with the sphere is no acceleration along it.
            let here = Vector3::from(reference.directions()[magnet]);
            let change = now.0[magnet] - before.0[magnet];
            let along = (change - here * here.dot(&change)).norm() / PERIOD;
            (fastest, hardest) = (fastest.max(speed / TURN.speed), hardest.max(along / TURN.acceleration));
        }
        for (frame, limits) in FRAMES.iter().enumerate() {
            assert!(now.1[frame].abs() <= limits.speed * (1.0 + 1e-9));
            let acceleration = (now.1[frame] - before.1[frame]).abs() / PERIOD;
            assert!(acceleration <= limits.acceleration * (1.0 + 1e-9), "{acceleration}");
        }
        before = now;
    }
    println!("fastest {fastest}, hardest {hardest}");
    // The limits are used: speed in full, acceleration as far as the lags leave it between two leaps. They
    // are kept on the sphere too, where the lags bend with what they follow.
    assert!(fastest > 0.99 && fastest < 1.0 + 1e-9, "{fastest}");
    assert!(hardest > 0.8 && hardest < 1.0 + 1e-9, "{hardest}");
}

/// Goal: after any history it ends on the last target, to rounding.
#[test]
fn every_history_ends_on_the_last_target() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..30 {
        let mut reference = at_rest(&directions(&mut random), &angles(&mut random));
        let mut goal = target(&directions(&mut random), None);
        for _ in 0..random.random_range(1..6) {
            goal = target(&directions(&mut random), Some(angles(&mut random)));
            (0..random.random_range(1..900)).for_each(|_| reference.advance(&goal, PERIOD));
        }
        (0..20_000).for_each(|_| reference.advance(&goal, PERIOD));
        let end = left(&reference, &goal);
        assert!(end.iter().all(|left| *left < 1e-12), "{end:?}");
        assert!((0..3).all(|magnet| reference.velocity(magnet).norm() < 1e-9));
    }
}

/// Goal: the way is one of time, not of cycles. At 100 Hz and 10 kHz it is that of 1 kHz to a thousandth of a
/// radian, whatever targets come on the way.
#[test]
fn the_way_does_not_depend_on_the_loops_rate() {
    let run = |period: f64| {
        let mut random = ChaCha8Rng::seed_from_u64(4);
        let mut reference = at_rest(&directions(&mut random), &angles(&mut random));
        let mut seen = Vec::new();
        for _ in 0..20 {
            let goal = target(&directions(&mut random), Some(angles(&mut random)));
            for _ in 0..25 {
                let cycles = (0.01 / period).round() as usize;
                (0..cycles).for_each(|_| reference.advance(&goal, period));
                seen.push((reference.directions(), reference.frame_angles().expect("steered")));
            }
        }
        seen
    };
    let common = run(1e-3);
    for (period, tolerance) in [(1e-2, 1e-12), (1e-4, 1e-3)] {
        let mut most = 0.0_f64;
        for ((directions, angles), (expected, expected_angles)) in run(period).iter().zip(&common) {
            for (one, other) in directions.iter().zip(expected).take(3) {
                most = most.max(angle_between(&Vector3::from(*one), &Vector3::from(*other)));
            }
            most = most.max((angles[0] - expected_angles[0]).abs());
        }
        println!("{period}: {most}");
        assert!(most < tolerance, "{period}: {most}");
    }
}

/// Goal: the velocity is that of the directions and angles.
#[test]
fn velocity_is_the_derivative_of_the_way() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut reference = at_rest(&directions(&mut random), &angles(&mut random));
    let goal = target(&directions(&mut random), Some(angles(&mut random)));
    let period = 1e-5;
    for number in 0..40_000 {
        let (before, angles_before) = (reference.directions(), reference.frame_angles());
        let (velocity, rate) = (reference.velocity(1), reference.frame_velocity());
        reference.advance(&goal, period);
        let (Some(before_angles), Some(after_angles)) = (angles_before, reference.frame_angles()) else {
            assert_eq!(number, 0);
            continue;
        };
        let moved = (Vector3::from(reference.directions()[1]) - Vector3::from(before[1])) / period;
        // Half a period of the greatest acceleration, on the sphere also of the centripetal one.
        assert!((moved - velocity).norm() < period * (TURN.acceleration + TURN.speed.powi(2)));
        assert!(((after_angles[0] - before_angles[0]) / period - rate[0]).abs() < period * 3.0);
    }
}

/// Goal: half a turn away any great circle will do, and one is followed; at no distance nothing moves; what
/// is no direction is no target.
#[test]
fn antipodes_no_distance_and_no_direction_are_safe() {
    let mut from = [Vector3::zeros(); MAGNETS_MAX];
    (from[0], from[1], from[2]) = (Vector3::x(), Vector3::y(), Vector3::z());
    let mut reference = at_rest(&from, &[0.0; POSE_PARAMETERS_MAX]);
    let mut goal = target(&from, None);
    (goal.directions[0], goal.directions[2]) = ([-1.0, 0.0, 0.0], [0.0; 3]);
    for _ in 0..5000 {
        reference.advance(&goal, PERIOD);
        let now = reference.directions();
        assert!(now[0].iter().all(|entry| entry.is_finite()));
        assert!((Vector3::from(now[0]).norm() - 1.0).abs() < 1e-12);
        assert_eq!(now[1..3], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }
    assert!(angle_between(&Vector3::from(reference.directions()[0]), &-Vector3::x()) < 1e-12);
    for strange in [[f64::NAN; 3], [f64::INFINITY, 0.0, 0.0], [f64::MAX; 3], [1e-310, 0.0, 0.0]] {
        goal.directions[0] = strange;
        for period in [0.0, -1.0, f64::NAN, 1e-12, 1e12, f64::INFINITY] {
            reference.advance(&goal, period);
            assert!(reference.directions()[0].iter().all(|entry| entry.is_finite()), "{strange:?} {period}");
        }
    }
}

/// Goal: without goals the frames stay and set no pace; where others turned them meanwhile is where they
/// begin.
#[test]
fn frames_without_goals_are_left_alone() {
    let mut random = SplitMix::new(6);
    let mut from = [Vector3::zeros(); MAGNETS_MAX];
    from[..3].fill(Vector3::x());
    let mut reference = at_rest(&from, &[0.4; POSE_PARAMETERS_MAX]);
    reference.advance(&target(&from, None), PERIOD);
    assert_eq!(reference.frame_angles(), None);
    assert_eq!(reference.frame_velocity(), [0.0; POSE_PARAMETERS_MAX]);
    let turned = [random.unit(); POSE_PARAMETERS_MAX];
    reference.reset_frames(&turned);
    let mut goals = turned;
    goals[0] += 0.5;
    reference.advance(&target(&from, Some(goals)), PERIOD);
    let angles = reference.frame_angles().expect("steered");
    // Within a millisecond of an acceleration of 2.5 rad/s^2.
    assert!(angles[0] >= turned[0] && angles[0] < turned[0] + 3e-6);
    assert_eq!(angles[1], turned[1]);
}

/// Goal: without a time constant the limited way itself is the reference.
#[test]
fn without_a_time_constant_limits_alone_shape_the_way() {
    let mut from = [Vector3::zeros(); MAGNETS_MAX];
    from[0] = Vector3::x();
    let mut reference = Reference::new(1, &Pacing { time_constant: 0.0, ..pacing() });
    reference.reset(&from, &[0.0; POSE_PARAMETERS_MAX]);
    let mut goal = target(&from, None);
    goal.directions[0] = [0.6, 0.8, 0.0];
    for _ in 0..100 {
        let before = reference.velocity(0);
        reference.advance(&goal, PERIOD);
        assert!((reference.velocity(0).norm() - before.norm()).abs() <= TURN.acceleration * PERIOD * 1.001);
    }
    // A tenth of a second at 30 rad/s^2, still short of the speed limit.
    assert!((reference.velocity(0).norm() - 3.0).abs() < 0.01);
}
