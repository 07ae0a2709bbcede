//! What is in a flight, when there is one, and what is left of a damaged one.

use std::path::Path;

use magsteer_hal::operator::{Cause, state};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::columns::Columns;
use super::super::flight::{BLOCK_RECORDS, write_flight};
use super::super::header::Reason;
use super::super::reading::{Ending, Flight, FlightError, FlightLabel};
use super::super::{Extract, Header, refusal_text};
use super::{Bench, RATE_HZ, flights, labels, rig};
use crate::daemon::cycle_record::CycleRecord;
use crate::daemon::state::Verb;

/// One trip, its flight read back, and the cycles as they were.
fn tripped() -> (Flight, Vec<CycleRecord>) {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(2_500);
    bench.trip();
    bench.recorder.end();
    let paths = flights(folder.path());
    assert_eq!(paths.len(), 1, "{paths:?}");
    (Flight::read(&paths[0]).expect("just written"), bench.records)
}

/// Goal: the cycle of the trip, a second before it, half a second after it, and why; the ring has wrapped.
#[test]
fn a_flight_holds_the_tripping_cycle_and_the_time_before_and_after_it() {
    let (flight, records) = tripped();
    let header = &flight.header;
    assert_eq!(flight.ending, Ending::Complete);
    assert_eq!((header.reason, header.from, header.to), (Reason::SafeStop, state::ACTIVE, state::SAFE_STOP));
    assert_eq!(header.cause, Cause::RequestNotFinite.code());
    assert_eq!((header.rig.as_str(), header.config_sha256.as_str()), (rig().rig.as_str(), "c0ffee"));
    assert_eq!(header.description_fingerprint, format!("{:016x}", rig().fingerprint()));
    let tripping = records
        .iter()
        .find(|record| record.decision.transition.is_some_and(|it| it.to == state::SAFE_STOP))
        .expect("it tripped");
    assert_eq!(header.trigger_cycle, tripping.tick.number);
    let cycles: Vec<u64> = (0..flight.records()).map(|at| flight.count(at, "cycle").expect("all")).collect();
    assert!(cycles.windows(2).all(|pair| pair[1] == pair[0] + 1), "newest, in order, none left out");
    let at = cycles.iter().position(|cycle| *cycle == tripping.tick.number).expect("in the flight");
    assert_eq!(flight.count(at, "transition_to"), Some(u64::from(state::SAFE_STOP)));
    assert_eq!(flight.count(at, "transition_cause"), Some(u64::from(Cause::RequestNotFinite.code())));
    let [first, last] = Extract::new(&flight, 1.0, 1.0, 10).span_s.expect("records");
    // The ring holds 1.5 s; its ramp of milliseconds ends in a fault, and half a second later it is written.
    assert!((-1.0..-0.9).contains(&first) && (0.5..0.6).contains(&last), "{first} to {last} s");
    assert_eq!(flight.records(), 1_500);
}

/// Goal: every value of every record as the loop had it, to the last bit, and each under its own name.
#[test]
fn records_come_back_bit_for_bit_under_their_names() {
    let (flight, records) = tripped();
    let columns = Columns::new(&rig());
    let first = flight.count(0, "cycle").expect("a cycle");
    let begin = records.iter().position(|record| record.tick.number == first).expect("recorded");
    let mut bytes = vec![0; columns.record_bytes()];
    for (at, record) in records[begin..].iter().take(flight.records()).enumerate() {
        columns.encode(record, &mut bytes);
        let expected: Vec<u64> =
            bytes.chunks_exact(8).map(|bytes| u64::from_le_bytes(bytes.try_into().expect("eight"))).collect();
        assert_eq!(flight.record(at), expected, "record {at}");
        let number = |name: &str| flight.number(at, name).map(f64::to_bits);
        let rig = rig();
        for (index, coil) in rig.coils.iter().enumerate() {
            let name = |what: &str| format!("coil.{}.{what}", coil.name);
            let measured = record.input.measured.current_a[index];
            assert_eq!(number(&name("measured_a")), Some(measured.to_bits()));
            assert_eq!(number(&name("commanded_a")), Some(record.admitted.current_a[index].to_bits()));
        }
        for (index, magnet) in rig.magnets().enumerate() {
            let name = |what: &str| format!("magnet.{}.{what}", magnet.name);
            assert_eq!(number(&name("measured_z")), Some(record.outcome.measured[index][2].to_bits()));
            assert_eq!(number(&name("bias_x_rad")), Some(record.outcome.bias[index][0].to_bits()));
        }
        assert_eq!(number("model_residual"), Some(record.outcome.model.residual.to_bits()));
        assert_eq!(flight.count(at, "tick_ns"), Some(record.tick.now.nanoseconds()));
        assert_eq!(flight.count(at, "state"), Some(record.decision.state.into()));
        assert_eq!(flight.count(at, "order"), record.order.map(u64::from));
    }
}

