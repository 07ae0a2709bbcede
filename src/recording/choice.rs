//! Which cycles and which columns of a recording a table has.
//!
//! Terms: a *field* is a quantity of a cycle, `measured_a`; its *columns* are the numbers that it is made of, named in full,
//! `coil.iron-0.measured_a`. A name picks the field or the column of that name, or else every column that it begins, up to a
//! dot or an underscore: `magnet.m1` all of a magnet, `magnet.m1.measured` its three components.

use super::cycle::{Cycle, Field};
use super::info::Info;
use super::value::Per;
use crate::config::nearest;

/// Answers of a cycle at most.
const ANSWERS: usize = magsteer_hal::record::CYCLE_ANSWERS;

/// What of a recording goes into a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// Of so many cycles one: the first, and from there every so many-th; at least 1.
    pub every: u64,
    /// Names of fields and columns, or what columns begin with; all of them when empty.
    pub names: Vec<String>,
}

impl Default for Choice {
    /// Everything.
    fn default() -> Self {
        Self { every: 1, names: Vec::new() }
    }
}

/// A name that picks nothing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name}: names no column{}", nearest.as_ref().map_or(String::new(), |nearest| format!("; did you mean `{nearest}`?")))]
pub struct UnknownColumn {
    /// The name.
    pub name: String,
    /// The one that was probably meant.
    pub nearest: Option<String>,
}

/// One field of a table.
#[derive(Debug, Clone)]
pub(super) struct Chosen {
    /// Its place in [`Cycle::FIELDS`].
    pub index: usize,
    /// It.
    pub field: &'static Field,
    /// Names of its columns.
    pub columns: Vec<String>,
    /// Which of them are chosen.
    pub is_chosen: Vec<bool>,
}

impl Choice {
    /// The fields of a table of this recording, in the order of a cycle; of each at least one column is chosen.
    ///
    /// # Errors
    /// When a name picks nothing.
    pub(super) fn of(&self, info: &Info) -> Result<Vec<Chosen>, UnknownColumn> {
        let mut fields: Vec<Chosen> = Cycle::FIELDS
            .iter()
            .enumerate()
            .map(|(index, field)| {
                let columns = columns(field, info);
                Chosen { index, field, is_chosen: vec![self.names.is_empty(); columns.len()], columns }
            })
            .collect();
        for name in &self.names {
            pick(name, &mut fields)?;
        }
        fields.retain(|field| field.is_chosen.contains(&true));
        Ok(fields)
    }
}

impl Chosen {
    /// Names of the columns that are chosen.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().zip(&self.is_chosen).filter(|(_, is_chosen)| **is_chosen).map(|(name, _)| &**name)
    }
}

/// Chooses what a name picks.
fn pick(name: &str, fields: &mut [Chosen]) -> Result<(), UnknownColumn> {
    let is_exact = fields
        .iter()
        .any(|field| field.field.name == name || field.columns.iter().any(|column| column == name));
    let picks = |field: &Field, column: &str| {
        if is_exact {
            return field.name == name || column == name;
        }
        let rest = column.strip_prefix(name).filter(|_| !name.is_empty());
        rest.is_some_and(|rest| name.ends_with(['.', '_']) || rest.starts_with(['.', '_']))
    };
    let mut picked = 0;
    for field in &mut *fields {
        for (column, is_chosen) in field.columns.iter().zip(&mut field.is_chosen) {
            if picks(field.field, column) {
                *is_chosen = true;
                picked += 1;
            }
        }
    }
    if picked > 0 {
        return Ok(());
    }
    let columns = fields.iter().flat_map(|field| &field.columns).map(String::as_str);
    let known: Vec<&str> = fields.iter().map(|field| field.field.name).chain(columns).collect();
    let meant = nearest(name, &known).filter(|_| !name.is_empty());
    Err(UnknownColumn { name: name.to_owned(), nearest: meant.map(str::to_owned) })
}

/// Entries of a field in a recording.
pub(super) fn entries(field: &Field, info: &Info) -> usize {
    match field.per {
        Per::Cycle => 1,
        Per::Coil => info.coils.len(),
        Per::Frame => info.frames.len(),
        Per::Magnet => info.magnets.len(),
        Per::Answer => ANSWERS,
    }
}

/// Names of a field's columns: `coil.iron-0.measured_a`, `magnet.m1.position_x_m`.
fn columns(field: &Field, info: &Info) -> Vec<String> {
    let named = |kind: &str, names: &[String]| -> Vec<String> {
        names.iter().map(|name| format!("{kind}.{name}.")).collect()
    };
    let prefixes = match field.per {
        Per::Cycle => vec![String::new()],
        Per::Coil => named("coil", &info.coils),
        Per::Frame => named("frame", &info.frames),
        Per::Magnet => named("magnet", &info.magnets),
        Per::Answer => (1..=ANSWERS).map(|number| format!("answer.{number}.")).collect(),
    };
    // The unit stays last.
    let unit = ["_rad", "_m"].into_iter().find(|unit| field.parts.len() > 1 && field.name.ends_with(unit));
    let unit = unit.unwrap_or("");
    let stem = &field.name[..field.name.len() - unit.len()];
    let parts = |prefix: &String| -> Vec<String> {
        field.parts.iter().map(|part| format!("{prefix}{stem}{part}{unit}")).collect()
    };
    prefixes.iter().flat_map(parts).collect()
}

#[cfg(test)]
mod tests {
    use super::{Choice, UnknownColumn};
    use crate::recording::Info;

    fn info() -> Info {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Info {
            coils: names(&["left", "right"]),
            frames: names(&["top"]),
            magnets: names(&["m1", "m12"]),
            ..Info::default()
        }
    }

    fn chosen(names: &[&str]) -> Result<Vec<String>, UnknownColumn> {
        let choice = Choice { every: 1, names: names.iter().map(|name| (*name).to_owned()).collect() };
        let fields = choice.of(&info())?;
        Ok(fields.iter().flat_map(|field| field.names()).map(str::to_owned).collect())
    }

    #[test]
    fn names_pick_fields_columns_and_what_they_begin() {
        let cases: [(&[&str], &[&str]); 5] = [
            (&["measured_a", "number"], &["number", "coil.left.measured_a", "coil.right.measured_a"]),
            (&["coil.right.measured_a", "coil.right.measured_a"], &["coil.right.measured_a"]),
            (
                &["magnet.m1.measured"],
                &["magnet.m1.measured_x", "magnet.m1.measured_y", "magnet.m1.measured_z"],
            ),
            (&["magnet.m1.position_x_m"], &["magnet.m1.position_x_m"]),
            (&["frame.top.measured_"], &["frame.top.measured_rad"]),
        ];
        for (names, expected) in cases {
            assert_eq!(chosen(names).expect("known"), expected, "{names:?}");
        }
        let magnet = chosen(&["magnet.m1"]).expect("known");
        assert!(magnet.len() > 20 && magnet.iter().all(|name| name.starts_with("magnet.m1.")), "{magnet:?}");
        assert_eq!(chosen(&["magnet.m1."]).expect("known"), magnet);
        assert!(chosen(&[]).expect("everything").len() > 100);
    }

    #[test]
    fn names_that_pick_nothing_are_refused_with_the_nearest() {
        for (name, nearest) in [
            ("mesured_a", Some("measured_a")),
            ("coil.left.mesured_a", Some("coil.left.measured_a")),
            ("nothing-of-that-kind-at-all", None),
            ("", None),
        ] {
            let refused = chosen(&["number", name]).expect_err("unknown");
            assert_eq!((&*refused.name, refused.nearest.as_deref()), (name, nearest));
        }
    }
}
