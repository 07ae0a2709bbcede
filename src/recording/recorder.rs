//! The process that records a run: takes every cycle that the daemon publishes and writes it down.
//!
//! ```text
//!  daemon ── batches ──▶ this thread ── queue ──▶ writer thread ──▶ recording.mcap
//!            (never waits)  takes, counts           encodes, writes twice a second
//! ```
//!
//! A disk that is slow, full or gone fills the queue and the writer's memory, both bounded; beyond that
//! cycles are lost and counted, and the daemon does not notice.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use magsteer_hal::Stamp;
use magsteer_hal::channels::{ChannelError, Endpoint, RecordObserver};
use magsteer_hal::record::RecordBatch;
use serde::Serialize;

use super::error::RecordingError;
use super::info::Info;
use super::topics::level;
use super::writer::{End, RecordingWriter};
use crate::daemon::StopFlag;

/// Name of a recording in its run's folder.
pub const RECORDING: &str = "recording.mcap";
/// Between two looks at the channel.
const POLL: Duration = Duration::from_millis(10);
/// What was taken is on the disk after this at the latest; well below the second that may be lost.
const FLUSH: Duration = Duration::from_millis(500);
/// Batches between taking and writing: 16 s at 1 kHz, 64 MB.
const QUEUE: usize = 2_048;
/// Most memory for what the disk does not take, bytes.
const WAITING_MAX: usize = 128 << 20;
/// A daemon that publishes nothing for so long is gone: its loop publishes whatever it does.
const SILENCE_MAX: Duration = Duration::from_secs(10);
/// The same when this process was told to end.
const SILENCE_ENDED: Duration = Duration::from_secs(1);

/// What to record.
#[derive(Debug, Clone)]
pub struct RecordingPlan {
    /// The file to make.
    pub file: PathBuf,
    /// What stands at its head.
    pub info: Info,
    /// The resolved configuration.
    pub config_text: String,
    /// As [`RecordBatch::config_digest`].
    pub config_digest: u64,
    /// How long the loop's end is waited for when told to end: a service manager tells both at once, and the
    /// ramp to zero is to be recorded.
    pub grace: Duration,
}

/// Why nothing could be recorded.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// The channel.
    #[error(transparent)]
    Channel(#[from] ChannelError),
    /// The file.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The writer's thread.
    #[error("the writer's thread could not be started: {0}")]
    Thread(std::io::Error),
    /// The writer's thread panicked.
    #[error("the writer's thread panicked")]
    WriterPanicked,
    /// The configuration at hand is not the daemon's.
    #[error("the daemon of this rig runs another configuration than the one named: name the daemon's")]
    OtherConfig,
}

/// Why a recording ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Why {
    /// The loop ended.
    LoopEnded,
    /// It was told to end.
    Asked,
    /// Nothing was heard of the daemon for long, or another one took its place.
    DaemonGone,
}

/// How a recording went.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct RecordReport {
    /// The file.
    pub file: PathBuf,
    /// Why it ended.
    pub ended: Why,
    /// Cycles in it.
    pub cycles: u64,
    /// Cycles of the run, since its first one was recorded, that are not.
    pub lost: u64,
    /// Those of them that never left the daemon.
    pub dropped: u64,
    /// True when it holds every cycle of the run, from the first to the last.
    pub is_complete: bool,
    /// Size of the file.
    pub bytes: u64,
    /// Why the disk did not take all of it.
    pub error: Option<String>,
}

