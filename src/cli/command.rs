//! The list of subcommands.

use clap::{Parser, Subcommand};

use super::check::Check;
use super::exit::Exit;
use super::field::Field;
use super::output;
use super::shape::Shape;

/// Steers soft continuum manipulators carrying permanent magnets with an array of mobile electromagnets.
#[derive(Debug, Parser)]
#[command(
    version,
    propagate_version = true,
    after_help = "Research software, not a medical device.\n\n\
    Exit codes: 0 done; 1 the answer is no; 2 usage; 65 data refused; 66 no such input; 69 daemon or driver not there;\n\
    70 a mistake in this program; 73 cannot create; 74 input or output failed; 77 no permission; 78 configuration refused;\n\
    130, 143 ramped down after SIGINT, SIGTERM."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// Every subcommand.
#[derive(Debug, Subcommand)]
pub enum Command {
    Check(Check),
    Field(Field),
    Shape(Shape),
}

impl Command {
    fn run(&self) -> anyhow::Result<Exit> {
        match self {
            Self::Check(command) => command.run(),
            Self::Field(command) => command.run(),
            Self::Shape(command) => command.run(),
        }
    }
}

/// Parses the command line and runs the subcommand. A wrong command line ends the process with code 2.
pub fn run() -> Exit {
    match Cli::parse().command.run() {
        Ok(exit) => exit,
        Err(error) => {
            output::error(format_args!("{error:#}"));
            Exit::of(&error)
        }
    }
}
