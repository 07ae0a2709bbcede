//! `magsteer events`: the journal of a daemon.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use magsteer::config::Config;
use magsteer::daemon::StopFlag;
use magsteer::daemon::recorder::{Entry, JOURNAL, JournalTail, journal_files, read_journal};
use magsteer::live::words;

use super::ending::{exit_of, watching};
use super::exit::{Exit, Failure};
use super::output;

/// Where the shipped configuration has flights and journal.
pub const RECORDINGS: &str = "runs/daemon";
/// Between two looks of `--follow`.
const FOLLOW_PERIOD: Duration = Duration::from_millis(200);

/// Show what happened: changes of state, targets given up, requests refused, flights written.
///
/// The newest event comes last. Ends with 66 when the folder has no journal, with 130 after Ctrl-C.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  magsteer events --last 20\n  magsteer events config/bigmag-planar.toml --follow\n  magsteer events runs/daemon --json"
)]
pub struct Events {
    /// Folder of the journal, or the configuration that names it. A run that is recorded has its journal in its own folder.
    #[arg(value_name = "FOLDER", default_value = RECORDINGS)]
    folder: PathBuf,
    /// Only the newest N.
    #[arg(long, value_name = "N")]
    last: Option<usize>,
    /// Go on with what comes, until Ctrl-C.
    #[arg(long)]
    follow: bool,
    /// Print one JSON object a line, as the journal has them.
    #[arg(long)]
    json: bool,
}

impl Events {
    pub fn run(&self) -> anyhow::Result<Exit> {
        Self { folder: journal_folder(&self.folder)?, ..self.clone() }.show()
    }

    fn show(&self) -> anyhow::Result<Exit> {
        if !self.follow {
            self.print_all()?;
            return Ok(Exit::Success);
        }
        let stop = Arc::new(StopFlag::new());
        watching(&stop, false, || (), || self.follow(&stop))?
    }

    /// Prints what there is.
    fn print_all(&self) -> anyhow::Result<()> {
        if journal_files(&self.folder).is_empty() {
            let missing = anyhow!(
                "{}: has no journal ({JOURNAL}); that of a run that is recorded is in the run's folder",
                self.folder.display()
            );
            return Err(Failure::with(Exit::NoInput, missing));
        }
        let page = read_journal(&self.folder).map_err(|error| self.unreadable(&error))?;
        let skipped = self.last.map_or(0, |last| page.entries.len().saturating_sub(last));
        page.entries[skipped..].iter().try_for_each(|entry| self.print(entry))?;
        self.note_damaged(page.damaged);
        Ok(())
    }

    fn follow(&self, stop: &StopFlag) -> anyhow::Result<Exit> {
        // Opened first: what is written between the two is printed twice rather than never.
        let mut tail = JournalTail::at_end(&self.folder).map_err(|error| self.unreadable(&error))?;
        if !journal_files(&self.folder).is_empty() {
            self.print_all()?;
        }
        while stop.requested().is_none() {
            let page = tail.look().map_err(|error| self.unreadable(&error))?;
            page.entries.iter().try_for_each(|entry| self.print(entry))?;
            self.note_damaged(page.damaged);
            std::thread::sleep(FOLLOW_PERIOD);
        }
        Ok(exit_of(stop))
    }

    fn print(&self, entry: &Entry) -> anyhow::Result<()> {
        if self.json {
            return output::json(entry);
        }
        Ok(output::result(format_args!("{}\n", words(entry)))?)
    }

    fn note_damaged(&self, lines: u64) {
        if lines > 0 {
            output::note(format_args!("{}: {lines} lines are damaged and left out", self.folder.display()));
        }
    }

    fn unreadable(&self, error: &std::io::Error) -> anyhow::Error {
        unreadable(&self.folder, error)
    }
}

/// The folder that a configuration names, where one is meant.
fn journal_folder(named: &Path) -> anyhow::Result<PathBuf> {
    if !named.is_file() {
        return Ok(named.to_owned());
    }
    let (_, config) = Config::load(named)?;
    let recorder = config.daemon.and_then(|daemon| daemon.recorder);
    let missing = || anyhow!("{}: has no table [daemon.recorder]: it keeps no journal", named.display());
    Ok(recorder.ok_or_else(|| Failure::with(Exit::NoInput, missing()))?.folder)
}

/// A folder that cannot be read.
pub fn unreadable(folder: &Path, error: &std::io::Error) -> anyhow::Error {
    let exit = if error.kind() == std::io::ErrorKind::NotFound { Exit::NoInput } else { Exit::Io };
    Failure::with(exit, anyhow!("{}: cannot be read: {error}", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::RECORDINGS;

    #[test]
    fn the_folder_is_that_of_the_shipped_configuration() {
        let shipped = include_str!("../../config/bigmag-planar.toml");
        assert!(shipped.contains(&format!("folder = \"{RECORDINGS}\"")));
    }
}
