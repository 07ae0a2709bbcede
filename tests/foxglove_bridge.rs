//! `magsteer bridge foxglove` as a process, with a daemon's status played here and a WebSocket client of this
//! file's own (RFC 6455; Foxglove's protocol: <https://github.com/foxglove/ws-protocol>).
#![cfg(feature = "foxglove")]

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use magsteer::config::Config;
use magsteer_hal::Stamp;
use magsteer_hal::channels::{OperatorServices, PrivateRoot};
use magsteer_hal::operator::{StatusMessage, state};
use serde_json::{Value, json};

/// Bound on every wait, only so that a failure ends.
const PATIENCE: Duration = Duration::from_secs(30);
const TEXT: u8 = 1;
const BINARY: u8 = 2;
/// Code of a message with data, before the subscription's number and the time.
const MESSAGE_DATA: u8 = 1;

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(name)
}

struct Bridge(Child);

impl Drop for Bridge {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A client's connection.
struct Socket(BufReader<TcpStream>);

impl Socket {
    fn open(host: &str) -> Self {
        let mut stream = TcpStream::connect(host).expect("it serves");
        stream.set_read_timeout(Some(PATIENCE)).expect("a socket");
        write!(
            stream,
            "GET / HTTP/1.1\r\nHost: {host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
             Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n"
        )
        .expect("it reads");
        let mut reader = BufReader::new(stream);
        let mut line = String::new();
        reader.read_line(&mut line).expect("text");
        assert!(line.contains(" 101 "), "{line}");
        while line.trim() != "" {
            line.clear();
            reader.read_line(&mut line).expect("text");
        }
        Self(reader)
    }

    /// Kind and content of the next frame.
    fn next(&mut self) -> (u8, Vec<u8>) {
        let mut head = [0; 2];
        self.0.read_exact(&mut head).expect("a frame");
        let length = match head[1] & 0x7f {
            126 => {
                let mut length = [0; 2];
                self.0.read_exact(&mut length).expect("a length");
                usize::from(u16::from_be_bytes(length))
            }
            127 => {
                let mut length = [0; 8];
                self.0.read_exact(&mut length).expect("a length");
                usize::try_from(u64::from_be_bytes(length)).expect("small")
            }
            length => usize::from(length),
        };
        let mut content = vec![0; length];
        self.0.read_exact(&mut content).expect("its content");
        (head[0] & 0x0f, content)
    }

    /// Sends a text, masked with zeros, as the protocol lets a client choose.
    fn send(&mut self, text: &str) {
        let length = u16::try_from(text.len()).expect("short").to_be_bytes();
        let mut frame = vec![0x80 | TEXT, 0x80 | 126, length[0], length[1], 0, 0, 0, 0];
        frame.extend_from_slice(text.as_bytes());
        self.0.get_mut().write_all(&frame).expect("it reads");
    }
}

#[test]
fn every_topic_is_advertised_and_comes_with_content() {
    let root = PrivateRoot::create("fx").expect("shared memory is there");
    let endpoint = root.endpoint("bigmag-planar").expect("short and own");
    let (_, config) = Config::load(&shipped("bigmag-planar.toml")).expect("shipped");
    let services = OperatorServices::create(&endpoint).expect("alone on this root");
    let fingerprint = config.description.fingerprint();
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| publish(services, fingerprint, &stop));
        let _stop = SetAtEnd(&stop);
        hear_every_topic(root.path());
    });
}

/// Ends the played daemon when the test ends, by a panic too.
struct SetAtEnd<'a>(&'a AtomicBool);

