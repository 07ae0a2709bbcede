//! `magsteer hal conformance`: whether a running driver keeps the contract.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use magsteer::config::Config;
use magsteer::daemon::StopFlag;
use magsteer_hal::conformance::{
    Ending, Finding, Level, RunningRig, StatedRates, Tolerances, Verdict, examine, junit,
};
use serde::Serialize;

use super::super::ending::{exit_of, watching};
use super::super::exit::cannot_create;
use super::super::exit::{Exit, Failure};
use super::super::output;
use super::super::rig_file::{RootArgs, channel_failure, keep_files_private};

/// How far to go.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum LevelArg {
    /// Listen, and send nothing.
    Static,
    /// Take authority, and command zero current alone.
    Dry,
    /// Drive a quarter of each coil's greatest current, and turn frames by 5 degrees.
    DummyLoad,
}

impl From<LevelArg> for Level {
    fn from(level: LevelArg) -> Self {
        match level {
            LevelArg::Static => Self::Static,
            LevelArg::Dry => Self::Dry,
            LevelArg::DummyLoad => Self::DummyLoad,
        }
    }
}

/// Check a running driver against the contract, in the daemon's place.
///
/// Ends with 0 when every check passes, 1 when one fails, 69 when no driver runs or a daemon has the rig.
/// SIGINT and SIGTERM end it early, currents at zero.
///
/// At level `dummy-load` currents flow and frames turn: take out the patient, the rod and your fingers, or
/// put resistors in place of the coils.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  magsteer sim-plant config/bigmag-planar.toml &\n  \
    magsteer hal conformance config/bigmag-planar.toml --level dummy-load --junit conformance.xml")]
pub struct Conformance {
    /// Configuration file (TOML) that the driver was started with.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// How far to go; each level includes those before it.
    #[arg(long, value_enum, default_value = "dry")]
    level: LevelArg,
    /// Rate at which the driver is to publish feedback; any steady one above 50 Hz when left out.
    #[arg(long, value_name = "HZ")]
    feedback_rate_hz: Option<f64>,
    /// Rate at which it is to publish poses; any steady one above 5 Hz when left out.
    #[arg(long, value_name = "HZ")]
    pose_rate_hz: Option<f64>,
    /// How far a measured current may lie off, as part of the coil's greatest.
    #[arg(long, value_name = "SHARE", default_value_t = 0.02)]
    current_tolerance: f64,
    /// How long currents may take to settle; five electrical time constants of the slowest coil when left
    /// out.
    #[arg(long, value_name = "MS")]
    settling_ms: Option<f64>,
    /// How long to wait for the driver to appear.
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    wait_s: f64,
    /// Write the findings as JUnit XML, too.
    #[arg(long, value_name = "OUT.xml")]
    junit: Option<PathBuf>,
    #[command(flatten)]
    root: RootArgs,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The stable keys are `passed`, `rig`, `level`, `counts`, `checks`, `ended_at_zero`, `interrupted` and
/// `elapsed_s`.
#[derive(Serialize)]
struct Answer<'a> {
    passed: bool,
    rig: &'a str,
    level: &'static str,
    counts: Counts,
    checks: Vec<Check<'a>>,
    /// False when current was left at the end.
    ended_at_zero: bool,
    interrupted: bool,
    elapsed_s: f64,
}

#[derive(Serialize)]
struct Counts {
    pass: usize,
    fail: usize,
    skip: usize,
}

#[derive(Serialize)]
struct Check<'a> {
    id: &'static str,
    level: &'static str,
    claim: &'static str,
    /// "pass", "fail" or "skip".
    verdict: &'static str,
    measured: &'a str,
    right: &'static str,
    elapsed_s: f64,
}

impl Counts {
    fn of(findings: &[Finding]) -> Self {
        let count = |wanted| findings.iter().filter(|finding| finding.verdict == wanted).count();
        Self { pass: count(Verdict::Kept), fail: count(Verdict::Broken), skip: count(Verdict::NotTried) }
    }
}

impl<'a> From<&'a Finding> for Check<'a> {
    fn from(finding: &'a Finding) -> Self {
        let facts = finding.clause.facts();
        Self {
            id: facts.id,
            level: facts.level.name(),
            claim: facts.claim,
            verdict: finding.verdict.name(),
            measured: &finding.measured,
            right: facts.right,
            elapsed_s: finding.elapsed_s,
        }
    }
}

