//! What the kernel tells of the daemon's process: its memory, and what its loop's thread met.

use std::path::PathBuf;

use magsteer::daemon::threads::threads_of;
use magsteer_hal::channels::{Endpoint, Leftovers};

/// The control loop's thread of a daemon.
const LOOP_THREAD: &str = "magsteer-loop";
/// Threads of a pool; where there are some, the loop is one of them, and nothing outside tells which.
const POOL_THREADS: &str = "magsteer-jac";
/// No private root is looked for.
const NO_ROOT: &str = "none";

/// A daemon's process.
#[derive(Debug, Clone)]
pub struct DaemonProcess {
    directory: PathBuf,
    loop_thread: Option<PathBuf>,
}

/// What a thread met since its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Met {
    pub page_faults: u64,
    pub preemptions: u64,
}

impl DaemonProcess {
    /// The process of this number, whose loop runs.
    pub fn of(pid: u32) -> Self {
        let directory = PathBuf::from(format!("/proc/{pid}"));
        let threads = threads_of(&directory);
        let pooled = threads.iter().any(|thread| thread.name.starts_with(POOL_THREADS));
        let own = threads.iter().find(|thread| thread.name == LOOP_THREAD && !pooled);
        let loop_thread = own.map(|thread| directory.join("task").join(thread.tid.to_string()));
        Self { directory, loop_thread }
    }

    /// The daemon of a rig, where this user may see it.
    pub fn of_rig(endpoint: &Endpoint) -> Option<Self> {
        let found = Leftovers::find(endpoint, NO_ROOT).ok()?;
        let role = format!("{}.daemon", endpoint.rig());
        found.holders.iter().find(|(name, _)| *name == role).map(|(_, pid)| Self::of(*pid))
    }

    /// Memory that is present, MB.
    pub fn rss_mb(&self) -> Option<f64> {
        let status = std::fs::read_to_string(self.directory.join("status")).ok()?;
        Some(number_after(&status, "VmRSS:")? as f64 * 1_024e-6)
    }

    /// What the loop's thread met.
    pub fn met(&self) -> Option<Met> {
        let task = self.loop_thread.as_ref()?;
        let stat = std::fs::read_to_string(task.join("stat")).ok()?;
        let status = std::fs::read_to_string(task.join("status")).ok()?;
        Some(Met {
            page_faults: page_faults(&stat)?,
            preemptions: number_after(&status, "nonvoluntary_ctxt_switches:")?,
        })
    }
}

/// The number on the line that begins with `key`.
fn number_after(text: &str, key: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(key))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Minor and major ones in a line of `/proc/PID/task/TID/stat`.
fn page_faults(stat: &str) -> Option<u64> {
    // The name stands in parentheses and may hold blanks; fields are counted as proc(5) does.
    let (_, after) = stat.rsplit_once(')')?;
    let field = |number: usize| after.split_whitespace().nth(number - 3)?.parse::<u64>().ok();
    Some(field(10)? + field(12)?)
}

#[cfg(test)]
mod tests {
    use super::{DaemonProcess, number_after, page_faults};

    #[test]
    fn memory_and_faults_are_read_as_the_kernel_writes_them() {
        let status =
            "Name:\tmagsteer\nVmHWM:\t  9 kB\nVmRSS:\t   52344 kB\nnonvoluntary_ctxt_switches:\t17\n";
        assert_eq!(number_after(status, "VmRSS:"), Some(52_344));
        assert_eq!(number_after(status, "nonvoluntary_ctxt_switches:"), Some(17));
        assert_eq!(number_after(status, "VmSwap:"), None);
        let stat = "4711 (a) b) S 1 4711 1 0 -1 4194368 120 0 3 0 0 3 1 0 0 -81 0 3";
        assert_eq!(page_faults(stat), Some(123));
        assert_eq!(page_faults("4711 (a S 1"), None);
    }

    #[test]
    fn a_process_that_is_no_daemon_has_memory_and_no_loop() {
        let this = DaemonProcess::of(std::process::id());
        assert!(this.rss_mb().is_some_and(|rss| rss > 0.5));
        assert_eq!(this.met(), None);
    }
}
