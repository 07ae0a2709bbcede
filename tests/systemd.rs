//! The daemon and the plant under a service manager: what they tell it, and the units that are shipped for it.
//!
//! The manager is played by this test, with a real socket of the kind that systemd opens.

#![cfg(feature = "sim")]

mod process_support;

use std::fs::{self, File};
use std::os::unix::fs::MetadataExt;
use std::os::unix::net::UnixDatagram;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::mpsc::{self, Receiver};

use magsteer::config::Config;
use magsteer_hal::operator::Cause;
use magsteer_sim_plant::PlantConfig;
use process_support::{PATIENCE, Process, World};
use rustix::process::Signal;

/// Where journald listens; on a machine where it does, lines go there and not to standard error.
const JOURNAL: &str = "/run/systemd/journal/socket";
/// Exposure that `systemd-analyze security` may find, in tenths: 1.0 of 10. Shared memory and real time cost 0.7 of it.
const EXPOSURE_MAX: &str = "10";

/// A service manager's end of one service. A thread empties the socket as it fills: its queue is short.
struct Manager {
    path: PathBuf,
    told: Receiver<String>,
}

impl Manager {
    fn new(world: &World, name: &str) -> Self {
        let path = world.root.path().join(name);
        let socket = UnixDatagram::bind(&path).expect("own directory");
        let (sender, told) = mpsc::channel();
        // Ends with the test's process, or with the first message after this end is gone.
        std::thread::spawn(move || {
            let mut buffer = [0; 512];
            while let Ok(length) = socket.recv(&mut buffer) {
                let message = String::from_utf8_lossy(&buffer[..length]).into_owned();
                if sender.send(message).is_err() {
                    break;
                }
            }
        });
        Self { path, told }
    }

    /// Starts a command of the world under this manager, with a watchdog of 200 ms, its standard error a journal's stream.
    fn start(&self, world: &World, name: &str) -> (Process, PathBuf) {
        let log = world.root.path().join(format!("{name}.log"));
        let stream = File::create(&log).and_then(|file| file.metadata()).expect("own directory");
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.arg(name).arg(&world.file).arg("--root").arg(world.root.path());
        command.args(["--json", "--end-with-stdin"]);
        command.env("NOTIFY_SOCKET", &self.path).env("WATCHDOG_USEC", "200000").env_remove("WATCHDOG_PID");
        command.env("JOURNAL_STREAM", format!("{}:{}", stream.dev(), stream.ino()));
        (Process::spawn(&mut command, log.clone()), log)
    }

    /// Takes messages until one starts so; all of them, that one last, in order.
    fn until(&self, start: &str) -> Vec<String> {
        let mut seen = Vec::new();
        loop {
            let message = self.told.recv_timeout(PATIENCE);
            seen.push(message.unwrap_or_else(|_| panic!("no {start} after {seen:?}")));
            if seen.last().is_some_and(|message| message.starts_with(start)) {
                return seen;
            }
        }
    }
}

/// Proves SR-20.
#[test]
fn daemon_and_plant_are_ready_when_they_run_alive_while_they_do_and_stopping_before_the_ramp() {
    let world = World::new();
    let of_plant = Manager::new(&world, "plant");
    let (plant, _) = of_plant.start(&world, "sim-plant");
    assert_eq!(of_plant.until("READY"), ["READY=1"]);
    // A machine that stops processes may stop the loop before it is asked to end.
    assert!((0..5).any(|number| runs_until_asked_to_end(&world, number)), "the loop never ran so long");
    of_plant.until("WATCHDOG=1");
    plant.signal(Signal::TERM);
    of_plant.until("STOPPING=1");
    assert_eq!(plant.wait().code, Some(143));
}

/// One life of a daemon; false when something else stopped its loop before it was asked to end.
fn runs_until_asked_to_end(world: &World, number: u32) -> bool {
    let manager = Manager::new(world, &format!("daemon-{number}"));
    let (daemon, log) = manager.start(world, "run");
    assert_eq!(manager.until("READY"), ["STATUS=waiting for a driver", "READY=1"]);
    manager.until("STATUS=idle");
    manager.until("WATCHDOG=1");
    manager.until("WATCHDOG=1");
    let mut operator = world.operator();
    operator.steer();
    manager.until("STATUS=active");
    daemon.signal(Signal::TERM);
    let before = manager.until("STOPPING=1");
    let told = |messages: &[String]| messages.iter().any(|message| message.contains("asked to end"));
    assert!(!told(&before), "{before:?}");
    let end = daemon.wait();
    if end.report["cause_code"] != Cause::Terminated.code() {
        println!("stopped before it was asked: {}", end.report["cause"]);
        return false;
    }
    assert_eq!(end.code, Some(143), "{}", end.said);
    manager.until("STATUS=safe-stop: the process was asked to end");
    if Path::new(JOURNAL).exists() {
        println!("priorities not looked at: the journal of this machine took the lines");
        return true;
    }
    let said = fs::read_to_string(log).expect("own directory");
    let prefixed =
        |prefix: &str, text: &str| said.lines().any(|line| line.starts_with(prefix) && line.contains(text));
    assert!(prefixed("<6>magsteer: ", "boot -> idle"), "{said}");
    assert!(prefixed("<5>magsteer: ", "-> safe-stop: the process was asked to end"), "{said}");
    true
}

