//! Cycles as tables: CSV, a column a number, or NPZ, an array a field.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::choice::{Choice, Chosen, entries};
use super::cycle::{Cycle, Field};
use super::error::RecordingError;
use super::info::Info;
use super::npz::{Kind, NpzWriter};
use super::reader::Recording;
use super::value::{Number, Per};

/// Most memory for the arrays of one pass over the recording, bytes.
const PASS_BYTES: u64 = 256 << 20;

/// What a table has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exported {
    /// Cycles.
    pub rows: u64,
    /// Numbers of each.
    pub columns: u64,
}

/// Writes the chosen cycles as a line each, the names of the columns first; what a cycle does not have is empty.
///
/// # Errors
/// When a name picks no column, the recording cannot be read, or the file cannot be written.
pub fn export_csv(recording: &Recording, target: &Path, choice: &Choice) -> Result<Exported, RecordingError> {
    let refused = |source| RecordingError::write(target, source);
    let fields = choice.of(recording.info())?;
    let file = File::create_new(target);
    let file = file.map_err(|source| RecordingError::Create { path: target.to_owned(), source })?;
    let mut output = BufWriter::with_capacity(1 << 18, file);
    let names: Vec<&str> = fields.iter().flat_map(Chosen::names).collect();
    writeln!(output, "{}", names.join(",")).map_err(refused)?;
    let mut rows = 0;
    for cycle in thinned(recording, choice)? {
        write_row(&mut output, &cycle?.numbers(), &fields).map_err(refused)?;
        rows += 1;
    }
    output.flush().map_err(refused)?;
    Ok(Exported { rows, columns: names.len() as u64 })
}

/// The chosen cycles. One that cannot be read is not passed over.
fn thinned(
    recording: &Recording,
    choice: &Choice,
) -> Result<impl Iterator<Item = Result<Cycle, RecordingError>>, RecordingError> {
    let every = choice.every.max(1);
    let cycles = (0_u64..).zip(recording.cycles()?);
    let is_chosen =
        move |(index, cycle): &(u64, Result<Cycle, _>)| index.is_multiple_of(every) || cycle.is_err();
    Ok(cycles.filter(is_chosen).map(|(_, cycle)| cycle))
}

fn write_row(output: &mut impl Write, numbers: &[Vec<Number>], fields: &[Chosen]) -> io::Result<()> {
    let mut is_first = true;
    for field in fields {
        let chosen = field.is_chosen.iter().enumerate().filter(|(_, is_chosen)| **is_chosen);
        for (index, _) in chosen {
            if !is_first {
                output.write_all(b",")?;
            }
            is_first = false;
            match numbers[field.index].get(index) {
                Some(Number::Count(count)) => write!(output, "{count}")?,
                Some(Number::Real(real)) if real.is_nan() => output.write_all(b"nan")?,
                Some(Number::Real(real)) => write!(output, "{real}")?,
                None => {}
            }
        }
    }
    output.write_all(b"\n")
}

/// Writes an array for every field of which a column is chosen: its first axis is the cycle, its second the
/// coil, frame or magnet, its third x, y, z and w. Names stand in `coil_names`, `frame_names` and
/// `magnet_names`. What a cycle does not have is not a number, or 0 among counts.
///
/// # Errors
/// When a name picks no column, the recording cannot be read, the file cannot be written, or would be longer
/// than the format allows.
pub fn export_npz(recording: &Recording, target: &Path, choice: &Choice) -> Result<Exported, RecordingError> {
    let refused = |source| RecordingError::write(target, source);
    let info = recording.info();
    let fields = choice.of(info)?;
    let rows = recording.counts()?.cycles.div_ceil(choice.every.max(1));
    let bytes: u64 = fields.iter().map(|field| rows * row_bytes(field.field, info)).sum();
    if bytes > u64::from(u32::MAX) - (1 << 20) {
        let reason = format!(
            "{rows} cycles are {} MB, more than an NPZ file holds: choose fewer cycles or columns, or CSV",
            bytes / 1_000_000
        );
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
    let mut rest = &fields[..];
    while !rest.is_empty() {
        let (now, later) = rest.split_at(pass_length(rest, rows, info));
        for (chosen, array) in now.iter().zip(gather(recording, now, rows, choice)?) {
            let field = chosen.field;
            let mut shape = vec![rows];
            if field.per != Per::Cycle {
                shape.push(entries(field, info) as u64);
            }
            if field.parts.len() > 1 {
                shape.push(field.parts.len() as u64);
            }
            output.array(field.name, kind(field), &shape, &array).map_err(refused)?;
        }
        rest = later;
    }
    output.finish().map_err(refused)?;
    let columns = fields.iter().map(|chosen| chosen.columns.len() as u64).sum();
    Ok(Exported { rows, columns })
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

/// How many of the fields fit into the memory of a pass; at least one.
fn pass_length(fields: &[Chosen], rows: u64, info: &Info) -> usize {
    let mut bytes = 0;
    let fits = |chosen: &&Chosen| {
        bytes += rows * row_bytes(chosen.field, info);
        bytes <= PASS_BYTES
    };
    fields.iter().take_while(fits).count().max(1)
}

/// The bytes of some fields' arrays, little-endian.
fn gather(
    recording: &Recording,
    fields: &[Chosen],
    rows: u64,
    choice: &Choice,
) -> Result<Vec<Vec<u8>>, RecordingError> {
    let info = recording.info();
    let room = |chosen: &Chosen| Vec::with_capacity((rows * row_bytes(chosen.field, info)) as usize);
    let mut arrays: Vec<Vec<u8>> = fields.iter().map(room).collect();
    for cycle in thinned(recording, choice)? {
        let numbers = cycle?.numbers();
        for (chosen, array) in fields.iter().zip(&mut arrays) {
            let (kind, numbers) = (kind(chosen.field), &numbers[chosen.index]);
            for index in 0..chosen.columns.len() {
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
