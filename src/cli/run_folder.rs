//! Where the files of a run go.

use std::path::Path;

use anyhow::anyhow;

use super::exit::{Exit, Failure};

/// `NAME-YYYYMMDD-HHMMSS`, UTC.
pub fn dated(name: &str) -> String {
    let now = time::OffsetDateTime::now_utc();
    format!(
        "{name}-{:04}{:02}{:02}-{:02}{:02}{:02}",
        now.year(),
        u8::from(now.month()),
        now.day(),
        now.hour(),
        now.minute(),
        now.second()
    )
}

/// A file or folder that cannot be made, with its exit code.
pub fn cannot_create(path: &Path, error: &std::io::Error) -> anyhow::Error {
    Failure::with(Exit::CannotCreate, anyhow!("{}: cannot be created: {error}", path.display()))
}
