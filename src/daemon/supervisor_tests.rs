//! Tests of the state machine: every (state, event) pair against a table, limits one by one, and
//! random sequences of events against what must never happen.

use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};
use rand::{RngExt, SeedableRng};

use super::config::{Limits, tests::shipped};
use super::state::{Directive, Request, State, Verb};
use super::supervisor::{Decision, Supervisor};
use super::watch::{DriverView, Observation, Response, response};

const PERIOD: Duration = Duration::from_millis(1);

fn limits() -> Limits {
    shipped().limits()
}

fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// A supervisor with a driver that does what it is told, one period behind.
struct Bench {
    supervisor: Supervisor,
    now: Stamp,
    seen: Observation,
    next_id: u32,
    /// False freezes the feedback.
    driver_alive: bool,
    /// False freezes the poses.
    sensor_alive: bool,
    /// True: the driver obeys claims.
    driver_obeys: bool,
    /// Current that commands of steering leave in the coils, A.
    current: f64,
}

impl Bench {
    fn new() -> Self {
        let now = Stamp::from_nanoseconds(1_000_000_000);
        let driver = DriverView {
            stamp: now,
            state: driver_state::IDLE,
            fault: 0,
            epoch: 0,
            current_max: 0.0,
            over_current: false,
        };
        let seen = Observation {
            now,
            missed: 0,
            pose_stamp: Some(now),
            driver: Some(driver),
            description_mismatch: false,
            model_converged: true,
            field_valid: true,
            request_finite: true,
            write_failed: false,
            commanded_zero: true,
        };
        Self {
            supervisor: Supervisor::new(limits(), 2, false),
            now,
            seen,
            next_id: 1,
            driver_alive: true,
            sensor_alive: true,
            driver_obeys: true,
            current: 2.0,
        }
    }

    fn driver(&mut self) -> &mut DriverView {
        self.seen.driver.as_mut().expect("the bench always has one")
    }

    fn cycle(&mut self, verb: Option<Verb>) -> Decision {
        self.now = self.now.after(PERIOD);
        self.seen.now = self.now;
        if self.sensor_alive {
            self.seen.pose_stamp = Some(self.now);
        }
        if self.driver_alive {
            let now = self.now;
            self.driver().stamp = now;
        }
        let id = self.next_id;
        self.next_id += 1;
        let decision = self.supervisor.step(&self.seen, verb.map(|verb| Request { id, verb }));
        self.obey(&decision);
        decision
    }

    fn obey(&mut self, decision: &Decision) {
        let steering = matches!(decision.directive, Directive::Begin | Directive::Follow | Directive::Hold);
        self.seen.commanded_zero = !steering;
        if !(self.driver_alive && self.driver_obeys) {
            return;
        }
        let current = self.current;
        let driver = self.driver();
        match decision.directive {
            Directive::Silent => {}
            Directive::Claim => (driver.epoch, driver.state) = (decision.epoch, driver_state::DRIVEN),
            Directive::Release => (driver.state, driver.current_max) = (driver_state::IDLE, 0.0),
            Directive::Disable => (driver.state, driver.current_max) = (driver_state::DISABLED, 0.0),
            Directive::Begin | Directive::Follow | Directive::Hold => driver.current_max = current,
            Directive::Rest | Directive::RampDown => driver.current_max = 0.0,
        }
    }

    fn cycles(&mut self, count: u64) -> Decision {
        for _ in 1..count {
            self.cycle(None);
        }
        self.cycle(None)
    }

    /// Cycles until `code` is reached, at most for `patience`.
    fn until(&mut self, code: u32, patience: Duration) -> Option<Duration> {
        let begin = self.now;
        while self.now.since(begin) <= patience {
            if self.cycle(None).state == code {
                return Some(self.now.since(begin));
            }
        }
        None
    }

    fn ask(&mut self, verb: Verb) -> Result<u32, Cause> {
        let id = self.next_id;
        let mut decision = self.cycle(Some(verb));
        for _ in 0..200 {
            if let Some(answer) = decision.answers.into_iter().flatten().find(|answer| answer.id == id) {
                return answer.refused.map_or(Ok(decision.state), Err);
            }
            decision = self.cycle(None);
        }
        panic!("{verb:?} was never answered");
    }

    fn idle() -> Self {
        let mut bench = Self::new();
        assert_eq!(bench.cycle(None).state, state::IDLE);
        bench
    }

