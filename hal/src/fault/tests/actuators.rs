//! Set points on their way to amplifiers and motors.

use super::bench::{at, fault, injector, ms};
use crate::fault::{Fault, FaultPlan, FaultTarget, FaultVerb, Garbage, Injector, Part, Reach, Scheduled};
use crate::guard::Setpoint;
use crate::limits::Limits;
use crate::message::{Actuation, COILS_MAX};
use crate::scripted::example_description;
use crate::seeded::Seeded;

/// A guard's set point that rises by 10 mA and 0.1 mrad each millisecond, from zero.
fn rising(millisecond: u64) -> Setpoint {
    let mut actuation = Actuation::default();
    actuation.current_a[..3].fill(0.01 * millisecond as f64);
    actuation.angle_rad[..2].fill(1e-4 * millisecond as f64);
    Setpoint::Drive(actuation)
}

/// What goes out at each millisecond.
fn through(injector: &mut Injector, milliseconds: u64) -> Vec<Actuation> {
    let pass = |now| *injector.setpoint(&rising(now), at(now), 1e-3).actuation();
    (0..=milliseconds).map(pass).collect()
}

fn actuators(verb: FaultVerb, part: Option<Part>) -> Fault {
    fault(FaultTarget::Actuators, verb, part)
}

#[test]
fn without_a_fault_set_points_pass_bit_for_bit() {
    let mut sound = injector(actuators(FaultVerb::Off, None), 5000, 1);
    for (now, actuation) in through(&mut sound, 100).iter().enumerate() {
        assert_eq!(actuation, rising(now as u64).actuation());
    }
    assert_eq!(sound.counts().setpoints_altered, 0);
}

#[test]
fn off_brings_currents_to_zero_within_slew_and_frames_to_a_stop() {
    let out = through(&mut injector(actuators(FaultVerb::Off, None), 100, 100), 300);
    // 1 A at 200 A/s is 5 ms, at 100 A/s 10 ms.
    assert!(out[103].current_a[0] > 0.0 && out[104].current_a[0] == 0.0, "{:?}", &out[99..106]);
    assert!(out[108].current_a[2] > 0.0 && out[109].current_a[2] == 0.0);
    assert!(out[110..200].iter().all(|out| out.current_a[..3] == [0.0; 3]));
    assert!(out[100..200].iter().all(|then| then.angle_rad[0] == out[99].angle_rad[0]));
    // Back within slew: 2 A at 200 A/s.
    assert!(out[209].current_a[0] < 2.0 && out[215].current_a[0] == rising(215).actuation().current_a[0]);
}

#[test]
fn stuck_stays_at_the_output_of_the_begin() {
    let out = through(&mut injector(actuators(FaultVerb::Stuck, None), 100, 100), 250);
    assert!(out[100..200].iter().all(|actuation| *actuation == out[99]));
    assert_eq!(out[99], *rising(99).actuation());
    assert_eq!(out[220], *rising(220).actuation(), "back");
}

#[test]
fn delayed_follows_set_points_of_then() {
    let out = through(&mut injector(actuators(FaultVerb::Delayed { by: ms(20) }, None), 100, 100), 250);
    assert!(out[100..120].iter().all(|actuation| *actuation == out[99]));
    for (now, actuation) in out.iter().enumerate().take(200).skip(121) {
        assert_eq!(actuation, rising(now as u64 - 20).actuation(), "{now} ms");
    }
}

#[test]
fn slow_follows_with_its_lag() {
    let rate_hz = 5.0;
    let out = through(&mut injector(actuators(FaultVerb::Slow { rate_hz }, None), 100, 400), 600);
    // A lag of first order trails a ramp by slope times time constant: 10 A/s / (2 pi 5 Hz).
    let trail = 10.0 / (std::f64::consts::TAU * rate_hz);
    let found = rising(450).actuation().current_a[0] - out[450].current_a[0];
    assert!((found / trail - 1.0).abs() < 0.02, "{found} A behind, expected {trail}");
}

#[test]
fn intermittent_alternates_between_off_and_following() {
    let verb = FaultVerb::Intermittent { period: ms(40), off_fraction: 0.5 };
    let out = through(&mut injector(actuators(verb, None), 100, 100), 300);
    for now in [115, 119, 155, 159, 195, 199] {
        assert_eq!(out[now].current_a[0], 0.0, "{now} ms");
    }
    for now in [139, 179] {
        assert_eq!(out[now].current_a[0], rising(now as u64).actuation().current_a[0], "{now} ms");
    }
}

#[test]
fn garbage_wanders_within_the_limits_and_comes_from_the_seed() {
    let faulty = || injector(actuators(FaultVerb::Garbage(Garbage::Random), None), 100, 2000);
    let out = through(&mut faulty(), 2000);
    let spread = |coil: usize| {
        let values = out[200..].iter().map(|actuation| actuation.current_a[coil]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| {
            (least.min(value), most.max(value))
        })
    };
    for (coil, limit) in [(0, 8.0), (1, 8.0), (2, 4.0)] {
        let (least, most) = spread(coil);
        assert!(least >= -limit && most <= limit, "coil {coil}: {least} to {most} A");
        assert!(most - least > limit, "coil {coil} wanders: {least} to {most} A");
    }
    assert_eq!(out, through(&mut faulty(), 2000));
}

