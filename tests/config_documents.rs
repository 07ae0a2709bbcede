//! Documents: what a file inherits, where a refusal points, what `check` answers, and the files of experiments.

mod right_config;

use std::fs;
use std::path::Path;
use std::process::Command;

use magsteer::config::ProblemKind::Value;
use magsteer::config::{Config, Document, Experiment, Problem, ProblemKind, Problems};
use right_config::{RIGHT, STEERING, line_of, refused};
use tempfile::TempDir;

/// A folder with files of the given names and texts.
fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn load(folder: &TempDir, name: &str) -> Result<(Document, Config), Problems> {
    Config::load(&folder.path().join(name))
}

fn only_problem(loaded: Result<(Document, Config), Problems>) -> Problem {
    let problems = loaded.expect_err("must be refused").into_vec();
    assert_eq!(problems.len(), 1, "{problems:#?}");
    problems.into_iter().next().unwrap()
}

#[test]
fn a_file_overrides_key_by_key_and_replaces_arrays() {
    let over = "extends = \"base.toml\"\n[rig]\nname = \"other\"\n[[coils]]\nname = \"only\"\ntype = \"air\"\n\
        azimuth_deg = 90\nelevation_deg = 0\ndistance_mm = 90\n[coil_types.air]\nsupply_v = 24.0\n";
    let two_coils = RIGHT.replace(
        "[manipulator]",
        "[[coils]]\nname = \"right\"\ntype = \"air\"\nazimuth_deg = 180.0\n\
        elevation_deg = 0.0\ndistance_mm = 100.0\n\n[manipulator]",
    );
    let folder = folder(&[("base.toml", &two_coils), ("over.toml", over)]);
    let (document, config) = load(&folder, "over.toml").unwrap();
    assert_eq!(document.files().count(), 2);
    assert_eq!(config.description.rig, "other");
    assert_eq!(config.description.workspace.radius, 0.055);
    assert_eq!(config.description.coils.len(), 1);
    assert_eq!(config.description.coils[0].supply_voltage, 24.0);
    assert_eq!(config.description.coils[0].resistance, 5.0);
}

#[test]
fn a_value_is_refused_in_the_file_that_holds_it() {
    let folder = folder(&[
        ("base.toml", RIGHT),
        ("middle.toml", "extends = \"base.toml\"\n\n[coil_types.air]\nsupply_v = -1.0\n"),
        ("top.toml", "extends = \"middle.toml\"\n[rig]\nname = \"top\"\n"),
    ]);
    let problem = only_problem(load(&folder, "top.toml"));
    assert!(problem.file.ends_with("middle.toml"), "{problem:?}");
    assert_eq!((problem.line, problem.column), (4, 12));
    assert_eq!(problem.key, "coil_types.air.supply_v");
}

#[test]
fn a_chain_that_closes_upon_itself_is_refused() {
    let folder = folder(&[
        ("a.toml", "extends = \"b.toml\"\n"),
        ("b.toml", "extends = \"./c.toml\"\n"),
        ("c.toml", "# here\nextends = \"b.toml\"\n"),
        ("self.toml", "extends = \"self.toml\"\n"),
    ]);
    let problem = only_problem(load(&folder, "a.toml"));
    assert!(problem.file.ends_with("c.toml"), "{problem:?}");
    assert_eq!((problem.problem, problem.line, problem.key.as_str()), (Value, 2, "extends"));
    assert!(problem.value.contains("a.toml -> b.toml -> c.toml -> b.toml"), "{problem:?}");
    assert!(only_problem(load(&folder, "self.toml")).value.contains("self.toml -> self.toml"));
}

#[test]
fn a_missing_file_is_refused_at_the_place_that_names_it() {
    let folder = folder(&[("a.toml", "\nextends = \"gone.toml\"\n"), ("b.toml", "extends = 3\n")]);
    let problem = only_problem(load(&folder, "gone.toml"));
    assert_eq!((problem.problem, problem.line), (ProblemKind::Unreadable, 0));
    assert!(problem.file.ends_with("gone.toml"), "{problem:?}");
    let problem = only_problem(load(&folder, "a.toml"));
    assert_eq!((problem.problem, problem.line, problem.column), (ProblemKind::Unreadable, 2, 11));
    assert!(problem.value.contains("gone.toml") && problem.value.contains("no such file"), "{problem:?}");
    let problem = only_problem(load(&folder, "b.toml"));
    assert_eq!((problem.problem, problem.value.as_str()), (Value, "3"));
}

