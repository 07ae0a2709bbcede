//! A file merged with those that it extends.

use std::collections::BTreeSet;
use std::fmt::{self, Display, Formatter};
use std::io;
use std::path::{Path, PathBuf};

use magsteer_hal::invalid::Invalid;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::deserialize::{self, instead_of};
use super::elsewhere::Elsewhere;
use super::files::{Files, unreadable};
use super::problem::{Problem, ProblemKind, Problems};
use super::tree::{self, Node, Table, Value};

/// The key that names the file to be laid under this one.
const EXTENDS: &str = "extends";
/// Longest chain of files; a longer one is taken for a mistake.
const FILES_MAX: usize = 16;

/// One merged document, every value of which knows its file, line and column.
#[derive(Debug, Clone)]
pub struct Document {
    files: Files,
    root: Node,
}

/// A document as one TOML text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Resolved {
    /// The merged tables, keys in alphabetical order, without `extends`.
    pub text: String,
    /// SHA-256 of `text`, lower-case hexadecimal.
    pub sha256: String,
}

/// A number of a document. TOML tells whole ones (`5`) from others (`5.0`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// Written without a point.
    Whole(i64),
    /// Written with one.
    Decimal(f64),
}

impl Number {
    /// Another value, written in the same way; a whole number is rounded.
    #[must_use]
    pub fn with_value(self, value: f64) -> Self {
        match self {
            Self::Whole(_) => Self::Whole(value.round() as i64),
            Self::Decimal(_) => Self::Decimal(value),
        }
    }

    /// Its value.
    #[must_use]
    pub fn value(self) -> f64 {
        match self {
            Self::Whole(value) => value as f64,
            Self::Decimal(value) => value,
        }
    }
}

impl Display for Number {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole(value) => write!(formatter, "{value}"),
            Self::Decimal(value) => write!(formatter, "{value}"),
        }
    }
}

impl Document {
    /// Reads a file and the chain of files that it extends.
    ///
    /// `extends = "other.toml"` stands at the top level and is relative to the file that holds it.
    ///
    /// # Errors
    /// Files that cannot be read, every syntax error of the first file that has one, a chain that closes upon itself.
    pub fn load(path: &Path) -> Result<Self, Problems> {
        let name = path.display().to_string();
        let text =
            std::fs::read_to_string(path).map_err(|error| one(unreadable(name.clone(), reason(&error))))?;
        Self::from_text_in(name, text, Some(path))
    }

    /// Reads a text that is not a file; `name` stands in messages. It cannot extend a file.
    ///
    /// # Errors
    /// Every syntax error; a key `extends`.
    pub fn from_text(name: impl Into<String>, text: impl Into<String>) -> Result<Self, Problems> {
        Self::from_text_in(name.into(), text.into(), None)
    }

    fn from_text_in(name: String, text: String, path: Option<&Path>) -> Result<Self, Problems> {
        let mut files = Files::default();
        let mut path = path.map(Path::to_path_buf);
        let mut chain: Vec<PathBuf> = path.iter().map(|path| canonical(path)).collect();
        let mut file = files.add(name, text);
        let mut layers = Vec::new();
        loop {
            let mut node = tree::parse(&files, file).map_err(all)?;
            let base = take_base(&files, &mut node, path.as_deref())?;
            layers.push(node);
            let Some(base) = base else { break };
            let refuse = |kind, reason: String, expected: &str| {
                one(files.problem(kind, &base.place, EXTENDS, reason, expected))
            };
            if chain.contains(&canonical(&base.path)) {
                let expected = "a file that does not lead back to this chain";
                let words = format!("{} ({})", files.words(&base.place), chain_names(&chain, &base.path));
                return Err(refuse(ProblemKind::Value, words, expected));
            }
            if chain.len() == FILES_MAX {
                let expected = format!("at most {FILES_MAX} files in a chain");
                return Err(refuse(ProblemKind::Value, files.words(&base.place), &expected));
            }
            let text = std::fs::read_to_string(&base.path).map_err(|error| {
                let words = format!("{} ({})", base.path.display(), reason(&error));
                refuse(ProblemKind::Unreadable, words, "a readable TOML file, relative to this one")
            })?;
            chain.push(canonical(&base.path));
            file = files.add(base.path.display().to_string(), text);
            path = Some(base.path);
        }
        let root = layers.into_iter().rev().reduce(tree::merge);
        let empty =
            || Node { place: super::files::Place { file: 0, span: 0..0 }, value: Value::Table(Table::new()) };
        Ok(Self { files, root: root.unwrap_or_else(empty) })
    }

