//! Tests of the loop in lockstep: a scripted controller, an ideal rig whose driver is the real command
//! guard, stepped time.

use std::time::Duration;

use magsteer_hal::conformance::Stepped;
use magsteer_hal::message::{driver_state, order};
use magsteer_hal::operator::{Cause, state};
use magsteer_hal::scripted::{EchoHardware, example_description};
use magsteer_hal::send::HeaderWriter;
use magsteer_hal::{Actuation, AdmittedCommand, CoilFeedback, Hardware, Sensed, Stamp, WriteError};
use rand::{RngExt, SeedableRng};

use super::clock::Tick;
use super::config::tests::shipped;
use super::control_loop::{ControlLoop, LoopOptions};
use super::cycle_record::CycleRecord;
use super::state::{Request, Verb};
use crate::control::plan::Obstacle;
use crate::control::{CycleInput, CycleOutcome, Directions, ReferenceTarget, Step, Verdict};

const PERIOD: Duration = Duration::from_millis(1);
const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// A controller that asks for what the test says.
#[derive(Debug, Clone)]
struct Scripted {
    request: Actuation,
    converged: bool,
    desired: Directions,
    verdict: Verdict,
    in_force: Directions,
    margin: f64,
    field_valid: bool,
    seen: Option<CycleInput>,
}

impl Step for Scripted {
    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        self.seen = Some(*input);
        let request = if input.engaged { self.request } else { input.admitted };
        let mut outcome = CycleOutcome { desired: self.desired, ..CycleOutcome::asking_for(request) };
        outcome.model.converged = self.converged;
        (outcome.verdict, outcome.in_force) = (self.verdict, self.in_force.into());
        (outcome.model.margin, outcome.model.field_valid) = (self.margin, self.field_valid);
        outcome
    }
}

/// An ideal rig at the end of a line.
struct Line {
    rig: EchoHardware,
    /// True: no command gets through, and the transport says so.
    is_cut: bool,
}

impl Hardware for Line {
    fn read(&mut self, now: Stamp) -> Sensed {
        self.rig.read(now)
    }

    fn write(&mut self, command: &AdmittedCommand, now: Stamp) -> Result<(), WriteError> {
        if self.is_cut { Err(WriteError::Transport) } else { self.rig.write(command, now) }
    }
}

/// A loop under stepped time.
struct Bench {
    control_loop: ControlLoop<Line, Scripted>,
    tick: Tick,
    next_id: u32,
}

impl Bench {
    fn new() -> Self {
        let description = &example_description();
        let mut request = Actuation::default();
        request.current_a[..3].copy_from_slice(&[3.0, -5.0, 1.0]);
        let controller = Scripted {
            request,
            converged: true,
            desired: [UP; 8],
            seen: None,
            verdict: Verdict::Unchecked,
            in_force: [UP; 8],
            margin: 1.0,
            field_valid: true,
        };
        let hardware = Line { rig: EchoHardware::new(description), is_cut: false };
        let options = LoopOptions { realtime_missing: false, token_seed: 3 };
        let control_loop = ControlLoop::new(hardware, controller, description, &shipped(), options);
        let tick = Tick::first(Stamp::from_nanoseconds(5_000_000_000));
        let mut bench = Self { control_loop, tick, next_id: 1 };
        bench.cycles(3);
        bench
    }

    fn cycle(&mut self) -> CycleRecord {
        self.tick = self.tick.stepped(PERIOD);
        self.control_loop.cycle(self.tick)
    }

    fn cycles(&mut self, count: usize) -> Vec<CycleRecord> {
        (0..count).map(|_| self.cycle()).collect()
    }

    /// The loop runs again after a pause in which nothing of it ran.
    fn after_stall(&mut self, pause: Duration) -> CycleRecord {
        let missed = (pause.as_millis() / PERIOD.as_millis()) as u64 - 1;
        let now = self.tick.now.after(pause);
        let number = self.tick.number + missed + 1;
        self.tick = Tick { number, deadline: now, now, lateness: pause - PERIOD, missed };
        self.control_loop.cycle(self.tick)
    }

