//! Text of a CSV file to samples in SI.
//!
//! | columns | meaning |
//! |---|---|
//! | `i0_a`, `i1_a`, ... | measured current of every coil, A, in the order of the configuration |
//! | `theta_NAME_deg`, or `theta0_deg`, ... | measured angle of every frame, deg |
//! | `NAME_tx`, `NAME_ty`, `NAME_tz` | a magnet's tangent, towards the tip, unit, world |
//! | or `NAME_qx`, `NAME_qy`, `NAME_qz`, `NAME_qw` | its orientation: the unit quaternion that turns body z to the tangent |
//! | `NAME_x_m`, `NAME_y_m`, `NAME_z_m` | its centre, m, world; may be left out |
//!
//! One line an equilibrium. Columns may stand in any order. A magnet may be left out of the file, or of a
//! line by empty cells. Blank lines and lines that start with `#` are passed over.

use magsteer_hal::{Actuation, HardwareDescription};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::math::csv::{CsvRow, CsvTable, Refusal, shortened};

use super::sample::{MagnetReading, Sample, Samples};

/// How far a tangent or a quaternion may be from unit length: a file with two decimals is.
const NORM_TOLERANCE: f64 = 0.02;

const POSITION: [&str; 3] = ["x_m", "y_m", "z_m"];
const TANGENT: [&str; 3] = ["tx", "ty", "tz"];
const QUATERNION: [&str; 4] = ["qx", "qy", "qz", "qw"];

/// The header of a file with tangents and positions of every magnet of a rig.
#[must_use]
pub fn columns(rig: &HardwareDescription) -> Vec<String> {
    let currents = (0..rig.coils.len()).map(|coil| format!("i{coil}_a"));
    let angles = rig.frames.iter().map(|frame| format!("theta_{}_deg", frame.name));
    let magnets = rig.magnets().flat_map(|magnet| {
        POSITION.into_iter().chain(TANGENT).map(move |part| format!("{}_{part}", magnet.name))
    });
    currents.chain(angles).chain(magnets).collect()
}

/// Reads the bytes of a file about a rig.
///
/// # Errors
/// The first thing in the file that cannot be read, with its place.
pub fn parse(bytes: &[u8], rig: &HardwareDescription) -> Result<Samples, Refusal> {
    let known = known(rig);
    let table = CsvTable::new(bytes, &known)?;
    let layout = Layout::new(&table, rig, &known)?;
    let samples: Vec<Sample> = table.rows().map(|row| layout.read(&row?)).collect::<Result<_, _>>()?;
    if samples.is_empty() {
        let expected = "followed by at least one line of measurements";
        return Err(table.refuse_header("the last line of the file", expected));
    }
    Ok(Samples { header_line: table.header_line, samples, ends_with_line_end: table.ends_with_line_end })
}

/// Which columns a file about a rig may have, in words.
fn known(rig: &HardwareDescription) -> String {
    let last = rig.coils.len().saturating_sub(1);
    let mut words = vec![if last == 0 { "i0_a".to_owned() } else { format!("i0_a to i{last}_a") }];
    words.extend(rig.frames.iter().map(|frame| format!("theta_{}_deg", frame.name)));
    for magnet in rig.magnets() {
        let name = &magnet.name;
        words.push(format!(
            "{name}_tx {name}_ty {name}_tz (or {name}_qx to {name}_qw), {name}_x_m {name}_y_m {name}_z_m"
        ));
    }
    words.join(", ")
}

/// Which column holds what.
struct Layout<'a> {
    table: &'a CsvTable<'a>,
    currents: Vec<usize>,
    angles: Vec<usize>,
    magnets: Vec<Option<MagnetColumns>>,
}

#[derive(Clone, Copy)]
struct MagnetColumns {
    orientation: Orientation,
    position: Option<[usize; 3]>,
}

#[derive(Clone, Copy)]
enum Orientation {
    Tangent([usize; 3]),
    Quaternion([usize; 4]),
}

impl<'a> Layout<'a> {
    fn new(table: &'a CsvTable<'a>, rig: &HardwareDescription, known: &str) -> Result<Self, Refusal> {
        let current = |coil: usize| format!("i{coil}_a");
        let angle =
            |frame: usize| [format!("theta_{}_deg", rig.frames[frame].name), format!("theta{frame}_deg")];
        let parts = || POSITION.into_iter().chain(TANGENT).chain(QUATERNION);
        let is_known = |name: &str| {
            (0..rig.coils.len()).any(|coil| current(coil) == name)
                || (0..rig.frames.len()).any(|frame| angle(frame).iter().any(|known| known == name))
                || rig.magnets().any(|magnet| parts().any(|part| format!("{}_{part}", magnet.name) == name))
        };
        table.check_columns(is_known, known)?;
        let at = |name: &str| table.columns.iter().position(|found| found == name);
        let must = |name: &str| {
            at(name)
                .ok_or_else(|| table.refuse_header(format!("no column {name}"), format!("all of {known}")))
        };
        let currents = (0..rig.coils.len()).map(|coil| must(&current(coil))).collect::<Result<_, _>>()?;
        let angles = (0..rig.frames.len())
            .map(|frame| {
                let [by_name, by_number] = angle(frame);
                match (at(&by_name), at(&by_number)) {
                    (Some(_), Some(_)) => Err(table.refuse_header(
                        format!("columns {by_name} and {by_number}"),
                        "columns that each stand once: both are the same frame",
                    )),
                    (None, Some(found)) => Ok(found),
                    _ => must(&by_name),
                }
            })
            .collect::<Result<_, _>>()?;
        let magnets: Vec<Option<MagnetColumns>> =
            rig.magnets().map(|magnet| magnet_columns(table, &magnet.name)).collect::<Result<_, _>>()?;
        if magnets.iter().all(Option::is_none) {
            let value = shortened(table.header);
            return Err(table.refuse_header(value, format!("with the orientation of a magnet: {known}")));
        }
        Ok(Self { table, currents, angles, magnets })
    }

