//! TOML as a tree whose every node remembers where it was written.

use std::collections::BTreeMap;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::files::{Files, Place};
use super::problem::{Problem, ProblemKind};

/// Entries of a table by name, so that the order of writing never matters.
pub(super) type Table = BTreeMap<String, Entry>;

/// A key and its value.
#[derive(Debug, Clone)]
pub(super) struct Entry {
    /// Where the key was written.
    pub key: Place,
    /// Its value.
    pub node: Node,
}

/// A value and where it was written.
#[derive(Debug, Clone)]
pub(super) struct Node {
    /// The value's text; for a table opened by a header, that header.
    pub place: Place,
    /// The value.
    pub value: Value,
}

/// A TOML value.
#[derive(Debug, Clone)]
pub(super) enum Value {
    /// `"text"`
    Text(String),
    /// `1`
    Integer(i64),
    /// `1.0`
    Float(f64),
    /// `true`
    Boolean(bool),
    /// A date or a time, kept as written.
    Datetime(toml::value::Datetime),
    /// `[1, 2]` or `[[name]]`
    Array(Vec<Node>),
    /// `{ a = 1 }` or `[name]`
    Table(Table),
}

/// Parses one of the `files`.
///
/// # Errors
/// Every syntax error, and every integer or float that does not fit 64 bits.
pub(super) fn parse(files: &Files, file: usize) -> Result<Node, Vec<Problem>> {
    let (root, errors) = DeTable::parse_recoverable(files.text(file));
    let problem = |error: &toml::de::Error| {
        let place = Place { file, span: error.span().unwrap_or(0..0) };
        files.problem(ProblemKind::Syntax, &place, "", files.words(&place), error.message())
    };
    let mut converter = Converter { files, file, problems: errors.iter().map(problem).collect() };
    let value = Value::Table(converter.table(root.get_ref(), ""));
    if converter.problems.is_empty() {
        Ok(Node { place: Place { file, span: 0..0 }, value })
    } else {
        Err(converter.problems)
    }
}

struct Converter<'f> {
    files: &'f Files,
    file: usize,
    problems: Vec<Problem>,
}

impl Converter<'_> {
    fn table(&mut self, table: &DeTable<'_>, path: &str) -> Table {
        let mut entries = Table::new();
        for (key, value) in table {
            let name = key.get_ref().to_string();
            let node = self.node(value, &child(path, &name));
            entries.insert(name, Entry { key: Place { file: self.file, span: key.span() }, node });
        }
        entries
    }

    fn node(&mut self, value: &Spanned<DeValue<'_>>, path: &str) -> Node {
        let place = Place { file: self.file, span: value.span() };
        let value = match value.get_ref() {
            DeValue::String(text) => Value::Text(text.to_string()),
            DeValue::Integer(digits) => {
                let value = i64::from_str_radix(digits.as_str(), digits.radix());
                Value::Integer(self.number(value, &place, path, "a whole number that fits 64 bits"))
            }
            DeValue::Float(digits) => {
                Value::Float(self.number(digits.as_str().parse(), &place, path, "a number"))
            }
            DeValue::Boolean(value) => Value::Boolean(*value),
            DeValue::Datetime(value) => Value::Datetime(*value),
            DeValue::Array(values) => {
                let element = |(index, value): (usize, &Spanned<DeValue<'_>>)| {
                    self.node(value, &format!("{path}[{index}]"))
                };
                Value::Array(values.iter().enumerate().map(element).collect())
            }
            DeValue::Table(table) => Value::Table(self.table(table, path)),
        };
        Node { place, value }
    }

    fn number<T: Default, E>(&mut self, value: Result<T, E>, place: &Place, path: &str, expected: &str) -> T {
        value.unwrap_or_else(|_| {
            let value = self.files.words(place);
            self.problems.push(self.files.problem(ProblemKind::Value, place, path, value, expected));
            T::default()
        })
    }
}

