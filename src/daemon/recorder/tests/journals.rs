//! Lines that are appended by many, torn by one that dies, moved away, followed.

use std::fs::{self, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::Path;

use magsteer_hal::operator::{Cause, state, verb};

use super::super::lines::{FILE_BYTES_MAX, Lines};
use super::super::{Entry, JOURNAL, JournalTail, event, journal_files, read_journal};
use super::Bench;
use crate::daemon::state::Verb;

fn line(number: u64) -> String {
    let entry = Entry { event: event::REFUSED.to_owned(), cycle: Some(number), ..Entry::default() };
    serde_json::to_string(&entry).expect("plain")
}

fn numbers(folder: &Path) -> Vec<u64> {
    let page = read_journal(folder).expect("readable");
    page.entries.iter().map(|entry| entry.cycle.expect("numbered")).collect()
}

/// Goal: the state's way, in order, with causes, cycles and times, and what was refused.
#[test]
fn the_journal_tells_the_way_of_the_state_with_causes_and_cycles() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(100);
    bench.recorder.refused(verb::RESET, Cause::WrongState);
    bench.trip();
    bench.ask(Verb::Reset);
    bench.run(3);
    bench.recorder.end();
    let page = read_journal(folder.path()).expect("readable");
    assert_eq!(page.damaged, 0);
    let told: Vec<&Entry> = page.entries.iter().filter(|it| it.event == event::TRANSITION).collect();
    let done: Vec<_> =
        bench.records.iter().filter_map(|record| Some((record, record.decision.transition?))).collect();
    assert_eq!(told.len(), done.len());
    assert!(done.len() >= 6, "boot, idle, armed, active, safe-stop, fault, idle: {done:?}");
    for (entry, (record, transition)) in told.into_iter().zip(done) {
        let word = |code| Some(state::name(code).to_owned());
        assert_eq!((&entry.from, &entry.to), (&word(transition.from), &word(transition.to)));
        assert_eq!(entry.cause_code, transition.cause.map(Cause::code));
        assert_eq!(
            (entry.cycle, entry.monotonic_ns),
            (Some(record.tick.number), record.tick.now.nanoseconds())
        );
        assert!(entry.time.ends_with('Z') && entry.time.contains('T'), "{}", entry.time);
    }
    let refused = page.entries.iter().find(|it| it.event == event::REFUSED).expect("told");
    assert_eq!((refused.request.as_deref(), refused.cause_code), (Some("reset"), Some(1)));
    let flight = page.entries.iter().find(|it| it.event == event::FLIGHT).expect("told");
    assert!(Path::new(flight.file.as_ref().expect("a path")).is_file());
    let last = page.entries.last().expect("entries");
    assert_eq!((last.event.as_str(), last.to.as_deref()), (event::STOP, Some("idle")));
}

/// Goal: whatever is written, five files of bounded size stay, and the newest lines in them, in order.
#[test]
fn a_journal_rotates_within_its_bound_and_keeps_the_newest() {
    const FILE: u64 = 2_000;
    let folder = tempfile::tempdir().expect("a folder");
    for number in 0..1_000 {
        Lines::Events.append(folder.path(), &line(number), FILE).expect("own folder");
        for path in journal_files(folder.path()) {
            assert!(fs::metadata(&path).expect("there").len() <= FILE, "{}", path.display());
        }
    }
    assert_eq!(journal_files(folder.path()).len(), 5);
    let kept = numbers(folder.path());
    assert_eq!(kept, (1_000 - kept.len() as u64..1_000).collect::<Vec<_>>());
    assert!(kept.len() > 60, "four files are full: {}", kept.len());
    const { assert!(5 * FILE_BYTES_MAX <= 20 << 20, "as the module says") };
}