impl Conformance {
    pub fn run(&self) -> anyhow::Result<Exit> {
        keep_files_private();
        let (_, config) = Config::load(&self.file)?;
        let endpoint = self.root.endpoint(&config.description.rig)?;
        let mut tolerances = Tolerances::of(&config.description);
        tolerances.current_share = positive("--current-tolerance", self.current_tolerance)?;
        if let Some(settling) = self.settling_ms {
            tolerances.settling = seconds("--settling-ms", settling / 1e3)?;
        }
        let rates = StatedRates { feedback_hz: self.feedback_rate_hz, pose_hz: self.pose_rate_hz };
        for (name, rate) in [("--feedback-rate-hz", rates.feedback_hz), ("--pose-rate-hz", rates.pose_hz)] {
            rate.map_or(Ok(1.0), |rate| positive(name, rate))?;
        }
        let wait = seconds("--wait-s", self.wait_s)?;
        let stop = Arc::new(StopFlag::new());
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        let ask = move || flag.store(true, Ordering::Relaxed);
        let start = Instant::now();
        let (findings, ending) = watching(&stop, false, ask, || {
            let description = config.description.clone();
            let mut rig = RunningRig::open(&endpoint, description, tolerances, rates, wait, interrupted)
                .map_err(channel_failure)?;
            let mut told = Ok(());
            let findings = examine(&mut rig, self.level.into(), |finding| {
                if !self.json && told.is_ok() {
                    told = output::result(line(finding));
                }
            });
            // Currents come first: a reader that went away is told of afterwards.
            let ending = rig.end();
            told?;
            anyhow::Ok((findings, ending))
        })??;
        self.conclude(&config.description.rig, &findings, ending, start.elapsed(), &stop)
    }

    fn conclude(
        &self,
        rig: &str,
        findings: &[Finding],
        ending: Ending,
        elapsed: Duration,
        stop: &StopFlag,
    ) -> anyhow::Result<Exit> {
        let counts = Counts::of(findings);
        let ended_at_zero = ending == Ending::AtZero;
        let interrupted = stop.requested().is_some();
        let passed = counts.fail == 0 && ended_at_zero && !interrupted;
        if let Some(path) = &self.junit {
            std::fs::write(path, junit(rig, findings)).map_err(|error| cannot_create(path, &error))?;
        }
        if self.json {
            output::json(&Answer {
                passed,
                rig,
                level: Level::from(self.level).name(),
                checks: findings.iter().map(Check::from).collect(),
                counts,
                ended_at_zero,
                interrupted,
                elapsed_s: elapsed.as_secs_f64(),
            })?;
        } else {
            let Counts { pass, fail, skip } = counts;
            let verdict = if passed { "conforms" } else { "does NOT conform" };
            let level = Level::from(self.level);
            output::result(format_args!(
                "\n{pass} passed, {fail} failed, {skip} not tried in {:.1} s: the driver of {rig} {verdict} at level {level}\n",
                elapsed.as_secs_f64()
            ))?;
        }
        if !ended_at_zero {
            output::error("current may still flow: the driver obeyed neither a release nor a disable order");
        }
        Ok(match (interrupted, passed) {
            (true, _) => exit_of(stop),
            (false, true) => Exit::Success,
            (false, false) => Exit::No,
        })
    }
}

/// One line for a kept check, three for a broken one.
fn line(finding: &Finding) -> String {
    let facts = finding.clause.facts();
    let first = format!(
        "{:<5}{:<10} {:<27} {}\n",
        finding.verdict.name(),
        facts.level.name(),
        facts.id,
        finding.measured
    );
    if finding.verdict == Verdict::Broken {
        format!("{first}{:16}{}\n{:16}right: {}\n", "", facts.claim, "", facts.right)
    } else {
        first
    }
}

fn positive(name: &str, value: f64) -> anyhow::Result<f64> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        Err(Failure::usage(format_args!("{name} {value}: must be finite and > 0")))
    }
}

fn seconds(name: &str, value: f64) -> anyhow::Result<Duration> {
    let usable = Duration::try_from_secs_f64(value).ok().filter(|duration| duration.as_secs() < 3600);
    usable.ok_or_else(|| Failure::usage(format_args!("{name}: must be >= 0 and below an hour")))
}
