//! What surrounds the processes goes away while coils carry current: the terminal, whoever read their output, memory.
//!
//! Folders that cannot be written are in `recorder_process.rs`, kills and stops in `kill.rs`, clocks that are stepped in `no_wall_clock.rs`.
//! No test judges how long anything took; each waits for a state, bounded only so that a failure ends.

#![cfg(feature = "sim")]

mod process_support;

use std::ffi::CStr;
use std::fs::File;
use std::os::fd::{AsFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use magsteer_hal::operator::{Cause, recorder, state};
use process_support::{PATIENCE, Process, World, current, until};
use rustix::fs::{Mode, OFlags};
use rustix::process::{Pid, Signal, kill_process};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;

/// A coil that carries less counts as being at rest, A: `ramp_done_a` of the configuration.
const REST: f64 = 0.1;

/// `magsteer NAME` on the rig of `world`, with nothing said yet of its input and output.
fn command(world: &World, name: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    add_arguments(&mut command, world, name);
    command
}

fn add_arguments(command: &mut Command, world: &World, name: &str) {
    command.arg(name).arg(&world.file).arg("--root").arg(world.root.path());
    if name == "run" {
        command.args(["--wait-s", "30"]).arg("--flights").arg(world.recordings());
    }
}

/// A child that does not outlive a failed test.
struct Held(Child);

impl Held {
    fn start(command: &mut Command) -> Self {
        Self(command.spawn().expect("the program is built"))
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.0), signal).expect("the child is there");
    }

    fn runs(&mut self) -> bool {
        self.0.try_wait().expect("a child").is_none()
    }

    fn wait(&mut self) -> ExitStatus {
        until(|| self.0.try_wait().expect("a child"), || format!("runs on after {PATIENCE:?}"))
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A terminal, and the program that has it as its controlling one. Dropping the first closes the terminal, which the
/// kernel tells the program by SIGHUP.
fn in_terminal(world: &World, name: &str, arguments: &[&str]) -> (OwnedFd, Held) {
    let terminal =
        openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).expect("a pseudo-terminal");
    grantpt(&terminal).expect("own terminal");
    unlockpt(&terminal).expect("own terminal");
    let path = ptsname(&terminal, Vec::new()).expect("own terminal");
    let far = open_far(&path);
    let clone = || Stdio::from(far.as_fd().try_clone_to_owned().expect("a descriptor"));
    // Makes a session of the program and its standard input the terminal of that.
    let mut command = Command::new("setsid");
    command.arg("--ctty").arg(env!("CARGO_BIN_EXE_magsteer"));
    add_arguments(&mut command, world, name);
    command.args(arguments);
    let held = Held::start(command.stdin(clone()).stdout(clone()).stderr(clone()));
    (terminal, held)
}

fn open_far(path: &CStr) -> OwnedFd {
    rustix::fs::open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())
        .expect("own terminal")
}

/// Proves SR-15.
#[test]
fn a_daemon_whose_terminal_closes_ramps_down_and_ends_with_143() {
    let world = World::new();
    let plant = world.plant();
    let folder = world.root.path().join("run");
    let (terminal, mut daemon) = in_terminal(&world, "run", &["--record", folder.to_str().expect("UTF-8")]);
    world.operator().steer();
    drop(terminal);
    assert_eq!(daemon.wait().code(), Some(143));
    let report = plant.end().report;
    assert_eq!(report["ended_currentless"], true, "{report}");
    assert_eq!(report["limit_breaks"], 0, "{report}");
    // Nobody could read how it ended, and nothing of that is lost.
    let summary = std::fs::read_to_string(folder.join("summary.json")).expect("a summary");
    let summary: Value = serde_json::from_str(&summary).expect("one object");
    assert_eq!(summary["state"], "idle", "{summary}");
    assert!(summary["ramp_down_ms"].as_f64() > Some(0.0), "it waited for the ramp: {summary}");
}

/// Proves SR-02 and SR-15.
#[test]
fn a_plant_whose_terminal_closes_ends_at_zero_and_its_follower_is_steered() {
    let world = World::new();
    let (terminal, mut plant) = in_terminal(&world, "sim-plant", &[]);
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    drop(terminal);
    assert_eq!(plant.wait().code(), Some(143));
    let status = operator.until_state(state::FAULT);
    let cause = Cause::from_code(status.cause).expect("known").text();
    assert!(cause.contains("driver"), "{cause}");
    let plant = world.plant();
    operator.steer();
    assert_eq!(daemon.end().code, Some(0));
    assert_eq!(plant.end().report["ended_currentless"], true);
}