    fn ask(&mut self, verb: Verb) -> Result<Vec<CycleRecord>, Cause> {
        let id = self.next_id;
        self.next_id += 1;
        self.control_loop.request(Request { id, verb }).expect("one request a cycle");
        let mut records = Vec::new();
        for _ in 0..200 {
            let record = self.cycle();
            records.push(record);
            if let Some(answer) = record.decision.answers.into_iter().flatten().find(|it| it.id == id) {
                return answer.refused.map_or(Ok(records), Err);
            }
        }
        panic!("{verb:?} was never answered");
    }

    fn active() -> Self {
        let mut bench = Self::new();
        bench.ask(Verb::Arm).expect("the bench is healthy");
        bench.ask(Verb::Go).expect("the bench is healthy");
        bench
    }

    fn hardware(&mut self) -> &mut EchoHardware {
        &mut self.control_loop.hardware_mut().rig
    }

    fn cut_line(&mut self, is_cut: bool) {
        self.control_loop.hardware_mut().is_cut = is_cut;
    }

    fn controller(&mut self) -> &mut Scripted {
        self.control_loop.controller_mut()
    }
}

fn largest(actuation: &Actuation) -> f64 {
    actuation.current_a.iter().fold(0.0, |largest: f64, current| largest.max(current.abs()))
}

fn orders(records: &[CycleRecord]) -> Vec<u32> {
    let mut orders: Vec<u32> = records.iter().filter_map(|record| record.order).collect();
    orders.dedup();
    orders
}

#[test]
fn a_whole_run_sends_claim_drive_ramp_release_and_breaks_no_limit() {
    let mut bench = Bench::new();
    let mut records = bench.ask(Verb::Arm).expect("the bench is healthy");
    records.extend(bench.ask(Verb::Go).expect("the bench is healthy"));
    records.extend(bench.cycles(200));
    assert!((records.last().expect("cycles ran").admitted.current_a[1] + 5.0).abs() < 1e-12);
    records.extend(bench.ask(Verb::Stop).expect("the bench is healthy"));
    records.extend(bench.cycles(200));
    let sent = orders(&records);
    assert_eq!(sent, [order::CLAIM, order::DRIVE, order::RAMP_DOWN, order::RELEASE]);
    let guard = bench.hardware().guard();
    assert_eq!((guard.limit_breaks(), guard.refusals().total()), (0, 0));
    assert_eq!(guard.state(), driver_state::IDLE);
    let last = records.last().expect("cycles ran");
    assert_eq!((last.decision.state, last.order), (state::IDLE, None));
}

/// Goal: a refused target gives way to the one in force; near a snap-through to the reference, with currents
/// kept to the last bit.
#[test]
fn targets_given_up_give_way_to_what_is_in_force() {
    let (near, far): (Directions, Directions) = ([[0.6, 0.0, 0.8]; 8], [[1.0, 0.0, 0.0]; 8]);
    let mut bench = Bench::active();
    bench.controller().in_force = near;
    bench.ask(Verb::SetTarget(far.into())).expect("a direction each");
    bench.controller().verdict = Verdict::Refused { obstacle: Obstacle::NearSnapThrough, progress: 0.5 };
    let record = bench.cycle();
    assert_eq!(record.decision.given_up, Some(Cause::TargetCrossesSnapThrough));
    assert_eq!(record.target.directions, near);
    bench.controller().verdict = Verdict::Unchecked;
    bench.controller().desired = [[0.0, 1.0, 0.0]; 8];
    bench.cycles(2);
    assert_eq!(bench.controller().seen.map(|input| input.target.directions), Some(near));
    bench.controller().margin = 0.05;
    let before = bench.cycle();
    assert_eq!(before.decision.state, state::HOLDING);
    assert_eq!(before.target.directions, [[0.0, 1.0, 0.0]; 8]);
    bench.controller().request.current_a = [4.0; 32];
    for record in bench.cycles(100) {
        assert_eq!((record.admitted, record.input.engaged), (before.admitted, false));
    }
    bench.controller().margin = 1.0;
    bench.ask(Verb::SetTarget(far.into())).expect("a direction each");
    bench.cycles(2);
    assert_ne!(bench.cycle().admitted, before.admitted);
}

/// Proves SR-09.
#[test]
fn nothing_is_sent_before_arming() {
    let mut bench = Bench::new();
    assert!(bench.cycles(50).iter().all(|record| record.order.is_none()));
}

