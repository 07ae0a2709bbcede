//! Reads typed configurations straight from the tree, so that a refusal keeps its place, and goes on after it.
//!
//! **Problem.** Serde stops at the first error, and its message is a sentence without a place.
//!
//! **Method.** [`NodeReader`] is a deserialiser over the tree that knows the path it is at. Keys that a struct does not have are
//! noted and passed over. Any other refusal ends the attempt; its path is then marked, and the next attempt finds a [`StandIn`](super::stand_in::StandIn) there, which gives
//! whatever type is asked for. Each attempt thus yields one refusal more, until the rest reads through. A value built with
//! stand-ins is thrown away.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{self, Display, Formatter};

use serde::de::{self, DeserializeOwned, Error, Unexpected};

use super::elsewhere::Elsewhere;
use super::files::Files;
use super::node_reader::NodeReader;
use super::problem::{Problem, ProblemKind, edit_distance, listed, nearest, one_of, suggestion};
use super::tree::{Entry, Node, Value, child};

/// Most refusals reported at once; each costs one attempt.
const REFUSALS_MAX: usize = 100;

/// Reads `node`, which stands at `path` of the `whole` document, into `T`.
///
/// # Errors
/// Every key that is unknown, missing or of another type.
pub(super) fn read<T: DeserializeOwned>(
    files: &Files,
    whole: &Node,
    (node, path): (&Node, &str),
) -> Result<T, Vec<Problem>> {
    let mut attempt = Attempt::default();
    let mut problems = Vec::new();
    let mut result = None;
    for _ in 0..REFUSALS_MAX {
        match T::deserialize(NodeReader { node, path: path.to_owned(), attempt: &attempt }) {
            Ok(value) => {
                result = Some(value);
                break;
            }
            Err(refusal) => {
                let key = refusal.key();
                problems.push(refusal.problem(files, node, path));
                // A stand-in was refused as well: nothing more can be learnt.
                if !attempt.marked.insert(key) {
                    break;
                }
            }
        }
    }
    let unknown = attempt.unknown.into_inner();
    let unread: BTreeSet<String> = unknown.keys().cloned().collect();
    let problem = |unknown: Unknown| unknown.problem(files, whole, (node, path), &unread);
    problems.extend(unknown.into_values().map(problem));
    match result {
        Some(value) if problems.is_empty() => Ok(value),
        _ => Err(problems),
    }
}

/// What one attempt knows of the earlier ones.
#[derive(Default)]
pub(super) struct Attempt {
    /// Paths that were refused: stand-ins go there.
    pub marked: BTreeSet<String>,
    /// Unknown keys by path.
    pub unknown: RefCell<BTreeMap<String, Unknown>>,
}

/// A key that nothing reads.
pub(super) struct Unknown {
    /// Its path from the root.
    pub path: String,
    /// Where it stands, and its value.
    pub entry: Entry,
    /// The key itself.
    pub name: String,
    /// The keys that would have been read.
    pub known: &'static [&'static str],
}

impl Unknown {
    fn problem(
        self,
        files: &Files,
        whole: &Node,
        section: (&Node, &str),
        unread: &BTreeSet<String>,
    ) -> Problem {
        let value = files.words(&self.entry.node.place);
        let expected = instead_of(&self.name, self.known, &Elsewhere { section, whole, unread });
        files.problem(ProblemKind::UnknownKey, &self.entry.key, self.path, value, expected)
    }
}

/// What to say of a key that nothing reads: what was likely meant, by a slip of the hand or at another place;
/// else what there is.
pub(super) fn instead_of(name: &str, known: &[&str], elsewhere: &Elsewhere<'_>) -> String {
    let slip = nearest(name, known);
    // That a key begins like one of this table says less than that another table has it.
    let is_sure = |slip: &&str| !name.starts_with(slip) || edit_distance(name, slip) <= 2;
    if let Some(slip) = slip.filter(is_sure) {
        return suggestion(&[slip]);
    }
    let same = elsewhere.same(name);
    if !same.is_empty() {
        return suggestion(&same);
    }
    if let Some(slip) = slip {
        return suggestion(&[slip]);
    }
    let similar = elsewhere.similar(name);
    if similar.is_empty() { listed(known) } else { suggestion(&similar) }
}

