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
                // A question names what was likely meant; anything else is what would be right.
                let head = format!("{place}: {key} = {value}: unknown key: ");
                if expected.ends_with('?') {
                    write!(formatter, "{head}{expected}")?;
                } else {
                    formatter.write_str(&folded(&format!("{head}must be {expected}")))?;
                }
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

/// Most keys that are listed for a person to choose from.
const LISTED_MAX: usize = 12;
/// Columns after which a list of keys goes on in a new line.
const COLUMNS_MAX: usize = 110;

/// What would be right in place of a key that nothing reads and that resembles none: the first of those there
/// are.
pub(super) fn listed(known: &[&str]) -> String {
    match known.len().checked_sub(LISTED_MAX) {
        _ if known.is_empty() => "left out".to_owned(),
        None | Some(0) => format!("one of {}", known.join(", ")),
        Some(rest) => format!("one of {} and {rest} more", known[..LISTED_MAX].join(", ")),
    }
}

/// The one question that names what was likely meant.
pub(super) fn suggestion<P: AsRef<str>>(meant: &[P]) -> String {
    let quoted: Vec<String> = meant.iter().map(|path| format!("`{}`", path.as_ref())).collect();
    format!("did you mean {}?", quoted.join(" or "))
}

/// The text with line ends in place of spaces, so that no line is longer than it must be.
fn folded(text: &str) -> String {
    let mut folded = String::with_capacity(text.len());
    let mut column = 0;
    for word in text.split(' ') {
        let width = word.chars().count();
        if column > 0 && column + 1 + width > COLUMNS_MAX {
            folded.push_str("\n    ");
            column = 4;
        } else if column > 0 {
            folded.push(' ');
            column += 1;
        }
        folded.push_str(word);
        column += width;
    }
    folded
}

/// The names that are right in place of `found`: all of them, and the likely one.
pub(super) fn one_of(found: &str, known: &[&str]) -> String {
    let all = if known.is_empty() { "left out".to_owned() } else { format!("one of {}", known.join(", ")) };
    match nearest(found, known) {
        Some(name) => format!("{all}; did you mean `{name}`?"),
        None => all,
    }
}

/// The known name with the fewest edits from `found`, when they are few enough to be a slip of the hand; else
/// one that goes on where `found` ends, as with its unit, or the other way round.
pub(crate) fn nearest<'a>(found: &str, known: &[&'a str]) -> Option<&'a str> {
    let (edits, name) = known.iter().map(|name| (edit_distance(found, name), *name)).min()?;
    let slip = 1 + found.chars().count() / 4;
    if edits <= slip {
        return Some(name);
    }
    known.iter().copied().find(|name| name.starts_with(found) || found.starts_with(name))
}

/// Levenshtein's distance, row by row.
pub(super) fn edit_distance(left: &str, right: &str) -> usize {
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
    fn a_long_list_of_keys_is_cut_and_says_so() {
        let keys: Vec<String> = (0..20).map(|index| format!("key_{index}")).collect();
        let keys: Vec<&str> = keys.iter().map(String::as_str).collect();
        assert_eq!(listed(&[]), "left out");
        assert!(listed(&keys[..12]).ends_with("key_10, key_11"), "{}", listed(&keys[..12]));
        assert!(listed(&keys).ends_with("key_10, key_11 and 8 more"), "{}", listed(&keys));
    }

    #[test]
    fn a_message_is_folded_between_words_and_loses_none() {
        let text = "word ".repeat(60) + "end";
        let folded = folded(&text);
        assert!(folded.lines().all(|line| line.chars().count() <= COLUMNS_MAX), "{folded}");
        assert!(folded.lines().count() == 3, "{folded}");
        assert_eq!(folded.split_whitespace().collect::<Vec<_>>().join(" "), text);
    }

    #[test]
    fn a_slip_is_suggested_and_a_different_word_is_not() {
        assert_eq!(nearest("nmae", &["axis", "name"]), Some("name"));
        assert_eq!(nearest("current_max", &["current_max_a", "slew_max_a_per_s"]), Some("current_max_a"));
        assert_eq!(nearest("rate", &["mode", "rate_hz"]), Some("rate_hz"));
        assert_eq!(nearest("colour", &["axis", "name"]), None);
    }
}
