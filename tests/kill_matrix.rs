//! Daemon and plant killed (SIGKILL), stopped (SIGSTOP) and asked to end (SIGTERM) in every state, as processes over shared
//! memory: every coil at zero within the stated time, and the pair comes back with nothing cleared by hand.
//!
//! Times are the plant's own: the longest way from a command that it obeyed to zero in every coil, on its clock. A plant
//! that is killed takes its coils along; its follower starts at zero. No test judges how long anything else took.
//!
//! Each case runs once in the suite, some at a time, each in a root of its own. More rounds, for a long night:
//! `MAGSTEER_KILL_ROUNDS=100 cargo test --release --test kill_matrix -- --nocapture`.

#![cfg(feature = "sim")]

mod process_support;

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use magsteer::config::Config;
use magsteer_hal::Stamp;
use magsteer_hal::operator::{StatusMessage, state, verb};
use process_support::{End, Operator, Process, World, current, until};
use rustix::process::{Pid, Resource, Rlimit, Signal, prlimit};
use serde_json::Value;

/// How often the whole matrix is gone through.
const ROUNDS_VARIABLE: &str = "MAGSTEER_KILL_ROUNDS";
/// Pairs at a time.
const PAIRS: usize = 3;
/// A coil that carries less counts as being at rest, A: `ramp_done_a` of the configuration.
const REST: f64 = 0.1;
/// How long a process stays stopped: longer than a command's validity and a ramp, and than feedback may be old.
const STOPPED: Duration = Duration::from_millis(450);
/// Most cells of a hundred that may be struck in another state than theirs: the machine kept a process from
/// running in between.
const ELSEWHERE_MAX_PERCENT: usize = 5;
/// Slew limit in the cases that strike during a ramp, A/s: from 1 A it takes 100 ms.
const SLOW_SLEW: &str = "slew_max_a_per_s = 10.0";

#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Daemon,
    Plant,
}

#[derive(Debug, Clone, Copy)]
struct Case {
    side: Side,
    state: u32,
    signal: Signal,
}

fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for signal in [Signal::KILL, Signal::STOP, Signal::TERM] {
        for state in state::BOOT..=state::FAULT {
            for side in [Side::Daemon, Side::Plant] {
                cases.push(Case { side, state, signal });
            }
        }
    }
    cases
}

/// A pair under way; a side is absent between its end and its follower's start.
struct Pair {
    world: World,
    plant: Option<Process>,
    daemon: Option<Process>,
    operator: Operator,
}

/// A world of its own; with slow ramps where a case strikes during one.
fn world(case: Case) -> World {
    let mut world = World::beside();
    if case.state == state::SAFE_STOP {
        let shipped = std::fs::read_to_string(&world.file).expect("shipped");
        world.file = world.root.path().join("slow.toml");
        let slow = shipped.replace("slew_max_a_per_s = 300.0", SLOW_SLEW);
        assert_ne!(slow, shipped);
        std::fs::write(&world.file, slow).expect("own directory");
        world.config = Config::load(&world.file).expect("as shipped but for the slew").1;
    }
    world
}

impl Pair {
    /// A daemon in the state of the case. In `BOOT` the plant is stopped, so that no feedback comes.
    fn bring_to(case: Case) -> Self {
        let world = world(case);
        let plant = world.plant();
        if case.state == state::BOOT {
            until(|| plant.said().contains("is running").then_some(()), || plant.said());
            plant.signal(Signal::STOP);
        }
        let daemon = world.daemon();
        let operator = world.operator();
        let mut pair = Self { world, plant: Some(plant), daemon: Some(daemon), operator };
        pair.reach(case.state);
        pair
    }

    fn reach(&mut self, code: u32) {
        match code {
            state::BOOT | state::IDLE => _ = self.operator.until_state(code),
            state::ARMED => self.arm(),
            state::ACTIVE => _ = self.operator.steer(),
            state::HOLDING => {
                self.operator.steer();
                let holds = || {
                    let status = self.operator.status()?;
                    match status.state {
                        state::ACTIVE => _ = self.operator.ask(verb::HOLD),
                        state::HOLDING => (),
                        // The machine kept the loop from running.
                        _ => _ = self.operator.steer(),
                    }
                    (status.state == state::HOLDING).then_some(())
                };
                until(holds, || "not holding".to_owned());
            }
            state::SAFE_STOP => {
                self.operator.steer();
                self.operator.ask(verb::STOP);
            }
            _ => {
                self.operator.steer();
                self.operator.ask(verb::ESTOP);
                self.operator.until_state(state::FAULT);
            }
        }
    }