/// Records the rig's daemon until its loop ends or `stop` is requested. `attached` is called when nothing
/// that is published from now on is missed, `warn` when the disk takes nothing, and when it does again.
///
/// # Errors
/// When there is no daemon within `wait`, it runs another configuration, or the file cannot be made.
pub fn record(
    endpoint: &Endpoint,
    wait: Duration,
    plan: RecordingPlan,
    stop: &StopFlag,
    attached: impl FnOnce(),
    warn: &(dyn Fn(&str) + Sync),
) -> Result<RecordReport, RecorderError> {
    // A folder that cannot be written to is noticed before anything runs.
    let probe = plan.file.with_extension("partial");
    let probed = std::fs::File::create_new(&probe).and_then(|_| std::fs::remove_file(&probe));
    probed.map_err(|source| RecordingError::Create { path: plan.file.clone(), source })?;
    if plan.file.exists() {
        let source = std::io::ErrorKind::AlreadyExists.into();
        return Err(RecordingError::Create { path: plan.file, source }.into());
    }
    let mut observer = RecordObserver::open(endpoint, wait)?;
    let (queue, batches) = sync_channel(QUEUE);
    let (config_digest, grace, is_distant) = (plan.config_digest, plan.grace, observer.is_distant());
    std::thread::scope(|scope| {
        let writer = std::thread::Builder::new()
            .name("magsteer-writer".to_owned())
            .spawn_scoped(scope, move || Scribe::new(plan, is_distant, warn).serve(&batches))
            .map_err(RecorderError::Thread)?;
        attached();
        let taken =
            take(&mut observer, &queue, config_digest, &Asked::new(stop, grace), &|| writer.is_finished());
        drop(queue);
        let report = writer.join().map_err(|_| RecorderError::WriterPanicked)?;
        let why = taken?;
        Ok(RecordReport { ended: why, ..report? })
    })
}

/// When it was told to end.
struct Asked<'a> {
    stop: &'a StopFlag,
    grace: Duration,
    since: OnceCell<Instant>,
}

impl<'a> Asked<'a> {
    fn new(stop: &'a StopFlag, grace: Duration) -> Self {
        Self { stop, grace, since: OnceCell::new() }
    }

    /// True when it is to end at last, the daemon having been heard last at `heard`.
    fn is_time(&self, heard: Option<Instant>) -> bool {
        let waited = self.since.get_or_init(Instant::now).elapsed();
        // A loop that still runs is heard every few milliseconds.
        let is_heard = heard.is_some_and(|heard| heard.elapsed() < SILENCE_ENDED);
        waited >= self.grace || !is_heard && waited >= SILENCE_ENDED
    }
}

/// Takes batches until something ends it.
fn take(
    observer: &mut RecordObserver,
    queue: &SyncSender<Box<RecordBatch>>,
    config_digest: u64,
    asked: &Asked<'_>,
    writer_is_gone: &dyn Fn() -> bool,
) -> Result<Why, RecorderError> {
    let mut heard: Option<Instant> = None;
    let (mut is_last, mut is_other) = (false, false);
    loop {
        let is_asked = asked.stop.requested().is_some();
        let restarts = observer.loss().restarts;
        let mut life = None;
        observer.drain(Stamp::now(), |batch| {
            heard = Some(Instant::now());
            is_other |=
                batch.config_digest != 0 && config_digest != 0 && batch.config_digest != config_digest;
            let first = *life.get_or_insert(batch.header.epoch);
            // Of another daemon's life nothing is recorded; a queue that is full shows as a hole.
            if !is_last && first == batch.header.epoch && restarts == 0 {
                let _ = queue.try_send(Box::new(*batch));
            }
            is_last |= batch.is_last == 1;
        });
        if is_other {
            return Err(RecorderError::OtherConfig);
        }
        if is_last {
            return Ok(Why::LoopEnded);
        }
        let is_silent = heard.is_some_and(|heard| heard.elapsed() > SILENCE_MAX);
        if is_silent || observer.loss().restarts > 0 {
            return Ok(Why::DaemonGone);
        }
        // Asked before the last look, so that nothing published before is missed.
        if is_asked && asked.is_time(heard) || writer_is_gone() {
            return Ok(Why::Asked);
        }
        std::thread::sleep(POLL);
    }
}

/// The writer's thread.
struct Scribe<'a> {
    plan: RecordingPlan,
    /// True when stamps are those of another machine's clock.
    is_distant: bool,
    writer: Option<RecordingWriter>,
    next_flush: Instant,
    /// How many cycles came to the publisher before the next one to be taken.
    expected: Option<u64>,
    end: End,
    has_first: bool,
    has_last: bool,
    /// Why the disk takes nothing; `None` while it does.
    error: Option<String>,
    warn: &'a (dyn Fn(&str) + Sync),
}

