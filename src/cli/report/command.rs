//! The subcommand.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::page::{Figure, page};
use super::run::Run;
use super::{health, modelling, steering};
use crate::cli::exit::{Exit, cannot_create};
use crate::cli::output;

/// Make the figures of a recorded run: as SVG, PNG and CSV, and one page with all of them.
///
/// Angles (desired, measured, predicted) and views of the rod as in the paper's Figs. 5 and 6, its field as in Fig. 3, the model with and
/// without magnetic forces as in Fig. 7; currents and frame angles with their limits, margins, timing. A run is recorded by
/// `magsteer run FILE --record`; `magsteer demo` records its own.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  magsteer report runs/demo-20261122-091419\n\nJSON: run, files, steps[].{target_deg, settled_s, ...}."
)]
pub struct Report {
    /// A run's folder, or its recording.mcap.
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

impl Report {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let run = Run::open(&self.run)?;
        let files = write(&run, &self.out.clone().unwrap_or_else(|| beside(&self.run)))?;
        if self.json {
            let steps = run.steps.iter().map(|step| &step.response).collect();
            output::json(&Answer { run: &self.run, files: &files, steps })?;
        } else {
            let listed: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
            output::result(listed)?;
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
