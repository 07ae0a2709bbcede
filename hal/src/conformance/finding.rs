//! What the suite reports.

use std::fmt;

use super::clause::Clause;

/// A clause that the rig broke.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Which.
    pub clause: Clause,
    /// What was found instead.
    pub detail: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} ({}): {}", self.clause.id(), self.clause, self.detail)
    }
}

/// What became of one clause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Kept.
    Kept,
    /// Broken.
    Broken,
    /// Not tried: the rig or what was found before did not let it.
    NotTried,
}

impl Verdict {
    /// The word a person reads.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kept => "pass",
            Self::Broken => "fail",
            Self::NotTried => "skip",
        }
    }
}

/// What was found of one clause.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Which.
    pub clause: Clause,
    /// Kept or broken.
    pub verdict: Verdict,
    /// What was measured, or why it was not tried.
    pub measured: String,
    /// Time that it took, s.
    pub elapsed_s: f64,
}

/// What one attempt came to: what was measured, or in which way the clause is broken.
pub(super) type Outcome = Result<Measured, String>;

/// What was measured while a clause was kept.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Measured {
    Found(String),
    NotTried(&'static str),
}

/// A kept clause.
pub(super) fn found(what: impl Into<String>) -> Outcome {
    Ok(Measured::Found(what.into()))
}

/// A clause that this rig does not let be tried.
pub(super) const fn not_tried(why: &'static str) -> Outcome {
    Ok(Measured::NotTried(why))
}
