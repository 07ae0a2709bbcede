//! What makes a coil's field in truth: a winding, or the published series behind a core.

use std::sync::{Arc, Mutex, PoisonError};

use super::axial::Axial;
use super::multipole::Multipole;
use super::saturation::Saturation;
use super::table::{Domain, Table};
use super::winding::Winding;

/// Tables kept for the plants to come; a campaign builds thousands with the same few windings.
const TABLES_MAX: usize = 8;

/// What a type of coil is in truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CoilTruth {
    /// A winding without a core.
    Winding(Winding),
    /// The series of the description, behind a core that may saturate.
    Multipole(Saturation),
}

/// Field of one ampere, or of one effective ampere, about a coil's axis.
#[derive(Debug, Clone)]
pub enum Source {
    /// From the table where it reaches, else from the sum.
    Winding(Winding, Option<Arc<Table>>),
    /// From the series.
    Multipole(Multipole),
}

impl Source {
    /// Field at `x` along the axis and squared distance `u` from it, m and m^2.
    #[must_use]
    pub fn at(&self, x: f64, u: f64) -> Axial {
        match self {
            Self::Winding(winding, table) => {
                let tabulated = table.as_ref().and_then(|table| table.at(x, u));
                tabulated.unwrap_or_else(|| winding.at(x, u.sqrt()))
            }
            Self::Multipole(series) => series.at(x, u),
        }
    }

    /// A winding that will be asked for its field in `domain` above all. Tables of equal windings and domains
    /// are shared.
    #[must_use]
    pub fn winding(winding: Winding, domain: Domain) -> Self {
        Self::Winding(winding, shared_table(&winding, domain))
    }
}

/// A winding, where its field was asked for, and the table that came of it.
type Entry = (Winding, Domain, Option<Arc<Table>>);

/// The table of a winding, made when it is asked for the first time.
fn shared_table(winding: &Winding, domain: Domain) -> Option<Arc<Table>> {
    static TABLES: Mutex<Vec<Entry>> = Mutex::new(Vec::new());
    // A panic elsewhere leaves whole entries behind.
    let mut tables = TABLES.lock().unwrap_or_else(PoisonError::into_inner);
    let is_same = |entry: &&Entry| entry.0 == *winding && entry.1 == domain;
    if let Some((_, _, table)) = tables.iter().find(is_same) {
        return table.clone();
    }
    let table = Table::new(winding, domain).map(Arc::new);
    if tables.len() == TABLES_MAX {
        tables.remove(0);
    }
    tables.push((*winding, domain, table.clone()));
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDING: Winding =
        Winding { inner_radius: 0.024, outer_radius: 0.046, length: 0.05, turns: 1700.0 };

    #[test]
    fn equal_windings_share_a_table_and_others_do_not() {
        let domain = Domain { x_min: 0.05, x_max: 0.1, r_max: 0.02 };
        let table = |winding, domain| match Source::winding(winding, domain) {
            Source::Winding(_, Some(table)) => table,
            other => panic!("{other:?}"),
        };
        let first = table(WINDING, domain);
        assert!(Arc::ptr_eq(&first, &table(WINDING, domain)));
        assert!(!Arc::ptr_eq(&first, &table(Winding { turns: 1000.0, ..WINDING }, domain)));
        assert!(!Arc::ptr_eq(&first, &table(WINDING, Domain { x_max: 0.11, ..domain })));
    }

    #[test]
    fn beyond_its_table_a_winding_goes_on_by_the_sum() {
        let source = Source::winding(WINDING, Domain { x_min: 0.05, x_max: 0.1, r_max: 0.02 });
        for (x, r) in [(0.2, 0.01), (0.07, 0.03), (0.03, 0.0)] {
            let axial = source.at(x, r * r);
            assert!((axial.along / WINDING.at(x, r).along - 1.0).abs() < 1e-13);
        }
        // A table nearer than it pays is not made.
        let near = Source::winding(WINDING, Domain { x_min: 1e-4, x_max: 0.1, r_max: 0.02 });
        assert!(matches!(near, Source::Winding(_, None)));
    }
}