    /// The files read, the one named first in front.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        self.files.names()
    }

    /// True when the document has the top-level key.
    #[must_use]
    pub fn has(&self, key: &str) -> bool {
        self.top().is_some_and(|table| table.contains_key(key))
    }

    /// Every top-level key that is not in `known`, as problems.
    #[must_use]
    pub fn unknown_keys(&self, known: &[&str]) -> Vec<Problem> {
        let entries = self.top().into_iter().flatten();
        let unread: BTreeSet<String> = entries
            .clone()
            .map(|(name, _)| name.clone())
            .filter(|name| !known.contains(&name.as_str()))
            .collect();
        let unknown = entries.filter(|(name, _)| unread.contains(*name));
        let elsewhere = Elsewhere { section: (&self.root, ""), whole: &self.root, unread: &unread };
        unknown
            .map(|(name, entry)| {
                let value = self.files.words(&entry.node.place);
                let expected = instead_of(name, known, &elsewhere);
                self.files.problem(ProblemKind::UnknownKey, &entry.key, name, value, expected)
            })
            .collect()
    }

    /// Reads the top-level table `key` into the type of the module that it belongs to. Ranges are that module's to
    /// check; hand what it refuses to [`Document::refuse`].
    ///
    /// # Errors
    /// The table when it is missing; every key in it that is unknown, missing or of another type.
    pub fn section<T: DeserializeOwned>(&self, key: &str) -> Result<T, Problems> {
        match self.top().and_then(|table| table.get(key)) {
            Some(entry) => deserialize::read(&self.files, &self.root, (&entry.node, key)).map_err(all),
            None => Err(self.without(key)),
        }
    }

    /// A section that a command cannot do without, though others can.
    ///
    /// # Errors
    /// The table as missing, when there is none.
    pub fn require<'s, T>(&self, key: &str, section: &'s Option<T>) -> Result<&'s T, Problems> {
        section.as_ref().ok_or_else(|| self.without(key))
    }

    /// Reads several top-level tables as the fields of one struct; other tables are passed over.
    ///
    /// # Errors
    /// As [`Document::section`].
    pub fn sections<T: DeserializeOwned>(&self, keys: &[&str]) -> Result<T, Problems> {
        let mut table = self.top().cloned().unwrap_or_default();
        table.retain(|name, _| keys.contains(&name.as_str()));
        let part = Node { place: self.root.place.clone(), value: Value::Table(table) };
        deserialize::read(&self.files, &self.root, (&part, "")).map_err(all)
    }

    /// Reads the whole document into one type.
    ///
    /// # Errors
    /// Every key that is unknown, missing or of another type.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, Problems> {
        deserialize::read(&self.files, &self.root, (&self.root, "")).map_err(all)
    }

    /// Refused values, keyed from the root, each with its place in the files.
    #[must_use]
    pub fn refuse(&self, refused: Vec<Invalid>) -> Vec<Problem> {
        let place = |invalid: Invalid| {
            let (place, _) = self.root.locate(&invalid.key);
            self.files.problem(ProblemKind::Value, &place, invalid.key, invalid.value, invalid.expected)
        };
        refused.into_iter().map(place).collect()
    }

    /// The number at a key (as `plant.rod.first_mode_damping_ratio`); `None` when there is none.
    #[must_use]
    pub fn number(&self, key: &str) -> Option<Number> {
        match &self.root.find(key)?.value {
            Value::Integer(value) => Some(Number::Whole(*value)),
            Value::Float(value) => Some(Number::Decimal(*value)),
            _ => None,
        }
    }

    /// Puts another number where one stands; false, and nothing is changed, when there is none at that key.
    /// Problems still show the text of the file.
    pub fn set_number(&mut self, key: &str, number: Number) -> bool {
        let Some(Node { value: value @ (Value::Integer(_) | Value::Float(_)), .. }) = self.root.find_mut(key)
        else {
            return false;
        };
        *value = match number {
            Number::Whole(number) => Value::Integer(number),
            Number::Decimal(number) => Value::Float(number),
        };
        true
    }

    /// Puts another text where one stands; false, and nothing is changed, when there is none at that key. Problems still
    /// show the text of the file, and a path counts from there.
    pub fn set_text(&mut self, key: &str, text: &str) -> bool {
        let Some(Node { value: Value::Text(old), .. }) = self.root.find_mut(key) else { return false };
        text.clone_into(old);
        true
    }

    /// The text at a key as a path: relative to the file that says so. `None` when there is no text.
    #[must_use]
    pub fn path_at(&self, key: &str) -> Option<PathBuf> {
        let node = self.root.find(key)?;
        let Value::Text(text) = &node.value else { return None };
        let file = self.files.names().nth(node.place.file)?;
        Some(Path::new(file).parent().unwrap_or(Path::new("")).join(text))
    }

    /// The merged document as one text with its digest.
    #[must_use]
    pub fn resolved(&self) -> Resolved {
        let text = toml::to_string_pretty(&self.root.to_toml())
            .expect("a tree read from TOML has nothing that TOML cannot say");
        let digest = Sha256::digest(text.as_bytes());
        let sha256 = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        Resolved { text, sha256 }
    }

    fn without(&self, key: &str) -> Problems {
        let expected = format!("a table [{key}] in this file or in one that it extends");
        one(self.files.problem(ProblemKind::Missing, &self.root.place, key, "", expected))
    }

    fn top(&self) -> Option<&Table> {
        match &self.root.value {
            Value::Table(table) => Some(table),
            _ => None,
        }
    }
}

