use std::time::Duration;

use super::{AdmittedCommand, Authority, Gate, Limited, Refused};
use crate::description::HardwareDescription;
use crate::message::{Actuation, order};
use crate::scripted::example_description;
use crate::seeded::Seeded;
use crate::time::Stamp;

const AUTHORITY: Authority = Authority { epoch: 3, token: 7, validity: Duration::from_millis(100) };
const PERIOD: f64 = 1e-3;
/// Rounding of one sum of the size of a current: a few units in the last place of 8.
const ROUNDING: f64 = 1e-14;

fn actuation(currents: [f64; 3], angles: [f64; 2]) -> Actuation {
    let mut actuation = Actuation::default();
    actuation.current_a[..3].copy_from_slice(&currents);
    actuation.angle_rad[..2].copy_from_slice(&angles);
    actuation
}

fn wild(random: &mut Seeded) -> f64 {
    match random.below(12) {
        0 => f64::NAN,
        1 => f64::INFINITY,
        2 => f64::NEG_INFINITY,
        3 => random.within(f64::MAX),
        4 => random.within(1e-300),
        5 => -0.0,
        6..8 => random.within(100.0),
        _ => random.within(8.0),
    }
}

/// A step from `before` to `after` that `Gate::drive` may take in `period`.
fn assert_within_limits(
    description: &HardwareDescription,
    before: &Actuation,
    after: &Actuation,
    period: f64,
) {
    for (index, coil) in description.coils.iter().enumerate() {
        let (from, to) = (before.current_a[index], after.current_a[index]);
        assert!(to.abs() <= coil.current_max, "coil {index} at {to} A");
        assert!((to - from).abs() <= coil.slew_max * period + ROUNDING, "coil {index} from {from} to {to} A");
    }
    for (index, frame) in description.frames.iter().enumerate() {
        let (from, to) = (before.angle_rad[index], after.angle_rad[index]);
        assert!((frame.angle_min..=frame.angle_max).contains(&to), "frame {index} at {to} rad");
        assert!(
            (to - from).abs() <= frame.speed_max * period + ROUNDING,
            "frame {index} from {from} to {to}"
        );
    }
    assert!(after.current_a[description.coils.len()..].iter().all(|current| *current == 0.0));
    assert!(after.angle_rad[description.frames.len()..].iter().all(|angle| *angle == 0.0));
}

/// Proves SR-06.
#[test]
fn no_request_sequence_whatever_gets_beyond_magnitude_range_slew_or_speed() {
    let description = example_description();
    let (mut admitted, mut refused) = (0, 0);
    for seed in 0..40 {
        let mut random = Seeded::new(seed);
        let mut gate = Gate::new(&description);
        for _ in 0..500 {
            let mut request = Actuation::default();
            let wildness = random.below(4);
            for value in request.current_a.iter_mut().chain(&mut request.angle_rad) {
                *value = if wildness == 0 { wild(&mut random) } else { random.within(12.0) };
            }
            let period = if random.below(20) == 0 { wild(&mut random) } else { random.unit() * 2e-3 };
            let before = *gate.previous();
            match gate.drive(&request, period, AUTHORITY, Stamp::default()) {
                Ok(outcome) => {
                    admitted += 1;
                    assert_within_limits(&description, &before, outcome.command.actuation(), period);
                    assert_eq!(outcome.command.actuation(), gate.previous());
                }
                Err(_) => {
                    refused += 1;
                    assert_eq!(*gate.previous(), before, "a refusal changes nothing");
                }
            }
        }
    }
    assert!(admitted > 10_000 && refused > 500, "{admitted} admitted, {refused} refused");
}

#[test]
fn request_within_all_limits_passes_unchanged_and_is_not_called_limited() {
    let mut gate = Gate::new(&example_description());
    gate.seed(&actuation([2.0, -2.0, 1.0], [0.1, -0.1]));
    let request = actuation([2.1, -2.1, 1.05], [0.1005, -0.1005]);
    let outcome = gate.drive(&request, PERIOD, AUTHORITY, Stamp::from_nanoseconds(77)).expect("admitted");
    assert_eq!(*outcome.command.actuation(), request);
    assert_eq!(outcome.limited, Limited::default());
    assert!(!outcome.limited.any());
    assert_eq!(outcome.command.order(), order::DRIVE);
    assert_eq!(outcome.command.authority(), AUTHORITY);
    assert_eq!(outcome.command.pose_source_stamp(), Stamp::from_nanoseconds(77));
}

#[test]
fn each_kind_of_limiting_is_counted_by_itself() {
    let mut gate = Gate::new(&example_description());
    gate.seed(&actuation([8.0, 0.0, 0.0], [180.0_f64.to_radians(), 0.0]));
    let request = actuation([9.0, 5.0, -5.0], [4.0, 1.0]);
    let limited = gate.drive(&request, PERIOD, AUTHORITY, Stamp::default()).expect("admitted").limited;
    assert_eq!(limited, Limited { magnitude: 2, slew: 2, range: 1, speed: 1 });
    assert!(limited.any());
}

