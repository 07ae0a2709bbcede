//! The one file that talks to the kernel for real time and for signals.
//!
//! Problem: whether a thread really runs under `SCHED_FIFO`, on its CPU and with its memory locked
//! depends on rights that a process may lack, and a silent failure shows only as rare lateness.
//! Method: each property is set and then *read back* from the kernel; the report says what was wanted, what
//! holds, and why they differ. An ordinary user gets a working loop and an honest report.

#![expect(unsafe_code, reason = "the C library's scheduling and signal calls have no safe wrapper here")]

use std::io;
use std::num::NonZeroU64;
use std::time::Duration;

use magsteer_hal::Stamp;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::{Deserialize, Serialize};

use super::realtime::{RealtimeItem, RealtimeReport};

/// Stack touched in advance, so that no cycle meets a page fault there.
const STACK_PREFAULT: usize = 256 * 1_024;
/// Heap of the loop's thread touched in advance: the transport takes memory once a message, a few hundred
/// bytes.
const HEAP_PREFAULT: usize = 1 << 20;
/// A page, at least.
const PAGE: usize = 4_096;

/// Sleeps until `deadline` on `CLOCK_MONOTONIC`; returns at once when it is over.
pub fn sleep_until(deadline: Stamp) {
    let nanoseconds = deadline.nanoseconds();
    let request = rustix::time::Timespec {
        tv_sec: i64::try_from(nanoseconds / 1_000_000_000).unwrap_or(i64::MAX),
        tv_nsec: i64::try_from(nanoseconds % 1_000_000_000).unwrap_or(0),
    };
    // A signal interrupts the sleep; the deadline is absolute, so that it is simply resumed.
    while rustix::thread::clock_nanosleep_absolute(rustix::thread::ClockId::Monotonic, &request)
        == Err(rustix::io::Errno::INTR)
    {}
}

/// What a loop thread asks of the kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RealtimeRequest {
    /// Priority under `SCHED_FIFO`, 1 to 99.
    pub priority: u32,
    /// CPU to run on; `None` for any.
    pub cpu: Option<u32>,
    /// True to lock the process's memory.
    pub lock_memory: bool,
}

/// Asks for real time for the calling thread and reads back what holds. Call it in the loop's
/// thread, after everything that the loop needs was allocated.
#[must_use]
pub fn request_realtime(request: &RealtimeRequest) -> RealtimeReport {
    let mut items = vec![request_fifo(request.priority)];
    items.extend(request.cpu.map(request_cpu));
    items.extend(request_kept_heap());
    prefault_stack();
    prefault_heap();
    // Last of what concerns memory, so that it locks the pages that were touched.
    if request.lock_memory {
        items.push(request_memory_lock());
    }
    items.push(request_timer_slack());
    RealtimeReport { items, threads: Vec::new() }
}

/// Asks for the loop's policy for the calling thread, which helps the loop's, and reads back what holds. Its CPU is left
/// to the kernel: pinned to the loop's it could not help.
#[must_use]
pub fn request_helper_realtime(priority: u32) -> RealtimeItem {
    let _ = rustix::thread::set_current_timer_slack(NonZeroU64::new(1));
    prefault_stack();
    RealtimeItem { name: "helpers".to_owned(), ..request_fifo(priority) }
}

/// Asks for ordinary scheduling for the calling thread, off the loop's CPU where there is another one, and
/// reads back what holds: a process started under a real-time policy hands it down to all of its threads.
#[must_use]
pub fn request_ordinary(loop_cpu: Option<u32>) -> Vec<RealtimeItem> {
    let parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: 0 names the calling thread, and the pointer is to a live, initialised structure.
    let set = outcome(unsafe { libc::sched_setscheduler(0, libc::SCHED_OTHER, &raw const parameters) });
    let (policy, _) = scheduling();
    let granted = policy == libc::SCHED_OTHER;
    let got = if granted { "ordinary scheduling".to_owned() } else { format!("policy {policy}") };
    let mend = "start the program under an ordinary policy: `chrt --other 0 magsteer run ...`";
    let mut items = vec![RealtimeItem::new(
        "scheduling",
        "ordinary scheduling".to_owned(),
        got,
        granted,
        set.err(),
        mend,
    )];
    items.extend(loop_cpu.and_then(leave_cpu));
    items
}

