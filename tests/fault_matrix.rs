//! Every fault verb in every state: which cause is latched, what the daemon does, and when every coil is at zero by the
//! plant's own truth.
//!
//! In lockstep with the real controller against the shipped planar rig. The fault begins in a state that was reached by
//! requests, and stays; a loop that steers goes on to and fro between two pairs of angles.
#![cfg(feature = "sim")]

mod rig_support;

use std::ops::ControlFlow;

use magsteer::config::Document;
use magsteer::daemon::{CycleRecord, Verb};
use magsteer_hal::fault::{Fault, FaultPlanConfig, Reach};
use magsteer_hal::operator::{Cause, state};
use magsteer_sim_plant::{SimulatedRig, ramp};
use rig_support::{Bench, Setup, directions_planar};

/// The states in which each fault begins, in the order of the columns.
const STATES: [u32; 5] = [state::IDLE, state::ARMED, state::ACTIVE, state::HOLDING, state::SAFE_STOP];
/// Angles from z, deg, and how long each pair is steered to, s.
const TARGETS_DEG: [[f64; 2]; 2] = [[70.0, 100.0], [95.0, 75.0]];
const TARGET_TIME: f64 = 0.5;
/// How long a fault is watched, s.
const WATCHED: f64 = 2.0;
/// Limits of the shipped file, s, and an allowance for a ramp from 3 A at 300 A/s, amplifiers and a sensor's period.
const POSE_STOP: f64 = 0.25;
const FEEDBACK_STOP: f64 = 0.2;
const VALIDITY: f64 = 0.1;
const FOLLOWING: f64 = 0.15;
const RAMP: f64 = 0.03;

/// What a fault does in a state.
#[derive(Debug, Clone, Copy)]
enum Does {
    /// Nothing: the state stays, and a stop under way ends in idle, with every coil at zero within a time, s.
    Nothing,
    /// The daemon latches this cause, and every coil is at zero within a time, s.
    Latches(Cause, f64),
    /// It stops for this cause, and cuts when the ramp's time is over, because nobody can see the end of the ramp.
    Cuts(Cause, f64),
}

use Does::{Cuts, Latches, Nothing};

/// One row: what it befalls, what it does, and what follows in each state.
type Row = (&'static str, &'static str, [Does; 5]);

const STALE: [Does; 5] = {
    let stale = Latches(Cause::PoseStale, POSE_STOP + RAMP);
    [Nothing, Nothing, stale, stale, Nothing]
};
const BLIND: [Does; 5] = {
    let blind = Cuts(Cause::FeedbackStale, FEEDBACK_STOP + RAMP);
    [Nothing, blind, blind, blind, Cuts(Cause::OperatorStop, RAMP)]
};
const LOST: [Does; 5] = {
    let lost = Latches(Cause::AuthorityLost, VALIDITY + RAMP);
    [Nothing, lost, lost, lost, Nothing]
};

const POSES: &[Row] = &[
    ("poses", "verb = 'off'", STALE),
    ("poses", "verb = 'off'\nmagnet = 'm2'", STALE),
    ("poses", "verb = 'garbage'\ngarbage = 'nan'", STALE),
    ("poses", "verb = 'garbage'\ngarbage = 'huge'", STALE),
    ("poses", "verb = 'garbage'\ngarbage = 'quaternion'\nmagnet = 'm1'", STALE),
    ("poses", "verb = 'repeated'", STALE),
    ("poses", "verb = 'backward'", STALE),
    ("poses", "verb = 'wrong-version'", STALE),
    ("poses", "verb = 'slow'\nrate_hz = 2.0", STALE),
    ("poses", "verb = 'delayed'\ndelay_ms = 300.0", STALE),
    ("poses", "verb = 'garbage'\ngarbage = 'random'", {
        let implausible = Latches(Cause::PoseImplausible, 3.0 * POSE_STOP);
        [Nothing, Nothing, implausible, implausible, Nothing]
    }),
    // Frozen poses of a rod that stands still are true.
    ("poses", "verb = 'stuck'", [Nothing, Nothing, Latches(Cause::PoseImplausible, 1.5), Nothing, Nothing]),
    ("poses", "verb = 'wrong-epoch'\nepoch = 'other'", {
        let restarted = Latches(Cause::SensorRestarted, 0.01 + RAMP);
        [Nothing, Nothing, restarted, restarted, Nothing]
    }),
];

