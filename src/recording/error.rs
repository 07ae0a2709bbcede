//! Why a recording could not be written or read.

use std::io;
use std::path::{Path, PathBuf};

use super::cdr::CdrError;
use super::choice::UnknownColumn;

/// A recording that cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// There is none.
    #[error("{}: cannot be opened: {source}", path.display())]
    Open {
        /// Where it was looked for.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Reading failed.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// It cannot be made.
    #[error("{}: cannot be created: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Writing failed.
    #[error("{}: cannot be written: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file is of another kind.
    #[error("{}: is no recording of this program: {reason}", path.display())]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// What is missing.
        reason: &'static str,
    },
    /// Another version recorded other fields.
    #[error("{}: was recorded by version {program} with other fields than version {own} has", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// The version that recorded.
        program: String,
        /// This one.
        own: &'static str,
    },
    /// A cycle does not decode.
    #[error("{}: a cycle {source}", path.display())]
    Cycle {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: CdrError,
    },
    /// The container could not be put together.
    #[error("{}: {source}", path.display())]
    Container {
        /// The file.
        path: PathBuf,
        /// What the library says.
        source: mcap::McapError,
    },
    /// A column that is asked for is none.
    #[error(transparent)]
    Column(#[from] UnknownColumn),
    /// What is asked for does not fit into the format.
    #[error("{}: {reason}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What is too large, and what helps.
        reason: String,
    },
}

impl RecordingError {
    pub(super) fn read(path: &Path, source: io::Error) -> Self {
        Self::Read { path: path.to_owned(), source }
    }

    pub(super) fn write(path: &Path, source: io::Error) -> Self {
        Self::Write { path: path.to_owned(), source }
    }

    pub(super) fn container(path: &Path, source: mcap::McapError) -> Self {
        Self::Container { path: path.to_owned(), source }
    }
}
