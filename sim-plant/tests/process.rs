//! The driver process behind its channels, in real time.

#[path = "../src/fixture.rs"]
mod fixture;

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;
use std::time::Duration;

use magsteer_hal::channels::{DaemonEnd, DaemonServices, DriverEnd, Endpoint, PrivateRoot};
use magsteer_hal::message::driver_state;
use magsteer_hal::{Actuation, Authority, CoilFeedback, Gate, Hardware, HardwareDescription, Stamp};
use magsteer_sim_plant::PlantConfig;
use magsteer_sim_plant::process::{Summary, run};

/// A machine that is busy elsewhere may take long; one that never gets there fails.
const PATIENCE: Duration = Duration::from_secs(60);

/// The commanding side: sends at every tick and remembers what came back.
struct Commander {
    end: DaemonEnd,
    gate: Gate,
    authority: Authority,
    last_write: Stamp,
    poses: u64,
}

impl Commander {
    fn new(endpoint: &Endpoint, description: &HardwareDescription) -> Self {
        let services = DaemonServices::open(endpoint, PATIENCE).expect("a driver");
        let now = Stamp::now();
        // Long enough that a machine which stops a process now and then does not end the test's authority.
        let authority =
            Authority { epoch: now.nanoseconds(), token: 1, validity: Duration::from_millis(500) };
        Self {
            end: services.into_ports(description).expect("ports"),
            gate: Gate::new(description),
            authority,
            last_write: now,
            poses: 0,
        }
    }

    fn read(&mut self) -> Option<CoilFeedback> {
        let sensed = self.end.read(Stamp::now());
        self.poses += u64::from(sensed.pose.fresh);
        sensed.feedback.last
    }

    /// Claims anew until granted: authority that lapsed while this thread was stopped is not the test's concern.
    fn drive(&mut self, request: &Actuation, feedback: Option<&CoilFeedback>) {
        let now = Stamp::now();
        let held = feedback.is_some_and(|feedback| {
            feedback.state == driver_state::DRIVEN && feedback.accepted_epoch == self.authority.epoch
        });
        let command = if held {
            let period = now.since(self.last_write).as_secs_f64();
            self.gate.drive(request, period, self.authority, Stamp::default()).expect("finite").command
        } else {
            self.authority.epoch = now.nanoseconds();
            self.gate.claim(self.authority)
        };
        self.last_write = now;
        self.end.write(&command, now).expect("sent");
    }
}

/// Drives a plant process until a coil carries its request, then hands over to `finish`; the summary of the run.
fn driven(finish: impl Fn(&mut Commander, &Actuation, &AtomicBool)) -> (Summary, u64) {
    let description = fixture::bigmag();
    let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
    let mut plant = config.build(&description).expect("valid");
    let root = PrivateRoot::create("ms").expect("a directory");
    let endpoint = root.endpoint(&description.rig).expect("an endpoint");
    let stop = AtomicBool::new(false);
    let mut request = Actuation::default();
    request.current_a[4] = 2.0;
    thread::scope(|scope| {
        let process = scope.spawn(|| {
            let mut end = DriverEnd::create(&endpoint).expect("a driver");
            run(&mut plant, &config.real_time, &mut end, &stop, &AtomicU64::new(0), |_| ())
        });
        let mut commander = Commander::new(&endpoint, &description);
        until(|| {
            let feedback = commander.read();
            commander.drive(&request, feedback.as_ref());
            feedback.is_some_and(|feedback| feedback.measured.current_a[4] > 1.9)
        });
        finish(&mut commander, &request, &stop);
        stop.store(true, Ordering::Relaxed);
        (process.join().expect("the process ended"), commander.poses)
    })
}

fn until(mut holds: impl FnMut() -> bool) {
    let start = Stamp::now();
    while !holds() {
        assert!(Stamp::now().since(start) < PATIENCE, "did not get there");
        thread::sleep(Duration::from_millis(1));
    }
}

/// Proves SR-01.
#[test]
fn process_follows_commands_and_ramps_down_when_they_cease() {
    let (summary, poses) = driven(|commander, _, _| {
        until(|| {
            commander.read().is_some_and(|feedback| {
                feedback.state == driver_state::IDLE && feedback.measured.current_a[4].abs() < 0.01
            })
        });
    });
    let ramp = summary.last_ramp.expect("one way to zero");
    // 2 A at 300 A/s.
    assert!(ramp.from_loss >= Duration::from_millis(6), "{ramp:?}");
    assert!(ramp.from_last_command > ramp.from_loss);
    assert!(summary.ended_currentless);
    assert!(summary.counts.steps > 0 && poses > 0);
    assert_eq!((summary.counts.steps_unsolved, summary.limit_breaks, summary.messages_unsent), (0, 0, 0));
    assert!(summary.counts.current_max <= 2.0 + 1e-9);
}

#[test]
fn process_told_to_stop_ends_without_current_though_commands_go_on() {
    let (summary, _) = driven(|commander, request, stop| {
        stop.store(true, Ordering::Relaxed);
        for _ in 0..50 {
            let feedback = commander.read();
            commander.drive(request, feedback.as_ref());
            thread::sleep(Duration::from_millis(1));
        }
    });
    assert!(summary.ended_currentless);
    assert!(summary.last_ramp.is_some());
}

#[test]
fn process_that_cannot_catch_up_leaves_time_out_and_counts_it() {
    let description = fixture::bigmag();
    let mut tables = fixture::plant_tables();
    // Twenty milliseconds pass between wake-ups, of which one may be caught up.
    tables["real_time"]["wake_us"] = 20_000.into();
    tables["real_time"]["catch_up_max_ms"] = 1.into();
    let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
    let mut plant = config.build(&description).expect("valid");
    let root = PrivateRoot::create("ms").expect("a directory");
    let endpoint = root.endpoint(&description.rig).expect("an endpoint");
    let mut end = DriverEnd::create(&endpoint).expect("a driver");
    let stop = AtomicBool::new(false);
    let summary = thread::scope(|scope| {
        let process = scope.spawn(|| {
            thread::sleep(Duration::from_millis(200));
            stop.store(true, Ordering::Relaxed);
        });
        let summary = run(&mut plant, &config.real_time, &mut end, &stop, &AtomicU64::new(0), |_| ());
        process.join().expect("the timer ended");
        summary
    });
    assert!(summary.stalls > 0);
    let stalls = u32::try_from(summary.stalls).expect("few");
    assert!(summary.left_out >= Duration::from_millis(15) * stalls, "{summary:?}");
    let simulated = Duration::from_micros(500) * u32::try_from(summary.counts.steps).expect("few");
    assert!(!simulated.is_zero() && simulated * 5 < summary.left_out, "{summary:?}");
}
