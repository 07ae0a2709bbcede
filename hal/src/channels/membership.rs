//! A process's membership in the transport, with a sweeper against one fault of it.
//!
//! A shared-memory segment becomes readable once its maker has finished it. The maker can be killed before: the segment
//! then stays half-made for ever, belongs to no node that could be cleared up, and whoever opens it waits without end,
//! a control loop included. So every member sweeps: a thread of its own takes half-made segments of this root away
//! once they are older than any living maker needs, which also frees those who already wait.
//!
//! A member also closes what the transport leaves open to other users.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};
use std::{fs, io};

use std::os::unix::fs::{MetadataExt, PermissionsExt};

use iceoryx2::prelude::{Node, ipc};

use super::endpoint::denied;
use super::error::ChannelError;

/// Where the system keeps shared-memory segments; fixed.
pub(super) const SEGMENTS: &str = "/dev/shm";
/// Age from which a half-made segment counts as abandoned. Making one takes microseconds.
pub(super) const ABANDONED_AGE: Duration = Duration::from_secs(1);
const SWEEP_PERIOD: Duration = Duration::from_millis(500);

/// A node and its sweeper, which ends with it.
#[derive(Debug)]
pub(super) struct Membership {
    pub(super) node: Node<ipc::Service>,
    pub(super) _sweeper: Sweeper,
}

/// Takes half-made segments away for as long as it lives.
#[derive(Debug)]
pub(super) struct Sweeper {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Sweeper {
    /// Sweeps segments whose names start with `prefix`.
    pub(super) fn start(prefix: String) -> io::Result<Self> {
        let (stop, stopped) = mpsc::channel::<()>();
        let sweep_until_stopped = move || {
            while let Err(RecvTimeoutError::Timeout) = stopped.recv_timeout(SWEEP_PERIOD) {
                // What cannot be listed now may be the next time.
                let _ = sweep(Path::new(SEGMENTS), &prefix, ABANDONED_AGE);
            }
        };
        let thread = thread::Builder::new().name("magsteer-sweep".to_owned()).spawn(sweep_until_stopped)?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Sweeper {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take() {
            // A sweeper that panicked has nothing left to do.
            let _ = thread.join();
        }
    }
}

/// Removes files in `directory` that start with `prefix`, are not yet readable by their owner and at least `age` old.
pub(super) fn sweep(directory: &Path, prefix: &str, age: Duration) -> io::Result<()> {
    const OWNER_READS: u32 = 0o400;
    for entry in fs::read_dir(directory)?.flatten() {
        if !entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            continue;
        }
        // Gone or finished in the meantime: nothing to sweep.
        let Ok(metadata) = entry.metadata() else { continue };
        let made = metadata.modified().unwrap_or_else(|_| SystemTime::now());
        let is_old = SystemTime::now().duration_since(made).is_ok_and(|since| since >= age);
        if metadata.is_file() && metadata.permissions().mode() & OWNER_READS == 0 && is_old {
            // What cannot be removed now may be the next time.
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}

/// Closes the segments whose names start with `prefix` to everybody but their owner, who must be this user.
///
/// The transport opens one of them to all users: the count of nodes, from which the names of nodes are made. It is closed
/// within microseconds of being made, and holds nothing else. Segments in `/dev/shm` can be made under any name by anybody:
/// one that somebody else prepared is refused.
pub(super) fn seal(prefix: &str) -> Result<(), ChannelError> {
    let refused = |path: &Path, source| ChannelError::Root { path: path.to_owned(), source };
    let directory = Path::new(SEGMENTS);
    for entry in fs::read_dir(directory).map_err(|error| refused(directory, error))?.flatten() {
        if !entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            continue;
        }
        match sealed(&entry.path()) {
            Ok(None) => (),
            Ok(Some(owner)) => {
                let why = format!("belongs to user {owner}: somebody else made this segment; remove it");
                return Err(denied(entry.path(), &why));
            }
            // Its maker took it away meanwhile.
            Err(error) if error.kind() == io::ErrorKind::NotFound => (),
            Err(error) => return Err(refused(&entry.path(), error)),
        }
    }
    Ok(())
}

/// Closes one file of this user; otherwise says whose it is.
fn sealed(path: &PathBuf) -> io::Result<Option<u32>> {
    const OTHERS: u32 = 0o077;
    let found = fs::symlink_metadata(path)?;
    if found.uid() != rustix::process::getuid().as_raw() {
        return Ok(Some(found.uid()));
    }
    let mode = found.permissions().mode();
    if mode & OTHERS != 0 {
        fs::set_permissions(path, fs::Permissions::from_mode(mode & 0o7777 & !OTHERS))?;
    }
    Ok(None)
}

/// Removes every file in `directory` that starts with `prefix`.
pub(super) fn remove_all(directory: &Path, prefix: &str) -> io::Result<()> {
    for entry in fs::read_dir(directory)?.flatten() {
        if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            // One that cannot be removed stays: it is gone already, or somebody else's.
            let _ = fs::remove_file(entry.path());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;
    use std::path::Path;
    use std::time::Duration;

    use super::{seal, sealed, sweep};

    /// Proves SR-16.
    #[test]
    fn segment_that_is_open_to_others_is_closed_and_somebody_elses_is_refused() {
        let prefix = format!("mstseal-{}_", std::process::id());
        let path = Path::new("/dev/shm").join(format!("{prefix}count"));
        fs::write(&path, "").expect("written");
        fs::set_permissions(&path, Permissions::from_mode(0o666)).expect("own file");
        seal(&prefix).expect("own segment");
        assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o7777, 0o600);
        if rustix::process::getuid().is_root() {
            std::os::unix::fs::chown(&path, Some(65_534), None).expect("root may");
            let refused = seal(&prefix).expect_err("somebody else's").to_string();
            assert!(refused.contains("belongs to user 65534"), "{refused}");
        } else {
            println!("another owner was not tried: that takes root");
        }
        fs::remove_file(&path).expect("there");
        assert!(sealed(&path).is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound));
    }

    fn file(directory: &Path, name: &str, mode: u32) {
        let path = directory.join(name);
        fs::write(&path, "").expect("written");
        fs::set_permissions(&path, Permissions::from_mode(mode)).expect("set");
    }

    fn names(directory: &Path) -> Vec<String> {
        let entries = fs::read_dir(directory).expect("listed");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("read").file_name().into_string().expect("text")).collect();
        names.sort();
        names
    }

    #[test]
    fn sweep_takes_half_made_segments_of_its_own_root_alone() {
        let directory = tempfile::tempdir().expect("a directory");
        file(directory.path(), "mine_half", 0o200);
        file(directory.path(), "mine_whole", 0o600);
        file(directory.path(), "other_half", 0o200);
        sweep(directory.path(), "mine_", Duration::from_secs(3600)).expect("swept");
        assert_eq!(names(directory.path()), ["mine_half", "mine_whole", "other_half"], "still young");
        sweep(directory.path(), "mine_", Duration::ZERO).expect("swept");
        assert_eq!(names(directory.path()), ["mine_whole", "other_half"]);
    }
}
