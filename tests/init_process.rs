//! `magsteer init`: a folder that runs as it is, and in which a mistake is pointed at.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

fn magsteer(arguments: &[&str], folder: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(arguments).current_dir(folder).output().expect("the program is built")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn every_system_makes_a_folder_that_is_right_as_it_is_and_is_not_written_over() {
    let folder = tempfile::tempdir().expect("a directory");
    for system in ["bigmag", "bigmag-3d", "bigmag-14"] {
        let made = magsteer(&["init", &format!("my-{system}"), "--system", system], folder.path());
        assert_eq!(made.status.code(), Some(0), "{}", said(&made));
        let file = format!("my-{system}/rig.toml");
        let checked = magsteer(&["check", &file], folder.path());
        assert_eq!(checked.status.code(), Some(0), "{system}: {}", said(&checked));
        let told = String::from_utf8_lossy(&checked.stdout).into_owned();
        assert!(told.contains(&format!("rig my-{system}")), "{told}");
        let own = folder.path().join(&file);
        fs::write(&own, "mine").expect("own directory");
        let again = magsteer(&["init", &format!("my-{system}"), "--system", system], folder.path());
        assert_eq!(again.status.code(), Some(73), "{}", said(&again));
        assert!(said(&again).contains("rig.toml"), "{}", said(&again));
        assert_eq!(fs::read_to_string(&own).expect("still there"), "mine");
    }
    let refused = magsteer(&["init", "My Rig"], folder.path());
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    assert!(!folder.path().join("My Rig").exists());
}

#[test]
fn what_is_mistyped_in_it_is_pointed_at() {
    let folder = tempfile::tempdir().expect("a directory");
    assert_eq!(magsteer(&["init", "my-rig"], folder.path()).status.code(), Some(0));
    let file = folder.path().join("my-rig/rig.toml");
    let text = fs::read_to_string(&file).expect("made");
    fs::write(&file, text + "\n[daemon]\nrate_hzz = 1000.0\n").expect("own directory");
    let checked = magsteer(&["check", "my-rig/rig.toml"], folder.path());
    assert_eq!(checked.status.code(), Some(78));
    let message = said(&checked);
    assert!(message.contains("rig.toml") && message.contains("did you mean `rate_hz`?"), "{message}");
}
