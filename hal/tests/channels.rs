//! Both ends of the channels over real shared memory, in one process, each test under a root of its own.

use std::thread;
use std::time::Duration;

use magsteer_hal::channels::{
    ChannelError, ClientError, DaemonEnd, DaemonServices, DriverEnd, DriverServices, Endpoint,
    OperatorClient, OperatorServer, OperatorServices, PrivateRoot, RecordObserver, Role, TruthObserver,
};
use magsteer_hal::message::order;
use magsteer_hal::operator::{OperatorAnswer, OperatorRequest, StatusMessage, verb};
use magsteer_hal::record::RecordBatch;
use magsteer_hal::scripted::example_description;
use magsteer_hal::{Authority, CoilCommand, Gate, Hardware, MagnetPose, PoseMessage, Stamp};

const WAIT: Duration = Duration::from_secs(5);

/// A root of its own; the endpoint outlives no test.
fn endpoint() -> (PrivateRoot, Endpoint) {
    let root = PrivateRoot::create("magsteer-test").expect("a root");
    let endpoint = Endpoint::new("example", Some(root.path())).expect("an endpoint");
    (root, endpoint)
}

fn daemon(endpoint: &Endpoint) -> DaemonEnd {
    let services = DaemonServices::open(endpoint, WAIT).expect("a driver");
    services.into_ports(&example_description()).expect("ports")
}

fn pose(now: Stamp) -> PoseMessage {
    let seen = MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
    let mut message = PoseMessage { magnet_count: 2, magnets: [seen; 8], ..PoseMessage::default() };
    message.header.source_stamp_ns = now.nanoseconds();
    message
}

/// Polls until something is there; a failure shows as a hang of the suite, not as a time limit.
fn until<T>(mut poll: impl FnMut() -> Option<T>) -> T {
    loop {
        if let Some(found) = poll() {
            return found;
        }
        thread::sleep(Duration::from_micros(200));
    }
}

fn fresh_pose(driver: &mut DriverEnd, daemon: &mut DaemonEnd) -> PoseMessage {
    until(|| {
        let now = Stamp::now();
        driver.publish_pose(pose(now), now).expect("published");
        let reading = daemon.read(Stamp::now()).pose;
        reading.last.filter(|_| reading.fresh)
    })
}

fn sent_claim(daemon: &mut DaemonEnd, driver: &mut DriverEnd, epoch: u64) -> CoilCommand {
    let mut gate = Gate::new(&example_description());
    let claim = gate.claim(Authority { epoch, token: 7, validity: Duration::from_millis(100) });
    until(|| {
        daemon.write(&claim, Stamp::now()).expect("sent");
        driver.take_command(Stamp::now()).filter(|command| command.header.epoch == epoch)
    })
}

#[test]
fn poses_and_commands_cross_and_only_the_newest_is_kept() {
    let (_root, endpoint) = endpoint();
    let mut driver = DriverEnd::create(&endpoint).expect("a driver");
    let mut daemon = daemon(&endpoint);
    let first = fresh_pose(&mut driver, &mut daemon);
    for _ in 0..3 {
        let now = Stamp::now();
        driver.publish_pose(pose(now), now).expect("published");
    }
    let reading = daemon.read(Stamp::now()).pose;
    assert_eq!(reading.last.expect("poses").header.sequence, first.header.sequence + 3);
    assert!(!daemon.read(Stamp::now()).pose.fresh, "each message is fresh once");
    let command = sent_claim(&mut daemon, &mut driver, 4);
    assert_eq!((command.order, command.token, command.coil_count), (order::CLAIM, 7, 3));
    assert!(driver.take_command(Stamp::now()).is_none());
}

#[test]
fn daemon_without_a_driver_says_so_and_leaves_the_role_free() {
    let (_root, endpoint) = endpoint();
    for _ in 0..2 {
        let refused = DaemonServices::open(&endpoint, Duration::from_millis(30)).expect_err("no driver");
        assert!(matches!(refused, ChannelError::Missing { role: Role::Driver, .. }), "{refused}");
    }
}

