//! The subcommand: start a campaign, go on with one, replay one of its runs.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::available_parallelism;
use std::time::Instant;

use anyhow::{Context, anyhow};
use clap::{Args, value_parser};
use magsteer::config::{Config, Document, Experiment, Problems};
use magsteer::daemon::StopFlag;
use magsteer_hal::invalid::Invalid;
use serde::Serialize;

use super::folder::{Folder, Identity, check_same, read_manifest, read_rows};
use super::pool::play_all;
use super::progress::Progress;
use super::row::{Columns, RunRow};
use super::runner::Runner;
use super::summary::{Session, Summary};
use crate::cli::ending::{exit_of, watching};
use crate::cli::exit::{Exit, Failure};
use crate::cli::output;
#[cfg(all(feature = "figures", feature = "record"))]
use crate::cli::report::{self, CampaignRuns};
use crate::cli::run_folder::dated;

/// Runs of a new campaign when their number is left out.
const RUNS: u64 = 200;
/// Seed of a new campaign when it is left out.
const SEED: u64 = 1;

/// Steer many simulated plants, drawn at random, through one experiment: in lockstep, faster than real time,
/// on all cores.
///
/// The table `[campaign]` of the configuration names the experiment and what is drawn. Every run is judged by
/// its plant's true poses. Rows, summary and report go into a folder; killed or interrupted at any moment,
/// a campaign is resumed from there. The same configuration and seed give the same rows bit for bit, whatever
/// the threads and however often it was resumed.
///
/// A run is unstable when it did not steer to the end, when the model lost the rod (45 degrees apart at the
/// end of a step), or when a step did not settle and a magnet still turned by more than 5 degrees in its last
/// second. Ends with 0; with 1 when a command broke a limit or a run was unstable. That a run did not settle
/// is a result: it is told, and the code is 0.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  magsteer campaign config/bigmag-planar.toml --runs 200 --seed 1\n  \
    magsteer campaign config/bigmag-planar.toml --resume runs/campaign-20261122-031500\n  \
    magsteer campaign config/bigmag-planar.toml --resume runs/campaign-20261122-031500 --only 17")]
pub struct Campaign {
    /// Configuration file (TOML) with a `[campaign]` table.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Number of runs; 200 when left out. More than before when resuming makes the campaign longer.
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..=1_000_000))]
    runs: Option<u64>,
    /// Seed of the campaign, which every run's seed follows from; 1 when left out.
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Folder for the campaign's files; a dated one below `runs` when left out.
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Threads; as many as there are cores when left out.
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Experiment, in place of that of the configuration.
    #[arg(long, value_name = "FILE")]
    experiment: Option<PathBuf>,
    /// Go on with the campaign in this folder.
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Play this run alone and write nothing (0 first); compare it with that of the folder, when one is
    /// named.
    #[arg(long, value_name = "RUN", conflicts_with_all = ["runs", "threads"])]
    only: Option<u64>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints of a campaign.
#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    folder: &'a Path,
    files: &'a [PathBuf],
}

/// What `--json` prints of one run.
#[derive(Serialize)]
struct Replay<'a> {
    #[serde(flatten)]
    row: &'a RunRow,
    drawn: BTreeMap<String, f64>,
    /// Digest of the same run in the folder.
    recorded_digest: Option<&'a str>,
    /// Whether it is the same run bit for bit; `None` when there is none to compare with.
    equal: Option<bool>,
}

