//! What the channels allocate once they run: the transport's one block a sent message, nothing to receive.
//!
//! One test in a file of its own: the counter is that of the thread, the allocator that of the process.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::time::Duration;

use magsteer_hal::channels::{DaemonServices, DriverEnd, Endpoint, PrivateRoot};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{
    Actuation, Authority, CoilFeedback, CommandGuard, Gate, Hardware, POSE_PARAMETERS_MAX, PoseMessage, Stamp,
};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

#[expect(
    unsafe_code,
    reason = "counting allocations needs an allocator; it hands every call on to the system's"
)]
// SAFETY: every call goes unchanged to `System`, which keeps the contract; counting touches no memory it hands out.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`, and every block came from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations of this thread while `work` runs.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    work();
    ALLOCATIONS.get() - before
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
