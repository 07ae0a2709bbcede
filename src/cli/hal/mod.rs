//! `magsteer hal`: what the author of a driver needs.

mod bindings;
mod conformance;
mod describe;
mod new;
mod udp_driver;

use clap::{Args, Subcommand};

use self::bindings::{Bindings, Messages};
use self::conformance::Conformance;
use self::describe::Describe;
use self::new::New;
use self::udp_driver::UdpDriver;
use super::exit::Exit;

/// Tools for whoever writes a driver: a template, a rig's numbers, the check of a running one.
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
    Messages(Messages),
    New(New),
    UdpDriver(UdpDriver),
}

impl Hal {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.command {
            Command::Conformance(command) => command.run(),
            Command::Describe(command) => command.run(),
            Command::Bindings(command) => command.run(),
            Command::Messages(command) => command.run(),
            Command::New(command) => command.run(),
            Command::UdpDriver(command) => command.run(),
        }
    }
}
