//! The files thread: writes events, minutes and flights, and keeps what it cannot write until it can.
//!
//! Nothing waits for it. A disk that is full, a folder that vanished or may not be written, a file system
//! that hangs: each is noted in [`RecorderState`], which the status shows, and tried again once a second.
//! Even when there is nothing to write, room and rights for one flight are looked at every few seconds: to
//! learn of a full disk from a flight that cannot be written is to learn of it too late.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use serde::Serialize;

use super::flight::{FLIGHT_SUFFIX, PARTIAL_SUFFIX, write_flight};
use super::header::Header;
use super::journal::{Entry, event};
use super::lines::{FILE_BYTES_MAX, Lines};
use super::minutes::Minute;
use super::ring::Ring;
use super::wall::compact;
use crate::daemon::log::log;

/// Pause between two attempts to write what could not be written.
const RETRY: Duration = Duration::from_secs(1);
/// Pause between two looks at room and rights.
const CHECK: Duration = Duration::from_secs(5);
/// Events that wait at once.
pub const EVENTS_MAX: usize = 1_024;
/// Room asked for beside that of a flight: the next files of journal and minutes.
const ROOM_BESIDE: u64 = 2 * FILE_BYTES_MAX;
/// Minutes that wait at once: a day. Older ones are forgotten.
const MINUTES_MAX: usize = 1_440;
/// Paths of flights that a run remembers.
const PATHS_MAX: usize = 100;
/// Names tried for a flight when several are written in one second.
const NAMES_MAX: u32 = 1_000;
/// Code of a failure that the system has no number for.
const OTHER_ERROR: u32 = u32::MAX;

/// How the recorder fares: read by the status and by the report of the run.
#[derive(Debug, Default)]
pub struct RecorderState {
    /// Number of the system's last error, 0 while everything can be written.
    pub error: AtomicU32,
    /// Events that wait to be written.
    pub events_waiting: AtomicUsize,
    /// Events that found no room to wait.
    pub events_lost: AtomicU64,
    /// Flights written.
    pub flights: AtomicU32,
    /// Flights for which there was no ring, or no way to a file until the end.
    pub flights_lost: AtomicU32,
    /// Where the newest of them are, the very newest last.
    paths: Mutex<Vec<PathBuf>>,
}

impl RecorderState {
    /// Where the newest flights were written, at most 100, the oldest first.
    #[must_use]
    pub fn paths(&self) -> Vec<PathBuf> {
        self.paths.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn note(&self, path: PathBuf) {
        self.flights.fetch_add(1, Ordering::Relaxed);
        let mut paths = self.paths.lock().unwrap_or_else(PoisonError::into_inner);
        if paths.len() >= PATHS_MAX {
            paths.remove(0);
        }
        paths.push(path);
    }
}

/// Where events, minutes and flights go.
pub trait Store: Send {
    /// Adds a line to the file of such lines.
    ///
    /// # Errors
    /// When nothing was added.
    fn append(&mut self, lines: Lines, line: &str) -> io::Result<()>;

    /// Writes a flight, under a name that nothing had before.
    ///
    /// # Errors
    /// When there is no such file then.
    fn save(&mut self, header: &Header, records: &mut dyn Iterator<Item = &[u8]>) -> io::Result<PathBuf>;

    /// Makes sure that `bytes` could be written.
    ///
    /// # Errors
    /// Why they could not.
    fn check(&mut self, bytes: u64) -> io::Result<()>;
}

/// A folder of the file system.
#[derive(Debug)]
pub struct Folder {
    /// Its path.
    pub path: PathBuf,
    /// Flights kept in it.
    pub flights_max: usize,
}

impl Store for Folder {
    fn append(&mut self, lines: Lines, line: &str) -> io::Result<()> {
        fs::create_dir_all(&self.path)?;
        lines.append(&self.path, line, FILE_BYTES_MAX)
    }

    fn save(&mut self, header: &Header, records: &mut dyn Iterator<Item = &[u8]>) -> io::Result<PathBuf> {
        fs::create_dir_all(&self.path)?;
        self.make_room()?;
        let (path, partial) = self.free_name(header)?;
        let written = write_file(&partial, header, records).and_then(|()| fs::rename(&partial, &path));
        if let Err(error) = written {
            // Its room is what the next attempt needs.
            let _ = fs::remove_file(&partial);
            return Err(error);
        }
        Ok(path)
    }