#[test]
fn every_column_has_a_name_of_its_own_and_every_record_room_for_all() {
    let columns = Columns::new(&rig());
    let mut names: Vec<&str> = columns.described().iter().map(|column| column.name.as_str()).collect();
    let count = names.len();
    assert_eq!(columns.record_bytes(), 8 * count);
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), count);
    assert!(columns.described().iter().all(|column| !column.meaning.is_empty()));
    // Nothing is left as it was: the last column is written too.
    let (_, records) = tripped();
    let mut bytes = vec![0xA5; columns.record_bytes()];
    columns.encode(&records[100], &mut bytes);
    assert_ne!(bytes[8 * (count - 1)..], [0xA5; 8]);
}

#[test]
fn a_stop_that_was_wished_for_makes_no_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(300);
    bench.ask(Verb::Stop);
    bench.run(1_000);
    assert_eq!(bench.records.last().expect("cycles").decision.state, state::IDLE);
    bench.recorder.end();
    assert_eq!(flights(folder.path()), Vec::<std::path::PathBuf>::new());
}

/// Goal: a tripped ramp and the fault that ends it are one episode; the next one has its own flight.
#[test]
fn every_episode_has_one_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(300);
    bench.trip();
    assert_eq!(bench.entered(state::FAULT).decision.cause, Some(Cause::RequestNotFinite));
    bench.ask(Verb::Reset);
    bench.steer(300);
    bench.ask(Verb::EmergencyStop);
    bench.run(700);
    bench.recorder.end();
    let mut labels = labels(folder.path());
    // Names tell them apart by the second alone.
    labels.sort_by_key(|label| label.header.trigger_cycle);
    let about: Vec<(Reason, u32)> =
        labels.iter().map(|label| (label.header.reason, label.header.cause)).collect();
    let expected =
        [(Reason::SafeStop, Cause::RequestNotFinite.code()), (Reason::Fault, Cause::EmergencyStop.code())];
    assert_eq!(about, expected);
    assert!(labels.iter().all(|label| label.whole));
}

#[test]
fn an_operator_gets_a_flight_of_a_loop_that_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    assert_eq!(bench.recorder.order(), Err(Cause::NotRecording), "nothing to write yet");
    bench.steer(300);
    bench.recorder.order().expect("records");
    bench.run(600);
    bench.recorder.end();
    let labels = labels(folder.path());
    // The loop was told to end while it steered here; that it held authority then is another flight.
    assert_eq!(labels.len(), 2);
    let ordered = labels.iter().find(|label| label.header.reason == Reason::Operator).expect("ordered");
    assert_eq!((ordered.header.to, ordered.header.cause), (state::ACTIVE, 0));
    assert_eq!(ordered.header.records, 20 + 1 + 20 + 1 + 300 + 500);
}

/// Goal: a loop whose thread dies leaves its last cycles behind, though no transition tells of it.
#[test]
fn a_loop_that_dies_leaves_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(50);
    let last = bench.records.last().expect("cycles").tick.number;
    bench.recorder.end();
    let labels = labels(folder.path());
    assert_eq!((labels[0].header.reason, labels[0].header.trigger_cycle), (Reason::LoopDied, last));
}

#[test]
fn a_fault_within_half_a_second_of_the_end_is_still_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut bench = Bench::new(folder.path());
    bench.steer(50);
    bench.ask(Verb::EmergencyStop);
    bench.run(3);
    bench.recorder.end();
    let labels = labels(folder.path());
    assert_eq!((labels.len(), labels[0].header.cause), (1, Cause::EmergencyStop.code()));
}

#[test]
fn the_oldest_flights_make_room_for_new_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut written = Vec::new();
    for _ in 0..5 {
        let mut bench = Bench::new(folder.path());
        bench.steer(50);
        bench.ask(Verb::EmergencyStop);
        let state = bench.recorder.state();
        bench.recorder.end();
        written.extend(state.paths());
    }
    assert_eq!(written.len(), 5);
    let mut kept = written.split_off(2);
    kept.sort();
    assert_eq!(flights(folder.path()), kept);
}

