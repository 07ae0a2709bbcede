//! `magsteer report` as a user meets it: every figure in three formats, curves that are the run's, one page that loads nothing.

#![cfg(all(feature = "sim", feature = "record", feature = "figures"))]

mod recording_support;
mod rig_support;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use magsteer::daemon::cycle_message;
use recording_support::{complete, planar};
use serde_json::Value;

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
    // Drawings name parts of themselves by url(#...).
    let page = page.replace("url(#", "");
    for loads in ["<script", "<link", "<img", "@import", "src=", "url("] {
        assert!(!page.contains(loads), "{loads}");
    }
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