    fn check(&mut self, bytes: u64) -> io::Result<()> {
        fs::create_dir_all(&self.path)?;
        rustix::fs::access(&self.path, rustix::fs::Access::WRITE_OK | rustix::fs::Access::EXEC_OK)?;
        let room = rustix::fs::statvfs(&self.path)?;
        let is_enough = room.f_bavail.saturating_mul(room.f_frsize) >= bytes.saturating_add(ROOM_BESIDE);
        if is_enough { Ok(()) } else { Err(rustix::io::Errno::NOSPC.into()) }
    }
}

impl Folder {
    /// Deletes the oldest flights of the folder, so that one more is within the bound.
    fn make_room(&self) -> io::Result<()> {
        let mut flights = Vec::new();
        for entry in fs::read_dir(&self.path)? {
            let entry = entry?;
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name.ends_with(FLIGHT_SUFFIX) || name.ends_with(PARTIAL_SUFFIX) {
                flights.push((entry.metadata()?.modified()?, entry.path()));
            }
        }
        flights.sort();
        let surplus = (flights.len() + 1).saturating_sub(self.flights_max.max(1));
        flights.iter().take(surplus).try_for_each(|(_, path)| fs::remove_file(path))
    }

    /// `20261122-091419-bigmag-planar-fault-304`, or the same with a number.
    fn free_name(&self, header: &Header) -> io::Result<(PathBuf, PathBuf)> {
        let rig = header.rig.replace(['/', '\0'], "_");
        let stem = format!("{}-{rig}-{}", compact(SystemTime::now()), header.reason.name());
        let cause = if header.cause == 0 { String::new() } else { format!("-{}", header.cause) };
        for number in 1..=NAMES_MAX {
            let again = if number == 1 { String::new() } else { format!("-{number}") };
            let name = format!("{stem}{cause}{again}");
            let path = self.path.join(format!("{name}{FLIGHT_SUFFIX}"));
            let partial = self.path.join(format!("{name}{PARTIAL_SUFFIX}"));
            if !path.exists() && !partial.exists() {
                return Ok((path, partial));
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }
}

fn write_file(path: &Path, header: &Header, records: &mut dyn Iterator<Item = &[u8]>) -> io::Result<()> {
    let mut output = BufWriter::new(File::create_new(path)?);
    write_flight(&mut output, header, records)?;
    output.flush()?;
    output.get_ref().sync_all()
}

/// What the files thread is sent.
#[derive(Debug)]
pub enum Job {
    /// An event for the journal.
    Event(Entry),
    /// Timing of a minute.
    Minute(Box<Minute>),
    /// A flight.
    Flight(Box<Header>, Ring),
}

/// The thread's state.
pub struct Files<S> {
    store: S,
    jobs: Receiver<Job>,
    /// Rings that were written go back to be filled anew.
    rings: Sender<Ring>,
    state: Arc<RecorderState>,
    events: VecDeque<Entry>,
    minutes: VecDeque<Minute>,
    flights: VecDeque<(Box<Header>, Ring)>,
    /// Size of a flight.
    flight_bytes: u64,
    next_check: Instant,
    retry: Duration,
    /// Events lost that the journal was told of.
    told_lost: u64,
}

impl<S: Store> Files<S> {
    /// Nothing to write yet.
    pub fn new(
        store: S,
        jobs: Receiver<Job>,
        rings: Sender<Ring>,
        state: Arc<RecorderState>,
        flight_bytes: u64,
    ) -> Self {
        Self {
            store,
            jobs,
            rings,
            state,
            events: VecDeque::new(),
            minutes: VecDeque::new(),
            flights: VecDeque::new(),
            flight_bytes,
            next_check: Instant::now(),
            retry: RETRY,
            told_lost: 0,
        }
    }

    /// As [`Self::new`], but tries again after `retry`.
    #[cfg(test)]
    pub fn retrying_after(self, retry: Duration) -> Self {
        Self { retry, ..self }
    }

    /// Writes until the other end is gone and everything was tried once more.
    pub fn serve(mut self) {
        loop {
            let job = self.jobs.recv_timeout(self.retry);
            let ended = matches!(job, Err(RecvTimeoutError::Disconnected));
            job.into_iter().for_each(|job| self.take(job));
            while let Ok(job) = self.jobs.try_recv() {
                self.take(job);
            }
            self.work();
            if ended {
                self.give_up();
                return;
            }
        }
    }

    fn take(&mut self, job: Job) {
        match job {
            Job::Event(entry) => self.events.push_back(entry),
            Job::Minute(minute) => {
                if self.minutes.len() >= MINUTES_MAX {
                    self.minutes.pop_front();
                }
                self.minutes.push_back(*minute);
            }
            Job::Flight(header, ring) => self.flights.push_back((header, ring)),
        }
    }

    /// Writes all that can be written.
    fn work(&mut self) {
        let had_work = !self.events.is_empty() || !self.flights.is_empty() || !self.minutes.is_empty();
        let mut result = self.write_events();
        if let Err(error) = self.write_flights() {
            result = Err(error);
        }
        // Flights are events too.
        if result.is_ok() {
            result = self.write_events().and_then(|()| self.write_minutes());
        }
        let is_time = Instant::now() >= self.next_check;
        if result.is_ok() && is_time {
            self.next_check = Instant::now() + CHECK;
            result = self.store.check(self.flight_bytes);
        }
        if had_work || is_time || result.is_err() {
            self.note(&result);
        }
    }

    fn note(&mut self, result: &io::Result<()>) {
        let code = match result {
            Ok(()) => 0,
            Err(error) => {
                error.raw_os_error().and_then(|code| u32::try_from(code).ok()).unwrap_or(OTHER_ERROR)
            }
        };
        // A write that went well says nothing about room for a flight: only the next look clears that.
        let before = self.state.error.load(Ordering::Relaxed);
        if code == 0 && before != 0 && self.store.check(self.flight_bytes).is_err() {
            return;
        }
        self.state.error.store(code, Ordering::Relaxed);
        match result {
            Err(error) if code != before => {
                log(format_args!("recorder: cannot write: {error}; kept in memory and tried again"));
            }
            Ok(()) if before != 0 => log(format_args!("recorder: can write again")),
            _ => {}
        }
    }

    fn write_events(&mut self) -> io::Result<()> {
        let lost = self.state.events_lost.load(Ordering::Relaxed);
        while let Some(entry) = self.events.front() {
            if entry.event == event::STOP && !self.flights.is_empty() {
                // A journal ends with the end of its run.
                break;
            }
            self.store.append(Lines::Events, &line(entry)?)?;
            self.events.pop_front();
            self.state.events_waiting.fetch_sub(1, Ordering::Relaxed);
        }
        if lost > self.told_lost {
            let detail = Some(format!("{} events found no room to wait", lost - self.told_lost));
            let newest = Entry { event: event::LOST.to_owned(), detail, ..stamped_now() };
            self.store.append(Lines::Events, &line(&newest)?)?;
            self.told_lost = lost;
        }
        Ok(())
    }

    fn write_minutes(&mut self) -> io::Result<()> {
        while let Some(minute) = self.minutes.front() {
            self.store.append(Lines::Minutes, &line(minute)?)?;
            self.minutes.pop_front();
        }
        Ok(())
    }

    fn write_flights(&mut self) -> io::Result<()> {
        while let Some((header, ring)) = self.flights.front() {
            let path = self.store.save(header, &mut ring.records())?;
            log(format_args!(
                "{}; the last {} cycles are in {}",
                header.words(),
                header.records,
                path.display()
            ));
            let entry = Entry { event: event::FLIGHT.to_owned(), ..about(header, Some(&path)) };
            self.state.note(path);
            self.state.events_waiting.fetch_add(1, Ordering::Relaxed);
            let is_stop = |waiting: &Entry| waiting.event == event::STOP;
            let at = self.events.iter().position(is_stop).unwrap_or(self.events.len());
            self.events.insert(at, entry);
            if let Some((_, mut ring)) = self.flights.pop_front() {
                ring.clear();
                // Nobody takes it any more when the daemon is ending.
                let _ = self.rings.send(ring);
            }
        }
        Ok(())
    }

    /// The daemon ends: says what is lost with it.
    fn give_up(&mut self) {
        for (header, _) in std::mem::take(&mut self.flights) {
            self.state.flights_lost.fetch_add(1, Ordering::Relaxed);
            log(format_args!(
                "recorder: lost the flight of cycle {}: {}",
                header.trigger_cycle,
                header.words()
            ));
            // The journal may have room for a line where a flight has none.
            let entry = Entry { event: event::FLIGHT_LOST.to_owned(), ..about(&header, None) };
            let _ = line(&entry).and_then(|line| self.store.append(Lines::Events, &line));
        }
        let _ = self.write_events();
        let events = self.events.len();
        if events > 0 {
            self.state.events_lost.fetch_add(events as u64, Ordering::Relaxed);
            log(format_args!("recorder: lost {events} events"));
        }
        if !self.minutes.is_empty() {
            log(format_args!("recorder: lost the timing of {} minutes", self.minutes.len()));
        }
    }
}

fn line(entry: &impl Serialize) -> io::Result<String> {
    Ok(serde_json::to_string(entry)?)
}

fn stamped_now() -> Entry {
    let now = magsteer_hal::Stamp::now();
    Entry {
        time: super::wall::rfc_3339(SystemTime::now()),
        monotonic_ns: now.nanoseconds(),
        pid: std::process::id(),
        ..Entry::default()
    }
}

/// An event about a flight.
fn about(header: &Header, path: Option<&Path>) -> Entry {
    Entry {
        rig: header.rig.clone(),
        cycle: Some(header.trigger_cycle),
        cause_code: (header.cause != 0).then_some(header.cause),
        cause: (header.cause != 0).then(|| magsteer_hal::operator::cause::text(header.cause).to_owned()),
        file: path.map(|path| path.display().to_string()),
        detail: Some(header.words()),
        ..stamped_now()
    }
}