/// The bytes of a flight of some records, and where its blocks begin, its end included.
fn file(records: usize) -> (Vec<u8>, Vec<usize>) {
    let (flight, cycles) = tripped();
    let columns = Columns::new(&rig());
    let encoded: Vec<Vec<u8>> = cycles[..records]
        .iter()
        .map(|record| {
            let mut bytes = vec![0; columns.record_bytes()];
            columns.encode(record, &mut bytes);
            bytes
        })
        .collect();
    let header = Header { records: records as u64, ..flight.header };
    let mut bytes = Vec::new();
    write_flight(&mut bytes, &header, encoded.iter().map(Vec::as_slice)).expect("memory");
    let mut begins = vec![20 + serde_json::to_vec(&header).expect("plain").len()];
    let mut left = records;
    while left > 0 {
        let count = left.min(BLOCK_RECORDS);
        left -= count;
        begins.push(begins[begins.len() - 1] + 16 + count * columns.record_bytes());
    }
    assert_eq!(begins[begins.len() - 1] + 16, bytes.len());
    (bytes, begins)
}

fn read(folder: &Path, bytes: &[u8]) -> Result<Flight, FlightError> {
    let path = folder.join("cut.flight");
    std::fs::write(&path, bytes).expect("own folder");
    Flight::read(&path)
}

/// Goal: cut at every border of a record and of a block, and beside it, a file gives every whole block.
#[test]
fn a_file_cut_anywhere_is_read_up_to_its_last_whole_block() {
    let folder = tempfile::tempdir().expect("a folder");
    let (bytes, begins) = file(2 * BLOCK_RECORDS + 20);
    let whole = read(folder.path(), &bytes).expect("whole");
    assert_eq!((whole.ending, whole.records()), (Ending::Complete, 2 * BLOCK_RECORDS + 20));
    let record_bytes = Columns::new(&rig()).record_bytes();
    let mut cuts: Vec<usize> = Vec::new();
    for pair in begins.windows(2) {
        let records = (pair[1] - pair[0]) / record_bytes;
        let borders = (0..=records).map(|record| pair[0] + 12 + record * record_bytes);
        cuts.extend(borders.chain([pair[0], pair[1]]).flat_map(|cut| [cut - 1, cut, cut + 1]));
    }
    cuts.extend((begins[3]..bytes.len()).chain([begins[0]]));
    for cut in cuts.into_iter().filter(|cut| (begins[0]..bytes.len()).contains(cut)) {
        let found = read(folder.path(), &bytes[..cut]).expect("its header is whole");
        let blocks = begins.iter().rposition(|begin| *begin <= cut).expect("behind the header");
        let records = (blocks * BLOCK_RECORDS).min(whole.records());
        let offset = begins[blocks] as u64;
        assert_eq!((found.records(), found.ending), (records, Ending::Truncated { offset }), "cut at {cut}");
        assert!((0..records).all(|record| found.record(record) == whole.record(record)), "cut at {cut}");
    }
    for cut in [0, 1, 7] {
        assert!(matches!(read(folder.path(), &bytes[..cut]), Err(FlightError::NotAFlight { .. })));
    }
    for cut in [8, 15, 16, 300, begins[0] - 1] {
        assert!(matches!(read(folder.path(), &bytes[..cut]), Err(FlightError::Header { .. })), "{cut}");
    }
}

