//! One refused value of a configuration, and how a person reads it.

use std::fmt::{self, Display, Formatter};

use serde::{Serialize, Serializer};

/// What is wrong, apart from where.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProblemKind {
    /// A file that could not be read.
    Unreadable,
    /// Text that is not TOML.
    Syntax,
    /// A key that nothing reads.
    UnknownKey,
    /// A key or table that must be there.
    Missing,
    /// A value of a wrong type, out of its range or in conflict with another.
    Value,
}

/// One refused value: where it stands, what it is and what would be right.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Problem {
    /// What is wrong.
    pub problem: ProblemKind,
    /// Path of the file, as it was named.
    pub file: String,
    /// Line, 1 first; 0 when the whole file is meant.
    pub line: usize,
    /// Column in characters, 1 first; 0 when the whole file is meant.
    pub column: usize,
    /// Path of the key from the root, as `coils[2].distance_mm`; empty when the text is not TOML.
    pub key: String,
    /// The value found; empty when a key is missing.
    pub value: String,
    /// What would have been accepted.
    pub expected: String,
    /// The line of the file and the characters to underline in it.
    #[serde(skip)]
    pub excerpt: Option<Excerpt>,
}

/// A line of a file with a part to underline.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excerpt {
    /// The line, without its end.
    pub text: String,
    /// Characters before the underlined part.
    pub indent: usize,
    /// Characters to underline, at least one.
    pub width: usize,
}

/// Every problem found; never empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Problems(Vec<Problem>);

impl Problems {
    /// Problems in the order of files, lines and columns; repetitions are dropped.
    ///
    /// Returns `None` when there are none.
    #[must_use]
    pub fn new(mut problems: Vec<Problem>) -> Option<Self> {
        let place =
            |problem: &Problem| (problem.file.clone(), problem.line, problem.column, problem.key.clone());
        problems.sort_by_key(place);
        problems.dedup();
        (!problems.is_empty()).then_some(Self(problems))
    }

    /// `value`, unless there are problems.
    ///
    /// # Errors
    /// The problems, when there are any.
    pub fn refuse<T>(problems: Vec<Problem>, value: T) -> Result<T, Self> {
        Self::new(problems).map_or(Ok(value), Err)
    }

    /// The problems, at least one.
    #[must_use]
    pub fn as_slice(&self) -> &[Problem] {
        &self.0
    }

    /// The problems, at least one.
    #[must_use]
    pub fn into_vec(self) -> Vec<Problem> {
        self.0
    }

    /// True when some file could not be read, so that nothing can be said of its content.
    #[must_use]
    pub fn unreadable(&self) -> bool {
        self.0.iter().any(|problem| problem.problem == ProblemKind::Unreadable)
    }
}

impl std::error::Error for Problems {}

impl Display for Problems {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        for (index, problem) in self.0.iter().enumerate() {
            if index > 0 {
                formatter.write_str("\n")?;
            }
            write!(formatter, "{problem}")?;
        }
        Ok(())
    }
}

impl Problem {
    /// The place as `file:line:column`, or the file alone.
    #[must_use]
    pub fn place(&self) -> String {
        if self.line == 0 {
            self.file.clone()
        } else {
            format!("{}:{}:{}", self.file, self.line, self.column)
        }
    }
}

impl Display for Problem {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self { key, value, expected, .. } = self;
        let place = self.place();
        match self.problem {
            ProblemKind::Unreadable => {
                write!(formatter, "{place}: cannot be read: {value}: must be {expected}")?
            }
            ProblemKind::Syntax if value.is_empty() => write!(formatter, "{place}: not TOML: {expected}")?,
            ProblemKind::Syntax => write!(formatter, "{place}: not TOML at `{value}`: {expected}")?,
            ProblemKind::UnknownKey => {
                write!(formatter, "{place}: {key} = {value}: unknown key: must be {expected}")?;
            }
            ProblemKind::Missing => write!(formatter, "{place}: {key} is missing: must be {expected}")?,
            ProblemKind::Value => write!(formatter, "{place}: {key} = {value}: must be {expected}")?,
        }
        let Some(excerpt) = &self.excerpt else { return Ok(()) };
        let number = self.line.to_string();
        let margin = " ".repeat(number.len());
        let indent = " ".repeat(excerpt.indent);
        let carets = "^".repeat(excerpt.width);
        write!(formatter, "\n{margin} |\n{number} | {}\n{margin} | {indent}{carets}", excerpt.text)
    }
}

/// Serialises as the list of problems.
impl Serialize for Problems {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

/// The names that are right in place of `found`: the likely one first, then all of them.
pub(super) fn one_of(found: &str, known: &[&str]) -> String {
    let all = if known.is_empty() { "left out".to_owned() } else { format!("one of {}", known.join(", ")) };
    match nearest(found, known) {
        Some(name) => format!("{all}; did you mean `{name}`?"),
        None => all,
    }
}

/// The known name with the fewest edits from `found`, when they are few enough to be a slip of the hand.
pub(crate) fn nearest<'a>(found: &str, known: &[&'a str]) -> Option<&'a str> {
    let (edits, name) = known.iter().map(|name| (edit_distance(found, name), *name)).min()?;
    let slip = 1 + found.chars().count() / 4;
    (edits <= slip || name.starts_with(found) || found.starts_with(name)).then_some(name)
}

/// Levenshtein's distance, row by row.
fn edit_distance(left: &str, right: &str) -> usize {
    let right: Vec<char> = right.chars().collect();
    let mut row: Vec<usize> = (0..=right.len()).collect();
    for (i, a) in left.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, b) in right.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[right.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distance_counts_insertions_deletions_and_replacements() {
        for (left, right, edits) in
            [("", "abc", 3), ("abc", "", 3), ("kitten", "sitting", 3), ("nmae", "name", 2), ("a", "a", 0)]
        {
            assert_eq!(edit_distance(left, right), edits, "{left} {right}");
        }
    }

    #[test]
    fn a_slip_is_suggested_and_a_different_word_is_not() {
        assert_eq!(nearest("nmae", &["axis", "name"]), Some("name"));
        assert_eq!(nearest("current_max", &["current_max_a", "slew_max_a_per_s"]), Some("current_max_a"));
        assert_eq!(nearest("colour", &["axis", "name"]), None);
    }
}
