//! The UDP driver with a simulated device on loopback, as two threads with real sockets and real channels.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use magsteer_hal::channels::PrivateRoot;
use magsteer_hal::conformance::{Ending, Level, RunningRig, StatedRates, Tolerances, Verdict, examine};
use magsteer_hal::driver::run;
use magsteer_hal::scripted::example_description;
use magsteer_hal::udp::{Request, SimulatedConfig, SimulatedDevice, UdpDevice, device_state, kind};
use magsteer_hal::{Actuation, udp};

const PERIOD: Duration = Duration::from_millis(1);
/// Longer than this machine stops a process now and then.
const VALIDITY: Duration = Duration::from_millis(150);
/// Bound on every wait, only so that a failure ends.
const PATIENCE: Duration = Duration::from_secs(20);

fn device() -> SimulatedDevice {
    let config =
        SimulatedConfig { time_constant: Duration::from_millis(2), pose_period: Duration::from_millis(5) };
    SimulatedDevice::bind(&example_description(), SocketAddr::from(([127, 0, 0, 1], 0)), config)
        .expect("a socket")
}

#[test]
fn udp_driver_with_its_device_keeps_the_contract() {
    let description = example_description();
    let root = PrivateRoot::create("msudp").expect("a root");
    let endpoint = root.endpoint(&description.rig).expect("an endpoint");
    let stop = AtomicBool::new(false);
    let mut far = device();
    let address = far.address().expect("bound");
    thread::scope(|scope| {
        let device = scope.spawn(|| far.serve(&stop));
        let driver = scope.spawn(|| {
            let mut near = UdpDevice::connect(&description, address, VALIDITY).expect("a socket");
            run(&description, &endpoint, &mut near, PERIOD, &stop).expect("channels")
        });
        let tolerances = Tolerances {
            settling: Duration::from_millis(40),
            angle_settling: Duration::from_millis(100),
            ..Tolerances::of(&description)
        };
        let rates = StatedRates::default();
        let interrupted = Arc::default();
        let rig = RunningRig::open(&endpoint, description.clone(), tolerances, rates, PATIENCE, interrupted);
        let mut rig = rig.expect("a driver");
        let findings = examine(&mut rig, Level::DummyLoad, |_| ());
        let ending = rig.end();
        drop(rig);
        stop.store(true, Ordering::Relaxed);
        let broken: Vec<String> = findings
            .iter()
            .filter(|finding| finding.verdict != Verdict::Kept)
            .map(|finding| format!("{}: {}", finding.clause.id(), finding.measured))
            .collect();
        assert_eq!(broken, Vec::<String>::new());
        assert_eq!(ending, Ending::AtZero);
        let summary = driver.join().expect("no panic");
        assert!(summary.cycles > 1_000 && summary.messages_unsent == 0, "{summary:?}");
        device.join().expect("no panic");
    });
}

/// Goal: a wire that breaks under current is no danger, whatever becomes of the driver.
#[test]
fn device_that_hears_nothing_any_more_goes_to_zero_by_itself() {
    let mut far = device();
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.connect(far.address().expect("bound")).expect("loopback");
    let mut actuation = Actuation::default();
    actuation.current_a[0] = 2.0;
    let start = Instant::now();
    let mut sequence = 0;
    while far.currents()[0] < 1.9 {
        assert!(start.elapsed() < PATIENCE, "the device does not follow");
        sequence += 1;
        let request = Request { sequence, kind: kind::FOLLOW, validity_us: 200_000, actuation };
        socket.send(&request.encode(3, 2)).expect("sent");
        far.serve_once();
    }
    while far.currents()[0] > 1e-3 {
        assert!(start.elapsed() < PATIENCE, "the device keeps its current");
        far.serve_once();
    }
    // A former request, come late, changes nothing.
    let late = Request { sequence, kind: kind::FOLLOW, validity_us: 200_000, actuation };
    socket.send(&late.encode(3, 2)).expect("sent");
    for _ in 0..20 {
        far.serve_once();
    }
    assert!(far.currents()[0] < 1e-3);
    // What it answers to the next one says so; to whoever asks, here a socket whose queue is empty.
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").expect("a socket");
    socket.connect(far.address().expect("bound")).expect("loopback");
    let next = Request { sequence: sequence + 1, kind: kind::CUT, validity_us: 1, actuation };
    socket.send(&next.encode(3, 2)).expect("sent");
    far.serve_once();
    socket.set_read_timeout(Some(PATIENCE)).expect("a time");
    let mut bytes = [0; udp::DATAGRAM_MAX];
    loop {
        let length = socket.recv(&mut bytes).expect("an answer");
        if let Ok(answer) = udp::Answer::decode(&bytes[..length], 3, 2)
            && answer.sequence == next.sequence
        {
            assert_eq!((answer.state, answer.actuation.current_a[0]), (device_state::CUT, 0.0));
            return;
        }
    }
}
