//! Arrays as NumPy keeps them: `.npy` files, stored without compression in a ZIP.
//!
//! Sources: NumPy, *NEP 1, a simple file format for NumPy arrays*, version 1.0; PKWARE, *APPNOTE.TXT, .ZIP
//! file format specification*, 6.3.

use std::fs::File;
use std::io::{self, BufWriter, Write};

use crate::daemon::recorder::Crc32;

/// What an array is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Doubles.
    F64,
    /// Wide counts.
    U64,
    /// Counts.
    U32,
}

/// The head of an array ends at a multiple of this, bytes.
const NPY_ALIGNMENT: usize = 64;
/// Version of the ZIP format that stored files need, and the least date that it knows.
const ZIP_VERSION: u16 = 20;
const ZIP_DATE: u16 = 1 << 5 | 1;
/// Names are UTF-8.
const ZIP_FLAGS: u16 = 1 << 11;

/// One file of the archive.
#[derive(Debug)]
struct Member {
    name: String,
    crc: u32,
    size: u32,
    offset: u32,
}

/// Writes arrays one after another.
#[derive(Debug)]
pub struct NpzWriter {
    output: BufWriter<File>,
    at: u64,
    members: Vec<Member>,
}

impl NpzWriter {
    /// Into an empty file.
    pub fn new(file: File) -> Self {
        Self { output: BufWriter::with_capacity(1 << 18, file), at: 0, members: Vec::new() }
    }

    /// An array of numbers, given as its little-endian bytes, the last axis running fastest.
    ///
    /// # Errors
    /// What the file system says.
    pub fn array(&mut self, name: &str, kind: Kind, shape: &[u64], bytes: &[u8]) -> io::Result<()> {
        let kind = match kind {
            Kind::F64 => "<f8",
            Kind::U64 => "<u8",
            Kind::U32 => "<u4",
        };
        self.member(name, &head(kind, shape), bytes)
    }

    /// An array of texts.
    ///
    /// # Errors
    /// What the file system says.
    pub fn texts(&mut self, name: &str, texts: &[String]) -> io::Result<()> {
        let width = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let mut bytes = Vec::new();
        for text in texts {
            let padded = text.chars().map(u32::from).chain(std::iter::repeat(0)).take(width);
            padded.for_each(|letter| bytes.extend(letter.to_le_bytes()));
        }
        self.member(name, &head(&format!("<U{width}"), &[texts.len() as u64]), &bytes)
    }

    fn member(&mut self, name: &str, head: &[u8], bytes: &[u8]) -> io::Result<()> {
        let too_large = |_| io::Error::from(io::ErrorKind::FileTooLarge);
        let member = Member {
            name: format!("{name}.npy"),
            crc: Crc32::new().with(head).with(bytes).value(),
            size: u32::try_from(head.len() + bytes.len()).map_err(too_large)?,
            offset: u32::try_from(self.at).map_err(too_large)?,
        };
        let mut local = b"PK\x03\x04".to_vec();
        member.describe(&mut local);
        local.extend(member.name.as_bytes());
        for part in [&local[..], head, bytes] {
            self.output.write_all(part)?;
            self.at += part.len() as u64;
        }
        self.members.push(member);
        Ok(())
    }

    /// Writes the directory; then the archive is whole.
    ///
    /// # Errors
    /// What the file system says.
    pub fn finish(mut self) -> io::Result<()> {
        let too_large = |_| io::Error::from(io::ErrorKind::FileTooLarge);
        let begin = u32::try_from(self.at).map_err(too_large)?;
        let mut directory = Vec::new();
        for member in &self.members {
            directory.extend(b"PK\x01\x02");
            directory.extend(ZIP_VERSION.to_le_bytes());
            member.describe(&mut directory);
            // Comment, disk, attributes: none.
            directory.extend([0; 10]);
            directory.extend(member.offset.to_le_bytes());
            directory.extend(member.name.as_bytes());
        }
        let count = u16::try_from(self.members.len()).map_err(too_large)?;
        let size = u32::try_from(directory.len()).map_err(too_large)?;
        directory.extend(b"PK\x05\x06\0\0\0\0");
        directory.extend(count.to_le_bytes());
        directory.extend(count.to_le_bytes());
        directory.extend(size.to_le_bytes());
        directory.extend(begin.to_le_bytes());
        directory.extend([0; 2]);
        self.output.write_all(&directory)?;
        self.output.flush()
    }
}

impl Member {
    /// What the head of a file and its entry in the directory share.
    fn describe(&self, to: &mut Vec<u8>) {
        let name = self.name.len() as u16;
        // Stored, not compressed; midnight.
        for value in [ZIP_VERSION, ZIP_FLAGS, 0, 0, ZIP_DATE] {
            to.extend(value.to_le_bytes());
        }
        for value in [self.crc, self.size, self.size] {
            to.extend(value.to_le_bytes());
        }
        to.extend(name.to_le_bytes());
        to.extend([0; 2]);
    }
}

/// The head of an array.
fn head(kind: &str, shape: &[u64]) -> Vec<u8> {
    let axes: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({axes}), }}");
    // Ten bytes stand before it, and it ends with a line's end.
    let length = (10 + text.len() + 1).next_multiple_of(NPY_ALIGNMENT) - 10;
    text += &" ".repeat(length - 1 - text.len());
    text.push('\n');
    let mut head = b"\x93NUMPY\x01\x00".to_vec();
    head.extend((length as u16).to_le_bytes());
    head.extend(text.as_bytes());
    head
}

#[cfg(test)]
mod tests {
    use super::head;

    /// Goal: against the format's own words: ten bytes, a literal of Python, and an end at a multiple of 64.
    #[test]
    fn the_head_of_an_array_is_what_numpy_reads() {
        let head = head("<f8", &[3, 2]);
        assert_eq!(&head[..8], b"\x93NUMPY\x01\x00");
        assert_eq!(head.len() % 64, 0);
        assert_eq!(usize::from(u16::from_le_bytes([head[8], head[9]])), head.len() - 10);
        let text = std::str::from_utf8(&head[10..]).expect("text");
        assert!(text.starts_with("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 2, ), }"));
        assert!(text.ends_with(" \n"));
    }
}
