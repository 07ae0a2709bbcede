//! Cycles as tables: CSV, a column a number, or NPZ, an array a field.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::cycle::{Cycle, Field};
use super::error::RecordingError;
use super::info::Info;
use super::npz::{Kind, NpzWriter};
use super::reader::Recording;
use super::value::{Number, Per};

/// Answers of a cycle at most.
const ANSWERS: usize = magsteer_hal::record::CYCLE_ANSWERS;
/// Most memory for the arrays of one pass over the recording, bytes.
const PASS_BYTES: u64 = 256 << 20;

/// Entries of a field in a recording.
fn entries(field: &Field, info: &Info) -> usize {
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

/// Writes every cycle as a line, the names of the columns first; what a cycle does not have is empty.
///
/// # Errors
/// When the recording cannot be read, or the file cannot be written.
pub fn export_csv(recording: &Recording, target: &Path) -> Result<u64, RecordingError> {
    let refused = |source| RecordingError::write(target, source);
    let file = File::create_new(target);
    let file = file.map_err(|source| RecordingError::Create { path: target.to_owned(), source })?;
    let mut output = BufWriter::with_capacity(1 << 18, file);
    let info = recording.info();
    let names: Vec<String> = Cycle::FIELDS.iter().flat_map(|field| columns(field, info)).collect();
    writeln!(output, "{}", names.join(",")).map_err(refused)?;
    let widths: Vec<usize> =
        Cycle::FIELDS.iter().map(|field| entries(field, info) * field.parts.len()).collect();
    let mut rows = 0;
    for cycle in recording.cycles()? {
        write_row(&mut output, &cycle?.numbers(), &widths).map_err(refused)?;
        rows += 1;
    }
    output.flush().map_err(refused)?;
    Ok(rows)
}

fn write_row(output: &mut impl Write, fields: &[Vec<Number>], widths: &[usize]) -> io::Result<()> {
    let mut is_first = true;
    for (numbers, width) in fields.iter().zip(widths) {
        for index in 0..*width {
            if !is_first {
                output.write_all(b",")?;
            }
            is_first = false;
            match numbers.get(index) {
                Some(Number::Count(count)) => write!(output, "{count}")?,
                Some(Number::Real(real)) if real.is_nan() => output.write_all(b"nan")?,
                Some(Number::Real(real)) => write!(output, "{real}")?,
                None => {}
            }
        }
    }
    output.write_all(b"\n")
}

/// Writes an array for every field: its first axis is the cycle, its second the coil, frame or magnet, its
/// third x, y, z and w. Names stand in `coil_names`, `frame_names` and `magnet_names`. What a cycle does not
/// have is not a number, or 0 among counts.
///
/// # Errors
/// When the recording cannot be read, the file cannot be written, or would be longer than the format allows.
pub fn export_npz(recording: &Recording, target: &Path) -> Result<u64, RecordingError> {
    let refused = |source| RecordingError::write(target, source);
    let info = recording.info();
    let rows = recording.counts()?.cycles;
    let bytes: u64 = Cycle::FIELDS.iter().map(|field| rows * row_bytes(field, info)).sum();
    if bytes > u64::from(u32::MAX) - (1 << 20) {
        let reason = format!("{rows} cycles are {} MB, more than an NPZ file holds: use csv", bytes >> 20);
        return Err(RecordingError::TooLarge { path: target.to_owned(), reason });
    }
    let file = File::create_new(target);
    let file = file.map_err(|source| RecordingError::Create { path: target.to_owned(), source })?;
    let mut output = NpzWriter::new(file);
    for (name, names) in
        [("coil_names", &info.coils), ("frame_names", &info.frames), ("magnet_names", &info.magnets)]
    {
        output.texts(name, names).map_err(refused)?;
    }
    let mut next = 0;
    while next < Cycle::FIELDS.len() {
        let end = pass_end(next, rows, info);
        let arrays = gather(recording, next..end, rows)?;
        for (field, array) in Cycle::FIELDS[next..end].iter().zip(arrays) {
            let mut shape = vec![rows];
            if field.per != Per::Cycle {
                shape.push(entries(field, info) as u64);
            }
            if field.parts.len() > 1 {
                shape.push(field.parts.len() as u64);
            }
            output.array(field.name, kind(field), &shape, &array).map_err(refused)?;
        }
        next = end;
    }
    output.finish().map_err(refused)?;
    Ok(rows)
}

fn kind(field: &Field) -> Kind {
    match (field.is_count, field.ros.starts_with("uint32")) {
        (true, true) => Kind::U32,
        (true, false) => Kind::U64,
        (false, _) => Kind::F64,
    }
}

fn row_bytes(field: &Field, info: &Info) -> u64 {
    let size = if kind(field) == Kind::U32 { 4 } else { 8 };
    (size * entries(field, info) * field.parts.len()) as u64
}

/// How many fields, from `begin`, fit into the memory of a pass; at least one.
fn pass_end(begin: usize, rows: u64, info: &Info) -> usize {
    let mut bytes = 0;
    let fits = |field: &&Field| {
        bytes += rows * row_bytes(field, info);
        bytes <= PASS_BYTES
    };
    begin + Cycle::FIELDS[begin..].iter().take_while(fits).count().max(1)
}

/// The bytes of some fields' arrays, little-endian.
fn gather(
    recording: &Recording,
    fields: std::ops::Range<usize>,
    rows: u64,
) -> Result<Vec<Vec<u8>>, RecordingError> {
    let info = recording.info();
    let chosen = &Cycle::FIELDS[fields.clone()];
    let room = |field: &Field| Vec::with_capacity((rows * row_bytes(field, info)) as usize);
    let mut arrays: Vec<Vec<u8>> = chosen.iter().map(room).collect();
    for cycle in recording.cycles()? {
        let numbers = cycle?.numbers();
        for ((field, array), numbers) in chosen.iter().zip(&mut arrays).zip(&numbers[fields.clone()]) {
            let kind = kind(field);
            for index in 0..entries(field, info) * field.parts.len() {
                let real = match numbers.get(index) {
                    Some(Number::Real(real)) => *real,
                    _ => f64::NAN,
                };
                let count = match numbers.get(index) {
                    Some(Number::Count(count)) => *count,
                    _ => 0,
                };
                match kind {
                    Kind::F64 => array.extend(real.to_le_bytes()),
                    Kind::U64 => array.extend(count.to_le_bytes()),
                    Kind::U32 => array.extend((count as u32).to_le_bytes()),
                }
            }
        }
    }
    Ok(arrays)
}
