//! Who runs on the channels, under which policy, and what dead processes left there.

use std::path::Path;

use magsteer::daemon::threads::{ThreadView, threads_of};
use magsteer_hal::channels::{Cleared, Leftovers};

use super::finding::Finding;

/// The control loop's thread of a daemon.
const LOOP_THREAD: &str = "magsteer-loop";
/// Threads that help it, and ask for the same policy.
const HELPERS: &str = "magsteer-jac";

pub fn leftovers(found: &Leftovers) -> Finding {
    const CHECK: &str = "leftovers";
    let names: Vec<String> =
        found.holders.iter().map(|(role, pid)| format!("{role} (process {pid})")).collect();
    let living =
        if names.is_empty() { "nobody runs".to_owned() } else { format!("{} run", names.join(", ")) };
    let files = match found.stale_locks.len() {
        0 => String::new(),
        count => format!("; {count} lock files of ended processes, which hold nothing"),
    };
    if found.dead.is_empty() && found.abandoned_roots.is_empty() {
        return Finding::pass(CHECK, format!("{living}; nothing left by dead processes{files}"));
    }
    let found = format!(
        "{living}; {} dead processes left shared memory, {} dead demonstrations all of theirs{files}",
        found.dead.len(),
        found.abandoned_roots.len()
    );
    Finding::warn(
        CHECK,
        found,
        "magsteer doctor --clean   # with the same --root; nothing that lives is touched",
    )
}

pub fn cleared(cleared: &Cleared) -> Finding {
    const CHECK: &str = "clean";
    let found = format!(
        "cleared away: {} dead processes' shared memory, {} lock files, {} roots of dead demonstrations",
        cleared.dead.len(),
        cleared.stale_locks.len(),
        cleared.abandoned_roots.len()
    );
    if cleared.failed.is_empty() {
        return Finding::pass(CHECK, found);
    }
    Finding::warn(
        CHECK,
        format!("{found}; not: {}", cleared.failed.join("; ")),
        "magsteer doctor --clean   # once more, with the same --root: another process may have been clearing up",
    )
}

/// One line for each daemon that runs: is its loop in real time?
pub fn daemons(found: &Leftovers) -> Vec<Finding> {
    let daemons = found.holders.iter().filter(|(role, _)| role.ends_with(".daemon"));
    daemons
        .filter_map(|(role, pid)| daemon(role, *pid, &threads_of(&Path::new("/proc").join(pid.to_string()))))
        .collect()
}

/// `None` when the process is no longer there, or is none whose threads can be told apart.
fn daemon(role: &str, pid: u32, threads: &[ThreadView]) -> Option<Finding> {
    const CHECK: &str = "running daemon";
    let looping = threads.iter().find(|thread| thread.name == LOOP_THREAD)?;
    let rivals: Vec<String> = threads
        .iter()
        .filter(|thread| {
            thread.is_realtime() && thread.name != LOOP_THREAD && !thread.name.starts_with(HELPERS)
        })
        .map(ToString::to_string)
        .collect();
    let found = format!("{role}, process {pid}: {looping}");
    Some(if !looping.is_realtime() {
        let mend =
            format!("sudo chrt --fifo --pid 80 {}   # now; for good see `priority` above", looping.tid);
        Finding::warn(CHECK, found, mend)
    } else if rivals.is_empty() {
        Finding::pass(CHECK, found)
    } else {
        let mend = "start it under an ordinary policy: chrt --other 0 magsteer run ...";
        Finding::warn(CHECK, format!("{found}; others in real time too: {}", rivals.join(", ")), mend)
    })
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use magsteer::daemon::threads::ThreadView;
    use magsteer_hal::channels::{Cleared, Leftovers};

    use super::super::finding::Level;
    use super::{cleared, daemon, leftovers};

    #[test]
    fn dead_processes_warn_and_lock_files_alone_do_not() {
        let mut found = Leftovers { stale_locks: vec![PathBuf::from("a.lock")], ..Leftovers::default() };
        found.holders = vec![("rig.driver".to_owned(), 7)];
        assert_eq!(leftovers(&found).level, Level::Pass);
        assert!(leftovers(&found).found.contains("rig.driver (process 7)"));
        found.dead = vec![8];
        assert_eq!(leftovers(&found).level, Level::Warn);
        found = Leftovers { abandoned_roots: vec![PathBuf::from("b")], ..Leftovers::default() };
        assert_eq!(leftovers(&found).level, Level::Warn);
        assert!(leftovers(&found).mend.expect("a warning").contains("--clean"));
    }

    #[test]
    fn what_could_not_be_cleared_away_is_told() {
        assert_eq!(cleared(&Cleared::default()).level, Level::Pass);
        let failed = cleared(&Cleared { failed: vec!["node".to_owned()], ..Cleared::default() });
        assert!(failed.level == Level::Warn && failed.found.ends_with("not: node"), "{failed}");
    }

    #[test]
    fn a_daemon_is_judged_by_its_loop_and_by_what_else_runs_in_real_time() {
        let thread = |name: &str, policy: &str| ThreadView {
            name: name.to_owned(),
            tid: 9,
            policy: policy.to_owned(),
            priority: 80,
            cpus: "0-1".to_owned(),
            timer_slack_ns: None,
        };
        let judge = |threads: &[ThreadView]| daemon("rig.daemon", 9, threads).map(|found| found.level);
        let looping = thread("magsteer-loop", "SCHED_FIFO");
        let comms = thread("magsteer-comms", "SCHED_OTHER");
        assert_eq!(judge(&[]), None);
        assert_eq!(judge(&[looping.clone(), comms.clone()]), Some(Level::Pass));
        assert_eq!(judge(&[thread("magsteer-loop", "SCHED_OTHER"), comms]), Some(Level::Warn));
        assert_eq!(judge(&[thread("magsteer-jac-1", "SCHED_FIFO"), looping.clone()]), Some(Level::Pass));
        assert_eq!(judge(&[thread("magsteer-comms", "SCHED_FIFO"), looping]), Some(Level::Warn));
    }
}
