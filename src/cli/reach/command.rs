//! The subcommand.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Args, value_parser};
use magsteer::control::plan::{Plan, Unreached};

use super::sample::{Sample, draw, edges};
use super::survey::Survey;
use super::table;
use crate::cli::exit::{Exit, Failure};
use crate::cli::plan::{Search, Subject, half_angle, in_threads};
use crate::cli::{data_file, output};

/// Map of reachable orientations: what share of targets about rest is reached, with what currents, margin and conditioning.
///
/// Directions of all magnets are drawn at random and planned for as `magsteer plan` does. Shares are by solid angle, whatever the
/// draws, and come with 95 % intervals. Ends with 0 when the map is made, whatever it shows.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    magsteer reach config/bigmag-planar.toml --samples 400 --picture reach.png\n  \
    magsteer reach config/bigmag-parallel.toml --cone 30 --out map\n\n\
    JSON: samples, reached_fraction, reached_interval, rings[].{from_deg, to_deg, samples, reached, reached_fraction,\n\
    reached_interval}, cones[], obstacles[].{obstacle, count}, path_current_max_a.{min, p50, p95, max}, path_margin_min,\n\
    condition, elapsed_s, processor_s, files.")]
pub struct Reach {
    /// Configuration of the rig (TOML), with [control.plan].
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Targets to try.
    #[arg(long, value_name = "N", default_value = "400", value_parser = value_parser!(u32).range(1..=1_000_000))]
    samples: u32,
    /// Farthest angle of each magnet from its rest direction, deg.
    #[arg(long, value_name = "DEG", default_value = "60", value_parser = half_angle)]
    cone: f64,
    /// Seed of the draws.
    #[arg(long, value_name = "SEED", default_value = "1")]
    seed: u64,
    /// Threads; as many as there are cores when left out.
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Folder for the samples (reach.csv) and the picture (reach.png); made when it is not there.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draw the map (PNG).
    #[cfg(feature = "figures")]
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Reach {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let subject = Subject::load(&self.file)?;
        if let Some(folder) = &self.out {
            // Before the work: who cannot be given its result shall not wait for it.
            fs::create_dir_all(folder).map_err(|error| {
                Failure::with(Exit::CannotCreate, anyhow!("{}: cannot be created: {error}", folder.display()))
            })?;
        }
        let cone = self.cone.to_radians();
        let rest = &subject.planner.rest().posture.directions;
        let samples = draw(rest, subject.magnets().len(), cone, self.samples as usize, self.seed);
        let targets: Vec<_> = samples.iter().map(|sample| sample.target).collect();
        let found = in_threads(self.threads, || Search::FromRest.run(&subject.planner, &targets))?;
        let mut survey = Survey::of(&edges(cone), &samples, &found.plans);
        (survey.elapsed_s, survey.processor_s) = (found.elapsed, found.processor);
        survey.files = self.write(&subject, &samples, &found.plans, &survey)?;
        if self.json {
            output::json(&survey)?;
        } else {
            output::result(survey.text())?;
        }
        Ok(Exit::Success)
    }

    fn write(
        &self,
        subject: &Subject,
        samples: &[Sample],
        plans: &[Result<Plan, Unreached>],
        survey: &Survey,
    ) -> anyhow::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        if let Some(folder) = &self.out {
            let path = folder.join("reach.csv");
            data_file::create(&path, table::text(&subject.description, samples, plans).as_bytes())?;
            files.push(path);
        }
        for path in self.pictures() {
            draw_picture(&path, subject, samples, plans, survey)?;
            files.push(path);
        }
        Ok(files)
    }

    #[cfg(feature = "figures")]
    fn pictures(&self) -> Vec<PathBuf> {
        let beside = self.out.as_ref().map(|folder| folder.join("reach.png"));
        beside.into_iter().chain(self.picture.clone()).collect()
    }

    /// This build draws nothing.
    #[cfg(not(feature = "figures"))]
    fn pictures(&self) -> Vec<PathBuf> {
        Vec::new()
    }
}

#[cfg(feature = "figures")]
fn draw_picture(
    path: &Path,
    subject: &Subject,
    samples: &[Sample],
    plans: &[Result<Plan, Unreached>],
    survey: &Survey,
) -> anyhow::Result<()> {
    let picture = super::picture::draw(&subject.magnets(), samples, plans, survey)?;
    data_file::create(path, &picture)
}

/// This build draws nothing.
#[cfg(not(feature = "figures"))]
fn draw_picture(
    _: &Path,
    _: &Subject,
    _: &[Sample],
    _: &[Result<Plan, Unreached>],
    _: &Survey,
) -> anyhow::Result<()> {
    Ok(())
}
