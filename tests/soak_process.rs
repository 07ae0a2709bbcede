//! Soaks of some seconds: they pass, break, recover and are broken off, and whatever happens coils end at
//! zero.
//!
//! No test judges a time: how late a shared machine lets a loop be is not this program's affair.
#![cfg(feature = "sim")]

mod process_support;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use magsteer::daemon::recorder::Flight;
use magsteer_hal::operator::state;
use process_support::{Process, World, current, until};
use rustix::process::Signal;
use serde_json::Value;

/// Steps that are over quickly, from where the rod rests.
const EXPERIMENT: &str = r#"
description = "Both magnets back and forth"
axis = [0.0, 1.0, 0.0]
zero_direction = [0.0, 0.0, 1.0]

[[steps]]
target_deg = { m1 = 90.0, m2 = 90.0 }
duration_s = 1.0

[[steps]]
target_deg = { m1 = 80.0, m2 = 80.0 }
duration_s = 1.0
"#;

const PLAN: &str = r#"
description = "Poses away for long enough to trip"

[[faults]]
at_s = 3.0
for_s = 1.0
target = "poses"
verb = "off"
"#;

/// The keys that other programs read.
const STABLE: [&str; 8] =
    ["passed", "hours", "cycles", "missed", "lateness_us", "rss_growth_mb", "alloc_in_cycle", "broken"];

/// A soak of the shipped rig in a folder of this world's own.
fn soak(world: &World, arguments: &[&str]) -> (Command, PathBuf) {
    let folder = world.root.path().join("soak");
    let experiment = world.root.path().join("experiment.toml");
    fs::write(&experiment, EXPERIMENT).expect("own directory");
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.arg("soak").arg(&world.file).arg("--experiment").arg(experiment);
    command.arg("--out").arg(&folder).args(arguments);
    (command, folder)
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The last line printed, which the folder holds too.
fn last_line(output: &Output, folder: &Path) -> Value {
    let printed = String::from_utf8(output.stdout.clone()).expect("text");
    let last = printed.lines().last().unwrap_or_else(|| panic!("nothing printed: {}", said(output)));
    let kept = fs::read_to_string(folder.join("soak.jsonl")).expect("written");
    assert_eq!(kept.lines().last(), Some(last));
    serde_json::from_str(last).expect("one object a line")
}

fn report(folder: &Path) -> Value {
    let text = fs::read_to_string(folder.join("report.json")).expect("written");
    serde_json::from_str(&text).expect("one object")
}

/// Goal: a soak that nothing breaks ends with 0, and leaves what other programs and people read.
#[test]
fn a_soak_that_holds_its_thresholds_passes_and_leaves_its_report() {
    let world = World::new();
    let (mut command, folder) = soak(
        &world,
        &["--minutes", "0.1", "--load", "1", "--fail-on", "alloc_in_cycle>0,trips>0,cycles<10", "--json"],
    );
    let output = command.output().expect("the program is built");
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}\n{}",
        said(&output),
        String::from_utf8_lossy(&output.stdout)
    );
    let begin: Vec<String> = said(&output).lines().take(2).map(str::to_owned).collect();
    assert!(
        begin[0].contains("for 0:00:06") && begin[0].contains(folder.to_str().expect("plain")),
        "{begin:?}"
    );
    assert!(begin[1].contains("alloc_in_cycle>0, trips>0, cycles<10"), "{begin:?}");
    let last = last_line(&output, &folder);
    for key in STABLE {
        assert!(!last[key].is_null(), "{key} of {last}");
    }
    for quantile in ["p50", "p99", "p999", "p9999", "max"] {
        assert!(last["lateness_us"][quantile].is_number(), "{quantile} of {last}");
    }
    assert_eq!((&last["passed"], &last["broken"]), (&true.into(), &Value::Array(Vec::new())));
    let steps = ["settled", "unsettled"].map(|key| last[key].as_u64().expect("a count"));
    assert!(steps.iter().sum::<u64>() >= 4, "six seconds of steps of a second: {last}");
    let report = report(&folder);
    let thresholds = report["thresholds"].as_array().expect("three");
    assert!(thresholds.len() == 3 && thresholds.iter().all(|it| it["held"] == true), "{thresholds:?}");
    assert!(report["machine"]["kernel"].is_string() && report["daemon"]["realtime"]["items"].is_array());
    assert_eq!(report["plant"]["ended_currentless"], true);
    let bins = report["daemon"]["histograms"]["lateness_us"].as_array().expect("bins");
    let binned: u64 = bins.iter().map(|bin| bin["cycles"].as_u64().expect("a count")).sum();
    assert_eq!(Some(binned), report["daemon"]["loop"]["cycles"].as_u64());
    let words = fs::read_to_string(folder.join("report.md")).expect("written");
    assert!(words.starts_with("# Soak: passed") && words.contains("`trips>0`"), "{words}");
    if cfg!(feature = "figures") {
        assert!(fs::read(folder.join("histograms.png")).expect("drawn").starts_with(b"\x89PNG"));
    }
}

