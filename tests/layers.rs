//! The house's rules about who may know whom, read off the source text.
//!
//! Rules are written as what is absent, so that a test can look for it. The scanner is tested on planted violations first:
//! a rule that cannot fail says nothing.

use std::fs;
use std::path::{Path, PathBuf};

/// A module may import only from itself and from those before it.
const LAYERS: [&str; 11] =
    ["math", "magnetics", "rod", "control", "daemon", "config", "recording", "live", "tunnel", "cli", "main"];

/// A source file without its comments and the contents of its strings.
struct Source {
    path: PathBuf,
    /// Identifiers, `::` and single characters, in order: enough to follow paths.
    tokens: Vec<String>,
}

impl Source {
    fn new(path: impl Into<PathBuf>, text: &str) -> Self {
        Self { path: path.into(), tokens: tokens(&strip(text)) }
    }

    fn names(&self, word: &str) -> bool {
        self.tokens.iter().any(|token| token == word)
    }

    /// True when the words stand one after another, as `["Stamp", "::", "now"]`.
    fn names_path(&self, path: &[&str]) -> bool {
        self.tokens.windows(path.len()).any(|window| window.iter().eq(path.iter()))
    }

    /// Modules of the crate's root that this file, `depth` modules deep, reaches by `crate::`, `magsteer::` or enough `super::`.
    fn root_modules(&self, depth: usize) -> Vec<String> {
        let tokens = &self.tokens;
        let mut found = Vec::new();
        for at in 0..tokens.len() {
            if at > 0 && tokens[at - 1] == "::" {
                continue;
            }
            let rooted = tokens[at] == "crate" || tokens[at] == "magsteer";
            let supers = tokens[at..].chunks(2).take_while(|pair| **pair == ["super", "::"]).count();
            if rooted && tokens.get(at + 1).is_some_and(|next| next == "::") {
                found.extend(heads(&tokens[at + 2..]));
            } else if supers > 0 && supers >= depth {
                found.extend(heads(&tokens[at + 2 * supers..]));
            }
        }
        found
    }
}

/// First names of what a path goes on with: one name, or each of a group in braces.
fn heads(tokens: &[String]) -> Vec<String> {
    if tokens.first().is_none_or(|first| first != "{") {
        return tokens.first().cloned().into_iter().collect();
    }
    let mut names = Vec::new();
    let mut depth = 0;
    for pair in tokens.windows(2) {
        match pair[0].as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            break;
        }
        if depth == 1 && (pair[0] == "{" || pair[0] == ",") && pair[1] != "}" {
            names.push(pair[1].clone());
        }
    }
    names
}

fn tokens(code: &str) -> Vec<String> {
    let is_word = |letter: &char| letter.is_alphanumeric() || *letter == '_';
    let mut tokens = Vec::new();
    let mut letters = code.chars().peekable();
    while let Some(letter) = letters.next() {
        if is_word(&letter) {
            let mut word = letter.to_string();
            while let Some(next) = letters.next_if(is_word) {
                word.push(next);
            }
            tokens.push(word);
        } else if letter == ':' && letters.next_if_eq(&':').is_some() {
            tokens.push("::".to_owned());
        } else if !letter.is_whitespace() {
            tokens.push(letter.to_string());
        }
    }
    tokens
}

/// Drops comments and the contents of string and character literals, raw strings and nested comments included.
fn strip(text: &str) -> String {
    let letters: Vec<char> = text.chars().collect();
    let mut code = String::new();
    let mut at = 0;
    while at < letters.len() {
        let rest = &letters[at..];
        at += if rest.starts_with(&['/', '/']) {
            rest.iter().position(|letter| *letter == '\n').unwrap_or(rest.len())
        } else if rest.starts_with(&['/', '*']) {
            block_comment(rest)
        } else if let Some(length) = raw_string(rest) {
            length
        } else if rest[0] == '"' {
            quoted(rest, '"')
        } else if rest[0] == '\'' && (rest.get(1) == Some(&'\\') || rest.get(2) == Some(&'\'')) {
            quoted(rest, '\'')
        } else {
            code.push(rest[0]);
            1
        };
    }
    code
}

