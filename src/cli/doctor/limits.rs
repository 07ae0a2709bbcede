//! What this user's rights and the memory allow.

use magsteer::daemon::{DaemonConfig, RealtimePolicy};

use super::finding::Finding;
use super::machine::Machine;

/// Bits of `CapEff`, capabilities(7).
const CAP_IPC_LOCK: u32 = 14;
const CAP_SYS_NICE: u32 = 23;
/// Enough for the daemon's memory, bytes: locking takes all that is mapped, stacks and reserves of the
/// allocator included, 320 to 380 MB in all.
const LOCKED_MIN: u64 = 512 << 20;
/// What a rig's channels take is some megabytes; a recorder beside them takes more.
const SHARED_MIN: u64 = 16 << 20;
const SHARED_COMFORTABLE: u64 = 64 << 20;
const LIMITS_FILE: &str = "/etc/security/limits.d/magsteer.conf";

/// True where lacking rights stop the daemon from arming: a file says so, or there is no file that says
/// otherwise.
fn enforces(daemon: Option<&DaemonConfig>) -> bool {
    daemon.is_none_or(|daemon| daemon.realtime == RealtimePolicy::Enforce)
}

pub fn priority(machine: &Machine, daemon: Option<&DaemonConfig>) -> Finding {
    const CHECK: &str = "priority";
    let wanted = daemon.map_or(80, |daemon| daemon.priority);
    if has_capability(machine, CAP_SYS_NICE) {
        return Finding::pass(CHECK, format!("any, by CAP_SYS_NICE; wanted {wanted}"));
    }
    let allowed = limit(machine, "Max realtime priority").unwrap_or(Some(0));
    match allowed {
        None => Finding::pass(CHECK, format!("unlimited; wanted {wanted}")),
        Some(allowed) if allowed >= u64::from(wanted) => {
            Finding::pass(CHECK, format!("up to {allowed}; wanted {wanted}"))
        }
        Some(allowed) => {
            let mend =
                format!("echo \"$USER - rtprio {wanted}\" | sudo tee -a {LIMITS_FILE}   # then log in anew");
            let found = format!("up to {allowed}, wanted {wanted}: the loop waits for every other program");
            Finding::graded(CHECK, enforces(daemon), found, mend)
        }
    }
}

pub fn locked_memory(machine: &Machine, daemon: Option<&DaemonConfig>) -> Finding {
    const CHECK: &str = "locked memory";
    if daemon.is_some_and(|daemon| !daemon.lock_memory) {
        let found = "[daemon] asks for none: a page that was swapped out holds up a cycle by milliseconds";
        return Finding::warn(CHECK, found, "put `lock_memory = true` into [daemon]");
    }
    if has_capability(machine, CAP_IPC_LOCK) {
        return Finding::pass(CHECK, "any, by CAP_IPC_LOCK");
    }
    match limit(machine, "Max locked memory").unwrap_or(Some(0)) {
        None => Finding::pass(CHECK, "unlimited"),
        Some(bytes) if bytes >= LOCKED_MIN => Finding::pass(CHECK, format!("up to {} MiB", bytes >> 20)),
        Some(bytes) => {
            let mend = format!(
                "echo \"$USER - memlock unlimited\" | sudo tee -a {LIMITS_FILE}   # then log in anew"
            );
            let found = format!("up to {} MiB, the daemon takes up to {}", bytes >> 20, LOCKED_MIN >> 20);
            Finding::graded(CHECK, enforces(daemon), found, mend)
        }
    }
}

pub fn swap(machine: &Machine) -> Finding {
    const CHECK: &str = "swap";
    let text = machine.text("/proc/swaps").unwrap_or_default();
    let areas: Vec<&str> = text.lines().skip(1).filter_map(|line| line.split_whitespace().next()).collect();
    if areas.is_empty() {
        return Finding::pass(CHECK, "none");
    }
    let found = format!("{}: a driver whose memory is not locked waits for it", areas.join(", "));
    Finding::warn(CHECK, found, "sudo swapoff -a   # and remove its lines from /etc/fstab")
}

/// `free` of `total` bytes where shared memory is; `None` when it is not there.
pub fn shared_memory(space: Option<(u64, u64)>) -> Finding {
    const CHECK: &str = "shared memory";
    let Some((free, total)) = space else {
        return Finding::fail(
            CHECK,
            "/dev/shm is not there",
            "sudo mount -t tmpfs -o mode=1777 tmpfs /dev/shm",
        );
    };
    let found = format!("{} of {} MiB free in /dev/shm", free >> 20, total >> 20);
    if free >= SHARED_COMFORTABLE {
        return Finding::pass(CHECK, found);
    }
    // As much more as is wanted free.
    let size = (total + SHARED_COMFORTABLE) >> 20;
    Finding::graded(CHECK, free < SHARED_MIN, found, format!("sudo mount -o remount,size={size}M /dev/shm"))
}

