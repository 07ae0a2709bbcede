//! A root of its own for one run, gone with it.

use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

use super::endpoint::prefix;
use super::membership::{SEGMENTS, remove_all};

/// A fresh root directory in memory. When it is dropped it goes, with every segment of its channels: end all
/// participants first.
#[derive(Debug)]
pub struct TemporaryRoot {
    path: PathBuf,
}

impl TemporaryRoot {
    /// Makes a root that no other process uses, for this user alone.
    ///
    /// # Errors
    /// When the directory cannot be made.
    pub fn new() -> io::Result<Self> {
        let mut number = 0_u32;
        loop {
            let path = PathBuf::from(format!("{SEGMENTS}/magsteer-run-{}-{number}", std::process::id()));
            match DirBuilder::new().mode(0o700).create(&path) {
                Ok(()) => return Ok(Self { path: path.canonicalize()? }),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
                Err(error) => return Err(error),
            }
        }
    }

    /// The directory, for [`super::Endpoint::new`].
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for TemporaryRoot {
    fn drop(&mut self) {
        // Memory left behind is a nuisance, not a fault: nothing to do about what cannot be removed.
        let _ = remove_all(Path::new(SEGMENTS), &prefix(&self.path));
        let _ = fs::remove_dir_all(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::{DriverEnd, Endpoint};
    use super::{SEGMENTS, TemporaryRoot, prefix};

    #[test]
    fn nothing_is_left_of_a_temporary_root_nor_of_its_segments() {
        let root = TemporaryRoot::new().expect("a root");
        let path = root.path().to_owned();
        let other = TemporaryRoot::new().expect("another root");
        assert_ne!(other.path(), path);
        let segments = || {
            let prefix = prefix(&path);
            let entries = fs::read_dir(SEGMENTS).expect("listed").flatten();
            entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix)).count()
        };
        let endpoint = Endpoint::new("example", Some(root.path())).expect("an endpoint");
        let driver = DriverEnd::create(&endpoint).expect("a driver");
        assert!(segments() > 0);
        drop(driver);
        drop(root);
        assert!(!path.exists());
        assert_eq!(segments(), 0);
    }
}
