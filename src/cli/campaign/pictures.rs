//! The pictures of a campaign: how fast and how exactly runs settled, and how that hangs together with what
//! was drawn.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::row::{Columns, RunRow};
use crate::cli::figures::{Scatter, Spread, scatters, spread};

/// Draws all pictures into `folder` and returns their paths; none without runs.
///
/// # Errors
/// When a picture cannot be drawn or written.
pub fn draw(folder: &Path, columns: &Columns, rows: &BTreeMap<u64, RunRow>) -> anyhow::Result<Vec<PathBuf>> {
    type Measure = fn(&RunRow) -> Option<f64>;
    // Where a run did not settle, its error says how it failed, not how exact it is.
    let measures: [(&str, &str, Measure); 2] = [
        ("settling", "slowest step settled after (s)", |row| row.settle_max_s),
        ("rms", "largest error RMS (deg)", |row| row.rms_max_deg.filter(|_| row.settled)),
    ];
    let mut files = Vec::new();
    for (name, label, measure) in measures {
        let values: Vec<f64> = rows.values().filter_map(measure).collect();
        if values.is_empty() {
            continue;
        }
        let path = folder.join(format!("{name}.png"));
        spread(&path, &Spread { label: label.to_owned(), values, members: rows.len() })?;
        files.push(path);
        if columns.drawn.is_empty() {
            continue;
        }
        let panels: Vec<Scatter> =
            columns.drawn.iter().enumerate().map(|(index, key)| panel(key, index, rows, measure)).collect();
        let path = folder.join(format!("{name}-against-draws.png"));
        scatters(&path, label, &panels)?;
        files.push(path);
    }
    Ok(files)
}

/// A measure against the `index`-th of the drawn values.
fn panel(
    key: &str,
    index: usize,
    rows: &BTreeMap<u64, RunRow>,
    measure: fn(&RunRow) -> Option<f64>,
) -> Scatter {
    let without = rows.values().filter(|row| measure(row).is_none());
    Scatter {
        // A key ends in its unit.
        label: key.strip_prefix("plant.").unwrap_or(key).to_owned(),
        points: rows.values().filter_map(|row| Some((row.drawn[index], measure(row)?))).collect(),
        without: without.map(|row| row.drawn[index]).collect(),
    }
}