    /// Asks for one state after the other until the daemon is armed, as an operator would: nothing else is cleared.
    fn arm(&mut self) {
        let daemon = self.daemon.as_ref().expect("one runs");
        let operator = &mut self.operator;
        // For the message of a failure: what was answered last, and the age of the poses.
        let last = Cell::new((None, 0.0));
        let armed = || {
            let status = operator.status()?;
            let answer = match status.state {
                state::IDLE => operator.ask(verb::ARM),
                state::FAULT => operator.ask(verb::RESET),
                _ => last.get().0,
            };
            last.set((answer, status.pose_age_us));
            (status.state == state::ARMED).then_some(())
        };
        until(armed, || format!("not armed: cause and age of poses {:?}: {}", last.get(), daemon.said()));
    }

    /// What the daemon says of itself last before the strike. A stop that was asked for shows in a status or
    /// two; where its ramp is over by then, that is what is struck.
    fn before_strike(&mut self, code: u32) -> StatusMessage {
        let shows = |status: &StatusMessage| {
            let still_steers = matches!(status.state, state::ARMED | state::ACTIVE | state::HOLDING);
            code != state::SAFE_STOP || !still_steers
        };
        self.operator.until(shows)
    }

    /// Waits for a status after `since` without authority and with every coil at rest.
    fn expect_rest_since(&mut self, since: Stamp) {
        self.operator.until(|status: &StatusMessage| {
            let newer = status.header.source_stamp() > since;
            newer && matches!(status.state, state::IDLE | state::FAULT) && current(status) < REST
        });
    }

    fn signal(&self, side: Side, signal: Signal) {
        let process = if side == Side::Daemon { &self.daemon } else { &self.plant };
        process.as_ref().expect("it runs").signal(signal);
    }
}

/// What a strike came to.
struct Outcome {
    /// State that the daemon told last before.
    found: u32,
    /// Largest current measured then, A.
    current: f64,
    /// The plant's longest way to zero, ms.
    took: f64,
    /// What was allowed, ms.
    allowed: f64,
}

/// Strikes, checks, and lets the pair come back.
fn strike(case: Case) -> Outcome {
    let mut pair = Pair::bring_to(case);
    let before = pair.before_strike(case.state);
    let struck = Stamp::now();
    pair.signal(case.side, case.signal);
    if case.signal == Signal::STOP {
        std::thread::sleep(STOPPED);
        pair.signal(case.side, Signal::CONT);
    }
    // A plant that stood still before takes what was sent to it, and goes on where it was not struck.
    let plant_is_gone = (case.side, case.signal) == (Side::Plant, Signal::KILL);
    if case.state == state::BOOT && !plant_is_gone {
        pair.signal(Side::Plant, Signal::CONT);
    }
    if case.signal != Signal::STOP {
        follow(case, &mut pair);
    }
    pair.expect_rest_since(struck);
    pair.arm();
    let end = pair.daemon.take().expect("it runs").end();
    assert_eq!(end.code, Some(0), "{}", end.said);
    assert_eq!(end.report["limit_breaks"], 0, "{}", end.report);
    let (took, allowed) = came_to_zero(&pair.world, &pair.plant.take().expect("it runs").end());
    Outcome { found: before.state, current: current(&before), took, allowed }
}

/// Waits for the end of the side that was struck, and starts its follower.
fn follow(case: Case, pair: &mut Pair) {
    if case.side == Side::Plant {
        let end = pair.plant.take().expect("it ran").wait();
        if case.signal == Signal::TERM {
            assert_eq!(end.code, Some(143), "{}", end.said);
            came_to_zero(&pair.world, &end);
        }
        pair.plant = Some(pair.world.plant());
        return;
    }
    let end = pair.daemon.take().expect("it ran").wait();
    if case.signal == Signal::TERM {
        // A loop that ended in a fault says so.
        let in_fault = end.report["state"] == "fault";
        assert_eq!(end.code, Some(if in_fault { 1 } else { 143 }), "{}", end.said);
        assert!(in_fault || case.state != state::FAULT, "{}", end.report);
    }
    pair.daemon = Some(pair.world.daemon());
    pair.operator = pair.world.operator();
}

/// What a plant says at its end: at zero, no command beyond a limit, and no way to zero longer than stated.
fn came_to_zero(world: &World, end: &End) -> (f64, f64) {
    let report = &end.report;
    assert!(matches!(end.code, Some(0 | 143)), "{}", end.said);
    assert_eq!(
        (&report["ended_currentless"], &report["limit_breaks"]),
        (&Value::Bool(true), &0.into()),
        "{report}"
    );
    let number = |key: &str| report[key].as_f64().unwrap_or_else(|| panic!("{key} in {report}"));
    let took = number("ramp_down_longest_ms");
    // While the plant itself is held up, its coils are too.
    let allowed = world.watchdog_ms(number("current_max_a")) + 1e-3 * number("lateness_max_us");
    assert!(took <= allowed, "{took} ms, not {allowed} ms: {report}");
    (took, allowed)
}

