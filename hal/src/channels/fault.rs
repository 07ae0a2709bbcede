//! Faults on request: the driver's desk, which exists only where faults are allowed, and the asking end.

use std::fmt::{self, Debug};
use std::time::Duration;

use iceoryx2::port::server::Server;
use iceoryx2::prelude::{PortFactory, ipc};

use super::endpoint::Endpoint;
use super::error::{ChannelError, FaultClientError, Role};
use super::lock;
use super::membership::Membership;
use super::requests::{Unanswered, ask};
use super::service::{FAULT, Requests, Wait, create_requests, open_requests, retried};
use crate::fault::{FaultAnswer, FaultRequest, Injector};
use crate::time::Stamp;

type FaultRequests = Requests<FaultRequest, FaultAnswer>;

/// Requests taken in one cycle of a driver; more wait for the next.
const REQUESTS_PER_CYCLE: usize = 4;

/// The asking end belongs to no loop: it may wait for a connection to form.
const CONNECTION_WAIT: Duration = Duration::from_millis(100);

/// What a driver needs to allow faults, made but not yet joined.
#[derive(Debug)]
pub(super) struct FaultServices {
    service: FaultRequests,
    injector: Injector,
}

impl FaultServices {
    pub(super) fn create(
        membership: &Membership,
        endpoint: &Endpoint,
        injector: Injector,
    ) -> Result<Self, ChannelError> {
        Ok(Self { service: create_requests(&membership.node, endpoint, FAULT)?, injector })
    }

    pub(super) fn into_desk(self) -> Result<FaultDesk, ChannelError> {
        let server = retried(FAULT, || {
            // Places may still be taken by processes that were killed.
            let _ = self.service.try_cleanup_dead_nodes();
            self.service.server_builder().create()
        })?;
        Ok(FaultDesk { server, injector: self.injector })
    }
}

/// The injector of a driver, and those who ask for faults. Belongs to the thread that made it.
pub(super) struct FaultDesk {
    server: Server<ipc::Service, FaultRequest, (), FaultAnswer, ()>,
    pub(super) injector: Injector,
}

impl Debug for FaultDesk {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("FaultDesk").field("injector", &self.injector).finish_non_exhaustive()
    }
}

impl FaultDesk {
    /// Carries out what was asked for since the former call, and answers.
    pub(super) fn serve(&mut self, now: Stamp) {
        for _ in 0..REQUESTS_PER_CYCLE {
            // A server that fails to connect to one client still serves the others.
            let Ok(Some(request)) = self.server.receive() else { return };
            let answer = FaultAnswer::to(request.payload(), &mut self.injector, now);
            // Whoever asked sees no answer then, and takes it as not done.
            let _ = request.send_copy(answer);
        }
    }
}

/// Asks the driver of a rig for faults. Belongs to the thread that made it.
#[derive(Debug)]
pub struct FaultClient {
    service: FaultRequests,
    endpoint: Endpoint,
    _membership: Membership,
}

impl FaultClient {
    /// Finds the rig's driver, for which it waits up to `wait`.
    ///
    /// # Errors
    /// When there is no driver, it does not allow faults, or the transport fails.
    pub fn open(endpoint: &Endpoint, wait: Duration) -> Result<Self, FaultClientError> {
        let membership = endpoint.join(CONNECTION_WAIT)?;
        match open_requests(&membership.node, endpoint, FAULT, Role::Driver, &Wait::new(wait)) {
            Ok(service) => Ok(Self { service, endpoint: endpoint.clone(), _membership: membership }),
            Err(ChannelError::Missing { .. }) => Err(absent(endpoint)),
            Err(error) => Err(error.into()),
        }
    }

    /// Sends a request and waits for its answer. Without an answer it must be taken as not done.
    ///
    /// # Errors
    /// When the driver does not allow faults, is gone or does not answer within `timeout`, or the transport
    /// fails.
    pub fn send(
        &mut self,
        request: FaultRequest,
        timeout: Duration,
    ) -> Result<FaultAnswer, FaultClientError> {
        ask(&self.service, FAULT, request, timeout).map_err(|unanswered| match unanswered {
            // A service whose maker was killed may outlive it.
            Unanswered::NoServer => absent(&self.endpoint),
            Unanswered::NoAnswer { timeout } => FaultClientError::NoAnswer { timeout },
            Unanswered::Transport { cause } => FaultClientError::Transport { cause },
        })
    }
}

/// Why nobody serves: no driver, or one that does not allow it.
fn absent(endpoint: &Endpoint) -> FaultClientError {
    let rig = endpoint.rig().to_owned();
    match lock::holder(endpoint.root(), endpoint.rig(), Role::Driver) {
        Some(pid) => FaultClientError::NotAllowed { rig, pid },
        None => FaultClientError::NoDriver { rig, root: endpoint.root().to_owned() },
    }
}
