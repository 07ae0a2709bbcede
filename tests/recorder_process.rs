//! What a daemon leaves behind when it trips, is killed, or cannot write; and the commands that read it.
//!
//! No test judges how long anything took; each waits for a state, bounded only so that a failure ends.
#![cfg(feature = "sim")]

mod process_support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use magsteer::daemon::recorder::{Ending, Flight};
use magsteer_hal::operator::{Cause, recorder, state, verb};
use process_support::{Operator, Process, World, current, until};
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

/// One JSON object, of a command that must succeed.
fn ask(arguments: &[&str]) -> Value {
    let output = magsteer(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", said(&output));
    serde_json::from_slice(&output.stdout).expect("one object")
}

/// The journal of a folder; no lines before it is there.
fn events(folder: &Path) -> Vec<Value> {
    let output = magsteer(&["events", text(folder), "--json"]);
    assert!(matches!(output.status.code(), Some(0 | 66)), "{}", said(&output));
    let lines = String::from_utf8(output.stdout).expect("text");
    lines.lines().map(|line| serde_json::from_str(line).expect("one object a line")).collect()
}

/// The flights of a folder, once there are so many.
fn flights(folder: &Path, count: usize) -> Vec<Value> {
    let list = || {
        let output = magsteer(&["runs", "list", text(folder), "--json"]);
        let answer: Value = serde_json::from_slice(&output.stdout).ok()?;
        let flights = answer["flights"].as_array()?.clone();
        let complete = flights.iter().all(|flight| flight["status"] == "complete");
        (flights.len() == count && complete).then_some(flights)
    };
    until(list, || format!("not {count} flights in {}", folder.display()))
}

/// Switches poses off until the daemon has latched that.
fn trip(world: &World, operator: &mut Operator) {
    let arguments = ["fault", "poses", "off", "--root", text(world.root.path())];
    until(|| (magsteer(&arguments).status.code() == Some(0)).then_some(()), || "no answer".to_owned());
    let status = operator.until(|status| status.state == state::FAULT && current(status) < 0.1);
    assert_eq!(status.cause, Cause::PoseStale.code());
}

/// Goal: after a fault the flight is there, with the tripping cycle and the time before it, and both commands
/// say why.
#[test]
fn a_fault_leaves_a_flight_and_a_journal_that_say_why() {
    let world = World::new();
    let plant = Process::start(&world, "sim-plant", &["--allow-faults"]);
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    trip(&world, &mut operator);
    let folder = world.recordings();
    let listed = flights(&folder, 1).remove(0);
    assert_eq!((&listed["reason"], &listed["cause_code"]), (&"safe-stop".into(), &200.into()), "{listed}");
    let file = PathBuf::from(listed["file"].as_str().expect("a path"));
    let (csv, picture) = (folder.join("flight.csv"), folder.join("flight.png"));
    let shown = ask(&["runs", "show", text(&file), "--json", "--csv", text(&csv)]);
    assert_eq!(shown["cause"], "no fresh poses", "{shown}");
    assert_eq!((&shown["to"], &shown["complete"]), (&"safe-stop".into(), &true.into()));
    assert_eq!(shown["rig"], world.config.description.rig.as_str());
    let rows = shown["rows"].as_array().expect("rows");
    let trip = rows.iter().find(|row| row["cycle"] == shown["trigger_cycle"]).expect("the cycle of the trip");
    let age = trip["pose_age_ms"].as_f64().expect("poses came before");
    let limit = world.config.daemon.as_ref().expect("shipped").pose_stop_ms;
    assert!(age >= limit, "{age} ms of at least {limit} ms");
    assert!(shown["span_s"][0].as_f64().expect("records") < -0.25, "the time before: {}", shown["span_s"]);
    assert!(shown["span_s"][1].as_f64().expect("records") >= 0.5, "the time after: {}", shown["span_s"]);
    assert_eq!(
        fs::read_to_string(&csv).expect("written").lines().count() as u64,
        1 + shown["records"].as_u64().expect("a count")
    );
    if cfg!(feature = "figures") {
        let drawn = magsteer(&["runs", "show", text(&file), "--around", "0.5", "--picture", text(&picture)]);
        assert_eq!(drawn.status.code(), Some(0), "{}", said(&drawn));
        assert!(fs::read(&picture).expect("drawn").starts_with(b"\x89PNG"));
        let told = String::from_utf8(drawn.stdout).expect("text");
        assert!(told.contains("-> safe-stop: no fresh poses (cause 200)"), "{told}");
        assert!(told.lines().any(|line| line.starts_with('>')), "the trip is marked: {told}");
    }
    let told = events(&folder);
    let transition = told.iter().find(|it| it["to"] == "safe-stop").expect("told");
    assert_eq!((&transition["cause_code"], &transition["cycle"]), (&200.into(), &shown["trigger_cycle"]));
    assert!(told.iter().any(|it| it["event"] == "flight" && it["file"] == listed["file"]), "{told:?}");
    assert!(daemon.said().contains(text(&file)), "one line says where: {}", daemon.said());
    let last = magsteer(&["events", text(&folder), "--last", "1"]);
    assert_eq!(String::from_utf8(last.stdout).expect("text").lines().count(), 1);
    let end = daemon.end();
    assert_eq!(end.report["flights"][0], listed["file"], "{}", end.report);
    let told = events(&folder);
    assert_eq!(
        (&told[0]["event"], &told.last().expect("events")["event"]),
        (&"start".into(), &"stop".into())
    );
    plant.end();
}

/// Goal: an operator's order is carried out without disturbing a loop that steers; another rig's daemon is
/// not asked.
#[test]
fn an_operator_saves_the_last_seconds_of_a_loop_that_goes_on() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    let save = ["runs", "save", "--root", text(world.root.path())];
    until(|| (magsteer(&save).status.code() == Some(0)).then_some(()), || "no answer".to_owned());
    let saved = flights(&world.recordings(), 1).remove(0);
    assert_eq!((&saved["reason"], &saved["cause_code"]), (&"operator".into(), &0.into()), "{saved}");
    let status = operator.until(|status| status.flights == 1);
    assert_eq!((status.recorder, status.recorder_error), (recorder::RECORDING, 0));
    daemon.end();
    plant.end();
}

