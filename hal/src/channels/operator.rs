//! Operators and the daemon: requests with answers, and the status that anyone may watch.

use std::fmt::{self, Debug};
use std::time::Duration;

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::ipc;

use super::distant::DistantClock;
use super::endpoint::Endpoint;
use super::error::{ChannelError, ClientError, Role};
use super::lock::RoleLock;
use super::membership::Membership;
use super::ports::{Inlet, Outlet};
use super::record::RecordOutlet;
use super::requests::ask;
use super::service::{
    RECORD, REQUEST, Requests, STATUS, TARGET_SET, TRUTH, Topic, Wait, create_requests, create_topic,
    open_requests, open_topic, retried,
};
use super::tunnel::is_distant;
use crate::hardware::WriteError;
use crate::message::PoseMessage;
use crate::operator::{OperatorAnswer, OperatorRequest, StatusMessage, verb};
use crate::record::RecordBatch;
use crate::send::HeaderWriter;
use crate::time::Stamp;

type OperatorRequests = Requests<OperatorRequest, OperatorAnswer>;
type RequestServer = Server<ipc::Service, OperatorRequest, (), OperatorAnswer, ()>;

/// None of these ports belong to a control loop: they may wait for a connection to form.
const CONNECTION_WAIT: Duration = Duration::from_millis(100);

/// The daemon's services for operators, made but not yet joined: may move to the thread that serves them.
#[derive(Debug)]
pub struct OperatorServices {
    lock: RoleLock,
    membership: Membership,
    request: OperatorRequests,
    target_set: OperatorRequests,
    status: Topic<StatusMessage>,
    record: Topic<RecordBatch>,
}

impl OperatorServices {
    /// Becomes the one who serves the rig's operators and makes the services.
    ///
    /// # Errors
    /// When the rig's operators are served already, or the transport fails.
    pub fn create(endpoint: &Endpoint) -> Result<Self, ChannelError> {
        let lock = RoleLock::acquire(endpoint.root(), endpoint.rig(), Role::OperatorServer)?;
        let membership = endpoint.join(CONNECTION_WAIT)?;
        Ok(Self {
            request: create_requests(&membership.node, endpoint, REQUEST)?,
            target_set: create_requests(&membership.node, endpoint, TARGET_SET)?,
            status: create_topic(&membership.node, endpoint, STATUS)?,
            record: create_topic(&membership.node, endpoint, RECORD)?,
            lock,
            membership,
        })
    }

    /// Joins the services; call it on the thread that serves operators, which must not be the control loop's.
    ///
    /// # Errors
    /// When the transport fails.
    pub fn into_server(self) -> Result<OperatorServer, ChannelError> {
        let epoch = Stamp::now().nanoseconds().max(1);
        Ok(OperatorServer {
            request: retried(REQUEST, || self.request.server_builder().create())?,
            target_set: retried(TARGET_SET, || self.target_set.server_builder().create())?,
            status: Outlet::new(self.status)?,
            record: RecordOutlet::new(self.record, epoch)?,
            header: HeaderWriter::new(epoch),
            _membership: self.membership,
            _lock: self.lock,
        })
    }
}

/// Serves operators. Belongs to the thread that made it.
#[derive(Debug)]
pub struct OperatorServer {
    request: RequestServer,
    target_set: RequestServer,
    status: Outlet<StatusMessage>,
    record: RecordOutlet,
    header: HeaderWriter,
    _membership: Membership,
    _lock: RoleLock,
}

impl OperatorServer {
    /// The next request that waits for an answer, from either service; never waits itself.
    pub fn next_request(&mut self) -> Option<IncomingRequest> {
        // A server that fails to connect to one client still serves the others.
        let received = |server: &RequestServer| server.receive().unwrap_or(None);
        received(&self.request).or_else(|| received(&self.target_set)).map(IncomingRequest::new)
    }

    /// Publishes the status, filling in sequence, epoch, schema and publish stamp.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_status(&mut self, mut status: StatusMessage, now: Stamp) -> Result<(), WriteError> {
        self.header.write(&mut status.header, now);
        self.status.send(status, now)
    }

    /// Publishes some cycles, filling in sequence, epoch, schema and publish stamp. Never waits: an observer whose
    /// queue is full loses its oldest batch.
    ///
    /// # Errors
    /// When the transport refuses.
    pub fn publish_record(&mut self, batch: &mut RecordBatch, now: Stamp) -> Result<(), WriteError> {
        self.record.publish(batch, now)
    }
}

/// A request that waits for its answer. Dropped without one, it counts as not done.
pub struct IncomingRequest {
    active: ActiveRequest<ipc::Service, OperatorRequest, (), OperatorAnswer, ()>,
}

