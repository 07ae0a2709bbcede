//! `magsteer report` as a user meets it: every figure in three formats, curves that are the run's or the
//! campaign's, one page that loads nothing.

#![cfg(all(feature = "sim", feature = "record", feature = "figures"))]

mod recording_support;
mod rig_support;
mod short_experiment;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use magsteer::daemon::cycle_message;
use recording_support::{complete, planar};
use serde_json::Value;
use short_experiment::SHORT_EXPERIMENT;

const TARGETS_DEG: [[f64; 2]; 2] = [[90.0, 90.0], [75.0, 80.0]];

fn report(run: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.arg("report").arg(run).arg("--json").output().expect("the program is built")
}

#[test]
fn report_draws_what_was_recorded_and_its_page_loads_nothing() {
    let folder = tempfile::tempdir().expect("a directory");
    let subject = planar();
    let mut writer = subject.writer(&folder.path().join("recording.mcap"));
    subject.steer(None, &TARGETS_DEG, 1.5, |record| {
        writer.write(&cycle_message(record)).expect("a disk with room");
    });
    writer.finish(&complete()).expect("a disk with room");
    let made = report(folder.path());
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let answer: Value = serde_json::from_slice(&made.stdout).expect("one object");
    let steps = answer["steps"].as_array().expect("steps");
    assert_eq!(steps.len(), TARGETS_DEG.len(), "{answer}");
    for (step, target) in steps.iter().zip(TARGETS_DEG) {
        assert!(step["settled_s"].is_number(), "{step}");
        for (told, target) in step["target_deg"].as_array().expect("angles").iter().zip(target) {
            assert!((told.as_f64().expect("a number") - target).abs() < 1e-9, "{step}");
        }
    }
    for name in ["angles", "views", "actuation", "margins", "forces", "field", "timing"] {
        let file = |extension: &str| folder.path().join("report").join(format!("{name}.{extension}"));
        let png = fs::read(file("png")).expect("a picture");
        assert!(png.starts_with(b"\x89PNG") && png.len() > 5_000, "{name}");
        let svg = fs::read_to_string(file("svg")).expect("a drawing");
        assert!(svg.contains("<svg") && svg.contains("</svg>"), "{name}");
        let table = fs::read_to_string(file("csv")).expect("a table");
        assert!(table.starts_with("chart,curve,x,y\n") && table.lines().count() > 4, "{name}");
    }
    // At the end of the last step the curve of the first magnet is where the target is.
    let angles = fs::read_to_string(folder.path().join("report/angles.csv")).expect("a table");
    let at = |time: f64| {
        let points = angles.lines().filter_map(|line| line.strip_prefix("1,measured,"));
        let mut points = points.filter_map(|point| {
            let (time, angle) = point.split_once(',')?;
            Some((time.parse::<f64>().ok()?, angle.parse::<f64>().ok()?))
        });
        points.find(|point| point.0 >= time).expect("a point").1
    };
    assert!((at(0.6 + 2.9) - TARGETS_DEG[1][0]).abs() < 1.0, "{}", at(3.5));
    let page = fs::read_to_string(folder.path().join("report/report.html")).expect("a page");
    assert_eq!(page.matches("<figure").count(), 7);
    for told in
        ["2 of 2 settled", "<th>begun</th>", " UTC", "periods missed by the loop", "largest current (A)"]
    {
        assert!(page.contains(told), "{told}");
    }
    // Every event has its time, and the pose age is that of every cycle, which a tracker of 200 Hz feeds now and then.
    let events = page.split("<h2>Events</h2>").nth(1).expect("events");
    let active = events.lines().find(|line| line.ends_with("armed -&gt; active")).expect("it was steered");
    let time: f64 = active.split_whitespace().next().and_then(|time| time.parse().ok()).expect("a time");
    assert!(time > 0.0 && time < 1.0 && active.contains(" s  "), "{active}");
    let ages = page.split("<tr><th>pose age</th>").nth(1).and_then(|rest| rest.split("</tr>").next());
    let ages: Vec<f64> =
        ages.expect("a row").split('>').filter_map(|cell| cell.strip_suffix("</td")?.parse().ok()).collect();
    assert!(
        ages[4] - ages[0] > 1500.0,
        "ages from one pose to the next are as far apart as the sensor's period: {ages:?}"
    );
    // Drawings name parts of themselves by url(#...).
    let page = page.replace("url(#", "");
    for loads in ["<script", "<link", "<img", "@import", "src=", "url("] {
        assert!(!page.contains(loads), "{loads}");
    }
}

/// Poses that are older than the loop admits when they arrive: a plant with those is never steered.
const CAMPAIGN: &str = r#"
[campaign]
experiment = "short.toml"

[[campaign.draw]]
key = "plant.sensors.tracker.poses.latency_ms"
choice = [4.0, 90.0]

[[campaign.draw]]
key = "plant.errors.modulus_relative"
uniform = { low = -0.05, high = 0.05 }
"#;

fn magsteer(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.current_dir(folder).args(arguments).output().expect("the program is built")
}

