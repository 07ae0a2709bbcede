//! Campaigns as a user runs them: the same rows bit for bit whatever the threads, resumed or not, killed or
//! not; refusals before the first run.
//!
//! The experiment here is short, so that a run takes a tenth of a second.
#![cfg(feature = "sim")]

mod short_experiment;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use short_experiment::SHORT_EXPERIMENT;
use tempfile::TempDir;

/// Bound on every wait, only so that a failure ends: nothing is judged by it.
const PATIENCE: Duration = Duration::from_secs(60);

const CAMPAIGN: &str = r#"
[campaign]
experiment = "short.toml"

[[campaign.draw]]
key = "plant.errors.modulus_relative"
uniform = { low = 0.02, high = 0.1 }

[[campaign.draw]]
key = "plant.rod.first_mode_damping_ratio"
choice = [0.2, 0.25]
"#;

/// A folder with a short experiment and a rig that plays it.
struct World {
    folder: TempDir,
}

impl World {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let world = Self { folder };
        fs::write(world.path("short.toml"), SHORT_EXPERIMENT).expect("written");
        world.write_rig("rig.toml", CAMPAIGN);
        world
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The shipped rig with another `[campaign]`.
    fn write_rig(&self, name: &str, campaign: &str) {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        fs::write(self.path(name), format!("extends = {shipped:?}\n{campaign}")).expect("written");
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.current_dir(self.folder.path()).arg("campaign").args(arguments);
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().expect("the program is there")
    }

    /// Runs what must end with 0 and prints one JSON object.
    fn answer(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", words(&output));
        serde_json::from_slice(&output.stdout).expect("one JSON object")
    }

    /// Runs what must end with `code`, and returns its message.
    fn refused(&self, arguments: &[&str], code: i32) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", words(&output));
        words(&output)
    }

    fn table(&self, folder: &str) -> String {
        fs::read_to_string(self.path(folder).join("runs.csv")).expect("a table")
    }

    /// Starts a campaign and waits until its table has so many rows.
    fn start(&self, folder: &str, rows: usize) -> Child {
        let arguments = ["rig.toml", "--runs", "100000", "--threads", "2", "--out", folder];
        let child = self.command(&arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn();
        let child = child.expect("the program is there");
        let begin = Instant::now();
        let lines = || fs::read_to_string(self.path(folder).join("runs.csv")).unwrap_or_default();
        while lines().matches('\n').count() < rows + 1 {
            assert!(begin.elapsed() < PATIENCE, "no {rows} rows");
            sleep(Duration::from_millis(10));
        }
        child
    }
}

