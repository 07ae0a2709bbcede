//! Files of measurements, and files made from them.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use anyhow::anyhow;
use magsteer::math::csv::Refusal;
use sha2::{Digest, Sha256};

use super::exit::{Exit, Failure};
use super::output;

/// The bytes of a CSV file.
///
/// # Errors
/// No such input, when it cannot be read.
pub fn read(path: &Path) -> anyhow::Result<Vec<u8>> {
    read_as(path, "a CSV file")
}

/// The bytes of a file; `kind` says what it must be.
///
/// # Errors
/// No such input, when it cannot be read.
pub fn read_as(path: &Path, kind: &str) -> anyhow::Result<Vec<u8>> {
    fs::read(path).map_err(|error| {
        let reason =
            if error.kind() == ErrorKind::NotFound { "no such file".to_owned() } else { error.to_string() };
        let file = path.display();
        Failure::with(Exit::NoInput, anyhow!("{file}: cannot be read: {reason}: must be {kind}"))
    })
}

/// SHA-256, lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Tells that a file may have been cut.
pub fn note_cut(path: &Path) {
    output::note(format_args!(
        "note: {}: the last line has no end: if the file was cut there, its last value is wrong",
        path.display()
    ));
}

/// Ends the command because of what stands in a file.
pub fn refuse(path: &Path, refusal: &Refusal) -> anyhow::Error {
    Failure::with(Exit::Data, anyhow!("{}:{refusal}", path.display()))
}

/// Writes a file.
///
/// # Errors
/// Cannot be created.
pub fn create(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    fs::write(path, bytes).map_err(|error| {
        Failure::with(Exit::CannotCreate, anyhow!("{}: cannot be written: {error}", path.display()))
    })
}