#[test]
fn daemon_meets_a_driver_that_starts_later() {
    let (_root, endpoint) = endpoint();
    let late = endpoint.clone();
    let driver = thread::spawn(move || {
        thread::sleep(Duration::from_millis(100));
        DriverServices::create(&late).expect("a driver")
    });
    let mut daemon = daemon(&endpoint);
    let mut driver = driver.join().expect("no panic").into_ports().expect("ports");
    fresh_pose(&mut driver, &mut daemon);
}

/// Proves SR-05.
#[test]
fn second_driver_and_second_daemon_are_refused_with_the_holder() {
    let (_root, endpoint) = endpoint();
    let _driver = DriverEnd::create(&endpoint).expect("a driver");
    let _daemon = daemon(&endpoint);
    let this = std::process::id();
    for refused in [
        DriverServices::create(&endpoint).expect_err("a second driver"),
        DaemonServices::open(&endpoint, WAIT).expect_err("a second daemon"),
    ] {
        let ChannelError::Held { pid, .. } = refused else { panic!("{refused}") };
        assert_eq!(pid, this);
    }
}

#[test]
fn restarted_driver_reaches_the_daemon_that_stayed() {
    let (_root, endpoint) = endpoint();
    let mut driver = DriverEnd::create(&endpoint).expect("a driver");
    let mut daemon = daemon(&endpoint);
    let before = fresh_pose(&mut driver, &mut daemon);
    drop(driver);
    let mut driver = DriverEnd::create(&endpoint).expect("a driver again");
    let after = fresh_pose(&mut driver, &mut daemon);
    assert!(after.header.epoch > before.header.epoch);
    sent_claim(&mut daemon, &mut driver, 5);
}

#[test]
fn restarted_daemon_reaches_the_driver_that_stayed() {
    let (_root, endpoint) = endpoint();
    let mut driver = DriverEnd::create(&endpoint).expect("a driver");
    let mut first = daemon(&endpoint);
    sent_claim(&mut first, &mut driver, 5);
    drop(first);
    let mut second = daemon(&endpoint);
    fresh_pose(&mut driver, &mut second);
    sent_claim(&mut second, &mut driver, 6);
}

#[test]
fn two_rigs_under_one_root_do_not_hear_each_other() {
    let (root, endpoint) = endpoint();
    let other = Endpoint::new("other", Some(root.path())).expect("an endpoint");
    let (mut driver, mut other_driver) =
        (DriverEnd::create(&endpoint).expect("a driver"), DriverEnd::create(&other).expect("a driver"));
    let (mut first, mut second) = (daemon(&endpoint), daemon(&other));
    fresh_pose(&mut driver, &mut first);
    assert!(second.read(Stamp::now()).pose.last.is_none());
    fresh_pose(&mut other_driver, &mut second);
}

#[test]
fn truth_arrives_complete_and_in_order() {
    let (_root, endpoint) = endpoint();
    let mut driver = DriverEnd::create(&endpoint).expect("a driver");
    let mut observer = TruthObserver::open(&endpoint, WAIT).expect("an observer");
    let mut sequences = Vec::new();
    until(|| {
        let now = Stamp::now();
        driver.publish_truth(pose(now), now).expect("published");
        observer.drain(now, |message| sequences.push(message.header.sequence));
        (!sequences.is_empty()).then_some(())
    });
    let first = *sequences.last().expect("one");
    sequences.clear();
    for _ in 0..300 {
        let now = Stamp::now();
        driver.publish_truth(pose(now), now).expect("published");
    }
    observer.drain(Stamp::now(), |message| sequences.push(message.header.sequence));
    assert_eq!(sequences, (first + 1..=first + 300).collect::<Vec<u64>>());
}

/// Serves on a thread of its own until the channel closes, as the daemon does.
fn serving(
    endpoint: &Endpoint,
    mut serve: impl FnMut(&mut OperatorServer) -> bool + Send + 'static,
) -> thread::JoinHandle<()> {
    let services = OperatorServices::create(endpoint).expect("services");
    thread::spawn(move || {
        let mut server = services.into_server().expect("a server");
        while serve(&mut server) {
            thread::sleep(Duration::from_micros(200));
        }
    })
}

