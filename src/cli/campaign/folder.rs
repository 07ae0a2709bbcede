//! The folder of a campaign: what it was started with, and a row a run, so that it can be killed at any
//! moment and resumed.
//!
//! | file | holds |
//! |---|---|
//! | `config.toml` | the configuration, merged with all that it extends |
//! | `experiment.toml` | the experiment, likewise |
//! | `nominal.toml` | the rig that the plants are built as, where the configuration names another than itself |
//! | `campaign.json` | seed, number of runs, SHA-256 of the texts, version of this program |
//! | `runs.csv` | a row a run: appended and flushed as runs finish, put in order at the end and at resuming |
//! | `summary.json` | what `--json` prints |
//!
//! The configuration names the other two, so that the folder holds all that its campaign needs. Files but `runs.csv` are written beside their place and then renamed. A last line without its end was
//! being written when the campaign was killed, and is dropped. The folder itself is locked, so that two
//! campaigns never write into one.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use magsteer::config::{Document, Problems, Resolved};
use serde::{Deserialize, Serialize};

use super::row::{Columns, RunRow};
use crate::cli::exit::{Exit, Failure, cannot_create};

const CONFIG: &str = "config.toml";
const EXPERIMENT: &str = "experiment.toml";
const NOMINAL: &str = "nominal.toml";
const CAMPAIGN: &str = "campaign.json";
const RUNS: &str = "runs.csv";
const SUMMARY: &str = "summary.json";

/// What makes two campaigns the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
    /// Seed of the campaign.
    pub seed: u64,
    /// The configuration.
    pub config: Resolved,
    /// The experiment.
    pub experiment: Resolved,
    /// What the plants are built as, where that is another configuration.
    pub nominal: Option<Resolved>,
}

impl Identity {
    /// That of a campaign with these files, as its folder names them.
    ///
    /// # Errors
    /// When the file that the plants are built as cannot be read.
    pub fn new(seed: u64, config: &Document, experiment: &Document) -> Result<Self, Problems> {
        let nominal = config.path_at("plant.nominal").map(|path| Document::load(&path)).transpose()?;
        let mut config = config.clone();
        config.set_text("campaign.experiment", EXPERIMENT);
        config.set_text("plant.nominal", NOMINAL);
        Ok(Self {
            seed,
            config: config.resolved(),
            experiment: experiment.resolved(),
            nominal: nominal.map(|nominal| nominal.resolved()),
        })
    }

    fn nominal_sha256(&self) -> Option<&String> {
        self.nominal.as_ref().map(|nominal| &nominal.sha256)
    }
}

/// `campaign.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Seed of the campaign.
    pub seed: u64,
    /// Runs asked for.
    pub runs: u64,
    /// SHA-256 of `config.toml`.
    pub config_sha256: String,
    /// SHA-256 of `experiment.toml`.
    pub experiment_sha256: String,
    /// SHA-256 of `nominal.toml`, where there is one.
    pub nominal_sha256: Option<String>,
    /// Version of the program.
    pub version: String,
}

/// The folder, locked while this lives.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    _lock: File,
}

impl Folder {
    /// Makes a folder for a new campaign.
    ///
    /// # Errors
    /// When it cannot be made, is in use, or holds a campaign already.
    pub fn create(path: &Path, identity: &Identity, runs: u64) -> anyhow::Result<Self> {
        fs::create_dir_all(path).map_err(|error| cannot_create(path, &error))?;
        let folder = Self::lock(path)?;
        if folder.file(CAMPAIGN).exists() {
            let why = anyhow!(
                "{0}: holds a campaign already: go on with `--resume {0}`, or name another folder",
                path.display()
            );
            return Err(Failure::with(Exit::CannotCreate, why));
        }
        folder.write(CONFIG, &identity.config.text)?;
        folder.write(EXPERIMENT, &identity.experiment.text)?;
        if let Some(nominal) = &identity.nominal {
            folder.write(NOMINAL, &nominal.text)?;
        }
        folder.write_manifest(identity, runs)?;
        Ok(folder)
    }

    /// Opens the folder of a campaign, to go on with it or to look at it.
    ///
    /// # Errors
    /// When it is none, or is in use.
    pub fn open(path: &Path) -> anyhow::Result<(Self, Manifest)> {
        let manifest = read_manifest(path)?;
        Ok((Self::lock(path)?, manifest))
    }

