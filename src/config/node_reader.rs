//! Serde's view of a node of the tree.

use std::collections::btree_map;

use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, IntoDeserializer, MapAccess, SeqAccess, VariantAccess,
    Visitor,
};
use serde::forward_to_deserialize_any;

use super::deserialize::{Attempt, Refusal, Unknown};
use super::problem::one_of;
use super::stand_in::StandIn;
use super::tree::{Entry, Node, Table, Value, child};

/// Deserialises one node.
pub(super) struct NodeReader<'a> {
    /// The node.
    pub node: &'a Node,
    /// Its path from the root.
    pub path: String,
    /// What is known from earlier attempts.
    pub attempt: &'a Attempt,
}

impl NodeReader<'_> {
    fn is_marked(&self) -> bool {
        self.attempt.marked.contains(&self.path)
    }
}

/// A node that was refused before gives a stand-in, any other whatever it holds.
macro_rules! read_unless_marked {
    ($($method:ident)*) => {
        $(fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
            if self.is_marked() { StandIn.$method(visitor) } else { self.deserialize_any(visitor) }
        })*
    };
}

impl<'de> Deserializer<'de> for NodeReader<'_> {
    type Error = Refusal;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        let Self { node, path, attempt } = self;
        let result = match &node.value {
            Value::Text(text) => visitor.visit_str(text),
            Value::Integer(value) => visitor.visit_i64(*value),
            Value::Float(value) => visitor.visit_f64(*value),
            Value::Boolean(value) => visitor.visit_bool(*value),
            Value::Datetime(value) => visitor.visit_string(value.to_string()),
            Value::Array(nodes) => {
                let mut elements = Elements { nodes, next: 0, path: &path, attempt };
                visitor.visit_seq(&mut elements).and_then(|value| {
                    let count = nodes.len();
                    let expected = format!("an array of {} entries, not of {count}", elements.next);
                    if elements.next == count { Ok(value) } else { Err(Refusal::custom(expected)) }
                })
            }
            Value::Table(table) => visitor.visit_map(Fields::new(table, &path, attempt, None)),
        };
        result.map_err(|refusal| refusal.at(&path))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        if self.is_marked() {
            return StandIn.deserialize_struct(name, fields, visitor);
        }
        let Value::Table(table) = &self.node.value else {
            return Err(Refusal::custom("a table").at(&self.path));
        };
        let access = Fields::new(table, &self.path, self.attempt, Some(fields));
        visitor.visit_map(access).map_err(|refusal| refusal.at(&self.path))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refusal> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        if self.is_marked() {
            return StandIn.deserialize_enum(name, variants, visitor);
        }
        let Self { node, path, attempt } = self;
        let refuse = |expected: String| Err(Refusal::custom(expected).at(&path));
        match &node.value {
            Value::Text(text) if variants.contains(&text.as_str()) => {
                let variant: StrDeserializer<'_, Refusal> = text.as_str().into_deserializer();
                visitor.visit_enum(variant).map_err(|refusal| refusal.at(&path))
            }
            Value::Text(text) => refuse(one_of(text, variants)),
            Value::Table(table) => match table.iter().next() {
                Some((name, entry)) if table.len() == 1 && variants.contains(&name.as_str()) => {
                    let path = child(&path, name);
                    visitor.visit_enum(Variant {
                        name,
                        content: NodeReader { node: &entry.node, path, attempt },
                    })
                }
                Some((name, entry)) if table.len() == 1 => {
                    let (path, entry, name) = (child(&path, name), entry.clone(), name.clone());
                    let unknown = Unknown { path, entry, name, known: variants };
                    attempt.unknown.borrow_mut().insert(unknown.path.clone(), unknown);
                    StandIn.deserialize_enum("", variants, visitor)
                }
                _ => refuse(format!("a table with exactly one of {}", variants.join(", "))),
            },
            _ => refuse(format!("one of {}", variants.join(", "))),
        }
    }

    read_unless_marked! {
        deserialize_bool deserialize_i8 deserialize_i16 deserialize_i32 deserialize_i64
        deserialize_u8 deserialize_u16 deserialize_u32 deserialize_u64 deserialize_f32 deserialize_f64
        deserialize_str deserialize_string deserialize_seq deserialize_map
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Refusal> {
        if self.is_marked() {
            StandIn.deserialize_tuple(length, visitor)
        } else {
            self.deserialize_any(visitor)
        }
    }

    forward_to_deserialize_any! {
        i128 u128 char bytes byte_buf unit unit_struct tuple_struct identifier ignored_any
    }
}

