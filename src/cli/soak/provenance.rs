//! The machine on which a soak was measured.

use magsteer::daemon::DaemonConfig;
use serde::Serialize;

use crate::cli::doctor::{Finding, Machine, of_machine};

/// What timing depends on and a configuration does not say.
#[derive(Debug, Serialize)]
pub struct Provenance {
    pub program: &'static str,
    /// Profile that it was built with.
    pub profile: &'static str,
    pub config_sha256: String,
    pub kernel: Option<String>,
    pub cpu_model: Option<String>,
    pub cpus: usize,
    /// What `doctor` finds.
    pub findings: Vec<Finding>,
}

impl Provenance {
    pub fn of(machine: &Machine, daemon: Option<&DaemonConfig>, config_sha256: String) -> Self {
        let cpus = machine.text("/proc/cpuinfo").unwrap_or_default();
        Self {
            program: concat!("magsteer ", env!("CARGO_PKG_VERSION")),
            profile: if cfg!(debug_assertions) { "dev" } else { "release" },
            config_sha256,
            kernel: machine.text("/proc/version"),
            cpu_model: value_of(&cpus, "model name"),
            cpus: cpus.lines().filter(|line| line.starts_with("processor")).count(),
            findings: of_machine(machine, daemon),
        }
    }
}

/// The value on the first line `key : value`.
fn value_of(text: &str, key: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with(key))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::{Machine, Provenance, value_of};

    #[test]
    fn the_processors_name_is_read_from_the_first_line_that_has_it() {
        let text = "processor\t: 0\nmodel name\t: A: fast one\nprocessor\t: 1\nmodel name\t: another\n";
        assert_eq!(value_of(text, "model name").as_deref(), Some("A: fast one"));
        assert_eq!(value_of(text, "bogomips"), None);
    }

    #[test]
    fn this_machine_has_a_kernel_and_is_looked_at_as_doctor_does() {
        let found = Provenance::of(&Machine::this(), None, "abc".to_owned());
        assert!(found.kernel.is_some_and(|kernel| kernel.starts_with("Linux")));
        assert!(found.cpus > 0 && found.findings.iter().any(|finding| finding.check == "preemption"));
    }
}
