//! One holder a role and rig: an advisory lock on a file that the kernel drops when its holder dies, however it dies.
//!
//! The file itself stays; it names the last holder's process, for people.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use super::error::{ChannelError, Role};

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
            Ok(()) => (),
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
        file.set_len(0).map_err(refused)?;
        file.rewind().map_err(refused)?;
        writeln!(file, "{}", std::process::id()).map_err(refused)?;
        Ok(Self { _file: file })
    }
}

/// The living process that took the role last, as far as its lock file says. Looks at no lock, so that it
/// never keeps anybody from taking one.
pub(super) fn holder(root: &Path, rig: &str, role: Role) -> Option<u32> {
    let text = std::fs::read_to_string(root.join(format!("{rig}.{role}.lock"))).ok()?;
    let number: u32 = text.trim().parse().ok()?;
    let pid = rustix::process::Pid::from_raw(i32::try_from(number).ok()?)?;
    rustix::process::test_kill_process(pid).is_ok().then_some(number)
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
