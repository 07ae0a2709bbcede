//! The scheduling of every thread of a process, as the kernel has it.
//!
//! Problem: what a thread asked for is not what it runs under when rights lack, and threads that never asked
//! inherit what the program was started with. Method: `/proc/PID/task`, proc(5), for each thread; nothing is
//! set here.

use std::fmt;
use std::fs;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// One thread, read back.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ThreadView {
    /// As it named itself, cut to 15 bytes by the kernel.
    pub name: String,
    /// The kernel's number of it.
    pub tid: u32,
    /// `SCHED_OTHER`, `SCHED_FIFO` and so on.
    pub policy: String,
    /// Priority under a real-time policy, 0 under others.
    pub priority: u32,
    /// CPUs that it may run on, as the kernel lists them.
    pub cpus: String,
    /// How late a timer of the thread may be by choice of the kernel, 0 under a real-time policy; `None`
    /// where it must not be read.
    pub timer_slack_ns: Option<u64>,
}

impl ThreadView {
    /// True under a policy that goes before ordinary threads.
    #[must_use]
    pub fn is_realtime(&self) -> bool {
        matches!(self.policy.as_str(), "SCHED_FIFO" | "SCHED_RR" | "SCHED_DEADLINE")
    }
}

impl fmt::Display for ThreadView {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} ({}): {}", self.name, self.tid, self.policy)?;
        if self.is_realtime() {
            write!(formatter, " {}", self.priority)?;
        }
        write!(formatter, ", CPU {}", self.cpus)?;
        match self.timer_slack_ns {
            Some(slack) => write!(formatter, ", timer slack {slack} ns"),
            None => Ok(()),
        }
    }
}

/// Every thread of the process under `process`, such as `/proc/self`; those that end meanwhile are left out.
#[must_use]
pub fn threads_of(process: &Path) -> Vec<ThreadView> {
    let Ok(entries) = fs::read_dir(process.join("task")) else { return Vec::new() };
    let tids = entries.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    let mut threads: Vec<ThreadView> = tids.filter_map(|tid| thread(process, tid)).collect();
    threads.sort_by_key(|thread| thread.tid);
    threads
}

fn thread(process: &Path, tid: u32) -> Option<ThreadView> {
    let task = process.join("task").join(tid.to_string());
    let (name, policy, priority) = scheduling_of(&fs::read_to_string(task.join("stat")).ok()?)?;
    let status = fs::read_to_string(task.join("status")).ok()?;
    let cpus = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
    // Not listed below the process, yet there; of another thread only for those who may set its priority.
    let slack = fs::read_to_string(process.parent()?.join(tid.to_string()).join("timerslack_ns"));
    let timer_slack_ns = slack.ok().and_then(|text| text.trim().parse().ok());
    Some(ThreadView {
        name,
        tid,
        policy: policy.to_owned(),
        priority,
        cpus: cpus.trim().to_owned(),
        timer_slack_ns,
    })
}

/// Name, policy and real-time priority in a line of `/proc/PID/task/TID/stat`.
fn scheduling_of(stat: &str) -> Option<(String, &'static str, u32)> {
    // The name stands in parentheses and may hold any others.
    let (before, after) = stat.rsplit_once(')')?;
    let (_, name) = before.split_once('(')?;
    // Counted as proc(5) does, of which the first two are read already.
    let field = |number: usize| after.split_whitespace().nth(number - 3);
    let policy = match field(41)?.parse::<u32>().ok()? {
        0 => "SCHED_OTHER",
        1 => "SCHED_FIFO",
        2 => "SCHED_RR",
        3 => "SCHED_BATCH",
        5 => "SCHED_IDLE",
        6 => "SCHED_DEADLINE",
        _ => "unknown",
    };
    Some((name.to_owned(), policy, field(40)?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::mpsc;

    use super::{scheduling_of, threads_of};

    /// Lines as the kernel writes them.
    const FIFO: &str = "4711 (magsteer-loop) S 1 4711 1 0 -1 4194368 120 0 0 0 3 1 0 0 -81 0 3 0 91234 2000000 500 \
        18446744073709551615 1 1 0 0 0 0 0 0 0 0 0 0 -1 1 80 1 0 0 0 0 0 0 0 0 0 0 0";
    const ORDINARY: &str = "12 (a) b) (c) R 1 12 1 0 -1 4194368 120 0 0 0 3 1 0 0 20 0 3 0 91234 2000000 500 \
        18446744073709551615 1 1 0 0 0 0 0 0 0 0 0 0 17 0 0 0 0 0 0 0 0 0 0 0 0 0 0";

    #[test]
    fn policy_and_priority_are_read_whatever_the_name_is() {
        assert_eq!(scheduling_of(FIFO), Some(("magsteer-loop".to_owned(), "SCHED_FIFO", 80)));
        assert_eq!(scheduling_of(ORDINARY), Some(("a) b) (c".to_owned(), "SCHED_OTHER", 0)));
        for broken in ["", "12", "12 (a", "12 (a) S 1", &FIFO.replace(" 80 1 ", " x 1 ")] {
            assert_eq!(scheduling_of(broken), None, "{broken}");
        }
    }

    /// Goal: another thread's name and CPUs are told, not those of whoever asks.
    #[test]
    fn a_thread_of_this_process_is_found_under_its_name() {
        let (ready, is_ready) = mpsc::channel();
        let (end, ended) = mpsc::channel::<()>();
        let thread = std::thread::Builder::new().name("read-me-back".to_owned()).spawn(move || {
            ready.send(()).expect("waited for");
            // Ends when the other end is dropped.
            let _ = ended.recv();
        });
        let thread = thread.expect("a thread");
        is_ready.recv().expect("it starts");
        let threads = threads_of(Path::new("/proc/self"));
        let found: Vec<_> = threads.iter().filter(|thread| thread.name == "read-me-back").collect();
        assert_eq!(found.len(), 1, "{threads:?}");
        assert!(!found[0].cpus.is_empty());
        assert!(found[0].to_string().starts_with(&format!("read-me-back ({}): SCHED_", found[0].tid)));
        drop(end);
        thread.join().expect("it only waits");
    }

    #[test]
    fn a_process_that_does_not_exist_has_no_threads() {
        assert!(threads_of(Path::new("/proc/0")).is_empty());
    }
}
