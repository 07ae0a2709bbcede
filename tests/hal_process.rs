//! `magsteer hal` as a user calls it: the check of running drivers as processes, templates, and drivers in
//! Python and C
//! where an interpreter with PyPI `iceoryx2`, or a compiler, is there.

mod process_support;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use magsteer_hal::operator::state;
use process_support::World;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

fn magsteer(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_magsteer")).args(arguments).output().expect("the program is built")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Runs the suite on whatever drives the rig of `world`; its answer and exit code.
fn conformance(world: &World, level: &str, more: &[&str]) -> (Value, Option<i32>) {
    let (file, root) = (world.file.to_str().expect("text"), world.root.path().to_str().expect("text"));
    let mut arguments =
        vec!["hal", "conformance", file, "--root", root, "--level", level, "--wait-s", "20", "--json"];
    arguments.extend(more);
    let output = magsteer(&arguments);
    let answer = serde_json::from_slice(&output.stdout);
    let answer = answer.unwrap_or_else(|error| panic!("{error}: {}", text(&output.stderr)));
    (answer, output.status.code())
}

fn assert_passed(answer: &Value, code: Option<i32>) {
    let checks = answer["checks"].as_array().expect("checks");
    let failed: Vec<&Value> = checks.iter().filter(|check| check["verdict"] != "pass").collect();
    assert!(failed.is_empty(), "{failed:#?}");
    assert_eq!((code, &answer["passed"], &answer["ended_at_zero"]), (Some(0), &true.into(), &true.into()));
    assert_eq!(answer["counts"]["pass"], checks.len());
    assert!(checks.len() >= 50, "{}", checks.len());
}

/// A process that is asked to end, and waited for, when the test is over.
struct Driver(Child);

impl Driver {
    fn start(command: &mut Command) -> Self {
        Self(command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().expect("it starts"))
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // One that has ended already needs no asking.
        let _ = kill_process(Pid::from_child(&self.0), Signal::TERM);
        let start = Instant::now();
        while self.0.try_wait().expect("a child").is_none() {
            if start.elapsed() > Duration::from_secs(10) {
                self.0.kill().expect("a child");
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

#[test]
fn simulated_rig_passes_every_check_and_the_junit_file_has_them_all() {
    let world = World::new();
    let _plant = world.plant();
    let junit = world.root.path().join("conformance.xml");
    let (answer, code) = conformance(&world, "dummy-load", &["--junit", junit.to_str().expect("text")]);
    assert_passed(&answer, code);
    let xml = std::fs::read_to_string(junit).expect("written");
    assert_eq!(xml.matches("<testcase ").count(), answer["checks"].as_array().expect("checks").len());
    assert!(xml.contains("name=\"watchdog-ramps-down\"") && xml.contains("failures=\"0\""), "{xml}");
}

#[test]
fn suite_says_who_is_missing_and_leaves_a_daemon_alone() {
    let world = World::new();
    let (file, root) = (world.file.to_str().expect("text"), world.root.path().to_str().expect("text"));
    let absent = magsteer(&["hal", "conformance", file, "--root", root, "--wait-s", "0.2"]);
    assert_eq!(absent.status.code(), Some(69), "{}", text(&absent.stderr));
    assert!(text(&absent.stderr).contains("no driver on rig"), "{}", text(&absent.stderr));
    let _plant = world.plant();
    let _daemon = world.daemon();
    world.operator().until_state(state::IDLE);
    let held = magsteer(&["hal", "conformance", file, "--root", root]);
    assert_eq!(held.status.code(), Some(69), "{}", text(&held.stderr));
    assert!(text(&held.stderr).contains("already has a daemon: process"), "{}", text(&held.stderr));
}

/// Goal: Ctrl-C while currents flow.
#[test]
fn interrupted_suite_ends_without_current_and_says_so() {
    let world = World::new();
    let _plant = world.plant();
    let (file, root) = (world.file.to_str().expect("text"), world.root.path().to_str().expect("text"));
    let child = Command::new(env!("CARGO_BIN_EXE_magsteer"))
        .args([
            "hal",
            "conformance",
            file,
            "--root",
            root,
            "--level",
            "dummy-load",
            "--wait-s",
            "20",
            "--json",
        ])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the program is built");
    std::thread::sleep(Duration::from_millis(4_000));
    kill_process(Pid::from_child(&child), Signal::INT).expect("the child is there");
    let output = child.wait_with_output().expect("a child");
    let answer: Value = serde_json::from_slice(&output.stdout).expect("an object");
    assert_eq!((output.status.code(), &answer["interrupted"]), (Some(130), &true.into()), "{answer}");
    assert_eq!(answer["ended_at_zero"], true);
    assert_eq!(answer["counts"]["fail"], 0, "an interruption is no finding: {answer}");
}

/// An interpreter that has PyPI `iceoryx2` 0.10: `$MAGSTEER_PYTHON`, or `python3`.
fn python() -> Option<PathBuf> {
    let program = std::env::var_os("MAGSTEER_PYTHON").map_or_else(|| PathBuf::from("python3"), PathBuf::from);
    let found = Command::new(&program).args(["-c", "import iceoryx2"]).stderr(Stdio::null()).status();
    found.is_ok_and(|status| status.success()).then_some(program)
}

/// Writes a driver in `language` below the rig's root, for its configuration.
fn template(world: &World, language: &str) -> PathBuf {
    let (file, folder) = (world.file.to_str().expect("text"), world.root.path().to_str().expect("text"));
    let made = magsteer(&["hal", "new", "drv", "--lang", language, "--config", file, "--dir", folder]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    world.root.path().join("drv")
}

#[test]
fn python_template_passes_every_check() {
    let Some(python) = python() else {
        println!(
            "skipped: no python3 with iceoryx2; pip install 'iceoryx2==0.10.*' and name it in MAGSTEER_PYTHON"
        );
        return;
    };
    let world = World::new();
    let folder = template(&world, "python");
    let _driver = Driver::start(
        Command::new(&python).arg(folder.join("driver.py")).arg("--root").arg(world.root.path()),
    );
    let (answer, code) = conformance(&world, "dummy-load", &[]);
    assert_passed(&answer, code);
}

#[test]
fn python_operator_arms_steers_and_stops_the_daemon() {
    let Some(python) = python() else {
        println!(
            "skipped: no python3 with iceoryx2; pip install 'iceoryx2==0.10.*' and name it in MAGSTEER_PYTHON"
        );
        return;
    };
    let world = World::new();
    let folder = template(&world, "python");
    let _plant = world.plant();
    let _daemon = world.daemon();
    let mut observer = world.operator();
    observer.until_state(state::IDLE);
    let ask = |words: &[&str]| {
        let mut command = Command::new(&python);
        command.current_dir(&folder).args(["-m", "magsteer.operator", "--rig", "rig.json", "--root"]);
        let output = command.arg(world.root.path()).args(words).output().expect("it starts");
        assert!(output.status.success(), "{words:?}: {}", text(&output.stderr));
        text(&output.stdout)
    };
    ask(&["target", "100", "105"]);
    ask(&["arm"]);
    ask(&["go"]);
    observer.until_state(state::ACTIVE);
    let status: Value = serde_json::from_str(&ask(&["status"])).expect("an object");
    assert_eq!(status["state"], "active", "{status}");
    let targets: Vec<f64> = serde_json::from_value(status["targets_deg"].clone()).expect("numbers");
    assert!((targets[0] - 100.0).abs() < 1e-2 && (targets[1] - 105.0).abs() < 1e-2, "{targets:?}");
    ask(&["stop"]);
    observer.until_state(state::IDLE);
}

#[test]
fn python_modules_pass_their_own_tests() {
    let program = python().unwrap_or_else(|| PathBuf::from("python3"));
    if !Command::new(&program)
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
    {
        println!("skipped: no python3");
        return;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("hal/python");
    // Layouts and guard need no transport.
    let output = Command::new(program)
        .current_dir(&folder)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .args(["-m", "unittest", "discover", "-s", "tests"])
        .output()
        .expect("it starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn c_template_behind_the_udp_driver_passes_every_check() {
    if !Command::new("cc")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
    {
        println!("skipped: no C compiler");
        return;
    }
    let world = World::new();
    let folder = template(&world, "c");
    let flags =
        ["-O2", "-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "device.c", "-o", "device", "-lm"];
    let built = Command::new("cc").current_dir(&folder).args(flags).output().expect("it starts");
    assert!(built.status.success(), "{}", text(&built.stderr));
    // A port that was free a moment ago.
    let port = std::net::UdpSocket::bind("127.0.0.1:0")
        .and_then(|socket| socket.local_addr())
        .expect("a socket")
        .port();
    let _device = Driver::start(Command::new(folder.join("device")).arg(port.to_string()));
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["hal", "udp-driver"]).arg(&world.file).arg("--root").arg(world.root.path());
    // Longer than a busy machine stops a process now and then.
    command.args(["--device", &format!("127.0.0.1:{port}"), "--validity-ms", "400"]);
    let _driver = Driver::start(&mut command);
    let (answer, code) = conformance(&world, "dummy-load", &[]);
    assert_passed(&answer, code);
}

#[test]
fn rust_template_has_the_rigs_own_fingerprint() {
    let world = World::new();
    let (file, folder) = (world.file.to_str().expect("text"), world.root.path().to_str().expect("text"));
    let hal = Path::new(env!("CARGO_MANIFEST_DIR")).join("hal");
    let hal = hal.to_str().expect("text");
    let new = ["hal", "new", "drv", "--lang", "rust", "--config", file, "--dir", folder, "--hal-path", hal];
    let made = magsteer(&new);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let tables = std::fs::read_to_string(world.root.path().join("drv/rig.toml")).expect("written");
    let config: magsteer_hal::config::HardwareConfig = toml::from_str(&tables).expect("the rig's tables");
    assert_eq!(config.build().expect("valid").fingerprint(), world.config.description.fingerprint());
    let again = magsteer(&new);
    assert_eq!(again.status.code(), Some(73), "nothing is written over: {}", text(&again.stderr));
}
