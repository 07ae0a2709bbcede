//! Tables of measurements as CSV text: cells by line and column, and why one of them is refused.
//!
//! Cells stand between commas, the first line that is neither blank nor a remark (`#`) names the columns.
//! Every refusal names line, column, value and what would be right.

use std::fmt::{self, Display, Formatter};

/// A value of a file of measurements that is refused: where it stands, what it is, and what would be right.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Line, 1 first.
    pub line: usize,
    /// Name of the column, or what else is meant.
    pub column: String,
    /// The value found.
    pub value: String,
    /// What would have been accepted.
    pub expected: String,
}

impl Refusal {
    /// Refuses `value`.
    pub fn new(
        line: usize,
        column: impl Into<String>,
        value: impl Display,
        expected: impl Into<String>,
    ) -> Self {
        Self { line, column: column.into(), value: value.to_string(), expected: expected.into() }
    }
}

impl std::error::Error for Refusal {}

impl Display for Refusal {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let Self { line, column, value, expected } = self;
        write!(formatter, "{line}: {column}: {value}: must be {expected}")
    }
}

/// A file of measurements, cut into lines.
#[derive(Debug, Clone)]
pub struct CsvTable<'a> {
    /// Line of the header, 1 first.
    pub header_line: usize,
    /// The header as it stands.
    pub header: &'a str,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// Lines after the header, with their numbers; none that is blank or a remark.
    lines: Vec<(usize, &'a str)>,
    /// False when the last line has no end: then its last value may have been cut short.
    pub ends_with_line_end: bool,
}

/// One line of a table, as many cells as columns.
#[derive(Debug, Clone)]
pub struct CsvRow<'a> {
    /// Line, 1 first.
    pub line: usize,
    columns: &'a [String],
    cells: Vec<&'a str>,
}

impl<'a> CsvTable<'a> {
    /// Cuts the bytes of a file. `headers` says which headers would be right.
    ///
    /// # Errors
    /// Text that is not UTF-8, and an empty file.
    pub fn new(bytes: &'a [u8], headers: &str) -> Result<Self, Refusal> {
        let text = decode(bytes)?;
        let mut lines = text
            .lines()
            .enumerate()
            .map(|(index, line)| (index + 1, line))
            .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
        let Some((header_line, header)) = lines.next() else {
            return Err(Refusal::new(1, "header", "an empty file", format!("the header {headers}")));
        };
        Ok(Self {
            header_line,
            header,
            columns: header.split(',').map(|name| name.trim().to_owned()).collect(),
            lines: lines.collect(),
            ends_with_line_end: text.ends_with('\n'),
        })
    }

    /// Refuses something in the header.
    pub fn refuse_header(&self, value: impl Display, expected: impl Into<String>) -> Refusal {
        Refusal::new(self.header_line, "header", value, expected)
    }

    /// Refuses names that are not known, and names that stand twice. `columns` says which would be right.
    ///
    /// # Errors
    /// The first such name.
    pub fn check_columns(&self, is_known: impl Fn(&str) -> bool, columns: &str) -> Result<(), Refusal> {
        for (at, name) in self.columns.iter().enumerate() {
            if !is_known(name) {
                let value = format!("column {:?}", shortened(name));
                return Err(self.refuse_header(value, format!("one of {columns}")));
            }
            if self.columns[..at].contains(name) {
                return Err(
                    self.refuse_header(format!("column {name} twice"), "columns that each stand once")
                );
            }
        }
        Ok(())
    }

    /// The lines of measurements.
    ///
    /// # Errors
    /// In place of a line: cells missing or too many.
    pub fn rows(&self) -> impl Iterator<Item = Result<CsvRow<'_>, Refusal>> {
        self.lines.iter().map(|(line, text)| self.row(*line, text))
    }

    fn row<'b>(&'b self, line: usize, text: &'b str) -> Result<CsvRow<'b>, Refusal> {
        let cells: Vec<&str> = text.split(',').map(str::trim).collect();
        let (found, count) = (cells.len(), self.columns.len());
        if found < count {
            let value = format!("nothing, after {found} of {count} columns");
            let expected = "a number: the line is cut short";
            return Err(Refusal::new(line, &self.columns[found], value, expected));
        }
        if found > count {
            let value = format!("{:?} after the last column", cells[count]);
            return Err(Refusal::new(line, "line", value, format!("{count} columns, as the header has")));
        }
        Ok(CsvRow { line, columns: &self.columns, cells })
    }
}

impl CsvRow<'_> {
    /// The number in a column.
    ///
    /// # Errors
    /// A cell that holds none, or one that is not finite.
    pub fn number(&self, column: usize) -> Result<f64, Refusal> {
        let cell = self.cells[column];
        let refuse = |expected: &str| {
            Refusal::new(self.line, &self.columns[column], format!("{:?}", shortened(cell)), expected)
        };
        let value: f64 = cell.parse().map_err(|_| refuse("a number"))?;
        if value.is_finite() { Ok(value) } else { Err(refuse("a finite number")) }
    }

    /// The text in a column.
    #[must_use]
    pub fn text(&self, column: usize) -> &str {
        self.cells[column]
    }

    /// True when there is nothing in a column.
    #[must_use]
    pub fn is_empty(&self, column: usize) -> bool {
        self.cells[column].is_empty()
    }
}

/// UTF-8, without the mark that some programs put in front.
fn decode(bytes: &[u8]) -> Result<&str, Refusal> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    std::str::from_utf8(bytes).map_err(|error| {
        let sound = &bytes[..error.valid_up_to()];
        let line = sound.iter().filter(|byte| **byte == b'\n').count() + 1;
        let start = sound.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        let value = format!("0x{:02x} as byte {}", bytes[sound.len()], sound.len() - start + 1);
        Refusal::new(line, "text", value, "UTF-8, as a program exports it under \"CSV\" or \"CSV UTF-8\"")
    })
}

/// The start of a text that may be long.
#[must_use]
pub fn shortened(text: &str) -> String {
    const CHARACTERS_MAX: usize = 60;
    match text.char_indices().nth(CHARACTERS_MAX) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text.to_owned(),
    }
}
