//! What the channels allocate once they run: the transport's one block a sent message, nothing to receive.
//!
//! A file of its own: the counter is that of the thread, the allocator that of the process.

#[path = "../../tests/counting_allocator/mod.rs"]
mod counting_allocator;

use std::time::Duration;

use magsteer_hal::channels::{DaemonServices, DriverEnd, Endpoint, PrivateRoot};
use magsteer_hal::fault::{
    Condition, EpochChange, Fault, FaultPlan, FaultTarget, FaultVerb, Garbage, Injector, Part, Reach,
    Scheduled,
};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{
    Actuation, Authority, CoilCommand, CoilFeedback, CommandGuard, Gate, Hardware, HardwareDescription,
    HeaderWriter, POSE_PARAMETERS_MAX, PoseMessage, Setpoint, Stamp,
};

/// Allocations of this thread while `work` runs.
fn allocations(work: impl FnOnce()) -> u64 {
    counting_allocator::allocations_in(work).1
}

#[test]
fn each_sent_message_costs_one_allocation_and_everything_else_none() {
    const CYCLES: u64 = 1000;
    let description = example_description();
    let root = PrivateRoot::create("magsteer-test").expect("a root");
    let endpoint = Endpoint::new(&description.rig, Some(root.path())).expect("an endpoint");
    let mut driver = DriverEnd::create(&endpoint).expect("a driver");
    let services = DaemonServices::open(&endpoint, Duration::from_secs(5)).expect("a driver");
    let mut daemon = services.into_ports(&description).expect("ports");
    let mut gate = Gate::new(&description);
    let mut guard = CommandGuard::new(&description, &[0.0; POSE_PARAMETERS_MAX]);
    let authority = Authority { epoch: 1, token: 7, validity: Duration::from_millis(100) };
    let mut now = Stamp::from_nanoseconds(1_000_000_000);
    let mut received = 0;
    let mut cycle = |claim: bool| {
        now = now.after(Duration::from_millis(1));
        received += u64::from(daemon.read(now).feedback.fresh);
        let command = if claim {
            gate.claim(authority)
        } else {
            let mut request = Actuation::default();
            // Refused every now and then, and beyond the limits always: faults must not allocate either.
            request.current_a[0] = if now.nanoseconds().is_multiple_of(7) { f64::NAN } else { 100.0 };
            match gate.drive(&request, 1e-3, authority, Stamp::default()) {
                Ok(admitted) => admitted.command,
                Err(_) => gate.ramp_to_zero(1e-3, authority),
            }
        };
        daemon.write(&command, now).expect("sent");
        if let Some(command) = driver.take_command(now) {
            let _ = guard.offer(&command, now);
        }
        let mut feedback =
            CoilFeedback { measured: *guard.setpoint(now, 1e-3).actuation(), ..CoilFeedback::default() };
        guard.report(&mut feedback);
        driver.publish_feedback(feedback, now).expect("sent");
        driver.publish_pose(PoseMessage::default(), now).expect("sent");
    };
    // Connections form.
    for _ in 0..10 {
        cycle(true);
    }
    let spent = allocations(|| (0..CYCLES).for_each(|_| cycle(false)));
    assert_eq!(spent, 3 * CYCLES, "one command, one feedback and one pose a cycle");
    assert!(received > CYCLES, "every feedback came back");
}

/// Goal: whatever faults begin, act and end, the injector allocates nothing after construction.
#[test]
fn faults_allocate_nothing() {
    let description = example_description();
    let scheduled = every_fault(&description);
    let count = scheduled.len() as u64;
    let plan = FaultPlan::new(Reach::Plant, scheduled);
    let mut injector = Injector::new(&description, &plan, 1);
    let mut guard = CommandGuard::new(&description, &[0.0; POSE_PARAMETERS_MAX]);
    let (mut poses, mut feedback) = (HeaderWriter::new(1), HeaderWriter::new(1));
    let mut now = Stamp::from_nanoseconds(1_000_000_000);
    let mut published = 0_u64;
    let spent = allocations(|| {
        for _ in 0..4000 {
            now = now.after(Duration::from_millis(1));
            let command = injector.command(&CoilCommand::default(), now);
            let _ = guard.offer(&command, now);
            injector.setpoint(&Setpoint::Drive(Actuation::default()), now, 1e-3);
            injector.offer_pose(PoseMessage::default(), now);
            injector.offer_feedback(CoilFeedback::default(), now);
            while injector.take_pose(&mut poses, now).is_some() {
                published += 1;
            }
            while injector.take_feedback(&mut feedback, now).is_some() {
                published += 1;
            }
            while injector.next_condition(now).is_some() {}
        }
        injector.clear(now);
    });
    assert_eq!(spent, 0);
    assert!(published > 1000, "{published}");
    let counts = injector.counts();
    assert_eq!((counts.begun, counts.ended, counts.active), (count, count, 0));
}

/// Each verb on each target, one after another and overlapping.
fn every_fault(description: &HardwareDescription) -> Vec<Scheduled> {
    let verbs = [
        FaultVerb::Delayed { by: Duration::from_secs(1) },
        FaultVerb::Off,
        FaultVerb::Stuck,
        FaultVerb::Garbage(Garbage::Random),
        FaultVerb::Slow { rate_hz: 50.0 },
        FaultVerb::Intermittent { period: Duration::from_millis(20), off_fraction: 0.5 },
        FaultVerb::Repeated,
        FaultVerb::Backward,
        FaultVerb::WrongEpoch(EpochChange::EveryMessage),
        FaultVerb::WrongVersion,
        FaultVerb::Physical(Condition::Open),
    ];
    let parts = [None, Some(Part::Magnet(1)), Some(Part::Coil(2))];
    let mut scheduled = Vec::new();
    for target in FaultTarget::ALL {
        for (index, verb) in (0..).zip(verbs) {
            let fits = parts
                .iter()
                .filter_map(|part| Fault::new(target, *part, verb, description, Reach::Plant).ok());
            scheduled.extend(fits.map(|fault| Scheduled {
                fault,
                from: Duration::from_millis(300 * index),
                lasts: Some(Duration::from_millis(if index == 0 { 3500 } else { 450 })),
            }));
        }
    }
    scheduled
}