const FEEDBACK: &[Row] = &[
    ("feedback", "verb = 'off'", BLIND),
    ("feedback", "verb = 'garbage'\ngarbage = 'nan'", BLIND),
    ("feedback", "verb = 'repeated'", BLIND),
    ("feedback", "verb = 'backward'", BLIND),
    ("feedback", "verb = 'wrong-version'", BLIND),
    ("feedback", "verb = 'stuck'", {
        let blind = Cuts(Cause::FeedbackStale, FEEDBACK_STOP + RAMP);
        // Frozen at zero, the end of the ramp shows; frozen at a current, it does not.
        let at_zero = Latches(Cause::FeedbackStale, FEEDBACK_STOP + RAMP);
        [Nothing, at_zero, blind, blind, Cuts(Cause::OperatorStop, RAMP)]
    }),
    ("feedback", "verb = 'garbage'\ngarbage = 'huge'", [Latches(Cause::OverCurrent, RAMP); 5]),
    ("feedback", "verb = 'garbage'\ngarbage = 'random'", {
        let astray = Cuts(Cause::NotFollowing, FOLLOWING + RAMP);
        [Nothing, astray, astray, astray, Cuts(Cause::OperatorStop, RAMP)]
    }),
    ("feedback", "verb = 'wrong-epoch'\nepoch = 'other'", {
        let lost = Latches(Cause::AuthorityLost, 0.01 + RAMP);
        [Nothing, lost, lost, lost, Nothing]
    }),
];

const ACTUATORS: &[Row] = &[
    ("actuators", "verb = 'repeated'", LOST),
    ("actuators", "verb = 'backward'", LOST),
    ("actuators", "verb = 'wrong-epoch'\nepoch = 'every-message'", LOST),
    ("actuators", "verb = 'wrong-version'", LOST),
    ("actuators", "verb = 'off'", {
        let cut = Latches(Cause::DriverFault, 0.15 + RAMP);
        [Nothing, Nothing, cut, cut, Nothing]
    }),
    // Set points of an idle driver are not the amplifiers' business; all others are driven astray.
    ("actuators", "verb = 'garbage'\ngarbage = 'random'", {
        let cut = Latches(Cause::DriverFault, 0.3);
        [Nothing, cut, cut, cut, cut]
    }),
    (
        "actuators",
        "verb = 'stuck'",
        // What is held creeps away from where it stuck; the daemon finds it first, and the ramp that does nothing is cut.
        [
            Nothing,
            Nothing,
            Latches(Cause::DriverFault, 0.5),
            Latches(Cause::DriverFault, 1.2),
            Latches(Cause::DriverFault, 0.15),
        ],
    ),
    (
        "actuators",
        "verb = 'delayed'\ndelay_ms = 300.0",
        // A loop with so much delay begins to swing.
        [
            Nothing,
            Nothing,
            Latches(Cause::DriverFault, 0.5),
            Latches(Cause::DriverFault, 1.4),
            Latches(Cause::DriverFault, 0.15),
        ],
    ),
    ("coil", "verb = 'open'\ncoil = 'iron-top-right'", {
        let cut = Latches(Cause::DriverFault, 0.7);
        [Nothing, Nothing, cut, cut, Nothing]
    }),
    (
        "coil",
        "verb = 'stuck-amplifier'\ncoil = 'iron-top-right'",
        [Nothing, Nothing, Latches(Cause::DriverFault, 1.0), Nothing, Latches(Cause::DriverFault, 0.15)],
    ),
    // The planar rig holds its frames where they are.
    ("frame", "verb = 'stalled'\nframe = 'top'", [Nothing; 5]),
];

