//! Files that this program writes, as a disk may give them back.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use magsteer::daemon::recorder::{Crc32, Ending, Flight, FlightLabel, JOURNAL, read_journal};
use magsteer::recording::{Recording, recover};

/// A file of these bytes in a folder of its own, which is removed afterwards.
fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(PathBuf)) {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("magsteer-fuzz-{}-{number}", std::process::id()));
    fs::create_dir_all(&folder).expect("a directory for temporary files");
    fs::write(folder.join(name), bytes).expect("room for a small file");
    read(folder.join(name));
    let _ = fs::remove_dir_all(&folder);
}

/// A flight as it stands; and, so that what a checksum keeps out is looked at too, with the bytes up to their
/// first zero as its header, the next one as the number of records in its one block, and the rest as these.
pub fn flight(bytes: &[u8]) {
    with_file("a.flight", bytes, |path| look_at_flight(&path));
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let mut file = b"MSFLIGHT\x01\0\0\0".to_vec();
    file.extend(u32::try_from(end).unwrap_or(u32::MAX).to_le_bytes());
    file.extend(&bytes[..end]);
    file.extend(Crc32::new().with(&file).value().to_le_bytes());
    let at = file.len();
    let records = bytes.get(end + 2..).unwrap_or_default();
    file.extend(b"BLCK\0\0\0\0");
    file.extend([bytes.get(end + 1).copied().unwrap_or(1), 0, 0, 0]);
    file.extend(records);
    let checksum = Crc32::new().with(&file[at..]).value();
    file.extend(checksum.to_le_bytes());
    with_file("a.flight", &file, |path| look_at_flight(&path));
}

fn look_at_flight(path: &Path) {
    match FlightLabel::read(path) {
        Err(error) => assert!(!error.to_string().is_empty()),
        Ok(label) => assert!(!label.header.words().is_empty()),
    }
    let Ok(flight) = Flight::read(path) else { return };
    assert_eq!(flight.ending == Ending::Complete, flight.ending.words().is_none());
    for record in 0..flight.records().min(64) {
        assert_eq!(flight.record(record).len(), flight.header.columns.len());
        for column in &flight.header.columns {
            let _ = (flight.count(record, &column.name), flight.number(record, &column.name));
        }
    }
}

/// A recording as it stands, and what recovery makes of it: that is whole, and holds as many messages.
pub fn recording(bytes: &[u8]) {
    with_file("recording.mcap", bytes, |path| {
        look_at_recording(&path);
        let mended = path.with_file_name("mended.mcap");
        match recover(&path, &mended) {
            Err(error) => assert!(!error.to_string().is_empty()),
            Ok(recovered) => {
                assert!(recovered.bytes_read + recovered.bytes_lost <= bytes.len() as u64);
                let again = recover(&mended, &path.with_file_name("again.mcap")).expect("its own");
                assert!(again.was_whole);
                assert_eq!((again.messages, again.damaged), (recovered.messages, 0));
            }
        }
    });
}

fn look_at_recording(path: &Path) {
    let recording = match Recording::open(path) {
        Ok(recording) => recording,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let cycles = recording.cycles().expect("it was opened before");
    let whole = cycles.take_while(Result::is_ok).count() as u64;
    if let Ok(counts) = recording.counts() {
        assert_eq!(counts.cycles, whole);
        assert!(counts.cycles <= counts.messages);
    }
    let _ = (recording.events(), recording.metadata());
}

/// A journal of events.
pub fn journal(bytes: &[u8]) {
    with_file(JOURNAL, bytes, |path| {
        let folder = path.parent().expect("in a folder");
        let page = read_journal(folder).expect("it can be read");
        assert!(page.entries.iter().all(|entry| !entry.event.is_empty()));
        assert!(page.entries.len() as u64 + page.damaged <= bytes.len() as u64 + 1);
    });
}
