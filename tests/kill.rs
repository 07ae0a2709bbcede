//! Daemon, plant and demonstration killed, stopped and signalled as processes, on the shipped planar configuration.
//!
//! Times of ramps are the plant's own: from the last command that it obeyed to zero current in every coil, on its clock.
//! No test judges how long anything else took; each waits for a state, bounded only so that a failure ends.

#![cfg(feature = "sim")]

mod process_support;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::channels::{Endpoint, PrivateRoot};
use magsteer_hal::operator::{Cause, state, verb};
use process_support::{End, Operator, Process, World, current, until};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// A coil that carries less counts as being at rest, A: `ramp_done_a` of the configuration.
const REST: f64 = 0.1;

/// Causes by which a loop stops that the machine kept from running.
const STARVED: [Cause; 5] =
    [Cause::PoseStale, Cause::Overruns, Cause::FeedbackStale, Cause::AuthorityLost, Cause::RampTimeout];

fn number(report: &Value, key: &str) -> f64 {
    report[key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"))
}

/// Checks what a plant says at its end: it carried current, and every coil came to zero within the watchdog's time.
fn assert_came_to_zero_in_time(world: &World, end: &End) {
    let report = &end.report;
    assert_eq!(end.code, Some(0), "{}", end.said);
    assert_eq!(report["ended_currentless"], true, "{report}");
    assert_eq!(report["limit_breaks"], 0, "{report}");
    let most = number(report, "current_max_a");
    assert!(most > 0.5, "{report}");
    let (took, allowed) = (number(report, "ramp_down_from_last_command_ms"), world.watchdog_ms(most));
    // While the plant itself is held up, its coils are too.
    let held_up = 1e-3 * number(report, "lateness_max_us");
    assert!(took <= allowed + held_up, "{took} ms, not {allowed} ms: {report}");
    println!("{took:.1} ms from the last command to zero, of {allowed:.1} ms and {held_up:.1} ms of delay");
}

/// Proves SR-01.
#[test]
fn a_killed_daemon_leaves_coils_at_zero_in_the_watchdogs_time_and_the_next_one_steers() {
    let world = World::new();
    let mut plant = world.plant();
    for _ in 0..2 {
        let daemon = world.daemon();
        let mut operator = world.operator();
        operator.steer();
        daemon.kill();
    }
    assert!(plant.runs());
    assert_came_to_zero_in_time(&world, &plant.end());
}

/// Proves SR-02 and SR-03.
#[test]
fn a_killed_plant_ends_steering_in_a_fault_and_its_follower_is_steered_by_the_same_daemon() {
    let world = World::new();
    let plant = world.plant();
    let mut daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    plant.kill();
    let status = operator.until_state(state::FAULT);
    let cause = Cause::from_code(status.cause).expect("known").text();
    assert!(cause.contains("driver"), "{cause}");
    assert!(daemon.said().contains("no fresh feedback from the driver"), "{}", daemon.said());
    assert!(daemon.runs());
    assert_a_silent_driver_is_told(&world, &mut operator);
    let plant = world.plant();
    // Held in its fault until it is reset, though the driver is back.
    let feedback_is_back = |status: &_| current(status) < 0.01;
    for _ in 0..50 {
        assert_eq!(operator.until(feedback_is_back).state, state::FAULT);
        std::thread::sleep(Duration::from_millis(10));
    }
    until(
        || {
            operator.ask(verb::RESET);
            operator.status().filter(|status| status.state == state::IDLE)
        },
        || "not reset".to_owned(),
    );
    operator.steer();
    daemon.kill();
    assert_came_to_zero_in_time(&world, &plant.end());
}

/// What was measured last is shown with its age, and who resets without a driver is told what helps.
fn assert_a_silent_driver_is_told(world: &World, operator: &mut Operator) {
    operator.until(|status| status.feedback_age_us > 300e3 && status.pose_age_us > 300e3);
    let say = |verb: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        let output = command.arg(verb).arg(&world.file).arg("--root").arg(world.root.path()).output();
        let output = output.expect("the program is built");
        (output.status.code(), String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned())
    };
    let (code, told) = say("status");
    assert_eq!(code, Some(0), "{told}");
    for measured in ["measured ", "currents "] {
        let line = told.lines().find(|line| line.starts_with(measured)).expect("a line");
        assert!(line.ends_with(" s ago)"), "{told}");
    }
    let (code, told) = say("reset");
    assert_eq!(code, Some(1), "{told}");
    assert!(told.contains("start the driver"), "{told}");
}