/// Goal: no flipped bit passes unseen, and what is read before it is what was written.
#[test]
fn a_flipped_bit_anywhere_is_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut bytes, begins) = file(2 * BLOCK_RECORDS);
    let whole = read(folder.path(), &bytes).expect("whole");
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let near_heads = begins.iter().flat_map(|begin| (0..16).map(move |byte| 8 * (begin + byte)));
    let mut bits: Vec<usize> = near_heads.collect();
    bits.extend((0..300).map(|_| random.random_range(0..8 * bytes.len())));
    for bit in bits {
        bytes[bit / 8] ^= 1 << (bit % 8);
        let damaged_block = begins.iter().rposition(|begin| *begin <= bit / 8);
        match (read(folder.path(), &bytes), damaged_block) {
            (Ok(found), Some(block)) => {
                assert_ne!(found.ending, Ending::Complete, "bit {bit}");
                assert!(found.ending.words().is_some_and(|words| words.contains(&begins[block].to_string())));
                assert_eq!(found.records(), block * BLOCK_RECORDS, "bit {bit}");
                assert!((0..found.records()).all(|record| found.record(record) == whole.record(record)));
            }
            (Err(_), None) => {}
            (found, _) => panic!("bit {bit}: {found:?}"),
        }
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

#[test]
fn blocks_that_changed_places_and_bytes_behind_the_end_are_seen() {
    let folder = tempfile::tempdir().expect("a folder");
    let (bytes, begins) = file(3 * BLOCK_RECORDS);
    let block = |index: usize| &bytes[begins[index]..begins[index + 1]];
    let swapped = [&bytes[..begins[0]], block(1), block(0), block(2), &bytes[begins[3]..]].concat();
    let found = read(folder.path(), &swapped).expect("its header is whole");
    assert_eq!((found.records(), found.ending), (0, Ending::Damaged { offset: begins[0] as u64 }));
    let doubled = [&bytes[..begins[1]], block(0), &bytes[begins[1]..]].concat();
    assert_eq!(read(folder.path(), &doubled).expect("its header is whole").records(), BLOCK_RECORDS);
    let missing = [&bytes[..begins[2]], &bytes[begins[3]..]].concat();
    assert!(matches!(read(folder.path(), &missing).expect("header").ending, Ending::Damaged { .. }));
    let longer = [bytes.as_slice(), b"\0"].concat();
    assert!(matches!(read(folder.path(), &longer).expect("header").ending, Ending::Damaged { .. }));
}

#[test]
fn what_is_no_flight_is_refused_whatever_it_holds() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = ChaCha8Rng::seed_from_u64(22);
    let (bytes, begins) = file(BLOCK_RECORDS);
    for _ in 0..200 {
        let length = random.random_range(0..4_000);
        let noise: Vec<u8> = (0..length).map(|_| random.random()).collect();
        assert!(read(folder.path(), &noise).is_err());
        // Noise behind a good head, and behind the magic alone.
        let behind = [&bytes[..begins[0]], &noise].concat();
        assert_eq!(read(folder.path(), &behind).expect("a good head").records(), 0);
        assert!(read(folder.path(), &[b"MSFLIGHT\x01\0\0\0".as_slice(), &noise].concat()).is_err());
    }
    let mut newer = bytes.clone();
    newer[8] = 2;
    let refusal = read(folder.path(), &newer).expect_err("another version").to_string();
    assert!(refusal.ends_with("is a flight of version 2; this program reads version 1"), "{refusal}");
    let missing = FlightLabel::read(&folder.path().join("nothing")).expect_err("no such file").to_string();
    assert!(missing.contains("No such file"), "{missing}");
}

#[test]
fn extremes_are_the_worst_values_and_rows_lead_to_the_trip() {
    let (flight, records) = tripped();
    let extract = Extract::new(&flight, 0.5, 0.1, 20);
    let first = flight.count(0, "cycle").expect("a cycle");
    let begin = records.iter().position(|record| record.tick.number == first).expect("recorded");
    let within = &records[begin..begin + flight.records()];
    let worst = |value: fn(&CycleRecord) -> f64| within.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
    let extreme = |name: &str| extract.extremes.iter().find(|it| it.name == name).expect("listed").value;
    assert_eq!(extreme("model_residual"), worst(|record| record.outcome.model.residual));
    let name = format!("coil.{}.measured_a", rig().coils[0].name);
    assert_eq!(extreme(&name).abs(), worst(|record| record.input.measured.current_a[0].abs()));
    assert!(extract.rows.iter().any(|row| row.cycle == flight.header.trigger_cycle && row.at_s == 0.0));
    assert!((20..=22).contains(&extract.rows.len()), "{}", extract.rows.len());
    assert!(extract.rows.iter().all(|row| row.at_s >= -0.5 && row.at_s <= 0.1));
    let step = extract.rows[1].at_s - extract.rows[0].at_s;
    assert!((step - 0.6 / 20.0).abs() < 2.0 / RATE_HZ, "{step}");
    assert_eq!(refusal_text(7, 0, 1).as_deref(), Some("magnet 1 was not seen"));
    assert_eq!(refusal_text(0, 0, 0), None);
}