impl Campaign {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let (document, config) = Config::load(&self.file)?;
        document.require("campaign", &config.campaign)?;
        let experiment_document = self.experiment(&document)?;
        let experiment =
            Experiment::from_document(&experiment_document, &config.description).map_err(Failure::data)?;
        let seed = self.seed_of_campaign()?;
        let runner = Runner::new(&document, &config, &experiment, seed)?;
        let identity = Identity::new(seed, &document, &experiment_document)?;
        match self.only {
            Some(run) => self.replay(run, &runner, &identity),
            None => self.play(&runner, &identity),
        }
    }

    /// The experiment named, else that of the configuration.
    fn experiment(&self, document: &Document) -> anyhow::Result<Document> {
        let key = "campaign.experiment";
        if let Some(path) = &self.experiment {
            return Document::load(path).map_err(Failure::data);
        }
        let path = document.path_at(key).context("a campaign names its experiment")?;
        Document::load(&path).map_err(|problems| {
            if !problems.unreadable() {
                return Failure::data(problems);
            }
            let value = format!("{} ({})", path.display(), problems.as_slice()[0].value);
            let expected = "an experiment that can be read, relative to this file".to_owned();
            let refused = document.refuse(vec![Invalid { key: key.to_owned(), value, expected }]);
            Problems::new(refused).map_or_else(|| anyhow!("{}", path.display()), Into::into)
        })
    }

    /// The folder that a campaign may already be in.
    fn earlier(&self) -> Option<&Path> {
        let folder = self.resume.as_deref().or(self.out.as_deref().filter(|_| self.only.is_some()));
        folder.filter(|folder| self.resume.is_some() || folder.exists())
    }

    /// The seed named, else that of the folder, else the default.
    fn seed_of_campaign(&self) -> anyhow::Result<u64> {
        match (self.seed, self.earlier()) {
            (Some(seed), _) => Ok(seed),
            (None, Some(folder)) => Ok(read_manifest(folder)?.seed),
            (None, None) => Ok(SEED),
        }
    }

    /// The folder, the rows that it has, and how many are wanted.
    fn open(&self, columns: &Columns, identity: &Identity) -> anyhow::Result<Opened> {
        let Some(path) = &self.resume else {
            let path = self.out.clone().unwrap_or_else(|| PathBuf::from("runs").join(dated("campaign")));
            let wanted = self.runs.unwrap_or(RUNS);
            let folder = Folder::create(&path, identity, wanted)?;
            return Ok(Opened { folder, rows: BTreeMap::new(), wanted });
        };
        let (folder, manifest) = Folder::open(path)?;
        check_same(path, &manifest, identity)?;
        let wanted = self.runs.unwrap_or(manifest.runs);
        if wanted < manifest.runs {
            let message = format!("--runs {wanted}: the campaign was started with {}", manifest.runs);
            return Err(Failure::usage(message));
        }
        let rows = read_rows(path, columns)?;
        folder.write_manifest(identity, wanted)?;
        Ok(Opened { folder, rows, wanted })
    }

    fn play(&self, runner: &Runner<'_>, identity: &Identity) -> anyhow::Result<Exit> {
        let columns = runner.columns();
        let Opened { folder, mut rows, wanted } = self.open(columns, identity)?;
        let pending: Vec<u64> = (0..wanted).filter(|run| !rows.contains_key(run)).collect();
        let cores = available_parallelism().map_or(1, usize::from);
        let threads = self.threads.map_or(cores, usize::from).min(pending.len().max(1));
        let mut table = folder.table(columns, &rows)?;
        let stop = Arc::new(StopFlag::new());
        let mut session = Session { threads, ..Session::default() };
        let begin = Instant::now();
        let played = watching(
            &stop,
            false,
            || (),
            || {
                let settled = rows.values().filter(|row| row.settled).count() as u64;
                let mut progress = Progress::new(wanted, rows.len() as u64, settled);
                let played = play_all(runner, pending, threads, &stop, |done| {
                    table.append(columns, &done.row)?;
                    session.add(&done);
                    progress.add(done.row.settled);
                    rows.insert(done.row.run, done.row);
                    Ok(())
                });
                progress.end();
                played
            },
        )?;
        session.elapsed = begin.elapsed();
        // In order, as an uninterrupted campaign on one thread has them.
        let table = folder.table(columns, &rows)?;
        let again = format!(
            "go on with `magsteer campaign {} --resume {}`",
            self.file.display(),
            folder.path().display()
        );
        played.inspect_err(|_| {
            output::note(format_args!("{} of {wanted} runs are kept: {again}", rows.len()))
        })?;
        let summary = Summary::of(rows.values(), &session, identity.seed, wanted, &identity.config.sha256);
        let mut files = vec![table.path().to_owned(), folder.write_summary(&summary)?];
        if !rows.is_empty() {
            files.extend(draw(folder.path())?);
        }
        self.print(&summary, folder.path(), &files)?;
        if stop.requested().is_some() {
            output::note(format_args!("interrupted after {} of {wanted} runs: {again}", rows.len()));
            return Ok(exit_of(&stop));
        }
        Ok(if summary.is_sound() { Exit::Success } else { Exit::No })
    }

    fn print(&self, summary: &Summary, folder: &Path, files: &[PathBuf]) -> anyhow::Result<()> {
        if self.json {
            return output::json(&Answer { summary, folder, files });
        }
        let files: String = files.iter().map(|file| format!("{}\n", file.display())).collect();
        Ok(output::result(format_args!("{}{files}", summary.text()))?)
    }

    /// Plays one run, and compares it with what the folder has of it.
    fn replay(&self, run: u64, runner: &Runner<'_>, identity: &Identity) -> anyhow::Result<Exit> {
        let columns = runner.columns();
        let mut recorded = None;
        if let Some(path) = self.earlier() {
            check_same(path, &read_manifest(path)?, identity)?;
            recorded = read_rows(path, columns)?.remove(&run);
            if recorded.is_none() {
                output::note(format_args!("{}: has no run {run} to compare with", path.display()));
            }
        }
        let stop = Arc::new(StopFlag::new());
        let played = watching(&stop, false, || (), || runner.play(run, || stop.requested().is_some()))??;
        let Some(row) = played else { return Ok(exit_of(&stop)) };
        let equal = recorded.as_ref().map(|recorded| *recorded == row);
        let drawn = columns.drawn_by_key(&row);
        if self.json {
            let recorded_digest = recorded.as_ref().map(|recorded| recorded.digest.as_str());
            output::json(&Replay { row: &row, drawn, recorded_digest, equal })?;
        } else {
            output::result(replay_text(&row, &drawn, recorded.as_ref(), equal))?;
        }
        Ok(if equal == Some(false) { Exit::No } else { Exit::Success })
    }
}

