//! The text of a calibration file to its values: every key known, every number finite, every name listed.

use nalgebra::Vector3;

use super::calibration::{Calibration, CoilSources};
use super::node::{Entry, Node, Value, parse};
use super::source::Source;
use crate::math::csv::{Refusal, shortened};

/// Keys of the file beside its coils.
pub(super) const SYSTEM_NAME: &str = "System_Name";
pub(super) const COIL_LIST: &str = "Coil_List";
pub(super) const WORKSPACE: &str = "Workspace_Dimensions";
/// Key of a coil beside its sources.
pub(super) const SOURCE_LIST: &str = "Source_List";
/// Keys of a source.
pub(super) const A_COEFF: &str = "A_Coeff";
pub(super) const B_COEFF: &str = "B_Coeff";
pub(super) const DIRECTION: &str = "Source_Direction";
pub(super) const POSITION: &str = "Source_Position";
/// A coil whose name holds this is the field without currents.
pub(super) const OFFSET: &str = "Offset";

/// A calibrated box has edges of at most this, m: a longer one is in other units.
const EDGE_MAX: f64 = 2.0;
/// Directions shorter than this are none.
const DIRECTION_MIN: f64 = 1e-9;

/// Reads the bytes of a calibration file.
///
/// # Errors
/// The first thing that is not as it must be, with line, key, value and what would be right.
pub fn read(bytes: &[u8]) -> Result<Calibration, Refusal> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count() + 1;
        Refusal::new(line, "text", format!("0x{:02x}", bytes[error.valid_up_to()]), "UTF-8")
    })?;
    if text.starts_with("%YAML:") {
        let value = text.lines().next().unwrap_or_default();
        let expected = "left out: this first line is OpenCV's, no YAML";
        return Err(Refusal::new(1, "file", shortened(value), expected));
    }
    let root = parse(text)?;
    let file = Table::new("", root.line, &root)?;
    let (listed, listed_line) = file.names(COIL_LIST)?;
    let known = |key: &str| [SYSTEM_NAME, COIL_LIST, WORKSPACE].contains(&key) || listed.contains(&key);
    file.check_keys(known, &format!("{SYSTEM_NAME}, {COIL_LIST}, {WORKSPACE}, or a name of {COIL_LIST}"))?;
    let workspace = workspace(&file)?;
    let name = file.text(SYSTEM_NAME)?;
    let (backgrounds, coils): (Vec<&str>, Vec<&str>) = listed.iter().partition(|name| name.contains(OFFSET));
    if coils.is_empty() {
        return Err(Refusal::new(listed_line, COIL_LIST, "without a coil", "the names of the coils"));
    }
    if backgrounds.len() > 1 {
        let value = format!("with {}", backgrounds.join(", "));
        return Err(Refusal::new(listed_line, COIL_LIST, value, format!("with one {OFFSET} at most")));
    }
    let read_all = |names: &[&str]| -> Result<Vec<CoilSources>, Refusal> {
        names.iter().map(|name| coil(&file, name)).collect()
    };
    Ok(Calibration {
        name,
        workspace,
        coils: read_all(&coils)?,
        background: read_all(&backgrounds)?.pop(),
        ends_with_line_end: text.ends_with('\n'),
    })
}

fn coil(file: &Table<'_>, name: &str) -> Result<CoilSources, Refusal> {
    let entry = file.entry(name)?;
    let table = Table::new(name, entry.line, &entry.node)?;
    let (listed, line) = table.names(SOURCE_LIST)?;
    if listed.is_empty() {
        let key = table.path(SOURCE_LIST);
        return Err(Refusal::new(line, key, "without a source", "the names of one or more sources"));
    }
    let known = |key: &str| key == SOURCE_LIST || listed.contains(&key);
    table.check_keys(known, &format!("{SOURCE_LIST}, or a name of {SOURCE_LIST}"))?;
    let sources: Vec<Source> = listed.iter().map(|name| source(&table, name)).collect::<Result<_, _>>()?;
    Ok(CoilSources { name: name.to_owned(), line: entry.line, sources })
}

fn source(coil: &Table<'_>, name: &str) -> Result<Source, Refusal> {
    let entry = coil.entry(name)?;
    let table = Table::new(&coil.path(name), entry.line, &entry.node)?;
    let keys = [A_COEFF, B_COEFF, DIRECTION, POSITION];
    table.check_keys(|key| keys.contains(&key), &keys.join(", "))?;
    let position = table.vector(POSITION)?;
    let direction = table.vector(DIRECTION)?;
    let length = direction.norm();
    if length < DIRECTION_MIN {
        let words = format!("{:?}", direction.as_slice());
        return Err(Refusal::new(
            table.entry(DIRECTION)?.line,
            table.path(DIRECTION),
            words,
            "a vector other than zero",
        ));
    }
    Ok(Source {
        name: name.to_owned(),
        line: entry.line,
        position,
        direction: direction / length,
        rising: table.numbers(A_COEFF)?,
        falling: table.numbers(B_COEFF)?,
    })
}

