//! Plays an experiment as an operator: sets targets through the channels, watches, and judges each step.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use magsteer::config::Experiment;
use magsteer::daemon::step_response::{Observation, StepResponse, judge};
use magsteer::daemon::target::angle_from_z_deg;
use magsteer::daemon::{LatencySummary, StopFlag, TimingSummary};
use magsteer_hal::channels::{Endpoint, OperatorClient, TruthObserver};
use magsteer_hal::message::PoseMessage;
use magsteer_hal::operator::{Cause, OperatorAnswer, OperatorRequest, StatusMessage, state, verb};
use magsteer_hal::{Actuation, MAGNETS_MAX, Stamp};

use super::exit::{Exit, Failure};
use super::output;

/// How long an operator waits for an answer; without one the request is not done.
pub const ANSWER_WAIT: Duration = Duration::from_millis(400);
/// How long the daemon may say nothing before it counts as gone.
const SILENCE_MAX: Duration = Duration::from_secs(2);
/// How often the channels are looked at.
const POLL: Duration = Duration::from_millis(5);
/// How often the live line is drawn anew.
const REDRAW: Duration = Duration::from_millis(100);

pub type Directions = [[f64; 3]; MAGNETS_MAX];

/// One status of the daemon, as far as pictures need it.
#[cfg_attr(not(feature = "figures"), expect(dead_code, reason = "pictures alone read all of it"))]
pub struct Sample {
    /// Time since the experiment began, s.
    pub time_s: f64,
    /// Targets.
    pub target: Directions,
    /// Measured tangents.
    pub measured: Directions,
    /// Predicted tangents.
    pub predicted: Directions,
    /// Measured currents and angles.
    pub actuation: Actuation,
}

/// One step as it was played.
#[cfg_attr(not(feature = "figures"), expect(dead_code, reason = "pictures alone read all of it"))]
pub struct PlayedStep {
    /// How it went.
    pub response: StepResponse,
    /// Its targets.
    pub target: Directions,
    /// When it ended, s since the experiment began.
    pub end_s: f64,
}

/// An experiment as it was played.
#[cfg_attr(not(feature = "figures"), expect(dead_code, reason = "pictures alone read all of it"))]
pub struct Played {
    /// Every step, in order.
    pub steps: Vec<PlayedStep>,
    /// Every status seen.
    pub samples: Vec<Sample>,
    /// True when steps were judged by the plant's true poses, false when by measured ones.
    pub judged_by_truth: bool,
    /// Timing of the daemon's loop so far; `None` when nothing was heard of it.
    pub timing: Option<TimingSummary>,
}

impl Played {
    /// True when every step settled.
    pub fn all_settled(&self) -> bool {
        self.steps.iter().all(|step| step.response.settled_s.is_some())
    }
}