/// Output that nobody can take.
#[derive(Debug, Clone, Copy)]
enum Broken {
    /// A pipe whose reader has gone.
    Pipe,
    /// A disk that is full.
    Disk,
}

impl Broken {
    fn output(self) -> Stdio {
        match self {
            Self::Pipe => {
                let (reader, writer) = std::io::pipe().expect("a pipe");
                drop(reader);
                Stdio::from(writer)
            }
            Self::Disk => Stdio::from(File::options().write(true).open("/dev/full").expect("on every Linux")),
        }
    }
}

/// Proves SR-15 and SR-29.
#[test]
fn who_steers_does_not_mind_that_nobody_takes_its_output() {
    for what in [Broken::Pipe, Broken::Disk] {
        let world = World::new();
        let start = |name| {
            Held::start(
                command(&world, name).stdin(Stdio::null()).stdout(what.output()).stderr(what.output()),
            )
        };
        let (mut plant, mut daemon) = (start("sim-plant"), start("run"));
        let mut operator = world.operator();
        let begun = operator.steer().cycle;
        operator.until(|status| status.cycle > begun + 2_000);
        assert!(plant.runs() && daemon.runs(), "{what:?}");
        let steered = operator.steer();
        assert!(steered.state == state::ACTIVE && current(&steered) > REST, "{what:?}: {steered:?}");
        daemon.signal(Signal::TERM);
        assert_eq!(daemon.wait().code(), Some(143), "{what:?}");
        let status = operator.last_status().expect("it published");
        assert!(status.state == state::IDLE && current(&status) < REST, "{what:?}: {status:?}");
        plant.signal(Signal::TERM);
        assert_eq!(plant.wait().code(), Some(143), "{what:?}");
    }
}

/// Goal: `magsteer ... | head` is no failure of any command: nothing is said, and the code is that of an
/// answer that was read to its end. Where the answer is the code, it stays.
///
/// Proves SR-29.
#[test]
fn a_reader_that_has_enough_ends_a_command_quietly() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/config/bigmag-planar.toml");
    let wrong = folder.path().join("wrong.toml");
    let text = format!("extends = {file:?}\n\n[rig]\nworkspace_diameter_mm = 0.11\n");
    std::fs::write(&wrong, text).expect("own directory");
    std::fs::write(folder.path().join("events.jsonl"), "").expect("own directory");
    let currents = "2,-1,0,0,1.5,0";
    let (wrong, folder) = (wrong.to_str().expect("plain"), folder.path().to_str().expect("plain"));
    let cases: &[(i32, &[&str])] = &[
        (0, &["shape", file, "--currents", currents, "--json"]),
        (0, &["shape", file, "--currents", currents]),
        (0, &["hal", "describe", file]),
        (0, &["hal", "messages"]),
        (0, &["check", file, "--print-resolved"]),
        (0, &["check", file]),
        (78, &["check", wrong, "--json"]),
        (0, &["runs", "list", folder, "--json"]),
        (0, &["field", "at", "0", "0", "0", "--config", file, "--currents", currents]),
        (0, &["--help"]),
    ];
    for (code, arguments) in cases {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.args(*arguments).stdin(Stdio::null()).stdout(Broken::Pipe.output());
        let output = command.output().expect("the program is built");
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!((output.status.code(), said.as_ref()), (Some(*code), ""), "{arguments:?}");
    }
    // A disk that is full is another matter.
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let output = command
        .args(["shape", file, "--currents", currents, "--json"])
        .stdout(Broken::Disk.output())
        .output();
    let output = output.expect("the program is built");
    assert_eq!(output.status.code(), Some(74), "{}", String::from_utf8_lossy(&output.stderr));
}

/// A file system of so many bytes, until this goes.
struct SmallDisk(PathBuf);

impl SmallDisk {
    /// `None` where this process may not mount one: it takes root.
    fn mount(at: PathBuf, bytes: u32) -> Option<Self> {
        std::fs::create_dir(&at).expect("own directory");
        let options = format!("size={bytes},mode=700");
        let mut mount = Command::new("mount");
        let mount =
            mount.args(["-t", "tmpfs", "-o", &options, "magsteer-test"]).arg(&at).stderr(Stdio::null());
        mount.status().is_ok_and(|status| status.success()).then_some(Self(at))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // The daemon has ended, and nobody else knows of it.
        let _ = Command::new("umount").arg(&self.0).status();
    }
}