/// Takes the calling thread, and every one that it starts from now on, off a CPU; `None` when it does not run there, or
/// has no other. A thread of those may go back by asking for that CPU.
#[must_use]
pub fn leave_cpu(cpu: u32) -> Option<RealtimeItem> {
    let cpu = cpu as usize;
    let mut wanted = sched_getaffinity(None).ok()?;
    if cpu >= CpuSet::MAX_CPU || !wanted.is_set(cpu) || wanted.count() < 2 {
        return None;
    }
    wanted.unset(cpu);
    let set = sched_setaffinity(None, &wanted).map_err(io::Error::from);
    let held = sched_getaffinity(None).unwrap_or_default();
    let (wanted, got) = (format!("CPU {}", cpu_list(&wanted)), format!("CPU {}", cpu_list(&held)));
    let granted = wanted == got;
    Some(RealtimeItem::new("affinity", wanted, got, granted, set.err(), "see `taskset` and cgroups"))
}

fn cpu_list(set: &CpuSet) -> String {
    let cpus = (0..CpuSet::MAX_CPU).filter(|&cpu| set.is_set(cpu)).map(|cpu| cpu.to_string());
    cpus.collect::<Vec<_>>().join(",")
}

/// What a thread met so far that costs it time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ThreadUsage {
    /// Pages that were not mapped yet.
    pub page_faults_minor: u64,
    /// Pages that had to be read from a disk.
    pub page_faults_major: u64,
    /// Times that the thread was taken off its CPU without wishing to wait.
    pub preemptions: u64,
}

impl ThreadUsage {
    /// What was met after `earlier`.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            page_faults_minor: self.page_faults_minor.saturating_sub(earlier.page_faults_minor),
            page_faults_major: self.page_faults_major.saturating_sub(earlier.page_faults_major),
            preemptions: self.preemptions.saturating_sub(earlier.preemptions),
        }
    }
}

/// The calling thread's counts, as the kernel keeps them.
#[must_use]
pub fn thread_usage() -> ThreadUsage {
    // SAFETY: an all-zero `rusage` is a valid value, and the pointer is to that live structure, which the
    // call fills.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_THREAD, &raw mut usage);
        usage
    };
    let count = |value: libc::c_long| u64::try_from(value).unwrap_or(0);
    ThreadUsage {
        page_faults_minor: count(usage.ru_minflt),
        page_faults_major: count(usage.ru_majflt),
        preemptions: count(usage.ru_nivcsw),
    }
}

/// Keeps freed memory with the process and large blocks on the heap, so that pages once touched stay: giving
/// memory back and taking it anew would meet page faults, and changes of the memory map that hold up every
/// thread's.
#[cfg(target_env = "gnu")]
fn request_kept_heap() -> Option<RealtimeItem> {
    // SAFETY: both parameters take any number; the allocator locks itself while it changes them.
    let kept =
        unsafe { libc::mallopt(libc::M_TRIM_THRESHOLD, -1) == 1 && libc::mallopt(libc::M_MMAP_MAX, 0) == 1 };
    let got = if kept { "kept" } else { "given back when freed" };
    Some(RealtimeItem::new(
        "heap",
        "kept".to_owned(),
        got.to_owned(),
        kept,
        None,
        "unset GLIBC_TUNABLES and MALLOC_* variables",
    ))
}

/// Other C libraries offer no such setting; the loop takes memory once a message, of a size that no allocator
/// gives back.
#[cfg(not(target_env = "gnu"))]
fn request_kept_heap() -> Option<RealtimeItem> {
    None
}

/// Touches pages of the calling thread's heap, which then keeps them.
#[inline(never)]
fn prefault_heap() {
    let mut pages = vec![0_u8; HEAP_PREFAULT];
    touch(&mut pages);
}

fn touch(pages: &mut [u8]) {
    for page in pages.chunks_mut(PAGE) {
        page[0] = 1;
    }
    std::hint::black_box(pages);
}

