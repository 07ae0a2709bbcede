//! The daemon's loop in lockstep: plays an experiment under stepped time, as fast as the machine allows and
//! the same every time.
//!
//! Terms: the *truth* is what the hardware knows of the magnets and no message tells; a *watcher* is called
//! after every cycle and may break off.
//!
//! Method: each cycle runs at a tick of the nominal grid, never late. An experiment waits until the driver
//! was heard, arms, goes, then sets one target after another and judges every step by the truth. A loop that
//! stops steering by itself plays the step out, so that its ramp to zero is seen, and nothing after it.
//!
//! What is absent: a clock, and any name of a plant: whatever implements [`Hardware`] and advances by the
//! stamps that it is given will do.

use std::ops::ControlFlow;
use std::time::Duration;

use magsteer_hal::operator::{Cause, state};
use magsteer_hal::{Hardware, HardwareDescription, MAGNETS_MAX, PoseMessage, Stamp};

use super::clock::Tick;
use super::config::DaemonConfig;
use super::control_loop::{ControlLoop, LoopOptions, Occupied};
use super::cycle_record::CycleRecord;
use super::state::{Request, Verb};
use super::step_response::{Judge, Observation, StepResponse};
use crate::control::{ReferenceTarget, Step};

/// Time for the first feedback and poses, s: many periods of the slowest sensor.
const BOOT_TIME: f64 = 0.5;
/// Time for the driver to confirm authority, s: above any `arm_timeout_ms` that makes sense.
const ARM_TIME: f64 = 0.5;
/// Time between going and the first target, s.
const GO_TIME: f64 = 0.1;
/// When the first cycle runs: any moment but zero, which the transport takes for "no stamp".
const BEGIN: Stamp = Stamp::from_nanoseconds(1_000_000_000);

/// A target, and how long it is steered to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedTarget {
    /// Desired tangents, and frame angles if any are planned.
    pub target: ReferenceTarget,
    /// Time until the next target, s.
    pub duration: f64,
}

/// One cycle as a watcher sees it.
#[derive(Debug)]
pub struct Seen<'a, H> {
    /// Index of the step under way; `None` before the first.
    pub step: Option<usize>,
    /// The cycle.
    pub record: &'a CycleRecord,
    /// True poses of the magnets after it.
    pub truth: &'a PoseMessage,
    /// The hardware after it.
    pub hardware: &'a H,
}

/// One step as it was played.
#[derive(Debug, Clone, PartialEq)]
pub struct LockstepStep {
    /// How the loop answered.
    pub response: StepResponse,
    /// Farthest that a magnet turned from where it was at the step's end, within the last second, rad.
    pub swing: f64,
}

/// How an experiment ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlayEnd {
    /// Every step was played while steering.
    Complete,
    /// It did not start to steer, or refused a target.
    Refused {
        /// Why, as far as the loop says.
        cause: Option<Cause>,
    },
    /// The loop stopped steering by itself.
    Stopped {
        /// State code at the end.
        state: u32,
        /// Why.
        cause: Option<Cause>,
    },
    /// The watcher broke off.
    BrokenOff,
}

/// An experiment as it was played.
#[derive(Debug, Clone, PartialEq)]
pub struct LockstepPlay {
    /// Every step begun and not broken off, in order.
    pub steps: Vec<LockstepStep>,
    /// How it ended.
    pub end: PlayEnd,
}

/// A control loop whose time is stepped.
#[derive(Debug)]
pub struct Lockstep<H, S> {
    control_loop: ControlLoop<H, S>,
    tick: Tick,
    period: Duration,
    requests: u32,
    cycles: u64,
    magnets: usize,
    /// Why the last request was refused, since the experiment began.
    refused: Option<Cause>,
    /// Cause of the last stop or fault.
    cause: Option<Cause>,
}

impl<H: Hardware, S: Step> Lockstep<H, S> {
    /// A loop about to run its first cycle.
    #[must_use]
    pub fn new(hardware: H, controller: S, description: &HardwareDescription, config: &DaemonConfig) -> Self {
        let options = LoopOptions::default();
        Self {
            control_loop: ControlLoop::new(hardware, controller, description, config, options),
            tick: Tick::first(BEGIN),
            period: config.period(),
            requests: 0,
            cycles: 0,
            magnets: description.magnets().count(),
            refused: None,
            cause: None,
        }
    }