fn block_comment(text: &[char]) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at < text.len() {
        match text[at..] {
            ['/', '*', ..] => (depth, at) = (depth + 1, at + 2),
            ['*', '/', ..] => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
        if depth == 0 {
            break;
        }
    }
    at
}

fn raw_string(text: &[char]) -> Option<usize> {
    let hashes = text.strip_prefix(&['r'])?.iter().take_while(|letter| **letter == '#').count();
    let start = 1 + hashes;
    (text.get(start) == Some(&'"')).then(|| {
        let end: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
        let length = text[start + 1..].windows(end.len()).position(|window| window == end);
        length.map_or(text.len(), |length| start + 1 + length + end.len())
    })
}

fn quoted(text: &[char], quote: char) -> usize {
    let mut at = 1;
    while at < text.len() && text[at] != quote {
        at += if text[at] == '\\' { 2 } else { 1 };
    }
    (at + 1).min(text.len())
}

/// Every Rust file below a folder of the workspace, by path from its root.
fn sources(folder: &str) -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pending = vec![root.join(folder)];
    let mut found = Vec::new();
    while let Some(path) = pending.pop() {
        if path.is_dir() {
            pending.extend(fs::read_dir(&path).unwrap().map(|entry| entry.unwrap().path()));
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            found.push(Source::new(path.strip_prefix(root).unwrap(), &text));
        }
    }
    assert!(!found.is_empty(), "nothing found below {folder}");
    found
}

/// The layer that a file of `src/` belongs to, and how many modules deep it stands; `None` for `lib.rs`.
fn layer(path: &Path) -> Option<(usize, usize)> {
    let inside = path.strip_prefix("src").unwrap();
    let parts: Vec<&str> = inside.iter().map(|part| part.to_str().unwrap()).collect();
    let first = parts[0].trim_end_matches(".rs");
    if first == "lib" {
        return None;
    }
    let index = LAYERS.iter().position(|name| *name == first);
    let index = index.unwrap_or_else(|| panic!("{} belongs to no layer", path.display()));
    let is_page = parts.last().is_some_and(|name| *name == "mod.rs");
    Some((index, parts.len() - usize::from(is_page)))
}

/// Imports against the order of the layers, as sentences.
fn order_violations(source: &Source) -> Vec<String> {
    let Some((own, depth)) = layer(&source.path) else { return Vec::new() };
    let later = |name: &String| LAYERS.iter().position(|layer| layer == name).filter(|other| *other > own);
    let sentence =
        |other: usize| format!("{} ({}) names {}", source.path.display(), LAYERS[own], LAYERS[other]);
    source.root_modules(depth).iter().filter_map(later).map(sentence).collect()
}

/// Files of `folder` outside `except` in which `forbidden` finds something.
fn offenders(folder: &str, except: &[&str], forbidden: impl Fn(&Source) -> bool) -> Vec<String> {
    sources(folder)
        .iter()
        .filter(|source| !except.iter().any(|path| source.path.starts_with(path)) && forbidden(source))
        .map(|source| source.path.display().to_string())
        .collect()
}

fn reads_a_clock(source: &Source) -> bool {
    ["Instant", "SystemTime", "clock_gettime"].iter().any(|name| source.names(name))
        || source.names_path(&["Stamp", "::", "now"])
}

/// Dependencies of a manifest that are among `forbidden`, whatever their kind.
fn forbidden_dependencies(manifest: &str, forbidden: &[&str]) -> Vec<String> {
    let manifest: toml::Table = manifest.parse().unwrap();
    let kinds = ["dependencies", "dev-dependencies", "build-dependencies"];
    let tables = kinds.iter().filter_map(|kind| manifest.get(*kind)?.as_table());
    let names = tables.flat_map(toml::Table::keys);
    names.filter(|name| forbidden.contains(&name.as_str())).cloned().collect()
}