#[test]
fn refusal_names_coil_frame_or_period_and_its_value() {
    let mut gate = Gate::new(&example_description());
    let mut refusal = |request: Actuation, period| {
        gate.drive(&request, period, AUTHORITY, Stamp::default()).expect_err("refused").to_string()
    };
    let cases = [
        (actuation([0.0, f64::NAN, 0.0], [0.0; 2]), PERIOD, "requested current of coil 1 is NaN A"),
        (actuation([0.0, 0.0, f64::INFINITY], [0.0; 2]), PERIOD, "requested current of coil 2 is inf A"),
        (actuation([0.0; 3], [0.0, f64::NAN]), PERIOD, "requested angle of frame 1 is NaN rad"),
        (actuation([0.0; 3], [f64::NEG_INFINITY, 0.0]), PERIOD, "requested angle of frame 0 is -inf rad"),
        (Actuation::default(), f64::NAN, "period is NaN s"),
        (Actuation::default(), f64::INFINITY, "period is inf s"),
        (Actuation::default(), -1e-3, "period is -0.001 s"),
    ];
    for (request, period, expected) in cases {
        let text = refusal(request, period);
        assert!(text.starts_with(expected), "{text}: expected {expected}");
    }
}

#[test]
fn entries_that_the_rig_does_not_have_are_neither_judged_nor_passed() {
    let mut gate = Gate::new(&example_description());
    let mut request = Actuation { current_a: [f64::NAN; 32], angle_rad: [f64::NAN; 8] };
    request.current_a[..3].fill(0.0);
    request.angle_rad[..2].fill(0.0);
    let outcome = gate.drive(&request, PERIOD, AUTHORITY, Stamp::default()).expect("admitted");
    assert_eq!(*outcome.command.actuation(), Actuation::default());
}

#[test]
fn seed_is_held_within_limits_and_survives_what_is_no_number() {
    let mut gate = Gate::new(&example_description());
    gate.seed(&actuation([1.0, 0.0, 0.0], [0.5, 0.25]));
    gate.seed(&actuation([f64::NAN, f64::INFINITY, -9.0], [f64::NAN, -9.0]));
    assert_eq!(*gate.previous(), actuation([0.0, 8.0, -4.0], [0.5, (-180.0_f64).to_radians()]));
}

#[test]
fn ramp_reaches_exact_zero_in_the_time_that_slew_allows_and_frames_hold() {
    let description = example_description();
    let mut gate = Gate::new(&description);
    gate.seed(&actuation([8.0, -3.3, 4.0], [0.3, -0.2]));
    let mut steps = 0;
    while !gate.is_at_zero() {
        let before = *gate.previous();
        let command = gate.ramp_to_zero(PERIOD, AUTHORITY);
        assert_eq!(command.order(), order::RAMP_DOWN);
        assert_within_limits(&description, &before, command.actuation(), PERIOD);
        assert_eq!(command.actuation().angle_rad, before.angle_rad);
        steps += 1;
        assert!(steps <= 41, "8 A at 200 A/s take 40 steps of 1 ms, and one for rounding");
    }
    assert!(steps >= 40);
}

#[test]
fn ramp_with_an_unusable_period_moves_nothing() {
    let mut gate = Gate::new(&example_description());
    let standing = actuation([1.0, 2.0, 3.0], [0.1, 0.2]);
    for period in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        gate.seed(&standing);
        assert_eq!(*gate.ramp_to_zero(period, AUTHORITY).actuation(), standing, "{period}");
    }
}

type Maker = fn(&mut Gate, Authority) -> AdmittedCommand;

#[test]
fn claim_release_and_disable_carry_zero_currents_and_held_frames() {
    let standing = actuation([1.0, 2.0, 3.0], [0.1, 0.2]);
    let makers: [(u32, Maker); 3] =
        [(order::CLAIM, Gate::claim), (order::RELEASE, Gate::release), (order::DISABLE, Gate::disable)];
    for (order, make) in makers {
        let mut gate = Gate::new(&example_description());
        gate.seed(&standing);
        let command = make(&mut gate, AUTHORITY);
        assert_eq!(command.order(), order);
        assert_eq!(*command.actuation(), actuation([0.0; 3], [0.1, 0.2]));
        assert!(gate.is_at_zero());
    }
}

#[test]
fn limits_that_are_no_positive_numbers_let_nothing_flow() {
    let mut description = example_description();
    description.coils[0].current_max = f64::NAN;
    description.coils[1].slew_max = f64::NAN;
    description.coils[2].current_max = -1.0;
    description.frames[0].angle_max = f64::NAN;
    description.frames[1].speed_max = f64::INFINITY;
    let mut gate = Gate::new(&description);
    let request = actuation([5.0, 5.0, 5.0], [1.0, 1.0]);
    let outcome = gate.drive(&request, PERIOD, AUTHORITY, Stamp::default()).expect("admitted");
    assert_eq!(*outcome.command.actuation(), Actuation::default());
}

#[test]
fn refused_carries_the_value_as_it_was() {
    let mut gate = Gate::new(&example_description());
    let request = actuation([f64::INFINITY, 0.0, 0.0], [0.0; 2]);
    let refused = gate.drive(&request, PERIOD, AUTHORITY, Stamp::default());
    assert_eq!(refused, Err(Refused::Current { coil: 0, value_a: f64::INFINITY }));
}
