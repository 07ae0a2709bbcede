//! Whom the guard obeys: every state, every sender, every order.

use super::{Bench, HOLDER, Sender, VALIDITY};
use crate::guard::{Refusal, RefusalCounts};
use crate::message::{CoilCommand, CoilFeedback, driver_state, order};

const ORDERS: [u32; 5] = [order::CLAIM, order::DRIVE, order::RAMP_DOWN, order::RELEASE, order::DISABLE];
const SENDERS: [(&str, Sender); 4] = [
    ("holder", HOLDER),
    ("other token", Sender { epoch: 5, token: 8 }),
    ("former epoch", Sender { epoch: 4, token: 7 }),
    ("later epoch", Sender { epoch: 6, token: 9 }),
];

type Reach = fn() -> Bench;

/// Ways to reach each state.
const STATES: [(&str, Reach); 7] = [
    ("never held", Bench::new),
    ("released", || {
        let mut bench = Bench::new();
        bench.send(HOLDER, order::CLAIM, [0.0; 3]).expect("free");
        bench.send(HOLDER, order::RELEASE, [0.0; 3]).expect("held");
        assert_eq!(bench.guard.state(), driver_state::IDLE);
        bench
    }),
    ("driven", driven),
    ("ramping down", || {
        let mut bench = driven();
        bench.send(HOLDER, order::RELEASE, [0.0; 3]).expect("held");
        bench.step();
        assert_eq!(bench.guard.state(), driver_state::RAMPING_DOWN);
        bench
    }),
    ("disabled", || {
        let mut bench = driven();
        bench.send(HOLDER, order::DISABLE, [0.0; 3]).expect("held");
        assert_eq!(bench.guard.state(), driver_state::DISABLED);
        bench
    }),
    ("tripped", || {
        let mut bench = driven();
        bench.guard.trip();
        bench
    }),
    ("lapsed, not yet noticed", || {
        let mut bench = driven();
        bench.now = bench.now.after(VALIDITY);
        bench
    }),
];

fn driven() -> Bench {
    let mut bench = Bench::new();
    bench.drive_to(1.0);
    bench
}

/// One row for each state and sender. A cell tells what becomes of CLAIM, DRIVE, RAMP_DOWN, RELEASE and DISABLE:
/// the state after it when obeyed (I idle, D driven, R ramping down, X disabled), else why not (a no authority,
/// h held by another, z not at zero, e epoch does not rise).
const TABLE: [[&str; 4]; 7] = [
    // holder, other token, former epoch, later epoch
    ["DaaaX", "DaaaX", "DaaaX", "DaaaX"], // never held
    ["eaaIX", "eaaae", "eaaae", "DaaaX"], // released
    ["DDDRX", "hhhhh", "hhhhh", "hhhhh"], // driven
    ["zaaRX", "zaaae", "zaaae", "zaaaX"], // ramping down
    ["eaaXX", "eaaae", "eaaae", "DaaaX"], // disabled
    ["eaaXX", "eaaae", "eaaae", "DaaaX"], // tripped
    // The holder's valid command is judged before the lapse of its former one.
    ["DDDRX", "zaahe", "zaahe", "zaahX"], // lapsed, not yet noticed
];

fn letter(outcome: Result<(), Refusal>, state: u32) -> char {
    match outcome {
        Ok(()) => match state {
            driver_state::IDLE => 'I',
            driver_state::DRIVEN => 'D',
            driver_state::RAMPING_DOWN => 'R',
            _ => 'X',
        },
        Err(Refusal::NoAuthority) => 'a',
        Err(Refusal::Held { .. }) => 'h',
        Err(Refusal::NotAtZero) => 'z',
        Err(Refusal::Epoch { .. }) => 'e',
        Err(_) => '?',
    }
}