/// A plan that allows faults and brings none: its only one begins after a day.
const NEVER: &str =
    "description = ''\n[[faults]]\nat_s = 86400.0\nfor_s = 1.0\ntarget = 'poses'\nverb = 'off'\n";

/// What came of a fault.
#[derive(Debug, Default)]
struct Came {
    /// States entered with their causes.
    entered: Vec<(u32, Option<Cause>)>,
    state: u32,
    cause: Option<Cause>,
    /// From the fault's begin until all coils are at zero for good, s.
    zero_after: Option<f64>,
    /// Currents by the plant's truth at the fault's begin, and at most in a state without authority before it.
    current_begin: f64,
}

fn fault(target: &str, verb: &str) -> Fault {
    let text =
        format!("description = ''\n[[faults]]\nat_s = 0.0\nlasting = true\ntarget = '{target}'\n{verb}\n");
    let document = Document::from_text("case.toml", &text).unwrap_or_else(|problems| panic!("{problems}"));
    let plan: FaultPlanConfig = document.read().unwrap_or_else(|problems| panic!("{problems}"));
    let setup = Setup::shipped("bigmag-planar.toml");
    let plan =
        plan.build(&setup.config.description, Reach::Plant).unwrap_or_else(|refused| panic!("{refused:?}"));
    plan.scheduled()[0].fault
}

fn bring_to(bench: &mut Bench, code: u32) {
    let settle = |bench: &mut Bench, verb: Option<Verb>, seconds: f64| {
        verb.into_iter().for_each(|verb| bench.request(verb));
        bench.run(seconds, |_, _| ());
    };
    settle(bench, None, 0.1);
    if code == state::IDLE {
        return;
    }
    settle(bench, Some(Verb::Arm), 0.1);
    if code == state::ARMED {
        return;
    }
    settle(bench, Some(Verb::Go), 0.05);
    for target in [TARGETS_DEG[1], TARGETS_DEG[0]] {
        settle(bench, Some(Verb::SetTarget(directions_planar(target).into())), TARGET_TIME);
    }
    match code {
        state::HOLDING => settle(bench, Some(Verb::Hold), 0.02),
        // The fault begins in the ramp's first cycle but one.
        state::SAFE_STOP => settle(bench, Some(Verb::Stop), 1e-3),
        _ => {}
    }
}

fn play(setup: &Setup, target: &str, verb: &str, code: u32) -> Came {
    let mut bench = Bench::with_faults(setup, Some(NEVER));
    bring_to(&mut bench, code);
    let rig = bench.lockstep.control_loop_mut().hardware_mut();
    let now = rig.plant().now();
    let mut came = Came { current_begin: current(rig), ..Came::default() };
    rig.faults().expect("allowed").begin(fault(target, verb), None, now).expect("the only one");
    let mut before = code;
    let mut at = 0.0;
    let mut look = |record: &CycleRecord, rig: &SimulatedRig| {
        at += 1e-3;
        let decision = &record.decision;
        if decision.state != before {
            came.entered.push((decision.state, decision.transition.and_then(|transition| transition.cause)));
            before = decision.state;
        }
        (came.state, came.cause) = (decision.state, decision.cause);
        if ramp::is_zero(&rig.plant().actual().current_a) {
            came.zero_after.get_or_insert(at);
        } else {
            came.zero_after = None;
        }
    };
    let steps = (WATCHED / TARGET_TIME).round() as usize;
    for step in 0..steps {
        if code == state::ACTIVE {
            let angles = TARGETS_DEG[(step + 1) % 2];
            bench.request(Verb::SetTarget(directions_planar(angles).into()));
        }
        let flow = bench.lockstep.run(TARGET_TIME, |record, rig| {
            look(record, rig);
            ControlFlow::Continue(())
        });
        assert!(flow.is_continue());
    }
    came
}

