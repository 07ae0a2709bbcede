//! One fault in a loop that steers: what came of it, and whether it can be mended.

use std::ops::ControlFlow;

use magsteer::control::Directions;
use magsteer::daemon::lockstep::Lockstep;
use magsteer::daemon::{CycleRecord, Verb};
use magsteer_hal::MAGNETS_MAX;
use magsteer_hal::operator::{Cause, state};
use magsteer_sim_plant::SimulatedRig;
use magsteer_sim_plant::ramp;

use crate::rig_support::{Bench, Setup};

/// When the fault begins, s: the rod has come most of the way to a target. Sensors frozen half way are
/// contradicted by neither target.
const ONSET: f64 = 2.3;
/// How long an episode is watched, s; one that has come to its end not so long.
const WATCHED: f64 = 2.0;
/// How long a latched fault with all coils at zero is watched, s.
const REST: f64 = 0.05;
/// `ramp_timeout_ms` of the shipped file, s.
const RAMP_TIMEOUT: f64 = 1.0;
/// Two pairs of angles, deg from z in the plane, and how long each is steered to, s.
const TARGETS_DEG: [[f64; 2]; 2] = [[70.0, 100.0], [95.0, 75.0]];
const TARGET_TIME: f64 = 0.5;

/// How the daemon is to answer.
#[derive(Debug, Clone, Copy)]
pub enum Answer {
    /// It goes on; `holds` when it holds in between for want of poses.
    SteersOn { holds: bool },
    /// It stops for `cause` with all coils at zero within a time, s, from the fault's begin, and latches a
    /// fault.
    Stops { cause: Cause, latched: Cause, zero_after: f64 },
}

/// A state entered, and when after the fault's begin, s.
#[derive(Debug, Clone, PartialEq)]
struct Entered {
    at: f64,
    state: u32,
    cause: Option<Cause>,
}

/// What happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Episode {
    what: String,
    entered: Vec<Entered>,
    /// From the fault's begin until all coils are at zero for good, s.
    zero_after: Option<f64>,
    pub commands_refused: u64,
    limit_breaks: u64,
    current_max: f64,
    begun: u64,
    effects: u64,
    /// State codes once the fault is cleared: after a while, and after reset, arm and go.
    mended: [u32; 4],
    refused_before: Option<Cause>,
}

type Loop = Lockstep<SimulatedRig, magsteer::control::Cycle>;

impl Episode {
    /// Steers, lets a fault begin and stay, and mends it in the end.
    pub fn of(target: &str, verb: &str) -> Self {
        let setup = Setup::shipped("bigmag-planar.toml");
        let text = format!(
            "description = ''\n[[faults]]\nat_s = {ONSET}\nlasting = true\ntarget = '{target}'\n{verb}\n"
        );
        let mut bench = Bench::with_faults(&setup, Some(&text));
        let lockstep = &mut bench.lockstep;
        let mut episode = Self {
            what: format!("{target}, {}", verb.replace('\n', ", ")),
            entered: Vec::new(),
            zero_after: None,
            commands_refused: 0,
            limit_breaks: 0,
            current_max: 0.0,
            begun: 0,
            effects: 0,
            mended: [0; 4],
            refused_before: None,
        };
        start(lockstep);
        episode.watch(lockstep);
        episode.mend(lockstep);
        episode.count(lockstep);
        episode
    }

    /// Steers to and fro through the fault.
    fn watch(&mut self, lockstep: &mut Loop) {
        let mut before = state::ACTIVE;
        let (begin, end) = (lockstep.elapsed(), ONSET + WATCHED);
        let mut cycles = 0.0;
        for step in 0.. {
            let left = end - lockstep.elapsed();
            if left < 0.5e-3 {
                break;
            }
            let target = Verb::SetTarget(directions(TARGETS_DEG[step % 2]).into());
            lockstep.request(target).expect("one request a step");
            _ = lockstep.run(TARGET_TIME.min(left), |record, rig| {
                cycles += 1.0;
                let at = begin + cycles * 1e-3 - ONSET;
                self.look(record, rig, at, &mut before);
                let rests = self.zero_after.is_some_and(|zero| at > zero + REST);
                let latched = self.entered.last().is_some_and(|last| last.at < at - REST);
                if before == state::FAULT && rests && latched {
                    return ControlFlow::Break(());
                }
                ControlFlow::Continue(())
            });
            if before == state::FAULT && self.zero_after.is_some() {
                break;
            }
        }
    }

    fn look(&mut self, record: &CycleRecord, rig: &SimulatedRig, at: f64, before: &mut u32) {
        let decision = &record.decision;
        assert!(at > 0.0 || decision.state == state::ACTIVE, "{}: steers before the fault", self.what);
        if decision.state != *before {
            *before = decision.state;
            let cause = decision.transition.and_then(|transition| transition.cause);
            self.entered.push(Entered { at, state: decision.state, cause });
        }
        // Garbage never gets past the receiver: what the controller is given is finite and near the
        // workspace.
        for magnet in record.input.pose.iter().flat_map(|pose| pose.magnets) {
            assert!(magnet.position_m.iter().all(|value| value.abs() < 0.12), "{}", self.what);
            assert!(magnet.orientation_xyzw.iter().all(|value| value.abs() <= 1.0), "{}", self.what);
        }
        assert!(record.input.measured.current_a.iter().all(|current| current.is_finite()));
        let currents = &rig.plant().actual().current_a;
        self.current_max = currents.iter().fold(self.current_max, |most, current| most.max(current.abs()));
        if !ramp::is_zero(currents) {
            self.zero_after = None;
        } else if at > 0.0 {
            self.zero_after.get_or_insert(at);
        }
    }

