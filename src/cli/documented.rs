//! Every command that a document shows is one that this program takes, about files that are there.

use std::path::Path;

use clap::Parser;
use clap::error::ErrorKind;

use super::command::Cli;

/// The documents, with the folder from which their commands are given.
const DOCUMENTS: [(&str, &str); 3] = [
    ("README.md", include_str!("../../README.md")),
    ("src/docs/guide.md", include_str!("../docs/guide.md")),
    ("hal/docs/your-driver.md", include_str!("../../hal/docs/your-driver.md")),
];
/// What stands before a command's own words.
const PROGRAMS: [&[&str]; 4] = [
    &["sudo", "-u", "magsteer", "magsteer"],
    &["cargo", "run", "--release", "--"],
    &["target/release/magsteer"],
    &["magsteer"],
];

/// A command of a document: where it stands, and its words.
struct Shown {
    place: String,
    words: Vec<String>,
}

/// The commands of this program in the shell blocks of a document.
fn shown(name: &str, text: &str) -> Vec<Shown> {
    let mut found = Vec::new();
    let mut is_shell = false;
    let mut continued = String::new();
    for (index, line) in text.lines().enumerate() {
        if line.starts_with("```") {
            is_shell = line == "```sh";
            continue;
        }
        if !is_shell {
            continue;
        }
        continued += line.split(" #").next().unwrap_or(line);
        if let Some(begun) = continued.strip_suffix('\\') {
            continued = format!("{begun} ");
            continue;
        }
        let whole = std::mem::take(&mut continued);
        for words in commands(&whole) {
            let program = PROGRAMS.iter().find(|program| words.iter().take(program.len()).eq(program.iter()));
            if let Some(program) = program {
                let place = format!("{name}:{}: {whole}", index + 1);
                found.push(Shown { place, words: words[program.len()..].to_vec() });
            }
        }
    }
    found
}

/// The words of each command on a line of a shell, as far as documents go: quotes, `&&`, `|`, `&`, `>`.
fn commands(line: &str) -> Vec<Vec<String>> {
    let mut commands = vec![Vec::new()];
    let (mut word, mut quote, mut is_word) = (String::new(), None, false);
    let end = |word: &mut String, is_word: &mut bool, commands: &mut Vec<Vec<String>>| {
        if std::mem::take(is_word) {
            commands.last_mut().expect("never empty").push(std::mem::take(word));
        }
    };
    for character in line.chars() {
        match (quote, character) {
            (Some(open), _) if character == open => quote = None,
            (Some(_), _) => word.push(character),
            (None, '\'' | '"') => (quote, is_word) = (Some(character), true),
            (None, '&' | '|' | ';' | '>') => {
                end(&mut word, &mut is_word, &mut commands);
                commands.push(Vec::new());
            }
            (None, ' ') => end(&mut word, &mut is_word, &mut commands),
            (None, _) => {
                word.push(character);
                is_word = true;
            }
        }
    }
    end(&mut word, &mut is_word, &mut commands);
    commands
}

#[test]
fn every_command_shown_is_one_that_this_program_takes() {
    let mut count = 0;
    for (name, text) in DOCUMENTS {
        for Shown { place, words } in shown(name, text) {
            count += 1;
            let line = std::iter::once("magsteer".to_owned()).chain(words.iter().cloned());
            match Cli::try_parse_from(line) {
                Ok(_) => {}
                Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {}
                // Built without it by default.
                Err(_)
                    if words.first().is_some_and(|word| word == "bridge") && !cfg!(feature = "foxglove") => {}
                Err(error) => panic!("{place}\n{error}"),
            }
            let shipped =
                words.iter().filter(|word| word.starts_with("config/") || word.starts_with("tests/"));
            for file in shipped {
                let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
                assert!(path.exists(), "{place}: no {file}");
            }
        }
    }
    assert!(count >= 50, "only {count} commands were found");
}

#[test]
fn commands_are_found_as_a_shell_would() {
    let text = "```sh\nmagsteer arm && magsteer \\\n  target set 'a b' # remark\necho x | magsteer run f &\n```\nmagsteer no\n";
    let words: Vec<_> = shown("here", text).into_iter().map(|shown| shown.words).collect();
    assert_eq!(words, [vec!["arm"], vec!["target", "set", "a b"], vec!["run", "f"]]);
}
