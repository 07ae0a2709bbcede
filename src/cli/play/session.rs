//! An operator's session: an experiment step by step.

use std::time::Duration;

use anyhow::anyhow;
use magsteer::config::{Experiment, ExperimentStep, Until};
use magsteer::control::plan::Guide;
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{StopFlag, TimingSummary};
use magsteer_hal::HardwareDescription;
use magsteer_hal::Stamp;
use magsteer_hal::channels::{Endpoint, OperatorClient, TruthObserver};
use magsteer_hal::operator::{Cause, OperatorAnswer, OperatorRequest, StatusMessage, cause, state, verdict};

use super::live_line::{LiveLine, live};
use super::watched::Watched;
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::{ANSWER_WAIT, target_request};

/// How often the channels are looked at.
pub(super) const POLL: Duration = Duration::from_millis(5);
/// How long the daemon may say nothing before it counts as gone.
const SILENCE_MAX: Duration = Duration::from_secs(2);
/// How often the live line is drawn anew.
const REDRAW: Duration = Duration::from_millis(100);

/// An experiment as it was played.
pub struct Played {
    /// Names of the magnets, base to tip.
    pub magnets: Vec<String>,
    /// Every step, in order.
    pub steps: Vec<StepResponse>,
    /// True when steps were judged by the plant's true poses, false when by measured ones.
    pub judged_by_truth: bool,
    /// Timing of the daemon's loop so far; `None` when nothing was heard of it.
    pub timing: Option<TimingSummary>,
}

impl Played {
    /// True when every step settled.
    pub fn all_settled(&self) -> bool {
        self.steps.iter().all(|step| step.settled_s.is_some())
    }
}

/// A step under way.
pub(super) struct UnderWay<'a> {
    pub(super) label: &'a str,
    pub(super) rig: &'a HardwareDescription,
    /// Unit tangents, one a magnet.
    pub(super) target: &'a [[f64; 3]],
    pub(super) step: &'a ExperimentStep,
    pub(super) stop: &'a StopFlag,
}

/// What a look at the daemon's status tells of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    UnderWay,
    Over,
    /// The daemon does not go there, or no farther.
    Refused {
        has_begun: bool,
    },
}

/// An operator's session with a daemon.
pub struct Session {
    pub(super) client: OperatorClient,
    truth: Option<TruthObserver>,
}

impl Session {
    /// Joins the channels, waiting up to `wait` for the daemon. With a simulated plant its true poses are watched too.
    ///
    /// # Errors
    /// When there is no daemon.
    pub fn open(endpoint: &Endpoint, wait: Duration) -> anyhow::Result<Self> {
        let client =
            OperatorClient::open(endpoint, wait).map_err(|error| Failure::with(Exit::Unavailable, error))?;
        // A driver of real coils has no truth to offer.
        let truth = TruthObserver::open(endpoint, Duration::ZERO).ok();
        Ok(Self { client, truth })
    }

    /// Plays every step of `experiment`, on ways of `guide` where there is one; stops early when `stop` is set.
    ///
    /// # Errors
    /// When a target is refused, or the daemon stops steering or falls silent.
    pub fn play(
        mut self,
        experiment: &Experiment,
        mut guide: Option<&mut Guide>,
        rig: &HardwareDescription,
        stop: &StopFlag,
    ) -> anyhow::Result<Played> {
        let magnets: Vec<String> = rig.magnets().map(|magnet| magnet.name.clone()).collect();
        let mut steps = Vec::new();
        for (index, step) in experiment.steps.iter().enumerate() {
            let asked = experiment.target(step, rig);
            let label = format!("step {}/{}", index + 1, experiment.steps.len());
            let under_way =
                UnderWay { label: &label, rig, target: &asked.directions[..magnets.len()], step, stop };
            let response = match &mut guide {
                None => {
                    self.send(target_request(&asked, rig), "target")?;
                    self.play_step(&under_way)?
                }
                Some(guide) => {
                    guide.set_out(&asked.directions);
                    self.lead(guide, &under_way)?
                }
            };
            let Some(response) = response else { break };
            steps.push(response);
        }
        let timing = self.client.newest_status(Stamp::now()).map(|status| TimingSummary::of_status(&status));
        Ok(Played { magnets, steps, judged_by_truth: self.truth.is_some(), timing })
    }