/// An operator's session with a daemon.
pub struct Session {
    client: OperatorClient,
    truth: Option<TruthObserver>,
    begin: Stamp,
    samples: Vec<Sample>,
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
        Ok(Self { client, truth, begin: Stamp::now(), samples: Vec::new() })
    }

    /// Asks for `verb`.
    ///
    /// # Errors
    /// When the daemon does not answer, or refuses: the message carries its reason.
    #[cfg(feature = "sim")]
    pub fn request(&mut self, verb: u32, name: &str) -> anyhow::Result<()> {
        self.send(OperatorRequest { verb, ..OperatorRequest::default() }, name)
    }

    /// Arms, again and again for up to `wait`: a rig that has just started may not have seen its first poses yet.
    ///
    /// # Errors
    /// The last refusal.
    #[cfg(feature = "sim")]
    pub fn arm(&mut self, wait: Duration) -> anyhow::Result<()> {
        let deadline = Instant::now() + wait;
        loop {
            match self.request(verb::ARM, "arm") {
                Err(_) if Instant::now() < deadline => std::thread::sleep(10 * POLL),
                outcome => return outcome,
            }
        }
    }

    /// Waits for a status of any state.
    ///
    /// # Errors
    /// When none comes within `wait`.
    pub fn wait_for_status(&mut self, wait: Duration) -> anyhow::Result<StatusMessage> {
        use state::{ACTIVE, ARMED, BOOT, FAULT, HOLDING, IDLE, SAFE_STOP};
        self.wait_for(&[BOOT, IDLE, ARMED, ACTIVE, HOLDING, SAFE_STOP, FAULT], wait)
    }

    /// Waits until the daemon is in one of `states`.
    ///
    /// # Errors
    /// When it is not within `wait`.
    pub fn wait_for(&mut self, states: &[u32], wait: Duration) -> anyhow::Result<StatusMessage> {
        let deadline = Instant::now() + wait;
        let mut last = None;
        while Instant::now() < deadline {
            last = self.client.newest_status(Stamp::now());
            if let Some(status) = last.filter(|status| states.contains(&status.state)) {
                return Ok(status);
            }
            std::thread::sleep(POLL);
        }
        let wanted: Vec<&str> = states.iter().map(|state| state::name(*state)).collect();
        let found = last.map_or("silent".to_owned(), |status| describe(&status));
        Err(Failure::with(
            Exit::Unavailable,
            anyhow!(
                "the daemon is {found}; expected {} within {} s",
                wanted.join(" or "),
                wait.as_secs_f64()
            ),
        ))
    }

    /// Plays every step of `experiment`; stops early when `stop` is set.
    ///
    /// # Errors
    /// When a target is refused, or the daemon stops steering or falls silent.
    pub fn play(
        mut self,
        experiment: &Experiment,
        magnets: &[&str],
        stop: &StopFlag,
    ) -> anyhow::Result<Played> {
        self.begin = Stamp::now();
        let mut steps = Vec::new();
        for (index, step) in experiment.steps.iter().enumerate() {
            let target = experiment.directions(step, magnets);
            let magnet_count = u32::try_from(magnets.len())?;
            let request = OperatorRequest { verb: verb::SET_TARGET, magnet_count, direction: target };
            self.send(request, "target")?;
            let label = format!("step {}/{}", index + 1, experiment.steps.len());
            let duration = Duration::from_secs_f64(step.duration_s);
            let Some(response) = self.play_step(&label, &target[..magnets.len()], duration, stop)? else {
                break;
            };
            let end_s = Stamp::now().since(self.begin).as_secs_f64();
            steps.push(PlayedStep { response, target, end_s });
        }
        let timing = self.client.newest_status(Stamp::now()).map(|status| TimingSummary::of_status(&status));
        Ok(Played { steps, samples: self.samples, judged_by_truth: self.truth.is_some(), timing })
    }

    /// Watches one step to its end; `None` when it was broken off.
    fn play_step(
        &mut self,
        label: &str,
        target: &[[f64; 3]],
        duration: Duration,
        stop: &StopFlag,
    ) -> anyhow::Result<Option<StepResponse>> {
        let mut line = LiveLine::new();
        let begin = Stamp::now();
        let mut watched = Watched::new(begin);
        self.discard_truth();
        while Stamp::now().since(begin) < duration {
            if stop.requested().is_some() {
                return Ok(None);
            }
            std::thread::sleep(POLL);
            self.watch(&mut watched);
            let Some(status) = watched.newest else {
                if Stamp::now().since(begin) > SILENCE_MAX {
                    return Err(Failure::with(Exit::Unavailable, anyhow!("the daemon fell silent")));
                }
                continue;
            };
            if !matches!(status.state, state::ACTIVE | state::HOLDING) {
                line.end();
                let why = anyhow!("the daemon stopped steering: it is {}", describe(&status));
                return Err(Failure::with(Exit::No, why));
            }
            if Stamp::now().since(status.header.source_stamp()) > SILENCE_MAX {
                return Err(Failure::with(Exit::Unavailable, anyhow!("the daemon fell silent")));
            }
            line.draw(|| live(label, begin, target, &status, watched.lateness_max_us), REDRAW);
        }
        let Some(end) = watched.newest else {
            let why = anyhow!(
                "nothing was heard of the daemon during {label}: is the step longer than its status period?"
            );
            return Err(Failure::with(Exit::Unavailable, why));
        };
        line.draw(|| live(label, begin, target, &end, watched.lateness_max_us), Duration::ZERO);
        line.end();
        Ok(Some(judge(target, &watched.observations)))
    }

    /// Takes over what arrived: statuses for pictures, and what the step is judged by.
    fn watch(&mut self, watched: &mut Watched) {
        let begin = self.begin;
        let by_truth = self.truth.is_some();
        let samples = &mut self.samples;
        self.client.drain_status(Stamp::now(), |status| {
            samples.push(Sample {
                time_s: status.header.source_stamp().since(begin).as_secs_f64(),
                target: status.target_direction,
                measured: status.measured_direction,
                predicted: status.predicted_direction,
                actuation: status.measured,
            });
            watched.take(status, by_truth);
        });
        if let Some(truth) = &mut self.truth {
            truth.drain(Stamp::now(), |pose| watched.take_truth(pose));
        }
    }

    fn discard_truth(&mut self) {
        if let Some(truth) = &mut self.truth {
            truth.drain(Stamp::now(), |_| ());
        }
    }

    fn send(&mut self, request: OperatorRequest, name: &str) -> anyhow::Result<()> {
        let answer = self
            .client
            .send(request, ANSWER_WAIT)
            .map_err(|error| Failure::with(Exit::Unavailable, anyhow!("{name}: {error}")))?;
        refusal(&answer).map_or(Ok(()), |reason| {
            Err(Failure::with(
                Exit::No,
                anyhow!("{name} refused: {reason} (the daemon is {})", state::name(answer.state)),
            ))
        })
    }
}

/// Why an answer is a refusal; `None` for an accepted request.
pub fn refusal(answer: &OperatorAnswer) -> Option<&'static str> {
    let text = || Cause::from_code(answer.cause).map_or("for a reason unknown to this version", Cause::text);
    (answer.accepted != 1).then(text)
}

