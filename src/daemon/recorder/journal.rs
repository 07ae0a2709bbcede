//! The journal: every event as one JSON object on one line of `events.jsonl`, and its reader.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::lines::Lines;

/// Name of the file that is written to.
pub const JOURNAL: &str = "events.jsonl";
/// Longest line that a reader takes, bytes; the writer's are far shorter.
const LINE_MAX: u64 = 64 << 10;

/// What an event is; the values of [`Entry::event`].
pub mod event {
    /// The daemon found its driver and starts its loop.
    pub const START: &str = "start";
    /// The loop ended.
    pub const STOP: &str = "stop";
    /// The state changed.
    pub const TRANSITION: &str = "transition";
    /// A target was given up.
    pub const GIVEN_UP: &str = "given-up";
    /// A request was refused.
    pub const REFUSED: &str = "refused";
    /// A flight was written.
    pub const FLIGHT: &str = "flight";
    /// A flight could not be written.
    pub const FLIGHT_LOST: &str = "flight-lost";
    /// The process that records every cycle has died.
    pub const RECORDING_LOST: &str = "recording-lost";
    /// Events were lost before this one.
    pub const LOST: &str = "lost";
}

/// One event. Fields without a value are left out of the line.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Entry {
    /// By the clock on the wall, RFC 3339.
    pub time: String,
    /// `CLOCK_MONOTONIC`.
    pub monotonic_ns: u64,
    /// Name of the rig.
    pub rig: String,
    /// The daemon's process.
    pub pid: u32,
    /// One of [`event`].
    pub event: String,
    /// Number of the cycle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycle: Option<u64>,
    /// State before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// State after.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// Stable code of the cause.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause_code: Option<u32>,
    /// The cause in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cause: Option<String>,
    /// The request that was refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub request: Option<String>,
    /// Path of a flight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// What else there is to say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub detail: Option<String>,
}

/// What a journal was read to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JournalPage {
    /// Events, the oldest first.
    pub entries: Vec<Entry>,
    /// Lines that are none.
    pub damaged: u64,
}

impl JournalPage {
    fn take(&mut self, line: &[u8]) {
        match serde_json::from_slice::<Entry>(line) {
            Ok(entry) if !entry.event.is_empty() => self.entries.push(entry),
            _ if line.trim_ascii().is_empty() => {}
            _ => self.damaged += 1,
        }
    }
}

/// The journal files of a folder, the oldest first.
#[must_use]
pub fn journal_files(folder: &Path) -> Vec<PathBuf> {
    Lines::Events.files(folder)
}

/// Reads every journal file of a folder.
///
/// # Errors
/// When one cannot be read; a folder without any is empty.
pub fn read_journal(folder: &Path) -> io::Result<JournalPage> {
    let mut page = JournalPage::default();
    for path in journal_files(folder) {
        let mut tail = JournalTail { path, ..JournalTail::default() };
        tail.read(&mut page)?;
        page.damaged += u64::from(tail.is_within_a_line());
    }
    Ok(page)
}

/// Reads what is appended to a journal from one look to the next.
#[derive(Debug, Default)]
pub struct JournalTail {
    path: PathBuf,
    reader: Option<BufReader<File>>,
    /// A line whose end is not there yet.
    partial: Vec<u8>,
}

impl JournalTail {
    /// The journal in `folder`, from its present end, or from its begin when it is not there yet.
    ///
    /// # Errors
    /// When it is there and cannot be read.
    pub fn at_end(folder: &Path) -> io::Result<Self> {
        let mut tail = Self { path: Lines::Events.path(folder, 0), ..Self::default() };
        if tail.open()?
            && let Some(reader) = &mut tail.reader
        {
            reader.seek(SeekFrom::End(0))?;
        }
        Ok(tail)
    }

    /// What came since the last look; goes on with the new file when the old one was moved away.
    ///
    /// # Errors
    /// When the file is there and cannot be read.
    pub fn look(&mut self) -> io::Result<JournalPage> {
        let mut page = JournalPage::default();
        self.read(&mut page)?;
        if self.was_replaced() {
            // What was written to the old file before it was moved away.
            self.read(&mut page)?;
            (self.reader, self.partial) = (None, Vec::new());
            self.read(&mut page)?;
        }
        Ok(page)
    }

    fn is_within_a_line(&self) -> bool {
        !self.partial.is_empty()
    }

    fn open(&mut self) -> io::Result<bool> {
        if self.reader.is_none() {
            match File::open(&self.path) {
                Ok(file) => self.reader = Some(BufReader::new(file)),
                Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    fn was_replaced(&self) -> bool {
        let held = self.reader.as_ref().and_then(|reader| reader.get_ref().metadata().ok());
        let named = fs::metadata(&self.path).ok();
        match (held, named) {
            (Some(held), Some(named)) => (held.dev(), held.ino()) != (named.dev(), named.ino()),
            (held, _) => held.is_some(),
        }
    }

    fn read(&mut self, page: &mut JournalPage) -> io::Result<()> {
        self.open()?;
        let Some(reader) = &mut self.reader else { return Ok(()) };
        loop {
            let room = LINE_MAX.saturating_sub(self.partial.len() as u64);
            let taken = reader.by_ref().take(room).read_until(b'\n', &mut self.partial)?;
            let is_whole = self.partial.ends_with(b"\n");
            if is_whole || self.partial.len() as u64 >= LINE_MAX {
                page.take(&self.partial);
                self.partial.clear();
            } else if taken == 0 {
                return Ok(());
            }
        }
    }
}