/// Tables beside that at `path` which have `field` and nearly its name: `[materials.pmc770]` for
/// `[materials.pmc777]`.
fn twin(root: &Node, path: &str, field: &str) -> Option<String> {
    let (parent, name) = path.rsplit_once('.')?;
    let Value::Table(tables) = &root.find(parent)?.value else { return None };
    let has = |entry: &Entry| matches!(&entry.node.value, Value::Table(table) if table.contains_key(field));
    let others: Vec<&str> = tables
        .iter()
        .filter(|(other, entry)| *other != name && has(entry))
        .map(|(other, _)| other.as_str())
        .collect();
    nearest(name, &others).map(|other| child(parent, other))
}

/// A refusal of serde or of a type's own `Deserialize`.
#[derive(Debug)]
pub(super) struct Refusal {
    /// Path of the innermost value that was being read; `None` until it is known.
    path: Option<String>,
    reason: Reason,
}

#[derive(Debug)]
enum Reason {
    Missing(&'static str),
    Expected(String),
}

impl Refusal {
    fn new(reason: Reason) -> Self {
        Self { path: None, reason }
    }

    /// Says where, unless that is known already.
    pub fn at(mut self, path: &str) -> Self {
        self.path.get_or_insert_with(|| path.to_owned());
        self
    }

    /// The path that a stand-in must take.
    fn key(&self) -> String {
        let path = self.path.as_deref().unwrap_or_default();
        match self.reason {
            Reason::Missing(field) => child(path, field),
            Reason::Expected(_) => path.to_owned(),
        }
    }

    fn problem(&self, files: &Files, node: &Node, root: &str) -> Problem {
        let path = self.path.as_deref().unwrap_or(root);
        let relative = path.strip_prefix(root).unwrap_or(path);
        let relative = relative.strip_prefix('.').unwrap_or(relative);
        let (place, _) = node.locate(relative);
        match &self.reason {
            Reason::Missing(field) => {
                let table = if path.is_empty() { "the file".to_owned() } else { format!("`{path}`") };
                let twin = twin(node, relative, field).map(|twin| child(root, &twin));
                let twin = twin.map_or_else(String::new, |twin| format!("; {}", suggestion(&[twin])));
                let expected = format!("given in {table}{twin}");
                files.problem(ProblemKind::Missing, &place, child(path, field), "", expected)
            }
            Reason::Expected(expected) => {
                files.problem(ProblemKind::Value, &place, path, files.words(&place), expected)
            }
        }
    }
}

impl std::error::Error for Refusal {}

impl Display for Refusal {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match &self.reason {
            Reason::Missing(field) => write!(formatter, "{field} is missing"),
            Reason::Expected(expected) => write!(formatter, "must be {expected}"),
        }
    }
}

impl Error for Refusal {
    fn custom<T: Display>(message: T) -> Self {
        Self::new(Reason::Expected(message.to_string()))
    }

    fn invalid_type(_: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::new(Reason::Expected(in_plain_words(&expected.to_string())))
    }

    fn invalid_value(_: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        Self::new(Reason::Expected(in_plain_words(&expected.to_string())))
    }

    fn invalid_length(length: usize, expected: &dyn de::Expected) -> Self {
        let expected = in_plain_words(&expected.to_string());
        Self::new(Reason::Expected(format!("{expected}, not of {length}")))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self::new(Reason::Expected(one_of(variant, expected)))
    }

    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        Self::new(Reason::Expected(format!("without `{field}`; its keys are {}", one_of(field, expected))))
    }

    fn missing_field(field: &'static str) -> Self {
        Self::new(Reason::Missing(field))
    }
}

/// Serde speaks of Rust's types; a person who writes TOML does not.
fn in_plain_words(expected: &str) -> String {
    match expected {
        "f32" | "f64" => "a number".to_owned(),
        "u64" | "usize" => "a whole number >= 0".to_owned(),
        "u8" => "a whole number from 0 to 255".to_owned(),
        "u16" => "a whole number from 0 to 65535".to_owned(),
        "u32" => "a whole number from 0 to 4294967295".to_owned(),
        "i8" | "i16" | "i32" | "i64" | "isize" => "a whole number".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a string" => "a text in quotes".to_owned(),
        "a sequence" => "an array".to_owned(),
        "a map" => "a table".to_owned(),
        _ if expected.starts_with("struct ") => "a table".to_owned(),
        _ => match expected.strip_prefix("an array of length ") {
            Some(length) => format!("an array of {length} numbers"),
            None => expected.to_owned(),
        },
    }
}