fn current(rig: &SimulatedRig) -> f64 {
    rig.plant().actual().current_a.iter().fold(0.0, |most, current| most.max(current.abs()))
}

fn hold_to(rows: &[Row]) -> u32 {
    let setup = Setup::shipped("bigmag-planar.toml");
    let (mut cases, mut missed) = (0, Vec::new());
    for (target, verb, columns) in rows {
        for (code, does) in STATES.into_iter().zip(columns) {
            let what = format!("{target}, {}, in {}", verb.replace('\n', ", "), state::name(code));
            let came = play(&setup, target, verb, code);
            println!("{what}: {came:?}");
            let checked = std::panic::catch_unwind(|| {
                assert_eq!(came.current_begin > 1.0, code >= state::ACTIVE, "{what}: {came:?}");
                check(&what, code, does, &came);
            });
            if checked.is_err() {
                missed.push(what);
            }
            cases += 1;
        }
    }
    assert!(missed.is_empty(), "{missed:#?}");
    cases
}

fn check(what: &str, code: u32, does: &Does, came: &Came) {
    let context = format!("{what}: {does:?}, {came:?}");
    let first = came.entered.first().copied();
    let zero_within = |most: f64| assert!(came.zero_after.is_some_and(|zero| zero <= most), "{context}");
    match (*does, code) {
        (Nothing, state::SAFE_STOP) => {
            assert_eq!((came.state, came.cause), (state::IDLE, Some(Cause::OperatorStop)), "{context}");
            zero_within(VALIDITY + RAMP);
        }
        (Nothing, state::ACTIVE) => {
            let steers =
                |(entered, _): &(u32, Option<Cause>)| matches!(*entered, state::ACTIVE | state::HOLDING);
            assert!(came.entered.iter().all(steers), "{context}");
        }
        (Nothing, _) => {
            assert_eq!((came.entered.len(), came.state, came.cause), (0, code, None), "{context}");
        }
        (Latches(cause, zero), _) => {
            assert_eq!((came.state, came.cause), (state::FAULT, Some(cause)), "{context}");
            zero_within(zero);
        }
        (Cuts(cause, zero), _) => {
            let stopped = came.entered.iter().find(|(entered, _)| *entered == state::SAFE_STOP);
            let why = if code == state::SAFE_STOP {
                Some(Cause::OperatorStop)
            } else {
                stopped.and_then(|stop| stop.1)
            };
            assert_eq!(why, Some(cause), "{context}");
            assert_eq!((came.state, came.cause), (state::FAULT, Some(Cause::RampTimeout)), "{context}");
            zero_within(zero);
        }
    }
    // A stop under way is not begun anew, and nothing that was stopped steers again.
    let stops = came.entered.iter().filter(|(entered, _)| *entered == state::SAFE_STOP).count();
    assert!(stops <= usize::from(code != state::SAFE_STOP), "{context}");
    let after_stop = came.entered.iter().skip_while(|(entered, _)| *entered < state::SAFE_STOP);
    assert!(
        after_stop.skip(1).all(|(entered, _)| matches!(*entered, state::IDLE | state::FAULT)),
        "{context}"
    );
    assert!(first.is_some() || matches!(does, Nothing), "{context}");
}

/// Proves SR-10 and SR-11.
#[test]
fn faults_of_poses_stop_what_steers_and_nothing_else() {
    assert_eq!(hold_to(POSES), 65);
}

/// Proves SR-02.
#[test]
fn faults_of_feedback_stop_whoever_holds_authority() {
    assert_eq!(hold_to(FEEDBACK), 45);
}

/// Proves SR-12.
#[test]
fn faults_of_commands_and_actuators_end_at_zero_current_by_the_drivers_own_guard() {
    assert_eq!(hold_to(ACTUATORS), 55);
}
