//! The subcommand.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

#[cfg(feature = "sim")]
use super::campaign::{CampaignRuns, FailedRun, is_campaign};
use super::page::{Figure, page};
use super::run::Run;
use super::{health, modelling, steering};
use crate::cli::exit::{Exit, cannot_create};
use crate::cli::output;

/// Make the figures of a recorded run or of a campaign: as SVG, PNG and CSV, and one page with all of them.
///
/// Angles (desired, measured, predicted) and views of the rod as in the paper's Figs. 5 and 6, its field as in Fig. 3, the model with and
/// without magnetic forces as in Fig. 7; currents and frame angles with their limits, margins, timing. A run is recorded by
/// `magsteer run FILE --record`; `magsteer demo` records its own.
///
/// Of a campaign: settling times and errors step by step over the drawn plants, what failed runs have in common, currents and margins
/// against their limits, and the command that plays each failed run again.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer report runs/demo-20261122-091419\n  magsteer report runs/campaign-20261122-031500\n\n\
                  JSON: run, files, steps[].{target_deg, settled_s, ...}; of a campaign: campaign, files, runs, settled, unstable,\n\
                  failed[].{run, outcome, replay}."
)]
pub struct Report {
    /// A run's folder, its recording.mcap, or a campaign's folder.
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Folder for the report; `report` in the run's folder when left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Answer<'a> {
    run: &'a Path,
    files: &'a [PathBuf],
    steps: Vec<&'a magsteer::daemon::step_response::StepResponse>,
}

/// What `--json` prints of a campaign.
#[cfg(feature = "sim")]
#[derive(Serialize)]
struct CampaignAnswer<'a> {
    campaign: &'a Path,
    files: &'a [PathBuf],
    runs: usize,
    settled: usize,
    unstable: usize,
    failed: Vec<FailedRun>,
}

fn list(files: &[PathBuf]) -> anyhow::Result<()> {
    let listed: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
    Ok(output::result(listed)?)
}

impl Report {
    pub fn run(&self) -> anyhow::Result<Exit> {
        #[cfg(feature = "sim")]
        if is_campaign(&self.run) {
            return self.campaign();
        }
        let run = Run::open(&self.run)?;
        let files = write(&run, &self.out.clone().unwrap_or_else(|| beside(&self.run)))?;
        if self.json {
            let steps = run.steps.iter().map(|step| &step.response).collect();
            output::json(&Answer { run: &self.run, files: &files, steps })?;
        } else {
            list(&files)?;
        }
        Ok(Exit::Success)
    }

    #[cfg(feature = "sim")]
    fn campaign(&self) -> anyhow::Result<Exit> {
        let campaign = CampaignRuns::open(&self.run)?;
        let files =
            super::campaign::write(&campaign, &self.out.clone().unwrap_or_else(|| beside(&self.run)))?;
        if self.json {
            output::json(&CampaignAnswer {
                campaign: &self.run,
                files: &files,
                runs: campaign.rows.len(),
                settled: campaign.rows.iter().filter(|row| row.settled).count(),
                unstable: campaign.rows.iter().filter(|row| row.unstable).count(),
                failed: campaign.failed(),
            })?;
        } else {
            list(&files)?;
        }
        Ok(Exit::Success)
    }
}

/// Makes every figure of a run and the page with all of them in a folder; returns their paths, the page's first.
///
/// # Errors
/// When a figure cannot be drawn, or a file cannot be written.
pub fn write(run: &Run, folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    std::fs::create_dir_all(folder).map_err(|error| cannot_create(folder, &error))?;
    let sheets = [
        Some(steering::angles(run)),
        steering::convergence(run),
        steering::views(run),
        Some(health::actuation(run)),
        Some(health::margins(run)),
        modelling::forces(run),
        Some(modelling::field(run)),
        Some(health::timing(run)),
    ];
    let file = folder.join("report.html");
    let (mut figures, mut files) = (Vec::new(), vec![file.clone()]);
    for sheet in sheets.into_iter().flatten() {
        let (svg, written) = sheet.write(folder)?;
        files.extend(written);
        figures.push(Figure { name: sheet.name, caption: sheet.caption, svg });
    }
    std::fs::write(&file, page(run, &figures)).map_err(|error| cannot_create(&file, &error))?;
    Ok(files)
}

/// The folder of the report of a run, which may be named by its recording.
pub fn beside(run: &Path) -> PathBuf {
    let folder = if run.is_dir() { run } else { run.parent().unwrap_or(Path::new("")) };
    folder.join("report")
}
