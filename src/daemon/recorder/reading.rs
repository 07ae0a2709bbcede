//! Reads flights, damaged ones as far as their last good block.
//!
//! Everything read is taken for hostile: lengths are bounded before memory is asked for, and a checksum is
//! right before its content is used.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use super::checksum::Crc32;
use super::columns::NONE;
use super::flight::{BLOCK, BLOCK_EXTRA, BLOCK_RECORDS, DONE, DONE_BYTES, HEADER_MAX, MAGIC, VERSION};
use super::header::{Column, Header};

/// Why a file cannot be read as a flight at all.
#[derive(Debug, thiserror::Error)]
pub enum FlightError {
    /// It cannot be opened.
    #[error("{path}: {source}", path = path.display())]
    Open {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Reading failed.
    #[error("{path}: cannot be read: {source}", path = path.display())]
    Read {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It begins otherwise.
    #[error("{path}: is not a flight: it does not begin with MSFLIGHT", path = path.display())]
    NotAFlight {
        /// Which file.
        path: PathBuf,
    },
    /// Another version of the format.
    #[error("{path}: is a flight of version {actual}; this program reads version {expected}", path = path.display())]
    Version {
        /// Which file.
        path: PathBuf,
        /// Version of this program.
        expected: u32,
        /// Version of the file.
        actual: u32,
    },
    /// Its header is cut short or damaged.
    #[error("{path}: its header is damaged: {reason}", path = path.display())]
    Header {
        /// Which file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

/// How far a file could be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// To its end, every checksum right.
    Complete,
    /// It ends in the middle.
    Truncated {
        /// Offset of what is incomplete.
        offset: u64,
    },
    /// What stands there is not what was written.
    Damaged {
        /// Offset of the block.
        offset: u64,
    },
}

impl Ending {
    /// What a person reads: nothing for a complete file.
    #[must_use]
    pub fn words(self) -> Option<String> {
        match self {
            Self::Complete => None,
            Self::Truncated { offset } => Some(format!("cut short in what begins at byte {offset}")),
            Self::Damaged { offset } => Some(format!("damaged in what begins at byte {offset}")),
        }
    }
}

/// A flight as far as it could be read.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    /// What stands at its head.
    pub header: Header,
    /// How far it could be read.
    pub ending: Ending,
    /// Every value, record after record.
    values: Vec<u64>,
}

/// What the head of a flight and its length tell, its records unread.
#[derive(Debug, Clone, PartialEq)]
pub struct FlightLabel {
    /// What stands at its head.
    pub header: Header,
    /// Length of the file.
    pub bytes: u64,
    /// True when the file is as long as its header says.
    pub whole: bool,
}

impl FlightLabel {
    /// Reads the head of a file.
    ///
    /// # Errors
    /// When it is none, of another version, or its header is damaged.
    pub fn read(path: &Path) -> Result<Self, FlightError> {
        let mut source = Source::open(path)?;
        let bytes = source.input.get_ref().metadata().map_err(|source| open_error(path, source))?.len();
        let header = source.header()?;
        let blocks = header.records.div_ceil(BLOCK_RECORDS as u64);
        let records = header.records.saturating_mul(8 * header.columns.len() as u64);
        // A hostile header counts more records than there are numbers.
        let blocks = blocks.saturating_mul(BLOCK_EXTRA);
        let expected = (source.offset + DONE_BYTES).saturating_add(records).saturating_add(blocks);
        Ok(Self { header, bytes, whole: bytes == expected })
    }
}

impl Flight {
    /// Reads a file up to its end or to its last good block.
    ///
    /// # Errors
    /// When it is none, of another version, or its header is damaged.
    pub fn read(path: &Path) -> Result<Self, FlightError> {
        let mut source = Source::open(path)?;
        let header = source.header()?;
        let mut values = Vec::new();
        let ending = source.blocks(&header, &mut values)?;
        Ok(Self { header, ending, values })
    }

    /// Records read.
    #[must_use]
    pub fn records(&self) -> usize {
        self.values.len() / self.width()
    }

    /// Every value of one record, in the order of the header's columns; none past the last.
    #[must_use]
    pub fn record(&self, record: usize) -> &[u64] {
        self.values.chunks_exact(self.width()).nth(record).unwrap_or_default()
    }

    /// Where the column of this name stands.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header.columns.iter().position(|column| column.name == name)
    }

    /// A count; `None` when it, its record or its column is not there.
    #[must_use]
    pub fn count(&self, record: usize, column: &str) -> Option<u64> {
        let bits = *self.record(record).get(self.column(column)?)?;
        (bits != NONE).then_some(bits)
    }

    /// A value as a number, counts too; `None` when it, its record or its column is not there.
    #[must_use]
    pub fn number(&self, record: usize, column: &str) -> Option<f64> {
        let at = self.column(column)?;
        self.number_at(record, at)
    }

    /// As [`Self::number`], of the column at a place.
    #[must_use]
    pub fn number_at(&self, record: usize, column: usize) -> Option<f64> {
        let bits = *self.record(record).get(column)?;
        if self.header.columns.get(column)?.kind == Column::COUNT {
            return (bits != NONE).then_some(bits as f64);
        }
        Some(f64::from_bits(bits)).filter(|value| !value.is_nan())
    }

    /// Seconds from the trigger to the begin of a record; negative before it.
    #[must_use]
    pub fn seconds(&self, record: usize) -> Option<f64> {
        let tick = self.count(record, "tick_ns")?;
        let trigger = self.header.trigger_ns;
        let apart = tick.abs_diff(trigger) as f64 * 1e-9;
        Some(if tick < trigger { -apart } else { apart })
    }

    fn width(&self) -> usize {
        self.header.columns.len().max(1)
    }
}

/// A file under way.
struct Source<'a> {
    path: &'a Path,
    input: BufReader<File>,
    /// Bytes taken so far.
    offset: u64,
}

