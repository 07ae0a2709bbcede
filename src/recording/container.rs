//! The records of an MCAP file in their order, as far as they are whole: what readers and recovery share.
//!
//! The index at the end of a file is not needed: a file that was cut has none. A chunk counts as a whole or
//! not at all, by its checksum. Memory is bounded by the longest record.
//!
//! Source: the MCAP specification, version 0 (<https://mcap.dev/spec>).

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, parse_record};

use super::error::RecordingError;

/// Longest record that is believed, bytes: far above any chunk.
const RECORD_MAX: u64 = 1 << 30;

/// How far a file could be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// To its end, which is there.
    Whole,
    /// To here; the rest is not there, or not whole.
    Cut {
        /// Bytes that were read as whole records.
        at: u64,
    },
}

/// Records of a file, those in chunks among them.
#[derive(Debug)]
pub struct Records {
    path: PathBuf,
    reader: BufReader<File>,
    /// Bytes of whole records so far.
    at: u64,
    /// Of the chunk that was read last, in reverse.
    unpacked: Vec<Record<'static>>,
    ending: Option<Ending>,
    /// Chunks whose checksum is wrong.
    damaged: u64,
}

impl Records {
    /// At the first record of a file.
    ///
    /// # Errors
    /// When there is no such file, or it is no MCAP.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let opened = File::open(path).and_then(|file| {
            // A folder opens, and only reading tells.
            if file.metadata()?.is_dir() { Err(io::ErrorKind::IsADirectory.into()) } else { Ok(file) }
        });
        let file = opened.map_err(|source| RecordingError::Open { path: path.to_owned(), source })?;
        let mut reader = BufReader::with_capacity(1 << 18, file);
        let mut magic = [0; MAGIC.len()];
        let read = fill(&mut reader, &mut magic).map_err(|error| RecordingError::read(path, error))?;
        if read < magic.len() || magic != *MAGIC {
            return Err(RecordingError::NotARecording {
                path: path.to_owned(),
                reason: "it is no MCAP file",
            });
        }
        let at = magic.len() as u64;
        Ok(Self { path: path.to_owned(), reader, at, unpacked: Vec::new(), ending: None, damaged: 0 })
    }

    /// The next record; `None` at the end, of which [`Self::ending`] tells.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn next(&mut self) -> Result<Option<Record<'static>>, RecordingError> {
        loop {
            if let Some(record) = self.unpacked.pop() {
                return Ok(Some(record));
            }
            if self.ending.is_some() {
                return Ok(None);
            }
            let read = self.read().map_err(|error| RecordingError::read(&self.path, error))?;
            let Some((code, body)) = read else {
                self.ending = Some(Ending::Cut { at: self.at });
                return Ok(None);
            };
            self.at += 9 + body.len() as u64;
            if code == op::CHUNK {
                match unpacked(&body) {
                    Some(records) => self.unpacked.extend(records.into_iter().rev()),
                    None => self.damaged += 1,
                }
                continue;
            }
            match parse_record(code, &body) {
                Ok(Record::Footer(_)) => {
                    self.ending = Some(Ending::Whole);
                    return Ok(None);
                }
                Ok(record) => return Ok(Some(record.into_owned())),
                Err(_) => self.damaged += 1,
            }
        }
    }

    /// Reads one record; `None` when the file ends before it does.
    fn read(&mut self) -> io::Result<Option<(u8, Vec<u8>)>> {
        let mut head = [0; 9];
        if fill(&mut self.reader, &mut head)? < head.len() {
            return Ok(None);
        }
        let [code, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        let is_known = (op::HEADER..=op::DATA_END).contains(&code) || code >= 0x80;
        if !is_known || length > RECORD_MAX {
            return Ok(None);
        }
        let mut body = Vec::new();
        // Grows with what is there: a length that is a lie costs no memory.
        let read = self.reader.by_ref().take(length).read_to_end(&mut body)?;
        Ok((read as u64 == length).then_some((code, body)))
    }

    /// How far it was read, once there is no next record.
    #[must_use]
    pub fn ending(&self) -> Ending {
        self.ending.unwrap_or(Ending::Cut { at: self.at })
    }

    /// Whole records that were left out because their checksum or content is wrong.
    #[must_use]
    pub fn damaged(&self) -> u64 {
        self.damaged
    }
}

/// The records of a chunk; `None` when one is not whole. Its checksum is looked at before any record: a length within a
/// damaged one may be anything, and memory of that length would be asked for.
fn unpacked(body: &[u8]) -> Option<Vec<Record<'static>>> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(RECORD_MAX as usize);
    let mut reader = LinearReader::new_with_options(options);
    let head = [&[op::CHUNK][..], &(body.len() as u64).to_le_bytes()].concat();
    let mut rest = head.as_slice().chain(body);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::ReadRequest(length) => {
                // Nothing read means the end.
                let read = rest.read(reader.insert(length.min(head.len() + body.len()))).ok()?;
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } => {
                records.push(parse_record(opcode, data).ok()?.into_owned());
            }
        }
    }
    Some(records)
}

/// Reads until `bytes` is full or the file ends; how many were read.
fn fill(reader: &mut impl Read, bytes: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < bytes.len() {
        match reader.read(&mut bytes[filled..]) {
            Ok(0) => break,
            Ok(read) => filled += read,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
