//! What the amplifiers and motors are told: bounded steps, ramps that end, and nothing without authority.

use std::time::Duration;

use super::{Bench, HOLDER, PERIOD, Sender, VALIDITY, currents};
use crate::guard::{CommandGuard, Setpoint, VALIDITY_MAX};
use crate::message::{POSE_PARAMETERS_MAX, driver_state, order};
use crate::scripted::example_description;
use crate::seeded::Seeded;
use crate::time::Stamp;

#[test]
fn guard_without_commands_stays_idle_at_zero_and_holds_its_frames() {
    let mut angles = [0.0; POSE_PARAMETERS_MAX];
    angles[..2].copy_from_slice(&[0.5, -9.0]);
    let mut guard = CommandGuard::new(&example_description(), &angles);
    let Setpoint::Idle(actuation) = guard.setpoint(Stamp::from_nanoseconds(7), PERIOD) else {
        panic!("idle")
    };
    assert_eq!(actuation.current_a, [0.0; 32]);
    assert_eq!(actuation.angle_rad[..2], [0.5, (-180.0_f64).to_radians()]);
}

/// Proves SR-01.
#[test]
fn ramp_after_validity_ran_out_starts_on_time_keeps_slew_holds_frames_and_ends_at_exact_zero() {
    let mut bench = Bench::new();
    bench.drive_to(0.9);
    let mut turned = bench.command(HOLDER, order::DRIVE, [0.9, 0.0, 0.0]);
    turned.actuation.angle_rad[0] = 0.01;
    bench.guard.offer(&turned, bench.now).expect("valid");
    let last_step = bench.step_for(99);
    assert_eq!(last_step.actuation().current_a, currents([0.9, 0.0, 0.0]).current_a);
    assert!(matches!(last_step, Setpoint::Drive(_)), "valid for 100 ms, one of which is left");
    // 0.9 A at 0.2 A a step.
    let mut left = 0.9_f64;
    for _ in 0..5 {
        let setpoint = bench.step();
        let current = setpoint.actuation().current_a[0];
        assert!((left - current - left.min(0.2)).abs() < 1e-12, "from {left} to {current}");
        assert!((setpoint.actuation().angle_rad[0] - 0.01).abs() < 1e-15, "frames hold");
        assert_eq!(matches!(setpoint, Setpoint::Idle(_)), current == 0.0);
        left = current;
    }
    assert_eq!(left, 0.0);
    assert_eq!(bench.guard.state(), driver_state::IDLE);
}

/// Proves SR-04.
#[test]
fn validity_is_never_granted_beyond_its_maximum() {
    let mut bench = Bench::new();
    bench.drive_to(1.0);
    let mut command = bench.command(HOLDER, order::DRIVE, [1.0, 0.0, 0.0]);
    command.header.valid_until_ns = u64::MAX;
    bench.guard.offer(&command, bench.now).expect("valid");
    bench.now = bench.now.after(VALIDITY_MAX - Duration::from_nanos(1));
    assert!(matches!(bench.guard.setpoint(bench.now, 0.0), Setpoint::Drive(_)));
    bench.now = bench.now.after(Duration::from_nanos(1));
    assert!(matches!(bench.guard.setpoint(bench.now, 0.0), Setpoint::RampDown(_)));
}

#[test]
fn ramp_down_order_ramps_keeps_authority_and_driving_goes_on_without_a_jump() {
    let mut bench = Bench::new();
    bench.drive_to(1.0);
    bench.send(HOLDER, order::RAMP_DOWN, [1.0, 0.0, 0.0]).expect("held");
    let Setpoint::RampDown(actuation) = bench.step() else { panic!("ramping") };
    assert!((actuation.current_a[0] - 0.8).abs() < 1e-12);
    let Setpoint::RampDown(actuation) = bench.step_for(30) else { panic!("ramping") };
    assert_eq!(actuation.current_a[0], 0.0);
    assert_eq!(bench.guard.state(), driver_state::DRIVEN);
    bench.send(HOLDER, order::DRIVE, [1.0, 0.0, 0.0]).expect("held");
    let Setpoint::Drive(actuation) = bench.step() else { panic!("driven") };
    assert!(actuation.current_a[0] <= 0.2 + 1e-12, "slew, whatever was commanded");
}

