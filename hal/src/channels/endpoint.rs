//! Where a rig's channels live: the rig's name and the root directory that all its participants share.
//!
//! Who may read and command is decided here, by the user: the root is a directory of mode 0700 that belongs to this process's
//! user, or it is refused. What the transport makes below it and in `/dev/shm` is for its owner alone, but for one segment
//! (the count of nodes), which it opens to everybody; that one is closed as soon as it is there. A segment of this root that
//! belongs to somebody else is refused too.

use std::fs::DirBuilder;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::prelude::{Config, FileName, NodeBuilder, SemanticString, SignalHandlingMode, ipc};
use sha2::{Digest, Sha256};

use super::error::ChannelError;
use super::membership::{Membership, SEGMENTS, Sweeper, seal};
use super::service::retried;
use crate::description::is_rig_name;

/// Environment variable that names the root directory when no argument does.
pub const ROOT_VARIABLE: &str = "MAGSTEER_ROOT";

/// The transport's sockets and file names leave this much for the root, bytes.
pub(crate) const ROOT_LENGTH_MAX: usize = 65;

/// The transport's version stands in every file name: two versions must never share a segment.
pub(crate) const TRANSPORT_VERSION: &str = "0100";

/// A rig and the root directory under which its channels meet.
///
/// All participants must run under one user and name one root: two roots are two separate worlds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Endpoint {
    rig: String,
    root: PathBuf,
}

impl Endpoint {
    /// The channels of `rig` under `root`; without one under `$MAGSTEER_ROOT`, else `/dev/shm/magsteer-UID`.
    /// Creates the directory, for this user alone, when it is missing.
    ///
    /// # Errors
    /// When the name is not a rig's, or the directory cannot be made, is too long, belongs to somebody else or is open
    /// to others.
    pub fn new(rig: &str, root: Option<&Path>) -> Result<Self, ChannelError> {
        if !is_rig_name(rig) {
            return Err(ChannelError::RigName { name: rig.to_owned() });
        }
        let named = root.map(Path::to_owned).or_else(|| {
            let value = std::env::var_os(ROOT_VARIABLE)?;
            (!value.is_empty()).then(|| PathBuf::from(value))
        });
        let root = match named {
            Some(root) => usable_directory(&root)?,
            None => {
                let root = default_root();
                let usable = usable_directory(&root)?;
                if usable != root {
                    let why = "is a link; name the directory itself in MAGSTEER_ROOT";
                    return Err(denied(root, why));
                }
                usable
            }
        };
        let length = root.as_os_str().len();
        if length > ROOT_LENGTH_MAX {
            return Err(ChannelError::RootTooLong { path: root, length, length_max: ROOT_LENGTH_MAX });
        }
        Ok(Self { rig: rig.to_owned(), root })
    }

    /// Name of the rig.
    #[must_use]
    pub fn rig(&self) -> &str {
        &self.rig
    }

    /// The root directory, absolute.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Full name of one of the rig's services.
    pub(super) fn service(&self, channel: &str) -> String {
        format!("magsteer/{}/{channel}", self.rig)
    }

    /// Joins the transport under this root. `connection_wait` is how long a port may wait for another process to
    /// finish making its half of a connection; zero where a control loop owns the ports.
    pub(super) fn join(&self, connection_wait: Duration) -> Result<Membership, ChannelError> {
        let config = self.config(connection_wait)?;
        let refused = |source| ChannelError::Root { path: self.root.clone(), source };
        let prefix = prefix(&self.root);
        seal(&prefix)?;
        let sweeper = Sweeper::start(prefix.clone()).map_err(refused)?;
        let node = retried("node", || {
            NodeBuilder::new()
                .signal_handling_mode(SignalHandlingMode::Disabled)
                .config(&config)
                .create::<ipc::Service>()
        })?;
        seal(&prefix)?;
        Ok(Membership { node, _sweeper: sweeper })
    }

    pub(super) fn config(&self, connection_wait: Duration) -> Result<Config, ChannelError> {
        let root_bytes = self.root.as_os_str().as_encoded_bytes();
        let unusable = |_| ChannelError::Root {
            path: self.root.clone(),
            source: io::Error::from(io::ErrorKind::InvalidFilename),
        };
        let mut config = Config::default();
        config.global.prefix = FileName::new(prefix(&self.root).as_bytes()).map_err(unusable)?;
        config.global.set_root_path(&iceoryx2::prelude::Path::new(root_bytes).map_err(unusable)?);
        config.global.creation_timeout = connection_wait;
        Ok(config)
    }
}

