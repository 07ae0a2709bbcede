//! The texts that a document was read from, and places in them.

use std::ops::Range;

use super::problem::{Excerpt, Problem, ProblemKind};

/// A stretch of one file's text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    /// Index into [`Files`].
    pub file: usize,
    /// Bytes of the text.
    pub span: Range<usize>,
}

/// Every text read for a document; the one named first stands first.
#[derive(Debug, Clone, Default)]
pub(super) struct Files {
    texts: Vec<(String, String)>,
}

impl Files {
    /// Keeps a text under the name that messages use; returns its index.
    pub fn add(&mut self, name: String, text: String) -> usize {
        self.texts.push((name, text));
        self.texts.len() - 1
    }

    /// Names in the order of reading.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.texts.iter().map(|(name, _)| name.as_str())
    }

    /// The text of a file.
    pub fn text(&self, file: usize) -> &str {
        &self.texts[file].1
    }

    /// The words at a place on one line, shortened to what a message can hold.
    pub fn words(&self, place: &Place) -> String {
        const CHARACTERS_MAX: usize = 60;
        let text = self.text(place.file).get(place.span.clone()).unwrap_or_default();
        let line = text.split_whitespace().collect::<Vec<_>>().join(" ");
        if line.chars().count() <= CHARACTERS_MAX {
            return line;
        }
        let start: String = line.chars().take(CHARACTERS_MAX).collect();
        format!("{start}...")
    }

    /// A problem at a place.
    pub fn problem(
        &self,
        kind: ProblemKind,
        place: &Place,
        key: impl Into<String>,
        value: impl Into<String>,
        expected: impl Into<String>,
    ) -> Problem {
        let (name, text) = &self.texts[place.file];
        let start = floor_boundary(text, place.span.start);
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        let line_end = text[start..].find('\n').map_or(text.len(), |at| start + at);
        let end = floor_boundary(text, place.span.end).clamp(start, line_end);
        let indent = text[line_start..start].chars().count();
        Problem {
            problem: kind,
            file: name.clone(),
            line: text[..line_start].matches('\n').count() + 1,
            column: indent + 1,
            key: key.into(),
            value: value.into(),
            expected: expected.into(),
            excerpt: Some(Excerpt {
                // A tab would shift the carets: it counts as one character, so it is shown as one.
                text: text[line_start..line_end].trim_end_matches('\r').replace('\t', " "),
                indent,
                width: text[start..end].chars().count().max(1),
            }),
        }
    }
}

/// A problem with a file as a whole.
pub(super) fn unreadable(file: impl Into<String>, reason: impl Into<String>) -> Problem {
    Problem {
        problem: ProblemKind::Unreadable,
        file: file.into(),
        line: 0,
        column: 0,
        key: String::new(),
        value: reason.into(),
        expected: "a readable TOML file".to_owned(),
        excerpt: None,
    }
}

fn floor_boundary(text: &str, at: usize) -> usize {
    let mut at = at.min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at
}
