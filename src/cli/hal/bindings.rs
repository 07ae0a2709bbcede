//! `magsteer hal bindings` and `magsteer hal messages`: the messages for another language, and for people.

use clap::Args;

use super::super::exit::Exit;
use super::super::output;

/// Print the messages, codes and service settings as a Python module of ctypes structures, for PyPI
/// `iceoryx2` 0.10.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer hal bindings > magsteer/messages.py")]
pub struct Bindings {}

impl Bindings {
    pub fn run(&self) -> anyhow::Result<Exit> {
        output::result(magsteer_hal::binding::python())?;
        Ok(Exit::Success)
    }
}

/// Print a reference of all messages, codes and services as Markdown.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer hal messages > hal/docs/messages.md")]
pub struct Messages {}

impl Messages {
    pub fn run(&self) -> anyhow::Result<Exit> {
        output::result(magsteer_hal::binding::reference())?;
        Ok(Exit::Success)
    }
}