impl<'a> Scribe<'a> {
    fn new(plan: RecordingPlan, is_distant: bool, warn: &'a (dyn Fn(&str) + Sync)) -> Self {
        Self {
            plan,
            is_distant,
            writer: None,
            next_flush: Instant::now() + FLUSH,
            expected: None,
            end: End::default(),
            has_first: false,
            has_last: false,
            error: None,
            warn,
        }
    }

    fn serve(mut self, batches: &Receiver<Box<RecordBatch>>) -> Result<RecordReport, RecordingError> {
        loop {
            let wait = self.next_flush.saturating_duration_since(Instant::now());
            match batches.recv_timeout(wait) {
                Ok(batch) => self.take(&batch)?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if Instant::now() >= self.next_flush {
                self.flush();
                self.next_flush = Instant::now() + FLUSH;
            }
        }
        self.finish()
    }

    fn take(&mut self, batch: &RecordBatch) -> Result<(), RecordingError> {
        let used = batch.used();
        if self.writer.is_none() {
            let mut info = Info { realtime_missing: batch.realtime_missing == 1, ..self.plan.info.clone() };
            if self.is_distant {
                info.set_wall_offset(batch.header.publish_stamp_ns);
            }
            self.writer = Some(RecordingWriter::create(&self.plan.file, info, &self.plan.config_text)?);
            self.has_first = batch.begin == 0;
            // What went before a recording that begins late is none of its losses.
            self.end.dropped = if self.has_first { 0 } else { batch.dropped };
        }
        let Some(writer) = &mut self.writer else { return Ok(()) };
        let hole = self.expected.map_or(0, |expected| batch.begin.saturating_sub(expected));
        self.expected = Some(batch.begin + used.len() as u64);
        let newly_dropped = batch.dropped.saturating_sub(self.end.dropped);
        self.end.dropped = batch.dropped;
        self.end.lost += hole + newly_dropped;
        self.has_last = batch.is_last == 1;
        if hole + newly_dropped > 0 {
            let text = format!("{} cycles before this one are not recorded", hole + newly_dropped);
            let now_ns = used.first().map_or(0, |cycle| cycle.tick.now_ns);
            writer.event(now_ns, level::WARN, &text)?;
        }
        if writer.waiting() > WAITING_MAX {
            self.end.lost += used.len() as u64;
            return Ok(());
        }
        used.iter().try_for_each(|cycle| writer.write(cycle))
    }

    fn flush(&mut self) {
        let Some(flushed) = self.writer.as_mut().map(RecordingWriter::flush) else { return };
        let is_new = flushed.is_err() != self.error.is_some();
        self.error = flushed.err().map(|error| error.to_string());
        match &self.error {
            // Told once; what waits is tried again.
            Some(error) if is_new => (self.warn)(&format!("{error}; kept in memory and tried again")),
            None if is_new => (self.warn)("the disk takes the recording again"),
            _ => {}
        }
    }

    fn finish(mut self) -> Result<RecordReport, RecordingError> {
        let Self { plan, writer, .. } = &mut self;
        let writer = match writer.take() {
            Some(writer) => writer,
            // Not a single cycle: an empty recording says so.
            None => RecordingWriter::create(&plan.file, plan.info.clone(), &plan.config_text)?,
        };
        let end = End { is_complete: self.has_first && self.has_last && self.end.lost == 0, ..self.end };
        let (cycles, written, length) = (writer.cycles(), writer.written(), writer.length());
        let report = RecordReport {
            file: self.plan.file,
            ended: Why::LoopEnded,
            cycles,
            lost: end.lost,
            dropped: end.dropped,
            is_complete: end.is_complete,
            bytes: length,
            error: None,
        };
        Ok(match writer.finish(&end) {
            Ok(bytes) => RecordReport { bytes, ..report },
            // What waited in memory goes with this process.
            Err(error) => RecordReport {
                cycles: written,
                lost: end.lost + (cycles - written),
                is_complete: false,
                error: Some(error.to_string()),
                ..report
            },
        })
    }
}

/// The recording in a run's folder, or the file itself.
#[must_use]
pub fn recording_in(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(RECORDING) } else { path.to_owned() }
}
