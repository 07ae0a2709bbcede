//! The records of an MCAP file in their order, as far as they are whole: what readers and recovery share.
//!
//! The index at the end of a file is not needed: a file that was cut has none. A chunk counts as a whole or
//! not at all, by its checksum. Memory is bounded by the longest record.
//!
//! Source: the MCAP specification, version 0 (<https://mcap.dev/spec>).

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::records::{ChunkHeader, Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, parse_record};

use super::error::RecordingError;
use super::lengths;
use crate::daemon::recorder::Crc32;

/// Longest record that is believed, bytes: far above any chunk.
const RECORD_MAX: u64 = 1 << 30;
/// Longest content of a compressed chunk that is believed, bytes.
const CHUNK_MAX: usize = 256 << 20;
/// Bytes before the body of a record: its kind and its length.
const HEAD: usize = 9;

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
            self.at += (HEAD + body.len()) as u64;
            match decode(code, &body) {
                Some(Record::Chunk { header, data }) => match unpack(&header, &data, &body) {
                    Some(records) => self.unpacked.extend(records.into_iter().rev()),
                    None => self.damaged += 1,
                },
                Some(Record::Footer(_)) => {
                    self.ending = Some(Ending::Whole);
                    return Ok(None);
                }
                Some(record) => return Ok(Some(record.into_owned())),
                None => self.damaged += u64::from(lengths::is_of_use(code)),
            }
        }
    }

    /// Reads one record; `None` when the file ends before it does.
    fn read(&mut self) -> io::Result<Option<(u8, Vec<u8>)>> {
        let mut head = [0; HEAD];
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

/// A record that a reader looks into; `None` for others, and for one that is damaged.
fn decode(code: u8, body: &[u8]) -> Option<Record<'_>> {
    (lengths::is_of_use(code) && lengths::fit(code, body)).then(|| parse_record(code, body).ok()).flatten()
}

/// The records of a chunk, whose record is `body`; `None` when its checksum or one of them is wrong.
fn unpack(header: &ChunkHeader, data: &[u8], body: &[u8]) -> Option<Vec<Record<'static>>> {
    if header.compression.is_empty() { unpack_plain(header, data) } else { unpack_compressed(body) }
}

fn unpack_plain(header: &ChunkHeader, mut data: &[u8]) -> Option<Vec<Record<'static>>> {
    // No checksum is written as 0.
    if header.uncompressed_crc != 0 && header.uncompressed_crc != Crc32::new().with(data).value() {
        return None;
    }
    let mut records = Vec::new();
    while let Some((&[code, ref length @ ..], rest)) = data.split_first_chunk::<HEAD>() {
        let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
        let (body, behind) = rest.split_at_checked(length)?;
        data = behind;
        keep(code, body, &mut records)?;
    }
    data.is_empty().then_some(records)
}

/// By the library's reader of whole files, of which this is the only record.
fn unpack_compressed(body: &[u8]) -> Option<Vec<Record<'static>>> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(CHUNK_MAX);
    let mut reader = LinearReader::new_with_options(options);
    let head = [&[op::CHUNK], &(body.len() as u64).to_le_bytes()[..]].concat();
    let (mut first, mut rest) = (&head[..], body);
    let mut records = Vec::new();
    while let Some(event) = reader.next_event() {
        match event.ok()? {
            LinearReadEvent::ReadRequest(wanted) => {
                if first.is_empty() {
                    (first, rest) = (rest, &[]);
                }
                let (taken, behind) = first.split_at(wanted.min(first.len()));
                reader.insert(taken.len()).copy_from_slice(taken);
                reader.notify_read(taken.len());
                first = behind;
            }
            LinearReadEvent::Record { data, opcode } => keep(opcode, data, &mut records)?,
        }
    }
    Some(records)
}

/// Adds a record that a reader looks into; `None` when it is damaged.
fn keep(code: u8, body: &[u8], records: &mut Vec<Record<'static>>) -> Option<()> {
    if lengths::is_of_use(code) {
        records.push(decode(code, body)?.into_owned());
    }
    Some(())
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