fn request_fifo(priority: u32) -> RealtimeItem {
    let parameters = libc::sched_param { sched_priority: i32::try_from(priority).unwrap_or(1) };
    // SAFETY: 0 names the calling thread, and the pointer is to a live, initialised structure.
    let set = outcome(unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) });
    let (policy, held) = scheduling();
    let got = match policy {
        libc::SCHED_FIFO => format!("SCHED_FIFO {held}"),
        libc::SCHED_RR => format!("SCHED_RR {held}"),
        _ => "ordinary scheduling".to_owned(),
    };
    let granted = policy == libc::SCHED_FIFO && Some(held) == i32::try_from(priority).ok();
    let mend = "grant CAP_SYS_NICE, or `rtprio` in /etc/security/limits.conf";
    RealtimeItem::new("scheduling", format!("SCHED_FIFO {priority}"), got, granted, set.err(), mend)
}

/// Policy and priority of the calling thread, as the kernel holds them.
fn scheduling() -> (i32, i32) {
    let mut parameters = libc::sched_param { sched_priority: 0 };
    // SAFETY: 0 names the calling thread, and the pointer is to a live structure that the call fills.
    let policy = unsafe {
        libc::sched_getparam(0, &raw mut parameters);
        libc::sched_getscheduler(0)
    };
    (policy & !libc::SCHED_RESET_ON_FORK, parameters.sched_priority)
}

fn request_cpu(cpu: u32) -> RealtimeItem {
    let index = cpu as usize;
    let set = if index < CpuSet::MAX_CPU {
        let mut wanted = CpuSet::new();
        wanted.set(index);
        sched_setaffinity(None, &wanted).map_err(io::Error::from)
    } else {
        Err(io::Error::from(io::ErrorKind::InvalidInput))
    };
    let held = sched_getaffinity(None).unwrap_or_default();
    let granted = held.count() == 1 && index < CpuSet::MAX_CPU && held.is_set(index);
    let mend = "name a CPU that this process may use, see `nproc` and cgroups";
    RealtimeItem::new(
        "affinity",
        format!("CPU {cpu}"),
        format!("CPU {}", cpu_list(&held)),
        granted,
        set.err(),
        mend,
    )
}

/// Locks all pages present. Later ones are left out: where the limit on locked memory is finite, locking them
/// would make an allocation of another thread fail.
fn request_memory_lock() -> RealtimeItem {
    let set = rustix::mm::mlockall(rustix::mm::MlockAllFlags::CURRENT).map_err(io::Error::from);
    let locked_kb = locked_memory_kb().unwrap_or(0);
    let mend = "grant CAP_IPC_LOCK, or `memlock` in /etc/security/limits.conf";
    RealtimeItem::new(
        "memory",
        "locked".to_owned(),
        format!("{locked_kb} kB locked"),
        locked_kb > 0 && set.is_ok(),
        set.err(),
        mend,
    )
}

/// `VmLck` of this process.
fn locked_memory_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmLck:"))?;
    line.split_whitespace().next()?.parse().ok()
}

/// Timer slack of 1 ns, the least there is; it delays the wake-ups of ordinary threads by 50 us otherwise.
fn request_timer_slack() -> RealtimeItem {
    let set = rustix::thread::set_current_timer_slack(NonZeroU64::new(1)).map_err(io::Error::from);
    let held = rustix::thread::current_timer_slack();
    // Threads under a real-time policy have no slack at all; the kernel then reports 0.
    let granted = held.is_ok_and(|nanoseconds| nanoseconds <= 1);
    let got = held.map_or_else(|_| "unknown".to_owned(), |nanoseconds| format!("{nanoseconds} ns"));
    RealtimeItem::new(
        "timer slack",
        "1 ns".to_owned(),
        got,
        granted,
        set.err(),
        "needs a kernel with prctl(2)",
    )
}

