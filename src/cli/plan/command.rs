//! The subcommand.

use std::path::{Path, PathBuf};

use clap::{Args, value_parser};
use magsteer::config::Experiment;

use super::answer::Answer;
use super::choice::Choice;
use super::frames::NamedAngles;
use super::search::{Found, Search, best_fixed, in_threads};
use super::subject::Subject;
use super::way;
use crate::cli::actuation::finite;
use crate::cli::exit::Exit;
use crate::cli::{data_file, output};

/// Frame angles, currents and a way for each of a set of targets.
///
/// Every setting of the frames on the grid of [control.plan] is tried by continuation of equilibria of the model; of those that
/// arrive, within the limits of the currents and on a stable branch all the way, the one is taken that leaves the currents most
/// power to undo disturbances. Ends with 0 when every target was reached, with 1 when some were not.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    magsteer plan config/bigmag-planar.toml targets.csv --json\n  \
    magsteer plan config/bigmag-planar.toml --cone 30 --count 200 --seed 7\n  \
    magsteer plan config/bigmag-planar.toml targets.csv --path\n  \
    magsteer plan config/bigmag-planar.toml --cone 60 --count 50 --best-fixed\n\n\
    JSON: targets[].{reached, error_deg, currents_a, angles_deg, current_max_a, condition, stability_margin, reason,\n\
    directions, waypoints, home, path_current_max_a, path_margin_min, expected_power_a2}, reached_fraction,\n\
    reached_interval, frames, fixed_angles_deg, elapsed_s, processor_s.")]
pub struct Plan {
    /// Configuration of the rig (TOML), with [control.plan].
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    choice: Choice,
    /// Plan each target from rest; what is done when nothing else is said.
    #[arg(long, conflicts_with_all = ["path", "fixed_frames", "best_fixed"])]
    from_rest: bool,
    /// Plan from each target to the next, the first from rest.
    #[arg(long, conflicts_with_all = ["fixed_frames", "best_fixed"])]
    path: bool,
    /// Hold all frames at one setting, deg: what an array without motors would reach.
    #[arg(
        long,
        value_name = "NAME=DEG,...",
        visible_alias = "hold-frames",
        allow_hyphen_values = true,
        conflicts_with = "best_fixed"
    )]
    fixed_frames: Option<NamedAngles>,
    /// Hold all frames at that setting of the grid with which most of the targets are reached.
    #[arg(long)]
    best_fixed: bool,
    /// Write an experiment that plays the ways, for `magsteer target play`.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["fixed_frames", "best_fixed"])]
    out: Option<PathBuf>,
    /// Time that magnets settle in at every step of the experiment, s.
    #[arg(long, value_name = "S", default_value = "3", requires = "out", value_parser = settle)]
    settle_s: f64,
    /// Threads; as many as there are cores when left out.
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Plan {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let subject = Subject::load(&self.file)?;
        let held = self.fixed_frames.as_ref();
        let held = held.map(|angles| angles.for_rig("--fixed-frames", &subject.description)).transpose()?;
        let targets = self.choice.targets(&subject)?;
        let planner = &subject.planner;
        let (found, fixed) = in_threads(self.threads, || {
            let fixed = if self.best_fixed { Some(best_fixed(planner, &targets)) } else { held };
            let search = match fixed {
                Some(setting) => Search::Held(setting),
                None if self.path => Search::OneAfterAnother,
                None => Search::FromRest,
            };
            (search.run(planner, &targets), fixed)
        })?;
        let answer =
            Answer::new(&subject.description, &targets, &found, fixed.as_ref().map(<[f64; _]>::as_slice));
        if let Some(out) = &self.out {
            self.write(out, &subject, &found)?;
        }
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.table())?;
        }
        Ok(if answer.all_reached() { Exit::Success } else { Exit::No })
    }

    fn write(&self, out: &Path, subject: &Subject, found: &Found) -> anyhow::Result<()> {
        if found.reached() == 0 {
            output::note(format_args!("{}: not written: no target was reached", out.display()));
            return Ok(());
        }
        let rest = &subject.planner.rest().posture;
        let text = way::experiment(&subject.description, rest, &found.plans, !self.path, self.settle_s);
        data_file::create(out, text.as_bytes())?;
        // What cannot be played must not lie about as if it could.
        Experiment::load(out, &subject.description)?;
        Ok(())
    }
}

/// Time to settle in, s.
fn settle(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value > 0.0 && value <= 3600.0 {
        Ok(value)
    } else {
        Err("must be above 0 and at most 3600".to_owned())
    }
}
