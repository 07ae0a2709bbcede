//! What the values of `[daemon]` mean on any machine.

use magsteer::daemon::{DaemonConfig, RealtimePolicy};

use super::finding::Finding;

/// Kernel threads that keep CPUs together run at this priority.
const KERNELS_OWN: u32 = 99;

/// One line for each choice that has a price, and one on the pauses that the time limits ride through.
pub fn of(daemon: &DaemonConfig) -> Vec<Finding> {
    vec![policy(daemon), loop_priority(daemon), spin(daemon), pauses(daemon)]
}

fn policy(daemon: &DaemonConfig) -> Finding {
    const CHECK: &str = "policy";
    match daemon.realtime {
        RealtimePolicy::Enforce => {
            Finding::pass(CHECK, "enforce: the daemon refuses to arm without real time")
        }
        RealtimePolicy::BestEffort => {
            let found = "best-effort: the daemon arms without real time, and says so once";
            Finding::warn(CHECK, found, "put `realtime = \"enforce\"` into [daemon]")
        }
    }
}

fn loop_priority(daemon: &DaemonConfig) -> Finding {
    const CHECK: &str = "loop's priority";
    let found = format!("{} under SCHED_FIFO", daemon.priority);
    if daemon.priority < KERNELS_OWN {
        return Finding::pass(CHECK, found);
    }
    let found = format!("{found}: a loop that hangs also stops the kernel's own threads of that priority");
    Finding::warn(CHECK, found, "put `priority = 80` into [daemon]")
}

fn spin(daemon: &DaemonConfig) -> Finding {
    const CHECK: &str = "spin";
    if daemon.spin_us == 0.0 {
        return Finding::pass(CHECK, "off");
    }
    let share = daemon.spin_us * 1e-4 * daemon.rate_hz;
    let found = format!("{} us before each deadline: {share:.0} % of the loop's CPU", daemon.spin_us);
    if share <= 25.0 {
        return Finding::pass(CHECK, found);
    }
    Finding::warn(CHECK, found, format!("put `spin_us = {:.0}` into [daemon]", 250_000.0 / daemon.rate_hz))
}

fn pauses(daemon: &DaemonConfig) -> Finding {
    let DaemonConfig { pose_hold_ms, pose_stop_ms, command_validity_ms, overrun_fraction, .. } = daemon;
    let window = daemon.overrun_window_ms;
    Finding::pass(
        "time limits",
        format!(
            "a pause of the loop above {command_validity_ms} ms makes the driver ramp to zero; missing {:.0} % of the \
             periods over {window} ms ramps down; poses older than {pose_hold_ms} ms hold the currents, than \
             {pose_stop_ms} ms ramp down",
            100.0 * overrun_fraction,
        ),
    )
}

#[cfg(test)]
pub mod tests {
    use magsteer::daemon::{DaemonConfig, RealtimePolicy};

    use super::super::finding::Level;
    use super::of;

    /// The values of the shipped file.
    pub fn daemon() -> DaemonConfig {
        let file: toml::Table = include_str!("../../../config/bigmag-planar.toml").parse().expect("shipped");
        file["daemon"].clone().try_into().expect("shipped")
    }

    #[test]
    fn choices_that_have_a_price_warn_and_name_the_edit() {
        type Edit = fn(&mut DaemonConfig);
        let cases: [(Edit, &str, Level); 6] = [
            (|_| (), "policy", Level::Warn),
            (|daemon| daemon.realtime = RealtimePolicy::Enforce, "policy", Level::Pass),
            (|daemon| daemon.priority = 98, "loop's priority", Level::Pass),
            (|daemon| daemon.priority = 99, "loop's priority", Level::Warn),
            (|daemon| daemon.spin_us = 200.0, "spin", Level::Pass),
            (|daemon| (daemon.spin_us, daemon.rate_hz) = (40.0, 10_000.0), "spin", Level::Warn),
        ];
        for (edit, check, level) in cases {
            let mut config = daemon();
            edit(&mut config);
            let findings = of(&config);
            let found = findings.iter().find(|finding| finding.check == check).expect("looked at");
            assert_eq!(found.level, level, "{found}");
            assert_eq!(found.mend.is_some(), level == Level::Warn, "{found}");
        }
    }

    #[test]
    fn the_edit_that_a_spin_warning_names_is_taken_and_ends_it() {
        let mut config = daemon();
        (config.spin_us, config.rate_hz) = (40.0, 10_000.0);
        config.spin_us = 250_000.0 / config.rate_hz;
        assert_eq!(config.check(), vec![]);
        assert!(
            of(&config).iter().filter(|finding| finding.check == "spin").all(|it| it.level == Level::Pass)
        );
    }
}