    fn lock(path: &Path) -> anyhow::Result<Self> {
        let lock = File::open(path).map_err(|error| cannot_create(path, &error))?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path: path.to_owned(), _lock: lock }),
            Err(TryLockError::WouldBlock) => {
                let why = anyhow!("{}: another campaign is writing into this folder", path.display());
                Err(Failure::with(Exit::Unavailable, why))
            }
            Err(TryLockError::Error(error)) => {
                Err(anyhow!(error).context(format!("{}: cannot be locked", path.display())))
            }
        }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Notes another number of runs.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_manifest(&self, identity: &Identity, runs: u64) -> anyhow::Result<()> {
        let manifest = Manifest {
            seed: identity.seed,
            runs,
            config_sha256: identity.config.sha256.clone(),
            experiment_sha256: identity.experiment.sha256.clone(),
            nominal_sha256: identity.nominal_sha256().cloned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        self.write(CAMPAIGN, &(serde_json::to_string_pretty(&manifest)? + "\n"))
    }

    /// Writes the summary and returns its path.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn write_summary(&self, summary: &impl Serialize) -> anyhow::Result<PathBuf> {
        self.write(SUMMARY, &(serde_json::to_string_pretty(summary)? + "\n"))?;
        Ok(self.file(SUMMARY))
    }

    /// Puts rows in the order of their runs, and leaves the table open for more.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn table(&self, columns: &Columns, rows: &BTreeMap<u64, RunRow>) -> anyhow::Result<Table> {
        let lines: String = rows.values().map(|row| columns.line(row)).collect();
        self.write(RUNS, &(columns.header() + &lines))?;
        let path = self.file(RUNS);
        let file = OpenOptions::new().append(true).open(&path);
        let file = file.with_context(|| format!("{}: cannot be opened", path.display()))?;
        Ok(Table { path, file })
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes a whole file or nothing of it.
    fn write(&self, name: &str, text: &str) -> anyhow::Result<()> {
        let (path, beside) = (self.file(name), self.file(&format!("{name}.new")));
        let written = File::create(&beside)
            .and_then(|mut file| file.write_all(text.as_bytes()).and_then(|()| file.sync_all()))
            .and_then(|()| fs::rename(&beside, &path));
        written.with_context(|| format!("{}: cannot be written", path.display()))
    }
}

/// `runs.csv`, open for more rows.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    file: File,
}

impl Table {
    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends a row; when this returns it survives the end of the process and of the machine.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn append(&mut self, columns: &Columns, row: &RunRow) -> anyhow::Result<()> {
        let written = self.file.write_all(columns.line(row).as_bytes()).and_then(|()| self.file.sync_data());
        written.with_context(|| format!("{}: cannot be written", self.path.display()))
    }
}

/// `campaign.json` of a folder.
///
/// # Errors
/// When the folder is not a campaign's.
pub fn read_manifest(path: &Path) -> anyhow::Result<Manifest> {
    let file = path.join(CAMPAIGN);
    let text = fs::read_to_string(&file).map_err(|error| {
        let why = anyhow!("{}: cannot be read: {error}: not the folder of a campaign", file.display());
        Failure::with(Exit::NoInput, why)
    })?;
    let manifest = serde_json::from_str(&text).map_err(|error| anyhow!("{}: {error}", file.display()));
    manifest.map_err(|error| Failure::with(Exit::Data, error))
}

/// Refuses to mix runs of two campaigns, naming what differs.
///
/// # Errors
/// When seed, configuration, experiment or program differ.
pub fn check_same(path: &Path, manifest: &Manifest, identity: &Identity) -> anyhow::Result<()> {
    let mut differences = Vec::new();
    if manifest.seed != identity.seed {
        differences.push(format!("seed {}, not {}", manifest.seed, identity.seed));
    }
    for (name, was, is) in [
        (CONFIG, &manifest.config_sha256, &identity.config),
        (EXPERIMENT, &manifest.experiment_sha256, &identity.experiment),
    ] {
        if *was != is.sha256 {
            let text = fs::read_to_string(path.join(name)).unwrap_or_default();
            let line = first_difference(&text, &is.text);
            differences.push(format!("another {}: {line}", name.trim_end_matches(".toml")));
        }
    }
    if manifest.nominal_sha256.as_ref() != identity.nominal_sha256() {
        differences.push("another plant.nominal".to_owned());
    }
    let version = env!("CARGO_PKG_VERSION");
    if manifest.version != version {
        differences.push(format!("version {}, not {version}", manifest.version));
    }
    if differences.is_empty() {
        return Ok(());
    }
    let why = anyhow!("{}: was started with {}", path.display(), differences.join("; and with "));
    Err(Failure::with(Exit::Data, why))
}

