//! Every value of a flight as CSV: a heading with the columns' names, a row a cycle, nothing between two
//! commas where there is no value.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use anyhow::anyhow;
use magsteer::daemon::recorder::{Column, Flight, NONE};

use crate::cli::exit::{Exit, Failure};

/// Writes `flight` to `path`.
pub fn write(path: &Path, flight: &Flight) -> anyhow::Result<()> {
    let failure = |exit: Exit, error: &std::io::Error| {
        Failure::with(exit, anyhow!("{}: cannot be written: {error}", path.display()))
    };
    let file = File::create(path).map_err(|error| failure(Exit::CannotCreate, &error))?;
    write_to(&mut BufWriter::new(file), flight).map_err(|error| failure(Exit::Io, &error))
}

fn write_to(output: &mut impl Write, flight: &Flight) -> std::io::Result<()> {
    let columns = &flight.header.columns;
    let names: Vec<&str> = columns.iter().map(|column| column.name.as_str()).collect();
    writeln!(output, "{}", names.join(","))?;
    for record in 0..flight.records() {
        for (index, (bits, column)) in flight.record(record).iter().zip(columns).enumerate() {
            if index > 0 {
                output.write_all(b",")?;
            }
            let number = f64::from_bits(*bits);
            match column.kind == Column::COUNT {
                true if *bits != NONE => write!(output, "{bits}")?,
                // The shortest text that reads back to the same number.
                false if !number.is_nan() => write!(output, "{number:?}")?,
                _ => {}
            }
        }
        output.write_all(b"\n")?;
    }
    output.flush()
}
