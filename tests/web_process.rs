//! `magsteer web` as a process, with a daemon's services played here: paths, headers, refusals, metrics,
//! events.
#![cfg(feature = "web")]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use magsteer::config::Config;
use magsteer_hal::Stamp;
use magsteer_hal::channels::{Endpoint, OperatorServices, PrivateRoot};
use magsteer_hal::operator::{OperatorAnswer, StatusMessage, state, verb};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Bound on every wait, only so that a failure ends.
const PATIENCE: Duration = Duration::from_secs(30);

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml")
}

/// Publishes statuses and takes every request, until dropped.
struct Daemon {
    stop: Arc<AtomicBool>,
    /// Verb asked last.
    asked: Arc<AtomicU32>,
    thread: Option<JoinHandle<()>>,
}

impl Daemon {
    fn start(endpoint: &Endpoint) -> Self {
        let (_, config) = Config::load(&shipped()).expect("shipped");
        let fingerprint = config.description.fingerprint();
        let services = OperatorServices::create(endpoint).expect("alone on this root");
        let (stop, asked) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU32::new(0)));
        let (stopped, noted) = (Arc::clone(&stop), Arc::clone(&asked));
        let serve = move || {
            let mut server = services.into_server().expect("joined");
            let mut cycle = 0;
            while !stopped.load(Ordering::Acquire) {
                while let Some(incoming) = server.next_request() {
                    noted.store(incoming.request().verb, Ordering::Release);
                    let answer =
                        OperatorAnswer { accepted: 1, state: state::ACTIVE, ..OperatorAnswer::default() };
                    incoming.answer(answer).expect("the operator waits");
                }
                cycle += 10;
                let mut status = StatusMessage {
                    state: state::ACTIVE,
                    cycle,
                    rate_hz: 1_000.0,
                    description_fingerprint: fingerprint,
                    ..StatusMessage::default()
                };
                status.header.source_stamp_ns = Stamp::now().nanoseconds();
                server.publish_status(status, Stamp::now()).expect("the transport works");
                std::thread::sleep(Duration::from_millis(10));
            }
        };
        Self { stop, asked, thread: Some(std::thread::spawn(serve)) }
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.join().expect("the played daemon does not panic");
        }
    }
}

/// A page server on a free port.
struct Web {
    child: Child,
    /// As `127.0.0.1:40000`.
    host: String,
    /// What it takes commands with; empty where it takes none.
    key: String,
}

impl Web {
    fn start(root: &Path, arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.arg("web").arg(shipped()).arg("--root").arg(root).args(arguments);
        let mut child = command.stdout(Stdio::piped()).spawn().expect("the program is built");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("text");
        let address = line.trim().strip_prefix("http://").and_then(|rest| rest.split_once('/'));
        let (host, fragment) = address.unwrap_or_else(|| panic!("{line:?}"));
        let key = fragment.strip_prefix("#key=").unwrap_or_default();
        Self { host: host.to_owned(), key: key.to_owned(), child }
    }

    /// What one request brings: status, head and body.
    fn ask(&self, request: &str, headers: &[(&str, &str)], body: &str) -> (u16, String, String) {
        let port = self.host.rsplit_once(':').expect("with its port").1;
        let mut stream = TcpStream::connect(format!("127.0.0.1:{port}")).expect("it serves");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        let mut text =
            format!("{request} HTTP/1.1\r\nConnection: close\r\nContent-Length: {}\r\n", body.len());
        if !headers.iter().any(|(name, _)| *name == "Host") {
            text += &format!("Host: {}\r\n", self.host);
        }
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        stream.write_all(format!("{text}\r\n{body}").as_bytes()).expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("text");
        let (head, body) = answer.split_once("\r\n\r\n").expect("a head");
        let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status");
        (status, head.to_lowercase(), body.to_owned())
    }

    fn command(&self, token: &str, body: &str) -> (u16, Value) {
        let own = format!("http://{}", self.host);
        let (status, _, answer) =
            self.ask("POST /command", &[("Origin", &own), ("X-Magsteer-Token", token)], body);
        (status, serde_json::from_str(&answer).expect("JSON"))
    }
}

