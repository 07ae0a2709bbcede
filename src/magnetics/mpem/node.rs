//! YAML as a tree in which every value knows its line.
//!
//! Calibrations use little of YAML: mappings, sequences, numbers, texts and the empty value. Tags, anchors,
//! aliases, several documents, keys that stand twice and keys that are not texts are refused: what they mean
//! differs between readers, and a number that two readers read differently is a wrong field.

use saphyr_parser::{Event, Parser, ScalarStyle, ScanError, Tag};

use crate::math::csv::{Refusal, shortened};

/// Deepest nesting read; a calibration has five levels.
const DEPTH_MAX: usize = 16;
/// Most values read: 32 coils of 8 sources with 10 coefficients have about five thousand.
const NODES_MAX: usize = 100_000;

/// A value and where it stands.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// Line, 1 first.
    pub line: usize,
    pub value: Value,
}

#[derive(Debug, Clone)]
pub(super) enum Value {
    /// A number or a text, as written; `plain` without quotes.
    Scalar {
        text: String,
        plain: bool,
    },
    Sequence(Vec<Node>),
    Mapping(Vec<Entry>),
}

/// A key and its value.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    pub key: String,
    /// Line of the key.
    pub line: usize,
    pub node: Node,
}

impl Node {
    /// The value in words, for a refusal.
    pub fn words(&self) -> String {
        match &self.value {
            Value::Scalar { text, plain: true } if text.is_empty() => "nothing".to_owned(),
            Value::Scalar { text, plain: true } => shortened(text),
            Value::Scalar { text, plain: false } => format!("{:?}", shortened(text)),
            Value::Sequence(items) => format!("a sequence of {}", items.len()),
            Value::Mapping(entries) => format!("a mapping of {} keys", entries.len()),
        }
    }

    /// True for an empty value and for `~` and `null`.
    pub fn is_null(&self) -> bool {
        matches!(&self.value, Value::Scalar { text, plain: true }
            if matches!(text.as_str(), "" | "~" | "null" | "Null" | "NULL"))
    }
}

/// Reads one document.
///
/// # Errors
/// The first thing that is no YAML, or none of the YAML that is read here.
pub(super) fn parse(text: &str) -> Result<Node, Refusal> {
    let mut parser = Parser::new_from_str(text);
    let mut builder = Builder::default();
    // What is missing at the end of the text is said to be on the line after it.
    let last_line = text.lines().count().max(1);
    while let Some(event) = parser.next_event() {
        let (event, span) = event.map_err(|error| syntax(&error, last_line))?;
        builder.take(event, span.start.line().min(last_line))?;
    }
    builder.root.ok_or_else(|| Refusal::new(1, "file", "an empty file", "a calibration in YAML"))
}

fn syntax(error: &ScanError, last_line: usize) -> Refusal {
    Refusal::new(error.marker().line().min(last_line), "YAML", error.info(), "right YAML")
}

/// A mapping or sequence that is still open.
struct Open {
    node: Node,
    /// The key that waits for its value.
    key: Option<(String, usize)>,
}

#[derive(Default)]
struct Builder {
    open: Vec<Open>,
    root: Option<Node>,
    nodes: usize,
}

impl Builder {
    fn take(&mut self, event: Event<'_>, line: usize) -> Result<(), Refusal> {
        match event {
            Event::DocumentStart(_) if self.root.is_some() => {
                Err(Refusal::new(line, "file", "a second document", "one document"))
            }
            Event::Alias(_) => Err(Refusal::new(line, "YAML", "an alias", "the value written out")),
            Event::Scalar(text, style, anchor, tag) => {
                check_plainness(line, anchor, tag.as_deref())?;
                let plain = style == ScalarStyle::Plain;
                self.put(Node { line, value: Value::Scalar { text: text.into_owned(), plain } })
            }
            Event::SequenceStart(anchor, tag) => {
                check_plainness(line, anchor, tag.as_deref())?;
                self.open(Node { line, value: Value::Sequence(Vec::new()) })
            }
            Event::MappingStart(anchor, tag) => {
                check_plainness(line, anchor, tag.as_deref())?;
                self.open(Node { line, value: Value::Mapping(Vec::new()) })
            }
            Event::SequenceEnd | Event::MappingEnd => match self.open.pop() {
                Some(closed) => self.put(closed.node),
                None => Ok(()),
            },
            Event::Nothing
            | Event::StreamStart
            | Event::StreamEnd
            | Event::DocumentStart(_)
            | Event::DocumentEnd => Ok(()),
        }
    }

    fn open(&mut self, node: Node) -> Result<(), Refusal> {
        if self.open.len() >= DEPTH_MAX {
            let value = format!("more than {DEPTH_MAX} levels");
            return Err(Refusal::new(node.line, "YAML", value, "a calibration, of five levels"));
        }
        self.open.push(Open { node, key: None });
        Ok(())
    }

    /// Puts a finished value where it belongs.
    fn put(&mut self, node: Node) -> Result<(), Refusal> {
        self.nodes += 1;
        if self.nodes > NODES_MAX {
            let value = format!("more than {NODES_MAX} values");
            return Err(Refusal::new(node.line, "YAML", value, "a calibration, of some thousand values"));
        }
        let Some(parent) = self.open.last_mut() else {
            self.root = Some(node);
            return Ok(());
        };
        match &mut parent.node.value {
            Value::Sequence(items) => items.push(node),
            Value::Mapping(entries) => match parent.key.take() {
                Some((key, line)) => entries.push(Entry { key, line, node }),
                None => parent.key = Some((key_of(&node, entries)?, node.line)),
            },
            Value::Scalar { .. } => {}
        }
        Ok(())
    }
}

/// The text of a key that does not stand among `entries` already.
fn key_of(node: &Node, entries: &[Entry]) -> Result<String, Refusal> {
    let Value::Scalar { text, .. } = &node.value else {
        return Err(Refusal::new(node.line, "YAML", node.words(), "a name before the colon"));
    };
    match entries.iter().find(|entry| entry.key == *text) {
        Some(first) => {
            let value = format!("given before, on line {}", first.line);
            Err(Refusal::new(node.line, shortened(text), value, "given once"))
        }
        None => Ok(text.clone()),
    }
}

fn check_plainness(line: usize, anchor: usize, tag: Option<&Tag>) -> Result<(), Refusal> {
    if let Some(tag) = tag {
        return Err(Refusal::new(line, "YAML", format!("the tag {tag}"), "without tags"));
    }
    if anchor != 0 {
        return Err(Refusal::new(line, "YAML", "an anchor", "without anchors"));
    }
    Ok(())
}
