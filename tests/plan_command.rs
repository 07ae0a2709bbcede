//! `magsteer plan` and `magsteer reach`, as another program would call them.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

const HEADER: &str = "m1x,m1y,m1z,m2x,m2y,m2z\n";

/// A folder with the shipped rig on a coarse grid, `rig.toml`.
struct World(TempDir);

impl World {
    fn new() -> Self {
        let world = Self(TempDir::new().unwrap());
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        let text =
            format!("extends = {:?}\n[control.plan]\nframe_step_deg = 45.0\n", shipped.to_str().unwrap());
        world.write("rig.toml", &text);
        world
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn magsteer(&self, arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
        command.args(arguments).current_dir(self.0.path()).output().unwrap()
    }

    fn answer(&self, arguments: &[&str], code: i32) -> Value {
        let output = self.magsteer(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {output:?}");
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn refusal(&self, arguments: &[&str], code: i32) -> String {
        let output = self.magsteer(arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {output:?}");
        assert!(output.stdout.is_empty(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    }
}

/// A line of a file of targets: both magnets at angles from z towards x, turned out of the plane by `yaw`, all deg.
fn line(angles: [f64; 2], yaw: f64) -> String {
    let cells = angles.iter().flat_map(|angle| {
        let (sine, cosine) = angle.to_radians().sin_cos();
        let (out, along) = yaw.to_radians().sin_cos();
        [sine * along, sine * out, cosine].map(|component| format!("{component:.9}"))
    });
    cells.collect::<Vec<_>>().join(",") + "\n"
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn reached_targets_have_every_stable_key_and_end_with_0() {
    let world = World::new();
    world.write(
        "targets.csv",
        &format!("{HEADER}{}{}", line([100.0, 110.0], 5.0), line([105.0, 100.0], -8.0)),
    );
    let answer = world.answer(&["plan", "rig.toml", "targets.csv", "--json", "--threads", "2"], 0);
    assert_eq!(answer["reached_fraction"], 1.0);
    let targets = answer["targets"].as_array().unwrap();
    assert_eq!(targets.len(), 2);
    for target in targets {
        assert_eq!(target["reached"], true);
        assert!(target["reason"].is_null());
        assert!(target["error_deg"].as_f64().unwrap() <= 0.1);
        let currents = numbers(&target["currents_a"]);
        assert_eq!(currents.len(), 6);
        let most = currents.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
        assert!((target["current_max_a"].as_f64().unwrap() - most).abs() < 1e-12 && most <= 8.0);
        assert_eq!(numbers(&target["angles_deg"]).len(), 2);
        assert!(target["condition"].as_f64().unwrap() >= 1.0);
        let margin = target["stability_margin"].as_f64().unwrap();
        assert!(margin > 0.0 && target["path_margin_min"].as_f64().unwrap() <= margin);
        let last = target["waypoints"].as_array().unwrap().last().unwrap();
        assert_eq!(last["angles_deg"], target["angles_deg"]);
        assert_eq!(last["directions"], target["directions"]);
    }
}

#[test]
fn a_target_that_is_not_reached_says_why_and_ends_with_1() {
    let world = World::new();
    world.write("targets.csv", &format!("{HEADER}{}-1,0,0,-1,0,0\n", line([100.0, 110.0], 5.0)));
    let answer = world.answer(&["plan", "rig.toml", "targets.csv", "--json"], 1);
    assert_eq!(answer["reached_fraction"], 0.5);
    let refused = &answer["targets"][1];
    assert_eq!(refused["reached"], false);
    assert!(refused["reason"].as_str().unwrap().starts_with("not reached with any of"), "{refused}");
    assert!(refused["currents_a"].is_null() && refused["error_deg"].is_null());
    let table = world.magsteer(&["plan", "rig.toml", "targets.csv"]);
    let text = String::from_utf8(table.stdout).unwrap();
    assert!(text.contains("reached 1 of 2"), "{text}");
}

/// Goal: frames held in the plane of the coils do not reach out of it; in it they do, and the answer names what they were held at.
#[test]
fn held_frames_are_held() {
    let world = World::new();
    world.write(
        "targets.csv",
        &format!("{HEADER}{}{}", line([105.0, 108.0], 0.0), line([105.0, 108.0], 15.0)),
    );
    let held = ["plan", "rig.toml", "targets.csv", "--fixed-frames", "bottom=0,top=0", "--json"];
    let answer = world.answer(&held, 1);
    assert_eq!(answer["targets"][0]["reached"], true);
    assert_eq!(answer["targets"][1]["reached"], false);
    assert_eq!(numbers(&answer["fixed_angles_deg"]), [0.0, 0.0]);
    let best = world.answer(&["plan", "rig.toml", "targets.csv", "--best-fixed", "--json"], 0);
    assert_eq!(best["reached_fraction"], 1.0);
    assert_ne!(numbers(&best["fixed_angles_deg"]), [0.0, 0.0]);
}

/// Goal: the written experiment is one that the loop takes, one step a waypoint.
#[test]
fn ways_are_written_as_an_experiment() {
    let world = World::new();
    world.write(
        "targets.csv",
        &format!("{HEADER}{}{}", line([100.0, 110.0], 5.0), line([105.0, 100.0], -8.0)),
    );
    let arguments = ["plan", "rig.toml", "targets.csv", "--path", "--out", "way.toml", "--json"];
    let answer = world.answer(&arguments, 0);
    let targets = answer["targets"].as_array().unwrap();
    let waypoints: usize = targets.iter().map(|target| target["waypoints"].as_array().unwrap().len()).sum();
    let text = fs::read_to_string(world.path("way.toml")).unwrap();
    let (_, config) = magsteer::config::Config::load(&world.path("rig.toml")).unwrap();
    let experiment =
        magsteer::config::Experiment::load(&world.path("way.toml"), &config.description).unwrap();
    assert_eq!(experiment.steps.len(), waypoints, "{text}");
    let last = experiment.target(experiment.steps.last().unwrap(), &config.description);
    let angles = last.frame_angles.unwrap().map(f64::to_degrees);
    for (angle, expected) in angles.iter().zip(numbers(&targets[1]["angles_deg"])) {
        assert!((angle - expected).abs() < 1e-5);
    }
    for (direction, expected) in last.directions.iter().zip(targets[1]["directions"].as_array().unwrap()) {
        for (component, expected) in direction.iter().zip(numbers(expected)) {
            assert!((component - expected).abs() < 1e-8);
        }
    }
}

#[test]
fn refused_targets_name_file_line_column_and_what_is_right() {
    let world = World::new();
    let refuse = |text: &str| {
        world.write("targets.csv", text);
        world.refusal(&["plan", "rig.toml", "targets.csv"], 65)
    };
    let long = refuse(&format!("{HEADER}1,0,0,1,0,0\n1,0,0,1,1,0\n"));
    assert!(
        long.contains("targets.csv:3: m2x,m2y,m2z: a vector of length 1.4142: must be a unit vector"),
        "{long}"
    );
    let nan = refuse(&format!("{HEADER}1,0,0,nan,0,0\n"));
    assert!(nan.contains("targets.csv:2: m2x: \"nan\": must be a finite number"), "{nan}");
    let missing = refuse("m1x,m1y,m1z\n1,0,0\n");
    assert!(missing.contains("targets.csv:1: header: no column m2x"), "{missing}");
    let gone = world.refusal(&["plan", "rig.toml", "nothing.csv"], 66);
    assert!(gone.contains("nothing.csv: cannot be read: no such file"), "{gone}");
}

#[test]
fn wrong_arguments_are_usage_errors() {
    let world = World::new();
    let cone = ["plan", "rig.toml", "--cone", "20"];
    let with = |more: &[&'static str]| world.refusal(&[&cone[..], more].concat(), 2);
    assert!(with(&["--fixed-frames", "bottom=0"]).contains("frame top: must be one angle for each"));
    assert!(with(&["--fixed-frames", "bottom=0,left=3"]).contains("no frame left"));
    assert!(with(&["--fixed-frames", "bottom=0,top=200"]).contains("must be from -180 to 180 deg"));
    assert!(with(&["--fixed-frames", "bottom"]).contains("must be a frame and its angle"));
    world.refusal(&["plan", "rig.toml"], 2);
    world.refusal(&["plan", "rig.toml", "--cone", "0"], 2);
    world.refusal(&["plan", "rig.toml", "targets.csv", "--cone", "20"], 2);
}

#[test]
fn a_rig_without_a_plan_is_refused_by_the_name_of_the_table() {
    let world = World::new();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    let text = fs::read_to_string(shipped).unwrap();
    let start = text.find("\n[control.plan]").unwrap();
    let end = start + text[start..].find("\n[daemon]").unwrap();
    world.write("bare.toml", &format!("{}{}", &text[..start], &text[end..]));
    for command in ["plan", "reach"] {
        let arguments: &[&str] = &[command, "bare.toml", "--cone", "20"];
        let refusal = world.refusal(arguments, 78);
        assert!(refusal.contains("control.plan"), "{refusal}");
    }
}

/// Goal: the map's files are there and agree with its numbers; near rest everything is reached.
#[test]
fn reach_writes_what_it_counts() {
    let world = World::new();
    let arguments =
        ["reach", "rig.toml", "--samples", "8", "--cone", "20", "--seed", "3", "--out", "map", "--json"];
    let answer = world.answer(&arguments, 0);
    assert_eq!(answer["samples"], 8);
    let rings = answer["rings"].as_array().unwrap();
    assert_eq!(rings.len(), 2);
    let sum = |key: &str| rings.iter().map(|ring| ring[key].as_u64().unwrap()).sum::<u64>();
    assert_eq!(sum("samples"), 8);
    let table = fs::read_to_string(world.path("map/reach.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    let columns: Vec<&str> = lines[0].split(',').collect();
    let reached = columns.iter().position(|column| *column == "reached").unwrap();
    assert_eq!(lines.len(), 9);
    let count = lines[1..].iter().filter(|line| line.split(',').nth(reached) == Some("1")).count();
    assert_eq!(count as u64, sum("reached"));
    assert!(lines.iter().all(|line| line.split(',').count() == columns.len()));
    assert!(answer["reached_fraction"].as_f64().unwrap() > 0.9, "{answer}");
    if cfg!(feature = "figures") {
        let picture = fs::read(world.path("map/reach.png")).unwrap();
        assert!(picture.starts_with(b"\x89PNG"));
    }
}
