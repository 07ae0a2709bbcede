//! Making and opening services: settings in one table, bounded retries, and a check of what was found.

use std::error::Error;
use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use iceoryx2::prelude::{
    AttributeVerifier, IceoryxSend, MessagingPattern, Node, PortFactory, Service, ServiceName, ZeroCopySend,
    ipc,
};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeCreateError, PublishSubscribeOpenError, PublishSubscribeOpenOrCreateError,
};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError, RequestResponseOpenError, RequestResponseOpenOrCreateError,
};
use iceoryx2::service::port_factory::{publish_subscribe, request_response};
use iceoryx2::service::service_hash::ServiceHash;

use super::endpoint::Endpoint;
use super::error::{ChannelError, Role};
use super::layout::schema_hash;

/// A publish-subscribe service.
pub(super) type Topic<T> = publish_subscribe::PortFactory<ipc::Service, T, ()>;
/// A request-response service.
pub(super) type Requests<Q, A> = request_response::PortFactory<ipc::Service, Q, (), A, ()>;

/// What a request or an answer is made of.
pub(super) trait Payload: IceoryxSend + ZeroCopySend + Debug + Copy + 'static {}

impl<T: IceoryxSend + ZeroCopySend + Debug + Copy + 'static> Payload for T {}

/// How long one step of opening may be tried again: another process may be half-way through making
/// or clearing up the same thing.
const RETRY_TIME: Duration = Duration::from_secs(3);
const RETRY_PAUSE: Duration = Duration::from_millis(10);
/// How long a service may stand half-made before it counts as abandoned: many times what making one takes.
const HUNG_TIME: Duration = Duration::from_millis(500);

/// Settings of a publish-subscribe service.
///
/// Places for publishers and subscribers are more than the rig needs: a process that is killed while it joins can leave
/// its place taken until the service itself ends, and must not lock out its follower. That there is one publisher
/// is kept by the role locks and checked by [`super::ports::Outlet::sole`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct TopicSettings {
    pub(crate) channel: &'static str,
    /// Messages kept for a subscriber that joins late.
    pub(crate) history: usize,
    /// Longest queue of a subscriber.
    pub(crate) buffer: usize,
    pub(crate) publishers: usize,
    pub(crate) subscribers: usize,
}

impl TopicSettings {
    /// Processes that may have the service open.
    pub(crate) const fn nodes(self) -> usize {
        self.publishers + self.subscribers + 4
    }
}

pub(crate) const POSE: TopicSettings =
    TopicSettings { channel: "pose", history: 1, buffer: 64, publishers: 8, subscribers: 8 };
pub(crate) const FEEDBACK: TopicSettings =
    TopicSettings { channel: "coil/feedback", history: 1, buffer: 64, publishers: 8, subscribers: 8 };
/// No history: a command for a former driver must not reach the next one.
pub(crate) const COMMAND: TopicSettings =
    TopicSettings { channel: "coil/command", history: 0, buffer: 1, publishers: 8, subscribers: 8 };
pub(crate) const TRUTH: TopicSettings =
    TopicSettings { channel: "sim/truth", history: 1, buffer: 512, publishers: 8, subscribers: 8 };
pub(crate) const STATUS: TopicSettings =
    TopicSettings { channel: "status", history: 1, buffer: 64, publishers: 8, subscribers: 16 };

/// A second of a loop at 1 kHz waits for whoever records it.
pub(crate) const RECORD: TopicSettings =
    TopicSettings { channel: "record", history: 0, buffer: 128, publishers: 8, subscribers: 4 };

pub(crate) const REQUEST: &str = "request";
pub(crate) const TARGET_SET: &str = "target/set";
/// Served by a driver that allows faults on request, and by no other.
pub(super) const FAULT: &str = "fault";

/// Opens the service, or makes it when it does not exist. Only the holder of the role that makes it may call this.
pub(super) fn create_topic<T: IceoryxSend + ZeroCopySend + std::fmt::Debug + 'static>(
    node: &Node<ipc::Service>,
    endpoint: &Endpoint,
    settings: TopicSettings,
) -> Result<Topic<T>, ChannelError> {
    let name = endpoint.service(settings.channel);
    let (service, attributes) = (service_name(&name)?, attributes(&name)?);
    let leftover = leftover_file(node, &service, MessagingPattern::PublishSubscribe);
    let topic = made(&name, &leftover, is_hung_topic, || {
        node.service_builder(&service)
            .publish_subscribe::<T>()
            .enable_safe_overflow(true)
            .history_size(settings.history)
            .subscriber_max_buffer_size(settings.buffer)
            .subscriber_max_borrowed_samples(1)
            .max_publishers(settings.publishers)
            .max_subscribers(settings.subscribers)
            .max_nodes(settings.nodes())
            .open_or_create_with_attributes(&attributes)
    })?;
    check_settings(topic, &name, settings)
}

