//! `magsteer field import` and `field export` as a user calls them.
#![cfg(all(feature = "mpem", feature = "sim"))]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use magsteer::config::Config;
use magsteer::magnetics::{AppliedField, CoilArray, FieldSample};
use magsteer_sim_plant::field::CoilArray as TrueArray;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use tempfile::TempDir;

const FIXTURE: &str = "tests/reference/calibration.yaml";
const RIG: &str = "config/bigmag-planar.toml";

fn field(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.arg("field").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR"));
    command.output().unwrap()
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn load(path: &Path) -> Config {
    Config::load(path).unwrap_or_else(|problems| panic!("{problems}")).1
}

fn expect(output: &Output, code: i32) {
    assert_eq!(output.status.code(), Some(code), "{output:?}");
}

fn modelled(config: &Config, angles: &[f64], currents: &[f64], point: &Vector3<f64>) -> Vector3<f64> {
    let mut sample = FieldSample::default();
    CoilArray::new(&config.description).posed(angles).actuated(currents).evaluate(point, &mut sample);
    sample.field
}

/// Goal: what is imported over a rig is a rig, in which controller and plant have the same field, that of the
/// calibration.
#[test]
fn an_imported_calibration_is_a_rig_on_both_sides() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("my-rig.toml");
    let output = field(&[
        "import",
        FIXTURE,
        "--config",
        RIG,
        "--coil-type",
        "iron",
        "--valid-from-x-mm",
        "43",
        "--out",
        out.to_str().unwrap(),
        "--json",
    ]);
    expect(&output, 0);
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["name"], "three coils");
    assert_eq!(answer["coils"][0]["name"], "West");
    assert_eq!(answer["coils"][2]["order"], 1);
    assert_eq!(answer["coils"][1]["axis"], serde_json::json!([0.0, 0.0, 1.0]));
    let notes = complaint(&output);
    assert!(notes.contains("bottom, top of the configuration turn nothing"), "{notes}");
    assert!(notes.contains("reaches out of the box"), "{notes}");
    let mut check = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    expect(&check.arg("check").arg(&out).output().unwrap(), 0);
    let config = load(&out);
    assert_eq!(config.description.coils.len(), 3);
    assert_eq!(config.description.coils[0].current_max, 8.0);
    let mut plant = TrueArray::as_described(&config.description);
    let mut random = ChaCha8Rng::seed_from_u64(6);
    for _ in 0..20 {
        let currents: Vec<f64> = (0..3).map(|_| random.random_range(-8.0..8.0)).collect();
        let point = Vector3::from_fn(|_, _| random.random_range(-0.02..0.02));
        plant.actuate(&currents, &[0.0, 0.0]);
        let (found, expected) = (modelled(&config, &[], &currents, &point), plant.at(&point));
        assert!(expected.valid && (found - expected.flux).norm() < 1e-12 * found.norm(), "{point}");
    }
}

/// Goal: unless told otherwise, the series holds as near as the calibrated box comes; and when the rig's
/// magnets lie nearer, the command says so and ends with 1.
#[test]
fn magnets_outside_of_what_was_calibrated_are_told() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("my-rig.toml");
    let output =
        field(&["import", FIXTURE, "--config", RIG, "--coil-type", "air", "--out", out.to_str().unwrap()]);
    expect(&output, 1);
    let notes = complaint(&output);
    assert!(notes.contains("no right configuration yet") && notes.contains("coil \"West\""), "{notes}");
    let text = fs::read_to_string(&out).unwrap();
    assert!(text.contains("valid_from_x_mm = 79.6\n"), "{text}");
}

#[test]
fn without_a_rig_the_coils_alone_are_written_to_be_extended() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("coils.toml");
    let output = field(&["import", FIXTURE, "--valid-from-x-mm", "43", "--out", out.to_str().unwrap()]);
    expect(&output, 0);
    let table = String::from_utf8(output.stdout).unwrap();
    for part in ["three coils: 3 coils", "West", "(-100.00, -30.00, 4.00)", "(0.0000, 0.0000, 1.0000)"] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let shipped = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(RIG)).unwrap();
    let (head, rest) = shipped.split_once("[coil_types.air]\n").unwrap();
    let (_, tail) = rest.split_once("[manipulator]\n").unwrap();
    let circuit = "current_max_a = 8.0\nslew_max_a_per_s = 300.0\nresistance_ohm = 5.0\ninductance_h = 0.1\nsupply_v = 48.0\n";
    let types: String =
        ["West", "Below", "South"].map(|name| format!("[coil_types.{name}]\n{circuit}")).concat();
    let rig = folder.path().join("rig.toml");
    fs::write(&rig, format!("extends = \"coils.toml\"\n{head}{types}[manipulator]\n{tail}")).unwrap();
    let names: Vec<String> = load(&rig).description.coils.into_iter().map(|coil| coil.name).collect();
    assert_eq!(names, ["West", "Below", "South"]);
}

