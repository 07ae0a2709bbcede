//! What the CPUs are left to do besides: isolation, clock frequency, time taken by the host.

use magsteer::daemon::DaemonConfig;

use super::finding::Finding;
use super::machine::Machine;

const CPU: &str = "/sys/devices/system/cpu";

pub fn isolation(machine: &Machine, daemon: Option<&DaemonConfig>) -> Finding {
    const CHECK: &str = "isolated CPUs";
    let online = machine.cpus(&format!("{CPU}/online"));
    let isolated = machine.cpus(&format!("{CPU}/isolated"));
    let Some(last) = online.last().copied().filter(|_| online.len() > 1) else {
        let found = "one CPU: loop, driver and everything else share it";
        return Finding::warn(CHECK, found, "give the machine a second CPU; no command does");
    };
    // Of a machine with more than one CPU the last is the least busy: CPU 0 takes what is bound to none.
    let cpu = daemon.and_then(|daemon| daemon.cpu).unwrap_or(last);
    let mend = format!(
        "sudo sed -i 's/^GRUB_CMDLINE_LINUX=\"/&isolcpus={cpu} nohz_full={cpu} rcu_nocbs={cpu} /' /etc/default/grub \
         && sudo update-grub && sudo reboot   # then `cpu = {cpu}` in [daemon]"
    );
    match (isolated.is_empty(), daemon.and_then(|daemon| daemon.cpu)) {
        (true, _) => Finding::warn(
            CHECK,
            format!("none of {}: other programs run on the loop's CPU", online.len()),
            mend,
        ),
        (false, Some(cpu)) if !isolated.contains(&cpu) => {
            Finding::warn(CHECK, format!("CPU {}, but not the loop's, CPU {cpu}", list(&isolated)), mend)
        }
        (false, _) => Finding::pass(CHECK, format!("CPU {} of {}", list(&isolated), online.len())),
    }
}

/// A loop's CPU that there is.
pub fn configured_cpu(machine: &Machine, daemon: &DaemonConfig) -> Finding {
    const CHECK: &str = "loop's CPU";
    let online = machine.cpus(&format!("{CPU}/online"));
    match daemon.cpu {
        Some(cpu) if online.contains(&cpu) => Finding::pass(CHECK, format!("CPU {cpu}")),
        Some(cpu) => {
            let found = format!("CPU {cpu} is not online; CPU {} are", list(&online));
            Finding::fail(
                CHECK,
                found,
                format!("echo 1 | sudo tee {CPU}/cpu{cpu}/online   # or name another in [daemon] cpu"),
            )
        }
        None => {
            let best = machine.cpus(&format!("{CPU}/isolated")).first().copied().or(online.last().copied());
            let found = "[daemon] names none: the kernel moves the loop about, which costs it its caches";
            Finding::warn(CHECK, found, format!("put `cpu = {}` into [daemon]", best.unwrap_or(0)))
        }
    }
}

pub fn governor(machine: &Machine) -> Finding {
    const CHECK: &str = "governor";
    let mut slow = Vec::new();
    let mut count = 0;
    for cpu in machine.names(CPU, "cpu") {
        let Some(governor) = machine.text(&format!("{CPU}/{cpu}/cpufreq/scaling_governor")) else { continue };
        count += 1;
        if governor != "performance" {
            slow.push(format!("{cpu} {governor}"));
        }
    }
    if slow.is_empty() {
        let found =
            if count == 0 { "the kernel sets no clock frequencies" } else { "performance on every CPU" };
        return Finding::pass(CHECK, found);
    }
    let found = format!("{}: a CPU that idles between cycles runs them slowly", slow.join(", "));
    Finding::warn(CHECK, found, format!("echo performance | sudo tee {CPU}/cpu*/cpufreq/scaling_governor"))
}