impl Drop for Web {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !holds() {
        assert!(begin.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn root() -> (PrivateRoot, Endpoint) {
    let root = PrivateRoot::create("wb").expect("shared memory is there");
    let endpoint = root.endpoint("bigmag-planar").expect("short and own");
    (root, endpoint)
}

const FREE: [&str; 2] = ["--bind", "127.0.0.1:0"];

#[test]
fn page_and_its_parts_are_served_with_a_policy_that_lets_nothing_else_in() {
    let (root, _endpoint) = root();
    let web = Web::start(root.path(), &FREE);
    for (path, kind) in [
        ("/", "text/html"),
        ("/page.css", "text/css"),
        ("/page.js", "text/javascript"),
        ("/draw.js", "text/javascript"),
        ("/icon.svg", "image/svg+xml"),
    ] {
        let (status, head, body) = web.ask(&format!("GET {path}"), &[], "");
        assert_eq!(status, 200, "{path}");
        assert!(head.contains(&format!("content-type: {kind}")), "{head}");
        assert!(head.contains("content-security-policy: default-src 'none'; script-src 'self'"), "{head}");
        assert!(
            head.contains("x-frame-options: deny") && head.contains("x-content-type-options: nosniff"),
            "{head}"
        );
        for word in ["https://", "//cdn", "@import", "{{"] {
            assert!(!body.contains(word), "{path} names {word}");
        }
        let foreign = body.replace("http://www.w3.org/2000/svg", "");
        assert!(!foreign.contains("http://"), "{path} names another server");
    }
    assert_eq!(web.ask("GET /nothing", &[], "").0, 404);
    assert_eq!(web.ask("GET /command", &[], "").0, 405);
}

/// Proves SR-27.
#[test]
fn commands_reach_the_daemon_from_the_own_page_alone() {
    let (root, endpoint) = root();
    let daemon = Daemon::start(&endpoint);
    let web = Web::start(root.path(), &FREE);
    let token = web.key.clone();
    assert_eq!(token.len(), 32);
    assert!(!web.ask("GET /", &[], "").2.contains(&token), "whoever loads the page does not get the key");
    let stop = r#"{"verb": "stop"}"#;
    let own = format!("http://{}", web.host);
    for (headers, what) in [
        (vec![], "without a token"),
        (vec![("X-Magsteer-Token", "0")], "with another token"),
        (vec![("X-Magsteer-Token", token.as_str()), ("Origin", "http://evil.example")], "from another site"),
        (vec![("X-Magsteer-Token", token.as_str()), ("Host", "evil.example")], "by another name"),
    ] {
        let (status, _, body) = web.ask("POST /command", &headers, stop);
        assert_eq!(status, 403, "{what}: {body}");
    }
    assert_eq!(web.ask("GET /", &[("Host", "evil.example")], "").0, 403, "nor is the page shown");
    assert_eq!(daemon.asked.load(Ordering::Acquire), 0, "nothing of it came through");
    let (status, answer) = web.command(&token, stop);
    assert_eq!(
        (status, answer["accepted"].as_bool(), answer["state"].as_str()),
        (200, Some(true), Some("active"))
    );
    assert_eq!(daemon.asked.load(Ordering::Acquire), verb::STOP);
    let set = r#"{"verb": "set-target", "angles_deg": [[70], [110]]}"#;
    assert_eq!(web.command(&token, set).1["accepted"], true);
    assert_eq!(daemon.asked.load(Ordering::Acquire), verb::SET_TARGET);
    for wrong in [
        r#"{"verb": "set-target", "angles_deg": [[70]]}"#,
        r#"{"verb": "set-target", "angles_deg": [[70], [110, 3]]}"#,
        r#"{"verb": "jump"}"#,
        r#"{"verb": "stop", "more": 1}"#,
        "stop",
    ] {
        let (status, answer) = web.command(&token, wrong);
        assert!(status == 400 && answer["error"].is_string(), "{wrong}: {answer}");
    }
    let large =
        web.ask("POST /command", &[("Origin", &own), ("X-Magsteer-Token", &token)], &" ".repeat(5_000));
    assert_eq!(large.0, 413, "longer than any command");
}

#[test]
fn a_stop_without_a_daemon_is_answered_as_not_done() {
    let (root, _endpoint) = root();
    let web = Web::start(root.path(), &FREE);
    let (status, answer) = web.command(&web.key, r#"{"verb": "stop"}"#);
    assert_eq!((status, answer["error"].as_str()), (503, Some("no daemon serves this rig")));
}

#[test]
fn metrics_tell_of_the_daemon_while_it_is_heard() {
    let (root, endpoint) = root();
    let web = Web::start(root.path(), &FREE);
    let scrape = || web.ask("GET /metrics", &[], "");
    let (status, head, text) = scrape();
    assert_eq!((status, text.contains("magsteer_up{rig=\"bigmag-planar\"} 0\n")), (200, true), "{text}");
    assert!(head.contains("content-type: application/openmetrics-text; version=1.0.0"), "{head}");
    let _daemon = Daemon::start(&endpoint);
    until("the daemon is heard", || {
        scrape().2.contains("magsteer_state{rig=\"bigmag-planar\",magsteer_state=\"active\"} 1\n")
    });
    assert!(scrape().2.ends_with("# EOF\n"));
}

#[test]
fn events_begin_with_what_a_page_needs_and_go_on_with_frames() {
    let (root, endpoint) = root();
    let _daemon = Daemon::start(&endpoint);
    let web = Web::start(root.path(), &FREE);
    let mut stream = TcpStream::connect(&web.host).expect("it serves");
    stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
    write!(stream, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", web.host).expect("it reads");
    let mut event = String::new();
    let (mut hello, mut frames, mut samples) = (None, 0, 0);
    for line in BufReader::new(stream).lines() {
        let line = line.expect("text");
        if let Some(name) = line.strip_prefix("event: ") {
            name.clone_into(&mut event);
        } else if let Some(data) = line.strip_prefix("data: ") {
            let data: Value = serde_json::from_str(data).expect("JSON");
            if event == "hello" {
                hello = Some(data);
            } else {
                frames += 1;
                samples += data["samples"].as_array().expect("a list").len();
                assert_eq!(data["figures"]["coils"].as_array().expect("a list").len(), 6);
            }
            let active = hello.as_ref().is_some_and(|_| frames > 20);
            if active {
                break;
            }
        }
    }
    let hello = hello.expect("it came first");
    assert_eq!(
        (hello["rig"]["name"].as_str(), hello["commands"].as_bool()),
        (Some("bigmag-planar"), Some(true))
    );
    assert_eq!(hello["rig"]["angles"], "planar");
    assert!(samples > 10, "{samples} samples in {frames} frames");
}

/// Proves SR-27.
#[test]
fn other_machines_may_look_only_when_allowed_and_then_nobody_commands() {
    let (root, _endpoint) = root();
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let output = command.arg("web").arg(shipped()).args(["--bind", "0.0.0.0:0"]).output().expect("built");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("--allow-remote-viewing"), "{output:?}");
    let web = Web::start(root.path(), &["--bind", "0.0.0.0:0", "--allow-remote-viewing"]);
    assert_eq!(web.ask("GET /", &[("Host", "rig.example:80")], "").0, 200);
    assert_eq!(web.key, "");
    let (status, answer) = web.command("", r#"{"verb": "stop"}"#);
    assert_eq!(
        (status, answer["error"].as_str()),
        (403, Some("commands are off, since other machines may look"))
    );
}

#[test]
fn a_signal_ends_it_while_pages_are_open() {
    let (root, _endpoint) = root();
    let mut web = Web::start(root.path(), &FREE);
    let mut open = TcpStream::connect(&web.host).expect("it serves");
    write!(open, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", web.host).expect("it reads");
    let mut first = [0];
    open.read_exact(&mut first).expect("it answers");
    kill_process(Pid::from_child(&web.child), Signal::TERM).expect("the child is there");
    until("it ends", || web.child.try_wait().expect("a child").is_some());
    assert_eq!(web.child.wait().expect("a child").code(), Some(143));
}