/// Goal: exported at turned frames and imported again, the shipped array has the same field, to twelve
/// digits.
#[test]
fn an_exported_array_comes_back_as_it_was() {
    let folder = TempDir::new().unwrap();
    let (yaml, out) = (folder.path().join("calibration.yaml"), folder.path().join("again.toml"));
    expect(&field(&["export", RIG, "--angles-deg", "30,-45", "--out", yaml.to_str().unwrap()]), 0);
    let text = fs::read_to_string(&yaml).unwrap();
    assert!(text.contains("# Frames at: bottom 30 deg, top -45 deg\n"), "{text}");
    let output = field(&[
        "import",
        yaml.to_str().unwrap(),
        "--config",
        RIG,
        "--coil-type",
        "iron",
        "--valid-from-x-mm",
        "43",
        "--out",
        out.to_str().unwrap(),
    ]);
    expect(&output, 0);
    let (before, after) = (load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(RIG)), load(&out));
    let angles = [30_f64.to_radians(), (-45_f64).to_radians()];
    let mut random = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..50 {
        let currents: Vec<f64> = (0..6).map(|_| random.random_range(-8.0..8.0)).collect();
        let point = Vector3::from_fn(|_, _| random.random_range(-0.03..0.03));
        let expected = modelled(&before, &angles, &currents, &point);
        let found = modelled(&after, &[0.0, 0.0], &currents, &point);
        assert!((found - expected).norm() < 1e-12 * expected.norm(), "{point}: {found} {expected}");
    }
}

#[test]
fn refusals_name_the_file_and_end_with_their_codes() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("spoiled.yaml");
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(FIXTURE)).unwrap();
    fs::write(&path, text.replace("- 2.5e-06", "- .nan")).unwrap();
    let output = field(&["import", path.to_str().unwrap()]);
    expect(&output, 65);
    let words = "spoiled.yaml:13: West.Src_0.B_Coeff[0]: .nan: must be a finite number";
    assert!(complaint(&output).contains(words), "{output:?}");
    expect(&field(&["import", "no-such.yaml"]), 66);
    let output = field(&["import", FIXTURE, "--config", RIG]);
    expect(&output, 2);
    assert!(complaint(&output).contains("whose circuit the coils have (air, iron)"), "{output:?}");
    let output = field(&["import", FIXTURE, "--config", RIG, "--coil-type", "steel"]);
    expect(&output, 2);
    assert!(complaint(&output).contains("(air, iron)"), "{output:?}");
    expect(&field(&["import", FIXTURE, "--coil-type", "air"]), 2);
    expect(&field(&["export", RIG, "--angles-deg", "30"]), 2);
    fs::write(&path, text.replace("South", "South_Offset")).unwrap();
    expect(&field(&["import", path.to_str().unwrap()]), 65);
    let output = field(&["import", path.to_str().unwrap(), "--without-background"]);
    expect(&output, 0);
    assert!(complaint(&output).contains("South_Offset, is left out"), "{output:?}");
}

/// Goal: a file with several sources a coil, as most are, is refused unless one source may stand for them;
/// then what that leaves is told and written down.
#[test]
fn several_sources_become_one_when_asked_for() {
    let folder = TempDir::new().unwrap();
    let (path, out) = (folder.path().join("several.yaml"), folder.path().join("coils.toml"));
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(FIXTURE)).unwrap();
    let more = "  Source_List: [Only, More]\n  More: {A_Coeff: ~, B_Coeff: [4.0e-7], Source_Direction: [0.3, 0.9, 0], Source_Position: [0.02, -0.1, 0]}\n";
    fs::write(&path, text.replace("  Source_List: [Only]\n", more)).unwrap();
    let output = field(&["import", path.to_str().unwrap()]);
    expect(&output, 65);
    let words = complaint(&output);
    assert!(words.contains("South.Source_List: 2 sources (Only, More): must be one source"), "{words}");
    assert!(words.contains("--one-source-within-percent"), "{words}");
    let within = |percent: &str| {
        let out = out.to_str().unwrap();
        field(&[
            "import",
            path.to_str().unwrap(),
            "--one-source-within-percent",
            percent,
            "--out",
            out,
            "--json",
        ])
    };
    expect(&within("0.001"), 65);
    let output = within("10");
    expect(&output, 0);
    let answer: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["coils"][0]["left_percent"], Value::Null);
    let left = answer["coils"][2]["left_percent"].as_f64().unwrap();
    assert!((0.001..10.0).contains(&left), "{left}");
    let told = format!("South: one source in place of 2 leaves {left:.2} % of the calibrated field");
    assert!(complaint(&output).contains(&told), "{output:?}");
    assert!(fs::read_to_string(&out).unwrap().contains(&told));
}
