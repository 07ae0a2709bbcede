//! The folder of a recorded run: what was run, what was recorded, how it went.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use magsteer::config::Document;
use magsteer::daemon::recorder::JOURNAL;
use magsteer::daemon::{Bin, CompanionPlan, RunReport};
use magsteer::recording::RECORDING;
use magsteer_hal::channels::Endpoint;

use super::exit::{Exit, Failure, cannot_create};
use super::run_folder::dated;

/// Where run folders are made.
pub const RUNS: &str = "runs";
/// The resolved configuration.
const CONFIG: &str = "config.toml";
/// What the operator said of the run.
const DESCRIPTION: &str = "description.txt";
/// The report of the run, as `run --json` prints it.
const SUMMARY: &str = "summary.json";
/// Lateness and execution of its cycles, bin by bin.
const LATENCY: &str = "latency.csv";
/// Names tried when several runs begin in one second.
const NAMES_MAX: u32 = 100;

/// The folder of a run that is recorded.
#[derive(Debug)]
pub struct RunFiles {
    folder: PathBuf,
    description: String,
    /// Files of this run that were not there before, and the folder when that was not; to be removed in this
    /// order.
    made: Vec<PathBuf>,
}

impl RunFiles {
    /// Makes the folder, a dated one below `runs` when none is named, and puts into it what is run.
    ///
    /// # Errors
    /// When it cannot be made, or holds a recording already.
    pub fn begin(named: Option<&Path>, document: &Document, description: &str) -> anyhow::Result<Self> {
        let folder = named.map_or_else(dated_folder, |folder| Ok(folder.to_owned()))?;
        let is_new = !folder.exists();
        std::fs::create_dir_all(&folder).map_err(|error| cannot_create(&folder, &error))?;
        let recording = folder.join(RECORDING);
        if recording.exists() {
            let taken = anyhow!("{}: is there already: name another folder", recording.display());
            return Err(Failure::with(Exit::CannotCreate, taken));
        }
        let mut made: Vec<PathBuf> = [CONFIG, DESCRIPTION].map(|name| folder.join(name)).into();
        made.retain(|path| !path.exists());
        made.extend(is_new.then(|| folder.clone()));
        let files = Self { folder, description: description.to_owned(), made };
        files.put(CONFIG, &document.resolved().text)?;
        if !description.is_empty() {
            files.put(DESCRIPTION, &format!("{}\n", description.trim_end()))?;
        }
        Ok(files)
    }

    /// Takes away what [`Self::begin`] made, since the run came to nothing. What was recorded all the same, or
    /// told in a journal, stays, with all that belongs to it.
    pub fn discard(&self) {
        if self.recording().exists() || self.folder.join(JOURNAL).exists() {
            return;
        }
        for path in &self.made {
            // A folder that somebody else put files into is not empty, and stays.
            let _ = if path.is_dir() { std::fs::remove_dir(path) } else { std::fs::remove_file(path) };
        }
    }

    /// Its path.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The resolved configuration in it.
    pub fn config(&self) -> PathBuf {
        self.folder.join(CONFIG)
    }

    /// The recording in it.
    pub fn recording(&self) -> PathBuf {
        self.folder.join(RECORDING)
    }

    /// How to start this program once more, to record the rig's daemon.
    ///
    /// # Errors
    /// When this program cannot be found.
    pub fn companion(&self, endpoint: &Endpoint) -> anyhow::Result<CompanionPlan> {
        let program = std::env::current_exe().context("cannot find this program")?;
        let mut arguments: Vec<OsString> = vec!["record".into(), self.config().into()];
        for (name, value) in [
            ("--root", endpoint.root().as_os_str()),
            ("--out", self.folder.as_os_str()),
            ("--description", self.description.as_ref()),
        ] {
            // One word, so that a text that begins with a dash is no option.
            let mut argument = OsString::from(format!("{name}="));
            argument.push(value);
            arguments.push(argument);
        }
        arguments.push("--as-companion".into());
        Ok(CompanionPlan { program, arguments })
    }

    /// Puts the report of the run into the folder, and how long its cycles took.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn end(&self, report: &RunReport) -> anyhow::Result<()> {
        self.put(SUMMARY, &format!("{}\n", serde_json::to_string_pretty(report)?))?;
        let mut table = "time,from_us,up_to_us,cycles\n".to_owned();
        let histograms = &report.histograms;
        for (time, bins) in [("lateness", &histograms.lateness_us), ("execution", &histograms.execution_us)] {
            bins.iter().for_each(|bin| table += &row(time, bin));
        }
        self.put(LATENCY, &table)
    }

    fn put(&self, name: &str, text: &str) -> anyhow::Result<()> {
        let path = self.folder.join(name);
        std::fs::write(&path, text).map_err(|error| cannot_create(&path, &error))
    }
}

fn row(time: &str, bin: &Bin) -> String {
    let width = 2_f64.powf(magsteer::daemon::TimingHistograms::PER_OCTAVE.recip());
    format!("{time},{:.3},{:.3},{}\n", bin.up_to_us / width, bin.up_to_us, bin.cycles)
}

/// `runs/run-YYYYMMDD-HHMMSS`, UTC; with a number behind it when that is taken.
fn dated_folder() -> anyhow::Result<PathBuf> {
    let name = dated("run");
    let numbered = (2..NAMES_MAX).map(|number| format!("{name}-{number}"));
    let mut folders = std::iter::once(name.clone()).chain(numbered).map(|name| Path::new(RUNS).join(name));
    folders.find(|folder| !folder.exists()).ok_or_else(|| {
        Failure::with(Exit::CannotCreate, anyhow!("{RUNS}/{name}: is there already, many times"))
    })
}
