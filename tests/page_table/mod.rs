//! Tables of numbers in a page of the documentation: a test computes the rows and holds the page to them.
//!
//! `MAGSTEER_WRITE_DOCS=1 cargo test` writes the tables anew.

use std::fmt::Write;
use std::path::Path;

/// A number in a page may differ from that of the row by this share of itself: it is rounded, and other machines round otherwise.
const NEAR: f64 = 0.03;
/// The same for numbers near zero.
const SMALL: f64 = 0.011;

/// One line of a table.
pub struct Row {
    pub name: String,
    pub numbers: Vec<f64>,
}

impl Row {
    fn line(&self) -> String {
        let mut line = format!("| {} |", self.name);
        for number in &self.numbers {
            let _ = write!(line, " {} |", rounded(*number));
        }
        line + "\n"
    }

    fn agrees(&self, line: &str) -> bool {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let numbers = cells.iter().skip(1).map(|cell| cell.parse::<f64>().unwrap_or(f64::NAN));
        cells.first() == Some(&self.name.as_str())
            && cells.len() == self.numbers.len() + 1
            && numbers.zip(&self.numbers).all(|(told, number)| {
                let off = (told - number).abs();
                off <= NEAR * number.abs() || off <= SMALL
            })
    }
}

/// Three digits.
fn rounded(number: f64) -> String {
    let digits = if number.abs() >= 100.0 { 0 } else { 2 - (number.abs() >= 10.0) as usize };
    format!("{number:.digits$}")
}

/// Holds the table `name` of the file `page` of this repository, below its own header of two lines, to the rows.
pub fn hold(page: &str, name: &str, rows: &[Row]) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(page);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let (begin, end) = (format!("<!-- table: {name} -->\n"), "<!-- end of table -->\n");
    let begun = text.find(&begin).unwrap_or_else(|| panic!("{page} has no `{}`", begin.trim())) + begin.len();
    let header: usize = text[begun..].split_inclusive('\n').take(2).map(str::len).sum();
    let start = begun + header;
    let stop = start + text[start..].find(end).unwrap_or_else(|| panic!("{page}: {name} does not end"));
    let found: String = rows.iter().map(Row::line).collect();
    println!("{name}:\n{found}");
    if std::env::var_os("MAGSTEER_WRITE_DOCS").is_some() {
        let written = format!("{}{found}{}", &text[..start], &text[stop..]);
        std::fs::write(&path, written).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        return;
    }
    let lines: Vec<&str> = text[start..stop].lines().collect();
    let agrees = lines.len() == rows.len() && rows.iter().zip(&lines).all(|(row, line)| row.agrees(line));
    assert!(
        agrees,
        "{page}, table {name}: not what was measured:\n{found}write it with MAGSTEER_WRITE_DOCS=1"
    );
}