    fn armed() -> Self {
        let mut bench = Self::idle();
        assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED));
        bench
    }

    fn active() -> Self {
        let mut bench = Self::armed();
        assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
        bench.cycles(5);
        bench
    }

    /// A bench whose supervisor is in the state with this code.
    fn in_state(code: u32) -> Self {
        match code {
            state::BOOT => {
                let mut bench = Self::new();
                bench.driver_alive = false;
                bench.now = bench.now.after(ms(1_000));
                bench.cycle(None);
                bench
            }
            state::IDLE => Self::idle(),
            state::ARMED => Self::armed(),
            state::ACTIVE => Self::active(),
            state::HOLDING => {
                let mut bench = Self::active();
                assert_eq!(bench.ask(Verb::Hold), Ok(state::HOLDING));
                bench
            }
            state::SAFE_STOP => {
                let mut bench = Self::active();
                // Currents stay up: the ramp does not end by itself during the test.
                bench.driver_obeys = false;
                assert_eq!(bench.ask(Verb::Stop), Ok(state::SAFE_STOP));
                bench
            }
            _ => {
                let mut bench = Self::active();
                assert_eq!(bench.ask(Verb::EmergencyStop), Ok(state::FAULT));
                bench
            }
        }
    }
}

/// What happens to a daemon in the table below.
#[derive(Debug, Clone, Copy)]
enum Event {
    Ask(Verb),
    PosesStop,
    ModelFails,
    FieldInvalid,
    FeedbackStops,
    AuthorityLost,
    DriverCut,
    DriverFault,
    OverCurrent,
    Overruns,
    RequestNotFinite,
    WritesFail,
}

impl Event {
    /// Lets the event happen for half a second; returns the last decision.
    fn happen(self, bench: &mut Bench) -> Decision {
        match self {
            // Whether it is refused shows in the state.
            Self::Ask(verb) => _ = bench.ask(verb),
            Self::PosesStop => bench.sensor_alive = false,
            Self::ModelFails => bench.seen.model_converged = false,
            Self::FieldInvalid => bench.seen.field_valid = false,
            Self::FeedbackStops => bench.driver_alive = false,
            Self::AuthorityLost => (bench.driver().state, bench.driver_obeys) = (driver_state::IDLE, false),
            Self::DriverCut => bench.driver().state = driver_state::DISABLED,
            Self::DriverFault => bench.driver().fault = 7,
            Self::OverCurrent => bench.driver().over_current = true,
            Self::Overruns => bench.seen.missed = 10,
            Self::RequestNotFinite => bench.seen.request_finite = false,
            Self::WritesFail => bench.seen.write_failed = true,
        }
        bench.cycles(500)
    }
}

/// Goal: each event in each state, half a second later. A letter names the state: `b`oot, `i`dle, `a`rmed,
/// a`c`tive, `h`olding, `s`afe-stop, `f`ault; the columns are the states before, in the same order.
#[test]
fn every_event_in_every_state_leads_where_the_table_says() {
    use Event::{
        Ask, AuthorityLost, DriverCut, DriverFault, FeedbackStops, FieldInvalid, ModelFails, OverCurrent,
        Overruns, PosesStop, RequestNotFinite, WritesFail,
    };
    let target = [[0.0, 0.0, 1.0]; 8];
    let table: [(Event, &str, Option<Cause>); 19] = [
        //                              biachsf
        (Ask(Verb::Arm), "baachsf", None),
        (Ask(Verb::Go), "bicccsf", None),
        (Ask(Verb::Hold), "biahhsf", None),
        (Ask(Verb::Stop), "biiiisf", None),
        (Ask(Verb::Terminate), "biiiisf", None),
        (Ask(Verb::Reset), "biachsi", None),
        (Ask(Verb::EmergencyStop), "fffffff", Some(Cause::EmergencyStop)),
        (Ask(Verb::SetTarget(target)), "biachsf", None),
        (PosesStop, "biaffsf", Some(Cause::PoseStale)),
        (ModelFails, "biaffsf", Some(Cause::ModelNotConverged)),
        (FieldInvalid, "biaffsf", Some(Cause::FieldModelInvalid)),
        (FeedbackStops, "bissssf", Some(Cause::FeedbackStale)),
        (AuthorityLost, "bifsssf", Some(Cause::AuthorityLost)),
        (DriverCut, "bifffsf", Some(Cause::DriverDisabled)),
        (DriverFault, "bffffff", Some(Cause::DriverFault)),
        (OverCurrent, "bffffff", Some(Cause::OverCurrent)),
        (Overruns, "bifffsf", Some(Cause::Overruns)),
        (RequestNotFinite, "biaffsf", Some(Cause::RequestNotFinite)),
        (WritesFail, "bifffsf", Some(Cause::CommandNotSent)),
    ];
    let letters = ["b", "i", "a", "c", "h", "s", "f"];
    for (event, row, cause) in table {
        for (code, expected) in (0_u32..).zip(row.chars()) {
            let mut bench = Bench::in_state(code);
            let before = bench.supervisor.state().code();
            assert_eq!(before, code, "the bench reached the state");
            let decision = event.happen(&mut bench);
            let after = letters[decision.state as usize];
            assert_eq!(after, expected.to_string(), "{event:?} in {}", state::name(code));
            let stopped = (state::ARMED..=state::HOLDING).contains(&code)
                && matches!(decision.state, state::FAULT | state::SAFE_STOP);
            if let (true, Some(cause)) = (stopped, cause) {
                assert_eq!(decision.cause, Some(cause), "{event:?} in {}", state::name(code));
            }
        }
    }
}