/// Goal: SIGKILL loses no line of the journal that was written before.
#[test]
fn a_killed_daemon_leaves_its_journal_readable() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    let folder = world.recordings();
    let steers = || events(&folder).iter().any(|it| it["to"] == "active").then_some(());
    until(steers, || "not told".to_owned());
    daemon.kill();
    let told = events(&folder);
    let states: Vec<&str> = told.iter().filter_map(|it| it["to"].as_str()).collect();
    assert!(states.starts_with(&["idle", "armed", "active"]), "{told:?}");
    assert!(told.iter().all(|it| it["event"] != "stop"));
    plant.end();
}

/// Goal: without a folder to write to, and with nobody who reads what it says, the daemon steers, trips, is
/// reset and steers again; the status warns, and says what the system says.
#[test]
fn a_daemon_that_cannot_write_anywhere_steers_and_warns() {
    let world = World::new();
    let plant = Process::start(&world, "sim-plant", &["--allow-faults"]);
    let in_the_way = world.root.path().join("file");
    fs::write(&in_the_way, "").expect("own directory");
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["run", text(&world.file), "--wait-s", "30", "--root", text(world.root.path())]);
    command.arg("--flights").arg(in_the_way.join("below")).arg("--end-with-stdin");
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut daemon = command.spawn().expect("the program is built");
    // Broken pipes from its first word on.
    drop((daemon.stdout.take(), daemon.stderr.take()));
    let mut operator = world.operator();
    operator.steer();
    trip(&world, &mut operator);
    let status = operator.until(|status| status.recorder == recorder::FAILING);
    assert_eq!(status.recorder_error, libc::ENOTDIR.unsigned_abs());
    let shown = ask(&["status", "--json", "--root", text(world.root.path())]);
    assert_eq!(shown["recorder"], "failing", "{shown}");
    assert!(shown["recorder_error"].as_str().is_some_and(|it| it.contains("Not a directory")), "{shown}");
    let clear = ["fault", "clear", "--root", text(world.root.path())];
    until(|| (magsteer(&clear).status.code() == Some(0)).then_some(()), || "no answer".to_owned());
    operator.steer();
    // What waited in memory is written as soon as the way is free.
    fs::remove_file(&in_the_way).expect("own directory");
    let flight = flights(&in_the_way.join("below"), 1).remove(0);
    assert_eq!(flight["cause_code"], Cause::PoseStale.code());
    operator.ask(verb::STOP);
    operator.until_state(state::IDLE);
    drop(daemon.stdin.take());
    daemon.wait().expect("a child");
    plant.end();
}