fn outcome(returned: i32) -> io::Result<()> {
    if returned == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[inline(never)]
fn prefault_stack() {
    let mut pages = [0_u8; STACK_PREFAULT];
    touch(&mut pages);
}

/// SIGINT, SIGTERM and SIGHUP, taken one by one by the thread that waits for them.
///
/// They are blocked in the creating thread and in all threads started after it, so that no handler ever
/// interrupts anything; create this first in `main`.
#[derive(Debug)]
pub struct Signals {
    set: libc::sigset_t,
}

impl Signals {
    /// Blocks the signals for this thread and its descendants.
    ///
    /// # Errors
    /// When the kernel refuses the mask.
    pub fn block() -> io::Result<Self> {
        // SAFETY: an all-zero `sigset_t` is valid storage, and `sigemptyset` initialises it before any use;
        // every pointer is to a live local.
        let set = unsafe {
            let mut set: libc::sigset_t = std::mem::zeroed();
            libc::sigemptyset(&raw mut set);
            for signal in [libc::SIGINT, libc::SIGTERM, libc::SIGHUP] {
                libc::sigaddset(&raw mut set, signal);
            }
            match libc::pthread_sigmask(libc::SIG_BLOCK, &raw const set, std::ptr::null_mut()) {
                0 => set,
                code => return Err(io::Error::from_raw_os_error(code)),
            }
        };
        Ok(Self { set })
    }

    /// Does `work` on this thread with the signals let through: a process that it starts inherits the mask, and
    /// could not be asked to end otherwise. Meant for that alone, since a signal that comes meanwhile acts as
    /// if nobody waited for it.
    ///
    /// # Errors
    /// When the kernel refuses the mask.
    pub fn let_through<T>(work: impl FnOnce() -> T) -> io::Result<T> {
        let set = Self::block()?.set;
        let change = |how| {
            // SAFETY: the set is initialised and lives; the former mask is not asked for.
            match unsafe { libc::pthread_sigmask(how, &raw const set, std::ptr::null_mut()) } {
                0 => Ok(()),
                code => Err(io::Error::from_raw_os_error(code)),
            }
        };
        change(libc::SIG_UNBLOCK)?;
        let done = work();
        change(libc::SIG_BLOCK)?;
        Ok(done)
    }

    /// Waits for one of the signals; `None` when none came within `patience`.
    #[must_use]
    pub fn wait(&self, patience: Duration) -> Option<i32> {
        let timeout = libc::timespec {
            tv_sec: libc::time_t::try_from(patience.as_secs()).unwrap_or(libc::time_t::MAX),
            tv_nsec: libc::c_long::from(patience.subsec_nanos()),
        };
        // SAFETY: both pointers are to live, initialised structures; the information is not asked for.
        let signal =
            unsafe { libc::sigtimedwait(&raw const self.set, std::ptr::null_mut(), &raw const timeout) };
        (signal > 0).then_some(signal)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use magsteer_hal::Stamp;

    use super::{RealtimeRequest, Signals, request_realtime, scheduling, sleep_until};

    /// Goal: whatever the rights of the user who runs this test, the report agrees with the kernel.
    #[test]
    fn report_says_what_the_kernel_holds_for_this_thread() {
        let request = RealtimeRequest { priority: 7, cpu: Some(0), lock_memory: false };
        let thread = std::thread::spawn(move || (request_realtime(&request), scheduling()));
        let (report, (policy, priority)) = thread.join().expect("the thread only asks");
        let fifo = &report.items[0];
        assert_eq!(fifo.granted, (policy, priority) == (libc::SCHED_FIFO, 7), "{report}");
        assert_eq!(fifo.granted, fifo.why_not.is_none());
        assert_eq!(report.is_granted(), report.items.iter().all(|item| item.why_not.is_none()));
    }

    #[test]
    fn a_cpu_that_does_not_exist_is_reported_not_granted() {
        let request = RealtimeRequest { priority: 1, cpu: Some(1_023), lock_memory: false };
        let thread = std::thread::spawn(move || request_realtime(&request));
        let report = thread.join().expect("the thread only asks");
        assert!(!report.is_granted());
        assert!(report.to_string().contains("wanted CPU 1023"), "{report}");
    }

    #[test]
    fn sleeping_until_a_past_deadline_returns_and_until_a_future_one_waits() {
        sleep_until(Stamp::from_nanoseconds(1));
        let deadline = Stamp::now().after(Duration::from_millis(3));
        sleep_until(deadline);
        assert!(Stamp::now() >= deadline);
    }

    #[test]
    fn a_blocked_signal_is_taken_by_the_waiting_thread() {
        let thread = std::thread::spawn(|| {
            let signals = Signals::block().expect("blocking a signal needs no rights");
            assert_eq!(signals.wait(Duration::from_millis(1)), None);
            // SAFETY: sends a signal to the calling thread, which blocks it.
            let sent = unsafe { libc::pthread_kill(libc::pthread_self(), libc::SIGHUP) };
            assert_eq!(sent, 0);
            signals.wait(Duration::from_secs(5))
        });
        assert_eq!(thread.join().expect("the thread only waits"), Some(libc::SIGHUP));
    }
}