    /// Runs one cycle.
    pub fn cycle(&mut self) -> CycleRecord {
        let record = self.control_loop.cycle(self.tick);
        self.tick = self.tick.stepped(self.period);
        self.cycles += 1;
        let refused = record.decision.answers.iter().flatten().find_map(|answer| answer.refused);
        self.refused = refused.or(record.decision.given_up).or(self.refused);
        self.cause = record.decision.cause;
        record
    }

    /// Runs cycles for a time in seconds, until `look` breaks off.
    pub fn run(
        &mut self,
        seconds: f64,
        mut look: impl FnMut(&CycleRecord, &H) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let cycles = (seconds / self.period.as_secs_f64()).round() as u64;
        for _ in 0..cycles {
            let record = self.cycle();
            look(&record, self.control_loop.hardware())?;
        }
        ControlFlow::Continue(())
    }

    /// Asks for something in the next cycle.
    ///
    /// # Errors
    /// When something was asked for that cycle already.
    pub fn request(&mut self, verb: Verb) -> Result<(), Occupied> {
        self.requests += 1;
        self.control_loop.request(Request { id: self.requests, verb })
    }

    /// Arms, goes, and steers through `steps`, each judged by `truth`. Time before it, and other experiments,
    /// are the caller's.
    pub fn play(
        &mut self,
        steps: &[TimedTarget],
        truth: impl Fn(&H) -> PoseMessage,
        mut watch: impl FnMut(&Seen<'_, H>) -> ControlFlow<()>,
    ) -> LockstepPlay {
        let mut played = Vec::with_capacity(steps.len());
        self.refused = None;
        let start = [(None, BOOT_TIME), (Some(Verb::Arm), ARM_TIME), (Some(Verb::Go), GO_TIME)];
        for (verb, seconds) in start {
            verb.into_iter().for_each(|verb| self.ask(verb));
            let flow = self.run(seconds, |record, hardware| {
                watch(&Seen { step: None, record, truth: &truth(hardware), hardware })
            });
            if flow.is_break() {
                return LockstepPlay { steps: played, end: PlayEnd::BrokenOff };
            }
        }
        for (index, step) in steps.iter().enumerate() {
            if self.end_after(index) != PlayEnd::Complete {
                break;
            }
            self.ask(Verb::SetTarget(step.target));
            let mut judge = Judge::new(&step.target.directions[..self.magnets]);
            let (magnets, period) = (self.magnets, self.period.as_secs_f64());
            let mut cycles = 0.0;
            let flow = self.run(step.duration, |record, hardware| {
                let truth = truth(hardware);
                judge.take(&observation(cycles * period, &truth, magnets, record));
                cycles += 1.0;
                watch(&Seen { step: Some(index), record, truth: &truth, hardware })
            });
            if flow.is_break() {
                return LockstepPlay { steps: played, end: PlayEnd::BrokenOff };
            }
            played.push(LockstepStep { swing: judge.swing(), response: judge.verdict() });
        }
        LockstepPlay { end: self.end_after(played.len()), steps: played }
    }

    /// As [`Self::request`]; what cannot be asked counts as refused.
    fn ask(&mut self, verb: Verb) {
        if self.request(verb).is_err() {
            self.refused = Some(Cause::Busy);
        }
    }

    /// How an experiment would have ended after so many steps.
    fn end_after(&self, steps: usize) -> PlayEnd {
        let state = self.control_loop.state().code();
        let steers = matches!(state, state::ACTIVE | state::HOLDING);
        match self.refused {
            None if steers => PlayEnd::Complete,
            None if steps > 0 => PlayEnd::Stopped { state, cause: self.cause },
            refused => PlayEnd::Refused { cause: refused.or(self.cause) },
        }
    }

    /// The loop.
    pub fn control_loop(&self) -> &ControlLoop<H, S> {
        &self.control_loop
    }

    /// The loop, to disturb it.
    pub fn control_loop_mut(&mut self) -> &mut ControlLoop<H, S> {
        &mut self.control_loop
    }

    /// Time stepped so far, s.
    #[must_use]
    pub fn elapsed(&self) -> f64 {
        self.cycles as f64 * self.period.as_secs_f64()
    }
}

fn observation(time: f64, truth: &PoseMessage, magnets: usize, record: &CycleRecord) -> Observation {
    let mut tangent = [[0.0; 3]; MAGNETS_MAX];
    for (tangent, magnet) in tangent.iter_mut().zip(&truth.magnets).take(magnets) {
        *tangent = magnet.tangent();
    }
    let currents = record.input.measured.current_a;
    let current = currents.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
    Observation { time, tangent, current }
}

#[cfg(test)]
mod tests {
    use magsteer_hal::scripted::{EchoHardware, example_description};
    use magsteer_hal::{Actuation, MagnetPose};

