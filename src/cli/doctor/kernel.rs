//! What the kernel is: how it preempts, its clock, how much time it leaves to real-time threads.

use super::finding::Finding;
use super::machine::Machine;

const FULL: &str = "sudo mount -t debugfs none /sys/kernel/debug; echo full | sudo tee /sys/kernel/debug/sched/preempt   # for good: \
    preempt=full on the kernel's command line";
const REALTIME: &str =
    "sudo apt-get install linux-image-rt-amd64 && sudo reboot   # or your system's PREEMPT_RT kernel";

/// How a kernel lets a thread go before what it does itself.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Preemption {
    Realtime,
    Full,
    /// One of the kernel's other words.
    Less(String),
    Unknown,
}

pub fn preemption(machine: &Machine) -> Finding {
    const CHECK: &str = "preemption";
    let release = machine.text("/proc/sys/kernel/osrelease").unwrap_or_else(|| "unknown release".to_owned());
    match preemption_of(machine) {
        Preemption::Realtime => Finding::pass(CHECK, format!("kernel {release}, PREEMPT_RT")),
        Preemption::Full => {
            let found = format!(
                "kernel {release} preempts itself, but is no PREEMPT_RT: rare waits of milliseconds stay"
            );
            Finding::warn(CHECK, found, REALTIME)
        }
        Preemption::Less(model) => {
            let found = format!(
                "kernel {release} preempts itself as `{model}`: wake-ups wait for system calls of others"
            );
            Finding::warn(CHECK, found, FULL)
        }
        Preemption::Unknown => Finding::warn(
            CHECK,
            format!("kernel {release} does not say how it preempts itself to this user"),
            FULL,
        ),
    }
}

fn preemption_of(machine: &Machine) -> Preemption {
    let version = machine.text("/proc/version").unwrap_or_default();
    let has = |word: &str| version.split_whitespace().any(|part| part == word);
    if machine.text("/sys/kernel/realtime").as_deref() == Some("1") || has("PREEMPT_RT") {
        return Preemption::Realtime;
    }
    let named = |model: &str| match model {
        "full" => Preemption::Full,
        other => Preemption::Less(other.to_owned()),
    };
    // The model in force stands in parentheses: `none voluntary (full) lazy`.
    let chosen = machine.text("/sys/kernel/debug/sched/preempt");
    let chosen = chosen.as_deref().and_then(|text| Some(text.split_once('(')?.1.split_once(')')?.0));
    let command_line = machine.text("/proc/cmdline").unwrap_or_default();
    let asked = command_line.split_whitespace().rev().find_map(|word| word.strip_prefix("preempt="));
    match chosen.or(asked) {
        Some(model) => named(model),
        None if has("PREEMPT_DYNAMIC") => Preemption::Unknown,
        None if has("PREEMPT") => Preemption::Full,
        None if version.is_empty() => Preemption::Unknown,
        None => Preemption::Less("none or voluntary".to_owned()),
    }
}

pub fn clock_source(machine: &Machine) -> Finding {
    const CHECK: &str = "clock source";
    const DIRECTORY: &str = "/sys/devices/system/clocksource/clocksource0";
    /// Read without a system call, in tens of nanoseconds.
    const FAST: [&str; 4] = ["tsc", "kvm-clock", "hyperv_clocksource_tsc_page", "arch_sys_counter"];
    let Some(current) = machine.text(&format!("{DIRECTORY}/current_clocksource")) else {
        return Finding::warn(
            CHECK,
            "the kernel does not name it",
            format!("cat {DIRECTORY}/current_clocksource"),
        );
    };
    if FAST.contains(&current.as_str()) {
        return Finding::pass(CHECK, format!("{current}, read without a system call"));
    }
    let available = machine.text(&format!("{DIRECTORY}/available_clocksource")).unwrap_or_default();
    let better = available.split_whitespace().find(|name| FAST.contains(name));
    let found = format!("{current}: each reading takes a microsecond or more, and a cycle takes several");
    match better {
        Some(better) => {
            Finding::warn(CHECK, found, format!("echo {better} | sudo tee {DIRECTORY}/current_clocksource"))
        }
        None => Finding::fail(
            CHECK,
            format!("{found}; no better one is offered ({available})"),
            "dmesg | grep -i tsc   # tells why; often tsc=reliable on the kernel's command line of a machine whose TSC is sound",
        ),
    }
}

