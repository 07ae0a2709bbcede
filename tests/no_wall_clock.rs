//! A clock that is stepped moves nothing: what decides, guards or simulates knows monotonic time alone.
//!
//! Every stamp is of `CLOCK_MONOTONIC` ([`magsteer_hal::Stamp::now`]), which nobody can step. So it is enough that the
//! sources name no other clock. Where files are dated for people, the wall clock has its place.

use std::path::{Path, PathBuf};

/// Words that stand for a clock that can be stepped.
const WALL: [&str; 5] = ["SystemTime", "UNIX_EPOCH", "CLOCK_REALTIME", "ClockId::Realtime", "chrono::"];
/// Where none of them may stand.
const GUARDED: [&str; 6] =
    ["src/math", "src/magnetics", "src/rod", "src/control", "src/daemon", "sim-plant/src"];
/// Under these, files are dated for people, or the ages of files are judged that may be swept away; nothing that moves a current.
const DATED: [&str; 2] = ["src/daemon/recorder", "hal/src/channels/membership.rs"];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder of this project").flatten() {
        let path = entry.path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn nothing_that_moves_a_current_reads_a_clock_that_can_be_stepped() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    for folder in GUARDED.into_iter().chain(["hal/src"]) {
        sources(&root.join(folder), &mut files);
    }
    assert!(files.len() > 100, "the sources are found: {}", files.len());
    let dated = |file: &Path| DATED.iter().any(|path| file.starts_with(root.join(path)));
    for file in files.iter().filter(|file| !dated(file)) {
        let text = std::fs::read_to_string(file).expect("a source");
        for word in WALL {
            assert!(!text.contains(word), "{} in {}", word, file.display());
        }
    }
}
