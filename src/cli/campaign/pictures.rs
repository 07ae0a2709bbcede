//! The pictures of a campaign: how fast and how exactly runs settled, and how that hangs together with what was drawn.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::row::{Columns, RunRow};
use crate::cli::figures::{Scatter, Spread, scatters, spread};

/// Draws all pictures into `folder` and returns their paths; none without runs.
///
/// # Errors
/// When a picture cannot be drawn or written.
pub fn draw(folder: &Path, columns: &Columns, rows: &BTreeMap<u64, RunRow>) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let runs = rows.len();
    let of_all = |of: fn(&RunRow) -> Option<f64>| rows.values().filter_map(of).collect::<Vec<f64>>();
    let subjects = [
        ("settling", "slowest step of a run settled after (s)", of_all(|row| row.settle_max_s)),
        ("rms", "largest error RMS of a run (deg)", of_all(|row| row.rms_max_deg)),
    ];
    for (name, label, values) in subjects {
        if values.is_empty() {
            continue;
        }
        let path = folder.join(format!("{name}.png"));
        spread(&path, &Spread { label: label.to_owned(), values, members: runs })?;
        files.push(path);
    }
    type Measure = fn(&RunRow) -> Option<f64>;
    let measures: [(&str, &str, Measure); 2] = [
        ("settling-against-draws", "slowest step settled after (s)", |row| row.settle_max_s),
        ("rms-against-draws", "largest error RMS (deg)", |row| row.rms_max_deg),
    ];
    for (name, label, measure) in measures {
        let panels: Vec<Scatter> = columns
            .drawn
            .iter()
            .enumerate()
            .map(|(index, key)| Scatter {
                label: key.strip_prefix("plant.").unwrap_or(key).to_owned(),
                points: rows.values().filter_map(|row| Some((row.drawn[index], measure(row)?))).collect(),
                without: rows
                    .values()
                    .filter(|row| measure(row).is_none())
                    .map(|row| row.drawn[index])
                    .collect(),
            })
            .collect();
        if panels.iter().all(|panel| panel.points.is_empty()) {
            continue;
        }
        let path = folder.join(format!("{name}.png"));
        scatters(&path, label, &panels)?;
        files.push(path);
    }
    Ok(files)
}