fn open_error(path: &Path, source: io::Error) -> FlightError {
    FlightError::Open { path: path.to_owned(), source }
}

impl<'a> Source<'a> {
    fn open(path: &'a Path) -> Result<Self, FlightError> {
        let file = File::open(path).map_err(|source| open_error(path, source))?;
        Ok(Self { path, input: BufReader::new(file), offset: 0 })
    }

    /// Fills `bytes`; how many there were.
    fn take(&mut self, bytes: &mut [u8]) -> Result<usize, FlightError> {
        let mut taken = 0;
        while taken < bytes.len() {
            match self.input.read(&mut bytes[taken..]) {
                Ok(0) => break,
                Ok(count) => taken += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(source) => return Err(FlightError::Read { path: self.path.to_owned(), source }),
            }
        }
        self.offset += taken as u64;
        Ok(taken)
    }

    fn bad_header(&self, reason: impl Into<String>) -> FlightError {
        FlightError::Header { path: self.path.to_owned(), reason: reason.into() }
    }

    fn header(&mut self) -> Result<Header, FlightError> {
        let mut start = [0; 16];
        let taken = self.take(&mut start)?;
        if taken < MAGIC.len() || start[..8] != MAGIC {
            return Err(FlightError::NotAFlight { path: self.path.to_owned() });
        }
        if taken < start.len() {
            return Err(self.bad_header("cut short"));
        }
        let actual = word(&start[8..12]);
        if actual != VERSION {
            return Err(FlightError::Version { path: self.path.to_owned(), expected: VERSION, actual });
        }
        let length = word(&start[12..16]) as usize;
        if length > HEADER_MAX {
            return Err(self.bad_header(format!("{length} bytes long, at most {HEADER_MAX} expected")));
        }
        let mut rest = vec![0; length + 4];
        if self.take(&mut rest)? < rest.len() {
            return Err(self.bad_header("cut short"));
        }
        let (json, checksum) = rest.split_at(length);
        if Crc32::new().with(&start).with(json).value() != word(checksum) {
            return Err(self.bad_header("its checksum does not match"));
        }
        serde_json::from_slice(json).map_err(|error| self.bad_header(error.to_string()))
    }

    /// Reads blocks while they are good.
    fn blocks(&mut self, header: &Header, values: &mut Vec<u64>) -> Result<Ending, FlightError> {
        let record_bytes = 8 * header.columns.len();
        let mut block = vec![0; BLOCK_RECORDS * record_bytes + 4];
        for number in 0_u32.. {
            let offset = self.offset;
            let mut start = [0; 12];
            // The end is longer than this too.
            if self.take(&mut start)? < start.len() {
                return Ok(Ending::Truncated { offset });
            }
            if start[..4] == DONE {
                return self.end(&start, (values.len() / header.columns.len().max(1)) as u64, offset);
            }
            let count = word(&start[8..12]) as usize;
            let expected = start[..4] == BLOCK && word(&start[4..8]) == number;
            if !expected || count == 0 || count > BLOCK_RECORDS {
                return Ok(Ending::Damaged { offset });
            }
            let length = count * record_bytes;
            let rest = &mut block[..length + 4];
            let taken = self.take(rest)?;
            if taken < rest.len() {
                return Ok(Ending::Truncated { offset });
            }
            let (records, checksum) = rest.split_at(length);
            if Crc32::new().with(&start).with(records).value() != word(checksum) {
                return Ok(Ending::Damaged { offset });
            }
            values.extend(records.chunks_exact(8).map(long));
        }
        Ok(Ending::Damaged { offset: self.offset })
    }

    fn end(&mut self, start: &[u8; 12], records: u64, offset: u64) -> Result<Ending, FlightError> {
        let mut checksum = [0; 4];
        if self.take(&mut checksum)? < checksum.len() {
            return Ok(Ending::Truncated { offset });
        }
        let sound = Crc32::new().with(start).value() == word(&checksum) && long(&start[4..]) == records;
        let nothing_after = self.take(&mut [0])? == 0;
        Ok(if sound && nothing_after { Ending::Complete } else { Ending::Damaged { offset } })
    }
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| (word << 8) | u32::from(*byte))
}

fn long(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |long, byte| (long << 8) | u64::from(*byte))
}