#[test]
fn every_order_of_every_sender_in_every_state_ends_as_tabled() {
    for ((state, reach), rows) in STATES.iter().zip(TABLE) {
        for ((sender_name, sender), row) in SENDERS.iter().zip(rows) {
            for (order, expected) in ORDERS.iter().zip(row.chars()) {
                let mut bench = reach();
                let refused_before = bench.guard.refusals().total();
                let breaks_before = bench.guard.limit_breaks();
                // A driving command asks for what flows, so that it breaks no limit.
                let current = if matches!(*order, order::DRIVE | order::RAMP_DOWN) { 1.0 } else { 0.0 };
                let outcome = bench.send(*sender, *order, [current, 0.0, 0.0]);
                let found = letter(outcome, bench.guard.state());
                let case = format!("{state}, {sender_name}, order {order}: {outcome:?}");
                assert_eq!(found, expected, "{case}");
                assert_eq!(
                    bench.guard.refusals().total() - refused_before,
                    u64::from(outcome.is_err()),
                    "{case}"
                );
                if *order != order::CLAIM {
                    assert_eq!(bench.guard.limit_breaks(), breaks_before, "{case}");
                }
                assert_echo(&bench, *sender, outcome.is_ok(), &case);
            }
        }
    }
}

fn assert_echo(bench: &Bench, sender: Sender, accepted: bool, case: &str) {
    let mut feedback = CoilFeedback::default();
    bench.guard.report(&mut feedback);
    let echoed = (feedback.accepted_epoch, feedback.accepted_sequence) == (sender.epoch, bench.sequence);
    assert_eq!(echoed, accepted, "{case}: echo");
}

/// Proves SR-04.
#[test]
fn every_fault_of_a_command_is_refused_counted_by_its_reason_and_changes_nothing() {
    type Spoil = fn(&mut CoilCommand);
    let cases: [(Spoil, Refusal); 14] = [
        (|command| command.header.schema = 9, Refusal::Schema { actual: 9 }),
        (|command| command.coil_count = 2, Refusal::Count { what: "coils", expected: 3, actual: 2 }),
        (|command| command.coil_count = 33, Refusal::Count { what: "coils", expected: 3, actual: 33 }),
        (
            |command| command.pose_parameter_count = 0,
            Refusal::Count { what: "frames", expected: 2, actual: 0 },
        ),
        (|command| command.order = 5, Refusal::Order { actual: 5 }),
        (|command| command.order = u32::MAX, Refusal::Order { actual: u32::MAX }),
        (
            |command| command.actuation.current_a[2] = f64::NAN,
            Refusal::NotFinite { what: "current", index: 2 },
        ),
        (
            |command| command.actuation.current_a[0] = f64::INFINITY,
            Refusal::NotFinite { what: "current", index: 0 },
        ),
        (|command| command.actuation.angle_rad[1] = f64::NAN, Refusal::NotFinite { what: "angle", index: 1 }),
        (
            |command| command.header.publish_stamp_ns += 1_000_001,
            Refusal::FutureStamp { ahead_ns: 1_000_001 },
        ),
        (|command| command.header.valid_until_ns -= 100_000_000, Refusal::Expired { late_ns: 0 }),
        (|command| command.header.valid_until_ns = 0, Refusal::Expired { late_ns: 0 }),
        (|command| command.header.sequence -= 1, Refusal::Sequence { last: 0, actual: 0 }),
        (|command| command.header.sequence = 0, Refusal::Sequence { last: 0, actual: 0 }),
    ];
    for (spoil, expected) in cases {
        let mut bench = driven();
        let mut command = bench.command(HOLDER, order::DRIVE, [1.0, 0.0, 0.0]);
        spoil(&mut command);
        let before = bench.guard.clone();
        let refusal = bench.guard.offer(&command, bench.now).expect_err("faulty");
        assert_eq!(std::mem::discriminant(&refusal), std::mem::discriminant(&expected), "{refusal}");
        if !matches!(expected, Refusal::Sequence { .. } | Refusal::Expired { .. }) {
            assert_eq!(refusal, expected);
        }
        assert_eq!((bench.guard.refusals().of(&expected), bench.guard.refusals().total()), (1, 1));
        let (mut then, mut now) = (before, bench.guard);
        assert_eq!(now.setpoint(bench.now, 0.01), then.setpoint(bench.now, 0.01), "{refusal}");
    }
}