/// Proves SR-14.
#[test]
fn disable_cuts_at_once_and_latches_until_a_new_claim() {
    let mut bench = Bench::new();
    bench.drive_to(1.0);
    bench.send(HOLDER, order::DISABLE, [0.0; 3]).expect("held");
    assert_eq!(bench.guard.setpoint(bench.now, 0.0), Setpoint::Disable(currents([0.0; 3])));
    bench.step_for(1000);
    assert_eq!(bench.guard.state(), driver_state::DISABLED);
    let later = Sender { epoch: 6, token: 1 };
    bench.send(later, order::CLAIM, [0.0; 3]).expect("granted");
    assert!(matches!(bench.step(), Setpoint::Drive(actuation) if actuation == currents([0.0; 3])));
}

#[test]
fn release_at_zero_frees_the_latch_at_once() {
    let mut bench = Bench::new();
    bench.send(HOLDER, order::CLAIM, [0.0; 3]).expect("free");
    bench.send(HOLDER, order::RELEASE, [0.0; 3]).expect("held");
    assert_eq!(bench.guard.state(), driver_state::IDLE);
    bench.send(Sender { epoch: 6, token: 1 }, order::CLAIM, [0.0; 3]).expect("free again");
}

#[test]
fn claim_moves_no_frame() {
    let mut bench = Bench::new();
    let mut claim = bench.command(HOLDER, order::CLAIM, [0.0; 3]);
    claim.actuation.angle_rad[0] = 1.0;
    bench.guard.offer(&claim, bench.now).expect("free");
    assert_eq!(bench.step_for(50).actuation().angle_rad[0], 0.0);
}

#[test]
fn driver_that_was_stopped_goes_on_when_a_valid_command_awaits_it() {
    let mut bench = Bench::new();
    bench.drive_to(1.0);
    bench.now = bench.now.after(VALIDITY * 3);
    bench.send(HOLDER, order::DRIVE, [1.0, 0.0, 0.0]).expect("valid now");
    assert!(matches!(bench.step(), Setpoint::Drive(_)));
    bench.now = bench.now.after(VALIDITY * 3);
    bench.guard.setpoint(bench.now, PERIOD);
    bench.send(HOLDER, order::DRIVE, [1.0, 0.0, 0.0]).expect_err("the lapse was noticed");
}

#[test]
fn unusable_periods_move_nothing() {
    let mut bench = Bench::new();
    bench.drive_to(1.0);
    bench.send(HOLDER, order::RAMP_DOWN, [1.0, 0.0, 0.0]).expect("held");
    for period in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        assert_eq!(bench.guard.setpoint(bench.now, period).actuation().current_a[0], 1.0, "{period}");
    }
}

/// Proves SR-07.
#[test]
fn no_command_sequence_whatever_moves_a_setpoint_faster_than_its_limit() {
    let description = example_description();
    let mut drives = 0;
    for seed in 0..60 {
        let mut random = Seeded::new(seed);
        let mut bench = Bench::new();
        let mut epoch = 5;
        for _ in 0..400 {
            // Mostly the holder; now and then a follower, which may claim when it is free.
            let sender = Sender { epoch: epoch + random.below(4) / 3, token: 7 };
            let orders =
                [order::CLAIM, order::DRIVE, order::DRIVE, order::DRIVE, order::RAMP_DOWN, order::RELEASE];
            let order = orders[random.below(6) as usize];
            let scale = if order == order::CLAIM { 0.0 } else { 20.0 };
            let mut command = bench.command(sender, order, [(); 3].map(|()| random.within(scale)));
            command.actuation.angle_rad[0] = random.within(10.0);
            if bench.guard.offer(&command, bench.now).is_ok() {
                epoch = sender.epoch;
            }
            let pause = if random.below(10) == 0 { 130 } else { 1 };
            let setpoint = bench.step_for(pause);
            drives += u32::from(matches!(setpoint, Setpoint::Drive(_)));
            let after = *setpoint.actuation();
            for (index, coil) in description.coils.iter().enumerate() {
                assert!(after.current_a[index].abs() <= coil.current_max);
            }
            let again = *bench.step().actuation();
            for (index, coil) in description.coils.iter().enumerate() {
                let change = (again.current_a[index] - after.current_a[index]).abs();
                assert!(change <= coil.slew_max * PERIOD + 1e-12, "coil {index} changed by {change} A");
            }
            let turned = (again.angle_rad[0] - after.angle_rad[0]).abs();
            assert!(
                turned <= description.frames[0].speed_max * PERIOD + 1e-12,
                "frame turned by {turned} rad"
            );
            assert!(again.current_a[3..].iter().all(|current| *current == 0.0));
        }
    }
    assert!(drives > 1000, "{drives}");
}