fn manifest(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

#[test]
fn the_scanner_finds_a_planted_import_against_the_order() {
    let planted = [
        ("src/math/a.rs", "use crate::rod::Rod;", "rod"),
        ("src/math/a.rs", "fn f() { crate::control::step(); }", "control"),
        ("src/math/mod.rs", "use super::rod;", "rod"),
        ("src/math/a.rs", "use super::super::daemon::Loop;", "daemon"),
        ("src/math/deep/a.rs", "use super::super::super::config::Config;", "config"),
        ("src/rod/a.rs", "use crate::{math::Pair, control::{Cycle, Step}};", "control"),
        ("src/rod/a.rs", "pub(in crate::cli) fn f() {}", "cli"),
        ("src/config/a.rs", "use magsteer::cli;", "cli"),
        ("src/control/a.rs", "const A: &str = r#\"\"//\"#; use crate::daemon::B;", "daemon"),
        ("src/control/a.rs", "/* /* nested */ */ use crate :: daemon :: B;", "daemon"),
    ];
    for (path, text, culprit) in planted {
        let violations = order_violations(&Source::new(path, text));
        assert_eq!(violations.len(), 1, "{path}: {text}: {violations:?}");
        assert!(violations[0].ends_with(&format!("names {culprit}")), "{violations:?}");
    }
}

#[test]
fn the_scanner_leaves_lawful_text_alone() {
    let lawful = [
        ("src/rod/a.rs", "use crate::{math::{daemon, Pair}, magnetics::AppliedField};"),
        ("src/rod/a.rs", "use super::control;"),
        ("src/rod/deep/a.rs", "use super::super::control;"),
        ("src/rod/a.rs", "// use crate::daemon;\n/* crate::cli */ /// [`crate::config`]\n"),
        (
            "src/rod/a.rs",
            "let text = \"crate::daemon \\\" crate::cli\"; let quote = '\"'; let life: &'a str;",
        ),
        ("src/main.rs", "mod cli; use magsteer::config::Config;"),
        ("src/lib.rs", "pub mod daemon;"),
        ("src/rod/a.rs", "use other::crate_::daemon; use other::magsteer::daemon;"),
    ];
    for (path, text) in lawful {
        assert_eq!(order_violations(&Source::new(path, text)), Vec::<String>::new(), "{path}: {text}");
    }
}

#[test]
#[should_panic(expected = "belongs to no layer")]
fn the_scanner_refuses_a_module_that_is_in_no_layer() {
    order_violations(&Source::new("src/utilities/a.rs", ""));
}

#[test]
fn the_scanner_finds_planted_names_and_dependencies() {
    assert!(reads_a_clock(&Source::new("a.rs", "use std::time::{Duration, Instant};")));
    assert!(reads_a_clock(&Source::new("a.rs", "let now = Stamp::now();")));
    assert!(!reads_a_clock(&Source::new("a.rs", "use std::time::Duration; fn f(now: Stamp) {} // Instant")));
    assert!(Source::new("a.rs", "use iceoryx2::prelude::*;").names("iceoryx2"));
    assert!(!Source::new("a.rs", "use my_iceoryx2::x; // iceoryx2").names("iceoryx2"));
    let manifest = "[dependencies]\na = \"1\"\n[dev-dependencies]\nb.workspace = true\n[features]\nc = []\n";
    assert_eq!(forbidden_dependencies(manifest, &["b", "c"]), ["b"]);
}

#[test]
fn modules_import_only_from_the_layers_before_them() {
    let violations: Vec<String> = sources("src").iter().flat_map(order_violations).collect();
    assert_eq!(violations, Vec::<String>::new());
}

#[test]
fn the_contract_knows_neither_the_controller_nor_the_plant() {
    let forbidden = |source: &Source| source.names("magsteer") || source.names("magsteer_sim_plant");
    assert_eq!(offenders("hal", &[], forbidden), Vec::<String>::new());
    let forbidden = forbidden_dependencies(&manifest("hal/Cargo.toml"), &["magsteer", "magsteer-sim-plant"]);
    assert_eq!(forbidden, Vec::<String>::new());
}

#[test]
fn the_plant_never_meets_the_controller() {
    assert_eq!(offenders("sim-plant", &[], |source| source.names("magsteer")), Vec::<String>::new());
    let forbidden = forbidden_dependencies(&manifest("sim-plant/Cargo.toml"), &["magsteer"]);
    assert_eq!(forbidden, Vec::<String>::new());
}

#[test]
fn the_controller_never_meets_the_plant_outside_the_command_line() {
    let except = ["src/cli", "src/main.rs"];
    assert_eq!(offenders("src", &except, |source| source.names("magsteer_sim_plant")), Vec::<String>::new());
}

#[test]
fn nothing_under_control_reads_a_clock_or_knows_a_channel() {
    let forbidden = |source: &Source| reads_a_clock(source) || source.names("iceoryx2");
    assert_eq!(offenders("src/control", &[], forbidden), Vec::<String>::new());
}

/// Goal: the cycle and all that decides in it run the same under stepped time.
#[test]
fn the_cycle_reads_no_clock() {
    for file in ["control_loop", "supervisor", "watch", "trust", "state", "receipt", "statistics", "lockstep"]
    {
        let path = format!("src/daemon/{file}.rs");
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(&path)).unwrap();
        assert!(!reads_a_clock(&Source::new(&path, &text)), "{path}");
    }
}