/// Goal: a writer that was killed within a line costs that line alone.
#[test]
fn a_torn_line_costs_no_other() {
    let folder = tempfile::tempdir().expect("a folder");
    Lines::Events.append(folder.path(), &line(1), 1 << 20).expect("own folder");
    let path = folder.path().join(JOURNAL);
    let mut file = OpenOptions::new().append(true).open(&path).expect("there");
    file.write_all(&line(2).as_bytes()[..20]).expect("own folder");
    drop(file);
    let page = read_journal(folder.path()).expect("readable");
    assert_eq!((page.entries.len(), page.damaged), (1, 1), "an end that is missing is told");
    Lines::Events.append(folder.path(), &line(3), 1 << 20).expect("own folder");
    assert_eq!(numbers(folder.path()), [1, 3]);
    assert_eq!(read_journal(folder.path()).expect("readable").damaged, 1);
}

#[test]
fn lines_of_any_bytes_are_read_past() {
    let folder = tempfile::tempdir().expect("a folder");
    let long = vec![b'x'; 200_000];
    let bytes = [b"\xff\xfe\0\n{}\n\n[1]\n".as_slice(), &long, b"\n", line(5).as_bytes(), b"\n"].concat();
    fs::write(folder.path().join(JOURNAL), bytes).expect("own folder");
    assert_eq!(numbers(folder.path()), [5]);
    assert!(read_journal(folder.path()).expect("readable").damaged >= 3);
}

/// Goal: several daemons in one folder tear no line and lose none, across rotations.
#[test]
fn writers_that_share_a_folder_tear_and_lose_nothing() {
    const WRITERS: u64 = 4;
    const LINES: u64 = 100;
    let folder = tempfile::tempdir().expect("a folder");
    // Room for all lines in five files, so that none is dropped by rotation.
    let file_bytes = (WRITERS * LINES * (line(999_999).len() as u64 + 1)) / 3;
    std::thread::scope(|scope| {
        for writer in 0..WRITERS {
            let path = folder.path();
            scope.spawn(move || {
                for number in 0..LINES {
                    let line = line(1_000 * writer + number);
                    while let Err(error) = Lines::Events.append(path, &line, file_bytes) {
                        assert_eq!(error.kind(), ErrorKind::WouldBlock, "{error}");
                        std::thread::yield_now();
                    }
                }
            });
        }
    });
    assert!(journal_files(folder.path()).len() > 1, "it rotated");
    let mut found = numbers(folder.path());
    for writer in 0..WRITERS {
        let own: Vec<u64> = found.iter().copied().filter(|number| number / 1_000 == writer).collect();
        assert_eq!(own, (1_000 * writer..1_000 * writer + LINES).collect::<Vec<_>>(), "in their order");
    }
    found.dedup();
    assert_eq!(found.len() as u64, WRITERS * LINES);
}

/// Goal: a reader that looks now and then sees every line once, also when the file is moved away between two
/// looks.
#[test]
fn a_follower_sees_every_line_once_across_rotations() {
    const FILE: u64 = 1_500;
    let folder = tempfile::tempdir().expect("a folder");
    Lines::Events.append(folder.path(), &line(0), FILE).expect("own folder");
    let mut tail = JournalTail::at_end(folder.path()).expect("readable");
    let mut seen = Vec::new();
    for number in 1..200 {
        Lines::Events.append(folder.path(), &line(number), FILE).expect("own folder");
        if number % 7 == 0 {
            seen.extend(tail.look().expect("readable").entries.iter().filter_map(|entry| entry.cycle));
        }
    }
    seen.extend(tail.look().expect("readable").entries.iter().filter_map(|entry| entry.cycle));
    assert_eq!(seen, (1..200).collect::<Vec<_>>());
    assert!(journal_files(folder.path()).len() > 3, "it rotated");
    let mut early = JournalTail::at_end(&folder.path().join("later")).expect("not there yet");
    assert_eq!(early.look().expect("still not").entries, vec![]);
    fs::create_dir(folder.path().join("later")).expect("own folder");
    Lines::Events.append(&folder.path().join("later"), &line(7), FILE).expect("own folder");
    assert_eq!(early.look().expect("readable").entries.len(), 1);
}
