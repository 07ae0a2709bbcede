//! A root directory that one process owns, for a rig that nobody else is to meet: demonstrations and tests.
//!
//! What the transport keeps is spread over two places: files under the root, and segments flat in `/dev/shm`, kept apart by
//! a prefix that is derived from the root's path. Participants that end take their own segments along, but for a few that
//! belong to all; participants that are killed leave theirs. Both go when the root's owner ends. An owner that is killed
//! leaves everything; the next owner of the same kind takes it away.

use std::fs::{DirBuilder, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use super::endpoint::{Endpoint, prefix};
use super::error::ChannelError;
use super::membership::{SEGMENTS, remove_all};

/// Locked by the owner as long as it lives.
const OWNER_LOCK: &str = "owner.lock";
/// Names to try: each fails only when another owner took it, or swept it away before it was locked.
const ATTEMPTS_MAX: u32 = 100;

/// A fresh root directory for this user alone, removed when dropped, with every segment of its participants.
///
/// Drop it only when all participants under it have ended: what still runs there loses its channels.
#[derive(Debug)]
pub struct PrivateRoot {
    path: PathBuf,
    _owned: File,
}

impl PrivateRoot {
    /// Makes `/dev/shm/HINT-PID-N`; before that, removes roots of the same hint and user whose owners and participants
    /// are dead.
    ///
    /// # Errors
    /// When `hint` is no short plain name, or the directory cannot be made.
    pub fn create(hint: &str) -> Result<Self, ChannelError> {
        let plain = |letter: char| letter.is_ascii_alphanumeric() || letter == '-';
        if hint.is_empty() || hint.len() > 30 || !hint.chars().all(plain) {
            let source = io::Error::from(io::ErrorKind::InvalidFilename);
            return Err(ChannelError::Root { path: PathBuf::from(hint), source });
        }
        remove_abandoned(hint);
        let mut last = None;
        for number in 0..ATTEMPTS_MAX {
            let path = Path::new(SEGMENTS).join(format!("{hint}-{}-{number}", std::process::id()));
            match owned(&path) {
                Ok(owned) => return Ok(Self { path, _owned: owned }),
                // Anything but a name that is taken or was swept away stays wrong.
                Err(source) if is_contended(&source) => last = Some(ChannelError::Root { path, source }),
                Err(source) => return Err(ChannelError::Root { path, source }),
            }
        }
        Err(last.expect("at least one attempt"))
    }

    /// The directory, absolute.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The channels of `rig` under this root.
    ///
    /// # Errors
    /// As [`Endpoint::new`].
    pub fn endpoint(&self, rig: &str) -> Result<Endpoint, ChannelError> {
        Endpoint::new(rig, Some(&self.path))
    }
}

impl Drop for PrivateRoot {
    fn drop(&mut self) {
        remove(&self.path);
    }
}

/// Makes the directory and locks it for this process.
fn owned(path: &Path) -> io::Result<File> {
    DirBuilder::new().mode(0o700).create(path)?;
    let lock = path.join(OWNER_LOCK);
    let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&lock)?;
    file.try_lock()?;
    // A sweeper may have come between making and locking; then this file is no longer the one under that name.
    if lock.metadata()?.ino() == file.metadata()?.ino() {
        return Ok(file);
    }
    Err(io::Error::from(io::ErrorKind::NotFound))
}

fn is_contended(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::NotFound | io::ErrorKind::WouldBlock)
}

/// Removes what killed owners left, and says what. What cannot be looked at or removed is somebody else's,
/// and stays.
pub(super) fn remove_abandoned(hint: &str) -> Vec<PathBuf> {
    let mut removed = Vec::new();
    for path in own_roots(hint) {
        if let Some(_locks) = abandoned(&path) {
            remove(&path);
            removed.push(path);
        }
    }
    removed
}

/// Roots of killed owners.
pub(super) fn abandoned_roots(hint: &str) -> Vec<PathBuf> {
    own_roots(hint).into_iter().filter(|path| abandoned(path).is_some()).collect()
}

