//! Both ends of a rig that is watched from another machine.
//!
//! ```text
//!  the rig's machine                                        a machine that watches
//!  daemon ── status, record ──▶ tunnel ═══ network ═══▶ tunnel ── status, record ──▶ viewers, recorders
//!            (SharedEnd beside it)                               request ──▶ WatchedEnd: refuses
//! ```
//!
//! The tunnel is another program: the transport's own. It carries topics, each as the bytes it is, and
//! neither requests nor a topic's attributes and settings. Hence on the watching machine a [`WatchedEnd`]
//! makes the topics, as a daemon would, before the tunnel finds them; it serves requests too, so that whoever
//! commands there is refused with a reason. That both ends speak of one layout is kept by
//! [`TunnelFacts::schema`], under which alone they are to meet.
//!
//! What is absent: the daemon's topics with its driver. No tunnel is told of them.

use std::time::Duration;

use iceoryx2::port::server::Server;
use iceoryx2::prelude::ipc;

use super::distant::DistantClock;
use super::endpoint::{Endpoint, prefix};
use super::error::{ChannelError, Role};
use super::layout::schema_hash;
use super::lock::{RoleLock, holder};
use super::membership::Membership;
use super::operator::IncomingRequest;
use super::ports::Inlet;
use super::service::{RECORD, REQUEST, STATUS, TARGET_SET, Topic, create_requests, create_topic, retried};
use crate::operator::{OperatorAnswer, OperatorRequest, StatusMessage};
use crate::record::RecordBatch;
use crate::time::Stamp;

/// None of these ports belong to a control loop: they may wait for a connection to form.
const CONNECTION_WAIT: Duration = Duration::from_millis(100);

/// What the transport's tunnel has to be told to carry what a rig publishes for watchers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TunnelFacts {
    /// Text of the transport's configuration file, TOML: the rig's root and prefix.
    pub transport_config: String,
    /// Full names of the topics that watchers need: the status, and every cycle. None of them commands.
    pub services: [String; 2],
    /// Tells builds with other layouts of messages apart.
    pub schema: String,
}

impl TunnelFacts {
    /// Those of a rig.
    ///
    /// # Errors
    /// When the root cannot be named to the transport.
    pub fn of(endpoint: &Endpoint) -> Result<Self, ChannelError> {
        let config = endpoint.config(CONNECTION_WAIT)?;
        let wait = config.global.creation_timeout;
        let transport_config = format!(
            "[global]\nroot-path = {:?}\nprefix = {:?}\n\n[global.creation-timeout]\nsecs = {}\nnanos = {}\n",
            config.global.root_path().to_string(),
            prefix(endpoint.root()),
            wait.as_secs(),
            wait.subsec_nanos(),
        );
        Ok(Self {
            transport_config,
            services: [STATUS, RECORD].map(|topic| endpoint.service(topic.channel)),
            schema: schema_hash(),
        })
    }
}

/// Held on the rig's machine beside a tunnel: there is one tunnel a rig, and what it makes in shared memory
/// is closed to other users and swept.
#[derive(Debug)]
pub struct SharedEnd {
    _membership: Membership,
    _lock: RoleLock,
}

impl SharedEnd {
    /// Becomes the one who shares the rig.
    ///
    /// # Errors
    /// When it is shared already, or the transport fails.
    pub fn open(endpoint: &Endpoint) -> Result<Self, ChannelError> {
        let lock = RoleLock::acquire(endpoint.root(), endpoint.rig(), Role::Tunnel)?;
        Ok(Self { _membership: endpoint.join(CONNECTION_WAIT)?, _lock: lock })
    }
}

type RequestServer = Server<ipc::Service, OperatorRequest, (), OperatorAnswer, ()>;

/// Held on a machine that watches: in the daemon's place towards operators and viewers, so that no daemon can
/// run there. Belongs to the thread that made it.
#[derive(Debug)]
pub struct WatchedEnd {
    request: RequestServer,
    target_set: RequestServer,
    status: Inlet<StatusMessage>,
    clock: DistantClock,
    newest: Option<StatusMessage>,
    _record: Topic<RecordBatch>,
    _membership: Membership,
    _locks: [RoleLock; 2],
}

impl WatchedEnd {
    /// Takes the place of the rig's daemon and makes its services.
    ///
    /// # Errors
    /// When the rig's operators are served here already, or the transport fails.
    pub fn create(endpoint: &Endpoint) -> Result<Self, ChannelError> {
        let lock = |role| RoleLock::acquire(endpoint.root(), endpoint.rig(), role);
        let locks = [lock(Role::OperatorServer)?, lock(Role::Tunnel)?];
        let membership = endpoint.join(CONNECTION_WAIT)?;
        let server = |channel| {
            let requests = create_requests(&membership.node, endpoint, channel)?;
            retried(channel, || requests.server_builder().create())
        };
        Ok(Self {
            request: server(REQUEST)?,
            target_set: server(TARGET_SET)?,
            status: Inlet::new(create_topic(&membership.node, endpoint, STATUS)?, STATUS.buffer)?,
            clock: DistantClock::default(),
            newest: None,
            _record: create_topic(&membership.node, endpoint, RECORD)?,
            _membership: membership,
            _locks: locks,
        })
    }

    /// The next request that waits for an answer; never waits itself.
    pub fn next_request(&mut self) -> Option<IncomingRequest> {
        // A server that fails to connect to one client still serves the others.
        let received = |server: &RequestServer| server.receive().unwrap_or(None);
        received(&self.request).or_else(|| received(&self.target_set)).map(IncomingRequest::new)
    }

