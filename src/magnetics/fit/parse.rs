//! Text of a CSV file to readings in SI.
//!
//! Two layouts, told apart by the header: one coil on a grid in its own frame ([`COIL_COLUMNS`]; mm, A, mT),
//! and an array in the world ([`ARRAY_COLUMNS`] with one column a coil, `i0` to `iN`; m, A, T) as
//! electromagnetic-navigation laboratories write it. Columns may stand in any order. Blank lines and lines
//! that start with `#` are passed over.

use nalgebra::Vector3;

use super::readings::{Layout, Reading, Readings, Refusal};

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
    let text = decode(bytes)?;
    let mut lines = text
        .lines()
        .enumerate()
        .map(|(index, line)| (index + 1, line))
        .filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let Some((header_line, header)) = lines.next() else {
        return Err(Refusal::new(1, "header", "an empty file", format!("the header {HEADERS}")));
    };
    let columns = Columns::new(header_line, header)?;
    let readings: Vec<Reading> =
        lines.map(|(line, text)| columns.read(line, text)).collect::<Result<_, _>>()?;
    if readings.is_empty() {
        let expected = "followed by at least one line of measurements";
        return Err(Refusal::new(header_line, "header", "the last line of the file", expected));
    }
    Ok(Readings {
        layout: columns.layout,
        header_line,
        columns: columns.names,
        readings,
        ends_with_line_end: text.ends_with('\n'),
    })
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

/// Which column holds what.
struct Columns {
    layout: Layout,
    names: Vec<String>,
    position: [usize; 3],
    currents: Vec<usize>,
    field: [usize; 3],
}

impl Columns {
    fn new(line: usize, header: &str) -> Result<Self, Refusal> {
        let names: Vec<String> = header.split(',').map(|name| name.trim().to_owned()).collect();
        let layout = layout(line, header, &names)?;
        let at = |name: &str| {
            let found = names.iter().position(|found| found == name);
            found.ok_or_else(|| Refusal::new(line, "header", format!("no column {name}"), HEADERS))
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
        Ok(Self { layout, names, position, currents, field })
    }

    fn read(&self, line: usize, text: &str) -> Result<Reading, Refusal> {
        let cells: Vec<&str> = text.split(',').map(str::trim).collect();
        let (found, count) = (cells.len(), self.names.len());
        if found < count {
            let value = format!("nothing, after {found} of {count} columns");
            let expected = "a number: the line is cut short";
            return Err(Refusal::new(line, &self.names[found], value, expected));
        }
        if found > count {
            let value = format!("{:?} after the last column", cells[count]);
            return Err(Refusal::new(line, "line", value, format!("{count} columns, as the header has")));
        }
        let number = |at: usize| -> Result<f64, Refusal> {
            let refuse = |expected: &str| {
                Refusal::new(line, &self.names[at], format!("{:?}", shortened(cells[at])), expected)
            };
            let value: f64 = cells[at].parse().map_err(|_| refuse("a number"))?;
            if value.is_finite() { Ok(value) } else { Err(refuse("a finite number")) }
        };
        let three = |at: &[usize; 3], unit: f64| -> Result<Vector3<f64>, Refusal> {
            Ok(Vector3::new(number(at[0])?, number(at[1])?, number(at[2])?) * unit)
        };
        let unit = match self.layout {
            Layout::OneCoil => 1e-3,
            Layout::Array => 1.0,
        };
        Ok(Reading {
            line,
            position: three(&self.position, unit)?,
            currents: self.currents.iter().map(|at| number(*at)).collect::<Result<_, _>>()?,
            field: three(&self.field, unit)?,
        })
    }
}

/// The layout that a header means, each name of which it knows and has once.
fn layout(line: usize, header: &str, names: &[String]) -> Result<Layout, Refusal> {
    let refuse = |value: String, expected: &str| Err(Refusal::new(line, "header", value, expected));
    let count = |known: &[&str]| names.iter().filter(|name| known.contains(&name.as_str())).count();
    let (coil, array) = (count(&COIL_COLUMNS), count(&ARRAY_COLUMNS));
    if coil == 0 && array == 0 {
        return refuse(shortened(header), HEADERS);
    }
    let layout = if coil >= array { Layout::OneCoil } else { Layout::Array };
    let is_known = |name: &str| match layout {
        Layout::OneCoil => COIL_COLUMNS.contains(&name),
        Layout::Array => ARRAY_COLUMNS.contains(&name) || is_current(name),
    };
    for (at, name) in names.iter().enumerate() {
        if !is_known(name) {
            return refuse(format!("column {:?}", shortened(name)), &format!("one of {HEADERS}"));
        }
        if names[..at].contains(name) {
            return refuse(format!("column {name} twice"), "columns that each stand once");
        }
    }
    Ok(layout)
}

/// True for `i0`, `i1` and so on; "i01" and "i+1" are not names of this layout.
fn is_current(name: &str) -> bool {
    let number = |digits: &str| digits.parse::<usize>().is_ok_and(|number| number.to_string() == digits);
    name.strip_prefix('i').is_some_and(number)
}

/// The start of a text that may be long.
fn shortened(text: &str) -> String {
    const CHARACTERS_MAX: usize = 60;
    match text.char_indices().nth(CHARACTERS_MAX) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text.to_owned(),
    }
}
