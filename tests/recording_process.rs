//! Recording as an operator meets it: `run --record`, `record`, `runs`, `replay`, and a recorder that is killed.
//!
//! No test judges how long anything took.
#![cfg(all(feature = "sim", feature = "record"))]

mod process_support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use magsteer::recording::{Ending, Recording, recover};
use magsteer_hal::operator::state;
use process_support::{Operator, Process, World, until};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Runs `magsteer` to its end.
fn magsteer(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_magsteer")).args(arguments).output().expect("the program is built")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().expect("plain")
}

/// One JSON object, of a command that ends with a code.
fn ask(arguments: &[&str], code: i32) -> Value {
    let output = magsteer(arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", said(&output));
    serde_json::from_slice(&output.stdout).expect("one object")
}

/// A daemon that records into a folder on the disk.
fn recorded(world: &World, folder: &Path) -> Process {
    let description = "--description=steered by a test";
    Process::start(world, "run", &["--wait-s", "30", "--record", text(folder), description])
}

/// Waits for some more cycles of the loop.
fn let_it_run(operator: &mut Operator, cycles: u64) -> u64 {
    let begin = operator.until(|_| true).cycle;
    operator.until(|status| status.cycle > begin + cycles).cycle
}

/// The daemon's child that records.
fn recorder_of(daemon: &Process) -> Pid {
    let tasks = fs::read_dir(format!("/proc/{}/task", daemon.pid())).expect("it runs");
    let of_task = |task: PathBuf| fs::read_to_string(task.join("children")).unwrap_or_default();
    let children: String = tasks.flatten().map(|task| of_task(task.path())).collect();
    let pid = children.split_whitespace().next().and_then(|pid| pid.parse().ok());
    pid.and_then(Pid::from_raw).expect("a child")
}

/// Goal: from the first cycle to the last, with the run's folder around it; done again bit for bit; another gain
/// is found. Cycles that a machine under load dropped on the way are counted, not hidden.
#[test]
fn a_recorded_run_leaves_a_folder_with_every_cycle_that_replays() {
    let world = World::new();
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let plant = world.plant();
    let daemon = recorded(&world, &run);
    let mut operator = world.operator();
    operator.steer();
    let_it_run(&mut operator, 500);
    // A service manager tells every process of a service at once: the ramp to zero is recorded all the same.
    kill_process(recorder_of(&daemon), Signal::TERM).expect("the recorder runs");
    let end = daemon.end();
    drop(plant);
    assert_eq!(end.code, Some(0), "{}", end.said);
    let shown = ask(&["runs", "show", text(&run), "--json"], 0);
    let ran = end.report["loop"]["cycles"].as_u64().expect("a count");
    let dropped = end.report["records_dropped"].as_u64().expect("a count");
    assert_eq!(shown["cycles"].as_u64().expect("a count") + dropped, ran, "{}", end.said);
    let number = |key: &str| shown[key].as_u64().expect("a count");
    let periods = number("last_cycle") - number("first_cycle") + 1;
    assert_eq!(number("cycles") + number("missed") + number("lost"), periods, "{shown}");
    if dropped == 0 {
        assert_eq!(shown["missed"], end.report["loop"]["missed"], "{shown}");
    }
    assert_eq!((&shown["whole"], &shown["description"]), (&true.into(), &"steered by a test".into()));
    assert_eq!(shown["is_complete"], dropped == 0);
    for name in ["config.toml", "description.txt", "summary.json", "latency.csv"] {
        assert!(run.join(name).is_file(), "{name}");
    }
    let summary = fs::read(run.join("summary.json")).expect("a summary");
    assert_eq!(serde_json::from_slice::<Value>(&summary).expect("one object"), end.report);
    let listed = ask(&["runs", "list", text(folder.path()), "--json"], 0);
    assert_eq!(listed["recordings"][0]["status"], "complete", "{listed}");
    if dropped > 0 {
        println!("{dropped} cycles were dropped by this machine: not replayed");
        return;
    }
    let replayed = ask(&["replay", text(&run), "--check", "--json"], 0);
    assert_eq!((replayed["equal"].as_u64(), &replayed["difference"]), (Some(ran), &Value::Null));
    let gain = "control.disturbance.tracking_per_s=11";
    let other = ask(&["replay", text(&run), "--check", "--set", gain, "--json"], 1);
    assert!(other["difference"]["fields"][0]["field"].as_str().expect("a name").starts_with("command"));
    let wrong = magsteer(&["replay", text(&run), "--set", "control.nothing=1"]);
    assert_eq!(wrong.status.code(), Some(2), "{}", said(&wrong));
    let again = magsteer(&["run", text(&world.file), "--record", text(&run)]);
    assert_eq!(again.status.code(), Some(73), "no recording is written over: {}", said(&again));
}

/// Goal: who started the daemon before the driver finds neither a folder that holds no run, nor one that is
/// taken.
#[test]
fn a_run_that_finds_no_driver_leaves_no_folder_and_can_be_started_again() {
    let world = World::new();
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let root = ["--root", text(world.root.path()), "--wait-s", "0.1"];
    for command in [["run", text(&world.file), "--record"], ["record", text(&world.file), "--out"]] {
        for attempt in 0..2 {
            let mut arguments = command.to_vec();
            arguments.push(text(&run));
            arguments.extend(root);
            let output = magsteer(&arguments);
            assert_eq!(output.status.code(), Some(69), "{command:?}, {attempt}: {}", said(&output));
            assert!(!run.exists(), "{command:?}, {attempt}");
        }
    }
    let own = folder.path().join("notes.txt");
    fs::write(&own, "mine").expect("own directory");
    let mut arguments = vec!["run", text(&world.file), "--record", text(folder.path())];
    arguments.extend(root);
    assert_eq!(magsteer(&arguments).status.code(), Some(69));
    let left = fs::read_dir(folder.path()).expect("still there").flatten();
    assert_eq!(left.map(|entry| entry.path()).collect::<Vec<_>>(), [own], "what was there stays");
}

/// Goal: the loop goes on, the log and the journal say so once, and what was on the disk is made whole.
#[test]
fn a_recorder_that_is_killed_is_noticed_and_leaves_a_recording_that_can_be_mended() {
    let world = World::new();
    let folder = tempfile::tempdir().expect("a folder");
    let plant = world.plant();
    let daemon = recorded(&world, folder.path());
    let mut operator = world.operator();
    operator.steer();
    let_it_run(&mut operator, 1_500);
    kill_process(recorder_of(&daemon), Signal::KILL).expect("the recorder runs");
    let cut = folder.path().join("recording.mcap");
    let words = "the recorder ended with signal: 9";
    until(|| daemon.said().contains(words).then_some(()), || daemon.said());
    let_it_run(&mut operator, 200);
    let end = daemon.end();
    drop(plant);
    assert_eq!(end.code, Some(0), "{}", end.said);
    assert_eq!(end.said.matches("the recorder ended").count(), 1, "{}", end.said);
    let journal = magsteer(&["events", text(&world.recordings())]);
    assert!(String::from_utf8_lossy(&journal.stdout).contains("recording-lost"), "{}", said(&journal));
    let before = fs::read(&cut).expect("what was written");
    let mended = folder.path().join("mended.mcap");
    assert!(!recover(&cut, &mended).expect("its head is whole").was_whole);
    assert_eq!(fs::read(&cut).expect("still there"), before);
    let counts = Recording::open(&mended).expect("whole").counts().expect("whole");
    assert_eq!((counts.ending, counts.holes, counts.is_complete), (Ending::Whole, 0, None));
    assert!(counts.first_number < 1_000 && counts.cycles > 500, "{counts:?}");
}

/// Goal: `record` attaches to a daemon that runs, ends with its loop, and says that the begin is missing; a rig's
/// other configuration is refused.
#[test]
fn a_daemon_that_runs_is_recorded_from_then_on() {
    let world = World::new();
    let folder = tempfile::tempdir().expect("a folder");
    let (plant, daemon) = (world.plant(), world.daemon());
    let mut operator = world.operator();
    operator.until(|status| status.state == state::IDLE);
    let root = ["--root", text(world.root.path())];
    let start = |file: &Path, out: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.args(["record", text(file), "--json", "--out"]).arg(folder.path().join(out)).args(root);
        Process::spawn(&mut command, folder.path().join(format!("{out}.log")))
    };
    let other = world.file.with_file_name("bigmag-planar-camera.toml");
    let other = start(&other, "other").wait();
    assert_eq!(other.code, Some(65), "{}", other.said);
    let recorder = start(&world.file, "own");
    until(|| recorder.said().contains("recording to").then_some(()), || recorder.said());
    let_it_run(&mut operator, 300);
    drop(daemon.end());
    drop(plant);
    let end = recorder.wait();
    assert!(matches!(end.code, Some(0 | 1)), "{}", end.said);
    assert_eq!((&end.report["ended"], &end.report["is_complete"]), (&"loop-ended".into(), &false.into()));
    let recording = folder.path().join("own");
    let counts = Recording::open(&recording).expect("a recording").counts().expect("whole");
    assert_eq!(Some(counts.cycles), end.report["cycles"].as_u64());
    assert!(counts.first_number > 0 && counts.cycles >= 300, "{counts:?}");
    let replayed = magsteer(&["replay", text(&recording), "--check"]);
    assert_eq!(replayed.status.code(), Some(65), "{}", said(&replayed));
    assert!(said(&replayed).contains("after the run did"), "{}", said(&replayed));
}