#[test]
fn requests_of_both_services_are_answered_by_verb() {
    let (_root, endpoint) = endpoint();
    let mut answered = 0;
    let server = serving(&endpoint, move |server| {
        while let Some(incoming) = server.next_request() {
            let cause = incoming.request().verb;
            incoming
                .answer(OperatorAnswer { accepted: 1, cause, ..OperatorAnswer::default() })
                .expect("answered");
            answered += 1;
        }
        answered < 6
    });
    let mut client = OperatorClient::open(&endpoint, WAIT).expect("a daemon");
    for verb in [verb::ARM, verb::SET_TARGET, verb::GO, verb::SET_TARGET, verb::STOP, verb::RESET] {
        let request = OperatorRequest { verb, ..OperatorRequest::default() };
        let answer = client.send(request, WAIT).expect("an answer");
        assert_eq!((answer.accepted, answer.cause), (1, verb));
    }
    server.join().expect("no panic");
}

#[test]
fn request_without_answer_times_out_and_is_gone_from_the_server() {
    let (_root, endpoint) = endpoint();
    let services = OperatorServices::create(&endpoint).expect("services");
    let mut server = services.into_server().expect("a server");
    let mut client = OperatorClient::open(&endpoint, WAIT).expect("a daemon");
    let request = OperatorRequest { verb: verb::GO, ..OperatorRequest::default() };
    let refused = client.send(request, Duration::from_millis(20)).expect_err("nobody answers");
    assert!(matches!(refused, ClientError::NoAnswer { .. }), "{refused}");
    assert!(server.next_request().is_none(), "what was given up must not be done later");
}

#[test]
fn client_of_a_daemon_that_left_is_told_that_there_is_none() {
    let (_root, endpoint) = endpoint();
    let server = OperatorServices::create(&endpoint).expect("services").into_server().expect("a server");
    let mut client = OperatorClient::open(&endpoint, WAIT).expect("a daemon");
    drop(server);
    let refused =
        client.send(OperatorRequest::default(), Duration::from_millis(20)).expect_err("nobody there");
    assert!(matches!(refused, ClientError::NoDaemon), "{refused}");
    drop(client);
    let refused = OperatorClient::open(&endpoint, Duration::from_millis(20)).expect_err("nobody there");
    assert!(matches!(refused, ChannelError::Missing { role: Role::Daemon, .. }), "{refused}");
}

#[test]
fn status_reaches_a_watcher_across_a_restart_of_the_daemon() {
    let (_root, endpoint) = endpoint();
    let make = || OperatorServices::create(&endpoint).expect("services").into_server().expect("a server");
    let mut server = make();
    let mut client = OperatorClient::open(&endpoint, WAIT).expect("a daemon");
    for cycle in [11, 12] {
        let status = until(|| {
            let status = StatusMessage { cycle, ..StatusMessage::default() };
            server.publish_status(status, Stamp::now()).expect("published");
            client.newest_status(Stamp::now()).filter(|status| status.cycle == cycle)
        });
        assert!(status.header.sequence > 0);
        if cycle == 11 {
            drop(server);
            server = make();
        }
    }
}

/// Goal: whoever records and is stopped for a while loses the oldest batches, by number; the daemon publishes on.
#[test]
fn slow_observer_of_cycles_loses_the_oldest_and_counts_them() {
    const PUBLISHED: u64 = 300;
    const QUEUE: u64 = 128;
    let (_root, endpoint) = endpoint();
    let services = OperatorServices::create(&endpoint).expect("services");
    let mut observer = RecordObserver::open(&endpoint, WAIT).expect("a daemon");
    let mut server = services.into_server().expect("a server");
    let mut publish = |begin: u64| {
        let mut batch = Box::new(RecordBatch { begin, count: 1, ..RecordBatch::default() });
        server.publish_record(&mut batch, Stamp::now()).expect("published");
    };
    // Listening before the first one was published, it misses none of the first.
    publish(0);
    let mut begins = until(|| {
        let mut begins = Vec::new();
        observer.drain(Stamp::now(), |batch| begins.push(batch.begin));
        (!begins.is_empty()).then_some(begins)
    });
    assert_eq!((begins.as_slice(), observer.loss().batches), (&[0][..], 0));
    (1..=PUBLISHED).for_each(&mut publish);
    begins.clear();
    observer.drain(Stamp::now(), |batch| begins.push(batch.begin));
    assert_eq!(begins, (PUBLISHED - QUEUE + 1..=PUBLISHED).collect::<Vec<_>>());
    assert_eq!(observer.loss().batches, PUBLISHED - QUEUE);
}