/// A folder with what it holds.
struct Opened {
    folder: Folder,
    rows: BTreeMap<u64, RunRow>,
    wanted: u64,
}

fn replay_text(
    row: &RunRow,
    drawn: &BTreeMap<String, f64>,
    recorded: Option<&RunRow>,
    equal: Option<bool>,
) -> String {
    let mut text = format!("run {}, seed {}\n", row.run, row.seed);
    for (key, value) in drawn {
        text += &format!("  {key} = {value}\n");
    }
    let settle = row.settle_s.iter().map(|time| time.map_or("-".to_owned(), |time| format!("{time:.2}")));
    text += &format!("settled after (s)  {}\n", settle.collect::<Vec<_>>().join("  "));
    let rms = row.rms_deg.iter().flatten().map(|rms| format!("{rms:.3}"));
    text += &format!("error RMS (deg)    {}\n", rms.collect::<Vec<_>>().join("  "));
    text += &format!(
        "largest current {:.2} A, {} commands beyond a limit, model off by {:.1} deg, swing {:.2} deg, ended {}{}\n",
        row.current_max_a,
        row.limit_breaks,
        row.model_error_deg,
        row.swing_deg,
        row.end,
        if row.unstable { ", UNSTABLE" } else { "" },
    );
    let verdict = match (equal, recorded) {
        (Some(true), _) => ", equal to the recorded run bit for bit".to_owned(),
        (Some(false), Some(recorded)) => format!(", NOT equal to the recorded run, {}", recorded.digest),
        _ => String::new(),
    };
    text + &format!("digest {}{verdict}\n", row.digest)
}

/// Makes the campaign's report in its folder; the page alone is named, which shows the rest.
#[cfg(all(feature = "figures", feature = "record"))]
fn draw(folder: &Path) -> anyhow::Result<Option<PathBuf>> {
    let files = report::write_campaign(&CampaignRuns::open(folder)?, &report::beside(folder))?;
    Ok(files.into_iter().next())
}

/// This build draws nothing.
#[cfg(not(all(feature = "figures", feature = "record")))]
fn draw(_: &Path) -> anyhow::Result<Option<PathBuf>> {
    Ok(None)
}
