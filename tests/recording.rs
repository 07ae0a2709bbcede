//! Recordings: everything that is written comes back, from a whole file and from one that was cut.
#![cfg(all(feature = "sim", feature = "record"))]

mod recording_support;
mod rig_support;

use std::fs;
use std::path::Path;

use magsteer::recording::{
    Choice, Cycle, Ending, Exported, Number, Recording, RecordingError, RecordingWriter, export_csv,
    export_npz, level, recover,
};
use rand::{RngExt, SeedableRng};
use recording_support::{Subject, complete, planar};

/// Steers for a second and a half, flushes twice a second of simulated time; tells the length of the file and
/// the number of cycles at each flush.
fn recorded(subject: &Subject, file: &Path) -> (Vec<Cycle>, Vec<(u64, usize)>) {
    let mut writer = subject.writer(file);
    let (mut cycles, mut flushes) = (Vec::new(), Vec::new());
    subject.steer(None, &[[90.0, 70.0], [70.0, 90.0]], 0.4, |record| {
        writer.write(&magsteer::daemon::cycle_message(record)).expect("room");
        cycles.push(subject.cycle(record));
        if cycles.len() % 200 == 0 {
            writer.flush().expect("room");
            flushes.push((writer.length(), cycles.len()));
        }
    });
    writer.finish(&complete()).expect("room");
    (cycles, flushes)
}

fn read(path: &Path) -> Vec<Cycle> {
    let recording = Recording::open(path).expect("a recording");
    recording.cycles().expect("a recording").map(|cycle| cycle.expect("whole")).collect()
}

/// Equal to the last bit: what is not a number is equal to itself.
fn assert_same(found: &[Cycle], expected: &[Cycle]) {
    assert_eq!(found.len(), expected.len());
    let bits = |cycle: &Cycle| -> Vec<u64> {
        let bits = |number: &Number| match number {
            Number::Count(count) => *count,
            Number::Real(real) => real.to_bits(),
        };
        cycle.numbers().iter().flatten().map(bits).collect()
    };
    for (found, expected) in found.iter().zip(expected) {
        assert_eq!(bits(found), bits(expected), "cycle {}", expected.number);
    }
}

/// Goal: every cycle comes back bit for bit, with the configuration, the description and the events.
#[test]
fn a_recording_gives_back_every_cycle_and_what_it_was() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("recording.mcap");
    let (cycles, _) = recorded(&subject, &file);
    assert_same(&read(folder.path()), &cycles);
    let recording = Recording::open(folder.path()).expect("a run's folder");
    assert_eq!(recording.config_text(), subject.document.resolved().text);
    assert_eq!(recording.info().config_sha256, subject.document.resolved().sha256);
    assert_eq!(recording.description(), "a test");
    assert!(!recording.info().machine.kernel.is_empty() && recording.info().rate_hz == 1_000.0);
    let counts = recording.counts().expect("whole");
    assert_eq!((counts.cycles, counts.holes, counts.damaged), (cycles.len() as u64, 0, 0));
    assert_eq!((counts.ending, counts.is_complete), (Ending::Whole, Some(true)));
    assert!(counts.messages > counts.cycles, "views and events stand beside the cycles");
    let events = recording.events().expect("whole");
    let texts: Vec<&str> = events.iter().map(|event| event.text.as_str()).collect();
    for expected in ["boot -> idle", "idle -> armed", "armed -> active", "request set-target (number 3)"] {
        assert!(texts.contains(&expected), "{expected} in {texts:?}");
    }
    let stopped = "active -> safe-stop: the process was asked to end (cause 101)";
    let stop = events.iter().find(|event| event.text == stopped);
    assert_eq!(stop.map(|event| event.level), Some(level::WARN), "{texts:?}");
    let metadata = recording.metadata().expect("whole");
    assert_eq!(metadata["magsteer-end"]["cycles"], cycles.len().to_string());
}