fn workspace(file: &Table<'_>) -> Result<[[f64; 2]; 3], Refusal> {
    let entry = file.entry(WORKSPACE)?;
    let expected = "three pairs of numbers, least and greatest x, y and z";
    let refuse = |words: String| Refusal::new(entry.line, WORKSPACE, words, expected);
    let Value::Sequence(rows) = &entry.node.value else { return Err(refuse(entry.node.words())) };
    if rows.len() != 3 {
        return Err(refuse(entry.node.words()));
    }
    let mut workspace = [[0.0; 2]; 3];
    for (axis, (range, row)) in workspace.iter_mut().zip(rows).enumerate() {
        let key = format!("{WORKSPACE}[{axis}]");
        let numbers = numbers(&key, row)?;
        let &[least, greatest] = numbers.as_slice() else {
            let expected = "two numbers, the least and the greatest";
            return Err(Refusal::new(row.line, key, row.words(), expected));
        };
        let value = format!("from {least} to {greatest}");
        if least >= greatest {
            return Err(Refusal::new(row.line, key, value, "a range, the least number first"));
        }
        if greatest - least > EDGE_MAX {
            let expected = format!("at most {EDGE_MAX} m long: in m, not in mm?");
            return Err(Refusal::new(row.line, key, value, expected));
        }
        *range = [least, greatest];
    }
    Ok(workspace)
}

/// A mapping and the path at which it stands.
struct Table<'a> {
    path: String,
    line: usize,
    entries: &'a [Entry],
}

impl<'a> Table<'a> {
    fn new(path: &str, line: usize, node: &'a Node) -> Result<Self, Refusal> {
        match &node.value {
            Value::Mapping(entries) => Ok(Self { path: path.to_owned(), line, entries }),
            _ => {
                let name = if path.is_empty() { "file" } else { path };
                Err(Refusal::new(line, name, node.words(), "a mapping of keys to values"))
            }
        }
    }

    /// The path of a key of this table.
    fn path(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    fn entry(&self, key: &str) -> Result<&'a Entry, Refusal> {
        let found = self.entries.iter().find(|entry| entry.key == key);
        found.ok_or_else(|| Refusal::new(self.line, self.path(key), "missing", "given: was the file cut?"))
    }

    fn check_keys(&self, is_known: impl Fn(&str) -> bool, expected: &str) -> Result<(), Refusal> {
        match self.entries.iter().find(|entry| !is_known(&entry.key)) {
            Some(entry) => {
                let key = self.path(&shortened(&entry.key));
                Err(Refusal::new(entry.line, key, "an unknown key", format!("one of {expected}")))
            }
            None => Ok(()),
        }
    }

    fn text(&self, key: &str) -> Result<String, Refusal> {
        let entry = self.entry(key)?;
        match &entry.node.value {
            Value::Scalar { text, .. } if !entry.node.is_null() => Ok(text.clone()),
            _ => Err(Refusal::new(entry.line, self.path(key), entry.node.words(), "a name")),
        }
    }

    /// Names that each stand once, and the line at which they are listed.
    fn names(&self, key: &str) -> Result<(Vec<&'a str>, usize), Refusal> {
        let entry = self.entry(key)?;
        let Value::Sequence(items) = &entry.node.value else {
            return Err(Refusal::new(entry.line, self.path(key), entry.node.words(), "a sequence of names"));
        };
        let mut names = Vec::with_capacity(items.len());
        for (index, item) in items.iter().enumerate() {
            let key = format!("{}[{index}]", self.path(key));
            match &item.value {
                Value::Scalar { text, .. } if names.contains(&text.as_str()) => {
                    return Err(Refusal::new(item.line, key, format!("{text} again"), "a name listed once"));
                }
                Value::Scalar { text, .. } if !item.is_null() => names.push(text.as_str()),
                _ => return Err(Refusal::new(item.line, key, item.words(), "a name")),
            }
        }
        Ok((names, entry.line))
    }

    fn numbers(&self, key: &str) -> Result<Vec<f64>, Refusal> {
        let entry = self.entry(key)?;
        // `A_Coeff: ~` is how the format writes that there are none.
        if entry.node.is_null() { Ok(Vec::new()) } else { numbers(&self.path(key), &entry.node) }
    }

    fn vector(&self, key: &str) -> Result<Vector3<f64>, Refusal> {
        let entry = self.entry(key)?;
        let numbers = numbers(&self.path(key), &entry.node)?;
        let count = numbers.len();
        let vector = <[f64; 3]>::try_from(numbers).map(Vector3::from);
        vector.map_err(|_| {
            Refusal::new(entry.line, self.path(key), format!("{count} numbers"), "three numbers, x, y and z")
        })
    }
}

/// The numbers of a sequence; each may stand in a sequence of its own, as matrices of one column do.
fn numbers(key: &str, node: &Node) -> Result<Vec<f64>, Refusal> {
    let Value::Sequence(items) = &node.value else {
        return Err(Refusal::new(node.line, key, node.words(), "a sequence of numbers"));
    };
    let number = |(index, item): (usize, &Node)| {
        let item = match &item.value {
            Value::Sequence(column) if column.len() == 1 => &column[0],
            _ => item,
        };
        let refuse =
            |expected: &str| Refusal::new(item.line, format!("{key}[{index}]"), item.words(), expected);
        let Value::Scalar { text, plain: true } = &item.value else { return Err(refuse("a number")) };
        let is_not_finite = |word: &str| matches!(word.to_ascii_lowercase().as_str(), "nan" | "inf");
        if is_not_finite(text.trim_start_matches(['+', '-', '.'])) {
            return Err(refuse("a finite number"));
        }
        let value: f64 = text.parse().map_err(|_| refuse("a number"))?;
        if value.is_finite() { Ok(value) } else { Err(refuse("a finite number")) }
    };
    items.iter().enumerate().map(number).collect()
}