fn words(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

fn signal(child: &Child, signal: Signal) {
    let pid = Pid::from_raw(i32::try_from(child.id()).expect("a process id")).expect("not zero");
    kill_process(pid, signal).expect("it still runs");
}

/// Goal: one thread and three give the same table, byte for byte, in the order of the runs; a run by itself
/// equals its row; another seed gives another table.
#[test]
fn rows_depend_on_neither_threads_nor_company() {
    let world = World::new();
    let answer = world.answer(&["rig.toml", "--runs", "5", "--threads", "1", "--out", "one", "--json"]);
    world.answer(&["rig.toml", "--runs", "5", "--threads", "3", "--out", "three", "--json"]);
    assert_eq!(world.table("one"), world.table("three"));
    let runs: Vec<String> =
        world.table("one").lines().skip(1).map(|line| line.split(',').next().unwrap().to_owned()).collect();
    assert_eq!(runs, ["0", "1", "2", "3", "4"]);
    assert_eq!(answer["runs"], 5);

    let replay = world.answer(&["rig.toml", "--only", "3", "--out", "one", "--json"]);
    assert_eq!(replay["equal"], true);
    assert_eq!(replay["digest"], replay["recorded_digest"]);
    assert!(world.table("one").contains(replay["digest"].as_str().unwrap()));
    let alone = world.answer(&["rig.toml", "--only", "3", "--json"]);
    assert_eq!((&alone["digest"], &alone["equal"]), (&replay["digest"], &Value::Null));

    let other = world.answer(&["rig.toml", "--only", "3", "--seed", "2", "--json"]);
    assert_ne!(other["digest"], replay["digest"]);
    assert_ne!(other["drawn"], replay["drawn"]);
}

/// Goal: the keys that other programs read, with values that agree with the table.
#[test]
fn answer_has_the_stable_keys_and_agrees_with_the_table() {
    let world = World::new();
    let answer = world.answer(&["rig.toml", "--runs", "3", "--out", "some", "--json"]);
    let summary: Value = serde_json::from_slice(&fs::read(world.path("some/summary.json")).unwrap()).unwrap();
    let table = world.table("some");
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = |name: &str| {
        let index = header.iter().position(|column| *column == name).unwrap_or_else(|| panic!("{name}"));
        table.lines().skip(1).map(move |line| line.split(',').nth(index).unwrap().to_owned())
    };
    let settled = column("settled").filter(|settled| settled == "1").count();
    let times: Vec<f64> = (1..=2)
        .flat_map(|step| column(&format!("settle_{step}_s")).collect::<Vec<_>>())
        .filter_map(|time| time.parse().ok())
        .collect();
    for answer in [&answer, &summary] {
        assert_eq!(answer["runs"], 3);
        assert_eq!(answer["settled_fraction"], settled as f64 / 3.0);
        let [low, high] = [0, 1].map(|end| answer["settled_interval"][end].as_f64().unwrap());
        assert!(0.0 <= low && low <= settled as f64 / 3.0 && settled as f64 / 3.0 <= high && high <= 1.0);
        assert_eq!((&answer["limit_breaks"], &answer["unstable"]), (&0.into(), &0.into()));
        assert_eq!(answer["settle_s"]["max"], times.iter().copied().fold(0.0, f64::max));
        assert!(answer["settle_s"]["p50"].is_f64() && answer["settle_s"]["p95"].is_f64());
        // Each run simulates 1.1 s before its first step and 2.4 s of steps.
        let simulated = answer["elapsed_s"].as_f64().unwrap() * answer["real_time_factor"].as_f64().unwrap();
        assert!((simulated - 3.0 * 3.5).abs() < 1e-6, "{simulated}");
    }
    assert!(column("simulated_s").all(|simulated| simulated.parse::<f64>().unwrap() > 3.49));
    assert!(
        column("plant.errors.modulus_relative")
            .all(|modulus| { (0.02..0.1).contains(&modulus.parse::<f64>().unwrap()) })
    );
    if cfg!(all(feature = "figures", feature = "record")) {
        let files: Vec<&str> = answer["files"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
        let page = files.iter().find(|file| file.ends_with("report/report.html"));
        let page = fs::read_to_string(world.path(page.unwrap_or_else(|| panic!("{files:?}")))).unwrap();
        assert_eq!(page.matches("<figure").count(), 5);
    }
}

/// Goal: a campaign with identified parameters plays the plants of the rig that they were identified from, and its folder
/// alone is enough to play a run again.
#[test]
fn folder_holds_what_its_plants_are_built_as() {
    let world = World::new();
    let softer = "extends = \"rig.toml\"\n[manipulator.materials.pmc770]\nyoung_modulus_mpa = 5.2\n";
    fs::write(world.path("softer.toml"), softer).unwrap();
    fs::write(world.path("told.toml"), format!("{softer}[plant]\nnominal = \"rig.toml\"\n")).unwrap();
    for file in ["softer.toml", "told.toml"] {
        world.answer(&[file, "--runs", "2", "--out", &file.replace(".toml", ""), "--json"]);
    }
    assert_ne!(world.table("softer"), world.table("told"), "the truth is another");
    assert!(world.path("told/nominal.toml").is_file() && !world.path("softer/nominal.toml").exists());
    let again = world.answer(&["told/config.toml", "--resume", "told", "--only", "1", "--json"]);
    assert_eq!(again["equal"], true, "{again}");
}

/// Goal: a table that was cut in the middle of a row, and has rows out of their order, is completed to the
/// uninterrupted one; a campaign can be made longer.
#[test]
fn resumed_campaign_equals_an_uninterrupted_one() {
    let world = World::new();
    world.answer(&["rig.toml", "--runs", "5", "--out", "whole", "--json"]);
    world.answer(&["rig.toml", "--runs", "3", "--out", "cut", "--json"]);
    let table = world.table("cut");
    let lines: Vec<&str> = table.lines().collect();
    let torn = format!("{}\n{}\n{}", lines[0], lines[3], &lines[1][..40]);
    fs::write(world.path("cut/runs.csv"), torn).unwrap();
    let answer = world.answer(&["rig.toml", "--resume", "cut", "--json"]);
    assert_eq!((&answer["runs"], &answer["runs_in_session"]), (&3.into(), &2.into()));
    assert_eq!(world.table("cut"), table);
    let answer = world.answer(&["rig.toml", "--resume", "cut", "--runs", "5", "--json"]);
    assert_eq!((&answer["runs"], &answer["runs_in_session"]), (&5.into(), &2.into()));
    assert_eq!(world.table("cut"), world.table("whole"));
    // Nothing is left to do.
    let answer = world.answer(&["rig.toml", "--resume", "cut", "--json"]);
    assert_eq!((&answer["runs"], &answer["runs_in_session"]), (&5.into(), &0.into()));
    assert_eq!(world.table("cut"), world.table("whole"));
}

/// Goal: SIGINT keeps what is done, sums it up, says how to go on and ends with 130; SIGTERM likewise with
/// 143.
#[test]
fn interrupted_campaign_keeps_what_is_done() {
    let world = World::new();
    for (kind, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let folder = format!("signal-{code}");
        let child = world.start(&folder, 2);
        signal(&child, kind);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(output.status.code(), Some(code), "{}", words(&output));
        let message = words(&output);
        assert!(message.contains(&format!("campaign rig.toml --resume {folder}")), "{message}");
        let rows = world.table(&folder).lines().count() - 1;
        let summary: Value =
            serde_json::from_slice(&fs::read(world.path(&folder).join("summary.json")).unwrap()).unwrap();
        assert!(rows >= 2);
        assert_eq!((&summary["runs"], &summary["runs_wanted"]), (&rows.into(), &100_000.into()));
        assert!(message.contains(&format!("after {rows} of 100000 runs")), "{message}");
    }
}

/// Goal: a campaign killed without warning leaves whole rows of the right runs, and its folder is free again.
#[test]
fn killed_campaign_is_readable() {
    let world = World::new();
    let mut child = world.start("killed", 3);
    let message = world.refused(&["rig.toml", "--resume", "killed"], 69);
    assert!(message.contains("another campaign is writing"), "{message}");
    signal(&child, Signal::KILL);
    child.wait().expect("it ends");
    let table = world.table("killed");
    let last = table.rfind('\n').map(|end| &table[..end]).and_then(|whole| whole.lines().last()).unwrap();
    let run = last.split(',').next().unwrap();
    let replay = world.answer(&["rig.toml", "--resume", "killed", "--only", run, "--json"]);
    assert_eq!(replay["equal"], true);
}

/// Goal: the shipped wide campaign steers a plant 20 % stiffer than the model through every step, and the model learns of it: without, it
/// would be bent 25 deg further than the rod at (60, 90), and a monitor would take that for a lost rod.
#[test]
fn the_model_of_a_stiff_plant_learns() {
    const STIFFEST: &str = "250";
    let world = World::new();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-random.toml");
    let run = world.answer(&[&shipped.to_string_lossy(), "--seed", "1", "--only", STIFFEST, "--json"]);
    assert_eq!((&run["settled"], &run["unstable"]), (&Value::Bool(true), &Value::Bool(false)), "{run}");
    assert!(run["drawn"]["plant.errors.modulus_relative"].as_f64().unwrap() > 0.15, "{run}");
    assert!(run["model_error_deg"].as_f64().unwrap() < 10.0, "{run}");
}

/// Goal: a row that is not what the program computes is found out, with exit code 1.
#[test]
fn a_forged_row_is_not_equal() {
    let world = World::new();
    world.answer(&["rig.toml", "--runs", "1", "--out", "forged", "--json"]);
    let table = world.table("forged");
    let digest = table.trim_end().rsplit(',').next().unwrap();
    fs::write(world.path("forged/runs.csv"), table.replace(digest, "0000000000000000")).unwrap();
    let message = world.refused(&["rig.toml", "--resume", "forged", "--only", "0"], 1);
    assert!(message.contains(digest) && message.contains("NOT equal"), "{message}");
}

/// Goal: rows of two campaigns never meet in one folder; what differs is named.
#[test]
fn another_campaign_is_not_resumed() {
    let world = World::new();
    world.answer(&["rig.toml", "--runs", "1", "--out", "some", "--json"]);
    let resumed = |file: &str, more: &[&str]| {
        let mut arguments = vec![file, "--resume", "some"];
        arguments.extend(more);
        world.refused(&arguments, 65)
    };
    let message = resumed("rig.toml", &["--seed", "7"]);
    assert!(message.contains("seed 1, not 7"), "{message}");
    world.write_rig("other.toml", &format!("{CAMPAIGN}\n[plant.amplifier]\nbandwidth_hz = 199.0\n"));
    let message = resumed("other.toml", &[]);
    assert!(
        message.contains("in [plant.amplifier] `bandwidth_hz = 200.0`, not `bandwidth_hz = 199.0`"),
        "{message}"
    );
    fs::write(world.path("longer.toml"), SHORT_EXPERIMENT.replace("1.2", "1.3")).unwrap();
    let message = resumed("rig.toml", &["--experiment", "longer.toml"]);
    assert!(message.contains("another experiment: in [[steps]] `duration_s = 1.2`, not"), "{message}");
    let message = world.refused(&["rig.toml", "--out", "some"], 73);
    assert!(message.contains("--resume some"), "{message}");
    world.refused(&["rig.toml", "--resume", "nowhere"], 66);
}

/// Goal: what cannot be drawn is refused before the first run, with file, line and value; no folder is made.
#[test]
fn impossible_campaigns_are_refused_before_the_first_run() {
    let world = World::new();
    let cases = [
        (
            "modulus_relative",
            "modulus_relativ",
            "campaign.draw[0].key = plant.errors.modulus_relativ: must be the path of a number",
        ),
        (
            "plant.errors.modulus_relative",
            "plant.sensor",
            "campaign.draw[0].key = plant.sensor: must be the path of a number",
        ),
        ("low = 0.02", "low = 0.2", "campaign.draw[0].uniform.low = 0.2: must be < high"),
        (
            "low = 0.02",
            "low = -0.95",
            "campaign.draw[0].uniform.low = -0.95: must be such that plant.errors.modulus_relative is from -0.9 to 10",
        ),
        (
            "[0.2, 0.25]",
            "[0.2, -1.0]",
            "campaign.draw[1].choice[1] = -1: must be such that plant.rod.first_mode_damping_ratio is from 0 to 2",
        ),
        ("uniform = {", "gamma = {", "campaign.draw[0].gamma"),
        ("high = 0.1 }", "high = 0.1, step = 1 }", "campaign.draw[0].uniform.step"),
        ("short.toml", "missing.toml", "missing.toml (no such file): must be an experiment that can be read"),
    ];
    for (right, wrong, expected) in cases {
        let campaign = CAMPAIGN.replacen(right, wrong, 1);
        assert_ne!(campaign, CAMPAIGN, "{right}");
        world.write_rig("wrong.toml", &campaign);
        let message = world.refused(&["wrong.toml", "--runs", "1", "--out", "wrong"], 78);
        assert!(message.contains(expected) && message.contains("wrong.toml:"), "{wrong}: {message}");
        assert!(!world.path("wrong").exists(), "{wrong}");
    }
}

/// Goal: a combination that no end of a distribution shows is refused in the run that draws it, by number and
/// value; what was done by then is kept.
#[test]
fn a_refused_combination_is_told_with_its_run() {
    let world = World::new();
    let draws = "[plant]\nstep_us = 250\n\n[campaign]\nexperiment = \"short.toml\"\n\n\
        [[campaign.draw]]\nkey = \"plant.step_us\"\nchoice = [250, 500]\n\n\
        [[campaign.draw]]\nkey = \"plant.real_time.wake_us\"\nuniform = { low = 300, high = 1000 }\n";
    world.write_rig("mixed.toml", draws);
    let message = world.refused(&["mixed.toml", "--runs", "40", "--threads", "1", "--out", "mixed"], 78);
    let rows = world.table("mixed").lines().count() - 1;
    assert!(message.contains(&format!("run {rows}, seed ")), "{message}");
    assert!(message.contains("plant.real_time.wake_us = ") && message.contains("from 500 to"), "{message}");
    assert!(message.contains("campaign mixed.toml --resume mixed"), "{message}");
}

/// Goal: a rig without `[campaign]` is told what to add.
#[test]
fn a_rig_without_the_table_is_told_so() {
    let world = World::new();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/reference-cantilever.toml");
    let message = world.refused(&[file.to_str().unwrap()], 78);
    assert!(message.contains("campaign is missing: must be a table [campaign]"), "{message}");
}

/// Goal: `check` finds what the campaign would refuse.
#[test]
fn check_knows_the_campaign_too() {
    let world = World::new();
    world.write_rig("wrong.toml", &CAMPAIGN.replacen("low = 0.02", "low = -0.95", 1));
    let mut check = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let output = check.current_dir(world.folder.path()).args(["check", "wrong.toml"]).output().unwrap();
    assert_eq!(output.status.code(), Some(78), "{}", words(&output));
    assert!(words(&output).contains("campaign.draw[0].uniform.low = -0.95"), "{}", words(&output));
}
