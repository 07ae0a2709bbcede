//! Writes a recording: cycles into an MCAP file of small chunks, each whole on the disk or not there.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use magsteer_hal::record::CycleMessage;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};

use super::cdr::Encoder;
use super::cycle::Cycle;
use super::error::RecordingError;
use super::info::{CONFIG, DESCRIPTION, Info, METADATA, METADATA_END};
use super::schemas::{self, ENCODING, MESSAGE_ENCODING};
use super::sink::{Pending, PiecewiseFile};
use super::topics::{self, joint_names, ros_name};

/// A chunk is closed when it is longer, bytes: about half a second of a small rig at 1 kHz.
const CHUNK_BYTES: u64 = 512 << 10;
/// Viewers get a cycle every so often: their topics are a thinned copy.
const VIEW_PERIOD_NS: u64 = 10_000_000;

/// Channels of a recording.
#[derive(Debug)]
struct Channels {
    cycle: u16,
    events: u16,
    measured_joints: u16,
    commanded_joints: u16,
    /// Measured and desired pose of each magnet.
    magnets: Vec<(u16, u16)>,
}

/// How a recording ended.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct End {
    /// Cycles of the run that are not in it: lost on the way.
    pub lost: u64,
    /// Those of them that never left the daemon.
    pub dropped: u64,
    /// True when the loop's last cycle is in it.
    pub is_complete: bool,
}

/// A recording under way. Belongs to the thread that made it.
pub struct RecordingWriter {
    path: PathBuf,
    file: PiecewiseFile,
    container: Writer<Pending>,
    channels: Channels,
    info: Info,
    joints: Vec<String>,
    /// Memory of the last message.
    bytes: Vec<u8>,
    previous: Option<Cycle>,
    next_view_ns: u64,
    cycles: u64,
    /// Those of them that are on the disk.
    written: u64,
    events: u32,
}

impl std::fmt::Debug for RecordingWriter {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("RecordingWriter").field("path", &self.path).finish_non_exhaustive()
    }
}

impl RecordingWriter {
    /// Makes the file and writes its head, the resolved configuration among it.
    ///
    /// # Errors
    /// When the file is there already or cannot be made.
    pub fn create(path: &Path, info: Info, config_text: &str) -> Result<Self, RecordingError> {
        let made = PiecewiseFile::create(path);
        let file = made.map_err(|source| RecordingError::Create { path: path.to_owned(), source })?;
        let begun = begin(file.pending(), &info, config_text);
        let (container, channels) = begun.map_err(|error| RecordingError::container(path, error))?;
        let mut writer = Self {
            path: path.to_owned(),
            file,
            container,
            channels,
            joints: joint_names(&info),
            info,
            bytes: Vec::new(),
            previous: None,
            next_view_ns: 0,
            cycles: 0,
            written: 0,
            events: 0,
        };
        writer.flush()?;
        Ok(writer)
    }

    /// Takes over one cycle; on the disk with the next [`Self::flush`].
    ///
    /// # Errors
    /// When the container refuses it.
    pub fn write(&mut self, message: &CycleMessage) -> Result<(), RecordingError> {
        let cycle = Cycle::of_message(message, self.info.sizes());
        self.write_cycle(cycle).map_err(|error| RecordingError::container(&self.path, error))
    }

    fn write_cycle(&mut self, cycle: Cycle) -> Result<(), McapError> {
        let now_ns = cycle.now_ns;
        let sequence = self.cycles as u32;
        self.put(self.channels.cycle, sequence, now_ns, |encoder| cycle.encode(encoder))?;
        for (level, text) in topics::events(&cycle, self.previous.as_ref()) {
            self.note(now_ns, level, &text)?;
        }
        if now_ns >= self.next_view_ns {
            self.next_view_ns = now_ns + VIEW_PERIOD_NS;
            self.write_views(&cycle)?;
        }
        self.cycles += 1;
        self.previous = Some(cycle);
        Ok(())
    }

    /// Writes one event.
    ///
    /// # Errors
    /// When the container refuses it.
    pub fn event(&mut self, now_ns: u64, level: u8, text: &str) -> Result<(), RecordingError> {
        self.note(now_ns, level, text).map_err(|error| RecordingError::container(&self.path, error))
    }

    fn note(&mut self, now_ns: u64, level: u8, text: &str) -> Result<(), McapError> {
        let (wall_ns, rig) = (self.wall_ns(now_ns), self.info.rig.clone());
        self.events += 1;
        self.put(self.channels.events, self.events, now_ns, |encoder| {
            topics::log(encoder, wall_ns, level, &rig, text);
        })
    }

    fn write_views(&mut self, cycle: &Cycle) -> Result<(), McapError> {
        let (now_ns, wall_ns, sequence) = (cycle.now_ns, self.wall_ns(cycle.now_ns), self.cycles as u32);
        let joints = std::mem::take(&mut self.joints);
        if cycle.feedback_received == 1 {
            self.put(self.channels.measured_joints, sequence, now_ns, |encoder| {
                topics::joints(encoder, wall_ns, &joints, &cycle.measured_a, &cycle.measured_rad);
            })?;
        }
        self.put(self.channels.commanded_joints, sequence, now_ns, |encoder| {
            topics::joints(encoder, wall_ns, &joints, &cycle.commanded_a, &cycle.commanded_rad);
        })?;
        self.joints = joints;
        if cycle.pose_received == 0 {
            return Ok(());
        }
        for magnet in 0..self.channels.magnets.len() {
            let (measured, desired) = self.channels.magnets[magnet];
            let (position, orientation) = (&cycle.position_m[magnet], &cycle.orientation[magnet]);
            self.put(measured, sequence, now_ns, |encoder| {
                topics::pose(encoder, wall_ns, position, orientation);
            })?;
            let turned = topics::turned_to(orientation, &cycle.desired[magnet]);
            self.put(desired, sequence, now_ns, |encoder| topics::pose(encoder, wall_ns, position, &turned))?;
        }
        Ok(())
    }

