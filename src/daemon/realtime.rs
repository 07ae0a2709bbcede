//! What was asked of the kernel for real time, what holds, and why they differ, as people and programs read it.

use std::{fmt, io};

use serde::{Deserialize, Serialize};

use super::threads::ThreadView;

/// One property: wanted, and read back.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RealtimeItem {
    /// Which property.
    pub name: String,
    /// What was asked for.
    pub wanted: String,
    /// What the kernel says holds.
    pub got: String,
    /// True when both agree.
    pub granted: bool,
    /// Why not, when they differ; with what mends it.
    pub why_not: Option<String>,
}

impl RealtimeItem {
    /// A property with what mends it where it was not granted; `error` is the kernel's own word.
    pub(super) fn new(
        name: &str,
        wanted: String,
        got: String,
        granted: bool,
        error: Option<io::Error>,
        mend: &str,
    ) -> Self {
        let why_not = (!granted).then(|| match error {
            Some(error) => format!("{error}; {mend}"),
            None => mend.to_owned(),
        });
        Self { name: name.to_owned(), wanted, got, granted, why_not }
    }
}

/// What holds for the thread that asked.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct RealtimeReport {
    /// Every property that was asked for.
    pub items: Vec<RealtimeItem>,
    /// Every thread of the process as the kernel had it once all ran.
    pub threads: Vec<ThreadView>,
}

impl RealtimeReport {
    /// True when everything asked for holds.
    #[must_use]
    pub fn is_granted(&self) -> bool {
        self.items.iter().all(|item| item.granted)
    }
}

impl fmt::Display for RealtimeReport {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, item) in self.items.iter().enumerate() {
            let separator = if index == 0 { "" } else { "; " };
            write!(formatter, "{separator}{}: {}", item.name, item.got)?;
            if let Some(why_not) = &item.why_not {
                write!(formatter, " (wanted {}: {why_not})", item.wanted)?;
            }
        }
        Ok(())
    }
}