/// Goal: the file is cut at 200 random places, within the index at its end too. What was flushed before the cut
/// comes back, and nothing that was not written; the file that was cut is left as it is, the new one is whole.
#[test]
fn a_recording_cut_anywhere_is_recovered_up_to_the_last_flush() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("recording.mcap");
    let (cycles, flushes) = recorded(&subject, &file);
    let bytes = fs::read(&file).expect("the recording");
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(20_261_122);
    let (cut, mended) = (folder.path().join("cut.mcap"), folder.path().join("mended.mcap"));
    let mut recovered_some = 0;
    for cutting in 0..200 {
        let length = random.random_range(0..bytes.len());
        fs::write(&cut, &bytes[..length]).expect("room");
        let _ = fs::remove_file(&mended);
        let flushed = flushes.iter().rfind(|(at, _)| *at <= length as u64).map_or(0, |(_, cycles)| *cycles);
        match recover(&cut, &mended) {
            Ok(recovered) => {
                assert_eq!(recovered.bytes_read + recovered.bytes_lost, length as u64);
                assert!(!recovered.was_whole && recovered.damaged == 0);
                let Ok(recording) = Recording::open(&mended) else {
                    assert_eq!(
                        flushed, 0,
                        "cut at {length}: nothing was flushed, so its head may be missing"
                    );
                    continue;
                };
                let found = read(&mended);
                assert!(found.len() >= flushed, "cut at {length}: {} of {flushed}", found.len());
                assert_same(&found, &cycles[..found.len()]);
                if cutting % 20 == 0 {
                    assert_eq!(recording.counts().expect("whole").ending, Ending::Whole);
                }
                recovered_some += u32::from(!found.is_empty());
            }
            Err(RecordingError::NotARecording { .. }) => assert_eq!(flushed, 0, "cut at {length}"),
            Err(other) => panic!("cut at {length}: {other}"),
        }
        assert_eq!(fs::read(&cut).expect("still there"), &bytes[..length], "the source is not touched");
    }
    assert!(recovered_some > 150, "most cuts lie behind the first flush: {recovered_some}");
    let again = recover(&file, &folder.path().join("again.mcap")).expect("whole");
    assert!(again.was_whole && again.bytes_lost == 0);
    assert_same(&read(&folder.path().join("again.mcap")), &cycles);
}

/// Goal: cycles, periods that the loop missed and cycles that the recording lost are all periods from the first to
/// the last.
#[test]
fn periods_that_the_loop_missed_are_counted_apart_from_lost_cycles() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let mut writer = subject.writer(&folder.path().join("recording.mcap"));
    let (mut ran, mut shift, mut written) = (0_u64, 0, 0);
    subject.steer(None, &[[90.0, 70.0]], 0.2, |record| {
        let mut message = magsteer::daemon::cycle_message(record);
        // Three periods are missed before every 50th cycle but the first; of every hundred cycles two are lost.
        message.tick.missed = if ran > 0 && ran.is_multiple_of(50) { 3 } else { 0 };
        shift += message.tick.missed;
        message.tick.number += shift;
        if !matches!(ran % 100, 20 | 21) {
            writer.write(&message).expect("room");
            written += 1;
        }
        ran += 1;
    });
    writer.finish(&complete()).expect("room");
    let counts = Recording::open(folder.path()).expect("a recording").counts().expect("whole");
    assert!(ran > 300 && counts.cycles == written, "{ran} {counts:?}");
    assert_eq!((counts.missed, counts.lost(), counts.holes), (shift, ran - written, (ran - written) / 2));
    assert_eq!(counts.periods(), counts.cycles + counts.missed + counts.lost());
}

/// Goal: a chunk with a wrong bit is left out, what stands before and behind it is not.
#[test]
fn a_damaged_chunk_is_a_hole_and_not_the_end() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("recording.mcap");
    let (cycles, flushes) = recorded(&subject, &file);
    let mut bytes = fs::read(&file).expect("the recording");
    let middle = (flushes[1].0 + flushes[2].0) / 2;
    bytes[usize::try_from(middle).expect("small")] ^= 0x10;
    fs::write(&file, &bytes).expect("room");
    let counts = Recording::open(&file).expect("its head is whole").counts().expect("readable");
    assert_eq!((counts.damaged, counts.holes, counts.ending), (1, 1, Ending::Whole));
    assert!(counts.cycles < cycles.len() as u64 && counts.cycles >= cycles.len() as u64 - 200);
    assert_eq!((counts.first_number, counts.last_number), (0, cycles.len() as u64 - 1));
    assert_eq!((counts.missed, counts.lost()), (0, cycles.len() as u64 - counts.cycles));
}

