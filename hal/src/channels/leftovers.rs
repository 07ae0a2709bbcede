//! What dead processes left under a root, found and cleared away on demand.
//!
//! Nothing of it keeps a rig from starting: whoever starts clears up what is in its way. It takes memory
//! until then, and people ask what it is.
//!
//! Terms: a *participant* is a process's membership in the transport; a *stale lock file* names a process
//! that is gone; an *abandoned root* is a [private root](super::PrivateRoot) whose owner and participants are
//! dead. Method: the transport tells dead participants by file locks that die with their holder, and so do
//! lock files and roots here. Nothing is taken from a process that lives, a stopped one included.

use std::fs::{self, OpenOptions};
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, Node, NodeState, ipc};

use super::endpoint::{Endpoint, prefix};
use super::error::{ChannelError, Role};
use super::lock::{is_named_by, living_holder};
use super::membership::{ABANDONED_AGE, SEGMENTS, sweep};
use super::private_root::{abandoned_roots, remove_abandoned};
use super::service::transport;
use crate::description::is_rig_name;

/// What was found under a root.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Leftovers {
    /// Participants that live, by process; 0 where it is not told.
    pub living: Vec<u32>,
    /// Participants that are dead, by process; 0 where it is not told.
    pub dead: Vec<u32>,
    /// Living holders of roles, as `RIG.ROLE`, by process.
    pub holders: Vec<(String, u32)>,
    /// Lock files whose holders are gone. Every process that held a role leaves one, however it ended.
    pub stale_locks: Vec<PathBuf>,
    /// Private roots of dead demonstrations.
    pub abandoned_roots: Vec<PathBuf>,
}

/// What was cleared away.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Cleared {
    /// Dead participants whose segments and places are gone, by process.
    pub dead: Vec<u32>,
    /// Lock files removed.
    pub stale_locks: Vec<PathBuf>,
    /// Private roots removed, with their segments.
    pub abandoned_roots: Vec<PathBuf>,
    /// What could not be cleared away, and why.
    pub failed: Vec<String>,
}

impl Leftovers {
    /// Looks at the root of `endpoint`, at no rig in particular, and for private roots made with `hint`.
    /// Changes nothing.
    ///
    /// # Errors
    /// When the transport cannot list its participants.
    pub fn find(endpoint: &Endpoint, hint: &str) -> Result<Self, ChannelError> {
        let mut found = Self { abandoned_roots: abandoned_roots(hint), ..Self::default() };
        each_participant(endpoint, |state| match state {
            NodeState::Alive(view) => found.living.push(process_of(&view)),
            NodeState::Dead(view) => found.dead.push(process_of(&view)),
            // Of another user, or half-made: nobody knows whether it is dead.
            NodeState::Inaccessible(_) | NodeState::Undefined(_) => {}
        })?;
        for path in lock_files(endpoint.root()) {
            match living_holder(&path) {
                Some(pid) => found.holders.push((role_of(&path), pid)),
                None => found.stale_locks.push(path),
            }
        }
        Ok(found)
    }

    /// Clears away what dead processes left, and only that.
    ///
    /// # Errors
    /// When the transport cannot list its participants; what fails by itself is told in [`Cleared::failed`].
    pub fn clear(endpoint: &Endpoint, hint: &str) -> Result<Cleared, ChannelError> {
        let mut cleared = Cleared { abandoned_roots: remove_abandoned(hint), ..Cleared::default() };
        each_participant(endpoint, |state| {
            let NodeState::Dead(view) = state else { return };
            let pid = process_of(&view);
            match view.blocking_remove_stale_resources(CLEANER_WAIT) {
                Ok(()) => cleared.dead.push(pid),
                Err(error) => cleared.failed.push(format!("participant of process {pid}: {error:?}")),
            }
        })?;
        // Segments that a killed process was making belong to no participant.
        if let Err(error) = sweep(Path::new(SEGMENTS), &prefix(endpoint.root()), ABANDONED_AGE) {
            cleared.failed.push(format!("{SEGMENTS}: {error}"));
        }
        for path in lock_files(endpoint.root()) {
            if living_holder(&path).is_none() && remove_stale(&path) {
                cleared.stale_locks.push(path);
            }
        }
        Ok(cleared)
    }
}

/// Another process may be clearing up the same participant; it takes milliseconds.
const CLEANER_WAIT: Duration = Duration::from_secs(1);

fn each_participant(
    endpoint: &Endpoint,
    mut take: impl FnMut(NodeState<ipc::Service>),
) -> Result<(), ChannelError> {
    let config = endpoint.config(Duration::ZERO)?;
    Node::<ipc::Service>::list(&config, |state| {
        take(state);
        CallbackProgression::Continue
    })
    .map_err(|error| transport("node", error))
}