    fn put(
        &mut self,
        channel_id: u16,
        sequence: u32,
        now_ns: u64,
        fill: impl FnOnce(&mut Encoder),
    ) -> Result<(), McapError> {
        let mut encoder = Encoder::reusing(std::mem::take(&mut self.bytes));
        fill(&mut encoder);
        self.bytes = encoder.finish();
        let time = self.wall_ns(now_ns);
        let header = MessageHeader { channel_id, sequence, log_time: time, publish_time: time };
        self.container.write_to_known_channel(&header, &self.bytes)
    }

    fn wall_ns(&self, monotonic_ns: u64) -> u64 {
        monotonic_ns.saturating_add(self.info.wall_offset_ns)
    }

    /// Closes the chunk and brings all that was written to the disk.
    ///
    /// # Errors
    /// When the disk takes it not; it is kept, and the next call tries again.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        self.container.flush().map_err(|error| RecordingError::container(&self.path, error))?;
        self.file.commit().map_err(|error| RecordingError::write(&self.path, error))?;
        self.written = self.cycles;
        Ok(())
    }

    /// Cycles on the disk.
    #[must_use]
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Bytes that the disk did not take yet.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.file.waiting()
    }

    /// Cycles taken over.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// Bytes in the file.
    #[must_use]
    pub fn length(&self) -> u64 {
        self.file.length()
    }

    /// Writes how it ended, and the index; then it is whole.
    ///
    /// # Errors
    /// When the disk takes it not.
    pub fn finish(mut self, end: &End) -> Result<u64, RecordingError> {
        let entries = [
            ("cycles", self.cycles.to_string()),
            ("lost", end.lost.to_string()),
            ("dropped", end.dropped.to_string()),
            ("is_complete", end.is_complete.to_string()),
        ];
        let metadata = entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        let record = Metadata { name: METADATA_END.to_owned(), metadata };
        let written = self.container.write_metadata(&record).and_then(|()| self.container.finish().map(drop));
        written.map_err(|error| RecordingError::container(&self.path, error))?;
        self.file.commit().map_err(|error| RecordingError::write(&self.path, error))?;
        Ok(self.file.length())
    }
}

/// The options of every container that this program writes.
pub(super) fn options(profile: &str) -> WriteOptions {
    WriteOptions::new()
        .profile(profile)
        .library(concat!("magsteer ", env!("CARGO_PKG_VERSION")))
        .compression(Some(Compression::Lz4))
        .chunk_size(Some(CHUNK_BYTES))
        .disable_seeking(true)
}

fn begin(pending: Pending, info: &Info, config_text: &str) -> Result<(Writer<Pending>, Channels), McapError> {
    let mut container = Writer::with_options(pending, options("ros2"))?;
    // First of all, so that a file that was cut says what it is.
    container.write_metadata(&Metadata { name: METADATA.to_owned(), metadata: info.to_metadata() })?;
    for (name, media_type, text) in
        [(CONFIG, "application/toml", config_text), (DESCRIPTION, "text/plain", &info.description)]
    {
        container.attach(&Attachment {
            log_time: info.wall_offset_ns,
            create_time: info.wall_offset_ns,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: Cow::Borrowed(text.as_bytes()),
        })?;
    }
    let channels = channels(&mut container, info)?;
    Ok((container, channels))
}

fn channels(container: &mut Writer<Pending>, info: &Info) -> Result<Channels, McapError> {
    let mut schema = |name, text: String| container.add_schema(name, ENCODING, text.as_bytes());
    let cycle = schema(schemas::CYCLE, schemas::cycle())?;
    let log = schema(schemas::LOG, schemas::log())?;
    let joints = schema(schemas::JOINTS, schemas::joints())?;
    let pose = schema(schemas::POSE, schemas::pose())?;
    let rig = ros_name(&info.rig);
    let mut channel = |schema, name: &str, unit: &str| {
        let metadata = BTreeMap::from([("unit".to_owned(), unit.to_owned())]);
        container.add_channel(schema, &format!("/{rig}/{name}"), MESSAGE_ENCODING, &metadata)
    };
    let in_names = "the last word of each field's name; times are CLOCK_MONOTONIC";
    let of_joints = "currents in A, joints NAME_a; angles in rad, joints NAME_rad; every 10 ms at most";
    let of_poses = "m, and quaternions whose z is the magnet's tangent; every 10 ms at most";
    let of_goals = "as measured_cp, turned to the desired tangent; position as measured";
    Ok(Channels {
        cycle: channel(cycle, "cycle", in_names)?,
        events: channel(log, "events", "none")?,
        measured_joints: channel(joints, "measured_js", of_joints)?,
        commanded_joints: channel(joints, "setpoint_js", of_joints)?,
        magnets: info
            .magnets
            .iter()
            .map(|magnet| {
                let magnet = ros_name(magnet);
                let measured = channel(pose, &format!("{magnet}/measured_cp"), of_poses)?;
                Ok((measured, channel(pose, &format!("{magnet}/setpoint_cp"), of_goals)?))
            })
            .collect::<Result<_, McapError>>()?,
    })
}