/// State and cause of a daemon in words.
fn describe(status: &StatusMessage) -> String {
    let name = state::name(status.state);
    Cause::from_code(status.cause)
        .map_or_else(|| name.to_owned(), |cause| format!("{name} ({})", cause.text()))
}

/// What was seen of one step.
struct Watched {
    begin: Stamp,
    newest: Option<StatusMessage>,
    current: f64,
    lateness_max_us: f64,
    observations: Vec<Observation>,
}

impl Watched {
    fn new(begin: Stamp) -> Self {
        Self { begin, newest: None, current: 0.0, lateness_max_us: 0.0, observations: Vec::new() }
    }

    fn take(&mut self, status: &StatusMessage, by_truth: bool) {
        let stamp = status.header.source_stamp();
        // A status of the step before may still have been under way.
        if stamp < self.begin {
            return;
        }
        self.current = status.measured.current_a.iter().fold(0.0, |most, current| most.max(current.abs()));
        self.lateness_max_us = self.lateness_max_us.max(status.lateness_max_us);
        self.newest = Some(*status);
        if !by_truth {
            self.observe(stamp, status.measured_direction);
        }
    }

    fn take_truth(&mut self, pose: &PoseMessage) {
        let stamp = pose.header.source_stamp();
        if stamp >= self.begin {
            self.observe(stamp, pose.magnets.map(|magnet| tangent(&magnet.orientation_xyzw)));
        }
    }

    fn observe(&mut self, stamp: Stamp, tangent: Directions) {
        let time = stamp.since(self.begin).as_secs_f64();
        self.observations.push(Observation { time, tangent, current: self.current });
    }
}

/// Third column of a unit quaternion's rotation.
fn tangent([x, y, z, w]: &[f64; 4]) -> [f64; 3] {
    [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]
}

fn live(
    label: &str,
    begin: Stamp,
    target: &[[f64; 3]],
    status: &StatusMessage,
    lateness_max_us: f64,
) -> String {
    let degrees = |directions: &[[f64; 3]]| -> String {
        let shown = |direction| format!("{:6.1}", angle_from_z_deg(direction).unwrap_or(f64::NAN));
        directions.iter().map(shown).collect()
    };
    let coils = (status.coil_count as usize).min(status.measured.current_a.len());
    let currents: String =
        status.measured.current_a[..coils].iter().map(|current| format!("{current:6.2}")).collect();
    format!(
        "{label} {:5.2} s  target{} deg  measured{} deg  currents{currents} A  loop {:.0} Hz  late {:.0} us, at most {lateness_max_us:.0} us",
        Stamp::now().since(begin).as_secs_f64(),
        degrees(target),
        degrees(&status.measured_direction[..target.len()]),
        status.rate_measured_hz,
        status.lateness_us,
    )
}

/// A line on standard error that is drawn over and over on a terminal, and once elsewhere.
struct LiveLine {
    is_terminal: bool,
    drawn: Option<Instant>,
    text: String,
}

impl LiveLine {
    fn new() -> Self {
        Self { is_terminal: std::io::stderr().is_terminal(), drawn: None, text: String::new() }
    }

    fn draw(&mut self, text: impl FnOnce() -> String, every: Duration) {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < every) {
            return;
        }
        self.drawn = Some(Instant::now());
        self.text = text();
        if self.is_terminal {
            let _ = write!(std::io::stderr(), "\r\x1b[2K{}", self.text);
        }
    }

    fn end(&mut self) {
        if self.is_terminal {
            let _ = writeln!(std::io::stderr());
        } else if !self.text.is_empty() {
            output::note(&self.text);
        }
    }
}

/// A line on the loop's timing.
pub fn timing_line(timing: &TimingSummary) -> String {
    let row = |latency: &LatencySummary| {
        format!("p50 {:.0} us, p99 {:.0} us, max {:.0} us", latency.p50, latency.p99, latency.max)
    };
    format!(
        "loop at {:.0} Hz: {} cycles, {} missed; lateness {}; execution {}; pose to command {}\n",
        timing.rate_hz,
        timing.cycles,
        timing.missed,
        row(&timing.lateness_us),
        row(&timing.execution_us),
        row(&timing.pose_to_command_us),
    )
}

/// The table of an experiment's steps.
pub fn table(played: &Played) -> String {
    let mut text = String::from(
        "target (deg)        settled after  error mean (deg)    error RMS (deg)     largest current\n",
    );
    for step in &played.steps {
        let response = &step.response;
        let list = |values: &[f64], digits: usize| {
            let parts: Vec<String> = values.iter().map(|value| format!("{value:.digits$}")).collect();
            parts.join("  ")
        };
        let settled = response.settled_s.map_or("not settled".to_owned(), |time| format!("{time:.2} s"));
        text += &format!(
            "{:<18}  {:<13}  {:<18}  {:<18}  {:.2} A\n",
            list(&response.target_deg, 0),
            settled,
            list(&response.error_mean_deg, 2),
            list(&response.error_rms_deg, 2),
            response.current_max_a,
        );
    }
    text
}
