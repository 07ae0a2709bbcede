//! An operator that brings a daemon to where it steers, plays an experiment over and over, and counts what
//! becomes of it.
//!
//! Method: looked at often, it does what the daemon's state asks for: arm, go, set the next target; after a
//! trip reset, where it was told to recover. A *trip* is the daemon's leaving the states in which it steers,
//! whoever is the cause.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use magsteer::config::Experiment;
use magsteer::daemon::step_response::{Judge, Observation};
use magsteer_hal::channels::{Endpoint, OperatorClient, TruthObserver};
use magsteer_hal::operator::{Cause, OperatorRequest, StatusMessage, cause, state, verb};
use magsteer_hal::{HardwareDescription, Stamp};

use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::{ANSWER_WAIT, target_request};
use crate::cli::output;

/// How long the daemon may say nothing before it counts as gone.
const SILENCE_MAX: Duration = Duration::from_secs(5);
/// Between two requests that bring the daemon back to steering.
const ASK_PAUSE: Duration = Duration::from_millis(50);
/// How long it may take until the daemon steers.
const STEER_WAIT: Duration = Duration::from_secs(60);

/// What became of steps and trips.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tally {
    pub settled: u64,
    pub unsettled: u64,
    pub trips: u64,
    /// How often for which cause.
    pub causes: BTreeMap<&'static str, u64>,
}

/// A step under way.
#[derive(Debug)]
struct Step {
    begin: Stamp,
    duration: Duration,
    judge: Judge,
    current: f64,
}

/// The operator.
pub struct Steering<'a> {
    client: OperatorClient,
    truth: Option<TruthObserver>,
    experiment: &'a Experiment,
    rig: &'a HardwareDescription,
    recovers: bool,
    /// Number of the step under way, or to come.
    index: usize,
    step: Option<Step>,
    /// The daemon was seen to steer since it was asked to.
    engaged: bool,
    last_engaged: Instant,
    last_asked: Instant,
    lost: Option<&'static str>,
    tally: Tally,
}

impl<'a> Steering<'a> {
    /// Joins the channels, waiting up to `wait` for the daemon. `recovers`: resets and arms again after a
    /// trip.
    ///
    /// # Errors
    /// When there is no daemon.
    pub fn open(
        endpoint: &Endpoint,
        wait: Duration,
        experiment: &'a Experiment,
        rig: &'a HardwareDescription,
        recovers: bool,
    ) -> anyhow::Result<Self> {
        let client =
            OperatorClient::open(endpoint, wait).map_err(|error| Failure::with(Exit::Unavailable, error))?;
        // A driver of real coils has no truth to offer.
        let truth = TruthObserver::open(endpoint, Duration::ZERO).ok();
        let now = Instant::now();
        Ok(Self {
            client,
            truth,
            experiment,
            rig,
            recovers,
            index: 0,
            step: None,
            engaged: false,
            last_engaged: now,
            last_asked: now,
            lost: None,
            tally: Tally::default(),
        })
    }

    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// True while the daemon steers.
    pub fn is_engaged(&self) -> bool {
        self.engaged
    }

