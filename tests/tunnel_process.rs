//! `magsteer tunnel` as a process, with a stand-in for the transport's tunnel: what a watching machine
//! refuses, and that neither command leaves anything behind. What passes a real one is tried by
//! `tests/scripts/two_machines.py`.

mod process_support;

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use process_support::{Process, World, until};
use rustix::process::Signal;

/// What the transport's tunnel is called.
const PROGRAM: &str = "iox2-link-tunnel-zenoh";
/// Says which version it is; otherwise notes that it runs, and that it was asked to end.
const STAND_IN: &str = "#!/bin/sh\n[ \"$1\" = --version ] && echo 'tunnel 0.10.0' && exit\n\
    trap 'echo > ../ended; exit' TERM\necho > ../began\nwhile :; do sleep 0.01; done\n";
/// Ends at once, as one that finds its port taken does.
const BROKEN: &str = "#!/bin/sh\n[ \"$1\" = --version ] && echo 'tunnel 0.10.0' && exit\nexit 3\n";

/// A program of this text in the world's own folder.
fn program(world: &World, text: &str) -> PathBuf {
    let path = world.root.path().join(PROGRAM);
    fs::write(&path, text).expect("own folder");
    fs::set_permissions(&path, Permissions::from_mode(0o700)).expect("own file");
    path
}

fn tunnel(world: &World, side: &str, program: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["tunnel", side]).arg(&world.file).arg("--root").arg(world.root.path());
    command.arg("--program").arg(program);
    command
}

/// Starts one and waits until its tunnel runs.
fn started(world: &World, side: &str) -> Process {
    let program = program(world, STAND_IN);
    let log = world.root.path().join(format!("{side}.log"));
    let process = Process::spawn(&mut tunnel(world, side, &program), log);
    until(|| world.root.path().join("began").exists().then_some(()), || process.said());
    process
}

fn ask(world: &World, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(words).arg("--root").arg(world.root.path()).arg("--config").arg(&world.file);
    command.output().expect("the program is built")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn watching_machine_refuses_every_command_and_says_why() {
    let world = World::new();
    let watch = started(&world, "watch");
    let target = ["target", "set", "m1=60deg", "m2=90deg"];
    let requests = ["arm", "go", "hold", "retreat", "stop", "reset", "estop"];
    for words in requests.iter().map(std::slice::from_ref).chain([target.as_slice()]) {
        let refused = ask(&world, words);
        assert_eq!(refused.status.code(), Some(1), "{words:?}: {}", said(&refused));
        assert!(said(&refused).contains("only watches the rig"), "{words:?}: {}", said(&refused));
    }
    let deaf = ask(&world, &["status"]);
    assert_eq!(deaf.status.code(), Some(69), "nothing came through: {}", said(&deaf));
    watch.signal(Signal::TERM);
    assert_eq!(watch.wait().code, Some(143));
    assert!(world.root.path().join("ended").exists(), "its tunnel was asked to end");
    assert!(!world.root.path().join("bigmag-planar.tunnel").exists(), "and its files are gone");
    let gone = ask(&world, &["arm"]);
    assert_eq!(gone.status.code(), Some(69), "nobody is in the daemon's place: {}", said(&gone));
}

#[test]
fn rig_is_shared_once_and_its_own_commands_stay() {
    let world = World::new();
    let _plant = world.plant();
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.until(|status| status.state == magsteer_hal::operator::state::IDLE);
    let share = started(&world, "share");
    let second = tunnel(&world, "share", &program(&world, STAND_IN)).output().expect("the program is built");
    assert_eq!(second.status.code(), Some(69), "{}", said(&second));
    assert!(said(&second).contains("already has a tunnel"), "{}", said(&second));
    let beside = tunnel(&world, "watch", &program(&world, STAND_IN)).output().expect("the program is built");
    assert_eq!(beside.status.code(), Some(69), "a rig does not watch itself: {}", said(&beside));
    let shown = ask(&world, &["status", "--json"]);
    let status: serde_json::Value = serde_json::from_slice(&shown.stdout).expect("an object");
    assert_eq!(status["distant"], false, "{status}");
    operator.steer();
    share.signal(Signal::INT);
    assert_eq!(share.wait().code, Some(130));
    daemon.end();
}

#[test]
fn tunnel_that_is_not_there_or_ends_by_itself_is_told_of() {
    let world = World::new();
    for (program, words) in [
        (world.root.path().join("nowhere"), "cargo install --locked --version 0.10.0"),
        (program(&world, BROKEN), "ended by itself"),
    ] {
        let refused = tunnel(&world, "share", &program).output().expect("the program is built");
        assert_eq!(refused.status.code(), Some(69), "{}", said(&refused));
        assert!(said(&refused).contains(words), "{}", said(&refused));
    }
}
