//! Exit codes: sysexits, so that a script can tell a refused file from a missing one.

use std::fmt::{self, Display, Formatter};
use std::process::ExitCode;

use magsteer::config::Problems;

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Done; the answer is yes.
    Success = 0,
    /// Done; the answer is no: not settled, not converged, not valid.
    No = 1,
    /// The command line is wrong.
    Usage = 2,
    /// A data file (experiment, measurement, recording) is refused.
    Data = 65,
    /// A file that was named cannot be read, nor one that it extends.
    NoInput = 66,
    /// The daemon or the driver is not there.
    Unavailable = 69,
    /// A mistake in this program.
    Software = 70,
    /// A file cannot be created.
    CannotCreate = 73,
    /// Reading or writing failed.
    Io = 74,
    /// A right is missing, as for real-time scheduling.
    NoPermission = 77,
    /// A configuration is refused.
    Config = 78,
    /// Ramped down after SIGINT.
    Interrupted = 130,
    /// Ramped down after SIGTERM.
    Terminated = 143,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

impl Exit {
    /// The code for an error that no command dealt with.
    pub fn of(error: &anyhow::Error) -> Self {
        if let Some(failure) = error.downcast_ref::<Failure>() {
            failure.exit
        } else if let Some(problems) = error.downcast_ref::<Problems>() {
            Self::of_problems(problems)
        } else if error.downcast_ref::<std::io::Error>().is_some() {
            Self::Io
        } else {
            Self::Software
        }
    }

    /// The code for a refused configuration.
    pub fn of_problems(problems: &Problems) -> Self {
        if problems.unreadable() { Self::NoInput } else { Self::Config }
    }
}

/// An error whose exit code is known.
#[derive(Debug)]
pub struct Failure {
    exit: Exit,
    source: anyhow::Error,
}

impl Failure {
    /// Ends the command with `exit`.
    pub fn with(exit: Exit, source: impl Into<anyhow::Error>) -> anyhow::Error {
        Self { exit, source: source.into() }.into()
    }

    /// What is wrong with a file, when that is the error.
    pub fn problems(error: &anyhow::Error) -> Option<&Problems> {
        let cause = error.downcast_ref::<Self>().map_or(error, |failure| &failure.source);
        cause.downcast_ref::<Problems>()
    }

    /// Ends the command because a data file, not a configuration, is refused or cannot be read.
    pub fn data(problems: Problems) -> anyhow::Error {
        let exit = if problems.unreadable() { Exit::NoInput } else { Exit::Data };
        Self::with(exit, problems)
    }

    /// Ends the command because its arguments do not fit together.
    pub fn usage(message: impl Display) -> anyhow::Error {
        Self::with(Exit::Usage, anyhow::anyhow!("{message}"))
    }
}

/// A file or folder that cannot be made, with its exit code.
pub fn cannot_create(path: &std::path::Path, error: &std::io::Error) -> anyhow::Error {
    Failure::with(Exit::CannotCreate, anyhow::anyhow!("{}: cannot be created: {error}", path.display()))
}

impl std::error::Error for Failure {}

impl Display for Failure {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        // The alternate form adds the chain of causes.
        write!(formatter, "{:#}", self.source)
    }
}
