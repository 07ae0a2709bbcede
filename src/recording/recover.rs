//! Makes a whole recording of one that was cut.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use mcap::records::{MessageHeader, Record};
use mcap::{Attachment, McapError, Writer};
use serde::Serialize;

use super::container::{Ending, Records};
use super::error::RecordingError;
use super::sink::{Pending, PiecewiseFile};
use super::writer::options;

/// What waits in memory before it is written, bytes.
const PIECE: usize = 4 << 20;

/// What became of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Recovered {
    /// Messages that are in the new file.
    pub messages: u64,
    /// Bytes of the old file that were read as whole records.
    pub bytes_read: u64,
    /// Bytes of the old file behind them.
    pub bytes_lost: u64,
    /// Records that were left out because their checksum or content is wrong.
    pub damaged: u64,
    /// True when the old file was whole already.
    pub was_whole: bool,
}

/// Copies every whole record of `source`, up to where it was cut, into `target`, which must not be there yet,
/// and gives that an end and an index. The source is not touched.
///
/// # Errors
/// When the source cannot be read or is no MCAP, or the target cannot be written.
pub fn recover(source: &Path, target: &Path) -> Result<Recovered, RecordingError> {
    let length = std::fs::metadata(source).map(|metadata| metadata.len());
    let length = length.map_err(|error| RecordingError::Open { path: source.to_owned(), source: error })?;
    let mut records = Records::open(source)?;
    let profile = match records.next()? {
        Some(Record::Header(header)) => header.profile,
        _ => {
            let reason = "it was cut within its head";
            return Err(RecordingError::NotARecording { path: source.to_owned(), reason });
        }
    };
    let file = PiecewiseFile::create(target);
    let mut file = file.map_err(|source| RecordingError::Create { path: target.to_owned(), source })?;
    let refused = |error| RecordingError::container(target, error);
    let container = Writer::with_options(file.pending(), options(&profile)).map_err(refused)?;
    let mut copy = Copier { container, schemas: BTreeMap::new(), channels: BTreeMap::new(), messages: 0 };
    while let Some(record) = records.next()? {
        copy.take(record).map_err(refused)?;
        if file.waiting() > PIECE {
            file.commit().map_err(|error| RecordingError::write(target, error))?;
        }
    }
    copy.container.finish().map_err(refused)?;
    file.commit().map_err(|error| RecordingError::write(target, error))?;
    let ending = records.ending();
    let bytes_read = if let Ending::Cut { at } = ending { at } else { length };
    Ok(Recovered {
        messages: copy.messages,
        bytes_read,
        bytes_lost: length.saturating_sub(bytes_read),
        damaged: records.damaged(),
        was_whole: ending == Ending::Whole,
    })
}

/// Numbers of schemas and channels are the new file's own.
struct Copier {
    container: Writer<Pending>,
    schemas: BTreeMap<u16, u16>,
    channels: BTreeMap<u16, u16>,
    messages: u64,
}

impl Copier {
    fn take(&mut self, record: Record<'_>) -> Result<(), McapError> {
        match record {
            Record::Schema { header, data } => {
                let id = self.container.add_schema(&header.name, &header.encoding, &data)?;
                self.schemas.insert(header.id, id);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id).copied().unwrap_or(0);
                let encoding = &channel.message_encoding;
                let id = self.container.add_channel(schema, &channel.topic, encoding, &channel.metadata)?;
                self.channels.insert(channel.id, id);
            }
            Record::Message { header, data } => {
                // A channel stands before its messages, or within what was lost.
                if let Some(&channel_id) = self.channels.get(&header.channel_id) {
                    let header = MessageHeader { channel_id, ..header };
                    self.container.write_to_known_channel(&header, &data)?;
                    self.messages += 1;
                }
            }
            Record::Attachment { header, data, .. } => self.container.attach(&Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data: Cow::Owned(data.into_owned()),
            })?,
            Record::Metadata(metadata) => self.container.write_metadata(&metadata)?,
            // Indices and statistics are made anew.
            _ => {}
        }
        Ok(())
    }
}
