//! Either side killed (SIGKILL) at any moment, starting included: the other meets its follower with nothing cleared up by hand.

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

use magsteer_hal::channels::{
    DaemonEnd, DaemonServices, DriverEnd, Endpoint, OperatorClient, OperatorServices, PrivateRoot,
};
use magsteer_hal::operator::{OperatorAnswer, OperatorRequest, verb};
use magsteer_hal::scripted::example_description;
use magsteer_hal::{Authority, Gate, Hardware, MagnetPose, PoseMessage, Stamp};

const WAIT: Duration = Duration::from_secs(20);
const ROLE_VARIABLE: &str = "MAGSTEER_TEST_ROLE";
const ROOT_VARIABLE: &str = "MAGSTEER_TEST_ROOT";

/// A process of its own in a role, killed when dropped.
struct Victim(Child);

impl Victim {
    fn start(role: &str, root: &Path) -> Self {
        let this = std::env::current_exe().expect("this test");
        let child = Command::new(this)
            .args(["--exact", "victim", "--ignored", "--nocapture"])
            .env(ROLE_VARIABLE, role)
            .env(ROOT_VARIABLE, root)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("started");
        Self(child)
    }
}

impl Drop for Victim {
    fn drop(&mut self) {
        // SIGKILL; it may be dead already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
#[ignore = "the process that the other tests start and kill"]
fn victim() {
    let role = std::env::var(ROLE_VARIABLE).expect("started by a test");
    let root = std::env::var(ROOT_VARIABLE).expect("started by a test");
    let endpoint = endpoint(Path::new(&root));
    // Ends with the test that started it, even when that is killed: its side of the pipe closes.
    thread::spawn(|| {
        let _ = std::io::stdin().read_line(&mut String::new());
        std::process::exit(0);
    });
    if role == "operators" {
        let services = OperatorServices::create(&endpoint).expect("services");
        let mut server = services.into_server().expect("a server");
        loop {
            while let Some(incoming) = server.next_request() {
                let epoch = u64::from(std::process::id());
                // The client may have given up.
                let _ = incoming.answer(OperatorAnswer { accepted: 1, epoch, ..OperatorAnswer::default() });
            }
            thread::sleep(Duration::from_micros(300));
        }
    } else if role == "driver" {
        let mut driver = DriverEnd::create(&endpoint).expect("a driver");
        loop {
            publish(&mut driver);
            thread::sleep(Duration::from_micros(300));
        }
    } else {
        let mut daemon = daemon(&endpoint);
        loop {
            claim(&mut daemon, Stamp::now().nanoseconds());
            thread::sleep(Duration::from_micros(300));
        }
    }
}

fn endpoint(root: &Path) -> Endpoint {
    Endpoint::new("example", Some(root)).expect("an endpoint")
}

fn daemon(endpoint: &Endpoint) -> DaemonEnd {
    let services = DaemonServices::open(endpoint, WAIT).expect("a driver");
    services.into_ports(&example_description()).expect("ports")
}

fn publish(driver: &mut DriverEnd) {
    let now = Stamp::now();
    let seen = MagnetPose { orientation_xyzw: [0.0, 0.0, 0.0, 1.0], valid: 1, ..MagnetPose::default() };
    let mut message = PoseMessage { magnet_count: 2, magnets: [seen; 8], ..PoseMessage::default() };
    message.header.source_stamp_ns = now.nanoseconds();
    driver.publish_pose(message, now).expect("published");
}

fn claim(daemon: &mut DaemonEnd, epoch: u64) {
    let mut gate = Gate::new(&example_description());
    let authority = Authority { epoch, token: 7, validity: Duration::from_millis(100) };
    daemon.write(&gate.claim(authority), Stamp::now()).expect("sent");
}

/// Polls until something is there; a failure shows as a hang of the suite, not as a time limit.
fn until<T>(mut poll: impl FnMut() -> Option<T>) -> T {
    loop {
        if let Some(found) = poll() {
            return found;
        }
        thread::sleep(Duration::from_micros(300));
    }
}

/// Waits for poses of a driver that started after `after`.
fn heard_driver(daemon: &mut DaemonEnd, after: u64) {
    until(|| {
        let reading = daemon.read(Stamp::now()).pose;
        reading.last.filter(|pose| reading.fresh && pose.header.epoch > after)
    });
}

/// Waits for a command of a daemon that claimed after `after`.
fn heard_daemon(driver: &mut DriverEnd, after: u64) {
    until(|| {
        publish(driver);
        let command = driver.take_command(Stamp::now());
        command.filter(|command| command.header.epoch > after)
    });
}

/// Moments to kill at, before, while and after the victim joins; milliseconds.
const MOMENTS: [u64; 8] = [0, 2, 4, 6, 9, 13, 20, 60];

#[test]
fn killed_drivers_are_followed_by_another_that_the_daemon_hears() {
    let root = PrivateRoot::create("magsteer-test").expect("a root");
    let first = Victim::start("driver", root.path());
    let mut daemon = daemon(&endpoint(root.path()));
    heard_driver(&mut daemon, 0);
    drop(first);
    for moment in MOMENTS {
        let hasty = Victim::start("driver", root.path());
        thread::sleep(Duration::from_millis(moment));
        drop(hasty);
        let dead = Stamp::now().nanoseconds();
        let _next = Victim::start("driver", root.path());
        heard_driver(&mut daemon, dead);
    }
}

#[test]
fn killed_daemons_are_followed_by_another_that_the_driver_hears() {
    let root = PrivateRoot::create("magsteer-test").expect("a root");
    let mut driver = DriverEnd::create(&endpoint(root.path())).expect("a driver");
    let first = Victim::start("daemon", root.path());
    heard_daemon(&mut driver, 0);
    drop(first);
    for moment in MOMENTS {
        let hasty = Victim::start("daemon", root.path());
        thread::sleep(Duration::from_millis(moment));
        drop(hasty);
        let dead = Stamp::now().nanoseconds();
        let _next = Victim::start("daemon", root.path());
        heard_daemon(&mut driver, dead);
    }
}

#[test]
fn killed_servers_of_operators_are_followed_by_another_that_answers_the_client() {
    let root = PrivateRoot::create("magsteer-test").expect("a root");
    let first = Victim::start("operators", root.path());
    let mut client = OperatorClient::open(&endpoint(root.path()), WAIT).expect("a server");
    drop(first);
    for moment in MOMENTS {
        let hasty = Victim::start("operators", root.path());
        thread::sleep(Duration::from_millis(moment));
        drop(hasty);
        let next = Victim::start("operators", root.path());
        for verb in [verb::GO, verb::SET_TARGET] {
            let request = OperatorRequest { verb, ..OperatorRequest::default() };
            let answer = until(|| client.send(request, Duration::from_millis(200)).ok());
            assert_eq!(answer.epoch, u64::from(next.0.id()));
        }
    }
}

#[test]
fn both_killed_are_followed_by_both_in_any_order() {
    let root = PrivateRoot::create("magsteer-test").expect("a root");
    let endpoint = endpoint(root.path());
    for (index, moment) in MOMENTS.into_iter().enumerate() {
        let both = (Victim::start("driver", root.path()), Victim::start("daemon", root.path()));
        thread::sleep(Duration::from_millis(moment));
        drop(both);
        let dead = Stamp::now().nanoseconds();
        if index % 2 == 0 {
            let _driver = Victim::start("driver", root.path());
            heard_driver(&mut daemon(&endpoint), dead);
        } else {
            let _daemon = Victim::start("daemon", root.path());
            heard_daemon(&mut DriverEnd::create(&endpoint).expect("a driver"), dead);
        }
    }
}