/// Opens the service, waiting until `deadline` for whoever has `role` to make it.
pub(super) fn open_topic<T: IceoryxSend + ZeroCopySend + std::fmt::Debug + 'static>(
    node: &Node<ipc::Service>,
    endpoint: &Endpoint,
    settings: TopicSettings,
    role: Role,
    wait: &Wait,
) -> Result<Topic<T>, ChannelError> {
    let name = endpoint.service(settings.channel);
    let (service, attributes) = (service_name(&name)?, attributes(&name)?);
    let missing =
        |error: &PublishSubscribeOpenError| matches!(error, PublishSubscribeOpenError::DoesNotExist);
    let topic = wait.opened(endpoint, &name, role, missing, || {
        node.service_builder(&service).publish_subscribe::<T>().open_with_attributes(&attributes)
    })?;
    check_settings(topic, &name, settings)
}

/// Opens a request service, or makes it when it does not exist. Only the holder of the role that makes it may call this.
pub(super) fn create_requests<Q: Payload, A: Payload>(
    node: &Node<ipc::Service>,
    endpoint: &Endpoint,
    channel: &str,
) -> Result<Requests<Q, A>, ChannelError> {
    let name = endpoint.service(channel);
    let (service, attributes) = (service_name(&name)?, attributes(&name)?);
    let leftover = leftover_file(node, &service, MessagingPattern::RequestResponse);
    made(&name, &leftover, is_hung_request, || {
        node.service_builder(&service)
            .request_response::<Q, A>()
            // A request whose sender no longer waits counts as not done.
            .enable_fire_and_forget_requests(false)
            // One serves; more places for the reason given at `TopicSettings`.
            .max_servers(4)
            .max_clients(16)
            .max_nodes(24)
            .open_or_create_with_attributes(&attributes)
    })
}

/// Opens a request service, waiting until `deadline` for whoever has `role` to make it.
pub(super) fn open_requests<Q: Payload, A: Payload>(
    node: &Node<ipc::Service>,
    endpoint: &Endpoint,
    channel: &str,
    role: Role,
    wait: &Wait,
) -> Result<Requests<Q, A>, ChannelError> {
    let name = endpoint.service(channel);
    let (service, attributes) = (service_name(&name)?, attributes(&name)?);
    let not_yet = |error: &RequestResponseOpenError| {
        use RequestResponseOpenError as Open;
        matches!(error, Open::DoesNotExist | Open::HangsInCreation | Open::IsMarkedForDestruction)
    };
    wait.opened(endpoint, &name, role, not_yet, || {
        node.service_builder(&service).request_response::<Q, A>().open_with_attributes(&attributes)
    })
}

/// Makes a service that this process alone may make. One whose maker was killed half-way stays so for ever: the
/// transport takes it for one that is still being made, and it belongs to no node that could be cleared up.
/// Nobody can have joined it, so once it has stood like that for a while its file is taken away.
fn made<T, E: Error + Send + Sync + 'static>(
    service: &str,
    leftover: &Path,
    is_hung: impl Fn(&E) -> bool,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, ChannelError> {
    let mut hung_since: Option<Instant> = None;
    retried(service, || {
        attempt().inspect_err(|error| {
            if !is_hung(error) {
                hung_since = None;
            } else if hung_since.get_or_insert_with(Instant::now).elapsed() >= HUNG_TIME {
                // What cannot be removed is reported by the attempts that go on failing.
                let _ = std::fs::remove_file(leftover);
                hung_since = None;
            }
        })
    })
}

fn is_hung_topic(error: &PublishSubscribeOpenOrCreateError) -> bool {
    use PublishSubscribeCreateError as Create;
    use PublishSubscribeOpenError as Open;
    use PublishSubscribeOpenOrCreateError as Error;
    matches!(
        error,
        Error::PublishSubscribeOpenError(Open::HangsInCreation | Open::ServiceInCorruptedState)
            | Error::PublishSubscribeCreateError(Create::HangsInCreation | Create::ServiceInCorruptedState)
            | Error::SystemInFlux
    )
}

