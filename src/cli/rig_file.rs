//! Which configuration a command means, and where its rig's channels are.

use std::path::{Path, PathBuf};

use clap::Args;
use magsteer::config::{Config, Document};
use magsteer_hal::channels::{ChannelError, Endpoint};

use super::exit::{Exit, Failure};
use super::shipped;

/// Where the channels are.
#[derive(Debug, Args)]
pub struct RootArgs {
    /// Directory under which a rig's processes meet; $MAGSTEER_ROOT or /dev/shm/magsteer-UID when left out.
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
}

impl RootArgs {
    /// The channels of a rig.
    pub fn endpoint(&self, rig: &str) -> anyhow::Result<Endpoint> {
        Endpoint::new(rig, self.root.as_deref()).map_err(channel_failure)
    }
}

/// Which rig a running daemon steers.
#[derive(Debug, Args)]
pub struct RigArgs {
    /// Configuration of the rig; config/bigmag-planar.toml when left out, or the copy of it in this program.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Name of the rig, in place of that in the configuration.
    #[arg(long, value_name = "NAME")]
    rig: Option<String>,
    #[command(flatten)]
    root: RootArgs,
}

impl RigArgs {
    /// The configuration, from `file` where a command takes one as an argument.
    pub fn load(&self, file: Option<&Path>) -> anyhow::Result<Config> {
        Ok(self.document(file)?.1)
    }

    /// The same, with the document that it was read from.
    pub fn document(&self, file: Option<&Path>) -> anyhow::Result<(Document, Config)> {
        let document = shipped::config(file.or(self.config.as_deref()))?;
        let config = Config::from_document(&document)?;
        Ok((document, config))
    }

    /// The channels; reads no file when the rig is named.
    pub fn endpoint(&self, file: Option<&Path>) -> anyhow::Result<Endpoint> {
        match &self.rig {
            Some(rig) => self.root.endpoint(rig),
            None => self.root.endpoint(&self.load(file)?.description.rig),
        }
    }
}

/// From here on this process makes files for its user alone: recordings, and whatever the transport keeps.
pub fn keep_files_private() {
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
}

/// A channel that could not be opened, with its exit code.
pub fn channel_failure(error: ChannelError) -> anyhow::Error {
    let exit = match &error {
        ChannelError::RigName { .. } | ChannelError::RootTooLong { .. } => Exit::Usage,
        ChannelError::Root { source, .. } if source.kind() == std::io::ErrorKind::PermissionDenied => {
            Exit::NoPermission
        }
        ChannelError::Root { .. } => Exit::CannotCreate,
        ChannelError::Held { .. }
        | ChannelError::Rival { .. }
        | ChannelError::Missing { .. }
        | ChannelError::Settings { .. } => Exit::Unavailable,
        ChannelError::Transport { .. } => Exit::Io,
    };
    // Its text holds that of its causes already.
    Failure::with(exit, anyhow::anyhow!("{error}"))
}