    use super::*;
    use crate::control::{CycleInput, CycleOutcome};
    use crate::daemon::config::tests::shipped;

    const UP: [f64; 3] = [0.0, 0.0, 1.0];

    /// Asks for one ampere, and after some engaged cycles for what is not a number.
    struct Failing {
        engaged_left: u32,
    }

    impl Step for Failing {
        fn step(&mut self, input: &CycleInput) -> CycleOutcome {
            let mut request = Actuation::default();
            self.engaged_left = self.engaged_left.saturating_sub(u32::from(input.engaged));
            request.current_a[0] = if self.engaged_left == 0 { f64::NAN } else { 1.0 };
            CycleOutcome::asking_for(request)
        }
    }

    fn lockstep(engaged_left: u32) -> Lockstep<EchoHardware, Failing> {
        let rig = example_description();
        Lockstep::new(EchoHardware::new(&rig), Failing { engaged_left }, &rig, &shipped())
    }

    fn upright(_: &EchoHardware) -> PoseMessage {
        let magnet = MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
        PoseMessage { magnet_count: 2, magnets: [magnet; MAGNETS_MAX], ..PoseMessage::default() }
    }

    fn targets(count: usize) -> Vec<TimedTarget> {
        vec![TimedTarget { target: [UP; MAGNETS_MAX].into(), duration: 0.3 }; count]
    }

    /// Goal: the watcher sees every cycle, those before the first step among them, and steps are judged by
    /// the truth.
    #[test]
    fn an_experiment_is_armed_played_and_judged_by_the_truth() {
        let mut lockstep = lockstep(u32::MAX);
        let mut cycles = [0_u32; 3];
        let played = lockstep.play(&targets(2), upright, |seen| {
            cycles[seen.step.map_or(0, |step| step + 1)] += 1;
            ControlFlow::Continue(())
        });
        assert_eq!(played.end, PlayEnd::Complete);
        assert_eq!(cycles, [1100, 300, 300]);
        assert!((lockstep.elapsed() - 1.7).abs() < 1e-9);
        for step in &played.steps {
            assert_eq!((step.response.settled_s, step.swing), (Some(0.0), 0.0));
            assert_eq!(step.response.current_max_a, 1.0);
        }
    }

    /// Goal: a loop that trips in the second of three steps plays that step out and ends there, with its
    /// cause.
    #[test]
    fn a_loop_that_stops_by_itself_plays_the_step_out() {
        let mut lockstep = lockstep(100 + 300 + 50);
        let played = lockstep.play(&targets(3), upright, |_| ControlFlow::Continue(()));
        assert_eq!(played.steps.len(), 2);
        let PlayEnd::Stopped { state, cause } = played.end else { panic!("{:?}", played.end) };
        assert_eq!((state, cause), (state::FAULT, Some(Cause::RequestNotFinite)));
        let current = lockstep.cycle().input.measured.current_a[0];
        assert!(current.abs() < 0.1, "ramped down: {current} A");
    }

    #[test]
    fn a_watcher_breaks_off_at_once() {
        let mut lockstep = lockstep(u32::MAX);
        let mut cycles = 0;
        let played = lockstep.play(&targets(2), upright, |_| {
            cycles += 1;
            if cycles == 1234 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((played.end, cycles, played.steps.len()), (PlayEnd::BrokenOff, 1234, 0));
    }

    /// Goal: a target that is no direction is refused, and no step is played towards it.
    #[test]
    fn a_refused_target_ends_the_experiment() {
        let mut lockstep = lockstep(u32::MAX);
        let targets = [TimedTarget { target: [[0.0; 3]; MAGNETS_MAX].into(), duration: 0.3 }; 2];
        let played = lockstep.play(&targets, upright, |_| ControlFlow::Continue(()));
        assert_eq!(played.end, PlayEnd::Refused { cause: Some(Cause::TargetInvalid) });
        assert_eq!(played.steps.len(), 1);
    }
}