/// The file named by `extends`.
struct Base {
    path: PathBuf,
    place: super::files::Place,
}

/// Takes `extends` out of a file's tree.
fn take_base(files: &Files, node: &mut Node, path: Option<&Path>) -> Result<Option<Base>, Problems> {
    let Value::Table(table) = &mut node.value else { return Ok(None) };
    let Some(entry) = table.remove(EXTENDS) else { return Ok(None) };
    let place = entry.node.place;
    let refuse = |expected: &str| {
        Err(one(files.problem(ProblemKind::Value, &place, EXTENDS, files.words(&place), expected)))
    };
    let Value::Text(name) = entry.node.value else {
        return refuse("the path of a file, relative to this one");
    };
    let Some(path) = path else { return refuse("left out: this text is not a file") };
    Ok(Some(Base { path: path.parent().unwrap_or(Path::new("")).join(name), place }))
}

fn chain_names(chain: &[PathBuf], next: &Path) -> String {
    let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let names: Vec<String> = chain.iter().map(PathBuf::as_path).chain([next]).map(name).collect();
    names.join(" -> ")
}

fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

fn reason(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::NotFound => "no such file".to_owned(),
        io::ErrorKind::InvalidData => "not UTF-8 text".to_owned(),
        _ => error.to_string(),
    }
}

fn one(problem: Problem) -> Problems {
    all(vec![problem])
}

fn all(problems: Vec<Problem>) -> Problems {
    Problems::new(problems).expect("a refusal carries at least one problem")
}
