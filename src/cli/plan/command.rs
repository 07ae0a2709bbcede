//! The subcommand.

use std::path::PathBuf;

use clap::{Args, value_parser};

use super::answer::Answer;
use super::choice::Choice;
use super::frames::NamedAngles;
use super::search::{Search, in_threads};
use super::subject::Subject;
use crate::cli::exit::Exit;
use crate::cli::output;

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
            let fixed =
                if self.best_fixed { Some(super::search::best_fixed(planner, &targets)) } else { held };
            let search = match fixed {
                Some(setting) => Search::Held(setting),
                None if self.path => Search::OneAfterAnother,
                None => Search::FromRest,
            };
            (search.run(planner, &targets), fixed)
        })?;
        let answer =
            Answer::new(&subject.description, &targets, &found, fixed.as_ref().map(<[f64; _]>::as_slice));
        if self.json {
            output::json(&answer)?;
        } else {
            output::result(answer.table())?;
        }
        Ok(if answer.all_reached() { Exit::Success } else { Exit::No })
    }
}