/// Proves SR-01 and SR-03.
#[test]
fn a_daemon_stopped_for_a_second_finds_coils_at_zero_and_does_not_resume() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    daemon.signal(Signal::STOP);
    std::thread::sleep(Duration::from_secs(1));
    daemon.signal(Signal::CONT);
    let woken = Stamp::now();
    let since_then = |status: &magsteer_hal::operator::StatusMessage| status.header.source_stamp() > woken;
    let status = operator.until(|status| since_then(status) && status.state == state::FAULT);
    assert!(current(&status) < REST, "{status:?}");
    for _ in 0..100 {
        let status = operator.until(since_then);
        assert_eq!(status.state, state::FAULT);
        assert!(current(&status) < REST, "{status:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
    // Nothing it sent after waking was obeyed, so that the last way to zero is the watchdog's.
    let plant = plant.end();
    daemon.end();
    assert_came_to_zero_in_time(&world, &plant);
}

/// Steers, signals, and returns how daemon and plant ended.
fn signalled(signal: Signal) -> (End, End) {
    // A machine that keeps the loop from running for long ends it in a fault before the signal does.
    for _ in 0..5 {
        let world = World::new();
        let plant = world.plant();
        let daemon = world.daemon();
        world.operator().steer();
        daemon.signal(signal);
        let ends = (daemon.wait(), plant.end());
        let code = ends.0.report["cause_code"].as_u64();
        if !STARVED.iter().any(|cause| Some(u64::from(cause.code())) == code) {
            return ends;
        }
    }
    panic!("starved five times");
}

/// Proves SR-15.
#[test]
fn sigint_and_sigterm_ramp_down_on_measured_current_and_end_with_130_and_143() {
    for (signal, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let (daemon, plant) = signalled(signal);
        assert_eq!(daemon.code, Some(code), "{}", daemon.said);
        let report = &daemon.report;
        assert_eq!(report["state"], "idle", "{report}");
        assert!(number(report, "ramp_down_ms") > 0.0, "{report}");
        assert!(number(report, "ramp_down_from_a") > number(report, "ramp_down_to_a"), "{report}");
        assert!(number(report, "ramp_down_to_a") < REST, "{report}");
        assert_eq!(report["limit_breaks"], 0, "{report}");
        assert_eq!((plant.code, &plant.report["ended_currentless"]), (Some(0), &Value::Bool(true)));
    }
}

/// Where in its life a daemon is killed.
#[derive(Debug, Clone, Copy)]
enum Moment {
    Boot,
    Idle,
    Arming,
    Armed,
    Steering,
    RampDown,
}

/// Brings a daemon to a moment, some time after which it is to be killed.
fn bring_to(moment: Moment, world: &World, daemon: &mut Process) {
    if matches!(moment, Moment::Boot) {
        return;
    }
    let mut operator = world.operator();
    operator.until_state(state::IDLE);
    match moment {
        Moment::Boot | Moment::Idle => (),
        Moment::Arming => _ = operator.ask(verb::ARM),
        Moment::Armed => until(
            || {
                operator.ask(verb::ARM);
                operator.status().filter(|status| status.state == state::ARMED).map(drop)
            },
            || "not armed".to_owned(),
        ),
        Moment::Steering => drop(operator.steer()),
        Moment::RampDown => {
            operator.steer();
            operator.ask(verb::STOP);
        }
    }
    assert!(daemon.runs());
}

/// Proves SR-01.
#[test]
fn a_daemon_killed_at_any_moment_leaves_coils_at_zero_and_a_clean_start_to_the_next() {
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let moments = [
        Moment::Boot,
        Moment::Idle,
        Moment::Arming,
        Moment::Armed,
        Moment::RampDown,
        Moment::Boot,
        Moment::RampDown,
        // Last, so that the way to zero that the plant reports is its watchdog's.
        Moment::Steering,
    ];
    let world = World::new();
    let mut plant = world.plant();
    for moment in moments {
        let mut daemon = world.daemon();
        bring_to(moment, &world, &mut daemon);
        // About as long as booting takes, and as a ramp.
        let longest = if matches!(moment, Moment::Boot) { 60.0 } else { 12.0 };
        std::thread::sleep(Duration::from_secs_f64(1e-3 * random.random_range(0.0..longest)));
        daemon.kill();
        let next = world.daemon();
        let mut operator = world.operator();
        operator.until(|status| status.state == state::IDLE && current(status) < 0.01);
        next.signal(Signal::TERM);
        let end = next.wait();
        assert_eq!(end.code, Some(143), "after {moment:?}: {}", end.said);
        assert!(plant.runs());
    }
    assert_came_to_zero_in_time(&world, &plant.end());
}

/// Proves SR-05.
#[test]
fn a_second_daemon_and_a_second_plant_are_refused_with_69_and_the_holders_process() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    world.operator().until_state(state::IDLE);
    for (holder, second) in [(&plant, world.plant()), (&daemon, world.daemon())] {
        let end = second.wait();
        assert_eq!(end.code, Some(69), "{}", end.said);
        assert!(end.said.contains(&format!("process {}", holder.pid())), "{}", end.said);
    }
    let end = daemon.end();
    assert_eq!(end.code, Some(0), "the first one was not disturbed: {}", end.said);
    assert_eq!(plant.end().code, Some(0));
}

