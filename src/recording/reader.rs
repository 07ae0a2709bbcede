//! Reads a recording back, whole or cut.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::Record;

use super::cdr::Decoder;
use super::container::{Ending, Records};
use super::cycle::Cycle;
use super::error::RecordingError;
use super::info::{CONFIG, DESCRIPTION, Info, METADATA, METADATA_END};
use super::recorder::recording_in;
use super::schemas;

/// Metadata by name, then by key.
pub type MetadataMap = BTreeMap<String, BTreeMap<String, String>>;

/// Something that happened during a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Event {
    /// When, by the clock on the wall, nanoseconds since 1970.
    pub wall_ns: u64,
    /// How much it matters, one of [`super::level`].
    pub level: u8,
    /// What.
    pub text: String,
}

/// What a recording holds, counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Counts {
    /// Cycles.
    pub cycles: u64,
    /// Number of the first one's period; 0 without any.
    pub first_number: u64,
    /// Number of the last one's.
    pub last_number: u64,
    /// When the first began.
    pub first_ns: u64,
    /// When the last began.
    pub last_ns: u64,
    /// Holes: places where a cycle is not the one that followed on the daemon's grid.
    pub holes: u64,
    /// Periods between the first cycle and the last that the loop missed, as the cycles after them tell: they
    /// have no cycle, and are no holes.
    pub missed: u64,
    /// Messages of all topics.
    pub messages: u64,
    /// Records that are damaged.
    pub damaged: u64,
    /// How far the file could be read.
    pub ending: Ending,
    /// The recorder's word that the run's last cycle is there; `None` when it did not come to say.
    pub is_complete: Option<bool>,
}

impl Counts {
    /// Periods from the first cycle to the last: those with a cycle, those missed and those lost.
    #[must_use]
    pub fn periods(&self) -> u64 {
        if self.cycles == 0 { 0 } else { self.last_number.saturating_sub(self.first_number) + 1 }
    }

    /// Cycles that the run had and the recording has not, between its first and its last.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.periods().saturating_sub(self.cycles + self.missed)
    }
}

/// Where a cycle stands in its run.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    number: u64,
    now_ns: u64,
}

/// A recording, opened: its head is read, its cycles are where they are.
#[derive(Debug, Clone)]
pub struct Recording {
    path: PathBuf,
    info: Info,
    config_text: String,
    description: String,
}

impl Recording {
    /// Opens a run's folder, or a recording.
    ///
    /// # Errors
    /// When there is none, it is another program's, or it was cut before its head ended.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let path = recording_in(path);
        let mut records = Records::open(&path)?;
        let (mut info, mut config_text, mut description) = (None, None, String::new());
        // The head stands before the first chunk, and every chunk begins after it.
        while let Some(record) = records.next()? {
            match record {
                Record::Metadata(metadata) if metadata.name == METADATA => {
                    info = Some(Info::of_metadata(&metadata.metadata));
                }
                Record::Attachment { header, data, .. } if header.name == CONFIG => {
                    config_text = Some(String::from_utf8_lossy(&data).into_owned());
                }
                Record::Attachment { header, data, .. } if header.name == DESCRIPTION => {
                    description = String::from_utf8_lossy(&data).into_owned();
                }
                Record::Message { .. } => break,
                _ => {}
            }
        }
        match (info, config_text) {
            (Some(info), Some(config_text)) => Ok(Self { path, info, config_text, description }),
            _ => Err(RecordingError::NotARecording { path, reason: "its head is missing" }),
        }
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What it says of itself.
    #[must_use]
    pub fn info(&self) -> &Info {
        &self.info
    }

    /// The resolved configuration of the run.
    #[must_use]
    pub fn config_text(&self) -> &str {
        &self.config_text
    }

    /// What the operator said of the run.
    #[must_use]
    pub fn description(&self) -> &str {
        &self.description
    }

    /// Every cycle, in the order of the run.
    ///
    /// # Errors
    /// When the file cannot be opened any more.
    pub fn cycles(&self) -> Result<Cycles, RecordingError> {
        Ok(Cycles {
            messages: Messages::open(self.path.clone())?,
            program: self.info.program.clone(),
            is_checked: false,
        })
    }