/// Proves SR-01, SR-02, SR-03 and SR-15.
#[test]
fn either_side_killed_stopped_or_ended_in_any_state_leaves_zero_current_and_a_pair_that_comes_back() {
    let rounds: usize =
        std::env::var(ROUNDS_VARIABLE).ok().map_or(1, |text| text.parse().expect("a number of rounds"));
    let all: Vec<Case> = (0..rounds).flat_map(|_| cases()).collect();
    let [next, failed, elsewhere] = [(); 3].map(|()| AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..PAIRS {
            scope.spawn(|| {
                while let Some(case) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let what = format!("{:?} in {} by {:?}", case.side, state::name(case.state), case.signal);
                    match catch_unwind(AssertUnwindSafe(|| strike(*case))) {
                        Ok(Outcome { found, current, took, allowed }) => {
                            elsewhere.fetch_add(usize::from(found != case.state), Ordering::Relaxed);
                            let found = state::name(found);
                            println!("{what}, found in {found} at {current:.2} A: {took:.1} ms to zero, of {allowed:.1} ms");
                        }
                        Err(_) => {
                            failed.fetch_add(1, Ordering::Relaxed);
                            println!("{what}: FAILED");
                        }
                    }
                }
            });
        }
    });
    let elsewhere = elsewhere.load(Ordering::Relaxed);
    println!("{} cases, {} failed, {elsewhere} struck elsewhere", all.len(), failed.load(Ordering::Relaxed));
    assert_eq!((all.len(), failed.load(Ordering::Relaxed)), (42 * rounds, 0));
    assert!(
        100 * elsewhere <= ELSEWHERE_MAX_PERCENT * all.len(),
        "{elsewhere} struck in another state than theirs"
    );
}

/// Proves SR-15.
/// Goal: a terminal that is closed ramps the coils down as a request to end does.
#[test]
fn closed_terminal_ends_both_sides_at_zero_current() {
    let world = World::new();
    let plant = world.plant();
    let daemon = world.daemon();
    world.operator().steer();
    daemon.signal(Signal::HUP);
    let end = daemon.wait();
    let in_fault = end.report["state"] == "fault";
    assert_eq!(end.code, Some(if in_fault { 1 } else { 143 }), "{}", end.said);
    plant.signal(Signal::HUP);
    let end = plant.wait();
    assert_eq!(end.code, Some(143), "{}", end.said);
    came_to_zero(&world, &end);
}

/// Goal: `magsteer run ... 2>&1 | head` whose reader went away: the loop steers on, stops on request, and ends at zero current.
///
/// Proves SR-15.
#[test]
fn daemon_whose_output_nobody_reads_steers_on_and_ends_at_zero_current() {
    let world = World::new();
    let plant = world.plant();
    let mut child = Command::new(env!("CARGO_BIN_EXE_magsteer"))
        .args(["run", path(&world.file), "--wait-s", "30", "--json", "--end-with-stdin"])
        .args(["--root", path(world.root.path())])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is built");
    drop((child.stdout.take(), child.stderr.take()));
    let mut operator = world.operator();
    operator.steer();
    // Each of these is told on a standard error that is closed.
    operator.ask(verb::STOP);
    operator.until(|status| matches!(status.state, state::IDLE | state::FAULT) && current(status) < REST);
    operator.steer();
    drop(child.stdin.take());
    let code = until(|| child.try_wait().expect("a child"), || "it goes on".to_owned()).code();
    // Asked to end by its closed input, it did: a report that nobody wanted to read is no failure.
    assert_eq!(code, Some(0));
    came_to_zero(&world, &plant.end());
}

/// Goal: a machine without memory left: no more address space for the daemon from here on, while it steers. The loop asks
/// for none and steers on; however it ends, the coils come to zero.
///
/// Proves SR-15 and SR-19.
#[test]
fn daemon_without_memory_left_steers_on_and_ends_at_zero_current() {
    let world = World::new();
    let plant = world.plant();
    let mut daemon = world.daemon();
    let mut operator = world.operator();
    operator.steer();
    let pid = Pid::from_raw(i32::try_from(daemon.pid()).expect("a process")).expect("not zero");
    prlimit(Some(pid), Resource::As, Rlimit { current: Some(1 << 20), maximum: Some(1 << 20) })
        .expect("its own child");
    let cycle = operator.until(|_| true).cycle;
    let status = operator.until(|status| status.cycle > cycle + 1_000);
    assert!(daemon.runs());
    println!("{} after 1000 cycles without memory", state::name(status.state));
    daemon.signal(Signal::TERM);
    let end = daemon.wait();
    assert_eq!(end.report["limit_breaks"], 0, "{:?} {}", end.code, end.said);
    came_to_zero(&world, &plant.end());
}

fn path(path: &Path) -> &str {
    path.to_str().expect("plain")
}