    fn read(&self, row: &CsvRow<'_>) -> Result<Sample, Refusal> {
        let mut actuation = Actuation::default();
        for (value, column) in actuation.current_a.iter_mut().zip(&self.currents) {
            *value = row.number(*column)?;
        }
        for (value, column) in actuation.angle_rad.iter_mut().zip(&self.angles) {
            *value = row.number(*column)?.to_radians();
        }
        let magnets = self
            .magnets
            .iter()
            .map(|columns| columns.map_or(Ok(None), |columns| self.read_magnet(row, &columns)));
        Ok(Sample { line: row.line, actuation, magnets: magnets.collect::<Result<_, _>>()? })
    }

    fn read_magnet(
        &self,
        row: &CsvRow<'_>,
        columns: &MagnetColumns,
    ) -> Result<Option<MagnetReading>, Refusal> {
        let orientation: &[usize] = match &columns.orientation {
            Orientation::Tangent(columns) => columns,
            Orientation::Quaternion(columns) => columns,
        };
        let all = || orientation.iter().chain(columns.position.iter().flatten());
        if all().all(|column| row.is_empty(*column)) {
            return Ok(None);
        }
        let numbers: Vec<f64> =
            orientation.iter().map(|column| row.number(*column)).collect::<Result<_, _>>()?;
        let norm = numbers.iter().map(|number| number * number).sum::<f64>().sqrt();
        if (norm - 1.0).abs() > NORM_TOLERANCE {
            let names: Vec<&str> =
                orientation.iter().map(|column| self.table.columns[*column].as_str()).collect();
            let value = format!("a vector {norm:.4} long");
            let expected = "1 long, to 2 %: a unit vector without a unit";
            return Err(Refusal::new(row.line, names.join(", "), value, expected));
        }
        let tangent = match numbers.as_slice() {
            [x, y, z, w] => UnitQuaternion::from_quaternion(Quaternion::new(*w, *x, *y, *z)) * Vector3::z(),
            tangent => Vector3::from_column_slice(tangent) / norm,
        };
        let position = columns
            .position
            .map(|[x, y, z]| Ok(Vector3::new(row.number(x)?, row.number(y)?, row.number(z)?)))
            .transpose()?;
        Ok(Some(MagnetReading { tangent, position }))
    }
}

/// A magnet's columns; `None` when the file has none of it.
fn magnet_columns(table: &CsvTable<'_>, name: &str) -> Result<Option<MagnetColumns>, Refusal> {
    let tangent = all_or_none(table, name, TANGENT)?;
    let quaternion = all_or_none(table, name, QUATERNION)?;
    let position = all_or_none(table, name, POSITION)?;
    let orientation = match (tangent, quaternion) {
        (Some(_), Some(_)) => {
            let value = format!("columns {name}_tx and {name}_qx");
            return Err(table.refuse_header(value, "either the tangent or the quaternion of a magnet"));
        }
        (Some(columns), None) => Orientation::Tangent(columns),
        (None, Some(columns)) => Orientation::Quaternion(columns),
        (None, None) if position.is_some() => {
            let value = format!("no column {name}_tx");
            return Err(table.refuse_header(value, format!("a tangent beside the position of {name}")));
        }
        (None, None) => return Ok(None),
    };
    Ok(Some(MagnetColumns { orientation, position }))
}

fn all_or_none<const N: usize>(
    table: &CsvTable<'_>,
    magnet: &str,
    parts: [&str; N],
) -> Result<Option<[usize; N]>, Refusal> {
    let names = parts.map(|part| format!("{magnet}_{part}"));
    let found = names.each_ref().map(|name| table.columns.iter().position(|column| column == name));
    if found.iter().all(Option::is_none) {
        return Ok(None);
    }
    for (name, found) in names.iter().zip(&found) {
        if found.is_none() {
            let expected = format!("all of {}", names.join(", "));
            return Err(table.refuse_header(format!("no column {name}"), expected));
        }
    }
    Ok(Some(found.map(Option::unwrap_or_default)))
}
