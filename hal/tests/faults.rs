//! Faults on a driver that is not the simulated plant: through [`DriverEnd`], on request, over shared memory.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use magsteer_hal::channels::{
    DaemonEnd, DaemonServices, DriverEnd, DriverServices, Endpoint, FaultClient, FaultClientError,
    PrivateRoot,
};
use magsteer_hal::fault::{
    Condition, Fault, FaultAnswer, FaultPlan, FaultRequest, FaultTarget, FaultVerb, Garbage, Injector, Part,
    Reach, refusal_text,
};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{
    Absent, CoilFeedback, CommandGuard, Hardware, MagnetPose, POSE_PARAMETERS_MAX, PoseMessage, Stamp,
};

/// Bound on every wait, only so that a failure ends.
const PATIENCE: Duration = Duration::from_secs(20);

/// A plain driver: its cycle knows nothing of faults but for the call between guard and amplifiers.
fn drive(mut end: DriverEnd, stop: &AtomicBool) {
    let mut guard = CommandGuard::new(&example_description(), &[0.0; POSE_PARAMETERS_MAX]);
    let upright = MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
    while !stop.load(Ordering::Relaxed) {
        let now = Stamp::now();
        if let Some(command) = end.take_command(now) {
            let _ = guard.offer(&command, now);
        }
        let setpoint = guard.setpoint(now, 1e-3);
        let obeyed = end.setpoint(&setpoint, now, 1e-3);
        let mut pose = PoseMessage { magnet_count: 2, magnets: [upright; 8], ..PoseMessage::default() };
        pose.header.source_stamp_ns = now.nanoseconds();
        end.publish_pose(pose, now).expect("sent");
        let mut feedback = CoilFeedback { measured: *obeyed.actuation(), ..CoilFeedback::default() };
        feedback.header.source_stamp_ns = now.nanoseconds();
        guard.report(&mut feedback);
        end.publish_feedback(feedback, now).expect("sent");
        thread::sleep(Duration::from_millis(1));
    }
}

fn injector(reach: Reach) -> Injector {
    Injector::new(&example_description(), &FaultPlan::empty(reach), 1)
}

/// Runs `work` beside a driver that allows faults, with a daemon's end and a client.
fn beside_a_driver(work: impl FnOnce(&mut DaemonEnd, &mut FaultClient)) {
    let root = PrivateRoot::create("ms").expect("a root");
    let endpoint = root.endpoint("example").expect("an endpoint");
    let stop = AtomicBool::new(false);
    thread::scope(|scope| {
        scope.spawn(|| {
            let services = DriverServices::create(&endpoint).expect("alone");
            let services = services.allow_faults(&endpoint, injector(Reach::Channels)).expect("allowed");
            drive(services.into_ports().expect("ports"), &stop);
        });
        let services = DaemonServices::open(&endpoint, PATIENCE).expect("a driver");
        let mut daemon = services.into_ports(&example_description()).expect("ports");
        let mut client = FaultClient::open(&endpoint, PATIENCE).expect("faults are allowed");
        // The driver ends even when the test fails.
        let outcome =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(&mut daemon, &mut client)));
        stop.store(true, Ordering::Relaxed);
        outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}

fn ask(client: &mut FaultClient, request: FaultRequest) -> FaultAnswer {
    client.send(request, PATIENCE).expect("an answer")
}

fn begin(client: &mut FaultClient, target: FaultTarget, verb: FaultVerb) {
    let fault = Fault::new(target, None, verb, &example_description(), Reach::Plant).expect("makes sense");
    let answer = ask(client, FaultRequest::begin(&fault, None));
    assert_eq!((answer.accepted, refusal_text(answer.reason)), (1, ""));
}

fn until(mut holds: impl FnMut() -> bool) {
    let start = Stamp::now();
    while !holds() {
        assert!(Stamp::now().since(start) < PATIENCE, "did not get there");
        thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn any_driver_has_the_verbs_and_gets_well_again() {
    beside_a_driver(|daemon, client| {
        until(|| daemon.read(Stamp::now()).pose.fresh);
        begin(client, FaultTarget::Poses, FaultVerb::Garbage(Garbage::Quaternion));
        let implausible = Some(Absent::Implausible { what: "quaternion", index: 0 });
        until(|| daemon.read(Stamp::now()).pose.refused == implausible);
        begin(client, FaultTarget::Feedback, FaultVerb::WrongVersion);
        until(|| {
            matches!(daemon.read(Stamp::now()).feedback.refused, Some(Absent::Schema { actual: 2, .. }))
        });
        let answer = ask(client, FaultRequest::clear());
        assert_eq!((answer.accepted, answer.cleared, answer.active), (1, 2, 0));
        until(|| {
            let sensed = daemon.read(Stamp::now());
            sensed.pose.fresh && sensed.feedback.fresh
        });
    });
}

#[test]
fn drivers_without_a_plant_refuse_its_conditions_in_words() {
    beside_a_driver(|_, client| {
        let verb = FaultVerb::Physical(Condition::Open);
        let part = Some(Part::Coil(0));
        let open =
            Fault::new(FaultTarget::Coil, part, verb, &example_description(), Reach::Plant).expect("a fault");
        let answer = ask(client, FaultRequest::begin(&open, None));
        assert_eq!(answer.accepted, 0);
        assert!(refusal_text(answer.reason).contains("simulated plant alone"), "{answer:?}");
    });
}

#[test]
fn without_the_flag_there_is_nothing_to_ask_even_after_a_driver_that_had_it() {
    let root = PrivateRoot::create("ms").expect("a root");
    let endpoint: Endpoint = root.endpoint("example").expect("an endpoint");
    let open = || FaultClient::open(&endpoint, Duration::from_millis(50));
    assert!(matches!(open(), Err(FaultClientError::NoDriver { .. })));
    let plain = DriverEnd::create(&endpoint).expect("alone");
    let refused = open().expect_err("not allowed");
    let FaultClientError::NotAllowed { pid, .. } = &refused else { panic!("{refused}") };
    assert_eq!(*pid, std::process::id());
    assert!(plain.faults().is_none());
    drop(plain);
    let services = DriverServices::create(&endpoint).expect("alone");
    let services = services.allow_faults(&endpoint, injector(Reach::Channels)).expect("allowed");
    let allowing = services.into_ports().expect("ports");
    // A client that knew the former driver asks the next one, which allows nothing.
    let mut client = open().expect("allowed");
    drop(allowing);
    let _plain = DriverEnd::create(&endpoint).expect("alone");
    let refused = client.send(FaultRequest::clear(), Duration::from_millis(50)).expect_err("nobody serves");
    assert!(matches!(refused, FaultClientError::NotAllowed { .. }), "{refused}");
}
