//! Text of a CSV file to readings in SI.
//!
//! Two layouts, told apart by the header: one coil on a grid in its own frame ([`COIL_COLUMNS`]; mm, A, mT),
//! and an array in the world ([`ARRAY_COLUMNS`] with one column a coil, `i0` to `iN`; m, A, T) as
//! electromagnetic-navigation laboratories write it. Columns may stand in any order. Blank lines and lines
//! that start with `#` are passed over.

use nalgebra::Vector3;

use crate::math::csv::{CsvRow, CsvTable, Refusal, shortened};

use super::readings::{Layout, Reading, Readings};

/// Columns of one coil's grid: mm, A and mT in the coil's frame.
pub const COIL_COLUMNS: [&str; 7] = ["x_mm", "y_mm", "z_mm", "current_a", "bx_mt", "by_mt", "bz_mt"];
/// Columns of an array's calibration, m and T in the world; the currents `i0` to `iN`, A, stand beside.
pub const ARRAY_COLUMNS: [&str; 6] = ["px", "py", "pz", "bx", "by", "bz"];

const HEADERS: &str = "x_mm,y_mm,z_mm,current_a,bx_mt,by_mt,bz_mt (one coil, mm, A and mT) or \
    px,py,pz,i0,...,iN,bx,by,bz (an array, m, A and T)";

/// Reads the bytes of a file.
///
/// # Errors
/// The first thing in the file that cannot be read, with its place.
pub fn parse(bytes: &[u8]) -> Result<Readings, Refusal> {
    let table = CsvTable::new(bytes, HEADERS)?;
    let columns = Columns::new(&table)?;
    let readings: Vec<Reading> = table.rows().map(|row| columns.read(&row?)).collect::<Result<_, _>>()?;
    if readings.is_empty() {
        let expected = "followed by at least one line of measurements";
        return Err(table.refuse_header("the last line of the file", expected));
    }
    Ok(Readings {
        layout: columns.layout,
        header_line: table.header_line,
        columns: table.columns,
        readings,
        ends_with_line_end: table.ends_with_line_end,
    })
}

/// Which column holds what.
struct Columns {
    layout: Layout,
    position: [usize; 3],
    currents: Vec<usize>,
    field: [usize; 3],
}

impl Columns {
    fn new(table: &CsvTable<'_>) -> Result<Self, Refusal> {
        let names = &table.columns;
        let layout = layout(table)?;
        let at = |name: &str| {
            let found = names.iter().position(|found| found == name);
            found.ok_or_else(|| table.refuse_header(format!("no column {name}"), HEADERS))
        };
        let three = |names: [&str; 3]| -> Result<[usize; 3], Refusal> {
            Ok([at(names[0])?, at(names[1])?, at(names[2])?])
        };
        let (position, currents, field) = match layout {
            Layout::OneCoil => (
                three(["x_mm", "y_mm", "z_mm"])?,
                vec![at("current_a")?],
                three(["bx_mt", "by_mt", "bz_mt"])?,
            ),
            Layout::Array => {
                let coils = names.iter().filter(|name| is_current(name)).count().max(1);
                let currents = (0..coils).map(|coil| at(&format!("i{coil}"))).collect::<Result<_, _>>()?;
                (three(["px", "py", "pz"])?, currents, three(["bx", "by", "bz"])?)
            }
        };
        Ok(Self { layout, position, currents, field })
    }

    fn read(&self, row: &CsvRow<'_>) -> Result<Reading, Refusal> {
        let three = |at: &[usize; 3], unit: f64| -> Result<Vector3<f64>, Refusal> {
            Ok(Vector3::new(row.number(at[0])?, row.number(at[1])?, row.number(at[2])?) * unit)
        };
        let unit = match self.layout {
            Layout::OneCoil => 1e-3,
            Layout::Array => 1.0,
        };
        Ok(Reading {
            line: row.line,
            position: three(&self.position, unit)?,
            currents: self.currents.iter().map(|at| row.number(*at)).collect::<Result<_, _>>()?,
            field: three(&self.field, unit)?,
        })
    }
}

/// The layout that a header means, each name of which it knows and has once.
fn layout(table: &CsvTable<'_>) -> Result<Layout, Refusal> {
    let count = |known: &[&str]| table.columns.iter().filter(|name| known.contains(&name.as_str())).count();
    let (coil, array) = (count(&COIL_COLUMNS), count(&ARRAY_COLUMNS));
    if coil == 0 && array == 0 {
        return Err(table.refuse_header(shortened(table.header), HEADERS));
    }
    let layout = if coil >= array { Layout::OneCoil } else { Layout::Array };
    let is_known = |name: &str| match layout {
        Layout::OneCoil => COIL_COLUMNS.contains(&name),
        Layout::Array => ARRAY_COLUMNS.contains(&name) || is_current(name),
    };
    table.check_columns(is_known, HEADERS)?;
    Ok(layout)
}

/// True for `i0`, `i1` and so on; "i01" and "i+1" are not names of this layout.
fn is_current(name: &str) -> bool {
    let number = |digits: &str| digits.parse::<usize>().is_ok_and(|number| number.to_string() == digits);
    name.strip_prefix('i').is_some_and(number)
}