fn is_hung_request(error: &RequestResponseOpenOrCreateError) -> bool {
    use RequestResponseCreateError as Create;
    use RequestResponseOpenError as Open;
    use RequestResponseOpenOrCreateError as Error;
    matches!(
        error,
        Error::RequestResponseOpenError(Open::HangsInCreation | Open::ServiceInCorruptedState)
            | Error::RequestResponseCreateError(Create::HangsInCreation | Create::ServiceInCorruptedState)
            | Error::SystemInFlux
    )
}

/// Where the transport keeps what it knows of a service.
fn leftover_file(node: &Node<ipc::Service>, service: &ServiceName, pattern: MessagingPattern) -> PathBuf {
    let global = &node.config().global;
    let hash = ServiceHash::new::<<ipc::Service as Service>::ServiceNameHasher>(service, pattern);
    let file = format!("{}{hash}{}", global.prefix, global.service.static_config_storage_suffix);
    PathBuf::from(global.service_dir().to_string()).join(file)
}

/// How long to wait for the other side, counted from one start for all its services.
#[derive(Debug)]
pub(super) struct Wait {
    start: Instant,
    duration: Duration,
}

impl Wait {
    pub(super) fn new(duration: Duration) -> Self {
        Self { start: Instant::now(), duration }
    }

    fn opened<T, E: Error + Send + Sync + 'static>(
        &self,
        endpoint: &Endpoint,
        service: &str,
        role: Role,
        not_yet: impl Fn(&E) -> bool,
        mut attempt: impl FnMut() -> Result<T, E>,
    ) -> Result<T, ChannelError> {
        let mut failed_since: Option<Instant> = None;
        loop {
            let error = match attempt() {
                Ok(opened) => return Ok(opened),
                Err(error) => error,
            };
            if not_yet(&error) {
                failed_since = None;
                if self.start.elapsed() >= self.duration {
                    let (rig, root) = (endpoint.rig().to_owned(), endpoint.root().to_owned());
                    return Err(ChannelError::Missing { rig, role, root, waited: self.duration });
                }
            } else if failed_since.get_or_insert_with(Instant::now).elapsed() >= RETRY_TIME {
                return Err(transport(service, error));
            }
            std::thread::sleep(RETRY_PAUSE);
        }
    }
}

/// Tries again for a bounded time: files of dead processes are being cleared up, or made, by somebody else.
pub(super) fn retried<T, E: Error + Send + Sync + 'static>(
    service: &str,
    mut attempt: impl FnMut() -> Result<T, E>,
) -> Result<T, ChannelError> {
    let start = Instant::now();
    loop {
        match attempt() {
            Ok(made) => return Ok(made),
            Err(error) if start.elapsed() >= RETRY_TIME => return Err(transport(service, error)),
            Err(_) => std::thread::sleep(RETRY_PAUSE),
        }
    }
}

pub(super) fn transport(service: &str, error: impl Error + Send + Sync + 'static) -> ChannelError {
    ChannelError::Transport { service: service.to_owned(), cause: Box::new(error) }
}

/// The transport takes settings for least values when it opens a service: what was found must be what is meant.
fn check_settings<T: IceoryxSend + std::fmt::Debug + 'static>(
    topic: Topic<T>,
    service: &str,
    settings: TopicSettings,
) -> Result<Topic<T>, ChannelError> {
    let found = topic.static_config();
    let pairs = [
        ("number of publishers", settings.publishers, found.max_publishers()),
        ("number of subscribers", settings.subscribers, found.max_subscribers()),
        ("history", settings.history, found.history_size()),
        ("queue", settings.buffer, found.subscriber_max_buffer_size()),
    ];
    match pairs.into_iter().find(|(_, expected, actual)| expected != actual) {
        Some((setting, expected, actual)) => {
            Err(ChannelError::Settings { service: service.to_owned(), setting, expected, actual })
        }
        None => Ok(topic),
    }
}

fn service_name(name: &str) -> Result<ServiceName, ChannelError> {
    ServiceName::new(name).map_err(|error| transport(name, error))
}

fn attributes(service: &str) -> Result<AttributeVerifier, ChannelError> {
    let key = AttributeKey::try_from("magsteer-schema").map_err(|error| transport(service, error))?;
    let hash = schema_hash();
    let value = AttributeValue::try_from(hash.as_str()).map_err(|error| transport(service, error))?;
    AttributeVerifier::new().require(&key, &value).map_err(|error| transport(service, error))
}