/// Lays `over` on `under`: tables merge key by key, everything else replaces.
pub(super) fn merge(under: Node, over: Node) -> Node {
    let (Value::Table(mut merged), Value::Table(above)) = (under.value, over.value.clone()) else {
        return over;
    };
    for (name, entry) in above {
        let entry = match merged.remove(&name) {
            Some(below) => Entry { key: entry.key, node: merge(below.node, entry.node) },
            None => entry,
        };
        merged.insert(name, entry);
    }
    Node { place: over.place, value: Value::Table(merged) }
}

impl Node {
    /// The node as plain TOML, without places.
    pub fn to_toml(&self) -> toml::Value {
        match &self.value {
            Value::Text(text) => toml::Value::String(text.clone()),
            Value::Integer(value) => toml::Value::Integer(*value),
            Value::Float(value) => toml::Value::Float(*value),
            Value::Boolean(value) => toml::Value::Boolean(*value),
            Value::Datetime(value) => toml::Value::Datetime(*value),
            Value::Array(nodes) => toml::Value::Array(nodes.iter().map(Self::to_toml).collect()),
            Value::Table(table) => toml::Value::Table(
                table.iter().map(|(name, entry)| (name.clone(), entry.node.to_toml())).collect(),
            ),
        }
    }

    /// The deepest node or key on the way along `path` (as `coils[2].frame`): its place, and whether the whole path led there.
    pub fn locate(&self, path: &str) -> (Place, bool) {
        let (mut node, mut rest) = (self, path);
        while !rest.is_empty() {
            let Some((hop, remaining)) = node.hop(rest) else { return (node.place.clone(), false) };
            let Some(found) = node.below(hop) else { return (node.place.clone(), false) };
            (node, rest) = (found, remaining);
        }
        (node.place.clone(), true)
    }

    /// The node at the end of `path`.
    pub fn find(&self, path: &str) -> Option<&Self> {
        let (mut node, mut rest) = (self, path);
        while !rest.is_empty() {
            let (hop, remaining) = node.hop(rest)?;
            (node, rest) = (node.below(hop)?, remaining);
        }
        Some(node)
    }

    /// The node at the end of `path`, to change it.
    pub fn find_mut(&mut self, path: &str) -> Option<&mut Self> {
        let (mut node, mut rest) = (self, path);
        while !rest.is_empty() {
            let (hop, remaining) = node.hop(rest)?;
            node = match (&mut node.value, hop) {
                (Value::Table(table), Hop::Key(name)) => &mut table.get_mut(name)?.node,
                (Value::Array(nodes), Hop::Index(index)) => nodes.get_mut(index)?,
                _ => return None,
            };
            rest = remaining;
        }
        Some(node)
    }

    /// The first hop of a path from here, and the path that remains.
    fn hop<'p>(&self, path: &'p str) -> Option<(Hop<'p>, &'p str)> {
        match &self.value {
            Value::Table(table) => {
                let rests = table.keys().filter_map(|name| Some((name.len(), after_key(path, name)?)));
                let (length, rest) = rests.max_by_key(|(length, _)| *length)?;
                Some((Hop::Key(&path[..length]), rest))
            }
            Value::Array(_) => after_index(path).map(|(index, rest)| (Hop::Index(index), rest)),
            _ => None,
        }
    }

    fn below(&self, hop: Hop<'_>) -> Option<&Self> {
        match (&self.value, hop) {
            (Value::Table(table), Hop::Key(name)) => table.get(name).map(|entry| &entry.node),
            (Value::Array(nodes), Hop::Index(index)) => nodes.get(index),
            _ => None,
        }
    }
}

/// One step of a path.
enum Hop<'p> {
    Key(&'p str),
    Index(usize),
}

/// The path of a key below `path`.
pub(super) fn child(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

/// What follows `key` at the start of a path, when it stands there as a whole.
fn after_key<'p>(path: &'p str, key: &str) -> Option<&'p str> {
    let rest = path.strip_prefix(key)?;
    if rest.is_empty() || rest.starts_with('[') { Some(rest) } else { rest.strip_prefix('.') }
}

/// The index at the start of a path, and what follows.
fn after_index(path: &str) -> Option<(usize, &str)> {
    let (index, rest) = path.strip_prefix('[')?.split_once(']')?;
    Some((index.parse().ok()?, rest.strip_prefix('.').unwrap_or(rest)))
}
