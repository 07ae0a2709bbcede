//! One run: a drawn plant, the controller of the configuration, the experiment in lockstep, judged by the
//! plant's truth.

use std::ops::ControlFlow;

use anyhow::anyhow;
use magsteer::config::{Config, Document, Experiment, Problems};
use magsteer::control::{ControlConfig, Cycle};
use magsteer::daemon::lockstep::{Lockstep, LockstepPlay, PlayEnd, Seen, TimedTarget};
use magsteer::daemon::{DaemonConfig, RunDigest};
use magsteer::math::angle_between;
use magsteer::rod::Manipulator;
use magsteer_hal::operator::state;
use magsteer_sim_plant::SimulatedRig;
use nalgebra::Vector3;

use super::plants::{Drawn, Plants};
use super::row::{Columns, RunRow, values};
use crate::cli::exit::{Exit, Failure};

/// A magnet whose model points farther than this from it at the end of a step is on another equilibrium than
/// the rod: parameters that are off by 20 % make a few degrees.
const MODEL_LOST: f64 = 45.0_f64.to_radians();
/// A magnet that turns farther than this in the last second of a step that did not settle swings on: noise
/// makes tenths of a degree.
const SWINGS_ON: f64 = 5.0_f64.to_radians();

/// Everything that the runs of a campaign share.
pub struct Runner<'a> {
    plants: Plants<'a>,
    control: &'a ControlConfig,
    manipulator: &'a Manipulator,
    daemon: &'a DaemonConfig,
    steps: Vec<TimedTarget>,
    columns: Columns,
    campaign_seed: u64,
}

impl<'a> Runner<'a> {
    /// Takes what a run needs from a configuration.
    ///
    /// # Errors
    /// A table that is missing, and distributions that reach beyond what the plant accepts.
    pub fn new(
        document: &'a Document,
        config: &'a Config,
        experiment: &Experiment,
        campaign_seed: u64,
    ) -> Result<Self, Problems> {
        let magnets: Vec<&str> = config.description.magnets().map(|magnet| magnet.name.as_str()).collect();
        let campaign = document.require("campaign", &config.campaign)?;
        let plants = Plants {
            document,
            description: &config.description,
            nominal: config.nominal(document)?,
            campaign,
        };
        plants.check()?;
        let target = |step| experiment.target(step, &config.description);
        let steps = experiment.steps.iter();
        let steps: Vec<TimedTarget> =
            steps.map(|step| TimedTarget { target: target(step), duration: step.duration_s }).collect();
        let columns = Columns {
            drawn: campaign.draw.iter().map(|draw| draw.key.clone()).collect(),
            steps: steps.len(),
            magnets: magnets.into_iter().map(str::to_owned).collect(),
        };
        Ok(Self {
            plants,
            control: document.require("control", &config.control)?,
            manipulator: document.require("rod", &config.manipulator)?,
            daemon: document.require("daemon", &config.daemon)?,
            steps,
            columns,
            campaign_seed,
        })
    }

