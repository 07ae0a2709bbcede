//! Bytes from outside must not bring the program down: the committed corpus and seeded mutations of it, through the very entry
//! points that `tests/fuzz` fuzzes.

#![cfg(all(feature = "sim", feature = "record", feature = "mpem"))]

#[path = "fuzz/entry_points/mod.rs"]
mod entry_points;

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Mutations of each file of the corpus: some seconds for all targets together.
const MUTATIONS: usize = 200;

/// What mistakes are made of: limits of numbers, signs of the formats.
const WORDS: [&str; 24] = [
    "nan",
    "inf",
    "-inf",
    "-0.0",
    "1e308",
    "-1e308",
    "1e-320",
    "0",
    "-1",
    "9223372036854775807",
    "99999999999999999999",
    "\n",
    "\r\n",
    "\t",
    ",",
    "\"",
    "'''",
    "[[",
    "]]",
    "{",
    "}",
    "=",
    "#",
    "\u{feff}é\u{202e}",
];

/// Files of a target's corpus by name, sorted.
fn corpus(target: &str) -> Vec<(String, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/corpus").join(target);
    let entries = fs::read_dir(&folder).expect("every target has a corpus").flatten();
    let mut files: Vec<(String, Vec<u8>)> = entries
        .map(|entry| {
            (entry.file_name().to_string_lossy().into_owned(), fs::read(entry.path()).expect("readable"))
        })
        .collect();
    files.sort();
    assert!(files.len() >= 2, "{target} has a few seeds");
    files
}

/// One to four random changes.
fn mutated(bytes: &[u8], other: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..=4) {
        let at = random.random_range(0..=bytes.len());
        let end = (at + random.random_range(0..=24)).min(bytes.len());
        match random.random_range(0..7) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.random_range(0..8),
            1 if at < bytes.len() => bytes[at] = random.random(),
            2 => drop(bytes.drain(at..end)),
            3 => {
                let word = WORDS[random.random_range(0..WORDS.len())];
                bytes.splice(at..end, word.bytes());
            }
            4 => {
                let copied = bytes[at..end].to_vec();
                let place = random.random_range(0..=bytes.len());
                bytes.splice(place..place, copied);
            }
            5 => {
                let from = random.random_range(0..=other.len());
                let to = (from + random.random_range(0..=64)).min(other.len());
                bytes.splice(at..end, other[from..to].iter().copied());
            }
            _ => bytes.truncate(at.max(1)),
        }
    }
    bytes
}

fn withstands(target: &str, seed: u64, entry: fn(&[u8])) {
    let files = corpus(target);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let survives = |name: &str, bytes: &[u8]| {
        if catch_unwind(|| entry(bytes)).is_err() {
            let kept = std::env::temp_dir().join(format!("{target}.crash"));
            let _ = fs::write(&kept, bytes);
            panic!("{target} panicked at {name}; the bytes are in {}", kept.display());
        }
    };
    for (name, bytes) in &files {
        survives(name, bytes);
        for number in 0..MUTATIONS {
            let other = &files[random.random_range(0..files.len())].1;
            survives(&format!("{name}, mutation {number}"), &mutated(bytes, other, &mut random));
        }
    }
}

/// Proves SR-18.
#[test]
fn configurations_experiments_and_fault_plans_never_bring_the_program_down() {
    withstands("config", 1, entry_points::config);
    withstands("experiment", 2, entry_points::experiment);
    withstands("fault_plan", 3, entry_points::fault_plan);
    withstands("experiment_csv", 12, entry_points::experiment_csv);
}

/// Proves SR-18.
#[test]
fn files_of_measurements_and_targets_never_bring_the_program_down() {
    withstands("targets_csv", 4, entry_points::targets_csv);
    withstands("calibration_csv", 5, entry_points::calibration_csv);
    withstands("identify_csv", 6, entry_points::identify_csv);
    withstands("calibration_yaml", 13, entry_points::calibration_yaml);
}

/// Proves SR-18.
#[test]
fn messages_of_a_hostile_peer_are_refused_or_usable() {
    withstands("messages", 7, entry_points::messages);
    withstands("cloud", 8, entry_points::cloud);
}

/// Proves SR-18.
#[test]
fn requests_and_lines_of_a_hostile_operator_are_refused_or_usable() {
    withstands("operator_requests", 14, entry_points::operator_requests);
    withstands("target_lines", 15, entry_points::target_lines);
}

/// Proves SR-18.
#[test]
fn datagrams_flights_journals_and_recordings_never_bring_the_program_down() {
    withstands("datagrams", 9, entry_points::datagrams);
    withstands("flight", 10, entry_points::flight);
    withstands("journal", 11, entry_points::journal);
    withstands("recording", 16, entry_points::recording);
}
