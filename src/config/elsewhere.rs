//! A key at the wrong place: where in the document it would be right.
//!
//! **Problem.** Whoever puts `time_constant_ms` into `[control]` in place of `[control.disturbance]` did not
//! misspell it.
//!
//! **Method.** The types of the tables cannot be asked for their keys, but the document can: most extend a
//! complete one. The same key is looked for in the section, then in the whole document, then a similar one in
//! the section; of those found, the ones that lie least deep are named. Keys that nothing reads are no
//! answer.

use std::collections::BTreeSet;

use super::problem::edit_distance;
use super::tree::{Node, Value, child};

/// Most places that are named.
const PLACES_MAX: usize = 3;
/// Letters of a key from which on a longer one that begins with it is similar.
const STEM_MIN: usize = 6;

/// A key and the path that ends in it.
type Found<'a> = (&'a str, String);

/// Where a key that nothing reads was found.
pub(super) struct Elsewhere<'a> {
    /// The part of the document that is read, and its path.
    pub section: (&'a Node, &'a str),
    /// All of it.
    pub whole: &'a Node,
    /// Paths of all keys of the section that nothing reads.
    pub unread: &'a BTreeSet<String>,
}

impl Elsewhere<'_> {
    /// Paths of the key `name`: at most three, none when no other table has it.
    pub fn same(&self, name: &str) -> Vec<String> {
        let of = |node, path| {
            let mut found = Vec::new();
            keys(node, path, self.unread, &mut found);
            shallowest(found.iter().filter(|(key, _)| *key == name))
        };
        let here = of(self.section.0, self.section.1);
        if here.is_empty() { of(self.whole, "") } else { here }
    }

    /// Paths in the section of the keys that are most like `name`: at most three, none when none is.
    pub fn similar(&self, name: &str) -> Vec<String> {
        let mut found = Vec::new();
        keys(self.section.0, self.section.1, self.unread, &mut found);
        let similar = found.iter().filter(|(key, _)| are_similar(name, key));
        let nearest = similar.clone().map(|(key, _)| edit_distance(name, key)).min();
        shallowest(similar.filter(|(key, _)| Some(edit_distance(name, key)) == nearest))
    }
}

/// Stricter than within one table: a document has many keys.
fn are_similar(name: &str, key: &str) -> bool {
    let is_stem = name.len().min(key.len()) >= STEM_MIN && (key.starts_with(name) || name.starts_with(key));
    is_stem || 4 * edit_distance(name, key) <= name.chars().count()
}

/// The paths with the fewest dots; entries of an array count as one place.
fn shallowest<'a>(found: impl Iterator<Item = &'a Found<'a>> + Clone) -> Vec<String> {
    let depth = |path: &str| path.matches('.').count();
    let least = found.clone().map(|(_, path)| depth(path)).min();
    let mut seen = BTreeSet::new();
    let shallow = found.filter(|(_, path)| Some(depth(path)) == least);
    let first = shallow.filter(|(_, path)| seen.insert(path.replace(|sign: char| sign.is_ascii_digit(), "")));
    first.take(PLACES_MAX).map(|(_, path)| path.clone()).collect()
}

/// Every key below `node` that something reads.
fn keys<'a>(node: &'a Node, path: &str, unread: &BTreeSet<String>, found: &mut Vec<Found<'a>>) {
    match &node.value {
        Value::Table(table) => {
            for (name, entry) in table {
                let path = child(path, name);
                if !unread.contains(&path) {
                    keys(&entry.node, &path, unread, found);
                    found.push((name, path));
                }
            }
        }
        Value::Array(nodes) => {
            for (index, node) in nodes.iter().enumerate() {
                keys(node, &format!("{path}[{index}]"), unread, found);
            }
        }
        _ => {}
    }
}