/// True while a process is there and not merely unburied.
fn lives(pid: u32) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // PID (NAME) STATE; the name may contain anything.
    status.rsplit_once(')').is_some_and(|(_, rest)| !rest.trim_start().starts_with(['Z', 'X']))
}

/// Proves SR-15.
#[test]
fn children_of_a_killed_demonstration_end_by_themselves_at_zero_current() {
    let world = World::new();
    let folder = world.root.path().join("demo");
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let demo = Process::spawn(command.arg("demo").arg("--out").arg(&folder), world.root.path().join("log"));
    let root = PathBuf::from(format!("/dev/shm/magsteer-demo-{}-0", demo.pid()));
    let rig = world.endpoint.rig();
    // The holders of the two roles say who they are.
    let holder = |role: &str| {
        let text = std::fs::read_to_string(root.join(format!("{rig}.{role}.lock"))).ok()?;
        text.trim().parse::<u32>().ok()
    };
    let children = ["driver", "daemon"].map(|role| until(|| holder(role), || demo.said()));
    let mut operator = Operator::open(&Endpoint::new(rig, Some(&root)).expect("the demonstration's"));
    operator.until(|status| status.state == state::ACTIVE && current(status) > 0.5);
    demo.kill();
    for child in children {
        until(|| (!lives(child)).then_some(()), || format!("process {child} goes on"));
    }
    let status = operator.last_status().expect("one was seen");
    assert!(current(&status) < REST, "{status:?}");
    let log = |name: &str| std::fs::read_to_string(folder.join(name)).expect("kept");
    let (daemon, plant) = (log("run.log"), log("sim-plant.log"));
    assert!(daemon.contains("active -> safe-stop: the process was asked to end"), "{daemon}");
    assert!(plant.contains("ended at zero current"), "{plant}");
    // What the killed one left in shared memory goes when the next one starts.
    drop(operator);
    drop(PrivateRoot::create("magsteer-demo").expect("made"));
    assert!(!Path::new(&root).exists());
}

/// Proves SR-15.
#[test]
fn interrupted_demonstration_ends_with_130_at_zero_current_and_leaves_nothing() {
    let world = World::new();
    let folder = world.root.path().join("demo");
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let demo = Process::spawn(command.arg("demo").arg("--out").arg(&folder), world.root.path().join("log"));
    let root = PathBuf::from(format!("/dev/shm/magsteer-demo-{}-0", demo.pid()));
    until(|| folder.join("run.log").exists().then_some(()), || demo.said());
    let mut operator = Operator::open(&Endpoint::new(world.endpoint.rig(), Some(&root)).expect("its"));
    operator.until(|status| status.state == state::ACTIVE && current(status) > 0.5);
    drop(operator);
    let pid = Pid::from_raw(i32::try_from(demo.pid()).expect("a process")).expect("not zero");
    kill_process(pid, Signal::INT).expect("the child is there");
    let end = demo.wait();
    assert_eq!(end.code, Some(130), "{}", end.said);
    assert!(end.said.contains("every coil is at zero current"), "{}", end.said);
    assert!(!root.exists());
}
