//! A viewer: attached to one rig's status and journal, whatever the daemon does.
//!
//! The caller looks some twenty times a second, and draws what [`Viewer::figures`] says. Nothing here waits
//! for the daemon, but [`Viewer::send`], which waits for an answer as every operator does.

use std::path::{Path, PathBuf};
use std::time::Duration;

use magsteer_hal::Stamp;
use magsteer_hal::channels::{ClientError, Endpoint, OperatorClient};
use magsteer_hal::operator::{OperatorAnswer, OperatorRequest, StatusMessage, verb};

use super::alert;
use super::events::EventFeed;
use super::figures::{Figures, is_of};
use super::history::History;
use super::link::{Lifeline, Link};
use super::rig::Rig;
use super::rod::{RodFigures, RodModel};
use crate::config::Config;
use crate::control::Directions;

/// Between two attempts to find a daemon, and how long a silent one is listened to before its channel is
/// opened anew.
const RETRY: Duration = Duration::from_secs(1);
const PATIENCE: Duration = Duration::from_secs(3);
/// Between two looks at the journal.
const JOURNAL_PERIOD: Duration = Duration::from_millis(250);
/// The daemon answers within 200 ms, or not at all; the rest is for a machine that stops processes.
const ANSWER_WAIT: Duration = Duration::from_millis(400);

/// Why a request was not sent. It counts as not done.
#[derive(Debug, thiserror::Error)]
pub enum Unsent {
    /// No daemon is there to ask.
    #[error("no daemon serves this rig")]
    NoDaemon,
    /// The angles do not fit the rig.
    #[error("a target needs {expected} finite angles for each of {magnets} magnets, within a turn")]
    Target {
        /// Angles of one magnet.
        expected: usize,
        /// Magnets of the rig.
        magnets: usize,
    },
    /// No answer, or the transport failed.
    #[error(transparent)]
    Client(#[from] ClientError),
}

/// Attached to one rig. Belongs to the thread that made it.
#[derive(Debug)]
pub struct Viewer {
    endpoint: Endpoint,
    rig: Rig,
    client: Option<OperatorClient>,
    next_try: Stamp,
    opened: Stamp,
    lifeline: Lifeline,
    newest: Option<StatusMessage>,
    history: History,
    rod: RodModel,
    events: Option<EventFeed>,
    next_journal: Stamp,
}

impl Viewer {
    /// A viewer of the rig of `config` whose channels are at `endpoint`; `journal`: the folder of its
    /// journal, in place of the configuration's.
    #[must_use]
    pub fn new(endpoint: Endpoint, config: &Config, journal: Option<PathBuf>) -> Self {
        let rig = Rig::new(config);
        let folder = journal.or_else(|| rig.journal.clone());
        let events = folder.as_deref().map(|folder: &Path| EventFeed::new(&rig.name, folder));
        Self {
            endpoint,
            client: None,
            next_try: Stamp::default(),
            opened: Stamp::default(),
            lifeline: Lifeline::new(rig.status_rate_hz),
            newest: None,
            history: History::new(),
            rod: RodModel::new(config),
            events,
            next_journal: Stamp::default(),
            rig,
        }
    }

    /// Takes over what came since the last look; finds the daemon when there is none, or a silent one.
    pub fn look(&mut self, now: Stamp) {
        let quiet = self.lifeline.age(now).is_none_or(|age| age > PATIENCE);
        if quiet && self.client.is_some() && now.since(self.opened) > PATIENCE {
            // A daemon that was started anew may have made its channels anew.
            self.client = None;
        }
        if self.client.is_none() && now >= self.next_try {
            self.next_try = now.after(RETRY);
            self.client = OperatorClient::open(&self.endpoint, Duration::ZERO).ok();
            self.opened = now;
        }
        let Self { client, rig, lifeline, newest, history, .. } = self;
        if let Some(client) = client {
            client.drain_status(now, |status| {
                lifeline.heard(&status.header);
                history.take(rig, status);
                *newest = Some(*status);
            });
        }
        if now >= self.next_journal {
            self.next_journal = now.after(JOURNAL_PERIOD);
            self.events.iter_mut().for_each(EventFeed::look);
        }
    }

    /// How the viewer stands to the daemon.
    #[must_use]
    pub fn link(&self, now: Stamp) -> Link {
        self.lifeline.link(self.client.is_some(), now)
    }

    /// What there is to show; `with_rod`: solves for the rod's shape.
    pub fn figures(&mut self, now: Stamp, with_rod: bool) -> Figures {
        let link = self.link(now);
        let age_s = self.lifeline.age(now).map(|age| age.as_secs_f64());
        let rod = match self.newest.filter(|_| with_rod) {
            Some(status) => self.rod.draw(&status, is_of(&status, &self.rig)),
            None => RodFigures::default(),
        };
        let mut figures =
            Figures::new(&self.rig, self.newest.as_ref(), (link, age_s, self.lifeline.restarts()), rod);
        if self.client.as_ref().is_some_and(OperatorClient::is_distant) {
            figures.alerts.push(alert::of_distance());
        }
        figures
    }

    /// The status heard last; `None` before the first.
    #[must_use]
    pub const fn newest(&self) -> Option<&StatusMessage> {
        self.newest.as_ref()
    }

    /// Facts of the rig.
    #[must_use]
    pub const fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Samples of the last minute.
    #[must_use]
    pub const fn history(&self) -> &History {
        &self.history
    }

    /// The journal; `None` for a daemon without.
    #[must_use]
    pub const fn events(&self) -> Option<&EventFeed> {
        self.events.as_ref()
    }

    /// Sends a request without content, one of [`verb`], and waits for its answer.
    ///
    /// # Errors
    /// When no daemon answers; it must be taken as not done.
    pub fn send(&mut self, verb: u32) -> Result<OperatorAnswer, Unsent> {
        self.send_request(OperatorRequest { verb, ..OperatorRequest::default() })
    }

    /// Sets the target: the angles of every magnet, base to tip, as the rig's directions are told.
    ///
    /// # Errors
    /// When the angles do not fit the rig, or no daemon answers.
    pub fn set_target(&mut self, angles_deg: &[Vec<f64>]) -> Result<OperatorAnswer, Unsent> {
        let magnets = self.rig.magnets.len();
        let misfit = || Unsent::Target { expected: self.rig.angles.count(), magnets };
        if angles_deg.len() != magnets {
            return Err(misfit());
        }
        let mut direction = Directions::default();
        for (direction, angles) in direction.iter_mut().zip(angles_deg) {
            *direction = self.rig.direction(angles).ok_or_else(misfit)?;
        }
        let magnet_count = u32::try_from(magnets).unwrap_or(u32::MAX);
        self.send_request(OperatorRequest {
            verb: verb::SET_TARGET,
            magnet_count,
            direction,
            ..OperatorRequest::default()
        })
    }

    fn send_request(&mut self, request: OperatorRequest) -> Result<OperatorAnswer, Unsent> {
        if self.client.is_none() {
            // A stop must not wait for the next attempt.
            self.client = OperatorClient::open(&self.endpoint, Duration::ZERO).ok();
            self.opened = Stamp::now();
        }
        let client = self.client.as_mut().ok_or(Unsent::NoDaemon)?;
        Ok(client.send(request, ANSWER_WAIT)?)
    }
}