/// Free and total bytes of the file system that shared memory is on.
pub fn shared_memory_space() -> Option<(u64, u64)> {
    let found = rustix::fs::statvfs("/dev/shm").ok()?;
    Some((found.f_bavail.saturating_mul(found.f_frsize), found.f_blocks.saturating_mul(found.f_frsize)))
}

fn has_capability(machine: &Machine, bit: u32) -> bool {
    let status = machine.text("/proc/self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    effective.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()).is_some_and(|set| set >> bit & 1 == 1)
}

/// The limit in force, `Some(None)` for none; `None` where the kernel does not name it.
fn limit(machine: &Machine, name: &str) -> Option<Option<u64>> {
    let text = machine.text("/proc/self/limits")?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    match rest.split_whitespace().next()? {
        "unlimited" => Some(None),
        number => number.parse().ok().map(Some),
    }
}

#[cfg(test)]
mod tests {
    use magsteer::daemon::RealtimePolicy;

    use super::super::consequences::tests::daemon;
    use super::super::finding::Level;
    use super::super::fixture::machine;
    use super::{locked_memory, priority, shared_memory, swap};

    const STATUS: &str = "/proc/self/status";
    const LIMITS: &str = "/proc/self/limits";
    const NO_RIGHTS: &str = "Name:\tmagsteer\nCapEff:\t0000000000000000";
    const NICE: &str = "CapEff:\t0000000000800000";
    const LOCK: &str = "CapEff:\t0000000000004000";

    fn limits(rtprio: &str, memlock: &str) -> String {
        format!(
            "Limit                     Soft Limit           Hard Limit           Units\n\
            Max locked memory         {memlock}              {memlock}              bytes\n\
            Max realtime priority     {rtprio}                    {rtprio}"
        )
    }

    #[test]
    fn rights_to_priority_come_from_a_capability_or_the_limit() {
        let cases = [
            (NICE, "0", Level::Pass),
            (LOCK, "0", Level::Fail),
            (NO_RIGHTS, "0", Level::Fail),
            (NO_RIGHTS, "79", Level::Fail),
            (NO_RIGHTS, "80", Level::Pass),
            (NO_RIGHTS, "unlimited", Level::Pass),
        ];
        for (status, rtprio, level) in cases {
            let fixture = machine(&[(STATUS, status), (LIMITS, &limits(rtprio, "0"))]);
            let mut config = daemon();
            config.realtime = RealtimePolicy::Enforce;
            for asked in [None, Some(&config)] {
                assert_eq!(priority(&fixture.machine, asked).level, level, "{status} {rtprio}");
            }
            config.realtime = RealtimePolicy::BestEffort;
            let eased = if level == Level::Fail { Level::Warn } else { level };
            assert_eq!(
                priority(&fixture.machine, Some(&config)).level,
                eased,
                "the daemon would arm without"
            );
        }
        assert_eq!(priority(&machine(&[]).machine, None).level, Level::Fail, "nothing known is no right");
    }

    #[test]
    fn rights_to_lock_memory_come_from_a_capability_or_the_limit() {
        let cases = [
            (LOCK, "0", Level::Pass),
            (NICE, "8388608", Level::Fail),
            (NO_RIGHTS, "268435456", Level::Fail),
            (NO_RIGHTS, "536870912", Level::Pass),
            (NO_RIGHTS, "unlimited", Level::Pass),
        ];
        for (status, memlock, level) in cases {
            let fixture = machine(&[(STATUS, status), (LIMITS, &limits("0", memlock))]);
            assert_eq!(locked_memory(&fixture.machine, None).level, level, "{status} {memlock}");
        }
        let mut config = daemon();
        config.lock_memory = false;
        let found = locked_memory(&machine(&[(STATUS, LOCK)]).machine, Some(&config));
        assert_eq!(found.level, Level::Warn, "{found}");
    }

    #[test]
    fn swap_is_named_by_its_areas() {
        let header = "Filename\tType\tSize\tUsed\tPriority";
        assert_eq!(swap(&machine(&[("/proc/swaps", header)]).machine).level, Level::Pass);
        assert_eq!(swap(&machine(&[]).machine).level, Level::Pass);
        let used = format!("{header}\n/dev/sda2 partition 2097148 0 -2\n/swapfile file 1 0 -3");
        let found = swap(&machine(&[("/proc/swaps", &used)]).machine);
        assert_eq!(found.level, Level::Warn);
        assert!(found.found.starts_with("/dev/sda2, /swapfile"), "{found}");
    }

    #[test]
    fn little_shared_memory_warns_and_next_to_none_fails() {
        let levels = [None, Some(1), Some(32), Some(64)].map(|free| {
            let found = shared_memory(free.map(|free| (free << 20, 100 << 20)));
            assert_eq!(found.mend.is_some(), found.level != Level::Pass);
            found.level
        });
        assert_eq!(levels, [Level::Fail, Level::Fail, Level::Warn, Level::Pass]);
    }
}