impl Drop for SetAtEnd<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Plays a daemon that steers.
fn publish(services: OperatorServices, fingerprint: u64, stop: &AtomicBool) {
    let mut server = services.into_server().expect("joined");
    while !stop.load(Ordering::Acquire) {
        let mut status = StatusMessage {
            state: state::ACTIVE,
            description_fingerprint: fingerprint,
            ..StatusMessage::default()
        };
        status.header.source_stamp_ns = Stamp::now().nanoseconds();
        status.measured.current_a[4] = -1.25;
        // The second magnet alone is seen.
        status.measured_position_m[1] = [0.004, 0.0, -0.002];
        (status.measured_direction[1], status.target_direction[1]) = ([1.0, 0.0, 0.0], [0.8, 0.0, 0.6]);
        server.publish_status(status, Stamp::now()).expect("the transport works");
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn hear_every_topic(root: &Path) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["bridge", "foxglove"]).arg(shipped("bigmag-planar.toml")).arg("--root").arg(root);
    let mut child = command.args(["--bind", "127.0.0.1:0"]).stdout(Stdio::piped()).spawn().expect("built");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("text");
    let _bridge = Bridge(child);
    let mut socket = Socket::open(line.trim().strip_prefix("ws://").expect("its address"));

    let mut topics: BTreeMap<u64, String> = BTreeMap::new();
    let (mut heard, mut actuation, mut transforms) = (BTreeSet::new(), Value::Null, Vec::new());
    let wanted = BTreeSet::from([
        "/measured_cp",
        "/target_cp",
        "/tf",
        "/scene",
        "/angles",
        "/actuation",
        "/status",
        "/timing",
    ]);
    let begin = Instant::now();
    while heard != wanted.iter().map(|it| (*it).to_owned()).collect() {
        assert!(begin.elapsed() < PATIENCE, "{heard:?} of {topics:?}");
        match socket.next() {
            (TEXT, text) => {
                let message: Value = serde_json::from_slice(&text).expect("JSON");
                for channel in message["channels"].as_array().into_iter().flatten() {
                    let id = channel["id"].as_u64().expect("a number");
                    topics.insert(id, channel["topic"].as_str().expect("text").to_owned());
                    let asked = json!({"op": "subscribe", "subscriptions": [{"id": id, "channelId": id}]});
                    socket.send(&asked.to_string());
                }
            }
            (BINARY, data) if data[0] == MESSAGE_DATA => {
                let id = u64::from(u32::from_le_bytes(data[1..5].try_into().expect("four bytes")));
                let topic = topics[&id].clone();
                assert!(data.len() > 13 || topic == "/log", "{topic} is empty");
                if topic == "/actuation" {
                    actuation = serde_json::from_slice(&data[13..]).expect("JSON");
                }
                if topic == "/tf" {
                    data[13..].clone_into(&mut transforms);
                }
                heard.insert(topic);
                heard.remove("/log");
            }
            _ => {}
        }
    }
    assert_eq!(actuation["measured_a"][4], -1.25);
    let names = |name: &str| transforms.windows(name.len()).any(|text| text == name.as_bytes());
    assert!(names("world") && names("m2") && !names("m1"), "the magnet that is seen has its own frame");
    assert_eq!(actuation["coils"].as_array().expect("a list").len(), 6);
}

/// Goal: the layout that is shipped names nothing that is not published.
#[test]
fn layout_is_json_and_names_topics_that_are_published() {
    let text = std::fs::read_to_string(shipped("magsteer.foxglove-layout.json")).expect("shipped");
    let layout: Value = serde_json::from_str(&text).expect("JSON");
    let panels = layout["configById"].as_object().expect("panels");
    assert!(panels.len() >= 5, "{panels:?}");
    let mut paths = Vec::new();
    strings(&layout["configById"], &mut paths);
    let named: BTreeSet<&str> = paths
        .iter()
        .filter(|it| it.starts_with('/'))
        .map(|it| it.split(['.', '[']).next().unwrap_or(it))
        .collect();
    for topic in ["/angles", "/actuation", "/scene", "/status", "/timing"] {
        assert!(named.contains(topic), "{topic} of {named:?}");
    }
    let known = [
        "/measured_cp",
        "/target_cp",
        "/tf",
        "/scene",
        "/angles",
        "/actuation",
        "/status",
        "/timing",
        "/log",
    ];
    let unknown: Vec<_> = named.iter().filter(|it| !known.contains(it)).collect();
    assert!(unknown.is_empty(), "{unknown:?}");
}

/// Every string and key below a value.
fn strings(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::String(text) => found.push(text.clone()),
        Value::Array(entries) => entries.iter().for_each(|entry| strings(entry, found)),
        Value::Object(fields) => fields.iter().for_each(|(key, value)| {
            found.push(key.clone());
            strings(value, found);
        }),
        _ => {}
    }
}