#[test]
fn poses_late_by_the_hold_limit_hold_and_come_back_without_a_request() {
    let mut bench = Bench::active();
    bench.sensor_alive = false;
    assert_eq!(bench.cycles(50).state, state::ACTIVE, "50 ms old poses are still steered by");
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Hold));
    bench.sensor_alive = true;
    let decision = bench.cycle(None);
    // The request of this cycle was made without sensing: it is not followed yet.
    assert_eq!((decision.state, decision.directive), (state::ACTIVE, Directive::Hold));
    assert_eq!(bench.cycle(None).directive, Directive::Follow);
}

#[test]
fn poses_missing_for_the_stop_limit_end_in_a_latched_fault() {
    let mut bench = Bench::active();
    bench.sensor_alive = false;
    let after = bench.until(state::SAFE_STOP, ms(400)).expect("the stop limit is 250 ms");
    assert_eq!(after, ms(251));
    bench.until(state::FAULT, ms(100)).expect("the driver ramps down within two cycles");
    assert_eq!(bench.ask(Verb::Reset), Err(Cause::PoseStale), "the sensor is still silent");
    bench.sensor_alive = true;
    bench.cycle(None);
    assert_eq!(bench.cycles(1_000).state, state::FAULT, "nothing resumes by itself");
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
}

#[test]
fn an_operators_hold_outlasts_a_loss_of_sensing() {
    let mut bench = Bench::in_state(state::HOLDING);
    assert_eq!(bench.cycle(None).directive, Directive::Follow, "held in closed loop");
    bench.sensor_alive = false;
    assert_eq!(bench.cycles(60).directive, Directive::Hold);
    bench.sensor_alive = true;
    bench.cycle(None);
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.directive), (state::HOLDING, Directive::Follow));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
}

#[test]
fn the_first_command_of_an_activity_is_what_was_measured() {
    let mut bench = Bench::armed();
    assert_eq!(bench.cycle(Some(Verb::Go)).directive, Directive::Begin);
    assert_eq!(bench.cycle(None).directive, Directive::Follow);
}

#[test]
fn arming_names_what_is_missing() {
    type Spoil = fn(&mut Bench);
    let cases: [(Cause, Spoil); 6] = [
        (Cause::PoseStale, |bench| {
            bench.sensor_alive = false;
            bench.cycles(100);
        }),
        (Cause::FeedbackStale, |bench| {
            bench.driver_alive = false;
            bench.cycles(300);
        }),
        (Cause::DriverBusy, |bench| bench.driver().state = driver_state::DRIVEN),
        (Cause::DriverBusy, |bench| bench.driver().current_max = 0.2),
        (Cause::DescriptionMismatch, |bench| bench.seen.description_mismatch = true),
        (Cause::ArmTimeout, |bench| bench.driver_obeys = false),
    ];
    for (cause, spoil) in cases {
        let mut bench = Bench::idle();
        spoil(&mut bench);
        assert_eq!(bench.ask(Verb::Arm), Err(cause));
        assert_eq!(bench.cycles(200).state, state::IDLE);
        assert_eq!(bench.supervisor.epoch(), 0, "no authority is left behind");
    }
}

#[test]
fn arming_is_refused_when_enforced_real_time_is_missing() {
    let mut bench = Bench::new();
    bench.supervisor = Supervisor::new(limits(), 2, true);
    bench.cycle(None);
    assert_eq!(bench.ask(Verb::Arm), Err(Cause::RealtimeMissing));
}

