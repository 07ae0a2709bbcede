//! The last check before current flows.

use std::time::Duration;

use crate::message::Actuation;
use crate::time::Stamp;

/// Who commands, and for how long each command stays good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Authority {
    /// Rises with every claim on this host.
    pub epoch: u64,
    /// Names the holder within the epoch.
    pub token: u64,
    /// A command is void this long after it was sent.
    pub validity: Duration,
}

/// A command that passed the gate: the only thing that [`crate::Hardware::write`] accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdmittedCommand {
    pub(crate) order: u32,
    pub(crate) authority: Authority,
    pub(crate) pose_source_stamp: Stamp,
    pub(crate) actuation: Actuation,
}