/// Proves SR-08.
#[test]
fn the_first_command_equals_what_was_measured_then_it_slews() {
    let mut bench = Bench::new();
    bench.ask(Verb::Arm).expect("the bench is healthy");
    let records = bench.ask(Verb::Go).expect("the bench is healthy");
    let first = records.last().expect("answered in a cycle");
    assert_eq!(first.admitted.current_a, first.input.measured.current_a);
    let mut previous = first.admitted;
    for record in bench.cycles(30) {
        let step = (record.admitted.current_a[1] - previous.current_a[1]).abs();
        assert!(step <= 200.0 * 1e-3 + 1e-12, "coil 1 slews at 200 A/s: {step}");
        previous = record.admitted;
    }
}

#[test]
fn without_a_target_the_rod_is_kept_where_it_was_found() {
    let mut bench = Bench::active();
    bench.cycle();
    assert_eq!(bench.controller().seen.expect("a cycle ran").target, [UP; 8].into());
}

#[test]
fn a_target_reaches_the_controller_in_the_next_cycle() {
    let mut bench = Bench::active();
    let mut target = Directions::default();
    (target[0], target[1]) = ([1.0, 0.0, 0.0], [0.6, 0.0, 0.8]);
    bench.ask(Verb::SetTarget(target.into())).expect("unit vectors");
    let record = bench.cycle();
    assert_eq!(record.input.target, target.into());
    assert_eq!(record.target, target.into());
}

#[test]
fn a_hold_freezes_the_reference_of_its_moment_until_go() {
    let mut bench = Bench::active();
    let moving = [[0.6, 0.0, 0.8]; 8];
    bench.controller().desired = moving;
    bench.cycle();
    bench.ask(Verb::Hold).expect("steering");
    bench.controller().desired = [UP; 8];
    let record = *bench.cycles(20).last().expect("cycles ran");
    assert_eq!((record.decision.state, record.input.target), (state::HOLDING, moving.into()));
    assert!(record.input.engaged, "held in closed loop");
    bench.ask(Verb::Go).expect("holding");
    assert_eq!(bench.cycle().input.target, [UP; 8].into(), "back to the target as set");
}

/// Goal: a retreat sends what was sent on the way there, backwards, and ends where it was told to with the loop keeping what it came to.
///
/// Proves SR-25.
#[test]
fn a_retreat_goes_back_over_what_was_admitted_and_keeps_the_rod_there() {
    let mut bench = Bench::active();
    // There by a detour: the second coil first, then the first one.
    let mut way = Vec::new();
    for corner in [[0.0, 2.0], [3.0, 2.0]] {
        bench.controller().request.current_a[..2].copy_from_slice(&corner);
        way.extend(bench.cycles(300).into_iter().map(|record| record.admitted));
    }
    bench.controller().margin = 0.05;
    bench.cycles(3);
    let aside = [[0.6, 0.0, 0.8]; 8];
    bench.controller().desired = aside;
    bench.ask(Verb::Retreat).expect("held");
    let mut back = bench.cycles(20);
    while back[back.len() - 1].decision.cause == Some(Cause::Retreating) {
        assert!(back.len() < 2_000, "comes to the end of what is remembered");
        back.push(bench.cycle());
    }
    for record in &back {
        let apart = |admitted: &Actuation| {
            let pairs = record.admitted.current_a.iter().zip(&admitted.current_a);
            pairs.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max)
        };
        let beside = way.iter().map(apart).fold(f64::INFINITY, f64::min);
        assert!(beside < 0.2, "{beside} A beside the way: {:?}", record.admitted);
        assert!(!record.input.engaged);
    }
    let last = back[back.len() - 1];
    assert!(largest(&last.admitted) < 1e-9, "where this activity began");
    assert_eq!((last.decision.state, last.decision.cause), (state::HOLDING, Some(Cause::NearSnapThrough)));
    // Once more, and far enough on the way.
    bench.controller().margin = 1.0;
    bench.cycle();
    bench.ask(Verb::SetTarget([UP; 8].into())).expect("unit vectors");
    bench.cycles(300);
    bench.controller().margin = 0.05;
    bench.cycles(3);
    bench.ask(Verb::Retreat).expect("held");
    bench.cycles(20);
    bench.controller().margin = 1.0;
    let record = bench.cycles(3)[2];
    assert_eq!((record.decision.state, record.decision.cause), (state::ACTIVE, None));
    let kept = ReferenceTarget { directions: aside, frame_angles: Some(record.admitted.angle_rad) };
    assert_eq!(record.input.target, kept);
}