/// Goal: the figures of a campaign agree with its table, and the command beside each failed run plays that run again, bit for bit.
#[test]
fn report_of_a_campaign_tells_its_failed_runs_and_how_to_play_them_again() {
    let world = tempfile::tempdir().expect("a directory");
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    fs::write(world.path().join("short.toml"), SHORT_EXPERIMENT).expect("own directory");
    fs::write(world.path().join("rig.toml"), format!("extends = {shipped:?}\n{CAMPAIGN}"))
        .expect("own directory");
    let played =
        magsteer(world.path(), &["campaign", "rig.toml", "--runs", "6", "--seed", "1", "--out", "done"]);
    // 1: some run was unstable.
    assert_eq!(played.status.code(), Some(1), "{}", String::from_utf8_lossy(&played.stderr));
    let made = magsteer(world.path(), &["report", "done", "--json"]);
    assert_eq!(made.status.code(), Some(0), "{}", String::from_utf8_lossy(&made.stderr));
    let answer: Value = serde_json::from_slice(&made.stdout).expect("one object");

    let table = fs::read_to_string(world.path().join("done/runs.csv")).expect("a table");
    let header: Vec<&str> = table.lines().next().expect("a header").split(',').collect();
    let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let of = |row: &[&str], name: &str| -> String {
        let column = header.iter().position(|column| *column == name).unwrap_or_else(|| panic!("{name}"));
        row[column].to_owned()
    };
    let late: Vec<String> = rows
        .iter()
        .filter(|row| of(row, "plant.sensors.tracker.poses.latency_ms") == "90")
        .map(|row| of(row, "run"))
        .collect();
    assert!(!late.is_empty() && late.len() < rows.len(), "both are drawn: {late:?}");
    let failed = answer["failed"].as_array().expect("runs");
    let named: Vec<String> = failed.iter().map(|failed| failed["run"].to_string()).collect();
    assert_eq!(named, late);
    assert_eq!(answer["settled"], rows.len() - late.len());
    for row in rows.iter().filter(|row| !late.contains(&of(row, "run"))) {
        let margin: f64 = of(row, "margin_min").parse().expect("a number");
        assert!(margin > 0.0 && margin < 1.0, "{margin}");
        let number = |name: &str| of(row, name).parse::<f64>().expect("a number");
        let steps = number("rms_step_1_deg").max(number("rms_step_2_deg"));
        assert_eq!(steps, number("rms_max_deg"));
    }

    for name in ["outcome", "settling", "errors", "draws", "limits"] {
        let file = |extension: &str| world.path().join("done/report").join(format!("{name}.{extension}"));
        let png = fs::read(file("png")).expect("a picture");
        assert!(png.starts_with(b"\x89PNG") && png.len() > 5_000, "{name}");
        assert!(fs::read_to_string(file("svg")).expect("a drawing").contains("</svg>"), "{name}");
        let table = fs::read_to_string(file("csv")).expect("a table");
        assert!(table.starts_with("chart,curve,x,y\n") && table.lines().count() > 4, "{name}");
    }
    let draws = fs::read_to_string(world.path().join("done/report/draws.csv")).expect("a table");
    assert_eq!(draws.lines().filter(|line| line.starts_with("1,unstable,90,")).count(), late.len());
    let page = fs::read_to_string(world.path().join("done/report/report.html")).expect("a page");
    assert_eq!(page.matches("<figure").count(), 5);
    let page = page.replace("url(#", "");
    for loads in ["<script", "<link", "<img", "@import", "src=", "url("] {
        assert!(!page.contains(loads), "{loads}");
    }

    let replay = failed[0]["replay"].as_str().expect("a command");
    assert!(page.contains(replay), "{replay}");
    let arguments: Vec<&str> = replay.split_whitespace().skip(1).collect();
    let replayed = magsteer(world.path(), &arguments);
    assert_eq!(replayed.status.code(), Some(0), "{}", String::from_utf8_lossy(&replayed.stderr));
    assert!(String::from_utf8_lossy(&replayed.stdout).contains("equal to the recorded run bit for bit"));
}

#[test]
fn a_campaign_without_a_run_is_refused_by_its_name() {
    let folder = tempfile::tempdir().expect("a directory");
    fs::write(folder.path().join("campaign.json"), "{}").expect("own directory");
    let refused = report(folder.path());
    assert_eq!(refused.status.code(), Some(65), "{}", String::from_utf8_lossy(&refused.stderr));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("campaign.json"));
}

#[test]
fn what_is_no_recording_is_refused_by_its_name() {
    let folder = tempfile::tempdir().expect("a directory");
    let refused = report(folder.path());
    assert_eq!(refused.status.code(), Some(66), "{}", String::from_utf8_lossy(&refused.stderr));
    fs::write(folder.path().join("recording.mcap"), "not one").expect("own directory");
    let refused = report(folder.path());
    assert_eq!(refused.status.code(), Some(65), "{}", String::from_utf8_lossy(&refused.stderr));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("recording.mcap"));
}
