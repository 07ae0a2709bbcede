//! The file of a flight, version 1. All values are little-endian.
//!
//! ```text
//! offset  size            what
//! 0       8               "MSFLIGHT"
//! 8       4               version, 1
//! 12      4               length H of the header
//! 16      H               header: one JSON object in UTF-8; its `columns` say what a record holds
//! 16+H    4               CRC-32 of all before
//!         then blocks, one after another:
//!         4               "BLCK"
//!         4               number of the block, 0 first
//!         4               number of records N in it, 1 to 64
//!         8 N C           the records, C values of 8 bytes each
//!         4               CRC-32 of all of the block before
//!         and at the end:
//!         4               "DONE"
//!         8               records in the file
//!         4               CRC-32 of both
//! ```
//!
//! A block is a sixteenth of a second at 1 kHz: what is lost with a damaged one. Its number is in its
//! checksum, so that blocks cannot change places unseen.

use std::io::{self, Write};

use super::checksum::Crc32;
use super::header::Header;

pub(super) const MAGIC: [u8; 8] = *b"MSFLIGHT";
pub(super) const VERSION: u32 = 1;
pub(super) const BLOCK: [u8; 4] = *b"BLCK";
pub(super) const DONE: [u8; 4] = *b"DONE";
/// Most records of a block.
pub(super) const BLOCK_RECORDS: usize = 64;
/// Bytes of a block beside its records.
pub(super) const BLOCK_EXTRA: u64 = 16;
/// Bytes of the end.
pub(super) const DONE_BYTES: u64 = 16;
/// Longest header: some 50 kB for the largest rig, with room.
pub(super) const HEADER_MAX: usize = 1 << 20;

/// Ending of a flight's name.
pub const FLIGHT_SUFFIX: &str = ".flight";
/// Ending of the name while it is being written.
pub const PARTIAL_SUFFIX: &str = ".flight.partial";

/// Writes a whole flight.
///
/// # Errors
/// What `output` fails with, or `InvalidInput` for a header that is too long.
pub fn write_flight<'a>(
    output: &mut impl Write,
    header: &Header,
    records: impl Iterator<Item = &'a [u8]>,
) -> io::Result<()> {
    output.write_all(&head(header)?)?;
    let mut records = records.peekable();
    let (mut number, mut total) = (0_u32, 0_u64);
    let mut block = Vec::new();
    while records.peek().is_some() {
        block.clear();
        block.extend(BLOCK);
        block.extend(number.to_le_bytes());
        block.extend([0; 4]);
        let mut count = 0_u32;
        for record in records.by_ref().take(BLOCK_RECORDS) {
            block.extend(record);
            count += 1;
        }
        block[8..12].copy_from_slice(&count.to_le_bytes());
        let checksum = Crc32::new().with(&block).value();
        block.extend(checksum.to_le_bytes());
        output.write_all(&block)?;
        number = number.wrapping_add(1);
        total += u64::from(count);
    }
    let mut end = DONE.to_vec();
    end.extend(total.to_le_bytes());
    let checksum = Crc32::new().with(&end).value();
    end.extend(checksum.to_le_bytes());
    output.write_all(&end)
}

/// All before the first block.
fn head(header: &Header) -> io::Result<Vec<u8>> {
    let json = serde_json::to_vec(header)?;
    if json.len() > HEADER_MAX {
        let message = format!("the header has {} bytes, at most {HEADER_MAX} expected", json.len());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    let mut head = MAGIC.to_vec();
    head.extend(VERSION.to_le_bytes());
    head.extend((json.len() as u32).to_le_bytes());
    head.extend(json);
    let checksum = Crc32::new().with(&head).value();
    head.extend(checksum.to_le_bytes());
    Ok(head)
}
