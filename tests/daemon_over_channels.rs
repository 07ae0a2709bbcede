//! The daemon over real shared memory: an ideal driver in a thread, the daemon in another, an operator here.
//!
//! No test judges how long anything took; each waits for a state, bounded only so that a failure ends.

mod ideal_driver;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ideal_driver::Driver;
use magsteer::control::{CycleInput, CycleOutcome, Directions, Step};
use magsteer::daemon::{DaemonConfig, RunError, RunPlan, RunReport, StopFlag, run};
use magsteer_hal::channels::{Endpoint, OperatorClient, PrivateRoot};
use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, OperatorAnswer, OperatorRequest, StatusMessage, state, verb};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{Actuation, Stamp};

const PATIENCE: Duration = Duration::from_secs(20);

/// What differs from the shipped file. Wide limits: a machine that runs many tests at once stops threads for long.
const WIDE: &str = r#"
rate_hz = 500.0
command_validity_ms = 1000.0
pose_hold_ms = 2000.0
pose_stop_ms = 4000.0
pose_error_max_deg = 180.0
following_current_max_a = 100.0
following_angle_max_deg = 360.0
following_stop_ms = 5000.0
feedback_stop_ms = 2000.0
model_stop_ms = 2000.0
ramp_timeout_ms = 5000.0
arm_timeout_ms = 150.0
overrun_fraction = 0.99
overrun_window_ms = 10000.0
priority = 10
lock_memory = false

[monitors]
current_error_max_a = 100.0
current_error_stop_ms = 10000.0
open_stop_ms = 10000.0
model_error_max_deg = 180.0
controller_frozen_ms = 10000.0
"#;

fn config() -> DaemonConfig {
    let shipped: toml::Table = include_str!("../config/bigmag-planar.toml").parse().expect("shipped");
    let mut daemon = shipped["daemon"].as_table().expect("a table").clone();
    daemon.remove("recorder");
    for (key, value) in WIDE.parse::<toml::Table>().expect("written here") {
        match (daemon.get_mut(&key), value) {
            (Some(toml::Value::Table(shipped)), toml::Value::Table(wide)) => shipped.extend(wide),
            (_, value) => _ = daemon.insert(key, value),
        }
    }
    daemon.try_into().expect("written here")
}

/// Asks for constant currents; panics in its cycle when told to.
struct Constant {
    panics: Arc<AtomicBool>,
}

impl Step for Constant {
    fn step(&mut self, input: &CycleInput) -> CycleOutcome {
        assert!(!self.panics.load(Ordering::Relaxed), "told to panic");
        let mut request = input.admitted;
        if input.engaged {
            request.current_a[..3].copy_from_slice(&[2.0, -2.0, 1.0]);
        }
        CycleOutcome { desired: input.target.directions, ..CycleOutcome::asking_for(request) }
    }
}

/// A daemon in a thread of its own.
struct Daemon {
    stop: Arc<StopFlag>,
    panics: Arc<AtomicBool>,
    thread: JoinHandle<Result<RunReport, RunError>>,
}

impl Daemon {
    fn start(endpoint: &Endpoint, arm: bool) -> Self {
        let stop = Arc::new(StopFlag::new());
        let panics = Arc::new(AtomicBool::new(false));
        let (endpoint, stop_inside) = (endpoint.clone(), Arc::clone(&stop));
        let controller = Constant { panics: Arc::clone(&panics) };
        let thread = std::thread::spawn(move || {
            let config = config();
            let description = example_description();
            let plan = RunPlan {
                description: &description,
                config: &config,
                endpoint: &endpoint,
                driver_wait: PATIENCE,
                arm,
                recorder: None,
                companion: None,
                config_digest: 0,
            };
            run(&plan, || controller, &stop_inside)
        });
        Self { stop, panics, thread }
    }

    fn end(self) -> Result<RunReport, RunError> {
        self.stop.request(2);
        self.thread.join().expect("errors are returned, not thrown")
    }
}

struct Operator(OperatorClient);

impl Operator {
    fn join(endpoint: &Endpoint) -> Self {
        Self(OperatorClient::open(endpoint, PATIENCE).expect("a daemon was started"))
    }

    fn ask(&mut self, verb: u32) -> OperatorAnswer {
        self.send(OperatorRequest { verb, ..OperatorRequest::default() })
    }

    /// Sends until an answer comes: on a starved machine one may be late, which means not done.
    fn send(&mut self, request: OperatorRequest) -> OperatorAnswer {
        let begin = Instant::now();
        loop {
            match self.0.send(request, Duration::from_millis(500)) {
                Ok(answer) => return answer,
                Err(error) => assert!(begin.elapsed() < PATIENCE, "{error}"),
            }
        }
    }

