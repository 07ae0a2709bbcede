//! Bringing a daemon that has just started to where it steers.

use std::time::{Duration, Instant};

use anyhow::anyhow;
use magsteer_hal::Stamp;
use magsteer_hal::operator::{OperatorRequest, StatusMessage, state, verb};

use super::session::{POLL, Session, describe};
use crate::cli::exit::{Exit, Failure};

impl Session {
    /// Asks for `verb`.
    ///
    /// # Errors
    /// When the daemon does not answer, or refuses: the message carries its reason.
    pub fn request(&mut self, verb: u32, name: &str) -> anyhow::Result<()> {
        self.send(OperatorRequest { verb, ..OperatorRequest::default() }, name)
    }

    /// Arms, again and again for up to `wait`: a rig that has just started may not have seen its first poses yet.
    ///
    /// # Errors
    /// The last refusal.
    pub fn arm(&mut self, wait: Duration) -> anyhow::Result<()> {
        let deadline = Instant::now() + wait;
        loop {
            match self.request(verb::ARM, "arm") {
                Err(_) if Instant::now() < deadline => std::thread::sleep(10 * POLL),
                outcome => return outcome,
            }
        }
    }

    /// Waits until the daemon is in one of `states`.
    ///
    /// # Errors
    /// When it is not within `wait`.
    pub fn wait_for(&mut self, states: &[u32], wait: Duration) -> anyhow::Result<StatusMessage> {
        let deadline = Instant::now() + wait;
        let mut last = None;
        while Instant::now() < deadline {
            last = self.client.newest_status(Stamp::now());
            if let Some(status) = last.filter(|status| states.contains(&status.state)) {
                return Ok(status);
            }
            std::thread::sleep(POLL);
        }
        let wanted: Vec<&str> = states.iter().map(|state| state::name(*state)).collect();
        let found = last.map_or("silent".to_owned(), |status| describe(&status));
        Err(Failure::with(
            Exit::Unavailable,
            anyhow!(
                "the daemon is {found}; expected {} within {} s",
                wanted.join(" or "),
                wait.as_secs_f64()
            ),
        ))
    }
}