    /// Why steering ended for good; `None` while it goes on.
    pub fn lost(&self) -> Option<&'static str> {
        self.lost
    }

    /// The daemon's newest status.
    pub fn status(&mut self) -> Option<StatusMessage> {
        self.client.newest_status(Stamp::now())
    }

    /// Takes over what arrived, and does what is to be done. To be called many times a second.
    ///
    /// # Errors
    /// When the daemon falls silent, or does not come to steer.
    pub fn poll(&mut self) -> anyhow::Result<()> {
        self.observe();
        let now = Stamp::now();
        let status = self.client.newest_status(now);
        let heard = status.map(|status| Stamp::from_nanoseconds(status.header.publish_stamp_ns));
        let silent = heard.map_or(self.last_engaged.elapsed(), |heard| now.since(heard));
        if silent > SILENCE_MAX {
            return Err(Failure::with(Exit::Unavailable, anyhow!("the daemon fell silent")));
        }
        let Some(status) = status else { return Ok(()) };
        if matches!(status.state, state::ACTIVE | state::HOLDING) {
            self.engaged = true;
            self.last_engaged = Instant::now();
            self.go_on();
            return Ok(());
        }
        if std::mem::take(&mut self.engaged) {
            self.note_trip(&status);
        }
        if self.lost.is_none() && self.last_asked.elapsed() >= ASK_PAUSE {
            self.bring_back(&status);
            self.last_asked = Instant::now();
        }
        if self.last_engaged.elapsed() > STEER_WAIT {
            let (found, why) = (state::name(status.state), cause::text(status.cause));
            let text = anyhow!(
                "the daemon did not come to steer within {} s: it is {found} ({why})",
                STEER_WAIT.as_secs()
            );
            return Err(Failure::with(Exit::No, text));
        }
        Ok(())
    }

    /// Asks for the last seconds of every cycle and waits until they are written; false when they are not.
    pub fn save(&mut self, wait: Duration) -> bool {
        let written = |this: &mut Self| this.status().map_or(0, |status| status.flights);
        let before = written(self);
        if !self.ask(verb::SAVE) {
            return false;
        }
        let begin = Instant::now();
        while begin.elapsed() < wait {
            if written(self) > before {
                return true;
            }
            std::thread::sleep(ASK_PAUSE);
        }
        false
    }

    /// Ramps down a daemon that goes on by itself; false when it was not seen to be at rest in time.
    pub fn ramp_down(&mut self, wait: Duration) -> bool {
        let begin = Instant::now();
        let mut asked = false;
        while begin.elapsed() < wait {
            asked = asked || self.ask(verb::STOP);
            let rests = |status: StatusMessage| matches!(status.state, state::IDLE | state::FAULT);
            if self.status().is_some_and(rests) {
                return true;
            }
            std::thread::sleep(ASK_PAUSE);
        }
        false
    }

    /// Hands poses and currents to the judge of the step under way.
    fn observe(&mut self) {
        let now = Stamp::now();
        let by_truth = self.truth.is_some();
        let step = &mut self.step;
        self.client.drain_status(now, |status| {
            let Some(step) = step else { return };
            step.current =
                status.measured.current_a.iter().fold(0.0, |most: f64, current| most.max(current.abs()));
            if !by_truth {
                step.take(status.header.source_stamp(), status.measured_direction);
            }
        });
        if let Some(truth) = &mut self.truth {
            truth.drain(now, |pose| {
                let Some(step) = step else { return };
                step.take(pose.header.source_stamp(), pose.magnets.map(|magnet| magnet.tangent()));
            });
        }
    }

    /// Sees the step under way to its end, then begins the next.
    fn go_on(&mut self) {
        let Some(step) = &self.step else {
            // A step whose target is refused takes its time too, and does not settle.
            self.set_target();
            self.begin_step();
            return;
        };
        if Stamp::now().since(step.begin) >= step.duration {
            let settled = step.judge.verdict().settled_s.is_some();
            self.count_step(settled);
            self.step = None;
        }
    }

    fn count_step(&mut self, settled: bool) {
        self.tally.settled += u64::from(settled);
        self.tally.unsettled += u64::from(!settled);
        self.index = (self.index + 1) % self.experiment.steps.len();
    }

    fn begin_step(&mut self) {
        let step = &self.experiment.steps[self.index];
        let target = self.experiment.target(step, self.rig).directions;
        self.step = Some(Step {
            begin: Stamp::now(),
            duration: Duration::from_secs_f64(step.duration_s),
            judge: Judge::new(&target[..self.rig.magnets().count()]),
            current: 0.0,
        });
    }

    fn note_trip(&mut self, status: &StatusMessage) {
        self.step = None;
        self.tally.trips += 1;
        let why = Cause::from_code(status.cause).map_or("unknown", Cause::text);
        *self.tally.causes.entry(why).or_default() += 1;
        if !self.recovers {
            self.lost = Some(why);
        }
    }

    /// One request towards steering; whether it was done shows in the next status.
    fn bring_back(&mut self, status: &StatusMessage) {
        match status.state {
            state::IDLE => _ = self.ask(verb::ARM),
            state::ARMED => _ = self.set_target() && self.ask(verb::GO),
            state::FAULT if self.recovers => _ = self.ask(verb::RESET),
            _ => {}
        }
    }

    /// False when the target was refused, which is told.
    fn set_target(&mut self) -> bool {
        let step = &self.experiment.steps[self.index];
        let asked = self.experiment.target(step, self.rig);
        let answer = self.client.send(target_request(&asked, self.rig), ANSWER_WAIT);
        if let Some(answer) = answer.as_ref().ok().filter(|answer| answer.accepted != 1) {
            output::note(format_args!(
                "step {}: target refused: {}",
                self.index + 1,
                cause::text(answer.cause)
            ));
        }
        answer.is_ok_and(|answer| answer.accepted == 1)
    }

    fn ask(&mut self, verb: u32) -> bool {
        let request = OperatorRequest { verb, ..OperatorRequest::default() };
        self.client.send(request, ANSWER_WAIT).is_ok_and(|answer| answer.accepted == 1)
    }
}

impl Step {
    fn take(&mut self, stamp: Stamp, tangent: [[f64; 3]; magsteer_hal::MAGNETS_MAX]) {
        // One of the step before may still have been under way.
        if stamp >= self.begin {
            let time = stamp.since(self.begin).as_secs_f64();
            self.judge.take(&Observation { time, tangent, current: self.current });
        }
    }
}
