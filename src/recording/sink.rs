//! The end of a recording that touches the disk: whole pieces or nothing.
//!
//! Problem: a disk that is full for a while must not end a recording, nor leave half a chunk in the middle of
//! it. Method: the container writes into memory; what it has written goes to the file in one piece when it is
//! asked for. A piece that cannot be written whole is taken back and tried again with what came after it.

use std::cell::RefCell;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;
use std::rc::Rc;

/// What was written and is not in the file yet.
#[derive(Debug, Clone, Default)]
pub struct Pending(Rc<RefCell<Buffer>>);

#[derive(Debug, Default)]
struct Buffer {
    bytes: Vec<u8>,
    position: u64,
}

impl Write for Pending {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut buffer = self.0.borrow_mut();
        buffer.bytes.extend(bytes);
        buffer.position += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Pending {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.0.borrow().position),
            // The container is told not to.
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}

/// A file that grows by whole pieces.
#[derive(Debug)]
pub struct PiecewiseFile {
    file: File,
    pending: Pending,
    length: u64,
}

impl PiecewiseFile {
    /// Makes a file that must not be there yet.
    ///
    /// # Errors
    /// When it is there, or cannot be made.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create_new(true).open(path)?;
        Ok(Self { file, pending: Pending::default(), length: 0 })
    }

    /// Where the container writes to.
    #[must_use]
    pub fn pending(&self) -> Pending {
        self.pending.clone()
    }

    /// Writes what waits; nothing of it is in the file when that fails.
    ///
    /// # Errors
    /// What the file system says.
    pub fn commit(&mut self) -> io::Result<()> {
        let mut buffer = self.pending.0.borrow_mut();
        if let Err(error) = self.file.write_all(&buffer.bytes) {
            // A tail that cannot even be cut off is one that readers leave out.
            let _ =
                self.file.set_len(self.length).and_then(|()| self.file.seek(SeekFrom::Start(self.length)));
            return Err(error);
        }
        self.length += buffer.bytes.len() as u64;
        buffer.bytes.clear();
        Ok(())
    }

    /// Bytes that wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.pending.0.borrow().bytes.len()
    }

    /// Bytes in the file.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.length
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Write;

    use super::PiecewiseFile;

    /// Goal: a piece that the disk refuses is kept and written later with what came after it, in order.
    #[test]
    fn what_the_disk_refuses_is_kept_and_written_later() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pieces");
        let mut file = PiecewiseFile::create(&path).expect("room");
        let mut pending = file.pending();
        pending.write_all(b"one,").expect("memory");
        file.commit().expect("room");
        pending.write_all(b"two,").expect("memory");
        // A file that is open for reading alone refuses as a full disk does.
        let writable = std::mem::replace(&mut file.file, File::open(&path).expect("there"));
        file.commit().expect_err("not writable");
        assert_eq!((file.waiting(), file.length()), (4, 4));
        assert_eq!(std::fs::read(&path).expect("there"), b"one,");
        pending.write_all(b"three").expect("memory");
        file.file = writable;
        file.commit().expect("room");
        assert_eq!((file.waiting(), file.length()), (0, 13));
        assert_eq!(std::fs::read(&path).expect("there"), b"one,two,three");
        assert!(PiecewiseFile::create(&path).is_err(), "nothing is written over");
    }
}