/// Roots of this hint and user, in order.
fn own_roots(hint: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(SEGMENTS) else { return Vec::new() };
    let mut found = Vec::new();
    for entry in entries.flatten() {
        let name = entry.file_name();
        let of_this_kind = name
            .to_str()
            .and_then(|name| name.strip_prefix(hint)?.strip_prefix('-')?.split_once('-'))
            .is_some_and(|(pid, number)| pid.parse::<u32>().is_ok() && number.parse::<u32>().is_ok());
        let own = entry
            .metadata()
            .is_ok_and(|found| found.is_dir() && found.uid() == rustix::process::getuid().as_raw());
        if of_this_kind && own {
            found.push(entry.path());
        }
    }
    found.sort();
    found
}

/// Takes every lock under a root: its owner's and its participants'. `None` while one of them lives.
fn abandoned(root: &Path) -> Option<Vec<File>> {
    let taken = |path: &Path| {
        let file = OpenOptions::new().write(true).open(path).ok()?;
        file.try_lock().ok()?;
        Some(file)
    };
    // Without it the root is just being made.
    let mut locks = vec![taken(&root.join(OWNER_LOCK))?];
    for entry in std::fs::read_dir(root).ok()?.flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|extension| extension == "lock") && entry.file_name() != OWNER_LOCK {
            locks.push(taken(&path)?);
        }
    }
    Some(locks)
}

/// Removes a root and its segments, and no other root's. What cannot be removed is left: nobody could mend it here.
fn remove(root: &Path) {
    // Segments first: while the directory stands nobody can own a root of the same name, and so of the same prefix.
    let _ = remove_all(Path::new(SEGMENTS), &prefix(root));
    let _ = std::fs::remove_dir_all(root);
}

#[cfg(test)]
mod tests {
    use std::fs::{File, OpenOptions};
    use std::path::{Path, PathBuf};

    use super::{OWNER_LOCK, PrivateRoot, prefix};
    use crate::channels::DriverEnd;

    /// Segments of a root.
    fn segments(root: &Path) -> Vec<PathBuf> {
        let prefix = prefix(root);
        let entries = std::fs::read_dir("/dev/shm").expect("shared memory is there");
        let paths = entries.flatten().map(|entry| entry.path());
        paths.filter(|path| path.to_str().is_some_and(|path| path.contains(&prefix))).collect()
    }

    #[test]
    fn dropped_root_leaves_neither_directory_nor_segments_and_touches_no_other_root() {
        let (kept, gone) =
            (PrivateRoot::create("mst").expect("made"), PrivateRoot::create("mst").expect("made"));
        let other = DriverEnd::create(&kept.endpoint("rig").expect("a name")).expect("a driver");
        drop(DriverEnd::create(&gone.endpoint("rig").expect("a name")).expect("a driver"));
        let path = gone.path().to_owned();
        // As one that was killed leaves it.
        let left = PathBuf::from(format!("/dev/shm/{}left.data", prefix(&path)));
        File::create(&left).expect("made");
        drop(gone);
        assert!(!path.exists());
        assert_eq!(segments(&path), Vec::<PathBuf>::new());
        assert!(kept.path().is_dir());
        assert!(!segments(kept.path()).is_empty(), "a living driver has segments");
        drop(other);
    }

    #[test]
    fn root_of_a_dead_owner_is_swept_once_its_participants_are_dead_too() {
        let dead = Path::new("/dev/shm").join(format!("mstdead-{}-999", std::process::id()));
        std::fs::create_dir(&dead).expect("made");
        for name in [OWNER_LOCK, "rig.daemon.lock"] {
            File::create(dead.join(name)).expect("made");
        }
        let participant = OpenOptions::new().write(true).open(dead.join("rig.daemon.lock")).expect("there");
        participant.try_lock().expect("free");
        let first = PrivateRoot::create("mstdead").expect("made");
        assert!(dead.is_dir(), "its participant lives");
        drop(participant);
        let second = PrivateRoot::create("mstdead").expect("made");
        assert!(!dead.exists());
        assert!(first.path().is_dir() && second.path().is_dir() && first.path() != second.path());
    }

    #[test]
    fn hints_that_are_no_plain_names_are_refused() {
        for hint in ["", "a/b", "..", "ä", &"x".repeat(31)] {
            PrivateRoot::create(hint).expect_err(hint);
        }
    }
}