/// Goal: whichever bit of a chunk is wrong, it is that chunk that is lost. A wrong bit in compressed data becomes a wrong length
/// of a record, for which no memory is asked.
#[test]
fn any_wrong_bit_costs_its_chunk_and_nothing_else() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("recording.mcap");
    let (cycles, flushes) = recorded(&subject, &file);
    let whole = fs::read(&file).expect("the recording");
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(20_261_123);
    // Of the begin of the second piece: a chunk, its head aside. A bit that decides nothing may be wrong unnoticed.
    let mut damaged = 0;
    let [begin, end] = [flushes[0].0, flushes[1].0].map(|at| usize::try_from(at).expect("small"));
    let range = begin + 200..begin + (end - begin) / 4;
    for _ in 0..150 {
        let (at, bit) = (random.random_range(range.clone()), random.random_range(0..8));
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << bit;
        fs::write(&file, &bytes).expect("room");
        let counts = Recording::open(&file).expect("its head is whole").counts().expect("readable");
        assert_eq!((counts.holes, counts.ending), (counts.damaged, Ending::Whole), "bit {bit} of byte {at}");
        assert_eq!(counts.damaged == 0, counts.lost() == 0, "bit {bit} of byte {at}");
        damaged += counts.damaged;
        assert_eq!(counts.cycles + counts.lost(), cycles.len() as u64);
    }
    assert!(damaged > 50, "most bits decide something: {damaged}");
}

#[test]
fn files_that_are_no_recordings_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let refused = |path: &Path| Recording::open(path).expect_err("no recording").to_string();
    assert!(refused(folder.path()).contains("recording.mcap: cannot be opened"));
    let file = folder.path().join("text.mcap");
    fs::write(&file, "some text that is longer than a head").expect("room");
    assert!(refused(&file).ends_with("is no recording of this program: it is no MCAP file"));
    let subject = planar();
    let file = folder.path().join("once.mcap");
    subject.writer(&file).finish(&complete()).expect("room");
    let twice = RecordingWriter::create(&file, subject.info(""), "").expect_err("it is there already");
    assert!(matches!(twice, RecordingError::Create { .. }), "{twice}");
}

/// Goal: fields that this version does not know are not guessed at.
#[test]
fn a_recording_of_another_version_is_refused_and_names_both() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("other.mcap");
    let mut info = subject.info("");
    info.program = "9.9.9".to_owned();
    let file = fs::File::create(&path).expect("room");
    let mut writer = mcap::Writer::new(std::io::BufWriter::new(file)).expect("room");
    let metadata = mcap::records::Metadata { name: "magsteer".to_owned(), metadata: info.to_metadata() };
    writer.write_metadata(&metadata).expect("room");
    let data = std::borrow::Cow::Borrowed(&b"[rig]"[..]);
    let (name, media_type) = ("config.toml".to_owned(), String::new());
    let config = mcap::Attachment { log_time: 0, create_time: 0, name, media_type, data };
    writer.attach(&config).expect("room");
    let schema = writer.add_schema("magsteer_msgs/msg/Cycle", "ros2msg", b"uint64 other\n").expect("room");
    let channel = writer.add_channel(schema, "/rig/cycle", "cdr", &Default::default()).expect("room");
    let header =
        mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, &[0; 12]).expect("room");
    writer.finish().expect("room");
    drop(writer);
    let recording = Recording::open(&path).expect("its head is known");
    let refused = recording.cycles().expect("there").next().expect("one").expect_err("other fields");
    let words = refused.to_string();
    assert!(words.contains("version 9.9.9") && words.contains(env!("CARGO_PKG_VERSION")), "{words}");
    assert!(matches!(refused, RecordingError::Version { .. }));
}

/// Goal: a table holds what the cycles hold, under names that end in their unit.
#[test]
fn a_recording_is_exported_as_csv_with_every_number() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let (cycles, _) = recorded(&subject, &folder.path().join("recording.mcap"));
    let recording = Recording::open(folder.path()).expect("a recording");
    let file = folder.path().join("cycles.csv");
    let exported = export_csv(&recording, &file, &Choice::default()).expect("room");
    let text = fs::read_to_string(&file).expect("a table");
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().expect("names");
    let column = |name: &str| names.iter().position(|known| *known == name).expect(name);
    assert_eq!(exported, Exported { rows: cycles.len() as u64, columns: names.len() as u64 });
    let coil = recording.info().coils[1].clone();
    let (number, current) = (column("number"), column(&format!("coil.{coil}.commanded_a")));
    let position = column("magnet.m2.position_z_m");
    for (line, cycle) in lines.by_ref().zip(&cycles) {
        assert_eq!(line.len(), names.len());
        assert_eq!(line[number], cycle.number.to_string());
        assert_eq!(line[current].parse::<f64>().expect("a number").to_bits(), cycle.commanded_a[1].to_bits());
        assert_eq!(line[position].parse::<f64>().expect("a number"), cycle.position_m[1][2]);
    }
    assert!(lines.next().is_none(), "a line a cycle");
    assert!(export_csv(&recording, &file, &Choice::default()).is_err(), "no file is written over");
}