fn process_of(view: &impl NodeView) -> u32 {
    let details = view.details().as_ref();
    details.and_then(|details| u32::try_from(details.process_id().value()).ok()).unwrap_or(0)
}

/// Lock files of roles, in order of their names. A file of another name or content is somebody else's.
fn lock_files(root: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(root) else { return Vec::new() };
    let is_of_a_role = |path: &Path| {
        let name =
            path.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_suffix(".lock"));
        let rig = |role: Role| name?.strip_suffix(&format!(".{role}"));
        Role::ALL.into_iter().filter_map(rig).any(is_rig_name)
    };
    // Its holder may have died between making it and writing its number.
    let is_a_number = |path: &Path| {
        let text = fs::read_to_string(path).unwrap_or_default();
        text.trim().is_empty() || text.trim().parse::<u32>().is_ok()
    };
    let mut found: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.is_file() && is_of_a_role(path) && is_a_number(path))
        .collect();
    found.sort();
    found
}

fn role_of(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// Removes a lock file that nobody holds, while holding it: who opened it meanwhile finds that it is gone and
/// opens anew.
fn remove_stale(path: &Path) -> bool {
    let Ok(file) = OpenOptions::new().write(true).open(path) else { return false };
    file.try_lock().is_ok() && is_named_by(&file, path) && fs::remove_file(path).is_ok()
}

#[cfg(test)]
mod tests {
    use super::Leftovers;
    use crate::channels::{DriverEnd, PrivateRoot};

    /// No process has this number.
    const NOBODY: &str = "2147483646\n";
    const HINT: &str = "mstleft";

    #[test]
    fn what_lives_is_told_and_left_alone_and_files_of_the_dead_go() {
        let root = PrivateRoot::create(HINT).expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let driver = DriverEnd::create(&endpoint).expect("a driver");
        let stale = root.path().join("other.daemon.lock");
        std::fs::write(&stale, NOBODY).expect("written");
        let found = Leftovers::find(&endpoint, HINT).expect("listed");
        let own = std::process::id();
        assert_eq!((&found.living, &found.dead), (&vec![own], &vec![]));
        assert_eq!(found.holders, [("rig.driver".to_owned(), own)]);
        assert_eq!(found.stale_locks, vec![stale.clone()]);
        assert!(stale.is_file(), "looking changes nothing");
        let cleared = Leftovers::clear(&endpoint, HINT).expect("listed");
        assert_eq!(
            (cleared.stale_locks, cleared.dead, cleared.failed),
            (vec![stale.clone()], vec![], vec![])
        );
        assert!(!stale.exists() && root.path().join("rig.driver.lock").is_file());
        DriverEnd::create(&endpoint).expect_err("its driver lives and holds the role");
        drop(driver);
        let after = Leftovers::find(&endpoint, HINT).expect("listed");
        assert_eq!((after.living, after.dead), (vec![], vec![]));
    }

    /// Goal: of a folder that is somebody's own, nothing goes but what a role left.
    #[test]
    fn files_that_no_role_made_stay() {
        let root = PrivateRoot::create(HINT).expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let foreign = [
            ("Cargo.lock", "4\n"),
            ("poetry.lock", NOBODY),
            ("a.daemon.lock.bak", NOBODY),
            ("Some Rig.daemon.lock", NOBODY),
            ("rig.judge.lock", NOBODY),
            ("rig.daemon.lock", "[package]\n"),
        ];
        for (name, text) in foreign {
            std::fs::write(root.path().join(name), text).expect("written");
        }
        assert_eq!(
            Leftovers::find(&endpoint, HINT).expect("listed").stale_locks,
            Vec::<std::path::PathBuf>::new()
        );
        assert!(Leftovers::clear(&endpoint, HINT).expect("listed").stale_locks.is_empty());
        assert!(foreign.iter().all(|(name, _)| root.path().join(name).is_file()));
    }

    /// Goal: a lock is judged by who holds it, not by the number in it.
    #[test]
    fn a_held_lock_stays_whatever_its_file_says() {
        let root = PrivateRoot::create(HINT).expect("a root");
        let endpoint = root.endpoint("rig").expect("a name");
        let _driver = DriverEnd::create(&endpoint).expect("a driver");
        let lock = root.path().join("rig.driver.lock");
        std::fs::write(&lock, NOBODY).expect("written");
        let cleared = Leftovers::clear(&endpoint, HINT).expect("listed");
        assert!(cleared.stale_locks.is_empty() && lock.is_file());
    }
}
