//! Safety requirements and tests name each other: `src/daemon/REQUIREMENTS.md` lists ids, tests carry them in a doc comment,
//! `/// Proves SR-01.`
//!
//! An id without a test is a promise, a test with an unlisted id proves nothing that was promised: both fail here. The scanner is
//! tried on planted mistakes first.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

const LIST: &str = "src/daemon/REQUIREMENTS.md";
const MARK: &str = "Proves SR-";
/// Where tests live.
const FOLDERS: [&str; 4] = ["src", "hal", "sim-plant", "tests"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where every test is one of safety, so that each says what it proves.
const SAFETY: [&str; 9] = [
    "tests/driver_fault.rs",
    "tests/fault_matrix.rs",
    "tests/kill.rs",
    "tests/kill_matrix.rs",
    "tests/monitors.rs",
    "tests/security.rs",
    "tests/surroundings.rs",
    "tests/systemd.rs",
    "src/daemon/supervisor_tests",
];

/// The ids of a line or text, as `SR-01`, in order.
fn ids(text: &str) -> Vec<String> {
    let digits = |rest: &str| rest.bytes().take_while(u8::is_ascii_digit).count();
    let parts = text.split("SR-").skip(1);
    parts.map(|rest| format!("SR-{}", &rest[..digits(rest)])).collect()
}

/// The ids that the list's table declares, each in the first cell of its row.
fn listed(text: &str) -> Vec<String> {
    let rows = text.lines().filter_map(|line| line.strip_prefix("| SR-"));
    rows.map(|row| format!("SR-{}", row.split(' ').next().unwrap_or_default())).collect()
}

/// The ids that the tests of a source prove, each with the test's name; a mark that stands above no test is a mistake.
fn proved(text: &str) -> Result<Vec<(String, String)>, String> {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let mut found = Vec::new();
    for (number, line) in lines.iter().enumerate() {
        let Some(comment) = line.strip_prefix("///").filter(|comment| comment.contains(MARK)) else {
            continue;
        };
        let below = || lines[number + 1..].iter().take_while(|line| line.starts_with(['/', '#', ')']));
        let function = lines.get(number + 1 + below().count()).and_then(|line| line.strip_prefix("fn "));
        let Some((name, _)) = function.and_then(|function| function.split_once('(')) else {
            return Err(format!("line {}: {MARK} above no function", number + 1));
        };
        if !below().any(|line| *line == "#[test]") {
            return Err(format!("line {}: {name} is no test", number + 1));
        }
        let around = lines[..number].iter().rev().take_while(|line| line.starts_with(['/', '#'])).copied();
        if around.chain(below().copied()).any(|line| line.starts_with("#[ignore")) {
            return Err(format!("line {}: {name} is ignored", number + 1));
        }
        found.extend(ids(comment).into_iter().map(|id| (id, name.to_owned())));
    }
    Ok(found)
}

/// Every test of a source by name.
fn tests(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let marked = lines.iter().enumerate().filter(|(_, line)| **line == "#[test]");
    let function = |(number, _)| lines[number + 1..].iter().find_map(|line: &&str| line.strip_prefix("fn "));
    marked.filter_map(function).filter_map(|line| Some(line.split_once('(')?.0.to_owned())).collect()
}

/// Every Rust file below a folder, or the file itself.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut pending = vec![folder.to_owned()];
    let mut found = Vec::new();
    while let Some(path) = pending.pop() {
        if path.is_dir() {
            pending
                .extend(fs::read_dir(&path).expect("readable").map(|entry| entry.expect("readable").path()));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
    found
}

#[test]
fn the_scanner_finds_ids_and_marks_that_stand_above_no_test() {
    let text = "/// Goal: all.\n///\n/// Proves SR-03, SR-14 and SR-21.\n#[test]\nfn holds() {\n}\n\
                /// Speaks of SR-99.\n#[test]\nfn other() {}\n    /// Proves SR-04.\n    #[test]\n    fn inner() {}\n";
    let expected = [("SR-03", "holds"), ("SR-14", "holds"), ("SR-21", "holds"), ("SR-04", "inner")];
    let expected: Vec<_> = expected.iter().map(|(id, name)| ((*id).to_owned(), (*name).to_owned())).collect();
    assert_eq!(proved(text), Ok(expected));
    assert_eq!(proved("/// Proves SR-01.\nfn helper() {}\n"), Err("line 1: helper is no test".to_owned()));
    assert_eq!(
        proved("/// Proves SR-01.\nconst A: u8 = 1;\n"),
        Err("line 1: Proves SR- above no function".to_owned())
    );
    assert_eq!(
        proved("/// Proves SR-01.\n#[test]\n#[ignore = \"slow\"]\nfn slow() {}\n"),
        Err("line 1: slow is ignored".to_owned())
    );
    assert_eq!(tests(text), ["holds", "other", "inner"]);
    assert_eq!(listed("| id |\n|---|\n| SR-01 | never (see SR-02) |\nSR-05\n"), ["SR-01"]);
}

#[test]
fn every_requirement_has_a_test_and_every_mark_a_requirement() {
    let list = fs::read_to_string(root().join(LIST)).expect("the list is there");
    let declared = listed(&list);
    let unique: BTreeSet<&String> = declared.iter().collect();
    assert_eq!(unique.len(), declared.len(), "an id is used once");
    assert!(declared.iter().all(|id| id.len() == 5), "SR- and two digits");
    assert!(list.contains("No conformity to any medical standard is claimed"));
    let mut proofs: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for path in FOLDERS.iter().flat_map(|folder| sources(&root().join(folder))) {
        // This file speaks of marks without proving anything.
        if path.ends_with("tests/requirements.rs") {
            continue;
        }
        let text = fs::read_to_string(&path).expect("readable");
        let found = proved(&text).unwrap_or_else(|mistake| panic!("{}: {mistake}", path.display()));
        for (id, test) in found {
            proofs.entry(id).or_default().push(test);
        }
    }
    let without: Vec<&String> = declared.iter().filter(|id| !proofs.contains_key(*id)).collect();
    assert!(without.is_empty(), "no test proves {without:?}");
    for (id, tests) in &proofs {
        assert!(unique.contains(id), "{tests:?} prove {id}, which {LIST} does not list");
    }
}

#[test]
fn every_test_of_safety_says_which_requirement_it_proves() {
    let mut silent = Vec::new();
    for path in SAFETY.iter().flat_map(|place| sources(&root().join(place))) {
        let text = fs::read_to_string(&path).expect("readable");
        let found = proved(&text).unwrap_or_else(|mistake| panic!("{}: {mistake}", path.display()));
        let speaks = |test: &String| found.iter().any(|(_, name)| name == test);
        let here = tests(&text);
        silent.extend(
            here.iter().filter(|test| !speaks(test)).map(|test| format!("{}: {test}", path.display())),
        );
    }
    assert!(silent.is_empty(), "these prove nothing that was promised: {silent:#?}");
}