    /// The table's columns.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Plays a run; `None` when it `is_over` before its end, which is asked in every cycle.
    ///
    /// # Errors
    /// When the plant refuses what was drawn.
    pub fn play(&self, run: u64, is_over: impl Fn() -> bool) -> anyhow::Result<Option<RunRow>> {
        let drawn = self.plants.draw(self.campaign_seed, run);
        let plant = self.plants.build(&drawn).map_err(|refused| {
            let words = Problems::new(refused).map_or(String::new(), |problems| problems.to_string());
            Failure::with(Exit::Config, anyhow!("run {run}, seed {}: {words}", drawn.seed))
        })?;
        let rig = self.plants.description;
        let cycle = Cycle::new(self.control, rig, self.manipulator.clone());
        let mut lockstep = Lockstep::new(SimulatedRig::new(plant, rig), cycle, rig, self.daemon);
        let mut collector = Collector::new(self);
        let played = lockstep.play(
            &self.steps,
            |rig| rig.plant().truth(),
            |seen| {
                collector.take(seen);
                if is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        );
        if played.end == PlayEnd::BrokenOff {
            return Ok(None);
        }
        Ok(Some(self.row(run, &drawn, &lockstep, &played, collector)))
    }

    fn row(
        &self,
        run: u64,
        drawn: &Drawn,
        lockstep: &Lockstep<SimulatedRig, Cycle>,
        played: &LockstepPlay,
        collector: Collector,
    ) -> RunRow {
        let plant = lockstep.control_loop().hardware().plant();
        let settle = |index: usize| played.steps.get(index).and_then(|step| step.response.settled_s);
        let settle_s: Vec<Option<f64>> = (0..self.steps.len()).map(settle).collect();
        let settled = settle_s.iter().all(Option::is_some);
        let longest = settle_s.iter().flatten().copied().reduce(f64::max);
        let rms_of = |magnet: usize| played.steps.iter().map(move |step| step.response.error_rms_deg[magnet]);
        let magnets = 0..self.columns.magnets.len();
        let pooled = |magnet: usize| {
            let squares: f64 = rms_of(magnet).map(|rms| rms * rms).sum();
            (!played.steps.is_empty()).then(|| (squares / played.steps.len() as f64).sqrt())
        };
        let unsettled = played.steps.iter().filter(|step| step.response.settled_s.is_none());
        let swing = unsettled.map(|step| step.swing).fold(0.0, f64::max);
        let model_error = collector.model_error.iter().copied().fold(0.0, f64::max);
        RunRow {
            run,
            seed: drawn.seed,
            drawn: values(&drawn.values),
            settled,
            steps_settled: settle_s.iter().flatten().count() as u64,
            settle_max_s: longest.filter(|_| settled),
            settle_s,
            rms_max_deg: magnets.clone().flat_map(rms_of).reduce(f64::max),
            rms_deg: magnets.map(pooled).collect(),
            rms_step_deg: (0..self.steps.len())
                .map(|index| {
                    let errors = played.steps.get(index)?.response.error_rms_deg.iter().copied();
                    errors.reduce(f64::max)
                })
                .collect(),
            model_error_deg: model_error.to_degrees(),
            swing_deg: swing.to_degrees(),
            current_max_a: plant.counts().current_max,
            margin_min: collector.margin_min,
            limit_breaks: plant.guard().limit_breaks(),
            holding_s: collector.cycles_holding as f64 * self.daemon.period().as_secs_f64(),
            unstable: played.end != PlayEnd::Complete || model_error > MODEL_LOST || swing > SWINGS_ON,
            end: words(&played.end),
            steps_unsolved: plant.counts().steps_unsolved,
            steps_outside_field_model: plant.counts().steps_outside_field_model,
            simulated_s: lockstep.elapsed(),
            digest: collector.digest.finish(),
        }
    }
}

/// How a run ended, in words.
fn words(end: &PlayEnd) -> String {
    let because = |cause: &Option<magsteer_hal::operator::Cause>| {
        cause.map_or(String::new(), |cause| format!(": {}", cause.text()))
    };
    match end {
        PlayEnd::Complete => "steering".to_owned(),
        PlayEnd::Refused { cause } => format!("refused{}", because(cause)),
        PlayEnd::Stopped { state, cause } => format!("{}{}", state::name(*state), because(cause)),
        PlayEnd::BrokenOff => "broken off".to_owned(),
    }
}

/// What is gathered cycle by cycle.
struct Collector {
    digest: RunDigest,
    cycles_holding: u64,
    /// Of each step: greatest angle between model and truth in its newest cycle, rad.
    model_error: Vec<f64>,
    margin_min: Option<f64>,
}

impl Collector {
    fn new(runner: &Runner<'_>) -> Self {
        Self {
            digest: RunDigest::new(runner.plants.description),
            cycles_holding: 0,
            model_error: vec![0.0; runner.steps.len()],
            margin_min: None,
        }
    }

    fn take(&mut self, seen: &Seen<'_, SimulatedRig>) {
        self.digest.take(seen.record, seen.truth);
        let Some(step) = seen.step else { return };
        self.cycles_holding += u64::from(seen.record.decision.state == state::HOLDING);
        let model = &seen.record.outcome.model;
        if model.converged && self.margin_min.is_none_or(|least| model.margin < least) {
            self.margin_min = Some(model.margin);
        }
        let magnets = &seen.truth.magnets[..seen.truth.magnet_count as usize];
        let errors = seen.record.outcome.predicted.iter().zip(magnets).map(|(predicted, magnet)| {
            angle_between(&Vector3::from(*predicted), &Vector3::from(magnet.tangent()))
        });
        self.model_error[step] = errors.fold(0.0, f64::max);
    }
}
