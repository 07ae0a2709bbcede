//! Asking and waiting for the answer, whoever answers.

use std::error::Error;
use std::time::{Duration, Instant};

use iceoryx2::port::client::Client;
use iceoryx2::prelude::ipc;

use super::error::ClientError;
use super::service::{Payload, Requests, retried};

/// Why there is no answer.
#[derive(Debug)]
pub(super) enum Unanswered {
    /// It reached nobody.
    NoServer,
    /// It reached somebody who did not answer in time.
    NoAnswer { timeout: Duration },
    /// The transport failed.
    Transport { cause: Box<dyn Error + Send + Sync> },
}

impl From<Unanswered> for ClientError {
    fn from(unanswered: Unanswered) -> Self {
        match unanswered {
            Unanswered::NoServer => Self::NoDaemon,
            Unanswered::NoAnswer { timeout } => Self::NoAnswer { timeout },
            Unanswered::Transport { cause } => Self::Transport { cause },
        }
    }
}

/// Sends a request and waits for its answer. Without an answer it must be taken as not done.
///
/// # Errors
/// When nobody serves requests or answers within `timeout`, or the transport fails.
pub(super) fn ask<Q: Payload, A: Payload>(
    service: &Requests<Q, A>,
    name: &str,
    request: Q,
    timeout: Duration,
) -> Result<A, Unanswered> {
    let start = Instant::now();
    loop {
        // A client of its own for each request: an answer that comes late has nowhere to go.
        let client = retried(name, || service.client_builder().create())
            .map_err(|error| Unanswered::Transport { cause: Box::new(error) })?;
        match await_answer(&client, request, start, timeout) {
            // It reached nobody, so it may be sent again: the server may be about to join.
            Err(Unanswered::NoServer) if start.elapsed() < timeout => {
                std::thread::sleep(Duration::from_millis(5));
            }
            outcome => return outcome,
        }
    }
}

fn await_answer<Q: Payload, A: Payload>(
    client: &Client<ipc::Service, Q, (), A, ()>,
    request: Q,
    start: Instant,
    timeout: Duration,
) -> Result<A, Unanswered> {
    let pending =
        client.send_copy(request).map_err(|error| Unanswered::Transport { cause: Box::new(error) })?;
    if pending.number_of_server_connections() == 0 {
        return Err(Unanswered::NoServer);
    }
    loop {
        // Asked before receiving: an answer sent just before the server let go must not be missed.
        let is_connected = pending.is_connected();
        match pending.receive() {
            Ok(Some(answer)) => return Ok(*answer),
            Ok(None) => (),
            Err(error) => return Err(Unanswered::Transport { cause: Box::new(error) }),
        }
        if !is_connected || start.elapsed() >= timeout {
            return Err(Unanswered::NoAnswer { timeout });
        }
        std::thread::sleep(Duration::from_micros(500));
    }
}
