//! Disks that are full, folders that vanish: counted, told, tried again; the thread that feeds never waits.

use std::fs;
use std::io::{self, Write};
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use magsteer_hal::operator::{StatusMessage, recorder};

use super::super::columns::Columns;
use super::super::config::RecorderConfig;
use super::super::files::{EVENTS_MAX, Files, Folder, Job, RecorderState, Store};
use super::super::flight::write_flight;
use super::super::header::Header;
use super::super::lines::Lines;
use super::super::ring::Ring;
use super::super::{Entry, JOURNAL, Minute, Recorder, RecorderPlan, event, read_journal};
use super::{Bench, RATE_HZ, flights, plan, rig, store};
use crate::daemon::state::Verb;
use crate::daemon::statistics::MinuteTiming;
use crate::daemon::timing_summary::{TimingHistograms, TimingSummary};

/// Bound on every wait, only so that a failure ends.
const PATIENCE: usize = 4_000;

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    for _ in 0..PATIENCE {
        if holds() {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    panic!("not within the bound: {what}");
}

fn no_space() -> io::Error {
    rustix::io::Errno::NOSPC.into()
}

/// A store that is full when told to be, and remembers what it took.
#[derive(Clone, Default)]
struct Fickle {
    full: Arc<AtomicBool>,
    lines: Arc<Mutex<Vec<String>>>,
    minutes: Arc<Mutex<Vec<String>>>,
    flights: Arc<Mutex<Vec<(u64, usize)>>>,
}

impl Fickle {
    fn ask(&self) -> io::Result<()> {
        if self.full.load(Ordering::Acquire) { Err(no_space()) } else { Ok(()) }
    }

    fn fill(&self, full: bool) {
        self.full.store(full, Ordering::Release);
    }

    /// Cycles of each minute written.
    fn minutes(&self) -> Vec<u64> {
        let lines = self.minutes.lock().expect("no panic");
        let minute = |line: &String| serde_json::from_str::<Minute>(line).expect("as written");
        lines.iter().map(|line| minute(line).timing.cycles).collect()
    }

    fn events(&self, wanted: &str) -> usize {
        let lines = self.lines.lock().expect("no panic");
        lines.iter().filter(|line| line.contains(&format!("\"event\":\"{wanted}\""))).count()
    }
}

impl Store for Fickle {
    fn append(&mut self, lines: Lines, line: &str) -> io::Result<()> {
        self.ask()?;
        let kept = if lines == Lines::Events { &self.lines } else { &self.minutes };
        kept.lock().expect("no panic").push(line.to_owned());
        Ok(())
    }

    fn save(&mut self, header: &Header, records: &mut dyn Iterator<Item = &[u8]>) -> io::Result<PathBuf> {
        self.ask()?;
        self.flights.lock().expect("no panic").push((header.trigger_cycle, records.count()));
        Ok(PathBuf::from(format!("{}.flight", header.trigger_cycle)))
    }

    fn check(&mut self, _bytes: u64) -> io::Result<()> {
        self.ask()
    }
}

fn status(recorder: &Recorder) -> StatusMessage {
    let mut status = StatusMessage::default();
    recorder.tell(&mut status);
    status
}

/// Goal: with a full disk events and two faults wait in memory, a third is lost and counted, the status
/// warns; with room again everything that waited is written, in order.
#[test]
fn a_full_disk_costs_nothing_but_what_memory_cannot_hold() {
    let disk = Fickle::default();
    let folder = PathBuf::from("unused");
    let mut bench = Bench::recording(Recorder::with_store(disk.clone(), &plan(&folder), &rig(), RATE_HZ));
    disk.fill(true);
    for _ in 0..3 {
        bench.steer(200);
        bench.ask(Verb::EmergencyStop);
        bench.run(600);
        bench.ask(Verb::Reset);
        bench.run(5);
    }
    until("the failure is told", || status(&bench.recorder).recorder == recorder::FAILING);
    let full = status(&bench.recorder);
    assert_eq!(full.recorder_error, libc::ENOSPC.unsigned_abs());
    assert_eq!((full.flights, full.recorder_lost), (0, 1), "two of three wait in memory");
    assert_eq!(disk.lines.lock().expect("no panic").len(), 0);
    disk.fill(false);
    until("both flights are written", || status(&bench.recorder).flights == 2);
    until("the warning is gone", || status(&bench.recorder).recorder == recorder::RECORDING);
    // The rings are free again, so that the next fault has its flight.
    bench.steer(200);
    bench.ask(Verb::EmergencyStop);
    bench.run(600);
    let transitions = bench.records.iter().filter(|record| record.decision.transition.is_some()).count();
    bench.recorder.end();
    assert_eq!(disk.events(event::TRANSITION), transitions, "no event was lost");
    assert_eq!((disk.events(event::FLIGHT), disk.events(event::FLIGHT_LOST)), (3, 1));
    let written = disk.flights.lock().expect("no panic").clone();
    assert_eq!(written.len(), 3);
    assert!(written.windows(2).all(|pair| pair[0].0 < pair[1].0), "in order: {written:?}");
    assert!(written.iter().all(|(_, records)| *records > 100), "{written:?}");
}

/// Goal: events that find no room to wait are counted, and the journal is told how many it lacks.
#[test]
fn events_beyond_what_may_wait_are_counted_and_told() {
    let disk = Fickle::default();
    disk.fill(true);
    let recorder = Recorder::with_store(disk.clone(), &plan(&PathBuf::new()), &rig(), RATE_HZ);
    let recorder = recorder.expect("a thread");
    let excess = 50;
    for _ in 0..EVENTS_MAX + excess {
        recorder.refused(1, magsteer_hal::operator::Cause::WrongState);
    }
    assert_eq!(status(&recorder).recorder_lost as usize, excess);
    disk.fill(false);
    until("it is told", || disk.events(event::LOST) == 1);
    assert_eq!(disk.events(event::REFUSED), EVENTS_MAX);
    let lines = disk.lines.lock().expect("no panic").clone();
    assert!(lines.iter().any(|line| line.contains("50 events found no room to wait")), "{lines:?}");
    recorder.end();
}

/// Goal: minutes wait for room as events do, in their order and in a file of their own.
#[test]
fn minutes_of_a_full_disk_are_written_once_there_is_room() {
    let disk = Fickle::default();
    disk.fill(true);
    let recorder = Recorder::with_store(disk.clone(), &plan(&PathBuf::new()), &rig(), RATE_HZ);
    let recorder = recorder.expect("a thread");
    for cycles in [3, 4] {
        let timing = TimingSummary { cycles, ..TimingSummary::default() };
        recorder.minute(MinuteTiming { timing, histograms: TimingHistograms::default() });
    }
    until("the failure is told", || status(&recorder).recorder == recorder::FAILING);
    assert_eq!(disk.minutes(), Vec::<u64>::new());
    disk.fill(false);
    recorder.end();
    assert_eq!(disk.minutes(), [3, 4]);
}

/// Goal: at the end of a daemon that never could write, what is lost is counted, and the end comes.
#[test]
fn the_end_of_a_daemon_does_not_wait_for_a_disk_that_stays_full() {
    let disk = Fickle::default();
    disk.fill(true);
    let recorder = Recorder::with_store(disk.clone(), &plan(&PathBuf::new()), &rig(), RATE_HZ);
    let mut bench = Bench::recording(recorder);
    bench.steer(50);
    bench.ask(Verb::EmergencyStop);
    let state = bench.recorder.state();
    bench.recorder.end();
    assert_eq!(state.flights_lost.load(Ordering::Relaxed), 1);
    assert!(state.events_lost.load(Ordering::Relaxed) >= 4, "boot to fault, and the stop");
    assert_eq!(state.paths(), Vec::<PathBuf>::new());
}

/// Takes so many bytes, then is full.
struct Limited(usize);

impl Write for Limited {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.0 == 0 {
            return Err(no_space());
        }
        let taken = bytes.len().min(self.0);
        self.0 -= taken;
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Goal: wherever a disk gets full within a flight, the writer says so; on the device made for it too.
#[test]
fn a_flight_that_does_not_fit_is_an_error_wherever_the_room_ends() {
    let record = [7_u8; 1_000];
    let records = || std::iter::repeat_n(record.as_slice(), 200);
    let header = a_header();
    let mut whole = Vec::new();
    write_flight(&mut whole, &header, records()).expect("memory");
    for room in (0..whole.len()).step_by(4_999).chain([whole.len() - 1]) {
        let error = write_flight(&mut Limited(room), &header, records()).expect_err("too little room");
        assert_eq!(error.raw_os_error(), Some(libc::ENOSPC), "{room}");
    }
    write_flight(&mut Limited(whole.len()), &header, records()).expect("just enough room");
    let mut device = fs::File::options().write(true).open("/dev/full").expect("on every Linux");
    let error = write_flight(&mut device, &header, records()).expect_err("full");
    assert_eq!(error.raw_os_error(), Some(libc::ENOSPC));
}

/// The head of some flight.
fn a_header() -> Header {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(50);
    bench.ask(Verb::EmergencyStop);
    bench.recorder.end();
    super::labels(folder.path()).remove(0).header
}

/// Goal: the journal on the device that is always full: nothing is written, all is kept, and it is written
/// once the journal may be an ordinary file.
#[test]
fn a_journal_on_a_full_device_is_kept_in_memory_and_written_later() {
    let folder = tempfile::tempdir().expect("a folder");
    symlink("/dev/full", folder.path().join(JOURNAL)).expect("own folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(100);
    until("the failure is told", || status(&bench.recorder).recorder == recorder::FAILING);
    assert_eq!(status(&bench.recorder).recorder_error, libc::ENOSPC.unsigned_abs());
    fs::remove_file(folder.path().join(JOURNAL)).expect("own folder");
    until("it can write", || status(&bench.recorder).recorder == recorder::RECORDING);
    bench.ask(Verb::Stop);
    bench.run(500);
    let transitions = bench.records.iter().filter(|record| record.decision.transition.is_some()).count();
    bench.recorder.end();
    let page = read_journal(folder.path()).expect("readable");
    let told = page.entries.iter().filter(|entry| entry.event == event::TRANSITION).count();
    assert_eq!((told, page.damaged), (transitions, 0));
}

/// Goal: a folder that cannot be made, since its path leads through a file, is told, and used as soon as it
/// can be.
#[test]
fn a_path_through_a_file_is_told_and_used_once_it_is_free() {
    let folder = tempfile::tempdir().expect("a folder");
    let in_the_way = folder.path().join("file");
    fs::write(&in_the_way, "").expect("own folder");
    let mut bench = Bench::new(&in_the_way.join("records"));
    bench.steer(100);
    until("the failure is told", || status(&bench.recorder).recorder == recorder::FAILING);
    assert_eq!(status(&bench.recorder).recorder_error, libc::ENOTDIR.unsigned_abs());
    fs::remove_file(&in_the_way).expect("own folder");
    until("it can write", || status(&bench.recorder).recorder == recorder::RECORDING);
    bench.ask(Verb::EmergencyStop);
    bench.recorder.end();
    assert_eq!(flights(&in_the_way.join("records")).len(), 1);
    assert!(read_journal(&in_the_way.join("records")).expect("readable").entries.len() >= 5);
}

#[test]
fn a_folder_that_vanishes_is_made_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let records = folder.path().join("records");
    let mut bench = Bench::new(&records);
    bench.steer(100);
    until("the journal is there", || records.join(JOURNAL).is_file());
    fs::remove_dir_all(&records).or_else(|_| fs::remove_dir_all(&records)).expect("own folder");
    bench.ask(Verb::EmergencyStop);
    bench.recorder.end();
    assert_eq!(flights(&records).len(), 1);
    let page = read_journal(&records).expect("readable");
    assert!(page.entries.iter().any(|entry| entry.to.as_deref() == Some("fault")), "{page:?}");
}

/// Goal: too little room for a flight is known before a flight needs it.
#[test]
fn room_for_a_flight_is_looked_at_before_it_is_needed() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut disk = store(folder.path());
    disk.check(0).expect("some room");
    assert_eq!(disk.check(u64::MAX / 2).expect_err("too much").raw_os_error(), Some(libc::ENOSPC));
    // The thread looks by itself, with nothing to write.
    let (jobs, todo) = channel::<Job>();
    let (back, _rings) = channel();
    let state = Arc::new(RecorderState::default());
    let files = Files::new(disk, todo, back, Arc::clone(&state), u64::MAX / 2);
    let files = files.retrying_after(Duration::from_millis(1));
    let thread = std::thread::spawn(|| files.serve());
    until("it is told", || state.error.load(Ordering::Relaxed) == libc::ENOSPC.unsigned_abs());
    // That a small event can be written does not hide it.
    state.events_waiting.fetch_add(1, Ordering::Relaxed);
    let entry = Entry { event: event::START.to_owned(), ..Entry::default() };
    jobs.send(Job::Event(entry)).expect("the thread lives");
    until("it is written", || state.events_waiting.load(Ordering::Relaxed) == 0);
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(state.error.load(Ordering::Relaxed), libc::ENOSPC.unsigned_abs());
    drop(jobs);
    thread.join().expect("it ends");
}

/// Goal: a flight whose writing fails leaves no file behind that would be taken for one.
#[test]
fn a_flight_that_failed_leaves_nothing_behind() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut disk = Folder { path: folder.path().to_owned(), flights_max: 3 };
    let mut header = a_header();
    // Longer than any header may be.
    header.config_sha256 = "x".repeat(2 << 20);
    let mut records = std::iter::empty();
    disk.save(&header, &mut records).expect_err("the header is too long");
    assert_eq!(fs::read_dir(folder.path()).expect("there").count(), 0);
}

/// Goal: memory as stated: bounded whatever is configured, and enough for the configured time where the bound
/// allows.
#[test]
fn memory_is_bounded_whatever_is_configured() {
    let ring = |seconds: f64, rate_hz: f64| {
        let config = RecorderConfig { folder: PathBuf::new(), seconds, flights_max: 1 };
        let plan = RecorderPlan { config, config_sha256: String::new() };
        super::super::keeper::capacity(&plan.config, rate_hz, Columns::new(&rig()).record_bytes())
    };
    assert_eq!(ring(10.0, 1_000.0), 10_500);
    assert_eq!(ring(10.0, 10_000.0), 105_000);
    let record_bytes = Columns::new(&rig()).record_bytes();
    assert!(2 * ring(60.0, 10_000.0) * record_bytes <= 512 << 20);
    assert!(Ring::new(record_bytes, 10).expect("little").size() == 10 * record_bytes);
}