/// Start of the name of every segment under `root`. Segments lie flat in one directory: this keeps roots apart there.
pub(super) fn prefix(root: &Path) -> String {
    let digest = Sha256::digest(root.as_os_str().as_encoded_bytes());
    let [first, second, third, fourth] = [digest[0], digest[1], digest[2], digest[3]];
    format!("magsteer{TRANSPORT_VERSION}_{first:02x}{second:02x}{third:02x}{fourth:02x}_")
}

fn default_root() -> PathBuf {
    PathBuf::from(format!("{SEGMENTS}/magsteer-{}", rustix::process::getuid().as_raw()))
}

/// Makes the directory where it is missing, and refuses one that is not this user's alone.
fn usable_directory(root: &Path) -> Result<PathBuf, ChannelError> {
    /// Any access of the group and of others.
    const OTHERS: u32 = 0o077;
    let refused = |source| ChannelError::Root { path: root.to_owned(), source };
    DirBuilder::new().recursive(true).mode(0o700).create(root).map_err(refused)?;
    let absolute = root.canonicalize().map_err(refused)?;
    let found = absolute.metadata().map_err(refused)?;
    let (owner, own) = (found.uid(), rustix::process::getuid().as_raw());
    if owner != own {
        let why =
            format!("belongs to user {owner}, this is user {own}: all of a rig's processes run as one user");
        return Err(denied(absolute, &why));
    }
    let mode = found.permissions().mode() & 0o7777;
    if mode & OTHERS != 0 {
        let why =
            format!("is open to other users (mode {mode:03o}): chmod 700 it, or name another directory");
        return Err(denied(absolute, &why));
    }
    Ok(absolute)
}

/// A root or segment that must not be used, though it could be.
pub(super) fn denied(path: PathBuf, why: &str) -> ChannelError {
    ChannelError::Root { path, source: io::Error::new(io::ErrorKind::PermissionDenied, why) }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::{PermissionsExt, chown};
    use std::path::Path;

    use super::{ChannelError, Endpoint};

    /// Proves SR-16.
    #[test]
    fn root_that_others_may_enter_or_that_is_somebody_elses_is_refused_with_the_remedy() {
        let root = tempfile::tempdir().expect("a directory");
        for mode in [0o755, 0o770, 0o701, 0o777, 0o1777] {
            fs::set_permissions(root.path(), Permissions::from_mode(mode)).expect("own directory");
            let refused = Endpoint::new("rig", Some(root.path())).expect_err("open to others");
            assert!(refused.to_string().contains(&format!("(mode {mode:03o}): chmod 700")), "{refused}");
        }
        fs::set_permissions(root.path(), Permissions::from_mode(0o700)).expect("own directory");
        Endpoint::new("rig", Some(root.path())).expect("own and closed");
        if !rustix::process::getuid().is_root() {
            println!("another owner was not tried: that takes root");
            return;
        }
        chown(root.path(), Some(65_534), None).expect("root may");
        let refused = Endpoint::new("rig", Some(root.path())).expect_err("somebody else's");
        assert!(refused.to_string().contains("belongs to user 65534, this is user 0"), "{refused}");
        chown(root.path(), Some(0), None).expect("root may");
    }

    #[test]
    fn rig_names_outside_their_alphabet_are_refused() {
        let root = tempfile::tempdir().expect("a directory");
        for name in ["", "Big", "a b", "a/b", "ä", &"x".repeat(41)] {
            let refused = Endpoint::new(name, Some(root.path()));
            assert!(matches!(refused, Err(ChannelError::RigName { .. })), "{name:?}");
        }
    }

    #[test]
    fn missing_root_is_made_and_an_overlong_one_is_refused_with_its_length() {
        let root = tempfile::tempdir().expect("a directory");
        let endpoint = Endpoint::new("rig", Some(&root.path().join("a/b"))).expect("made");
        assert!(endpoint.root().is_dir());
        let refused = Endpoint::new("rig", Some(&root.path().join("x".repeat(70)))).expect_err("too long");
        assert!(refused.to_string().contains("must be at most 65"), "{refused}");
    }

    #[test]
    fn root_that_cannot_be_made_is_refused_with_its_path() {
        let refused =
            Endpoint::new("rig", Some(Path::new("/proc/magsteer"))).expect_err("no directory there");
        assert!(refused.to_string().starts_with("channel root /proc/magsteer: "), "{refused}");
    }
}
