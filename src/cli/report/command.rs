//! The subcommand.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;

use super::page::{Figure, page};
use super::run::Run;
use super::{health, modelling, steering};
use crate::cli::exit::Exit;
use crate::cli::output;
use crate::cli::run_folder::cannot_create;

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
        let folder = self.out.clone().unwrap_or_else(|| beside(&self.run));
        std::fs::create_dir_all(&folder).map_err(|error| cannot_create(&folder, &error))?;
        let sheets = [
            Some(steering::angles(&run)),
            steering::convergence(&run),
            steering::views(&run),
            Some(health::actuation(&run)),
            Some(health::margins(&run)),
            modelling::forces(&run),
            Some(modelling::field(&run)),
            Some(health::timing(&run)),
        ];
        let (mut figures, mut files) = (Vec::new(), Vec::new());
        for sheet in sheets.into_iter().flatten() {
            let (svg, written) = sheet.write(&folder)?;
            files.extend(written);
            figures.push(Figure { name: sheet.name, caption: sheet.caption, svg });
        }
        let file = folder.join("report.html");
        std::fs::write(&file, page(&run, &figures)).map_err(|error| cannot_create(&file, &error))?;
        files.insert(0, file);
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

/// The folder of the report of a run, which may be named by its recording.
fn beside(run: &Path) -> PathBuf {
    let folder = if run.is_dir() { run } else { run.parent().unwrap_or(Path::new("")) };
    folder.join("report")
}
