//! The subcommands, and what they share.

use std::time::{Duration, Instant};

use clap::{Args, Subcommand};
use magsteer::control::Directions;
use magsteer_hal::Stamp;
use magsteer_hal::channels::OperatorClient;
use magsteer_hal::operator::StatusMessage;

#[cfg(feature = "joystick")]
use super::joystick::Joystick;
use super::play::Play;
use super::set::Set;
use super::stream::Stream;
use crate::cli::exit::{Exit, Failure};

/// How long to wait for a status of a daemon that is there.
pub(super) const STATUS_WAIT: Duration = Duration::from_millis(1_500);

/// Where the magnets are to point.
#[derive(Debug, Args)]
pub struct Target {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Set(Set),
    Play(Play),
    Stream(Stream),
    #[cfg(feature = "joystick")]
    Joystick(Joystick),
}

impl Target {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.action {
            Action::Set(set) => set.run(),
            Action::Play(play) => play.run(),
            Action::Stream(stream) => stream.run(),
            #[cfg(feature = "joystick")]
            Action::Joystick(joystick) => joystick.run(),
        }
    }
}

/// The target as set, or where none was set the measured tangents.
pub(super) fn present_target(status: &StatusMessage) -> Directions {
    let is_set = status.target_direction[0] != [0.0; 3];
    if is_set { status.target_direction } else { status.measured_direction }
}

/// The daemon's next status.
pub fn await_status(client: &mut OperatorClient) -> anyhow::Result<StatusMessage> {
    let begin = Instant::now();
    loop {
        if let Some(status) = client.newest_status(Stamp::now()) {
            return Ok(status);
        }
        if begin.elapsed() > STATUS_WAIT {
            let message = anyhow::anyhow!("no daemon publishes its status on this rig");
            return Err(Failure::with(Exit::Unavailable, message));
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