/// Goal: a narrower table has the same numbers as the whole one at the chosen places, and no others; a name that
/// picks nothing makes no file.
#[test]
fn an_export_of_some_columns_of_some_cycles_is_that_part_of_the_whole() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let (cycles, _) = recorded(&subject, &folder.path().join("recording.mcap"));
    let recording = Recording::open(folder.path()).expect("a recording");
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let choice = Choice { every: 7, names: names(&["magnet.m1.measured", "number", "commanded_a"]) };
    let file = folder.path().join("thin.csv");
    let exported = export_csv(&recording, &file, &choice).expect("room");
    let rows = cycles.len().div_ceil(7);
    assert_eq!(exported, Exported { rows: rows as u64, columns: 1 + 6 + 3 });
    let text = fs::read_to_string(&file).expect("a table");
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().expect("names").split(',').collect();
    assert_eq!((head[0], head[9]), ("number", "magnet.m1.measured_z"), "in the order of a cycle: {head:?}");
    assert_eq!(lines.clone().count(), rows);
    for (line, cycle) in lines.zip(cycles.iter().step_by(7)) {
        let found: Vec<&str> = line.split(',').collect();
        assert_eq!((found.len(), found[0]), (10, &*cycle.number.to_string()));
        let real = |index: usize| found[index].parse::<f64>().expect("a number").to_bits();
        assert_eq!(real(3), cycle.commanded_a[2].to_bits());
        assert!(real(7) == cycle.measured[0][0].to_bits() || cycle.measured[0][0].is_nan());
    }
    let npz = folder.path().join("thin.npz");
    let exported = export_npz(&recording, &npz, &choice).expect("room");
    // Arrays are whole: the tangents of both magnets.
    assert_eq!(exported, Exported { rows: rows as u64, columns: 1 + 6 + 6 });
    let bytes = fs::read(&npz).expect("an archive");
    assert_eq!(bytes[bytes.len() - 12], 3 + 3, "three arrays, and three lists of names");
    let shape = format!("'shape': ({rows}, 6, )");
    assert!(bytes.windows(shape.len()).any(|window| window == shape.as_bytes()));

    let none = folder.path().join("none.csv");
    let unknown = Choice { every: 1, names: names(&["number", "mesured_a"]) };
    let refused = export_csv(&recording, &none, &unknown).expect_err("no such column").to_string();
    assert_eq!(refused, "mesured_a: names no column; did you mean `measured_a`?");
    assert!(!none.exists());
}

/// Goal: the archive has the structure of a ZIP, with every field once and as many bytes as its shape says.
/// That NumPy reads it is shown by the script beside these tests.
#[test]
fn a_recording_is_exported_as_arrays_of_the_right_length() {
    let subject = planar();
    let folder = tempfile::tempdir().expect("a folder");
    let (cycles, _) = recorded(&subject, &folder.path().join("recording.mcap"));
    let recording = Recording::open(folder.path()).expect("a recording");
    let file = folder.path().join("cycles.npz");
    let exported = export_npz(&recording, &file, &Choice::default()).expect("room");
    assert_eq!(exported.rows, cycles.len() as u64);
    let bytes = fs::read(&file).expect("an archive");
    let end = &bytes[bytes.len() - 22..];
    assert_eq!(&end[..4], b"PK\x05\x06");
    let members = usize::from(u16::from_le_bytes([end[10], end[11]]));
    assert_eq!(members, Cycle::FIELDS.len() + 3, "every field, and three lists of names");
    let name = b"commanded_a.npy";
    let at = bytes.windows(name.len()).position(|window| window == name).expect("there") + name.len();
    let head = usize::from(u16::from_le_bytes([bytes[at + 8], bytes[at + 9]])) + 10;
    let shape = format!("'shape': ({}, 6, )", cycles.len());
    assert!(String::from_utf8_lossy(&bytes[at..at + head]).contains(&shape));
    let coil = |cycle: usize, coil: usize| {
        let begin = at + head + 8 * (6 * cycle + coil);
        f64::from_le_bytes(bytes[begin..begin + 8].try_into().expect("eight bytes"))
    };
    for (index, cycle) in cycles.iter().enumerate() {
        assert_eq!(coil(index, 2).to_bits(), cycle.commanded_a[2].to_bits());
    }
}
