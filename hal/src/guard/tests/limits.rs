//! When a command counts as a break of a limit: by its publish stamps, over every pair of commands.

use std::time::Duration;

use super::{Bench, HOLDER};
use crate::gate::{Authority, Gate};
use crate::guard::SLEW_JITTER;
use crate::message::{Actuation, order};
use crate::scripted::example_description;
use crate::seeded::Seeded;
use crate::send::CommandWriter;
use crate::time::Stamp;

/// A bench whose holder has claimed.
fn claimed() -> Bench {
    let mut bench = Bench::new();
    bench.send(HOLDER, order::CLAIM, [0.0; 3]).expect("free");
    bench
}

/// Proves SR-07.
#[test]
fn current_beyond_its_maximum_is_clamped_counted_and_obeyed() {
    let mut bench = Bench::new();
    bench.drive_to(8.0);
    bench.send(HOLDER, order::DRIVE, [8.0 + 1e-6, 0.0, 0.0]).expect("obeyed");
    assert_eq!(bench.guard.limit_breaks(), 1);
    assert_eq!(bench.step().actuation().current_a[0], 8.0);
}

#[test]
fn angle_beyond_its_range_is_clamped_and_counted() {
    let mut bench = claimed();
    let mut command = bench.command(HOLDER, order::DRIVE, [0.0; 3]);
    command.actuation.angle_rad[1] = 3.2;
    bench.guard.offer(&command, bench.now).expect("obeyed");
    assert_eq!(bench.guard.limit_breaks(), 1);
    assert!(bench.step_for(5000).actuation().angle_rad[1] <= 180.0_f64.to_radians());
}

#[test]
fn jump_counts_once_and_is_taken_within_slew() {
    let mut bench = claimed();
    bench.step();
    bench.send(HOLDER, order::DRIVE, [5.0, 0.0, 0.0]).expect("obeyed");
    assert_eq!(bench.guard.limit_breaks(), 1);
    assert!(bench.step().actuation().current_a[0] <= 0.2 + 1e-12);
}

#[test]
fn jitter_is_granted_once_and_not_with_every_command() {
    // Twice the slew limit: each step alone lies within one step's jitter.
    let mut bench = claimed();
    let mut commanded = 0.0;
    let mut accepted = 0;
    while bench.guard.limit_breaks() == 0 {
        bench.step();
        commanded += 0.4;
        bench.send(HOLDER, order::DRIVE, [commanded, 0.0, 0.0]).expect("obeyed");
        accepted += 1;
        assert!(accepted < 10, "a persistent break must be noticed");
    }
    // 0.2 A too much a command against 200 A/s times 2 ms of jitter.
    assert_eq!(accepted, 3);
}

#[test]
fn gate_that_is_given_the_time_between_writes_never_breaks_a_limit() {
    let description = example_description();
    for seed in 0..20 {
        let mut random = Seeded::new(seed);
        let mut bench = Bench::new();
        let mut gate = Gate::new(&description);
        let mut writer = CommandWriter::new(&description);
        let authority = Authority { epoch: 5, token: 7, validity: Duration::from_millis(100) };
        bench.guard.offer(&writer.message(&gate.claim(authority), bench.now), bench.now).expect("free");
        let mut before = bench.now;
        for _ in 0..2000 {
            let pause = Duration::from_nanos(random.below(5_000_000));
            bench.now = bench.now.after(pause);
            bench.guard.setpoint(bench.now, pause.as_secs_f64());
            let period = bench.now.since(before).as_secs_f64();
            before = bench.now;
            let mut request = Actuation::default();
            for value in request.current_a.iter_mut().chain(&mut request.angle_rad) {
                *value = random.within(20.0);
            }
            let admitted = gate.drive(&request, period, authority, Stamp::default()).expect("finite");
            // Some get lost on the way.
            let message = writer.message(&admitted.command, bench.now);
            if random.below(4) > 0 {
                bench.guard.offer(&message, bench.now).expect("valid");
            }
        }
        assert_eq!(bench.guard.limit_breaks(), 0, "seed {seed}");
        assert_eq!(bench.guard.refusals().total(), 0, "seed {seed}");
    }
}

#[test]
fn gate_with_a_nominal_period_and_stamps_that_jitter_within_tolerance_breaks_no_limit() {
    let description = example_description();
    let mut random = Seeded::new(1);
    let mut bench = Bench::new();
    let mut gate = Gate::new(&description);
    let mut writer = CommandWriter::new(&description);
    let authority = Authority { epoch: 5, token: 7, validity: Duration::from_millis(100) };
    bench.guard.offer(&writer.message(&gate.claim(authority), bench.now), bench.now).expect("free");
    let start = bench.now;
    let jitter = u64::try_from(SLEW_JITTER.as_nanos()).expect("small");
    for cycle in 1..3000_u32 {
        let tick = start.after(Duration::from_millis(1) * cycle);
        // Lateness below the jitter; a late one is overtaken by none.
        bench.now = bench.now.max(tick.after(Duration::from_nanos(random.below(jitter))));
        let direction = if (cycle / 200) % 2 == 0 { 8.0 } else { -8.0 };
        let mut request = Actuation::default();
        request.current_a[..3].fill(direction);
        let admitted = gate.drive(&request, 1e-3, authority, Stamp::default()).expect("finite");
        bench.guard.offer(&writer.message(&admitted.command, bench.now), bench.now).expect("valid");
    }
    assert_eq!(bench.guard.limit_breaks(), 0);
}