#[test]
fn currents_hold_while_sensing_is_lost_briefly() {
    let mut bench = Bench::active();
    bench.cycles(100);
    // Poses and feedback stop together: the loop holds until the feedback's limit trips it.
    bench.hardware().set_silent(true);
    let records = bench.cycles(150);
    let held: Vec<_> = records.iter().filter(|it| it.decision.state == state::HOLDING).collect();
    assert!(held.len() > 90);
    assert!(held.iter().all(|it| it.admitted == held[0].admitted));
    assert!(held.iter().skip(1).all(|it| !it.input.engaged));
    bench.hardware().set_silent(false);
    assert_eq!(bench.cycles(3)[2].decision.state, state::ACTIVE);
}

/// Proves SR-06.
#[test]
fn a_request_that_is_not_finite_is_never_sent_and_trips() {
    let mut bench = Bench::active();
    bench.cycles(100);
    bench.controller().request.current_a[0] = f64::NAN;
    let records = bench.cycles(100);
    assert!(records.iter().all(|record| record.admitted.current_a.iter().all(|it| it.is_finite())));
    assert_eq!(records[0].order, Some(order::RAMP_DOWN));
    let last = records.last().expect("cycles ran").decision;
    assert_eq!((last.state, last.cause), (state::FAULT, Some(Cause::RequestNotFinite)));
}

#[test]
fn a_model_that_does_not_converge_is_ridden_through_for_its_limit_only() {
    let mut bench = Bench::active();
    bench.controller().converged = false;
    assert_eq!(bench.cycles(250)[249].decision.state, state::ACTIVE);
    let last = bench.cycles(100)[99].decision;
    assert_eq!((last.state, last.cause), (state::FAULT, Some(Cause::ModelNotConverged)));
}

/// Goal: after 300 ms the loop is in a fault for `cause`, and no current is left.
fn expect_fault(bench: &mut Bench, cause: Cause) {
    let record = bench.cycles(300)[299];
    assert_eq!((record.decision.state, record.decision.cause), (state::FAULT, Some(cause)));
    assert_eq!(largest(&record.feedback.expect("alive").measured), 0.0, "{cause:?}");
    assert_eq!(bench.hardware().guard().limit_breaks(), 0);
}

/// Goal: half of the periods missed for ever is what is borne; nine of ten stop the loop within the window
/// and some, and it stays stopped until it has been punctual for a while.
///
/// Proves SR-21.
#[test]
fn loop_that_misses_too_many_periods_stops_and_one_that_misses_half_does_not() {
    let mut bench = Bench::active();
    bench.cycles(100);
    for _ in 0..2_000 {
        assert_eq!(bench.after_stall(Duration::from_millis(2)).decision.state, state::ACTIVE);
    }
    bench.cycles(400);
    let late = |bench: &mut Bench| bench.after_stall(Duration::from_millis(10)).decision.state;
    let cycles = (1..100).find(|_| late(&mut bench) >= state::SAFE_STOP).expect("too many");
    // Each misses 9 periods while 10 drain 5: 4 more of the 200 that are borne.
    assert_eq!(cycles, 50);
    bench.cycles(100);
    assert_eq!(bench.ask(Verb::Reset).err(), Some(Cause::Overruns), "punctual for 100 ms only");
    expect_fault(&mut bench, Cause::Overruns);
    bench.ask(Verb::Reset).expect("punctual since");
}

/// Goal: commands that the transport refuses for a while shorter than half of their validity are ridden
/// through; for longer, the loop says so by its name before the driver's own watchdog is taken for lost
/// authority.
///
/// Proves SR-01.
#[test]
fn commands_that_cannot_be_sent_stop_the_loop_by_their_name() {
    let mut bench = Bench::active();
    bench.cycles(100);
    for _ in 0..5 {
        bench.cut_line(true);
        assert_eq!(bench.cycles(50)[49].decision.state, state::ACTIVE);
        bench.cut_line(false);
        assert_eq!(bench.cycles(50)[49].decision.state, state::ACTIVE);
    }
    bench.cut_line(true);
    expect_fault(&mut bench, Cause::CommandNotSent);
    assert_eq!(bench.hardware().guard().state(), driver_state::IDLE, "it came to zero by itself");
    bench.cut_line(false);
    bench.ask(Verb::Reset).expect("the line is whole");
    bench.ask(Verb::Arm).expect("the driver is idle");
}