pub fn throttling(machine: &Machine) -> Finding {
    const CHECK: &str = "throttling";
    const MEND: &str = "sudo sysctl -w kernel.sched_rt_runtime_us=950000";
    let runtime = machine.number("/proc/sys/kernel/sched_rt_runtime_us");
    let period = machine.number("/proc/sys/kernel/sched_rt_period_us").filter(|period| *period > 0);
    match (runtime, period) {
        (Some(-1), _) => Finding::pass(
            CHECK,
            "real-time threads are not throttled: one that never sleeps takes its CPU for good",
        ),
        (Some(0), _) => Finding::fail(CHECK, "real-time threads get no time at all", MEND),
        (Some(runtime), Some(period)) => {
            let share = 100.0 * runtime as f64 / period as f64;
            let found = format!("real-time threads get {share:.0} % of each {} ms", period / 1_000);
            // A loop at its limit of lateness uses half of its CPU.
            if share >= 90.0 { Finding::pass(CHECK, found) } else { Finding::warn(CHECK, found, MEND) }
        }
        _ => Finding::pass(CHECK, "this kernel has no limit for real-time threads"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Level;
    use super::super::fixture::{Files, machine};
    use super::{clock_source, preemption, throttling};

    const VERSION: &str = "/proc/version";
    const DYNAMIC: &str = "Linux version 6.18.44 (a@b) (gcc 14) #1 SMP PREEMPT_DYNAMIC @0";
    const DEBUG: &str = "/sys/kernel/debug/sched/preempt";

    #[test]
    fn preemption_is_judged_by_what_is_in_force() {
        let cases: [(Files<'_>, Level, &str); 10] = [
            (
                &[("/sys/kernel/realtime", "1"), (VERSION, "Linux 5.10 SMP PREEMPT")],
                Level::Pass,
                "PREEMPT_RT",
            ),
            (&[(VERSION, "Linux version 6.12 #1 SMP PREEMPT_RT Debian")], Level::Pass, "PREEMPT_RT"),
            (&[(VERSION, DYNAMIC), (DEBUG, "none voluntary (full) lazy")], Level::Warn, "no PREEMPT_RT"),
            (&[(VERSION, DYNAMIC), (DEBUG, "none (voluntary) full")], Level::Warn, "`voluntary`"),
            (&[(VERSION, DYNAMIC), ("/proc/cmdline", "ro preempt=full quiet")], Level::Warn, "no PREEMPT_RT"),
            (
                &[(VERSION, DYNAMIC), ("/proc/cmdline", "preempt=full"), (DEBUG, "(none) full")],
                Level::Warn,
                "`none`",
            ),
            (&[(VERSION, DYNAMIC)], Level::Warn, "does not say"),
            (&[(VERSION, "Linux version 5.10 #1 SMP PREEMPT")], Level::Warn, "no PREEMPT_RT"),
            (&[(VERSION, "Linux version 5.10 #1 SMP")], Level::Warn, "none or voluntary"),
            (&[], Level::Warn, "does not say"),
        ];
        for (files, level, part) in cases {
            let fixture = machine(files);
            let found = preemption(&fixture.machine);
            assert_eq!(found.level, level, "{files:?}: {found}");
            assert!(found.found.contains(part), "{files:?}: {found}");
            assert_eq!(found.mend.is_some(), level != Level::Pass, "{found}");
        }
    }

    #[test]
    fn clock_source_is_judged_by_its_cost_and_a_better_one_named() {
        let current = "/sys/devices/system/clocksource/clocksource0/current_clocksource";
        let available = "/sys/devices/system/clocksource/clocksource0/available_clocksource";
        let cases: [(Files<'_>, Level, &str); 5] = [
            (&[(current, "tsc")], Level::Pass, ""),
            (&[(current, "kvm-clock")], Level::Pass, ""),
            (&[(current, "hpet"), (available, "hpet tsc acpi_pm")], Level::Warn, "echo tsc | sudo tee"),
            (&[(current, "acpi_pm"), (available, "acpi_pm")], Level::Fail, "dmesg"),
            (&[], Level::Warn, "cat "),
        ];
        for (files, level, mend) in cases {
            let fixture = machine(files);
            let found = clock_source(&fixture.machine);
            assert_eq!(found.level, level, "{files:?}: {found}");
            assert!(found.mend.unwrap_or_default().contains(mend), "{files:?}");
        }
    }

    #[test]
    fn throttling_fails_where_no_time_is_left_and_warns_where_little_is() {
        let cases = [
            (Some("-1"), Level::Pass),
            (Some("950000"), Level::Pass),
            (Some("500000"), Level::Warn),
            (Some("0"), Level::Fail),
            (None, Level::Pass),
        ];
        for (runtime, level) in cases {
            let mut files = vec![("/proc/sys/kernel/sched_rt_period_us", "1000000")];
            files.extend(runtime.map(|runtime| ("/proc/sys/kernel/sched_rt_runtime_us", runtime)));
            let fixture = machine(&files);
            assert_eq!(throttling(&fixture.machine).level, level, "{runtime:?}");
        }
    }
}