/// How long a CPU may take to wake from its deepest idling.
pub fn idling(machine: &Machine, daemon: Option<&DaemonConfig>) -> Finding {
    const CHECK: &str = "idling";
    if let Some(bound) = daemon.and_then(|daemon| daemon.idle_latency_us) {
        return Finding::pass(CHECK, format!("[daemon] keeps it to {bound} us while it runs"));
    }
    let directory = format!("{CPU}/cpu0/cpuidle");
    let enabled = |state: &String| machine.number(&format!("{directory}/{state}/disable")) != Some(1);
    let states = machine.names(&directory, "state").into_iter().filter(enabled);
    let deepest = states.filter_map(|state| machine.number(&format!("{directory}/{state}/latency"))).max();
    match deepest {
        None => Finding::pass(CHECK, "the kernel has no idle states that take time to leave"),
        Some(latency) => {
            let shared =
                machine.text(&format!("{CPU}/cpuidle/current_driver")).is_some_and(|name| name == "haltpoll");
            let found = format!("the deepest state takes {latency} us to leave");
            // A guest that halts is woken by its host, which the kernel's number does not know of.
            if latency <= 2 && !shared {
                return Finding::pass(CHECK, found);
            }
            let host = if shared { ", and then as long as the host takes" } else { "" };
            Finding::warn(CHECK, format!("{found}{host}"), "put `idle_latency_us = 0` into [daemon]")
        }
    }
}

/// Time that a hypervisor took, of all time, in the kernel's ticks since its start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stolen {
    stolen: u64,
    all: u64,
}

impl Stolen {
    /// From the first line of `/proc/stat`; `None` where the kernel does not tell.
    pub fn read(machine: &Machine) -> Option<Self> {
        let text = machine.text("/proc/stat")?;
        let line = text.lines().find(|line| line.starts_with("cpu "))?;
        let ticks: Vec<u64> = line.split_whitespace().skip(1).map_while(|word| word.parse().ok()).collect();
        // user, nice, system, idle, iowait, irq, softirq, steal; guests' time is contained in user's.
        let used = ticks.get(..8)?;
        Some(Self { stolen: used[7], all: used.iter().sum() })
    }

    /// Share of the time since `earlier`, percent; 0 when none passed.
    pub fn percent_since(&self, earlier: &Self) -> f64 {
        let all = self.all.saturating_sub(earlier.all);
        let stolen = self.stolen.saturating_sub(earlier.stolen);
        if all == 0 { 0.0 } else { 100.0 * stolen as f64 / all as f64 }
    }
}

/// `percent` of the machine's time taken by its host while wake-ups were measured.
pub fn steal(percent: Option<f64>) -> Finding {
    const CHECK: &str = "steal time";
    const MEND: &str = "virsh vcpupin DOMAIN VCPU CPU   # on the host: a CPU of its own for each of this machine's; nothing here helps";
    match percent {
        None => Finding::pass(CHECK, "the kernel does not tell"),
        Some(percent) if percent < 0.5 => Finding::pass(CHECK, format!("{percent:.1} % taken by a host")),
        Some(percent) => {
            let found = format!("{percent:.1} % taken by the host: wake-ups wait for it, by milliseconds");
            Finding::graded(CHECK, percent >= 10.0, found, MEND)
        }
    }
}

