//! What can go wrong with a rig's channels.

use std::error::Error;
use std::fmt::{self, Display};
use std::io;
use std::path::PathBuf;
use std::time::Duration;

/// A part that exists once for each rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Commands the coils.
    Daemon,
    /// Drives the coils.
    Driver,
    /// Answers operators, a part of the daemon.
    OperatorServer,
    /// Carries what the rig publishes from one machine to another.
    Tunnel,
}

impl Role {
    /// Every role.
    pub(super) const ALL: [Self; 4] = [Self::Daemon, Self::Driver, Self::OperatorServer, Self::Tunnel];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Daemon => "daemon",
            Self::Driver => "driver",
            Self::OperatorServer => "operator-server",
            Self::Tunnel => "tunnel",
        }
    }
}

impl Display for Role {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// Why an end of the channels could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ChannelError {
    /// The rig's name cannot be part of a channel's name.
    #[error("rig name {name:?}: must be 1 to 40 lower-case letters, digits and hyphens")]
    RigName {
        /// The name given.
        name: String,
    },
    /// The root directory is too long for the transport's file names.
    #[error("channel root {path}: {length} bytes long, must be at most {length_max}", path = path.display())]
    RootTooLong {
        /// The root.
        path: PathBuf,
        /// Its length.
        length: usize,
        /// Greatest length.
        length_max: usize,
    },
    /// The root directory cannot be used.
    #[error("channel root {path}: {source}", path = path.display())]
    Root {
        /// The root, or the file in it.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Another process has this role on this rig.
    #[error("rig {rig} already has a {role}: process {pid} (lock {path})", path = path.display())]
    Held {
        /// Name of the rig.
        rig: String,
        /// The role.
        role: Role,
        /// The holder, 0 when it did not say.
        pid: u32,
        /// The lock file.
        path: PathBuf,
    },
    /// The other side did not appear in time.
    #[error(
        "no {role} on rig {rig} within {waited_s:.1} s (channel root {root}): start it, with the same root",
        waited_s = waited.as_secs_f64(), root = root.display()
    )]
    Missing {
        /// Name of the rig.
        rig: String,
        /// Who is missing.
        role: Role,
        /// Where it was looked for.
        root: PathBuf,
        /// How long was waited.
        waited: Duration,
    },
    /// A process that holds no lock publishes where one alone may.
    #[error("service {service} already has a publisher: process {pid}")]
    Rival {
        /// The service.
        service: String,
        /// The process.
        pid: u32,
    },
    /// The service exists with settings that are not those of this build.
    #[error("service {service}: {setting} is {actual}, must be {expected}; was it made by another version?")]
    Settings {
        /// The service.
        service: String,
        /// The setting.
        setting: &'static str,
        /// As this build has it.
        expected: usize,
        /// As it is.
        actual: usize,
    },
    /// The transport failed.
    #[error("service {service}: {cause}")]
    Transport {
        /// The service or part of the transport.
        service: String,
        /// Its own error.
        #[source]
        cause: Box<dyn Error + Send + Sync>,
    },
}

/// Why a request got no answer. Without an answer it must be taken as not done.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// No daemon serves requests on this rig.
    #[error("no daemon answers requests on this rig")]
    NoDaemon,
    /// The daemon did not answer in time.
    #[error("no answer within {} ms", timeout.as_millis())]
    NoAnswer {
        /// How long was waited.
        timeout: Duration,
    },
    /// The transport failed.
    #[error("the request could not be sent: {cause}")]
    Transport {
        /// Its own error.
        #[source]
        cause: Box<dyn Error + Send + Sync>,
    },
}

/// Why a fault could not be asked for. Without an answer it must be taken as not done.
#[derive(Debug, thiserror::Error)]
pub enum FaultClientError {
    /// No driver runs on this rig.
    #[error("no driver on rig {rig} (channel root {root}): start it, with the same root", root = root.display())]
    NoDriver {
        /// Name of the rig.
        rig: String,
        /// Where it was looked for.
        root: PathBuf,
    },
    /// A driver runs, but was not started to allow faults.
    #[error("the driver of rig {rig} (process {pid}) does not allow faults: start it with --allow-faults")]
    NotAllowed {
        /// Name of the rig.
        rig: String,
        /// The driver.
        pid: u32,
    },
    /// The driver did not answer in time.
    #[error("no answer within {} ms", timeout.as_millis())]
    NoAnswer {
        /// How long was waited.
        timeout: Duration,
    },
    /// The transport failed.
    #[error("the request could not be sent: {cause}")]
    Transport {
        /// Its own error.
        #[source]
        cause: Box<dyn Error + Send + Sync>,
    },
    /// This end of the channels could not be made.
    #[error(transparent)]
    Channel(#[from] ChannelError),
}
