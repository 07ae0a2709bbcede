//! `magsteer demo`: plant and daemon as two processes, the planar experiment, a table and a report.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use magsteer::config::{Config, Experiment};
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{RunReport, StopFlag};
use magsteer_hal::HardwareDescription;
use magsteer_hal::operator::verb;
use serde::Serialize;

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure, cannot_create};
use super::output;
use super::pair::Pair;
use super::play::{Played, table, timing_line};
use super::run_folder::dated;
use super::shipped;
use super::sim_plant::PlantReport;

/// How long the rig may take until it can be armed.
const READY_WAIT: Duration = Duration::from_secs(5);
/// Steer two magnets on a simulated rig: plant and daemon as two processes that meet in shared memory alone.
///
/// Plays the planar experiment in real time, judges every step by the plant's true poses, and makes the run's report. Ends with 0
/// when every step settled, with 1 when one did not.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer demo\n  magsteer demo --config config/bigmag-planar-camera.toml --json"
)]
pub struct Demo {
    /// Configuration; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Experiment; config/experiments/planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    experiment: Option<PathBuf>,
    /// Folder for this run's files; a dated one below `runs` when left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys of `demo --json`; `plant` stands beside them.
#[derive(Serialize)]
struct Answer<'a> {
    all_settled: bool,
    steps: &'a [StepResponse],
    #[serde(rename = "loop")]
    timing: &'a magsteer::daemon::TimingSummary,
    files: &'a [PathBuf],
    judged_by_truth: bool,
    daemon: &'a RunReport,
    plant: &'a PlantReport,
}

impl Demo {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let document = shipped::config(self.config.as_deref())?;
        let config = Config::from_document(&document)?;
        let experiment =
            shipped::experiment(self.experiment.as_deref(), &config.description).map_err(Failure::data)?;
        let folder = self.folder()?;
        let recording = recording(&folder);
        let stop = Arc::new(StopFlag::new());
        let (played, daemon, plant) = watching(
            &stop,
            false,
            || (),
            || {
                let mut pair = Pair::start(&document, &config, &folder, &[], recording.is_some())?;
                let played = play(&mut pair, &experiment, &config.description, &stop);
                let reports = pair.end();
                reports.iter().for_each(|(daemon, _)| tell_flights(daemon));
                // Why it could not be played says more than what the children made of that.
                let played = played?;
                let (daemon, plant) = reports?;
                anyhow::Ok((played, daemon, plant))
            },
        )??;
        let Some(played) = played else { return Ok(interrupted(&stop, &daemon, &plant)) };
        let mut files = if recording.is_some() { report(&folder)? } else { Vec::new() };
        files.extend(recording);
        self.print(&played, &daemon, &plant, &files)?;
        let is_sound = played.all_settled() && daemon.is_clean() && plant.limit_breaks == 0;
        Ok(if is_sound { Exit::Success } else { Exit::No })
    }

    /// Makes the folder for this run.
    fn folder(&self) -> anyhow::Result<PathBuf> {
        let folder = self.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(dated("demo")));
        std::fs::create_dir_all(&folder).map_err(|error| cannot_create(&folder, &error))?;
        Ok(folder)
    }

    fn print(
        &self,
        played: &Played,
        daemon: &RunReport,
        plant: &PlantReport,
        files: &[PathBuf],
    ) -> anyhow::Result<()> {
        if !daemon.realtime.is_granted() {
            output::note(format_args!("the daemon ran without all of real time: {}", daemon.realtime));
        }
        if self.json {
            return output::json(&Answer {
                all_settled: played.all_settled(),
                steps: &played.steps,
                timing: &daemon.timing,
                files,
                judged_by_truth: played.judged_by_truth,
                daemon,
                plant,
            });
        }
        let mut text = format!("{}\n{}", table(played), timing_line(&daemon.timing));
        text += &format!(
            "plant: {} commands beyond a limit, largest current {:.2} A\n",
            plant.limit_breaks, plant.current_max_a
        );
        // Of the report its page alone: the rest stands beside it.
        let told = |file: &&PathBuf| file.extension().is_some_and(|kind| kind == "html" || kind == "mcap");
        for file in files.iter().filter(told) {
            text += &format!("{}\n", file.display());
        }
        text += if played.all_settled() { "every step settled\n" } else { "NOT every step settled\n" };
        Ok(output::result(text)?)
    }
}

/// Where this run is recorded. A folder that is used again keeps its former recording, and this run has none.
#[cfg(feature = "record")]
fn recording(folder: &Path) -> Option<PathBuf> {
    let file = folder.join(magsteer::recording::RECORDING);
    if file.exists() {
        output::note(format_args!("{}: is there already: this run is not recorded", file.display()));
        return None;
    }
    Some(file)
}

/// This build records nothing.
#[cfg(not(feature = "record"))]
fn recording(_: &Path) -> Option<PathBuf> {
    None
}

/// Says where the daemon wrote what it saw before it tripped.
fn tell_flights(daemon: &RunReport) {
    for flight in &daemon.flights {
        output::note(format_args!(
            "the daemon tripped; its last cycles: magsteer runs show {}",
            flight.display()
        ));
    }
}

/// The end of a demonstration that was broken off.
fn interrupted(stop: &StopFlag, daemon: &RunReport, plant: &PlantReport) -> Exit {
    if !plant.ended_currentless {
        output::error("interrupted, and the plant did not end at zero current");
        return Exit::No;
    }
    let ramp =
        daemon.ramp_down_ms.map_or(String::new(), |duration| format!(", ramped down in {duration:.1} ms"));
    output::note(format_args!("interrupted: every coil is at zero current{ramp}"));
    exit_of(stop)
}

/// Plays the experiment; `None` when it was told to stop on the way.
fn play(
    pair: &mut Pair,
    experiment: &Experiment,
    description: &HardwareDescription,
    stop: &StopFlag,
) -> anyhow::Result<Option<Played>> {
    let Some(mut session) = pair.ready(stop)? else { return Ok(None) };
    session.arm(READY_WAIT)?;
    session.request(verb::GO, "go")?;
    let played = session.play(experiment, None, description, stop).map_err(|error| pair.explain(error))?;
    Ok(stop.requested().is_none().then_some(played))
}

/// Makes the report of what was recorded.
#[cfg(all(feature = "figures", feature = "record"))]
fn report(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let run = super::report::Run::open(folder)?;
    super::report::write(&run, &super::report::beside(folder))
}

/// This build draws nothing.
#[cfg(not(all(feature = "figures", feature = "record")))]
fn report(_: &Path) -> anyhow::Result<Vec<PathBuf>> {
    Ok(Vec::new())
}