#[test]
fn a_stop_cancels_a_claim_and_both_requests_are_answered() {
    let mut bench = Bench::idle();
    bench.driver_obeys = false;
    let claim = bench.next_id;
    assert_eq!(bench.cycle(Some(Verb::Arm)).directive, Directive::Claim);
    let decision = bench.cycle(Some(Verb::Stop));
    let answers: Vec<_> = decision.answers.into_iter().flatten().collect();
    assert_eq!(answers[0].id, claim);
    assert_eq!(answers[0].refused, Some(Cause::OperatorStop));
    assert_eq!((answers[1].refused, decision.state), (None, state::IDLE));
}

#[test]
fn a_stop_ends_on_measured_current_not_on_commanded() {
    let mut bench = Bench::active();
    bench.driver_obeys = false;
    bench.ask(Verb::Stop).expect("stopping is allowed");
    assert_eq!(bench.cycles(500).state, state::SAFE_STOP, "current still flows");
    bench.driver().current_max = 0.09;
    let decision = bench.cycle(None);
    assert_eq!((decision.state, decision.cause), (state::IDLE, Some(Cause::OperatorStop)));
}

#[test]
fn a_ramp_that_takes_too_long_cuts_the_amplifiers() {
    let mut bench = Bench::active();
    bench.driver_obeys = false;
    bench.ask(Verb::Stop).expect("stopping is allowed");
    let decision = bench.cycles(1_100);
    assert_eq!((decision.state, decision.cause), (state::FAULT, Some(Cause::RampTimeout)));
    assert_eq!(decision.directive, Directive::Disable);
    assert_eq!(bench.ask(Verb::Reset), Err(Cause::RampTimeout), "current still flows");
}

#[test]
fn the_worst_cause_of_an_episode_wins_and_stays() {
    let mut bench = Bench::active();
    bench.driver_obeys = false;
    bench.ask(Verb::Stop).expect("stopping is allowed");
    bench.driver().over_current = true;
    assert_eq!(bench.cycle(None).cause, Some(Cause::OverCurrent));
    bench.driver().over_current = false;
    bench.driver().fault = 3;
    assert_eq!(bench.cycle(None).cause, Some(Cause::OverCurrent), "a milder one does not replace it");
    bench.ask(Verb::EmergencyStop).expect("always allowed");
    assert_eq!(bench.cycle(None).cause, Some(Cause::EmergencyStop));
}

#[test]
fn an_emergency_stop_from_idle_carries_an_epoch_that_the_driver_can_obey() {
    let mut bench = Bench::idle();
    let decision = bench.cycle(Some(Verb::EmergencyStop));
    assert_eq!(decision.directive, Directive::Disable);
    assert!(decision.epoch > 0);
}

#[test]
fn after_an_emergency_stop_it_takes_reset_and_arm_and_go() {
    let mut bench = Bench::in_state(state::FAULT);
    assert_eq!(bench.ask(Verb::Arm), Err(Cause::EmergencyStop));
    assert_eq!(bench.ask(Verb::Go), Err(Cause::EmergencyStop));
    assert_eq!(bench.ask(Verb::Reset), Ok(state::IDLE));
    assert_eq!(bench.ask(Verb::Go), Err(Cause::WrongState));
    assert_eq!(bench.ask(Verb::Arm), Ok(state::ARMED));
    assert_eq!(bench.ask(Verb::Go), Ok(state::ACTIVE));
}

#[test]
fn targets_that_are_no_unit_vectors_are_refused() {
    let mut bench = Bench::idle();
    let good = [0.6, 0.0, 0.8];
    for bad in [[0.0; 3], [f64::NAN, 0.0, 1.0], [1.0, 1.0, 0.0], [f64::INFINITY, 0.0, 0.0]] {
        let mut target = [[0.0; 3]; 8];
        (target[0], target[1]) = (good, bad);
        assert_eq!(bench.ask(Verb::SetTarget(target)), Err(Cause::TargetInvalid), "{bad:?}");
    }
    let mut target = [[0.0; 3]; 8];
    (target[0], target[1]) = (good, good);
    let decision = bench.cycle(Some(Verb::SetTarget(target)));
    assert_eq!(decision.target, Some(target));
}

#[test]
fn a_process_told_to_end_ramps_down_and_takes_no_more_orders() {
    let mut bench = Bench::active();
    bench.ask(Verb::Terminate).expect("ending is allowed");
    bench.until(state::IDLE, ms(50)).expect("the driver ramps down within two cycles");
    bench.cycles(2);
    assert!(bench.supervisor.has_ended(bench.now));
    assert_eq!(bench.ask(Verb::Arm), Err(Cause::Ending));
}