/// Proves SR-25.
#[test]
fn rod_that_the_model_has_beyond_a_snap_through_stops_the_loop_after_its_time_only() {
    let mut bench = Bench::active();
    bench.cycles(100);
    for _ in 0..5 {
        bench.controller().margin = -0.05;
        assert_eq!(bench.cycles(150)[149].decision.state, state::HOLDING, "currents are kept");
        bench.controller().margin = 0.5;
        bench.cycles(10);
    }
    bench.controller().margin = -0.05;
    expect_fault(&mut bench, Cause::StabilityLost);
}

/// Proves SR-10.
#[test]
fn magnets_outside_of_the_field_model_stop_the_loop_after_its_time_only() {
    let mut bench = Bench::active();
    for _ in 0..5 {
        bench.controller().field_valid = false;
        assert_eq!(bench.cycles(250)[249].decision.state, state::ACTIVE);
        bench.controller().field_valid = true;
        bench.cycles(10);
    }
    bench.controller().field_valid = false;
    bench.cycles(100);
    expect_fault(&mut bench, Cause::FieldModelInvalid);
    assert_eq!(bench.ask(Verb::Reset).err(), Some(Cause::FieldModelInvalid), "they still are");
    bench.controller().field_valid = true;
    bench.ask(Verb::Reset).expect("they are back");
}

#[test]
fn pauses_shorter_than_the_validity_are_ridden_through() {
    let mut bench = Bench::active();
    bench.cycles(100);
    for _ in 0..20 {
        let before = bench.cycle().admitted;
        let record = bench.after_stall(Duration::from_millis(60));
        assert!(matches!(record.decision.state, state::ACTIVE | state::HOLDING));
        let step = (record.admitted.current_a[0] - before.current_a[0]).abs();
        assert!(step <= 200.0 * 10e-3 + 1e-12, "what was missed is not made up in one step: {step}");
        bench.cycles(200);
    }
    assert_eq!(bench.cycle().decision.state, state::ACTIVE);
    assert_eq!(bench.hardware().guard().limit_breaks(), 0);
}

#[test]
fn a_pause_beyond_the_validity_loses_authority_and_trips() {
    let mut bench = Bench::active();
    bench.cycles(100);
    bench.after_stall(Duration::from_millis(150));
    let records = bench.cycles(200);
    let last = records.last().expect("cycles ran").decision;
    assert_eq!((last.state, last.cause), (state::FAULT, Some(Cause::AuthorityLost)));
    assert_eq!(bench.hardware().guard().state(), driver_state::IDLE);
    bench.ask(Verb::Reset).expect("the cause is over");
    bench.ask(Verb::Arm).expect("the driver is idle again");
}

#[test]
fn a_drivers_fault_cuts_the_amplifiers_until_it_is_gone_and_reset() {
    let mut bench = Bench::active();
    bench.cycles(50);
    bench.hardware().set_fault(42);
    let record = bench.cycles(2)[1];
    assert_eq!(record.order, Some(order::DISABLE));
    assert_eq!(bench.ask(Verb::Reset).err(), Some(Cause::DriverFault));
    bench.hardware().set_fault(0);
    bench.cycles(5);
    bench.ask(Verb::Reset).expect("the fault is gone");
    bench.ask(Verb::Arm).expect("a claim puts cut amplifiers back to work");
}

/// Proves SR-14.
#[test]
fn an_emergency_stop_from_idle_is_obeyed_by_the_driver() {
    let mut bench = Bench::new();
    bench.ask(Verb::EmergencyStop).expect("always allowed");
    bench.cycles(2);
    assert_eq!(bench.hardware().guard().state(), driver_state::DISABLED);
}