#[test]
fn a_problem_shows_its_line_with_carets() {
    let problems = refused(&RIGHT.replace("supply_v = 48.0", "supply_v = -48.0"));
    let message = problems[0].to_string();
    let lines: Vec<&str> = message.lines().collect();
    assert_eq!(lines[0], "bench.toml:23:12: coil_types.air.supply_v = -48: must be from 0.1 to 5000");
    assert_eq!(lines[1..], ["   |", "23 | supply_v = -48.0", "   |            ^^^^^"]);
}

#[test]
fn check_answers_in_json_and_by_its_exit_code() {
    let folder = folder(&[
        ("right.toml", &format!("{RIGHT}{STEERING}")),
        ("wrong.toml", &RIGHT.replace("distance_mm = 100.0", "distance_mm = -100.0")),
        ("broken.toml", "[rig\n"),
    ]);
    let check = |name: &str| {
        let command = Command::new(env!("CARGO_BIN_EXE_magsteer"))
            .args(["check", "--json"])
            .arg(folder.path().join(name))
            .output()
            .unwrap();
        let answer: serde_json::Value = serde_json::from_slice(&command.stdout).unwrap();
        (command.status.code().unwrap(), answer)
    };
    let (code, answer) = check("right.toml");
    assert_eq!((code, &answer["ok"], &answer["errors"]), (0, &true.into(), &serde_json::json!([])));
    let (code, answer) = check("wrong.toml");
    assert_eq!((code, &answer["ok"]), (78, &false.into()));
    let error = &answer["errors"][0];
    let file = Path::new(error["file"].as_str().unwrap()).file_name().unwrap();
    assert_eq!(file, "wrong.toml");
    let line = line_of(RIGHT, "distance_mm");
    assert_eq!((&error["line"], &error["column"]), (&line.into(), &15.into()));
    assert_eq!((&error["key"], &error["value"]), (&"coils[0].distance_mm".into(), &"-100".into()));
    assert_eq!(error["expected"], "from 1 to 10000");
    assert_eq!(check("broken.toml").0, 78);
    assert_eq!(check("absent.toml").0, 66);
}

/// Goal: `check` speaks of the simulated plant too, though the library does not know it.
#[cfg(feature = "sim")]
#[test]
fn check_refuses_a_mistyped_plant() {
    let plant = "[plant]\nseed = -1\nstep_us = 1000\nsensors = 3\n";
    let folder = folder(&[("plant.toml", &format!("{RIGHT}{STEERING}{plant}"))]);
    let command = Command::new(env!("CARGO_BIN_EXE_magsteer"))
        .args(["check", "--json"])
        .arg(folder.path().join("plant.toml"))
        .output()
        .unwrap();
    assert_eq!(command.status.code(), Some(78));
    let answer: serde_json::Value = serde_json::from_slice(&command.stdout).unwrap();
    let keys: Vec<&str> =
        answer["errors"].as_array().unwrap().iter().map(|error| error["key"].as_str().unwrap()).collect();
    for key in ["plant.seed", "plant.sensors", "plant.rod", "plant.errors"] {
        assert!(keys.contains(&key), "{key}: {keys:?}");
    }
}