impl Debug for IncomingRequest {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("IncomingRequest").field("request", self.request()).finish_non_exhaustive()
    }
}

impl IncomingRequest {
    pub(super) fn new(active: ActiveRequest<ipc::Service, OperatorRequest, (), OperatorAnswer, ()>) -> Self {
        Self { active }
    }

    /// What is asked for, unchecked.
    #[must_use]
    pub fn request(&self) -> &OperatorRequest {
        self.active.payload()
    }

    /// Answers.
    ///
    /// # Errors
    /// When the transport refuses; the operator then sees no answer.
    pub fn answer(self, answer: OperatorAnswer) -> Result<(), WriteError> {
        self.active.send_copy(answer).map_err(|_| WriteError::Transport)
    }
}

/// An operator's end: sends requests and watches the status. Belongs to the thread that made it.
#[derive(Debug)]
pub struct OperatorClient {
    request_service: OperatorRequests,
    target_set_service: OperatorRequests,
    status: Inlet<StatusMessage>,
    newest: Option<StatusMessage>,
    /// The clock of the rig's machine, when that is another one.
    distant: Option<DistantClock>,
    _membership: Membership,
}

impl OperatorClient {
    /// Finds the rig's daemon, for which it waits up to `wait`.
    ///
    /// # Errors
    /// When no daemon appears in time, or the transport fails.
    pub fn open(endpoint: &Endpoint, wait: Duration) -> Result<Self, ChannelError> {
        let membership = endpoint.join(CONNECTION_WAIT)?;
        let wait = Wait::new(wait);
        let request_service = open_requests(&membership.node, endpoint, REQUEST, Role::Daemon, &wait)?;
        let target_set_service = open_requests(&membership.node, endpoint, TARGET_SET, Role::Daemon, &wait)?;
        let status = open_topic(&membership.node, endpoint, STATUS, Role::Daemon, &wait)?;
        Ok(Self {
            request_service,
            target_set_service,
            status: Inlet::new(status, STATUS.buffer)?,
            newest: None,
            distant: is_distant(endpoint).then(DistantClock::default),
            _membership: membership,
        })
    }

    /// True when the rig is on another machine and reaches this one through a tunnel. Stamps of its status are
    /// then told by this machine's clock: an age is what came on top of the shortest way here.
    #[must_use]
    pub fn is_distant(&self) -> bool {
        self.distant.is_some()
    }

    /// Sends a request and waits for its answer. Without an answer it must be taken as not done.
    ///
    /// # Errors
    /// When no daemon serves requests or answers within `timeout`, or the transport fails.
    pub fn send(
        &mut self,
        request: OperatorRequest,
        timeout: Duration,
    ) -> Result<OperatorAnswer, ClientError> {
        let (service, name) = if request.verb == verb::SET_TARGET {
            (&self.target_set_service, TARGET_SET)
        } else {
            (&self.request_service, REQUEST)
        };
        Ok(ask(service, name, request, timeout)?)
    }

    /// The status published last, as far as it has arrived; `None` before the first.
    pub fn newest_status(&mut self, now: Stamp) -> Option<StatusMessage> {
        self.drain_status(now, |_| ());
        self.newest
    }

    /// Hands over every status that arrived since the former call, oldest first, up to a queue of 64.
    pub fn drain_status(&mut self, now: Stamp, mut take: impl FnMut(&StatusMessage)) {
        let Self { status, newest, distant, .. } = self;
        // What cannot be received is not new: the former status stays, with its age.
        let _ = status.drain(now, |message| {
            let mut message = *message;
            if let Some(clock) = distant {
                clock.localise(&mut message.header, now);
            }
            *newest = Some(message);
            take(&message);
        });
    }
}

/// Watches the true poses of a simulated plant. Belongs to the thread that made it.
#[derive(Debug)]
pub struct TruthObserver {
    truth: Inlet<PoseMessage>,
    _membership: Membership,
}

impl TruthObserver {
    /// Finds the rig's driver, for which it waits up to `wait`.
    ///
    /// # Errors
    /// When no driver appears in time, or the transport fails.
    pub fn open(endpoint: &Endpoint, wait: Duration) -> Result<Self, ChannelError> {
        let membership = endpoint.join(CONNECTION_WAIT)?;
        let truth = open_topic(&membership.node, endpoint, TRUTH, Role::Driver, &Wait::new(wait))?;
        Ok(Self { truth: Inlet::new(truth, TRUTH.buffer)?, _membership: membership })
    }

    /// Hands over every message that arrived since the former call, oldest first, up to a queue of 512.
    pub fn drain(&mut self, now: Stamp, take: impl FnMut(&PoseMessage)) {
        // What cannot be received is not new.
        let _ = self.truth.drain(now, take);
    }
}
