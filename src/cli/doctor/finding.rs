//! One line of the answer.

use std::fmt::{self, Display, Formatter};

use serde::Serialize;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Level {
    /// As it should be.
    Pass,
    /// Works, at a price that the line names.
    Warn,
    /// A control loop is not to be trusted on this machine, or does not run at all.
    Fail,
}

impl Display for Level {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::Pass => "PASS",
            Self::Warn => "WARN",
            Self::Fail => "FAIL",
        })
    }
}

/// What was looked at, what was found, and what mends it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Stable name of the check.
    pub check: &'static str,
    pub level: Level,
    /// What was found, in words.
    pub found: String,
    /// The command or edit that mends it; absent where all is well.
    pub mend: Option<String>,
}

impl Finding {
    pub fn pass(check: &'static str, found: impl Into<String>) -> Self {
        Self { check, level: Level::Pass, found: found.into(), mend: None }
    }

    pub fn warn(check: &'static str, found: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { check, level: Level::Warn, found: found.into(), mend: Some(mend.into()) }
    }

    pub fn fail(check: &'static str, found: impl Into<String>, mend: impl Into<String>) -> Self {
        Self { level: Level::Fail, ..Self::warn(check, found, mend) }
    }

    /// A failure where `grave`, else a warning.
    pub fn graded(
        check: &'static str,
        grave: bool,
        found: impl Into<String>,
        mend: impl Into<String>,
    ) -> Self {
        if grave { Self::fail(check, found, mend) } else { Self::warn(check, found, mend) }
    }
}

impl Display for Finding {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}  {:18} {}", self.level, self.check, self.found)?;
        match &self.mend {
            Some(mend) => write!(formatter, "\n      {:18} -> {mend}", ""),
            None => Ok(()),
        }
    }
}