/// Goal: a mistake in the table of a sensor, whose keys depend on its kind, is refused at its own line.
#[cfg(feature = "sim")]
#[test]
fn mistakes_in_a_sensors_table_keep_their_place() {
    let shipped = include_str!("../config/bigmag-planar.toml");
    let (shipped, _) = shipped.split_once("# Plants that differ at random").expect("campaigns come last");
    let camera = "plant.sensors.camera.point_cloud";
    let cases = [
        ("[plant.sensors.tracker.poses]", "[plant.sensors.tracker.pose]", "plant.sensors.tracker.pose"),
        ("outlier_share = 0.1", "outlier_share = 0.9", &format!("{camera}.outlier_share")),
        ("outlier_share = 0.1", "outliers = 0.1", &format!("{camera}.outliers")),
        ("random = { share = 0.2 }", "random = { share = 2.0 }", &format!("{camera}.occlusion.random.share")),
        ("curvature = { degree = 2 }", "curve = { degree = 2 }", &format!("{camera}.centreline.curve")),
        ("stations = 100", "stations = 2.5", "plant.sensors.fibre.curvature.stations"),
    ];
    for (right, wrong, key) in cases {
        assert!(shipped.contains(right), "{right}");
        let text = shipped.replacen(right, wrong, 1);
        let folder = folder(&[("plant.toml", &text)]);
        let command = Command::new(env!("CARGO_BIN_EXE_magsteer"))
            .args(["check", "--json"])
            .arg(folder.path().join("plant.toml"))
            .output()
            .unwrap();
        assert_eq!(command.status.code(), Some(78), "{wrong}: {command:?}");
        let answer: serde_json::Value = serde_json::from_slice(&command.stdout).unwrap();
        let errors = answer["errors"].as_array().unwrap();
        let error = errors.iter().find(|error| error["key"] == key).unwrap_or_else(|| panic!("{errors:?}"));
        assert_eq!(error["line"], line_of(&text, wrong), "{wrong}: {error}");
    }
}

const STEPS: &str = "description = \"test\"\naxis = [0.0, 1.0, 0.0]\nzero_direction = [0.0, 0.0, 1.0]\n\
    [[steps]]\ntarget_deg = { m1 = 90.0, m2 = 70.0 }\nduration_s = 4.0\n";

#[test]
fn mistyped_experiments_are_refused_alike() {
    let cases = [
        ("m2 = 70.0", "m3 = 70.0", "steps[0].target_deg.m3", "m1, m2"),
        (", m2 = 70.0", "", "steps[0].target_deg", "each magnet (m1, m2)"),
        ("m2 = 70.0", "m2 = 700.0", "steps[0].target_deg.m2", "from -360 to 360"),
        ("m2 = 70.0", "m2 = \"70deg\"", "steps[0].target_deg.m2", "a number"),
        ("duration_s = 4.0", "duration_s = 0", "steps[0].duration_s", "> 0"),
        (
            "duration_s = 4.0",
            "duration = 4.0\nduration_s = 4.0",
            "steps[0].duration",
            "did you mean `duration_s`?",
        ),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 0.0, 0.0]", "axis", "other than zero"),
        ("axis = [0.0, 1.0, 0.0]", "axis = [0.0, 1.0, 1.0]", "zero_direction", "perpendicular"),
    ];
    let read = |text: &str| {
        let document = Document::from_text("steps.toml", text)?;
        Experiment::from_document(&document, &magsteer_hal::scripted::example_description())
    };
    assert!(read(STEPS).is_ok());
    for (from, to, key, expected) in cases {
        let problems = read(&STEPS.replace(from, to)).expect_err(to).into_vec();
        let problem = problems.iter().find(|problem| problem.key == key);
        let problem = problem.unwrap_or_else(|| panic!("{to}: {problems:#?}"));
        assert!(problem.expected.contains(expected), "{problem:?}");
        assert!(problem.line >= 2 && problem.to_string().starts_with("steps.toml:"), "{problem:?}");
    }
}

/// Goal: a refused experiment is refused data, an unreadable one a missing input, for each command that plays one; nothing starts.
#[test]
fn refused_experiments_end_with_their_own_exit_codes() {
    let folder = folder(&[("steps.toml", "description = \"no steps\"\n")]);
    let code = |command: &[&str], name: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_magsteer"))
            .args(command)
            .arg(folder.path().join(name))
            .current_dir(folder.path())
            .output()
            .unwrap();
        assert!(String::from_utf8_lossy(&output.stderr).contains(name), "{output:?}");
        output.status.code().unwrap()
    };
    let mut commands = vec![&["target", "play"][..]];
    if cfg!(feature = "sim") {
        commands.push(&["demo", "--experiment"]);
    }
    for command in commands {
        assert_eq!(code(command, "steps.toml"), 65);
        assert_eq!(code(command, "absent.toml"), 66);
    }
}
