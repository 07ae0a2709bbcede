//! The runs of a campaign, as its folder has them.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use magsteer::config::Config;
use serde::Serialize;

use crate::cli::campaign::{Columns, Manifest, RunRow, read_columns, read_manifest, read_rows};
use crate::cli::exit::{Exit, Failure};

/// True of the folder of a campaign.
pub fn is_campaign(path: &Path) -> bool {
    path.join("campaign.json").is_file()
}

/// How a run came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RunOutcome {
    /// Every step settled.
    Settled,
    /// Some did not, and the loop stayed stable.
    Unsettled,
    /// It did not, as the campaign's help defines it.
    Unstable,
}

impl RunOutcome {
    /// Every outcome, the best first.
    pub const ALL: [Self; 3] = [Self::Settled, Self::Unsettled, Self::Unstable];

    /// Of a run.
    pub fn of(row: &RunRow) -> Self {
        match (row.unstable, row.settled) {
            (true, _) => Self::Unstable,
            (false, true) => Self::Settled,
            (false, false) => Self::Unsettled,
        }
    }

    /// In a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Settled => "settled",
            Self::Unsettled => "unsettled",
            Self::Unstable => "unstable",
        }
    }
}

/// A run that did not settle, or was unstable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FailedRun {
    /// Number of the run.
    pub run: u64,
    /// How it failed.
    pub outcome: RunOutcome,
    /// The command that plays it again.
    pub replay: String,
}

/// A campaign as far as it has come.
pub struct CampaignRuns {
    /// Its folder.
    pub folder: PathBuf,
    /// What it was started with.
    pub manifest: Manifest,
    /// What its table holds.
    pub columns: Columns,
    /// A row a run, in their order; at least one.
    pub rows: Vec<RunRow>,
    /// Name of the rig.
    pub rig: String,
    /// Greatest current that a coil may carry, A.
    pub current_limit: f64,
    /// Margin below which the loop holds.
    pub margin_hold: Option<f64>,
}

impl CampaignRuns {
    /// Reads the folder of a campaign.
    ///
    /// # Errors
    /// When a file of it is missing or cannot be read, or no run is done yet.
    pub fn open(folder: &Path) -> anyhow::Result<Self> {
        let manifest = read_manifest(folder)?;
        let columns = read_columns(folder)?;
        let rows: Vec<RunRow> = read_rows(folder, &columns)?.into_values().collect();
        if rows.is_empty() {
            let why = anyhow!("{}: no run of this campaign is done yet", folder.display());
            return Err(Failure::with(Exit::NoInput, why));
        }
        let (_, config) = Config::load(&folder.join("config.toml"))?;
        let coils = config.description.coils.iter().map(|coil| coil.current_max);
        Ok(Self {
            folder: folder.to_owned(),
            manifest,
            columns,
            rows,
            rig: config.description.rig.clone(),
            current_limit: coils.fold(0.0, f64::max),
            margin_hold: config.daemon.as_ref().map(|daemon| daemon.stability_hold),
        })
    }

    /// The runs that came out so.
    pub fn with(&self, outcome: RunOutcome) -> impl Iterator<Item = &RunRow> {
        self.rows.iter().filter(move |row| RunOutcome::of(row) == outcome)
    }

    /// The runs that failed, each with the command that plays it again.
    pub fn failed(&self) -> Vec<FailedRun> {
        let outcomes = self.rows.iter().map(|row| (row.run, RunOutcome::of(row)));
        let failed = outcomes.filter(|(_, outcome)| *outcome != RunOutcome::Settled);
        failed.map(|(run, outcome)| FailedRun { run, outcome, replay: self.replay(run) }).collect()
    }

    /// The command that plays a run again, with what the folder itself holds.
    fn replay(&self, run: u64) -> String {
        let folder = self.folder.display().to_string();
        let folder = if folder.contains(|letter: char| letter.is_whitespace() || letter == '\'') {
            format!("'{}'", folder.replace('\'', r"'\''"))
        } else {
            folder
        };
        format!("magsteer campaign {folder}/config.toml --resume {folder} --only {run}")
    }
}
