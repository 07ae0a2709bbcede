//! The command line of `magsteer doctor`, and what it prints.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use magsteer::config::Config;
use magsteer::daemon::DaemonConfig;
use magsteer_hal::channels::{Endpoint, Leftovers};
use serde::Serialize;

use super::super::exit::{Exit, Failure};
use super::super::output;
use super::super::rig_file::{RootArgs, channel_failure};
use super::finding::{Finding, Level};
use super::machine::Machine;
use super::processors::Stolen;
use super::wake_up::{self, Trial, WakeUps};
use super::{consequences, kernel, limits, processors, services};

/// Stands where channels are not asked for by a rig.
const NO_RIG: &str = "doctor";
/// Private roots of killed demonstrations are looked for under this name.
const DEMONSTRATIONS: &str = "magsteer-demo";

/// Tell whether this machine is fit for a control loop, and what mends it.
///
/// Looks at kernel, CPUs, rights, memory and channels, and measures wake-ups at the configured rate. Makes
/// the root directory where it is missing; changes nothing else but what `--clean` clears away. Ends with 0, or with 1 when a line says FAIL.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  magsteer doctor config/bigmag-planar.toml\n  magsteer doctor --seconds 60 --json\n  \
    magsteer doctor --clean"
)]
pub struct Doctor {
    /// Configuration whose [daemon] is looked at too, and whose rate is measured.
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// How long to measure wake-ups, s; 0 not at all.
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    seconds: f64,
    /// Clear away what dead processes left under the root, and only that.
    #[arg(long)]
    clean: bool,
    #[command(flatten)]
    root: RootArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `ok`, `findings` (each with `check`, `level`, `found`, `mend`), `wake_ups` and
/// `cleared`.
#[derive(Serialize)]
struct Answer<'a> {
    ok: bool,
    findings: &'a [Finding],
    /// Null where none were measured.
    wake_ups: Option<&'a WakeUps>,
    /// Null without `--clean`.
    cleared: Option<ClearedAnswer>,
}

#[derive(Serialize)]
struct ClearedAnswer {
    /// Dead processes whose shared memory is gone; 0 where one is not told.
    processes: Vec<u32>,
    lock_files: Vec<PathBuf>,
    roots: Vec<PathBuf>,
    failed: Vec<String>,
}

impl Doctor {
    pub fn run(&self) -> anyhow::Result<Exit> {
        let duration = Duration::try_from_secs_f64(self.seconds)
            .map_err(|error| Failure::usage(format_args!("--seconds: {error}")))?;
        let daemon = self.daemon()?;
        let endpoint = self.root.endpoint(NO_RIG)?;
        let machine = Machine::this();
        let mut findings = of_machine(&machine, daemon.as_ref());
        let cleared = self.services(&endpoint, &mut findings)?;
        let stolen = Stolen::read(&machine);
        let trial = Trial::of(daemon.as_ref(), duration);
        let measured = if duration.is_zero() { None } else { Some(wake_up::measure(&trial)?) };
        if let Some(measured) = &measured {
            let percent = stolen.and_then(|before| Some(Stolen::read(&machine)?.percent_since(&before)));
            findings.push(processors::steal(percent));
            findings.push(wake_up::judge(measured, daemon.as_ref()));
        }
        let ok = findings.iter().all(|finding| finding.level < Level::Fail);
        if self.json {
            output::json(&Answer { ok, findings: &findings, wake_ups: measured.as_ref(), cleared })?;
        } else {
            output::result(text(&findings, measured.as_ref()))?;
        }
        Ok(if ok { Exit::Success } else { Exit::No })
    }

    /// The daemon's table of the file, where one is named.
    fn daemon(&self) -> anyhow::Result<Option<DaemonConfig>> {
        let Some(file) = &self.file else { return Ok(None) };
        let (document, config) = Config::load(file)?;
        Ok(Some(document.require("daemon", &config.daemon)?.clone()))
    }

    /// Clears away where asked to, then tells what is there.
    fn services(
        &self,
        endpoint: &Endpoint,
        findings: &mut Vec<Finding>,
    ) -> anyhow::Result<Option<ClearedAnswer>> {
        let cleared = if self.clean {
            Some(Leftovers::clear(endpoint, DEMONSTRATIONS).map_err(channel_failure)?)
        } else {
            None
        };
        findings.extend(cleared.as_ref().map(services::cleared));
        let found = Leftovers::find(endpoint, DEMONSTRATIONS).map_err(channel_failure)?;
        findings.push(services::leftovers(&found));
        findings.extend(services::daemons(&found));
        Ok(cleared.map(|cleared| ClearedAnswer {
            processes: cleared.dead,
            lock_files: cleared.stale_locks,
            roots: cleared.abandoned_roots,
            failed: cleared.failed,
        }))
    }
}

/// Everything that files tell, without the channels.
pub fn of_machine(machine: &Machine, daemon: Option<&DaemonConfig>) -> Vec<Finding> {
    let mut findings = vec![
        kernel::preemption(machine),
        kernel::clock_source(machine),
        kernel::throttling(machine),
        processors::isolation(machine, daemon),
        processors::governor(machine),
        processors::idling(machine, daemon),
        limits::priority(machine, daemon),
        limits::locked_memory(machine, daemon),
        limits::swap(machine),
        limits::shared_memory(limits::shared_memory_space()),
    ];
    if let Some(daemon) = daemon {
        findings.push(processors::configured_cpu(machine, daemon));
        findings.extend(consequences::of(daemon));
    }
    findings
}

fn text(findings: &[Finding], measured: Option<&WakeUps>) -> String {
    let mut text: String = findings.iter().map(|finding| format!("{finding}\n")).collect();
    if let Some(measured) = measured {
        text += &format!("      measured with {}\n{}", measured.realtime, wake_up::picture(measured));
    }
    let count = |level: Level| findings.iter().filter(|finding| finding.level == level).count();
    text + &format!("{} FAIL, {} WARN, {} PASS\n", count(Level::Fail), count(Level::Warn), count(Level::Pass))
}

#[cfg(test)]
mod tests {
    use super::super::consequences::tests::daemon;
    use super::super::fixture::machine;
    use super::{Finding, Level, of_machine, text};

    #[test]
    fn a_machine_that_tells_nothing_is_looked_at_to_the_end() {
        let fixture = machine(&[]);
        for daemon in [None, Some(&daemon())] {
            let findings = of_machine(&fixture.machine, daemon);
            assert_eq!(findings.len(), if daemon.is_some() { 15 } else { 10 });
            for finding in &findings {
                assert_eq!(finding.mend.is_some(), finding.level != Level::Pass, "{finding}");
            }
        }
    }

    #[test]
    fn every_line_names_its_level_and_what_mends_it_and_the_last_counts() {
        let findings = [
            Finding::pass("a", "fine"),
            Finding::warn("b", "meh", "do x"),
            Finding::fail("c", "bad", "do y"),
        ];
        let lines: Vec<String> = text(&findings, None).lines().map(str::to_owned).collect();
        assert_eq!(lines.len(), 6);
        assert!(lines[0].starts_with("PASS  a") && lines[1].starts_with("WARN  b"), "{lines:?}");
        assert!(lines[2].ends_with("-> do x") && lines[4].ends_with("-> do y"), "{lines:?}");
        assert_eq!(lines[5], "1 FAIL, 1 WARN, 1 PASS");
    }
}