/// Elements of an array.
struct Elements<'a> {
    nodes: &'a [Node],
    next: usize,
    path: &'a str,
    attempt: &'a Attempt,
}

impl<'de> SeqAccess<'de> for &mut Elements<'_> {
    type Error = Refusal;

    fn next_element_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Refusal> {
        let Some(node) = self.nodes.get(self.next) else { return Ok(None) };
        let path = format!("{}[{}]", self.path, self.next);
        self.next += 1;
        seed.deserialize(NodeReader { node, path, attempt: self.attempt }).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.nodes.len() - self.next)
    }
}

/// Entries of a table.
struct Fields<'a> {
    entries: btree_map::Iter<'a, String, Entry>,
    /// The entry whose key was given last; `None` after a missing field.
    current: Option<(&'a str, &'a Node)>,
    /// Fields of the struct that are not in the table and were refused as missing.
    missing: Vec<&'static str>,
    /// Every field of the struct; `None` when any key is welcome.
    known: Option<&'static [&'static str]>,
    path: &'a str,
    attempt: &'a Attempt,
}

impl<'a> Fields<'a> {
    fn new(
        table: &'a Table,
        path: &'a str,
        attempt: &'a Attempt,
        known: Option<&'static [&'static str]>,
    ) -> Self {
        let missing = known.unwrap_or_default().iter().copied();
        let missing = missing
            .filter(|field| !table.contains_key(*field) && attempt.marked.contains(&child(path, field)))
            .collect();
        Self { entries: table.iter(), current: None, missing, known, path, attempt }
    }

    /// The next entry that the struct has; unknown ones are noted on the way.
    fn next_known(&mut self) -> Option<(&'a str, &'a Node)> {
        for (name, entry) in self.entries.by_ref() {
            match self.known {
                Some(known) if !known.contains(&name.as_str()) => {
                    let path = child(self.path, name);
                    let (entry, name) = (entry.clone(), name.clone());
                    let unknown = Unknown { path: path.clone(), entry, name, known };
                    self.attempt.unknown.borrow_mut().insert(path, unknown);
                }
                _ => return Some((name, &entry.node)),
            }
        }
        None
    }
}

impl<'de> MapAccess<'de> for Fields<'_> {
    type Error = Refusal;

    fn next_key_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<Option<S::Value>, Refusal> {
        self.current = self.next_known();
        let name = match self.current {
            Some((name, _)) => name,
            None => match self.missing.pop() {
                Some(field) => field,
                None => return Ok(None),
            },
        };
        let name: StrDeserializer<'_, Refusal> = name.into_deserializer();
        seed.deserialize(name).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'de>>(&mut self, seed: S) -> Result<S::Value, Refusal> {
        match self.current {
            Some((name, node)) => {
                let path = child(self.path, name);
                seed.deserialize(NodeReader { node, path, attempt: self.attempt })
            }
            None => seed.deserialize(StandIn),
        }
    }
}

/// The only entry of a table that stands for an enum: the variant's name and its content.
struct Variant<'a> {
    name: &'a str,
    content: NodeReader<'a>,
}

impl<'de, 'a> EnumAccess<'de> for Variant<'a> {
    type Error = Refusal;
    type Variant = NodeReader<'a>;

    fn variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<(S::Value, NodeReader<'a>), Refusal> {
        let name: StrDeserializer<'_, Refusal> = self.name.into_deserializer();
        Ok((seed.deserialize(name)?, self.content))
    }
}

impl<'de> VariantAccess<'de> for NodeReader<'_> {
    type Error = Refusal;

    fn unit_variant(self) -> Result<(), Refusal> {
        Err(Refusal::custom("given as a text in quotes: it has no keys").at(&self.path))
    }

    fn newtype_variant_seed<S: DeserializeSeed<'de>>(self, seed: S) -> Result<S::Value, Refusal> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Refusal> {
        self.deserialize_tuple(length, visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refusal> {
        self.deserialize_struct("", fields, visitor)
    }
}