#[test]
fn a_part_goes_wrong_alone() {
    let out = through(&mut injector(actuators(FaultVerb::Stuck, Some(Part::Coil(1))), 100, 100), 180);
    let sound = rising(150);
    let mut expected = *sound.actuation();
    expected.current_a[1] = out[99].current_a[1];
    assert_eq!(out[150], expected);
    let out = through(&mut injector(actuators(FaultVerb::Stuck, Some(Part::Frame(0))), 100, 100), 180);
    let mut expected = *sound.actuation();
    expected.angle_rad[0] = out[99].angle_rad[0];
    assert_eq!(out[150], expected);
}

/// Every verb that acts after the guard.
fn verbs() -> [FaultVerb; 6] {
    [
        FaultVerb::Off,
        FaultVerb::Stuck,
        FaultVerb::Garbage(Garbage::Random),
        FaultVerb::Slow { rate_hz: 0.1 },
        FaultVerb::Delayed { by: ms(1000) },
        FaultVerb::Intermittent { period: ms(30), off_fraction: 0.5 },
    ]
}

#[test]
fn a_cut_passes_at_once_and_nobody_commanding_means_zero_within_slew() {
    for verb in verbs() {
        let mut faulty = injector(actuators(verb, None), 100, 100_000);
        let last = through(&mut faulty, 150)[150];
        let mut other = faulty.clone();
        let standing = Actuation { angle_rad: last.angle_rad, ..Actuation::default() };
        let cut = Setpoint::Disable(standing);
        assert_eq!(faulty.setpoint(&cut, at(151), 1e-3), cut, "{verb}");
        assert_eq!(faulty.setpoint(&Setpoint::Idle(standing), at(152), 1e-3), Setpoint::Idle(standing));
        // At most 8 A at 100 A/s.
        let mut former = last;
        for now in 151..=240 {
            let out = *other.setpoint(&Setpoint::Idle(standing), at(now), 1e-3).actuation();
            let fell =
                out.current_a.iter().zip(&former.current_a).all(|(out, former)| out.abs() <= former.abs());
            assert!(fell, "{verb}: {former:?} to {out:?}");
            former = out;
        }
        assert_eq!(former.current_a, [0.0; COILS_MAX], "{verb}");
    }
}

/// Goal: whatever acts whenever, what goes out is finite and within every limit of the rig, on value and on
/// rate.
#[test]
fn no_fault_ever_exceeds_a_limit_of_the_rig() {
    let description = example_description();
    let limits = Limits::new(&description);
    let mut random = Seeded::new(5);
    for round in 0..20 {
        let mut scheduled = Vec::new();
        for _ in 0..6 {
            let verb = verbs()[random.below(6) as usize];
            let part = match random.below(3) {
                0 => None,
                1 => Some(Part::Coil(random.below(3) as usize)),
                _ => Some(Part::Frame(random.below(2) as usize)),
            };
            let (from, lasts) = (ms(random.below(500)), Some(ms(1 + random.below(400))));
            scheduled.push(Scheduled { fault: actuators(verb, part), from, lasts });
        }
        let mut faulty = Injector::new(&description, &FaultPlan::new(Reach::Channels, scheduled), round);
        let mut guard = Actuation::default();
        let mut former = guard;
        for now in 0..1000 {
            // A guard that keeps the limits, always on its way somewhere.
            let period = 1e-3;
            let sign = if now / 150 % 2 == 0 { 1.0 } else { -1.0 };
            for coil in 0..3 {
                let wanted = guard.current_a[coil] + sign * limits.slew_max[coil] * period;
                guard.current_a[coil] = wanted.clamp(-limits.current_max[coil], limits.current_max[coil]);
            }
            for frame in 0..2 {
                guard.angle_rad[frame] += sign * limits.speed_max[frame] * period;
            }
            let out = *faulty.setpoint(&Setpoint::Drive(guard), at(now), period).actuation();
            for coil in 0..3 {
                assert!(out.current_a[coil].abs() <= limits.current_max[coil]);
                let change = (out.current_a[coil] - former.current_a[coil]).abs();
                assert!(
                    change <= limits.slew_max[coil] * period * (1.0 + 1e-9),
                    "{change} A in round {round}"
                );
            }
            for frame in 0..2 {
                assert!(out.angle_rad[frame] >= limits.angle_min[frame] - 1e-12);
                assert!(out.angle_rad[frame] <= limits.angle_max[frame] + 1e-12);
                let change = (out.angle_rad[frame] - former.angle_rad[frame]).abs();
                assert!(change <= limits.speed_max[frame] * period * (1.0 + 1e-9));
            }
            former = out;
        }
        assert!(faulty.counts().setpoints_altered > 0);
    }
}