    /// Asks for a reset while the fault is there, then clears it, waits, and starts again.
    fn mend(&mut self, lockstep: &mut Loop) {
        let settled = |lockstep: &mut Loop, seconds: f64| {
            _ = lockstep.run(seconds, |_, _| ControlFlow::Continue(()));
            lockstep.control_loop().state().code()
        };
        if lockstep.control_loop().state().code() == state::FAULT {
            lockstep.request(Verb::Reset).expect("one request");
            let answers = lockstep.cycle().decision.answers;
            self.refused_before = answers.into_iter().flatten().find_map(|answer| answer.refused);
        }
        let rig = lockstep.control_loop_mut().hardware_mut();
        let counts = rig.faults().expect("allowed").counts();
        self.begun = counts.begun;
        self.effects = counts.poses.altered
            + counts.poses.withheld
            + counts.feedback.altered
            + counts.feedback.withheld
            + counts.commands_altered
            + counts.setpoints_altered;
        let now = rig.plant().now();
        rig.faults().expect("allowed").clear(now);
        // A driver's fault stands for half a second at least.
        self.mended[0] = settled(lockstep, 0.6);
        for (place, verb) in [(1, Verb::Reset), (2, Verb::Arm), (3, Verb::Go)] {
            lockstep.request(verb).expect("one request");
            self.mended[place] = settled(lockstep, 0.2);
        }
    }

    fn count(&mut self, lockstep: &Loop) {
        let feedback = lockstep.control_loop().hardware().plant().feedback();
        (self.commands_refused, self.limit_breaks) = (feedback.commands_refused, feedback.limit_breaks);
    }

    /// Holds the episode to what the daemon is to do.
    pub fn expect(&self, answer: &Answer) {
        let what = format!("{}: {self:?}", self.what);
        println!("{what}");
        assert_eq!(self.begun, 1, "the fault began: {what}");
        let physical = self.what.starts_with("coil") || self.what.starts_with("frame");
        assert_eq!(
            self.effects > 0,
            !physical,
            "the fault had an effect on what crosses the channels: {what}"
        );
        assert_eq!(self.limit_breaks, 0, "{what}");
        assert!(self.current_max <= 8.0, "{what}");
        let states: Vec<u32> = self.entered.iter().map(|entered| entered.state).collect();
        match *answer {
            Answer::SteersOn { holds } => {
                let steering = |code: &u32| matches!(*code, state::ACTIVE | state::HOLDING);
                assert!(states.iter().all(steering), "{what}");
                assert_eq!(states.contains(&state::HOLDING), holds, "{what}");
            }
            Answer::Stops { cause, latched, zero_after } => {
                let stop = self.entered.iter().find(|entered| entered.state >= state::SAFE_STOP);
                let stop = stop.expect("a stop");
                assert_eq!(stop.cause, Some(cause), "{what}");
                let last = self.entered.last().expect("a stop");
                assert_eq!((last.state, last.cause), (state::FAULT, Some(latched)), "{what}");
                assert!(
                    self.zero_after.is_some_and(|zero| zero <= zero_after),
                    "at most {zero_after} s: {what}"
                );
                for held in self.entered.iter().filter(|entered| entered.state == state::HOLDING) {
                    // What befalls currents moves the model at once and the rod later.
                    let swings =
                        !self.what.starts_with("poses") && held.cause == Some(Cause::PoseImplausible);
                    assert!(held.cause == Some(cause) || swings, "{what}");
                }
                let cut_after = last.at - stop.at;
                assert!(cut_after < RAMP_TIMEOUT + 0.01, "{what}");
                assert!(latched != Cause::RampTimeout || cut_after > RAMP_TIMEOUT, "{what}");
                // Nothing resumes by itself; once the fault is gone, a reset works.
                let start = [state::FAULT, state::IDLE, state::ARMED, state::ACTIVE];
                let was_reset = self.refused_before.is_none();
                assert_eq!(self.mended[0], if was_reset { state::IDLE } else { state::FAULT }, "{what}");
                assert_eq!(self.mended[1..], start[1..], "{what}");
            }
        }
    }
}

/// Arms, goes, and steers until a while before the fault.
fn start(lockstep: &mut Loop) {
    for (verb, seconds) in [(None, 0.5), (Some(Verb::Arm), 0.25), (Some(Verb::Go), 0.25)] {
        if let Some(verb) = verb {
            lockstep.request(verb).expect("one request");
        }
        _ = lockstep.run(seconds, |_, _| ControlFlow::Continue(()));
    }
    assert_eq!(lockstep.control_loop().state().code(), state::ACTIVE);
}

fn directions(angles_deg: [f64; 2]) -> Directions {
    let mut directions = [[0.0; 3]; MAGNETS_MAX];
    for (direction, angle) in directions.iter_mut().zip(angles_deg) {
        *direction = [angle.to_radians().sin(), 0.0, angle.to_radians().cos()];
    }
    directions
}