/// The first line in which two resolved texts differ, with the table that it stands in.
fn first_difference(was: &str, is: &str) -> String {
    let mut table = "";
    let (mut was_lines, mut is_lines) = (was.lines(), is.lines());
    loop {
        match (was_lines.next(), is_lines.next()) {
            (Some(was), Some(is)) if was == is => {
                if was.starts_with('[') {
                    table = was;
                }
            }
            (None, None) => return "its digest".to_owned(),
            (was, is) => {
                let words =
                    |line: Option<&str>| line.map_or("nothing".to_owned(), |line| format!("`{line}`"));
                let place = if table.is_empty() { String::new() } else { format!("in {table} ") };
                return format!("{place}{}, not {}", words(was), words(is));
            }
        }
    }
}

/// What the table of a folder holds, by its first line.
///
/// # Errors
/// When there is no table, or it is none of a campaign.
#[cfg(all(feature = "figures", feature = "record"))]
pub fn read_columns(path: &Path) -> anyhow::Result<Columns> {
    let file = path.join(RUNS);
    let text = fs::read_to_string(&file).map_err(|error| {
        Failure::with(Exit::NoInput, anyhow!("{}: cannot be read: {error}", file.display()))
    })?;
    let header = text.lines().next().unwrap_or_default();
    Columns::of_header(header).ok_or_else(|| {
        let why = anyhow!("{}:1: not the table of a campaign as this version writes it", file.display());
        Failure::with(Exit::Data, why)
    })
}

/// The rows of a folder, by run. Empty when there is no table yet.
///
/// # Errors
/// When the table cannot be read, or holds anything but rows of such a campaign.
pub fn read_rows(path: &Path, columns: &Columns) -> anyhow::Result<BTreeMap<u64, RunRow>> {
    let file = path.join(RUNS);
    let text = match fs::read(&file) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(anyhow!(error).context(format!("{}: cannot be read", file.display()))),
    };
    parse_rows(&text, columns)
        .map_err(|error| Failure::with(Exit::Data, anyhow!("{}:{error:#}", file.display())))
}

fn parse_rows(text: &str, columns: &Columns) -> anyhow::Result<BTreeMap<u64, RunRow>> {
    // What has no end was being written when the process was killed.
    let complete = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut rows = BTreeMap::new();
    for (index, line) in complete.lines().enumerate() {
        let number = index + 1;
        if index == 0 {
            if line != columns.header().trim_end() {
                return Err(anyhow!(
                    "{number}: another table: must begin with {}",
                    columns.header().trim_end()
                ));
            }
            continue;
        }
        let row = columns.parse(line).with_context(|| number.to_string())?;
        if rows.get(&row.run).is_some_and(|other| *other != row) {
            return Err(anyhow!("{number}: run {} stands here twice, and not the same", row.run));
        }
        rows.insert(row.run, row);
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::super::row::tests::{columns, row};
    use super::*;

    #[test]
    fn a_torn_last_line_is_dropped_wherever_it_was_cut() {
        let columns = columns();
        let whole = columns.header() + &columns.line(&row(1)) + &columns.line(&row(0));
        assert_eq!(parse_rows(&whole, &columns).unwrap().len(), 2);
        for cut in 0..whole.len() {
            let complete = whole[..cut].matches('\n').count().saturating_sub(1);
            let rows = parse_rows(&whole[..cut], &columns).unwrap();
            assert_eq!(rows.len(), complete, "cut after {cut} bytes");
        }
    }

    #[test]
    fn a_row_that_stands_twice_must_be_the_same() {
        let columns = columns();
        let (first, other) = (row(3), RunRow { digest: "fedcba9876543210".to_owned(), ..row(3) });
        let same = columns.header() + &columns.line(&first) + &columns.line(&first);
        assert_eq!(parse_rows(&same, &columns).unwrap().len(), 1);
        let differing = columns.header() + &columns.line(&first) + &columns.line(&other);
        assert!(parse_rows(&differing, &columns).unwrap_err().to_string().contains("run 3"));
    }

    #[test]
    fn the_first_difference_is_named_with_its_table() {
        let was = "seed = 1\n[plant.errors]\na = 1.0\nb = 2.0\n";
        let is = "seed = 1\n[plant.errors]\na = 1.0\nb = 3.0\n";
        assert_eq!(first_difference(was, is), "in [plant.errors] `b = 2.0`, not `b = 3.0`");
        assert_eq!(first_difference(was, ""), "`seed = 1`, not nothing");
    }
}
