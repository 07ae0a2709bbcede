//! Goal: `doctor --clean` clears away what a killed process left and touches nothing that lives, a stopped
//! process included; its JSON has the published keys.
#![cfg(feature = "sim")]

mod process_support;

use std::fs::Permissions;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

use magsteer_hal::operator::state;
use process_support::{World, until};
use rustix::process::Signal;
use serde_json::Value;

/// Runs the doctor on a root, without measuring.
fn doctor(root: &Path, arguments: &[&str]) -> (Output, Value) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let command = command.args(["doctor", "--json", "--seconds", "0", "--root"]).arg(root).args(arguments);
    let output = command.output().expect("the program is built");
    let answer = serde_json::from_slice(&output.stdout).unwrap_or(Value::Null);
    (output, answer)
}

fn finding<'a>(answer: &'a Value, check: &str) -> &'a Value {
    let findings = answer["findings"].as_array().expect("an array");
    findings.iter().find(|finding| finding["check"] == check).unwrap_or_else(|| panic!("{check} in {answer}"))
}

#[test]
fn what_a_killed_daemon_left_goes_and_a_living_plant_and_daemon_steer_on() {
    let world = World::new();
    let plant = world.plant();
    let killed = world.daemon();
    let killed_pid = killed.pid();
    world.operator().until_state(state::IDLE);
    killed.kill();

    let (_, before) = doctor(world.root.path(), &[]);
    assert_eq!(finding(&before, "leftovers")["level"], "WARN", "{before}");
    assert_eq!(before["cleared"], Value::Null, "it only looked");
    let (_, cleaned) = doctor(world.root.path(), &["--clean"]);
    let processes = cleaned["cleared"]["processes"].as_array().expect("an array");
    assert!(!processes.is_empty() && processes.iter().all(|pid| *pid == killed_pid), "{cleaned}");
    assert_eq!(cleaned["cleared"]["failed"], serde_json::json!([]));
    assert_eq!(finding(&cleaned, "leftovers")["level"], "PASS", "{cleaned}");
    let locks = cleaned["cleared"]["lock_files"].to_string();
    assert!(locks.contains(".daemon.lock") && !locks.contains("driver"), "{cleaned}");

    // The living plant meets a daemon as ever; both go on while the doctor cleans beside them.
    let mut daemon = world.daemon();
    let mut operator = world.operator();
    let begun = operator.steer();
    let (_, beside) = doctor(world.root.path(), &["--clean"]);
    assert_eq!(beside["cleared"]["processes"], serde_json::json!([]), "{beside}");
    assert_eq!(beside["cleared"]["lock_files"], serde_json::json!([]), "{beside}");
    let found = finding(&beside, "leftovers")["found"].as_str().expect("text").to_owned();
    for process in [&plant, &daemon] {
        assert!(found.contains(&format!("process {}", process.pid())), "{found}");
    }
    assert!(
        finding(&beside, "running daemon")["found"].as_str().is_some_and(|it| it.contains("magsteer-loop"))
    );
    operator.until(|status| status.cycle > begun.cycle + 200);
    assert!(daemon.runs());
    daemon.end();
    plant.end();
}

/// Goal: a process that is held up, by a debugger or a full machine, is not dead.
#[test]
fn a_stopped_process_is_left_alone() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    world.operator().until_state(state::IDLE);
    plant.signal(Signal::STOP);
    until(
        || {
            let stat = std::fs::read_to_string(format!("/proc/{}/stat", plant.pid())).ok()?;
            stat.rsplit_once(") ")?.1.starts_with('T').then_some(())
        },
        || "not stopped".to_owned(),
    );
    let (_, answer) = doctor(world.root.path(), &["--clean"]);
    assert_eq!(answer["cleared"]["processes"], serde_json::json!([]), "{answer}");
    plant.signal(Signal::CONT);
    let mut operator = world.operator();
    operator.steer();
    daemon.end();
    plant.end();
}

#[test]
fn the_answer_has_the_published_keys_and_the_exit_code_follows_from_it() {
    let mut builder = tempfile::Builder::new();
    // Channels are for one user only.
    let root = builder.permissions(Permissions::from_mode(0o700)).tempdir().expect("a directory");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/config/bigmag-planar.toml");
    let output = Command::new(env!("CARGO_BIN_EXE_magsteer"))
        .args(["doctor", file, "--json", "--seconds", "0.1", "--root"])
        .arg(root.path())
        .output()
        .expect("the program is built");
    let answer: Value = serde_json::from_slice(&output.stdout).expect("one object");
    let findings = answer["findings"].as_array().expect("an array");
    let fails = findings.iter().any(|finding| finding["level"] == "FAIL");
    assert_eq!(answer["ok"], !fails, "{answer}");
    assert_eq!(output.status.code(), Some(i32::from(fails)));
    for finding in findings {
        assert!(finding["check"].is_string() && finding["found"].is_string(), "{finding}");
        assert_eq!(finding["mend"].is_string(), finding["level"] != "PASS", "{finding}");
    }
    let checks = [
        "preemption",
        "clock source",
        "throttling",
        "isolated CPUs",
        "governor",
        "priority",
        "locked memory",
    ];
    let more = [
        "idling",
        "swap",
        "shared memory",
        "policy",
        "spin",
        "time limits",
        "leftovers",
        "steal time",
        "wake-ups",
    ];
    for check in checks.into_iter().chain(more) {
        finding(&answer, check);
    }
    let wake_ups = &answer["wake_ups"];
    assert_eq!(wake_ups["rate_hz"], 1_000.0);
    for key in ["cycles", "missed", "lateness_us", "histogram"] {
        assert!(wake_ups.get(key).is_some(), "{key} in {answer}");
    }
    assert!(wake_ups["lateness_us"]["p99"].is_number(), "{answer}");
}
