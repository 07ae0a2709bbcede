//! The journal as lines for people.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::alert::Level;
use crate::daemon::recorder::{Entry, JournalTail, event, read_journal};

/// Lines kept.
const CAPACITY: usize = 50;

/// One event.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct EventLine {
    /// By the clock on the wall, RFC 3339.
    pub time: String,
    /// What happened.
    pub text: String,
    /// How much it matters.
    pub level: Level,
}

/// The newest events of one rig, as far as its journal can be read.
#[derive(Debug)]
pub struct EventFeed {
    rig: String,
    folder: PathBuf,
    tail: Option<JournalTail>,
    lines: VecDeque<EventLine>,
    taken: u64,
}

impl EventFeed {
    /// The events of `rig` in the journal of `folder`, from those that are there on.
    #[must_use]
    pub fn new(rig: &str, folder: &Path) -> Self {
        let mut feed = Self {
            rig: rig.to_owned(),
            folder: folder.to_owned(),
            tail: None,
            lines: VecDeque::with_capacity(CAPACITY),
            taken: 0,
        };
        // Opened first: what is written between the two is shown twice rather than never.
        feed.tail = JournalTail::at_end(folder).ok();
        let page = read_journal(folder).unwrap_or_default();
        feed.take(&page.entries);
        feed
    }

    /// Takes over what came since the last look. A journal that cannot be read has nothing to tell, and is
    /// tried again.
    pub fn look(&mut self) {
        if self.tail.is_none() {
            self.tail = JournalTail::at_end(&self.folder).ok();
        }
        match self.tail.as_mut().map(JournalTail::look) {
            Some(Ok(page)) => self.take(&page.entries),
            Some(Err(_)) => self.tail = None,
            None => {}
        }
    }

    fn take(&mut self, entries: &[Entry]) {
        for entry in entries.iter().filter(|entry| entry.rig == self.rig) {
            if self.lines.len() == CAPACITY {
                self.lines.pop_front();
            }
            self.lines.push_back(EventLine {
                time: entry.time.clone(),
                text: what(entry),
                level: level(entry),
            });
            self.taken += 1;
        }
    }

    /// The newest events, the oldest first.
    pub fn lines(&self) -> impl DoubleEndedIterator<Item = &EventLine> + ExactSizeIterator {
        self.lines.iter()
    }

    /// Events taken since the begin.
    #[must_use]
    pub const fn taken(&self) -> u64 {
        self.taken
    }
}

/// A fault is grave; a stop that nobody asked for, and what is lost, are warnings.
fn level(entry: &Entry) -> Level {
    use magsteer_hal::operator::{Cause, state};
    let wished = [Cause::OperatorStop.code(), Cause::Terminated.code()];
    let is_wished = entry.cause_code.is_none_or(|code| wished.contains(&code));
    match entry.event.as_str() {
        event::TRANSITION if entry.to.as_deref() == Some(state::name(state::FAULT)) => Level::Grave,
        event::TRANSITION if is_wished => Level::Note,
        event::START | event::STOP | event::FLIGHT => Level::Note,
        _ => Level::Warning,
    }
}

/// `2026-11-22T09:14:19.012345Z bigmag-planar cycle 1234: active -> safe-stop: no fresh poses (cause 200)`.
#[must_use]
pub fn words(entry: &Entry) -> String {
    let cycle = entry.cycle.map_or(String::new(), |cycle| format!(" cycle {cycle}"));
    format!("{} {}{cycle}: {}", entry.time, entry.rig, what(entry))
}

/// `active -> safe-stop: no fresh poses (cause 200)`.
fn what(entry: &Entry) -> String {
    let (from, to) = (entry.from.as_deref(), entry.to.as_deref().unwrap_or("unknown"));
    let mut words = match entry.event.as_str() {
        event::TRANSITION => format!("{} -> {to}", from.unwrap_or("unknown")),
        event::GIVEN_UP => "target given up".to_owned(),
        event::REFUSED => format!("{} refused", entry.request.as_deref().unwrap_or("request")),
        event::STOP => format!("ended {to}"),
        event::FLIGHT => format!("flight {}", entry.file.as_deref().unwrap_or("")),
        other => other.to_owned(),
    };
    if let (Some(cause), Some(code)) = (&entry.cause, entry.cause_code) {
        words += &format!(": {cause} (cause {code})");
    }
    // A flight's details say again what its cause says.
    if let Some(detail) = entry.detail.as_ref().filter(|_| entry.event != event::FLIGHT) {
        words += &format!("; {detail}");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::{EventFeed, Level, words};
    use crate::daemon::recorder::{Entry, JOURNAL, event};

    fn entry() -> Entry {
        Entry {
            time: "T".to_owned(),
            rig: "rig".to_owned(),
            cycle: Some(7),
            event: event::TRANSITION.to_owned(),
            from: Some("active".to_owned()),
            to: Some("safe-stop".to_owned()),
            cause_code: Some(200),
            cause: Some("no fresh poses".to_owned()),
            detail: Some("magnet 1 was not seen".to_owned()),
            ..Entry::default()
        }
    }

    #[test]
    fn an_event_is_one_line_with_its_cause() {
        let line = "T rig cycle 7: active -> safe-stop: no fresh poses (cause 200); magnet 1 was not seen";
        assert_eq!(words(&entry()), line);
    }

    #[test]
    fn feed_tells_of_its_own_rig_alone_and_goes_on_with_what_comes() {
        let folder = tempfile::tempdir().expect("a directory");
        let path = folder.path().join(JOURNAL);
        let line = |entry: &Entry| serde_json::to_string(entry).expect("plain data") + "\n";
        let mut feed = EventFeed::new("rig", folder.path());
        assert_eq!(feed.lines().len(), 0, "no journal yet");
        let other = Entry { rig: "other".to_owned(), ..entry() };
        let fault = Entry { to: Some("fault".to_owned()), ..entry() };
        let asked = Entry { cause_code: Some(100), ..entry() };
        let text: String = [entry(), other, fault, asked].iter().map(line).collect();
        std::fs::write(&path, text).expect("own directory");
        feed.look();
        let levels: Vec<Level> = feed.lines().map(|line| line.level).collect();
        assert_eq!(levels, [Level::Warning, Level::Grave, Level::Note]);
        assert_eq!((feed.taken(), EventFeed::new("rig", folder.path()).lines().len()), (3, 3));
    }
}