#[test]
fn a_driver_of_another_rig_keeps_the_loop_in_boot() {
    let description = example_description();
    let controller = Bench::new().control_loop.controller_mut().clone();
    let mut hardware = EchoHardware::new(&description);
    hardware.set_silent(true);
    let options = LoopOptions::default();
    let mut control_loop = ControlLoop::new(hardware, controller, &description, &shipped(), options);
    let mut header = HeaderWriter::new(9);
    let mut tick = Tick::first(Stamp::from_nanoseconds(5_000_000_000));
    for cycle in 0..50 {
        tick = tick.stepped(PERIOD);
        let mut feedback = CoilFeedback { coil_count: 3, pose_parameter_count: 2, ..CoilFeedback::default() };
        feedback.description_fingerprint = description.fingerprint() ^ 1;
        feedback.header.source_stamp_ns = tick.now.nanoseconds();
        header.write(&mut feedback.header, tick.now);
        // Feedback comes only in every other cycle; the mismatch must not be forgotten in between.
        if cycle % 2 == 0 {
            control_loop.hardware_mut().inject_feedback(feedback);
        }
        let decision = control_loop.cycle(tick).decision;
        assert_eq!((decision.state, decision.cause), (state::BOOT, Some(Cause::DescriptionMismatch)));
    }
}

#[test]
fn a_process_told_to_end_ends_at_zero_current() {
    let mut bench = Bench::active();
    bench.cycles(100);
    bench.ask(Verb::Terminate).expect("always allowed while healthy");
    let mut cycles = 0;
    while !bench.control_loop.has_ended(bench.tick.now) {
        bench.cycle();
        cycles += 1;
        assert!(cycles < 1_000, "ends within the ramp's time");
    }
    let record = bench.cycle();
    assert_eq!(largest(&record.feedback.expect("alive").measured), 0.0);
    assert_eq!(record.decision.cause, Some(Cause::Terminated));
}

/// Goal: once a stop or trip began, no later command of the episode is larger than the one before, whatever
/// happens then; and the driver never saw a broken limit or a command that it had to refuse for its content.
#[test]
fn after_a_trip_commanded_currents_only_fall() {
    let mut trips = 0;
    for seed in 0..20 {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut bench = Bench::new();
        let mut falling_from: Option<f64> = None;
        for cycle in 0..3_000 {
            disturb(&mut random, &mut bench);
            let record = if random.random_bool(0.002) {
                bench.after_stall(Duration::from_millis(random.random_range(2..140)))
            } else {
                bench.cycle()
            };
            let drives = record.order == Some(order::DRIVE);
            let steers = matches!(record.decision.state, state::ACTIVE | state::HOLDING);
            assert!(!drives || steers || record.decision.state == state::ARMED, "{record:?}");
            if matches!(record.decision.state, state::SAFE_STOP | state::FAULT) {
                trips += u32::from(falling_from.is_none());
                let commanded = largest(&record.admitted);
                assert!(falling_from.is_none_or(|before| commanded <= before), "seed {seed}, {cycle}");
                falling_from = Some(commanded);
            } else {
                falling_from = None;
            }
        }
        assert_eq!(bench.hardware().guard().limit_breaks(), 0, "seed {seed}");
    }
    assert!(trips > 50, "the seeds must exercise stops: {trips}");
}

fn disturb(random: &mut rand_chacha::ChaCha8Rng, bench: &mut Bench) {
    if random.random_bool(0.05) {
        bench.controller().request.current_a[random.random_range(0..3)] = random.random_range(-20.0..20.0);
    }
    if random.random_bool(0.003) {
        match random.random_range(0..4) {
            0 => bench.hardware().set_silent(true),
            1 => bench.hardware().set_fault(1),
            2 => bench.controller().converged = false,
            _ => bench.controller().request.current_a[0] = f64::INFINITY,
        }
    }
    if random.random_bool(0.01) {
        bench.hardware().set_silent(false);
        bench.hardware().set_fault(0);
        bench.controller().converged = true;
        bench.controller().request.current_a[0] = 1.0;
    }
    if random.random_bool(0.05) {
        let verbs = [Verb::Arm, Verb::Go, Verb::Go, Verb::Hold, Verb::Reset, Verb::Stop];
        let verb = verbs[random.random_range(0..verbs.len())];
        bench.control_loop.request(Request { id: 0, verb }).expect("one request a cycle");
    }
}
