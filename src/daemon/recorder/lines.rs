//! Files of lines that grow and are bounded: the journal and the minutes.
//!
//! A line goes to the kernel in one write, so that it survives the death of this process at any moment (not
//! that of the machine: nothing is synchronised). The file is opened anew for every line, so that a folder
//! that was removed, replaced or filled costs what could not be written and no more; lines are rare. A file
//! that would grow beyond 4 MiB is moved to `NAME.1.jsonl`, that one to `NAME.2.jsonl` and so on; the fifth is
//! dropped, so that they take 20 MiB at most. Several daemons may share a folder: lines are written under a
//! lock.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::os::unix::fs::{FileExt, MetadataExt};
use std::path::{Path, PathBuf};

/// A file does not grow beyond this, bytes.
pub const FILE_BYTES_MAX: u64 = 4 << 20;
/// Files that were moved away and are kept.
const OLD_FILES: usize = 4;
/// Attempts to open the file that the name stands for, while others move it away.
const OPEN_ATTEMPTS: usize = 3;

/// What lines are about: they go into files of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lines {
    /// `events.jsonl`.
    Events,
    /// `minutes.jsonl`.
    Minutes,
}

impl Lines {
    const fn stem(self) -> &'static str {
        match self {
            Self::Events => "events",
            Self::Minutes => "minutes",
        }
    }

    /// Path of the file in use, 0, or of the one that was moved away so many times ago.
    pub fn path(self, folder: &Path, age: usize) -> PathBuf {
        let stem = self.stem();
        folder.join(if age == 0 { format!("{stem}.jsonl") } else { format!("{stem}.{age}.jsonl") })
    }

    /// The files of a folder, the oldest first.
    pub fn files(self, folder: &Path) -> Vec<PathBuf> {
        let files = (0..=OLD_FILES).rev().map(|age| self.path(folder, age));
        files.filter(|path| path.is_file()).collect()
    }

    /// Appends a line, without its end, to the file in `folder`; one of `bytes_max` is moved away first.
    ///
    /// # Errors
    /// What the file system says; the file is then as it was.
    pub fn append(self, folder: &Path, line: &str, bytes_max: u64) -> io::Result<()> {
        let mut file = self.open(folder)?;
        let mut length = file.metadata()?.len();
        if length > 0 && length + line.len() as u64 + 2 > bytes_max {
            for age in (0..OLD_FILES).rev() {
                let moved = fs::rename(self.path(folder, age), self.path(folder, age + 1));
                moved.or_else(
                    |error| if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) },
                )?;
            }
            file = self.open(folder)?;
            length = file.metadata()?.len();
        }
        let mut bytes = Vec::with_capacity(line.len() + 2);
        let mut last = [b'\n'];
        if length > 0 {
            file.read_exact_at(&mut last, length - 1)?;
        }
        if last != *b"\n" {
            // Whoever wrote there last died in the middle of it.
            bytes.push(b'\n');
        }
        bytes.extend(line.bytes().filter(|byte| *byte != b'\n'));
        bytes.push(b'\n');
        file.write_all(&bytes).inspect_err(|_| {
            // Half a line is none. Should that fail too, the next line begins with an end of line.
            let _ = file.set_len(length);
        })
    }

    /// Opens and locks the file that the name stands for. The lock is free again when the file is closed.
    fn open(self, folder: &Path) -> io::Result<File> {
        let path = self.path(folder, 0);
        for _ in 0..OPEN_ATTEMPTS {
            let file = OpenOptions::new().read(true).append(true).create(true).open(&path)?;
            file.try_lock().map_err(|error| match error {
                TryLockError::WouldBlock => io::ErrorKind::WouldBlock.into(),
                TryLockError::Error(error) => error,
            })?;
            let (held, named) = (file.metadata()?, fs::metadata(&path)?);
            if (held.dev(), held.ino()) == (named.dev(), named.ino()) {
                return Ok(file);
            }
        }
        Err(io::ErrorKind::WouldBlock.into())
    }
}