#[test]
fn the_model_reads_no_clock_either() {
    for folder in ["src/math", "src/magnetics", "src/rod"] {
        assert_eq!(offenders(folder, &[], reads_a_clock), Vec::<String>::new());
    }
}

/// `unsafe` is denied by the workspace's lints; this holds who may lift the lint.
#[test]
fn unsafe_code_stands_in_the_file_of_kernel_calls_and_the_counting_allocators_alone() {
    let is_unsafe = |source: &Source| source.names("unsafe") || source.names("unsafe_code");
    assert!(is_unsafe(&Source::new("a.rs", "#![expect(unsafe_code)]")));
    assert!(is_unsafe(&Source::new("a.rs", "let x = unsafe { f() };")));
    assert!(!is_unsafe(&Source::new("a.rs", "// unsafe\nlet x = \"unsafe\";")));
    let except = ["src/daemon/kernel.rs", "src/daemon/allocation.rs", "tests/counting_allocator"];
    for folder in ["src", "hal", "sim-plant", "tests", "benches"] {
        assert_eq!(offenders(folder, &except, is_unsafe), Vec::<String>::new());
    }
    let lints: toml::Table = manifest("Cargo.toml").parse().unwrap();
    assert_eq!(lints["workspace"]["lints"]["rust"]["unsafe_code"].as_str(), Some("deny"));
    for path in ["Cargo.toml", "hal/Cargo.toml", "sim-plant/Cargo.toml"] {
        let lints: toml::Table = manifest(path).parse().unwrap();
        assert_eq!(lints["lints"]["workspace"].as_bool(), Some(true), "{path}");
    }
}

#[test]
fn the_transport_is_named_in_the_contract_alone() {
    for folder in ["src", "sim-plant"] {
        assert_eq!(offenders(folder, &[], |source| source.names("iceoryx2")), Vec::<String>::new());
    }
    for path in ["Cargo.toml", "sim-plant/Cargo.toml"] {
        assert_eq!(forbidden_dependencies(&manifest(path), &["iceoryx2"]), Vec::<String>::new(), "{path}");
    }
}