    /// Asks again until accepted.
    fn insist(&mut self, verb: u32) {
        let begin = Instant::now();
        while self.ask(verb).accepted != 1 {
            assert!(begin.elapsed() < PATIENCE, "verb {verb}: {:?}", self.ask(verb));
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn until(&mut self, wanted: impl Fn(&StatusMessage) -> bool) -> StatusMessage {
        let begin = Instant::now();
        loop {
            let status = self.0.newest_status(Stamp::now());
            match status {
                Some(status) if wanted(&status) => return status,
                _ => assert!(begin.elapsed() < PATIENCE, "{status:?}"),
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn world() -> (PrivateRoot, Endpoint) {
    let root = PrivateRoot::create("ms").expect("shared memory is there");
    let endpoint = root.endpoint("example").expect("short and own");
    (root, endpoint)
}

/// A driver and a daemon that was armed at its start and let go.
struct Steering {
    _root: PrivateRoot,
    endpoint: Endpoint,
    driver: Driver,
    daemon: Daemon,
    operator: Operator,
}

impl Steering {
    fn begin() -> Self {
        let (root, endpoint) = world();
        let driver = Driver::start(&endpoint, example_description());
        let daemon = Daemon::start(&endpoint, true);
        let mut operator = Operator::join(&endpoint);
        operator.until(|status| status.state == state::ARMED);
        operator.insist(verb::GO);
        Self { _root: root, endpoint, driver, daemon, operator }
    }
}

#[test]
fn an_operator_arms_steers_sets_targets_and_stops() {
    let (_root, endpoint) = world();
    let driver = Driver::start(&endpoint, example_description());
    let daemon = Daemon::start(&endpoint, false);
    let mut operator = Operator::join(&endpoint);
    operator.until(|status| status.state == state::IDLE);
    let refused = operator.ask(verb::GO);
    assert_eq!((refused.accepted, refused.cause), (0, Cause::WrongState.code()));
    operator.insist(verb::ARM);
    let armed = operator.until(|status| status.state == state::ARMED);
    assert_eq!(armed.admitted, Actuation::default());
    assert_eq!(armed.description_fingerprint, example_description().fingerprint());
    let [first, second, none, ..] = armed.measured_position_m;
    assert_eq!([first, second, none], [ideal_driver::POSITION_M, ideal_driver::POSITION_M, [0.0; 3]]);
    operator.insist(verb::GO);
    let status = operator.until(|status| (status.admitted.current_a[0] - 2.0).abs() < 1e-9);
    assert_eq!((status.state, status.coil_count, status.magnet_count), (state::ACTIVE, 3, 2));
    let mut direction = Directions::default();
    (direction[0], direction[1]) = ([1.0, 0.0, 0.0], [0.6, 0.0, 0.8]);
    let target =
        OperatorRequest { verb: verb::SET_TARGET, magnet_count: 2, direction, ..OperatorRequest::default() };
    assert_eq!(operator.send(target).accepted, 1);
    operator.until(|status| status.target_direction == direction && status.desired_direction == direction);
    operator.insist(verb::STOP);
    let status = operator.until(|status| status.state == state::IDLE);
    assert_eq!(status.cause, Cause::OperatorStop.code());
    let report = daemon.end().expect("a clean end");
    assert!(report.is_clean() && report.timing.cycles > 0);
    assert!(report.ramp_down_ms.is_some_and(|duration| duration > 0.0));
    let guard = driver.end();
    assert_eq!(guard.limit_breaks(), 0);
}

#[test]
fn a_signal_while_steering_ramps_down_before_the_daemon_ends() {
    let Steering { _root, driver, daemon, mut operator, .. } = Steering::begin();
    operator.until(|status| (status.measured.current_a[1] + 2.0).abs() < 1e-9);
    let report = daemon.end().expect("a clean end");
    assert_eq!((report.state.as_str(), report.cause_code), ("idle", Cause::Terminated.code()));
    assert!(report.ramp_down_from_a.expect("it ramped") > 1.9);
    assert!(report.ramp_down_to_a.expect("it ramped") < 0.1);
    assert_ne!(driver.state(), driver_state::DRIVEN);
    driver.end();
}

/// Proves SR-24.
#[test]
fn a_panic_in_the_loop_ends_with_an_error_and_coils_at_zero() {
    let Steering { _root, driver, daemon, mut operator, .. } = Steering::begin();
    operator.until(|status| (status.measured.current_a[0] - 2.0).abs() < 1e-9);
    daemon.panics.store(true, Ordering::Relaxed);
    let result = daemon.thread.join().expect("the panic stays in the loop's thread");
    assert!(matches!(result, Err(RunError::LoopPanicked)), "{result:?}");
    let begin = Instant::now();
    while driver.state() != driver_state::IDLE {
        assert!(begin.elapsed() < PATIENCE, "the driver's own watchdog ends it");
        std::thread::sleep(Duration::from_millis(5));
    }
    driver.end();
}

#[test]
fn a_driver_that_vanishes_trips_and_a_new_one_is_met_without_restarting_the_daemon() {
    let Steering { _root, endpoint, driver, daemon, mut operator } = Steering::begin();
    operator.until(|status| status.state == state::ACTIVE);
    driver.end();
    operator.until(|status| status.state == state::FAULT);
    let driver = Driver::start(&endpoint, example_description());
    operator.insist(verb::RESET);
    operator.insist(verb::ARM);
    operator.until(|status| status.state == state::ARMED);
    assert!(daemon.end().expect("a clean end").is_clean());
    driver.end();
}

#[test]
fn without_a_driver_the_daemon_says_so_or_ends_when_asked() {
    let (_root, endpoint) = world();
    let daemon = Daemon::start(&endpoint, false);
    let result = daemon.end();
    assert!(matches!(result, Err(RunError::Interrupted)), "{result:?}");
}