    /// What happened, in its order.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn events(&self) -> Result<Vec<Event>, RecordingError> {
        let mut messages = Messages::open(self.path.clone())?;
        let mut events = Vec::new();
        while let Some(message) = messages.next(schemas::LOG)? {
            let decoded = log_text(&message.data);
            let (level, text) =
                decoded.map_err(|source| RecordingError::Cycle { path: self.path.clone(), source })?;
            events.push(Event { wall_ns: message.wall_ns, level, text });
        }
        Ok(events)
    }

    /// All metadata, those at the end among them.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn metadata(&self) -> Result<MetadataMap, RecordingError> {
        let mut records = Records::open(&self.path)?;
        let mut found = MetadataMap::new();
        while let Some(record) = records.next()? {
            if let Record::Metadata(metadata) = record {
                found.insert(metadata.name, metadata.metadata);
            }
        }
        Ok(found)
    }

    /// Counts everything: reads the whole file.
    ///
    /// # Errors
    /// When the file cannot be read, or a cycle does not decode.
    pub fn counts(&self) -> Result<Counts, RecordingError> {
        let mut cycles = self.cycles()?;
        let (mut first, mut last) = (None, None);
        let (mut count, mut holes, mut missed) = (0, 0, 0);
        for cycle in cycles.by_ref() {
            let cycle = cycle?;
            // A recording that begins late has no hole for that; its first number tells.
            holes += u64::from(last.is_some_and(|place: Place| !follows(Some(place.number), &cycle)));
            missed += last.map_or(0, |_| cycle.missed);
            let place = Place { number: cycle.number, now_ns: cycle.now_ns };
            first.get_or_insert(place);
            last = Some(place);
            count += 1;
        }
        let messages = cycles.messages;
        let told = messages.end.as_ref().and_then(|end| end.get("is_complete"));
        Ok(Counts {
            cycles: count,
            first_number: first.unwrap_or_default().number,
            last_number: last.unwrap_or_default().number,
            first_ns: first.unwrap_or_default().now_ns,
            last_ns: last.unwrap_or_default().now_ns,
            holes,
            missed,
            messages: messages.count,
            damaged: messages.records.damaged(),
            ending: messages.records.ending(),
            is_complete: told.map(|told| told == "true"),
        })
    }
}

/// True when `cycle` is the one after `previous`, the number of a period; without one when it is a run's
/// first.
#[must_use]
pub fn follows(previous: Option<u64>, cycle: &Cycle) -> bool {
    cycle.number == previous.map_or(0, |number| number + 1) + cycle.missed
}

/// Level and text of an event.
fn log_text(bytes: &[u8]) -> Result<(u8, String), super::cdr::CdrError> {
    let mut decoder = Decoder::new(bytes)?;
    let _seconds_and_nanoseconds = (decoder.u32()?, decoder.u32()?);
    let level = decoder.u8()?;
    let _rig = decoder.text()?;
    Ok((level, decoder.text()?.to_owned()))
}

/// The cycles of a recording.
#[derive(Debug)]
pub struct Cycles {
    messages: Messages,
    program: String,
    is_checked: bool,
}

impl Cycles {
    /// True when the fields recorded are those of this version.
    fn check(&mut self) -> Result<(), RecordingError> {
        let recorded = self.messages.schema(schemas::CYCLE);
        if recorded.is_some_and(|recorded| recorded != schemas::cycle().as_bytes()) {
            return Err(RecordingError::Version {
                path: self.messages.path.clone(),
                program: self.program.clone(),
                own: env!("CARGO_PKG_VERSION"),
            });
        }
        self.is_checked = true;
        Ok(())
    }

    fn take(&mut self) -> Result<Option<Cycle>, RecordingError> {
        let Some(message) = self.messages.next(schemas::CYCLE)? else { return Ok(None) };
        if !self.is_checked {
            self.check()?;
        }
        let decoded = Cycle::decode(&message.data);
        decoded.map(Some).map_err(|source| RecordingError::Cycle { path: self.messages.path.clone(), source })
    }
}

impl Iterator for Cycles {
    type Item = Result<Cycle, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.take().transpose()
    }
}

/// One message.
#[derive(Debug)]
struct Message {
    wall_ns: u64,
    data: Vec<u8>,
}

/// Messages of a file by the name of their type.
#[derive(Debug)]
struct Messages {
    path: PathBuf,
    records: Records,
    /// Name and text by number.
    schemas: BTreeMap<u16, (String, Vec<u8>)>,
    /// Number of the schema by that of the channel.
    channels: BTreeMap<u16, u16>,
    /// Metadata with which the recording ends, once it was passed.
    end: Option<BTreeMap<String, String>>,
    /// Messages passed, of any type.
    count: u64,
}

impl Messages {
    fn open(path: PathBuf) -> Result<Self, RecordingError> {
        let records = Records::open(&path)?;
        let (schemas, channels) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { path, records, schemas, channels, end: None, count: 0 })
    }

    fn schema(&self, name: &str) -> Option<&[u8]> {
        self.schemas.values().find(|(known, _)| known == name).map(|(_, text)| text.as_slice())
    }

    /// The next message of a type.
    fn next(&mut self, name: &str) -> Result<Option<Message>, RecordingError> {
        while let Some(record) = self.records.next()? {
            match record {
                Record::Schema { header, data } => {
                    self.schemas.insert(header.id, (header.name, data.into_owned()));
                }
                Record::Channel(channel) => {
                    self.channels.insert(channel.id, channel.schema_id);
                }
                Record::Metadata(metadata) if metadata.name == METADATA_END => {
                    self.end = Some(metadata.metadata);
                }
                Record::Message { header, data } => {
                    self.count += 1;
                    let schema = self.channels.get(&header.channel_id);
                    let schema = schema.and_then(|schema| self.schemas.get(schema));
                    if schema.is_some_and(|(known, _)| known == name) {
                        return Ok(Some(Message { wall_ns: header.log_time, data: data.into_owned() }));
                    }
                }
                _ => {}
            }
        }
        Ok(None)
    }
}