/// Goal: the first broken threshold leaves the cycles about it on disk, and code 1.
#[test]
fn a_broken_threshold_saves_the_last_seconds_and_ends_with_one() {
    let world = World::new();
    let (mut command, folder) = soak(&world, &["--minutes", "600", "--fail-on", "cycles>10", "--json"]);
    let output = command.output().expect("the program is built");
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let last = last_line(&output, &folder);
    let broken = last["broken"][0].as_str().expect("one").to_owned();
    assert!(last["passed"] == false && broken.starts_with("cycles>10: "), "{last}");
    let cycles = last["cycles"].as_u64().expect("a count");
    assert!(cycles < 30_000, "not waited for until the minute is over: {cycles}");
    let flight = PathBuf::from(last["flights"][0].as_str().expect("one"));
    let flight = Flight::read(&flight).expect("whole");
    assert_eq!((flight.header.reason.name(), flight.ending.words()), ("operator", None));
    let report = report(&folder);
    assert_eq!(report["thresholds"][0]["held"], false);
    assert_eq!(report["plant"]["ended_currentless"], true);
}

/// Goal: with a plan of faults a trip is counted with its cause, and steered on from; the threshold decides.
#[test]
fn a_trip_by_a_planned_fault_is_counted_and_recovered_from() {
    let world = World::new();
    let plan = world.root.path().join("plan.toml");
    fs::write(&plan, PLAN).expect("own directory");
    let plan = plan.to_str().expect("plain");
    let (mut command, folder) = soak(&world, &["--minutes", "0.15", "--fault-plan", plan, "--json"]);
    let output = command.output().expect("the program is built");
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let last = last_line(&output, &folder);
    assert!(last["trips"].as_u64() >= Some(1), "{last}");
    assert!(last["causes"]["no fresh poses"].as_u64() >= Some(1), "{last}");
    let log = fs::read_to_string(folder.join("run.log")).expect("the daemon's words");
    assert!(log.matches("armed -> active").count() >= 2, "{log}");
}

/// Goal: a daemon that was there before is soaked, left at rest, and goes on.
#[test]
fn a_daemon_that_runs_is_soaked_and_left_at_rest() {
    let world = World::new();
    let plant = world.plant();
    let mut daemon = world.daemon();
    let mut operator = world.operator();
    operator.until_state(state::IDLE);
    let root = world.root.path().to_str().expect("plain");
    let (mut command, folder) =
        soak(&world, &["--minutes", "0.05", "--attach", "--root", root, "--fail-on", "rss_mb>1e5", "--json"]);
    let output = command.output().expect("the program is built");
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(last_line(&output, &folder)["cycles"].as_u64() > Some(10));
    assert!(report(&folder)["daemon"].is_null());
    operator.until(|status| status.state == state::IDLE && current(status) < 0.1);
    assert!(daemon.runs());
    daemon.end();
    plant.end();
}

/// Goal: a signal ramps down, and what was measured by then is told.
#[test]
fn an_interrupted_soak_ramps_down_and_tells_what_it_measured() {
    let world = World::new();
    let (mut command, folder) = soak(&world, &["--hours", "1", "--json"]);
    let soak = Process::spawn(&mut command, world.root.path().join("soak.log"));
    let log = folder.join("run.log");
    let steers = || fs::read_to_string(&log).is_ok_and(|log| log.contains("armed -> active"));
    until(|| steers().then_some(()), || "not steering".to_owned());
    std::thread::sleep(std::time::Duration::from_millis(500));
    soak.signal(Signal::TERM);
    let end = soak.wait();
    assert_eq!(end.code, Some(143), "{}", end.said);
    assert_eq!((&end.report["passed"], &end.report["broken"][0]), (&false.into(), &"interrupted".into()));
    assert_eq!(report(&folder)["plant"]["ended_currentless"], true);
}

/// Goal: what cannot be judged is refused before anything starts.
#[test]
fn a_wrong_command_line_starts_nothing() {
    let world = World::beside();
    for (arguments, part) in [
        (vec!["--minutes", "1", "--fail-on", "mised>0"], "known are"),
        (vec!["--minutes", "1", "--fail-on", "missed>x"], "number"),
        (vec!["--minutes", "1", "--fail-on", "missed>0,"], "empty"),
        (vec!["--minutes", "0"], "must be a number > 0"),
        (vec!["--minutes", "1", "--hours", "1"], "cannot be used"),
        (vec![], "--hours"),
        (vec!["--minutes", "1", "--attach", "--fault-plan", "x"], "cannot be used"),
        (vec!["--minutes", "1", "--root", "x"], "--attach"),
    ] {
        let (mut command, folder) = soak(&world, &arguments);
        let output = command.output().expect("the program is built");
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(part), "{arguments:?}: {}", said(&output));
        assert!(!folder.exists(), "{arguments:?}");
    }
    let plan = world.root.path().join("plan.toml");
    fs::write(&plan, PLAN.replace("poses", "noses")).expect("own directory");
    let (mut command, folder) =
        soak(&world, &["--minutes", "1", "--fault-plan", plan.to_str().expect("plain")]);
    let output = command.output().expect("the program is built");
    assert_eq!(output.status.code(), Some(65), "{}", said(&output));
    assert!(!folder.exists());
}
