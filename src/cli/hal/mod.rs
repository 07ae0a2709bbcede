//! `magsteer hal`: what the author of a driver needs.

mod bindings;
mod conformance;
mod describe;

use std::path::Path;

use anyhow::anyhow;
use clap::{Args, Subcommand};

use self::bindings::Bindings;
use self::conformance::Conformance;
use self::describe::Describe;
use super::exit::{Exit, Failure};

/// Tools for whoever writes a driver: check a running one, describe a rig to one.
#[derive(Debug, Args)]
pub struct Hal {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Conformance(Conformance),
    Describe(Describe),
    Bindings(Bindings),
}

impl Hal {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.command {
            Command::Conformance(command) => command.run(),
            Command::Describe(command) => command.run(),
            Command::Bindings(command) => command.run(),
        }
    }
}

/// A file or folder that cannot be made, with its exit code.
fn cannot_create(path: &Path, error: &std::io::Error) -> anyhow::Error {
    Failure::with(Exit::CannotCreate, anyhow!("{}: cannot be created: {error}", path.display()))
}