/// The shipped units.
fn units() -> [(&'static str, String); 2] {
    ["magsteer@.service", "magsteer-plant@.service"].map(|name| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/systemd").join(name);
        (name, fs::read_to_string(path).expect("shipped"))
    })
}

/// The last value of a key.
fn value<'a>(unit: &'a str, key: &str) -> &'a str {
    let mut values = unit.lines().filter_map(|line| line.strip_prefix(key)?.strip_prefix('='));
    values.next_back().unwrap_or_else(|| panic!("{key} is stated"))
}

/// Proves SR-20.
#[test]
fn units_agree_with_the_program_and_the_shipped_configuration() {
    let (document, config) =
        Config::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml"))
            .expect("shipped");
    let shipped = config.daemon.expect("shipped with a daemon");
    for (name, unit) in units() {
        assert_eq!(value(&unit, "Type"), "notify", "{name}");
        assert_eq!(value(&unit, "Restart"), "no", "{name}");
        assert_eq!(value(&unit, "RemoveIPC"), "no", "{name}");
        assert_eq!((value(&unit, "UMask"), value(&unit, "RuntimeDirectoryMode")), ("0077", "0700"), "{name}");
        assert_eq!(value(&unit, "RuntimeDirectoryPreserve"), "yes", "{name}");
        let root = format!("MAGSTEER_ROOT=/run/{}", value(&unit, "RuntimeDirectory"));
        assert_eq!(value(&unit, "Environment"), root, "{name}");
        assert!(value(&unit, "WatchdogSec").parse::<u32>().is_ok_and(|seconds| seconds > 0), "{name}");
    }
    let [(_, daemon), (_, plant)] = units();
    for key in ["User", "Group", "RuntimeDirectory", "PrivateUsers"] {
        assert_eq!(value(&daemon, key), value(&plant, key), "both sides must meet: {key}");
    }
    assert!(value(&daemon, "LimitRTPRIO").parse::<u32>().is_ok_and(|most| most >= shipped.priority));
    let simulated = document.section::<PlantConfig>("plant").expect("shipped").real_time;
    assert!(value(&plant, "LimitRTPRIO").parse::<u32>().is_ok_and(|most| most >= simulated.priority));
    assert!(simulated.priority < shipped.priority, "the daemon comes first");
    assert_eq!(value(&plant, "RestrictRealtime"), "no");
    assert_eq!((value(&daemon, "LimitMEMLOCK"), value(&daemon, "RestrictRealtime")), ("infinity", "no"));
    // A ramp may take as long as a configuration can state.
    let stop_s: f64 = value(&daemon, "TimeoutStopSec").parse().expect("seconds");
    assert!(stop_s > 10.0 && stop_s > 1e-3 * shipped.ramp_timeout_ms);
}

/// Proves SR-16 and SR-17.
#[test]
fn units_are_valid_and_hardly_exposed() {
    if !Command::new("systemd-analyze").arg("--version").output().is_ok_and(|run| run.status.success()) {
        println!("not checked: systemd-analyze is not on this machine");
        return;
    }
    let directory = tempfile::tempdir().expect("a directory");
    for (name, unit) in units() {
        // An instance, and a program that exists here.
        let path = directory.path().join(name.replace('@', "@rig"));
        let program = env!("CARGO_BIN_EXE_magsteer");
        let text = unit.replace("/usr/local/bin/magsteer", program);
        assert!(text.contains(program), "{name}");
        fs::write(&path, text).expect("own directory");
        let verified = Command::new("systemd-analyze").arg("verify").arg(&path).output().expect("is there");
        let said = String::from_utf8_lossy(&verified.stderr);
        assert!(verified.status.success() && said.is_empty(), "{name}: {said}");
        let mut judge = Command::new("systemd-analyze");
        judge.args(["security", "--offline=true", "--no-pager", "--threshold", EXPOSURE_MAX]).arg(&path);
        let judged = judge.output().expect("is there");
        let table = String::from_utf8_lossy(&judged.stdout);
        println!("{}", table.lines().last().unwrap_or_default());
        assert!(judged.status.success(), "{name}: {table}");
    }
    // A mistake would be found.
    let wrong = directory.path().join("wrong.service");
    fs::write(&wrong, "[Service]\nExecStart=/bin/true\nTyp=notify\n").expect("own directory");
    let verified = Command::new("systemd-analyze").arg("verify").arg(&wrong).output().expect("is there");
    assert!(!verified.stderr.is_empty());
}