    /// Watches one step to its end; `None` when it was broken off.
    fn play_step(&mut self, under_way: &UnderWay<'_>) -> anyhow::Result<Option<StepResponse>> {
        let UnderWay { label, target, step, .. } = under_way;
        let begin = Stamp::now();
        let duration = Duration::from_secs_f64(step.duration_s);
        let mut watched = Watched::new(begin, target);
        let ended = self.see_through(under_way, &mut watched, |watched, status| {
            let refused = status.target_verdict == verdict::REFUSED;
            if refused || status.cause == Cause::NearSnapThrough.code() {
                return Seen::Refused { has_begun: !refused };
            }
            let has_settled = step.until == Some(Until::Settled) && watched.judge.has_settled();
            if has_settled || Stamp::now().since(begin) >= duration { Seen::Over } else { Seen::UnderWay }
        })?;
        match ended {
            Some(Seen::Refused { .. }) => {
                let cause = watched.newest.map_or(0, |status| status.cause);
                let why = anyhow!("{label} was refused: {}", cause::text(cause));
                Err(Failure::with(Exit::No, why))
            }
            ended => Ok(ended.map(|_| watched.judge.verdict())),
        }
    }

    /// Watches the daemon, which steers, until `look` sees an end in a status that began later than this; `None` when it was
    /// broken off.
    ///
    /// # Errors
    /// When the daemon stops steering or falls silent.
    pub(super) fn see_through(
        &mut self,
        under_way: &UnderWay<'_>,
        watched: &mut Watched,
        mut look: impl FnMut(&Watched, &StatusMessage) -> Seen,
    ) -> anyhow::Result<Option<Seen>> {
        let UnderWay { label, rig, target, stop, .. } = *under_way;
        let mut line = LiveLine::new();
        let begin = Stamp::now();
        self.discard_truth();
        loop {
            if stop.requested().is_some() {
                return Ok(None);
            }
            std::thread::sleep(POLL);
            self.watch(watched);
            let heard = watched.newest.map_or(begin, |status| status.header.source_stamp().max(begin));
            if Stamp::now().since(heard) > SILENCE_MAX {
                return Err(Failure::with(Exit::Unavailable, anyhow!("the daemon fell silent")));
            }
            let Some(status) = watched.newest else { continue };
            if !matches!(status.state, state::ACTIVE | state::HOLDING) {
                line.end();
                return Err(stopped(&status));
            }
            let text = || live((label, watched.begin()), rig, target, &status, watched.lateness_max_us);
            if status.header.source_stamp() <= begin {
                continue;
            }
            match look(watched, &status) {
                Seen::UnderWay => line.draw(text, REDRAW),
                seen => {
                    // A refused step did not begin: there is nothing to show of it.
                    if matches!(seen, Seen::Refused { has_begun: false }) {
                        line.erase();
                    } else {
                        line.draw(text, Duration::ZERO);
                        line.end();
                    }
                    return Ok(Some(seen));
                }
            }
        }
    }

    /// Takes over what the step is judged by.
    fn watch(&mut self, watched: &mut Watched) {
        let by_truth = self.truth.is_some();
        self.client.drain_status(Stamp::now(), |status| watched.take(status, by_truth));
        if let Some(truth) = &mut self.truth {
            truth.drain(Stamp::now(), |pose| watched.take_truth(pose));
        }
    }

    fn discard_truth(&mut self) {
        if let Some(truth) = &mut self.truth {
            truth.drain(Stamp::now(), |_| ());
        }
    }

    /// The daemon's answer, whatever it is.
    pub(super) fn ask(&mut self, request: OperatorRequest, name: &str) -> anyhow::Result<OperatorAnswer> {
        let answer = self.client.send(request, ANSWER_WAIT);
        answer.map_err(|error| Failure::with(Exit::Unavailable, anyhow!("{name}: {error}")))
    }

    pub(super) fn send(&mut self, request: OperatorRequest, name: &str) -> anyhow::Result<()> {
        let answer = self.ask(request, name)?;
        if answer.accepted == 1 {
            return Ok(());
        }
        let (reason, state) = (cause::text(answer.cause), state::name(answer.state));
        Err(Failure::with(Exit::No, anyhow!("{name} refused: {reason} (the daemon is {state})")))
    }
}

/// A daemon that steered does no longer.
pub(super) fn stopped(status: &StatusMessage) -> anyhow::Error {
    Failure::with(Exit::No, anyhow!("the daemon stopped steering: it is {}", describe(status)))
}

/// State and cause of a daemon in words.
pub(super) fn describe(status: &StatusMessage) -> String {
    let name = state::name(status.state);
    Cause::from_code(status.cause)
        .map_or_else(|| name.to_owned(), |cause| format!("{name} ({})", cause.text()))
}
