//! `magsteer run` as a process, with an ideal driver here and operators as processes: exit codes and printed keys.
//!
//! No test judges how long anything took; each waits for a state, bounded only so that a failure ends.

mod ideal_driver;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use ideal_driver::Driver;
use magsteer::config::Config;
use magsteer::daemon::recorder::read_minutes;
use magsteer::daemon::threads::threads_of;
use magsteer_hal::channels::PrivateRoot;
use magsteer_hal::message::driver_state;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

const PATIENCE: Duration = Duration::from_secs(30);

/// A rig of its own: root, driver, configuration with limits for a machine that runs many tests at once.
struct World {
    file: PathBuf,
    driver: Driver,
    root: PrivateRoot,
}

impl World {
    fn new() -> Self {
        // What the scripted magnets do, the model cannot know.
        Self::with("[daemon.monitors]\nmodel_error_max_deg = 180.0\nprogress_stop_ms = 600000.0\n")
    }

    /// With further tables of the configuration.
    fn with(tables: &str) -> Self {
        let root = PrivateRoot::create("ms").expect("shared memory is there");
        let file = root.path().join("rig.toml");
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        // The scripted magnets obey no current: what the model would learn from them is no bias of its own.
        let text = format!(
            "extends = {shipped:?}\n[daemon]\nrate_hz = 500.0\ncommand_validity_ms = 1000.0\npose_hold_ms = 2000.0\n\
             pose_stop_ms = 4000.0\npose_error_max_deg = 180.0\nfollowing_stop_ms = 2000.0\nfeedback_stop_ms = 2000.0\nmodel_stop_ms = 5000.0\nramp_timeout_ms = 5000.0\n\
             overrun_fraction = 0.99\noverrun_window_ms = 10000.0\n[control]\nfeedback = \"delayed-reference\"\n{tables}"
        );
        std::fs::write(&file, text).expect("own directory");
        let (_, config) = Config::load(&file).expect("extends a shipped file");
        let endpoint = root.endpoint(&config.description.rig).expect("short and own");
        let driver = Driver::start(&endpoint, config.description);
        Self { file, driver, root }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.args(arguments).arg("--root").arg(self.root.path());
        command
    }

    /// Runs an operator's command; `--config` or FILE is in the arguments where needed.
    fn operator(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program is built")
    }

