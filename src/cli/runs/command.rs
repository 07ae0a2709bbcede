//! The subcommands of `runs`.

use clap::{Args, Subcommand};
use magsteer::daemon::recorder::FlightError;
use magsteer_hal::operator::verb;

#[cfg(feature = "record")]
use super::export::{Export, Recover};
use super::list::List;
use super::show::Show;
use crate::cli::exit::{Exit, Failure};
use crate::cli::operator::RequestArgs;

/// Look at runs: recordings of every cycle, and flights, the last seconds before a trip.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer runs list\n  magsteer runs show runs/daemon/20261122-091419-bigmag-planar-safe-stop-200.flight\n  \
    magsteer runs save"
)]
pub struct Runs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    List(List),
    Show(Show),
    #[cfg(feature = "record")]
    Export(Export),
    #[cfg(feature = "record")]
    Recover(Recover),
    /// Have the daemon write its last seconds now; it goes on meanwhile.
    Save(RequestArgs),
}

impl Runs {
    pub fn run(&self) -> anyhow::Result<Exit> {
        match &self.action {
            Action::List(list) => list.run(),
            Action::Show(show) => show.run(),
            #[cfg(feature = "record")]
            Action::Export(export) => export.run(),
            #[cfg(feature = "record")]
            Action::Recover(recover) => recover.run(),
            Action::Save(request) => request.run(verb::SAVE),
        }
    }
}

/// A file that is no flight, or cannot be read, with its exit code.
pub fn refused(error: FlightError) -> anyhow::Error {
    let exit = match &error {
        FlightError::Open { .. } => Exit::NoInput,
        FlightError::Read { .. } => Exit::Io,
        FlightError::NotAFlight { .. } | FlightError::Version { .. } | FlightError::Header { .. } => {
            Exit::Data
        }
    };
    // Its text holds that of its cause already.
    Failure::with(exit, anyhow::anyhow!("{error}"))
}