    /// The status that came last, as far as it has arrived, with its stamps told by this machine's clock;
    /// `None` before the first.
    pub fn newest_status(&mut self, now: Stamp) -> Option<StatusMessage> {
        let Self { status, clock, newest, .. } = self;
        // What cannot be received is not new.
        let _ = status.drain(now, |message| {
            let mut message = *message;
            clock.localise(&mut message.header, now);
            *newest = Some(message);
        });
        self.newest
    }
}

/// True when what serves the rig's operators here is a [`WatchedEnd`]: the rig itself is on another machine.
pub(super) fn is_distant(endpoint: &Endpoint) -> bool {
    let of = |role| holder(endpoint.root(), endpoint.rig(), role);
    let server = of(Role::OperatorServer);
    // A daemon that took the place of a dead one is another process.
    server.is_some() && server == of(Role::Tunnel)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use iceoryx2::prelude::{Config, FilePath, SemanticString};

    use super::super::{OperatorClient, OperatorServices, PrivateRoot, RecordObserver};
    use super::{ChannelError, Role, SharedEnd, TunnelFacts, WatchedEnd};
    use crate::operator::{Cause, OperatorAnswer, OperatorRequest, StatusMessage, verb};
    use crate::time::Stamp;

    const WAIT: Duration = Duration::from_secs(5);

    /// Goal: the tunnel meets the rig's processes. The oracle is the transport's own reader.
    #[test]
    fn written_configuration_is_the_one_that_this_rig_joins_with() {
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let facts = TunnelFacts::of(&endpoint).expect("the transport takes the root");
        let file = root.path().join("iceoryx2.toml");
        std::fs::write(&file, &facts.transport_config).expect("written");
        let path = FilePath::new(file.as_os_str().as_encoded_bytes()).expect("a path");
        let read = Config::from_file(&path).expect("the transport reads it");
        assert_eq!(read, endpoint.config(super::CONNECTION_WAIT).expect("a configuration"));
    }

    #[test]
    fn services_for_watchers_hold_no_way_to_command() {
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let facts = TunnelFacts::of(&root.endpoint("rig").expect("a name")).expect("facts");
        assert_eq!(facts.services, ["magsteer/rig/status", "magsteer/rig/record"]);
        assert!(facts.services.iter().all(|name| !name.contains(['*', '?'])), "no pattern matches more");
    }

    /// Goal: what a viewer on the watching machine needs is there, and a command is refused with a reason.
    #[test]
    fn watching_machine_has_every_service_and_refuses_requests() {
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let mut end = WatchedEnd::create(&endpoint).expect("free");
        let mut client = OperatorClient::open(&endpoint, WAIT).expect("services are there");
        assert!(client.is_distant());
        RecordObserver::open(&endpoint, WAIT).expect("cycles would come here");
        let refused = OperatorServices::create(&endpoint).expect_err("no daemon beside it");
        assert!(matches!(refused, ChannelError::Held { role: Role::OperatorServer, .. }), "{refused}");
        for verb in [verb::ARM, verb::SET_TARGET] {
            let request = OperatorRequest { verb, ..OperatorRequest::default() };
            let answer = std::thread::scope(|scope| {
                let asked = scope.spawn(|| {
                    let mut client = OperatorClient::open(&endpoint, WAIT).expect("services are there");
                    client.send(request, WAIT).expect("an answer")
                });
                let mut answered = false;
                while !answered {
                    if let Some(incoming) = end.next_request() {
                        assert_eq!(incoming.request().verb, verb);
                        let cause = Cause::OnlyWatched.code();
                        let answer = OperatorAnswer { cause, ..OperatorAnswer::default() };
                        incoming.answer(answer).expect("the client waits");
                        answered = true;
                    }
                    std::thread::sleep(Duration::from_millis(1));
                }
                asked.join().expect("no panic")
            });
            assert_eq!((answer.accepted, answer.cause), (0, Cause::OnlyWatched.code()));
        }
        assert!(client.newest_status(Stamp::now()).is_none(), "nobody publishes");
    }

    /// Goal: a daemon's own viewers never take it for a distant one, whether it is shared or not.
    #[test]
    fn shared_rig_is_not_distant_and_is_shared_once() {
        let root = PrivateRoot::create("magsteer-test").expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        // The pid in the lock is what tells the two apart, and here both are this process: another one holds
        // it.
        let mut child = std::process::Command::new("sleep").arg("60").spawn().expect("a process");
        let lock = root.path().join("rig.tunnel.lock");
        let mut server = OperatorServices::create(&endpoint).expect("free").into_server().expect("joined");
        std::fs::write(&lock, child.id().to_string()).expect("written");
        let mut client = OperatorClient::open(&endpoint, WAIT).expect("a daemon");
        assert!(!client.is_distant());
        let status = StatusMessage { cycle: 7, ..StatusMessage::default() };
        server.publish_status(status, Stamp::from_nanoseconds(5)).expect("sent");
        let heard = client.newest_status(Stamp::now()).expect("it is here");
        assert_eq!((heard.cycle, heard.header.publish_stamp_ns), (7, 5), "stamps are this machine's");
        child.kill().expect("it runs");
        child.wait().expect("it ends");
        let _shared = SharedEnd::open(&endpoint).expect("free");
        let refused = SharedEnd::open(&endpoint).expect_err("one tunnel a rig");
        assert!(refused.to_string().contains("already has a tunnel"), "{refused}");
    }
}