    /// A request that is repeated until it is accepted: a starved machine may answer late.
    fn insist(&self, verb: &str) {
        let file = self.file.to_str().expect("plain");
        let begin = Instant::now();
        loop {
            let output = self.operator(&[verb, file]);
            if output.status.success() {
                return;
            }
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(begin.elapsed() < PATIENCE, "{verb}: {said}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn status(&self) -> Option<Value> {
        let output = self.operator(&["status", "--json", self.file.to_str().expect("plain")]);
        serde_json::from_slice(&output.stdout).ok()
    }

    fn until(&self, wanted: impl Fn(&Value) -> bool) -> Value {
        let begin = Instant::now();
        loop {
            match self.status() {
                Some(status) if wanted(&status) => return status,
                status => assert!(begin.elapsed() < PATIENCE, "{status:?}"),
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// `magsteer run` as a child.
struct Daemon(Option<Child>);

impl Daemon {
    fn start(world: &World, arguments: &[&str]) -> Self {
        let mut command = world.command(&["run", world.file.to_str().expect("plain"), "--json"]);
        command.arg("--flights").arg(world.root.path().join("recordings"));
        let command = command.args(arguments).stdin(Stdio::piped());
        let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        Self(Some(child.expect("the program is built")))
    }

    fn child(&mut self) -> &mut Child {
        self.0.as_mut().expect("not waited for yet")
    }

    fn signal(&mut self, signal: Signal) {
        let pid = Pid::from_child(self.child());
        kill_process(pid, signal).expect("the child is there");
    }

    /// Waits for the end: exit code, what was printed, what was said.
    fn end(mut self) -> (Option<i32>, Value, String) {
        let child = self.0.take().expect("not waited for yet");
        let output = child.wait_with_output().expect("a child");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), serde_json::from_slice(&output.stdout).unwrap_or(Value::Null), said)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // Nothing of a failed test is to remain.
        if let Some(mut child) = self.0.take() {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

#[test]
fn sigint_while_steering_ramps_down_and_ends_with_130() {
    let world = World::new();
    let mut daemon = Daemon::start(&world, &["--arm"]);
    world.until(|status| status["state"] == "armed");
    let file = world.file.to_str().expect("plain");
    let output = world.operator(&["target", "set", "m1=70deg", "m2=110deg", "--config", file, "--json"]);
    let answer: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!(answer["accepted"], true, "{answer}");
    world.insist("go");
    let steers = |status: &Value| {
        let currents = status["currents_a"].as_array().expect("an array");
        currents.iter().any(|current| current.as_f64().expect("a number").abs() > 0.5)
    };
    let status = world.until(|status| status["state"] == "active" && steers(status));
    for (target, expected) in status["targets_deg"].as_array().expect("an array").iter().zip([70.0, 110.0]) {
        assert!((target.as_f64().expect("a number") - expected).abs() < 1e-9, "{status}");
    }
    for key in ["cause", "cycle", "rate_hz", "measured_deg", "angles_deg", "pose_age_us", "missed"] {
        assert!(status.get(key).is_some(), "{key} in {status}");
    }
    daemon.signal(Signal::INT);
    let (code, report, said) = daemon.end();
    assert_eq!(code, Some(130), "{said}");
    assert_eq!(report["state"], "idle", "{report}");
    assert!(report["ramp_down_ms"].as_f64().is_some_and(|duration| duration > 0.0), "{report}");
    assert!(report["ramp_down_to_a"].as_f64().is_some_and(|current| current < 0.1), "{report}");
    for key in ["rate_hz", "cycles", "missed", "lateness_us", "execution_us", "pose_to_command_us"] {
        assert!(report["loop"].get(key).is_some(), "{key} in {report}");
    }
    let latency = |key: &str, quantile: &str| report["loop"][key][quantile].as_f64().expect("a number");
    // Between two processes, by the driver's own stamp.
    assert!(latency("pose_to_driver_us", "max") > 0.0, "{report}");
    assert!(report["loop"]["phases_us"]["control"]["p50"].as_f64().is_some_and(|us| us > 0.0), "{report}");
    let threads = report["realtime"]["threads"].as_array().expect("an array");
    let comms = threads.iter().find(|thread| thread["name"] == "magsteer-comms").expect("it runs");
    assert_eq!(comms["policy"], "SCHED_OTHER", "telemetry never competes with the loop: {report}");
    assert!(threads.iter().any(|thread| thread["name"] == "magsteer-loop"), "{report}");
    assert!(said.contains("active -> safe-stop: the process was asked to end"), "{said}");
    let minutes = read_minutes(&world.root.path().join("recordings")).expect("own folder");
    let cycles: u64 = minutes.iter().map(|minute| minute.timing.cycles).sum();
    assert_eq!(report["records_dropped"], 0, "{report}");
    assert_eq!(
        report["loop"]["cycles"], cycles,
        "every cycle is in a minute, the last ones in a part of one"
    );
    for minute in &minutes {
        let bins = &minute.histograms.lateness_us;
        assert_eq!(bins.iter().map(|bin| bin.cycles).sum::<u64>(), minute.timing.cycles, "{minute:?}");
    }
    assert_eq!(world.driver.end().limit_breaks(), 0);
}

/// Goal: `--passive` is seen in the status, with what would have stopped the loop and what a trip would do, and the loop
/// steers on; the emergency stop acts.
#[test]
fn passive_daemon_says_so_and_what_would_have_stopped_it() {
    let world = World::with("[daemon.monitors]\nmodel_error_max_deg = 5.0\nmodel_error_stop_ms = 100.0\n");
    let mut daemon = Daemon::start(&world, &["--arm", "--passive"]);
    let status = world.until(|status| status["state"] == "armed");
    assert_eq!((&status["passive"], &status["safe_action"]), (&true.into(), &"ramp".into()), "{status}");
    assert_eq!(status["would_trip"], Value::Null);
    let file = world.file.to_str().expect("plain");
    let output = world.operator(&["target", "set", "m1=70deg", "m2=110deg", "--config", file]);
    assert!(output.status.success());
    world.insist("go");
    let status = world.until(|status| status["would_trip_code"] == 217);
    assert_eq!(status["state"], "active", "{status}");
    let text = world.operator(&["status", file]).stdout;
    assert!(String::from_utf8_lossy(&text).contains("PASSIVE  monitors do not act"));
    world.insist("estop");
    world.until(|status| status["state"] == "fault");
    daemon.signal(Signal::TERM);
    let (_, report, said) = daemon.end();
    assert!(said.contains("passive: would have tripped: the model stays away"), "{said}");
    assert!(report["would_trip_count"].as_u64().is_some_and(|count| count >= 1), "{report}");
    assert!(report["monitors"]["coil_heat_max"].as_f64().is_some_and(|heat| heat < 1.0), "{report}");
    world.driver.end();
}

/// Proves SR-15.
#[test]
fn sigterm_while_idle_ends_with_143_and_closed_input_with_0() {
    let world = World::new();
    let mut daemon = Daemon::start(&world, &[]);
    world.until(|status| status["state"] == "idle");
    daemon.signal(Signal::TERM);
    assert_eq!(daemon.end().0, Some(143));
    let mut daemon = Daemon::start(&world, &["--end-with-stdin"]);
    world.until(|status| status["state"] == "idle");
    drop(daemon.child().stdin.take());
    assert_eq!(daemon.end().0, Some(0));
    world.driver.end();
}

#[test]
fn a_killed_daemon_leaves_coils_at_zero_and_the_next_one_starts() {
    let world = World::new();
    let mut daemon = Daemon::start(&world, &["--arm"]);
    world.until(|status| status["state"] == "armed");
    world.insist("go");
    daemon.signal(Signal::KILL);
    daemon.end();
    let begin = Instant::now();
    while world.driver.state() != driver_state::IDLE {
        assert!(begin.elapsed() < PATIENCE, "the driver's own watchdog ends it");
        std::thread::sleep(Duration::from_millis(5));
    }
    let mut daemon = Daemon::start(&world, &["--arm"]);
    world.until(|status| status["state"] == "armed");
    daemon.signal(Signal::TERM);
    assert_eq!(daemon.end().0, Some(143));
    world.driver.end();
}

#[test]
fn refused_requests_end_with_1_and_name_the_cause() {
    let world = World::new();
    let mut daemon = Daemon::start(&world, &[]);
    world.until(|status| status["state"] == "idle");
    let file = world.file.to_str().expect("plain");
    let output = world.operator(&["go", file, "--json"]);
    assert_eq!(output.status.code(), Some(1));
    let answer: Value = serde_json::from_slice(&output.stdout).expect("one object");
    assert_eq!((&answer["accepted"], &answer["cause_code"]), (&Value::Bool(false), &Value::from(1)));
    assert!(String::from_utf8_lossy(&output.stderr).contains("not possible in this state"));
    world.insist("estop");
    assert_eq!(world.until(|status| status["state"] == "fault")["cause"], "emergency stop");
    world.insist("reset");
    // A latched fault at the end is told by the exit code.
    world.insist("estop");
    daemon.signal(Signal::INT);
    let (code, report, _) = daemon.end();
    assert_eq!((code, &report["state"]), (Some(1), &Value::from("fault")));
    world.driver.end();
}

#[test]
fn without_a_daemon_operators_end_with_69() {
    let world = World::new();
    let file = world.file.to_str().expect("plain");
    for arguments in [vec!["arm", file], vec!["status", file], vec!["stop", "--rig", "bigmag-planar"]] {
        let output = world.operator(&arguments);
        assert_eq!(output.status.code(), Some(69), "{arguments:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("no daemon"), "{arguments:?}");
    }
    world.driver.end();
}

#[test]
fn a_second_daemon_on_a_rig_is_refused() {
    let world = World::new();
    let mut daemon = Daemon::start(&world, &[]);
    world.until(|status| status["state"] == "idle");
    let (code, _, said) = Daemon::start(&world, &[]).end();
    assert_eq!(code, Some(69), "{said}");
    assert!(said.contains("already has a daemon"), "{said}");
    daemon.signal(Signal::INT);
    assert_eq!(daemon.end().0, Some(130));
    world.driver.end();
}

/// Proves SR-23.
#[test]
fn a_cpu_that_is_not_there_keeps_an_enforcing_daemon_from_arming() {
    let world = World::new();
    let file = world.root.path().join("enforcing.toml");
    let text = format!("extends = {:?}\n[daemon]\nrealtime = \"enforce\"\ncpu = 1023\n", world.file);
    std::fs::write(&file, text).expect("own directory");
    let file = file.to_str().expect("plain");
    let mut daemon = world.command(&["run", file]);
    let daemon = daemon.stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
    let mut daemon = Daemon(Some(daemon.expect("the program is built")));
    world.until(|status| status["state"] == "idle");
    let output = world.operator(&["arm", file]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("real-time scheduling is enforced"), "{said}");
    assert_eq!(world.until(|_| true)["state"], "idle");
    daemon.signal(Signal::TERM);
    let (code, _, told) = daemon.end();
    assert_eq!(code, Some(143), "{told}");
    assert!(told.contains("CPU 1023"), "what is not granted is told: {told}");
    world.driver.end();
}

/// Goal: what is reported of the loop's thread is what the kernel says of it, asked by another process; and where its
/// memory is locked, no cycle met a page that was not there.
#[test]
fn what_the_loop_reports_of_its_grants_is_what_the_kernel_says() {
    let world = World::new();
    let mut daemon = Daemon::start(&world, &["--arm"]);
    world.until(|status| status["state"] == "armed");
    world.insist("go");
    let status = world.until(|status| status["state"] == "active");
    let cycle = |status: &Value| status["cycle"].as_u64().expect("a count");
    world.until(|later| cycle(later) > cycle(&status) + 500);
    let process = PathBuf::from(format!("/proc/{}", daemon.child().id()));
    let threads = threads_of(&process);
    let seen = threads.iter().find(|thread| thread.name == "magsteer-loop").expect("it runs");
    let locked = std::fs::read_to_string(process.join("status")).expect("own child");
    let locked_kb = locked.lines().find_map(|line| line.strip_prefix("VmLck:")).expect("proc(5)");
    let locked_kb: u64 = locked_kb.trim().trim_end_matches(" kB").parse().expect("a number");
    daemon.signal(Signal::TERM);
    let (code, report, said) = daemon.end();
    assert_eq!(code, Some(143), "{said}");
    let items = report["realtime"]["items"].as_array().expect("an array");
    let granted = |name: &str| {
        let item = items.iter().find(|item| item["name"] == name).expect("it was asked for");
        item["granted"] == true
    };
    assert_eq!(granted("scheduling"), seen.policy == "SCHED_FIFO", "{seen}: {report}");
    assert_eq!(granted("memory"), locked_kb > 0, "{locked_kb} kB: {report}");
    assert!(granted("timer slack"), "no right is needed for it: {report}");
    // None at all under a real-time policy, one nanosecond under others; hidden from who lacks the rights.
    assert!(seen.timer_slack_ns.is_none_or(|slack| slack <= 1), "{seen}");
    if granted("memory") {
        let usage = &report["loop_thread"];
        assert_eq!(usage["page_faults_minor"], 0, "{report}");
        assert_eq!(usage["page_faults_major"], 0, "{report}");
    }
    world.driver.end();
}

/// Goal: with a CPU of its own, the loop is alone there among the daemon's threads.
#[test]
fn threads_beside_the_loop_keep_off_its_cpu() {
    let cpus = rustix::thread::sched_getaffinity(None).expect("own mask");
    if cpus.count() < 2 {
        println!("skipped: one CPU");
        return;
    }
    let cpu = (0..1024).rfind(|&cpu| cpus.is_set(cpu)).expect("some CPU");
    let world = World::new();
    let file = world.root.path().join("pinned.toml");
    let text = format!("extends = {:?}\n[daemon]\ncpu = {cpu}\n", world.file);
    std::fs::write(&file, text).expect("own directory");
    let mut daemon = world.command(&["run", file.to_str().expect("plain")]);
    let daemon = daemon.stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let mut daemon = Daemon(Some(daemon.expect("the program is built")));
    world.until(|status| status["state"] == "idle");
    let threads = threads_of(Path::new(&format!("/proc/{}", daemon.child().id())));
    assert!(threads.len() > 3, "{threads:?}");
    for thread in &threads {
        let is_alone = thread.name == "magsteer-loop";
        let may_run_there = thread.cpus.split(',').any(|range| {
            let (first, last) = range.split_once('-').unwrap_or((range, range));
            (first.parse().unwrap_or(usize::MAX)..=last.parse().unwrap_or(0)).contains(&cpu)
        });
        assert_eq!(may_run_there, is_alone, "{thread}");
    }
    daemon.signal(Signal::TERM);
    assert_eq!(daemon.end().0, Some(143));
    world.driver.end();
}

#[test]
fn targets_that_make_no_sense_end_with_2() {
    let world = World::new();
    let file = world.file.to_str().expect("plain");
    for (target, reason) in [("m3=10deg", "m1, m2"), ("m1=70", "with its unit"), ("m1=400deg", "360deg")] {
        let output = world.operator(&["target", "set", target, "--config", file]);
        assert_eq!(output.status.code(), Some(2), "{target}");
        assert!(String::from_utf8_lossy(&output.stderr).contains(reason), "{target}");
    }
    world.driver.end();
}