#[test]
fn authority_is_released_until_the_driver_shows_it() {
    let mut bench = Bench::active();
    bench.ask(Verb::Stop).expect("stopping is allowed");
    let mut released = 0;
    for _ in 0..10 {
        released += u32::from(bench.cycle(None).directive == Directive::Release);
    }
    assert!(released >= 1);
    assert_eq!(bench.cycle(None).directive, Directive::Silent);
    assert_eq!(bench.supervisor.epoch(), 0);
}

/// Goal: over random events, healthy and faulty, what must never happen does not.
#[test]
fn random_events_never_break_the_rules() {
    for seed in 0..40 {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut bench = Bench::new();
        let mut before = *bench.supervisor.state();
        let mut reached = [false; 7];
        for _ in 0..4_000 {
            let verb = random_event(&mut random, &mut bench);
            let decision = bench.cycle(verb);
            check_rules(&before, verb, &decision, &bench, seed);
            before = *bench.supervisor.state();
            reached[before.code() as usize] = true;
        }
        assert!(reached.iter().skip(1).all(|reached| *reached), "seed {seed} visits every state");
    }
}

fn random_event(random: &mut rand_chacha::ChaCha8Rng, bench: &mut Bench) -> Option<Verb> {
    let toss = |random: &mut rand_chacha::ChaCha8Rng, chance| random.random_bool(chance);
    // Faults come rarely and go soon, so that the machine also works.
    if toss(random, 0.004) {
        match random.random_range(0..9) {
            0 => bench.sensor_alive = false,
            1 => bench.driver_alive = false,
            2 => bench.seen.model_converged = false,
            3 => bench.driver().fault = 1,
            4 => bench.driver().over_current = true,
            5 => bench.driver().state = random.random_range(0..4),
            6 => bench.driver_obeys = false,
            7 => bench.seen.missed = random.random_range(0..500),
            _ => bench.seen.request_finite = false,
        }
    }
    if toss(random, 0.02) {
        (bench.sensor_alive, bench.driver_alive, bench.driver_obeys) = (true, true, true);
        (bench.seen.model_converged, bench.seen.request_finite, bench.seen.missed) = (true, true, 0);
        (bench.driver().fault, bench.driver().over_current) = (0, false);
    }
    if !toss(random, 0.1) {
        return None;
    }
    let verbs = [
        Verb::Arm,
        Verb::Arm,
        Verb::Go,
        Verb::Go,
        Verb::Hold,
        Verb::Stop,
        Verb::Reset,
        Verb::Reset,
        Verb::SetTarget([[1.0, 0.0, 0.0]; 8]),
        Verb::EmergencyStop,
    ];
    let last = if toss(random, 0.1) { verbs.len() } else { verbs.len() - 1 };
    Some(verbs[random.random_range(0..last)])
}

fn check_rules(before: &State, verb: Option<Verb>, decision: &Decision, bench: &Bench, seed: u64) {
    let context = format!("seed {seed}: {before:?} with {verb:?} gave {decision:?}");
    let after = bench.supervisor.state();
    let drives = matches!(decision.directive, Directive::Begin | Directive::Follow | Directive::Hold);
    assert_eq!(drives, matches!(after, State::Active | State::Holding { .. }), "{context}");
    if matches!(before, State::Fault { .. }) && !matches!(after, State::Fault { .. }) {
        assert_eq!(verb, Some(Verb::Reset), "only a reset leaves Fault: {context}");
        assert_eq!(*after, State::Idle, "{context}");
    }
    if matches!(after, State::Active) && !matches!(before, State::Active | State::Holding { .. }) {
        assert_eq!((before, verb), (&State::Armed, Some(Verb::Go)), "{context}");
    }
    if matches!(after, State::Arming { .. }) && !matches!(before, State::Arming { .. }) {
        assert_eq!(verb, Some(Verb::Arm), "{context}");
    }
    if let (State::SafeStop { .. }, false) = (before, matches!(after, State::SafeStop { .. })) {
        assert!(matches!(after, State::Idle | State::Fault { .. }), "{context}");
    }
    if let (State::Fault { cause: old }, State::Fault { cause: new }) = (before, after) {
        assert!(new >= old, "a worse cause is never replaced by a milder one: {context}");
    }
    if let State::Fault { cause } = after {
        let disables = response(*cause) == Response::Disable;
        assert_eq!(disables, decision.directive == Directive::Disable, "{context}");
    }
    if !matches!(decision.directive, Directive::Silent) {
        assert!(decision.epoch > 0, "nothing is sent without an epoch: {context}");
    }
    let faulty = bench.seen.driver.is_some_and(|driver| driver.over_current);
    if faulty && *after != State::Boot {
        assert_eq!(decision.directive, Directive::Disable, "{context}");
    }
}