/// A flight and its bytes, of a daemon without a plant to speak of.
fn some_flight(world: &World) -> PathBuf {
    let plant = world.plant();
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    operator.ask(verb::ESTOP);
    operator.until_state(state::FAULT);
    let file = flights(&world.recordings(), 1).remove(0)["file"].as_str().expect("a path").into();
    daemon.end();
    plant.end();
    file
}

/// Goal: what cannot be read is told in one line, with the exit code of its kind; a damaged file is shown as
/// far as it goes.
#[test]
fn what_cannot_be_read_is_told_in_one_line_and_by_its_exit_code() {
    let world = World::new();
    let file = some_flight(&world);
    let bytes = fs::read(&file).expect("there");
    let other = world.root.path().join("other.flight");
    let mut newer = bytes.clone();
    newer[8] = 9;
    let mut flipped = bytes.clone();
    let middle = bytes.len() / 2;
    flipped[middle] ^= 1;
    let cases: [(&[u8], i32, &str); 5] = [
        (b"speed,angle\n", 65, "is not a flight"),
        (&newer, 65, "is a flight of version 9; this program reads version 1"),
        (&bytes[..100], 65, "its header is damaged: cut short"),
        (&bytes[..middle], 65, "cut short in what begins at byte"),
        (&flipped, 65, "damaged in what begins at byte"),
    ];
    for (content, code, expected) in cases {
        fs::write(&other, content).expect("own directory");
        let output = magsteer(&["runs", "show", text(&other), "--json"]);
        assert_eq!(output.status.code(), Some(code), "{expected}: {}", said(&output));
        let words = said(&output);
        assert!(words.contains(expected) && words.lines().count() == 1, "{expected}: {words}");
    }
    let shown: Value =
        serde_json::from_slice(&magsteer(&["runs", "show", text(&other), "--json"]).stdout).expect("shown");
    assert_eq!(shown["complete"], false);
    assert!(shown["records"].as_u64().expect("a count") > 0 && !shown["damage"].is_null(), "{shown}");
    assert!(matches!(Flight::read(&other).expect("a head").ending, Ending::Damaged { .. }));
    let missing = magsteer(&["runs", "show", "no-such.flight"]);
    assert_eq!(missing.status.code(), Some(66), "{}", said(&missing));
    for arguments in [["events", "no-such-folder"], ["events", "src"]] {
        assert_eq!(magsteer(&arguments).status.code(), Some(66), "{arguments:?}");
    }
    assert_eq!(magsteer(&["runs", "list", "no-such-folder"]).status.code(), Some(66));
    assert_eq!(magsteer(&["runs", "show", text(&file), "--around", "-1"]).status.code(), Some(2));
    let nowhere = magsteer(&["runs", "show", text(&file), "--csv", "/dev/full"]);
    assert_eq!(nowhere.status.code(), Some(74), "{}", said(&nowhere));
    let nowhere = magsteer(&["runs", "show", text(&file), "--csv", "no-such-folder/a.csv"]);
    assert_eq!(nowhere.status.code(), Some(73), "{}", said(&nowhere));
}

#[test]
fn a_follower_prints_what_comes_until_it_is_interrupted() {
    let world = World::new();
    let folder = world.recordings();
    fs::create_dir(&folder).expect("own directory");
    let log = world.root.path().join("follower.log");
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["events", text(&folder), "--follow", "--json"]).stdin(Stdio::null());
    let mut follower =
        command.stdout(fs::File::create(&log).expect("own directory")).spawn().expect("the program is built");
    let plant = world.plant();
    let daemon = world.daemon();
    let printed = || fs::read_to_string(&log).expect("own directory");
    until(|| printed().contains("\"to\":\"idle\"").then_some(()), printed);
    daemon.end();
    until(|| printed().contains("\"event\":\"stop\"").then_some(()), printed);
    kill_process(Pid::from_child(&follower), Signal::INT).expect("it runs");
    assert_eq!(follower.wait().expect("a child").code(), Some(130));
    plant.end();
}
