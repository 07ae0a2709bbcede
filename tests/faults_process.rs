//! Faults by script between processes: the flag, the plan and the command, over shared memory.
//!
//! No test judges how long anything took; each waits for a state, bounded only so that a failure ends.
#![cfg(feature = "sim")]

mod process_support;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use magsteer_hal::operator::{Cause, state, verb};
use process_support::{Process, World, current, until};
use serde_json::Value;

/// A coil that carries less counts as being at rest, A: `ramp_done_a` of the configuration.
const REST: f64 = 0.1;

/// Runs `magsteer` to its end, on the world's channels.
fn magsteer(world: &World, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(arguments).arg("--root").arg(world.root.path()).output().expect("the program is built")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A plan in the world's own directory.
fn plan(world: &World, text: &str) -> PathBuf {
    let path = world.root.path().join("plan.toml");
    std::fs::write(&path, text).expect("own directory");
    path
}

/// Asks for a fault until the driver answers: a starved machine may answer late.
fn insist(world: &World, arguments: &[&str]) -> Value {
    let answered = || {
        let output = magsteer(world, &[&["fault"], arguments, &["--json"]].concat());
        let done = output.status.code() == Some(0);
        done.then(|| serde_json::from_slice(&output.stdout).expect("one object"))
    };
    until(answered, || format!("{arguments:?} is not answered"))
}

/// Goal: after a fault on command the daemon stops and latches its cause; a reset is refused until the fault
/// is cleared, and then the loop steers again. The driver tells of the fault and counts it.
#[test]
fn poses_switched_off_on_command_stop_the_loop_until_cleared_and_reset() {
    let world = World::new();
    let plant = Process::start(&world, "sim-plant", &["--allow-faults"]);
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    let answer = insist(&world, &["poses", "off"]);
    assert_eq!((&answer["accepted"], &answer["reason"]), (&Value::Bool(true), &Value::Null), "{answer}");
    let status = operator.until(|status| status.state == state::FAULT && current(status) < REST);
    assert_eq!(status.cause, Cause::PoseStale.code());
    operator.ask(verb::RESET);
    assert_eq!(operator.until(|status| status.state == state::FAULT).cause, Cause::PoseStale.code());
    assert_eq!(insist(&world, &["clear"])["cleared"], 1);
    operator.until(|status| status.state == state::FAULT && status.pose_age_us < 50e3);
    operator.steer();
    assert_eq!(daemon.end().code, Some(0));
    let end = plant.end();
    assert_eq!(end.code, Some(0), "{}", end.said);
    let faults = &end.report["faults"];
    assert_eq!((&faults["begun"], &faults["ended"]), (&1.into(), &1.into()), "{}", end.report);
    assert!(faults["poses_withheld"].as_u64().is_some_and(|count| count > 10), "{}", end.report);
    for line in ["faults are allowed", "fault begins", "fault ends", "poses: off"] {
        assert!(end.said.contains(line), "{line:?} in {}", end.said);
    }
    assert_eq!(end.report["limit_breaks"], 0);
}

#[test]
fn commands_repeated_end_authority_and_the_plant_ramps_down_alone() {
    let world = World::new();
    let plant = Process::start(&world, "sim-plant", &["--allow-faults"]);
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    insist(&world, &["actuators", "repeated", "--for", "1"]);
    let status = operator.until(|status| status.state == state::FAULT && current(status) < REST);
    assert_eq!(status.cause, Cause::AuthorityLost.code());
    daemon.end();
    let end = plant.end();
    assert!(end.report["ramp_down_ms"].as_f64().is_some_and(|time| time > 0.0), "{}", end.report);
    assert!(end.report["commands_refused"].as_u64().is_some_and(|count| count > 10), "{}", end.report);
    assert!(end.report["faults"]["commands_altered"].as_u64().is_some_and(|count| count > 10));
}

#[test]
fn a_plan_runs_by_itself_and_is_told_and_counted() {
    let world = World::new();
    let path = plan(
        &world,
        "description = 'two'\n\n[[faults]]\nat_s = 0.2\nfor_s = 0.1\ntarget = 'poses'\nverb = 'slow'\nrate_hz = 20.0\n\n\
         [[faults]]\nat_s = 0.3\nfor_s = 0.2\ntarget = 'coil'\ncoil = 'air-top'\nverb = 'open'\n",
    );
    let path = path.to_str().expect("plain");
    let plant = Process::start(&world, "sim-plant", &["--allow-faults", "--fault-plan", path]);
    until(|| plant.said().contains("fault ends at").then_some(()), || plant.said());
    until(|| (plant.said().matches("fault ends at").count() == 2).then_some(()), || plant.said());
    let end = plant.end();
    assert_eq!((&end.report["faults"]["begun"], &end.report["faults"]["ended"]), (&2.into(), &2.into()));
    assert!(end.said.contains("poses: slow (20 Hz)") && end.said.contains("coil 5: open"), "{}", end.said);
}

#[test]
fn a_plan_without_the_flag_is_a_mistake_of_usage() {
    let world = World::new();
    let file = world.file.to_str().expect("plain");
    let path = plan(&world, "description = ''\nfaults = []\n");
    let output = magsteer(&world, &["sim-plant", file, "--fault-plan", path.to_str().expect("plain")]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("--allow-faults"), "{}", said(&output));
}

#[test]
fn plans_with_mistakes_are_refused_with_place_value_and_what_would_be_right() {
    let world = World::new();
    let file = world.file.to_str().expect("plain");
    let right = "description = ''\n[[faults]]\nat_s = 1.0\nfor_s = 2.0\ntarget = 'poses'\nverb = 'delayed'\ndelay_ms = 80.0\n";
    let cases = [
        ("at_s = 1.0", "at_s = -1.0", "plan.toml:3:8: faults[0].at_s = -1: must be from 0"),
        ("for_s = 2.0", "for_s = 0.0", "plan.toml:4:9: faults[0].for_s = 0: must be above 0"),
        ("for_s = 2.0\n", "", "faults[0].for_s = missing: must be a time in s, or lasting = true"),
        ("'poses'", "'pose'", "plan.toml:5:10: faults[0].target = 'pose': must be one of"),
        ("'delayed'", "'delay'", "plan.toml:6:8: faults[0].verb = 'delay': must be one of"),
        ("'delayed'", "'open'", "plan.toml:6:8: faults[0].verb = open: must be one that applies to poses"),
        ("80.0", "2000.0", "plan.toml:7:12: faults[0].delay_ms = 2000: must be from 1 to 1000"),
        ("delay_ms = 80.0", "rate_hz = 80.0", "plan.toml:7:11: faults[0].rate_hz = given: must be left out"),
        ("delay_ms = 80.0", "delay = 80.0", "plan.toml:7:1: faults[0].delay = 80.0: unknown key"),
        (
            "verb = 'delayed'",
            "verb = 'delayed'\nmagnet = 'm3'",
            "faults[0].magnet = \"m3\": must be the name of a magnet",
        ),
    ];
    for (old, new, expected) in cases {
        assert!(right.contains(old));
        let path = plan(&world, &right.replace(old, new));
        let arguments = ["sim-plant", file, "--allow-faults", "--fault-plan", path.to_str().expect("plain")];
        let output = magsteer(&world, &arguments);
        assert_eq!(output.status.code(), Some(65), "{new}: {}", said(&output));
        assert!(said(&output).contains(expected), "{new}: {expected:?} in {}", said(&output));
        assert!(said(&output).contains('^'), "{new}: a caret in {}", said(&output));
    }
    let missing = ["sim-plant", file, "--allow-faults", "--fault-plan", "no-such-plan.toml"];
    assert_eq!(magsteer(&world, &missing).status.code(), Some(66));
}

#[test]
fn drivers_that_do_not_allow_faults_are_told_from_those_that_are_not_there() {
    let world = World::new();
    let output = magsteer(&world, &["fault", "poses", "off"]);
    assert_eq!(output.status.code(), Some(69), "{}", said(&output));
    assert!(said(&output).contains("no driver on rig bigmag-planar"), "{}", said(&output));
    let mut plant = world.plant();
    until(|| plant.said().contains("is running").then_some(()), || plant.said());
    let output = magsteer(&world, &["fault", "poses", "off"]);
    assert_eq!(output.status.code(), Some(77), "{}", said(&output));
    assert!(
        said(&output).contains("does not allow faults: start it with --allow-faults"),
        "{}",
        said(&output)
    );
    assert!(plant.runs());
    let end = plant.end();
    assert_eq!((end.code, &end.report["faults"]), (Some(0), &Value::Null));
}

#[test]
fn requests_that_make_no_sense_end_with_2_and_say_what_would() {
    let world = World::new();
    let cases: [(&[&str], &str); 6] = [
        (&["poses", "open"], "VERB = open: must be one that applies to poses"),
        (&["poses", "melt"], "unknown variant `melt`"),
        (&["poses", "delayed"], "--delay-ms = missing: must be given"),
        (&["feedback", "slow", "--rate-hz", "0"], "--rate-hz = 0: must be from 0.1 to 1000"),
        (&["actuators", "garbage", "--garbage", "nan"], "`random` garbage alone"),
        (&["poses", "stuck", "--magnet", "m9"], "m1, m2"),
    ];
    for (arguments, expected) in cases {
        let output = magsteer(&world, &[&["fault"], arguments].concat());
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {}", said(&output));
        assert!(said(&output).contains(expected), "{expected:?} in {}", said(&output));
    }
}

#[test]
fn the_shipped_plan_is_right() {
    let world = World::new();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/faults/tour.toml");
    let path = path.to_str().expect("plain");
    let plant = Process::start(&world, "sim-plant", &["--allow-faults", "--fault-plan", path]);
    until(|| plant.said().contains("is running").then_some(()), || plant.said());
    assert_eq!(plant.end().code, Some(0));
}