/// Goal: flights, journal and recording meet a disk that is full; the loop goes on, the status warns, and the recorder
/// says what it lost.
///
/// Proves SR-29.
#[test]
fn a_full_disk_stops_the_recording_and_not_the_loop() {
    let world = World::new();
    let Some(disk) = SmallDisk::mount(world.root.path().join("disk"), 1 << 20) else {
        println!("skipped: no file system may be mounted here");
        return;
    };
    let _plant = world.plant();
    let log = world.root.path().join("daemon.log");
    let run = disk.0.join("run");
    let mut daemon = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    daemon.args(["run", "--json", "--wait-s", "30", "--record"]).arg(&run);
    daemon.arg("--root").arg(world.root.path()).arg(&world.file);
    let daemon = Process::spawn(&mut daemon, log);
    let mut operator = world.operator();
    let begun = operator.steer().cycle;
    let warned =
        operator.until(|status| status.recorder == recorder::FAILING && status.cycle > begun + 3_000);
    assert_eq!((warned.state, warned.loop_allocations), (state::ACTIVE, 0), "{warned:?}");
    daemon.signal(Signal::TERM);
    let end = daemon.wait();
    assert_eq!(end.report["state"], "idle", "{}", end.said);
    assert!(end.said.contains("o space left"), "{}", end.said);
}

/// A group of processes that may have so much memory together; gone with this.
struct MemoryGroup {
    path: PathBuf,
    /// The group's files of what it may use and of what it uses, bytes.
    limit: &'static str,
    usage: &'static str,
}

impl MemoryGroup {
    /// `None` where this process may not make one: it takes root, or a delegated part of the tree.
    fn create() -> Option<Self> {
        let own = std::fs::read_to_string("/proc/self/cgroup").ok()?;
        let kinds = [
            (":memory:", "/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
            ("0::", "/sys/fs/cgroup", "memory.max", "memory.current"),
        ];
        for (mark, root, limit, usage) in kinds {
            let Some(parent) = own.lines().find_map(|line| Some(line.split_once(mark)?.1)) else { continue };
            let name = format!("magsteer-{}", std::process::id());
            let path = Path::new(root).join(parent.trim_start_matches('/')).join(name);
            if std::fs::create_dir(&path).is_err() {
                continue;
            }
            let group = Self { path, limit, usage };
            if group.path.join(limit).exists() {
                return Some(group);
            }
        }
        None
    }

    /// Starts a shell's command within the group.
    fn start(&self, script: &str, command: &Command) -> Held {
        let mut within = Command::new("sh");
        let script = format!("echo $$ > '{}'\n{script}", self.path.join("cgroup.procs").display());
        within.args(["-c", &script]).arg(command.get_program()).args(command.get_args());
        Held::start(within.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()))
    }

    fn allow_more(&self, bytes: u64) {
        let usage = std::fs::read_to_string(self.path.join(self.usage)).expect("own group");
        let usage: u64 = usage.trim().parse().expect("a number");
        std::fs::write(self.path.join(self.limit), (usage + bytes).to_string()).expect("own group");
    }
}

impl Drop for MemoryGroup {
    fn drop(&mut self) {
        // Its processes have ended; the kernel may take a moment to bury the last.
        for _ in 0..100 {
            if std::fs::remove_dir(&self.path).is_ok() {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// Proves SR-19.
#[test]
fn processes_that_take_all_memory_beside_the_rig_are_ridden_through() {
    let world = World::new();
    let Some(group) = MemoryGroup::create() else {
        println!("skipped: no memory group may be made here");
        return;
    };
    // "$0" and "$@" are program and arguments.
    let start = |name| group.start(r#"exec "$0" "$@""#, &command(&world, name));
    let (mut plant, mut daemon) = (start("sim-plant"), start("run"));
    let mut operator = world.operator();
    operator.steer();
    group.allow_more(32 << 20);
    for round in 0..5 {
        // Takes what it gets, and is who has to go when there is no more.
        let hog = "echo 1000 > /proc/self/oom_score_adj\nexec tail /dev/zero";
        let ended = group.start(hog, &Command::new("tail")).wait();
        assert_eq!(ended.code(), None, "round {round}: killed for want of memory");
        assert!(plant.runs() && daemon.runs(), "round {round}");
        let status = operator.steer();
        assert_eq!(status.loop_allocations, 0, "round {round}");
    }
    daemon.signal(Signal::TERM);
    assert_eq!(daemon.wait().code(), Some(143));
    let status = operator.last_status().expect("it published");
    assert!(status.state == state::IDLE && current(&status) < REST, "{status:?}");
    plant.signal(Signal::TERM);
    assert_eq!(plant.wait().code(), Some(143));
}
