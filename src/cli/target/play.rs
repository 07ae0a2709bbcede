//! `magsteer target play`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Args;
use magsteer::config::{Config, Document, Experiment, experiment_of_csv};
use magsteer::control::plan::Guide;
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{StopFlag, TimingSummary};
use magsteer_hal::HardwareDescription;
use magsteer_hal::operator::{StatusMessage, state};
use serde::Serialize;

use super::command::{STATUS_WAIT, await_status};
use super::dry_run::{DryRun, Start};
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::connect;
use crate::cli::plan::planner;
use crate::cli::play::{Session, table, timing_line};
use crate::cli::rig_file::RigArgs;
use crate::cli::{data_file, output};

/// Play an experiment: set its targets one after another, and judge how each was reached.
///
/// The daemon must be steering (`arm`, `go`). All steps are walked in the model first, and when one cannot be reached within the
/// limits on a stable way, nothing moves. Steps are judged by measured tangents, or by the true ones of a simulated rig. The last
/// targets stay set. Ends with 0 when every step settled, with 1 when one did not or the daemon stopped steering.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    magsteer arm && magsteer go && magsteer target play config/experiments/planar.toml\n  \
    magsteer target play steps.csv --dry-run\n  \
    magsteer target play steps.csv --plan\n\n\
    CSV: a step a line, columns duration_s,m1_deg,m2_deg (angles about y from z), or m1x,m1y,m1z for directions; frames as\n\
    FRAME_deg; until = settled to go on as soon as a step has settled. TOML: also `until = \"settled\"`.")]
pub struct Play {
    /// Experiment (TOML), or its steps (CSV).
    #[arg(value_name = "STEPS")]
    experiment: PathBuf,
    /// Walk the steps in the model alone, and move nothing. Begins where a daemon's rig is, or at rest where no daemon answers.
    #[arg(long)]
    dry_run: bool,
    /// Find the ways: to every target one is planned from where the rig is, with the frames where they suit, and planned anew when
    /// the daemon refuses a part of it or the magnets end beside the target. Where no way leads on, the currents go to zero and the next
    /// way begins at rest. Needs [control.plan].
    #[arg(long, conflicts_with_all = ["dry_run", "unchecked"])]
    plan: bool,
    /// Play without walking the steps in the model first. The daemon looks at the way to each target all the same.
    #[arg(long, conflicts_with = "dry_run")]
    unchecked: bool,
    #[command(flatten)]
    rig: RigArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are those of `demo --json`; `files` is empty.
#[derive(Serialize)]
struct PlayAnswer<'a> {
    all_settled: bool,
    steps: &'a [StepResponse],
    #[serde(rename = "loop")]
    timing: Option<&'a TimingSummary>,
    files: [&'a str; 0],
    judged_by_truth: bool,
}

impl Play {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (document, config) = self.rig.document(None)?;
        let rig = &config.description;
        let experiment = read(&self.experiment, rig)?;
        let rehearse = |start: Start<'_>| {
            let mut run = DryRun::new(&document, &config, start)?;
            experiment.steps.iter().for_each(|step| run.step(&experiment.target(step, rig)));
            anyhow::Ok(run)
        };
        let status = connect(&self.rig, None).and_then(|mut client| await_status(&mut client));
        if self.dry_run {
            return rehearse(Start::of(status.ok().as_ref()))?.tell(self.json);
        }
        let status = status?;
        require_steering(&status)?;
        if self.plan {
            let guide = guide(&document, &config, &experiment)?;
            return play_and_tell(&self.rig, rig, &experiment, Some(guide), self.json);
        }
        if !self.unchecked && config.control.as_ref().is_some_and(|control| control.scout.is_some()) {
            let run = rehearse(Start::of(Some(&status)))?;
            if !run.is_clear() {
                output::note(run.table());
                let message = anyhow::anyhow!(
                    "nothing was moved: the model does not get through these steps; --unchecked plays them all the same"
                );
                return Err(Failure::with(Exit::No, message));
            }
        }
        play_and_tell(&self.rig, rig, &experiment, None, self.json)
    }
}

/// A guide through the steps of `experiment`.
///
/// # Errors
/// A configuration without `[rod]`, `[control]` or `[control.plan]`; a step that says where the frames shall stand.
pub(super) fn guide(document: &Document, config: &Config, experiment: &Experiment) -> anyhow::Result<Guide> {
    if let Some(step) = experiment.steps.iter().position(|step| !step.frames_deg.is_empty()) {
        let message = anyhow::anyhow!(
            "step {} says where the frames shall stand, which --plan is to find: leave one of them out",
            step + 1
        );
        return Err(Failure::usage(message));
    }
    Ok(Guide::new(planner(document, config)?))
}

/// A daemon that does not steer plays nothing.
pub(super) fn require_steering(status: &StatusMessage) -> anyhow::Result<()> {
    if matches!(status.state, state::ACTIVE | state::HOLDING) {
        return Ok(());
    }
    let state = state::name(status.state);
    let message = anyhow::anyhow!("the daemon is {state}: arm it and let it go before playing");
    Err(Failure::with(Exit::No, message))
}

/// Reads an experiment, or the steps of one from a file whose name ends in `.csv`.
fn read(path: &Path, rig: &HardwareDescription) -> anyhow::Result<Experiment> {
    let is_csv = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv"));
    if !is_csv {
        return Experiment::load(path, rig).map_err(Failure::data);
    }
    let bytes = data_file::read(path)?;
    experiment_of_csv(&bytes, rig).map_err(|refusal| data_file::refuse(path, &refusal))
}

/// Plays an experiment on the rig's daemon, which must be steering, and prints how it went.
pub(super) fn play_and_tell(
    rig: &RigArgs,
    description: &HardwareDescription,
    experiment: &Experiment,
    mut guide: Option<Guide>,
    json: bool,
) -> anyhow::Result<Exit> {
    let endpoint = rig.endpoint(None)?;
    let stop = Arc::new(StopFlag::new());
    let played = watching(
        &stop,
        false,
        || (),
        || Session::open(&endpoint, STATUS_WAIT)?.play(experiment, guide.as_mut(), description, &stop),
    )??;
    if stop.requested().is_some() {
        output::note("broken off; the last targets stay set");
        return Ok(exit_of(&stop));
    }
    if json {
        output::told(output::json(&PlayAnswer {
            all_settled: played.all_settled(),
            steps: &played.steps,
            timing: played.timing.as_ref(),
            files: [],
            judged_by_truth: played.judged_by_truth,
        }))?;
    } else {
        let timing = played.timing.as_ref().map_or(String::new(), timing_line);
        let text = format_args!("\n{}\n{timing}", table(&played));
        output::told(output::result(text).map_err(Into::into))?;
    }
    Ok(if played.all_settled() { Exit::Success } else { Exit::No })
}