fn list(cpus: &[u32]) -> String {
    cpus.iter().map(u32::to_string).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::super::consequences::tests::daemon;
    use super::super::finding::Level;
    use super::super::fixture::{Files, machine};
    use super::{Stolen, configured_cpu, governor, idling, isolation, steal};

    const ONLINE: &str = "/sys/devices/system/cpu/online";
    const ISOLATED: &str = "/sys/devices/system/cpu/isolated";

    #[test]
    fn isolation_is_judged_by_the_loops_cpu() {
        let cases: [(Files<'_>, Option<u32>, Level, &str); 6] = [
            (&[(ONLINE, "0")], None, Level::Warn, "second CPU"),
            (&[(ONLINE, "0-3"), (ISOLATED, "")], None, Level::Warn, "isolcpus=3 "),
            (&[(ONLINE, "0-3"), (ISOLATED, "")], Some(2), Level::Warn, "isolcpus=2 "),
            (&[(ONLINE, "0-3"), (ISOLATED, "3")], Some(2), Level::Warn, "isolcpus=2 "),
            (&[(ONLINE, "0-3"), (ISOLATED, "2-3")], Some(2), Level::Pass, ""),
            (&[(ONLINE, "0-3"), (ISOLATED, "2-3")], None, Level::Pass, ""),
        ];
        for (files, cpu, level, mend) in cases {
            let fixture = machine(files);
            let mut config = daemon();
            config.cpu = cpu;
            let found = isolation(&fixture.machine, Some(&config));
            assert_eq!(found.level, level, "{files:?} {cpu:?}: {found}");
            assert!(found.mend.unwrap_or_default().contains(mend), "{files:?} {cpu:?}");
        }
    }

    #[test]
    fn a_cpu_that_is_not_there_fails_and_none_warns() {
        let fixture = machine(&[(ONLINE, "0-1,3"), (ISOLATED, "3")]);
        let mut config = daemon();
        for (cpu, level) in [(Some(1), Level::Pass), (Some(2), Level::Fail), (None, Level::Warn)] {
            config.cpu = cpu;
            let found = configured_cpu(&fixture.machine, &config);
            assert_eq!(found.level, level, "{found}");
            if level == Level::Warn {
                assert!(found.mend.expect("a warning").contains("cpu = 3"), "the isolated one");
            }
        }
    }

    #[test]
    fn governors_other_than_performance_are_named_by_cpu() {
        let path = |cpu: u32| format!("/sys/devices/system/cpu/cpu{cpu}/cpufreq/scaling_governor");
        let (first, second) = (path(0), path(1));
        assert_eq!(governor(&machine(&[(ONLINE, "0-1")]).machine).level, Level::Pass);
        let fast = machine(&[(&first, "performance"), (&second, "performance")]);
        assert_eq!(governor(&fast.machine).level, Level::Pass);
        let slow = machine(&[(&first, "performance"), (&second, "powersave")]);
        let found = governor(&slow.machine);
        assert_eq!(found.level, Level::Warn);
        assert!(found.found.starts_with("cpu1 powersave"), "{found}");
    }

    #[test]
    fn idling_is_judged_by_the_deepest_state_in_use() {
        let at = |state: u32, name: &str| format!("/sys/devices/system/cpu/cpu0/cpuidle/state{state}/{name}");
        let (shallow, deep, disable) = (at(0, "latency"), at(1, "latency"), at(1, "disable"));
        let driver = "/sys/devices/system/cpu/cpuidle/current_driver";
        let cases: [(Files<'_>, Level); 5] = [
            (&[], Level::Pass),
            (&[(&shallow, "0"), (&deep, "1")], Level::Pass),
            (&[(&shallow, "0"), (&deep, "133")], Level::Warn),
            (&[(&shallow, "0"), (&deep, "133"), (&disable, "1")], Level::Pass),
            (&[(&shallow, "0"), (&deep, "1"), (driver, "haltpoll")], Level::Warn),
        ];
        let mut config = daemon();
        for (files, level) in cases {
            let fixture = machine(files);
            assert_eq!(idling(&fixture.machine, None).level, level, "{files:?}");
            config.idle_latency_us = None;
            assert_eq!(idling(&fixture.machine, Some(&config)).level, level, "{files:?}");
            config.idle_latency_us = Some(0);
            assert_eq!(idling(&fixture.machine, Some(&config)).level, Level::Pass, "{files:?}");
        }
    }

    #[test]
    fn stolen_time_is_a_share_of_all_time_between_two_readings() {
        let read = |text: &str| Stolen::read(&machine(&[("/proc/stat", text)]).machine);
        let before = read("cpu  100 0 50 800 0 0 0 50 7 7\ncpu0 1 2 3").expect("eight numbers");
        let after = read("cpu  150 0 60 1710 0 0 0 80 7 7").expect("eight numbers");
        assert!((after.percent_since(&before) - 3.0).abs() < 1e-12);
        assert_eq!(before.percent_since(&before), 0.0);
        for nothing in ["", "cpu 1 2 3", "intr 5"] {
            assert_eq!(read(nothing), None, "{nothing}");
        }
        let levels = [None, Some(0.1), Some(3.0), Some(12.0)].map(|percent| steal(percent).level);
        assert_eq!(levels, [Level::Pass, Level::Pass, Level::Warn, Level::Fail]);
    }
}
