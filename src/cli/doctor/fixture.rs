//! Machines made of files, for tests: nothing here depends on the machine that runs them.

use super::machine::Machine;

/// A machine that has these files and no others; kept until it is dropped.
pub struct Fixture {
    _directory: tempfile::TempDir,
    pub machine: Machine,
}

/// Paths with the text of each.
pub type Files<'a> = &'a [(&'a str, &'a str)];

pub fn machine(files: Files<'_>) -> Fixture {
    let directory = tempfile::tempdir().expect("a directory");
    for (path, text) in files {
        let path = directory.path().join(path.trim_start_matches('/'));
        std::fs::create_dir_all(path.parent().expect("below the root")).expect("made");
        std::fs::write(path, format!("{text}\n")).expect("written");
    }
    let machine = Machine::below(directory.path());
    Fixture { _directory: directory, machine }
}