/// Proves SR-09.
#[test]
fn claim_with_any_current_is_refused_by_coil() {
    let mut bench = Bench::new();
    let refused = bench.send(HOLDER, order::CLAIM, [0.0, 0.0, 1e-9]);
    assert_eq!(refused, Err(Refusal::ClaimNotZero { coil: 2 }));
    assert_eq!(bench.guard.state(), driver_state::IDLE);
    bench.send(HOLDER, order::CLAIM, [0.0; 3]).expect("the same epoch may claim properly");
}

#[test]
fn claim_refused_while_ramping_is_granted_once_at_zero() {
    let mut bench = driven();
    bench.step_for(100);
    assert_eq!(bench.guard.state(), driver_state::RAMPING_DOWN);
    let later = Sender { epoch: 6, token: 1 };
    assert_eq!(bench.send(later, order::CLAIM, [0.0; 3]), Err(Refusal::NotAtZero));
    bench.step_for(5);
    assert_eq!(bench.guard.state(), driver_state::IDLE);
    bench.send(later, order::CLAIM, [0.0; 3]).expect("at zero");
    assert_eq!(bench.guard.state(), driver_state::DRIVEN);
}

#[test]
fn disable_is_obeyed_however_late_it_comes() {
    let mut bench = driven();
    let mut command = bench.command(HOLDER, order::DISABLE, [0.0; 3]);
    command.header.valid_until_ns = 1;
    bench.guard.offer(&command, bench.now).expect("obeyed");
    assert_eq!(bench.guard.state(), driver_state::DISABLED);
}

#[test]
fn report_states_counts_and_fingerprint() {
    let mut bench = driven();
    let _ = bench.send(Sender { epoch: 9, token: 9 }, order::DRIVE, [0.0; 3]);
    bench.send(HOLDER, order::DRIVE, [9.0, 0.0, 0.0]).expect("clamped, counted, obeyed");
    let mut feedback = CoilFeedback { fault: 3, ..CoilFeedback::default() };
    bench.guard.report(&mut feedback);
    assert_eq!((feedback.commands_refused, feedback.limit_breaks), (1, 1));
    assert_eq!((feedback.coil_count, feedback.pose_parameter_count), (3, 2));
    assert_eq!(feedback.description_fingerprint, crate::scripted::example_description().fingerprint());
    assert_eq!(feedback.fault, 3, "the driver's own");
    let mut counts = RefusalCounts::default();
    counts.add(&Refusal::Held { holder: 1 });
    assert_eq!(*bench.guard.refusals(), counts);
}

#[test]
fn receipt_names_the_newest_poses_answered_and_when_their_first_command_came() {
    let mut bench = driven();
    let exposed = bench.now.nanoseconds() + 1;
    let first = offer_computed_from(&mut bench, HOLDER, exposed);
    assert_eq!(first.receipt, (exposed, first.now));
    // No poses, the same, older ones, ones of the future, ones in a command that is refused: nothing is
    // answered anew.
    let stranger = Sender { epoch: 9, token: 9 };
    let others =
        [(HOLDER, 0), (HOLDER, exposed), (HOLDER, exposed - 1), (HOLDER, u64::MAX), (stranger, exposed + 1)];
    for (sender, stamp) in others {
        let offered = offer_computed_from(&mut bench, sender, stamp);
        assert_eq!(offered.receipt, first.receipt, "{stamp} of {sender:?}");
    }
    let next = offer_computed_from(&mut bench, HOLDER, exposed + 1);
    assert_eq!(next.receipt, (exposed + 1, next.now));
}

struct Offered {
    now: u64,
    receipt: (u64, u64),
}

/// A command computed from poses exposed at `source_stamp_ns`, two milliseconds after the former.
fn offer_computed_from(bench: &mut Bench, sender: Sender, source_stamp_ns: u64) -> Offered {
    bench.step_for(2);
    let mut command = bench.command(sender, order::DRIVE, [0.0; 3]);
    command.header.source_stamp_ns = source_stamp_ns;
    let refused = bench.guard.offer(&command, bench.now).is_err();
    assert_eq!(refused, sender.epoch != HOLDER.epoch);
    let mut feedback = CoilFeedback::default();
    bench.guard.report(&mut feedback);
    let receipt = (feedback.answered_pose_stamp_ns, feedback.answer_received_stamp_ns);
    Offered { now: bench.now.nanoseconds(), receipt }
}
