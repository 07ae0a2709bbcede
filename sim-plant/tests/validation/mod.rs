//! Tables of measured deviations in `sim-plant/docs`: a test computes the rows, holds each to its bar, and holds the page to the rows.
//!
//! `MAGSTEER_WRITE_DOCS=1 cargo test -p magsteer-sim-plant` writes the tables anew.
#![allow(dead_code, reason = "every test file compiles its own copy")]

use std::fmt::Write;
use std::path::PathBuf;

/// A number in a page counts as that of the row when it is off by no more than this share of itself, or by
/// [`SMALL`] of the bar: libraries of other machines round otherwise.
const NEAR: f64 = 0.25;
/// See [`NEAR`].
const SMALL: f64 = 0.01;

/// One line of a table.
pub struct Row {
    /// What was compared with what.
    pub what: String,
    /// Greatest deviation found, in `unit`.
    pub measured: f64,
    /// Greatest deviation allowed, in `unit`.
    pub bar: f64,
    /// Of both numbers; empty for a ratio.
    pub unit: &'static str,
}

impl Row {
    pub fn new(what: impl Into<String>, measured: f64, bar: f64, unit: &'static str) -> Self {
        Self { what: what.into(), measured, bar, unit }
    }

    fn line(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("| {} | {:.1e}{unit} | {:.1e}{unit} |\n", self.what, self.measured, self.bar)
    }

    /// True when `line` says the same of the same.
    fn agrees(&self, line: &str) -> bool {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [what, measured, bar] = cells[..] else { return false };
        let number = |cell: &str| cell.split(' ').next().and_then(|number| number.parse::<f64>().ok());
        let (Some(told), Some(bar)) = (number(measured), number(bar)) else { return false };
        let off = (told - self.measured).abs();
        what == self.what
            && (bar - self.bar).abs() <= 0.05 * self.bar
            && (off <= NEAR * self.measured.abs() || off <= SMALL * self.bar)
    }
}

/// Holds every row to its bar and the table `name` of `sim-plant/docs/PAGE` to the rows.
pub fn hold(page: &str, name: &str, rows: &[Row]) {
    for row in rows {
        println!("{}: {:.3e} {} (bar {:.1e})", row.what, row.measured, row.unit, row.bar);
    }
    for row in rows {
        assert!(row.measured.abs() <= row.bar, "{}: {:e} beyond {:e}", row.what, row.measured, row.bar);
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("docs").join(page);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let (begin, end) = (format!("<!-- table: {name} -->\n"), "<!-- end of table -->\n");
    let start = text.find(&begin).unwrap_or_else(|| panic!("{page} has no `{}`", begin.trim())) + begin.len();
    let stop = start + text[start..].find(end).unwrap_or_else(|| panic!("{page}: {name} does not end"));
    if std::env::var_os("MAGSTEER_WRITE_DOCS").is_some() {
        let mut table = String::from("| compared | deviation | bar |\n|---|---|---|\n");
        for row in rows {
            let _ = write!(table, "{}", row.line());
        }
        let written = format!("{}{table}{}", &text[..start], &text[stop..]);
        std::fs::write(&path, written).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        return;
    }
    let lines: Vec<&str> = text[start..stop].lines().skip(2).collect();
    let agrees = lines.len() == rows.len() && rows.iter().zip(&lines).all(|(row, line)| row.agrees(line));
    let found: String = rows.iter().map(Row::line).collect();
    assert!(
        agrees,
        "{page}, table {name}: not what was measured:\n{found}write it with MAGSTEER_WRITE_DOCS=1"
    );
}
