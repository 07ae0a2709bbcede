//! A recorded run, as far as its figures need it.

use std::path::Path;

use anyhow::anyhow;
use hdrhistogram::Histogram;
use magsteer::config::{Config, Document};
use magsteer::daemon::latency_histogram;
use magsteer::daemon::step_response::{Judge, Observation, StepResponse};
use magsteer::recording::{Counts, Cycle, Info, Recording};
use magsteer_hal::MAGNETS_MAX;
use magsteer_hal::operator::state;

use crate::cli::exit::{Exit, Failure};
use crate::cli::runs::refused_recording;

/// Samples a second that figures show, and of a whole run, at most.
const SHOWN_HZ: f64 = 100.0;
const SAMPLES_MAX: u64 = 20_000;
/// A target that stood shorter than this is no step, s.
const STEP_MIN: f64 = 0.3;

/// One moment of the run. Directions are unit vectors in the world frame, one a magnet.
pub struct Sample {
    /// Since the recording began, s.
    pub time: f64,
    pub target: Vec<[f64; 3]>,
    pub measured: Vec<[f64; 3]>,
    pub predicted: Vec<[f64; 3]>,
    /// Measured, A.
    pub currents: Vec<f64>,
    /// Measured, rad.
    pub angles: Vec<f64>,
    pub margin: f64,
    pub condition: f64,
    /// Most currents and angles at a limit of value or rate in a cycle since the sample before.
    pub at_limit: u32,
    pub steers: bool,
}

/// A target while it was steered to.
pub struct Step {
    pub target: Vec<[f64; 3]>,
    /// Since the recording began, s.
    pub begin: f64,
    pub end: f64,
    /// Judged by measured tangents.
    pub response: StepResponse,
}

/// Times of all cycles, ns: a run of hours fits too.
pub struct Times {
    pub lateness: Histogram<u64>,
    pub execution: Histogram<u64>,
    /// Age of the newest poses in each cycle that had any, as `magsteer run` tells it.
    pub pose_age: Histogram<u64>,
}

impl Times {
    fn new() -> Self {
        let [lateness, execution, pose_age] = std::array::from_fn(|_| latency_histogram());
        Self { lateness, execution, pose_age }
    }
}

/// Something that happened.
pub struct TimedEvent {
    /// Since the recording began, s.
    pub time: f64,
    pub text: String,
}

/// What is known of a run.
pub struct Run {
    pub info: Info,
    pub description: String,
    pub config: Config,
    pub counts: Counts,
    pub events: Vec<TimedEvent>,
    pub samples: Vec<Sample>,
    pub steps: Vec<Step>,
    pub times: Times,
}

impl Run {
    /// Reads a recording, or a run's folder.
    ///
    /// # Errors
    /// No such file; a recording that cannot be read, or whose configuration this program refuses.
    pub fn open(path: &Path) -> anyhow::Result<Self> {
        let recording = Recording::open(path).map_err(refused_recording)?;
        let name = format!("{} (its configuration)", recording.path().display());
        let config = Config::from_document(&Document::from_text(name, recording.config_text())?)?;
        let info = recording.info().clone();
        let counts = recording.counts().map_err(refused_recording)?;
        let mut gathered = Gathered::new(&info, counts.cycles);
        for cycle in recording.cycles().map_err(refused_recording)? {
            gathered.take(&cycle.map_err(refused_recording)?);
        }
        let Gathered { samples, steps, times, .. } = gathered.ended();
        if samples.is_empty() {
            let message = anyhow!("{}: holds no cycle", recording.path().display());
            return Err(Failure::with(Exit::Data, message));
        }
        let begin_ns = counts.first_ns.saturating_add(info.wall_offset_ns);
        let events = recording.events().map_err(refused_recording)?.into_iter().map(|event| TimedEvent {
            time: event.wall_ns.saturating_sub(begin_ns) as f64 * 1e-9,
            text: event.text,
        });
        let events = events.collect();
        Ok(Self {
            description: recording.description().to_owned(),
            counts,
            info,
            config,
            events,
            samples,
            steps,
            times,
        })
    }

    /// Names of the magnets, base to tip.
    pub fn magnets(&self) -> &[String] {
        &self.info.magnets
    }
}

/// A step under way.
struct Under {
    target: Vec<[f64; 3]>,
    begin: f64,
    judge: Judge,
}

struct Gathered {
    stride: u64,
    count: u64,
    first_ns: Option<u64>,
    time: f64,
    samples: Vec<Sample>,
    steps: Vec<Step>,
    under: Option<Under>,
    times: Times,
    /// The most at a limit since the last sample.
    at_limit: u32,
}

impl Gathered {
    fn new(info: &Info, cycles: u64) -> Self {
        let by_rate = (info.rate_hz / SHOWN_HZ).ceil().max(1.0) as u64;
        Self {
            stride: by_rate.max(cycles.div_ceil(SAMPLES_MAX)),
            count: 0,
            first_ns: None,
            time: 0.0,
            samples: Vec::new(),
            steps: Vec::new(),
            under: None,
            times: Times::new(),
            at_limit: 0,
        }
    }

    fn take(&mut self, cycle: &Cycle) {
        let first = *self.first_ns.get_or_insert(cycle.now_ns);
        self.time = cycle.now_ns.saturating_sub(first) as f64 * 1e-9;
        self.times.lateness.saturating_record(cycle.lateness_ns);
        self.times.execution.saturating_record(cycle.execution_ns);
        if cycle.pose_received == 1 {
            self.times.pose_age.saturating_record(cycle.now_ns.saturating_sub(cycle.pose_stamp_ns));
        }
        self.at_limit = self.at_limit.max(cycle.saturated);
        self.take_step(cycle);
        if self.count.is_multiple_of(self.stride) {
            self.samples.push(Sample {
                time: self.time,
                target: cycle.target.clone(),
                measured: cycle.measured.clone(),
                predicted: cycle.predicted.clone(),
                currents: cycle.measured_a.clone(),
                angles: cycle.measured_rad.clone(),
                margin: cycle.stability_margin,
                condition: cycle.condition,
                at_limit: std::mem::take(&mut self.at_limit),
                steers: cycle.engaged == 1,
            });
        }
        self.count += 1;
    }

    fn take_step(&mut self, cycle: &Cycle) {
        let steers = matches!(cycle.state, state::ACTIVE | state::HOLDING);
        let is_set = cycle.target.iter().all(|direction| *direction != [0.0; 3]);
        if self.under.as_ref().is_some_and(|under| !steers || under.target != cycle.target) {
            self.end_step();
        }
        if !steers || !is_set {
            return;
        }
        let under = self.under.get_or_insert_with(|| Under {
            target: cycle.target.clone(),
            begin: self.time,
            judge: Judge::new(&cycle.target),
        });
        let mut tangent = [[0.0; 3]; MAGNETS_MAX];
        tangent.iter_mut().zip(&cycle.measured).for_each(|(to, from)| *to = *from);
        let current = cycle.measured_a.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
        under.judge.take(&Observation { time: self.time - under.begin, tangent, current });
    }

    fn end_step(&mut self) {
        let Some(Under { target, begin, judge }) = self.under.take() else { return };
        if self.time - begin >= STEP_MIN {
            self.steps.push(Step { target, begin, end: self.time, response: judge.verdict() });
        }
    }

    fn ended(mut self) -> Self {
        self.end_step();
        self
    }
}
