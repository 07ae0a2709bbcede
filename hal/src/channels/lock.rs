//! One holder a role and rig: an advisory lock on a file that the kernel drops when its holder dies, however it dies.
//!
//! The file itself stays; it names the last holder's process, for people.

use std::fs::{File, Metadata, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::Duration;

use super::error::{ChannelError, Role};

/// Attempts to take a role whose file is just being cleared away, and the pause between two.
const ATTEMPTS_MAX: u32 = 20;
const ATTEMPT_PAUSE: Duration = Duration::from_millis(5);

/// Held as long as it lives.
#[derive(Debug)]
pub(super) struct RoleLock {
    _file: File,
}

impl RoleLock {
    /// Takes the role, or says who has it.
    pub(super) fn acquire(root: &Path, rig: &str, role: Role) -> Result<Self, ChannelError> {
        let path = root.join(format!("{rig}.{role}.lock"));
        let refused = |source| ChannelError::Root { path: path.clone(), source };
        let mut attempts_left = ATTEMPTS_MAX;
        loop {
            attempts_left -= 1;
            let mut file = OpenOptions::new()
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                // Whoever can read a lock can take it.
                .mode(0o600)
                .open(&path)
                .map_err(refused)?;
            match file.try_lock() {
                // Cleared away as stale between opening and locking: no longer the file under that name.
                Ok(()) if !is_named_by(&file, &path) && attempts_left > 0 => (),
                Ok(()) => {
                    file.set_len(0).map_err(refused)?;
                    file.rewind().map_err(refused)?;
                    writeln!(file, "{}", std::process::id()).map_err(refused)?;
                    return Ok(Self { _file: file });
                }
                Err(TryLockError::WouldBlock) if attempts_left > 0 && living_holder(&path).is_none() => {
                    // Held by nobody who says so: whoever clears it away is about to be done.
                    std::thread::sleep(ATTEMPT_PAUSE);
                }
                Err(TryLockError::WouldBlock) => {
                    let mut text = String::new();
                    let pid = match file.read_to_string(&mut text) {
                        Ok(_) => text.trim().parse().unwrap_or(0),
                        Err(_) => 0,
                    };
                    return Err(ChannelError::Held { rig: rig.to_owned(), role, pid, path });
                }
                Err(TryLockError::Error(source)) => return Err(refused(source)),
            }
        }
    }
}

/// True when `path` still names `file`, and not another one or none.
pub(super) fn is_named_by(file: &File, path: &Path) -> bool {
    let same = |own: Metadata| {
        path.metadata().is_ok_and(|named| named.ino() == own.ino() && named.dev() == own.dev())
    };
    file.metadata().is_ok_and(same)
}

/// The living process that took the role last, as far as its lock file says. Looks at no lock, so that it
/// never keeps anybody from taking one.
pub(super) fn holder(root: &Path, rig: &str, role: Role) -> Option<u32> {
    living_holder(&root.join(format!("{rig}.{role}.lock")))
}

/// The living process that a lock file names, as long as the file is locked: another process may have the number by now.
pub(super) fn living_holder(path: &Path) -> Option<u32> {
    let text = std::fs::read_to_string(path).ok()?;
    let number: u32 = text.trim().parse().ok()?;
    let pid = rustix::process::Pid::from_raw(i32::try_from(number).ok()?)?;
    let lives = rustix::process::test_kill_process(pid).is_ok();
    (lives && is_locked(path).unwrap_or(true)).then_some(number)
}

/// Whether anybody holds the lock of a file, by the kernel's list; `None` where that cannot be read.
fn is_locked(path: &Path) -> Option<bool> {
    let file = path.metadata().ok()?;
    let (major, minor) = (rustix::fs::major(file.dev()), rustix::fs::minor(file.dev()));
    // "1: FLOCK  ADVISORY  WRITE 4711 fe:00:1234 0 EOF": process, then device and file.
    let wanted = format!("{major:02x}:{minor:02x}:{}", file.ino());
    let locks = std::fs::read_to_string("/proc/locks").ok()?;
    Some(locks.lines().any(|lock| lock.split_ascii_whitespace().any(|word| word == wanted)))
}

#[cfg(test)]
mod tests {
    use super::{ChannelError, Role, RoleLock, holder};

    #[test]
    fn second_holder_is_refused_and_told_who_holds() {
        let root = tempfile::tempdir().expect("a directory");
        let _held = RoleLock::acquire(root.path(), "rig", Role::Daemon).expect("free");
        let refused = RoleLock::acquire(root.path(), "rig", Role::Daemon).expect_err("held");
        let ChannelError::Held { pid, .. } = &refused else { panic!("{refused}") };
        assert_eq!(*pid, std::process::id());
        let text = refused.to_string();
        assert!(text.starts_with(&format!("rig rig already has a daemon: process {pid}")), "{text}");
    }

    #[test]
    fn holder_is_told_while_it_lives() {
        let root = tempfile::tempdir().expect("a directory");
        assert_eq!(holder(root.path(), "rig", Role::Driver), None);
        let _held = RoleLock::acquire(root.path(), "rig", Role::Driver).expect("free");
        assert_eq!(holder(root.path(), "rig", Role::Driver), Some(std::process::id()));
        // No process has this number.
        std::fs::write(root.path().join("rig.driver.lock"), "2147483646").expect("written");
        assert_eq!(holder(root.path(), "rig", Role::Driver), None);
    }

    /// Goal: a number that another process has by now makes nobody a holder.
    #[test]
    fn a_lock_that_nobody_holds_has_no_holder_whatever_number_it_names() {
        let root = tempfile::tempdir().expect("a directory");
        std::fs::write(root.path().join("rig.driver.lock"), std::process::id().to_string()).expect("written");
        assert_eq!(holder(root.path(), "rig", Role::Driver), None);
        let _held = RoleLock::acquire(root.path(), "rig", Role::Driver).expect("free");
        assert_eq!(holder(root.path(), "rig", Role::Driver), Some(std::process::id()));
    }

    #[test]
    fn other_roles_and_rigs_are_free_and_a_dropped_lock_is_free_again() {
        let root = tempfile::tempdir().expect("a directory");
        let held = RoleLock::acquire(root.path(), "rig", Role::Daemon).expect("free");
        RoleLock::acquire(root.path(), "rig", Role::Driver).expect("another role");
        RoleLock::acquire(root.path(), "other", Role::Daemon).expect("another rig");
        drop(held);
        RoleLock::acquire(root.path(), "rig", Role::Daemon).expect("free again");
    }
}
