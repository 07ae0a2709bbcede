//! Data that `tune identify` refuses, each with line, column, value and what would be right.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use magsteer::config::Config;
use magsteer::control::identification::columns;
use magsteer::magnetics::CoilArray;
use magsteer::rod::{Pass, PassMode, TipLoad};
use tempfile::TempDir;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const RIG: &str = "config/bigmag-planar.toml";

fn identify(data: &[&Path], options: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["tune", "identify", RIG]).args(data).args(options).current_dir(ROOT);
    command.output().unwrap()
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Equilibria of the model itself, one coil after the other.
fn sound() -> String {
    let (_, config) = Config::load(&Path::new(ROOT).join(RIG)).unwrap();
    let (rig, manipulator) = (&config.description, config.manipulator.as_ref().unwrap());
    let mut text = columns(rig).join(",") + "\n";
    let mut pass = Pass::new(manipulator);
    for row in 0..12_usize {
        let mut currents = [0.0; 6];
        currents[row % 6] = if row < 6 { 0.8 } else { -0.8 };
        let posed = CoilArray::new(rig).posed(&[0.3, -0.2]);
        let field = posed.actuated(&currents);
        let solution = manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
        assert!(solution.converged());
        let mut cells: Vec<f64> = currents.to_vec();
        cells.extend([0.3_f64.to_degrees(), -0.2_f64.to_degrees()]);
        for magnet in pass.magnets() {
            cells.extend(magnet.position().iter().chain(&magnet.tangent()));
        }
        let cells: Vec<String> = cells.iter().map(|cell| format!("{cell:.9}")).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    text
}

/// The text with one cell replaced; the header is line 0.
fn with_cell(text: &str, line: usize, column: usize, cell: &str) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let mut cells: Vec<&str> = lines[line].split(',').collect();
    cells[column] = cell;
    lines[line] = cells.join(",");
    lines.join("\n") + "\n"
}

fn lines(text: &str, count: usize) -> String {
    text.lines().take(count).fold(String::new(), |text, line| text + line + "\n")
}

#[test]
fn wrong_data_are_refused_by_line_column_value_and_what_would_be_right() {
    let text = sound();
    let header = lines(&text, 1);
    let without = |name: &str| text.replacen(&format!("{name},"), "", 1);
    let millimetres = {
        let row = text.lines().nth(3).unwrap();
        let cells: Vec<String> = row
            .split(',')
            .enumerate()
            .map(|(index, cell)| {
                let value: f64 = cell.parse().unwrap();
                if (8..11).contains(&index) { format!("{}", value * 1e3) } else { cell.to_owned() }
            })
            .collect();
        text.replacen(row, &cells.join(","), 1)
    };
    let cases: Vec<(&str, String, &str)> = vec![
        (
            "empty",
            String::new(),
            ":1: header: an empty file: must be the header i0_a to i5_a, theta_bottom_deg,",
        ),
        ("header alone", header, ":1: header: the last line of the file: must be followed by"),
        (
            "milliamperes in the header",
            text.replace("i0_a", "i0_ma"),
            ":1: header: column \"i0_ma\": must be one of",
        ),
        ("a coil missing", without("i3_a"), ":1: header: no column i3_a: must be all of"),
        ("a frame missing", without("theta_top_deg"), ":1: header: no column theta_top_deg: must be"),
        (
            "half a tangent",
            without("m1_ty"),
            ":1: header: no column m1_ty: must be all of m1_tx, m1_ty, m1_tz",
        ),
        (
            "twice",
            text.replace("m2_tx", "m1_tx"),
            ":1: header: column m1_tx twice: must be columns that each",
        ),
        ("unknown magnet", text.replace("m2_", "m3_"), ":1: header: column \"m3_x_m\": must be one of"),
        ("cut", text[..text.len() - 20].to_owned(), ": must be a number: the line is cut short"),
        ("a word", with_cell(&text, 4, 2, "high"), ":5: i2_a: \"high\": must be a number"),
        ("NaN", with_cell(&text, 4, 12, "NaN"), ":5: m1_ty: \"NaN\": must be a finite number"),
        ("part of a magnet", with_cell(&text, 4, 12, ""), ":5: m1_ty: \"\": must be a number"),
        (
            "milliamperes",
            with_cell(&text, 2, 1, "800"),
            ":3: i1_a: 800: must be at most 8 A in magnitude (coil iron-bottom-left): milliamperes",
        ),
        (
            "angle",
            with_cell(&text, 2, 6, "200"),
            ":3: theta_bottom_deg: 200.000000: must be -180.0 to 180.0 deg, the range of frame bottom",
        ),
        ("millimetres", millimetres, ":4: m1_x_m, m1_y_m, m1_z_m: ["),
        ("not a direction", with_cell(&text, 2, 11, "57.3"), ":3: m1_tx, m1_ty, m1_tz: a vector 57."),
        (
            "few",
            lines(&text, 2),
            ":1: rows: 1, which give 10 equations for 9 parameters: must be at least 2,",
        ),
    ];
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("data.csv");
    for (name, text, expected) in cases {
        fs::write(&path, text).unwrap();
        let output = identify(&[&path], &[]);
        assert_eq!(output.status.code(), Some(65), "{name}: {output:?}");
        let complaint = complaint(&output);
        assert!(complaint.contains(expected) && complaint.contains("data.csv"), "{name}: {complaint}");
    }
}

/// Goal: signs turned round give no estimates: the model has no such equilibria, or says that tangents
/// point elsewhere.
#[test]
fn tangents_the_wrong_way_round_are_noted() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("data.csv");
    let text = sound();
    let turned: String = text
        .lines()
        .enumerate()
        .map(|(line, row)| {
            let cells = row.split(',').enumerate().map(|(index, cell)| {
                let is_tangent = (11..14).contains(&index) || (17..20).contains(&index);
                match cell.parse::<f64>() {
                    Ok(value) if is_tangent && line > 0 => format!("{:.9}", -value),
                    _ => cell.to_owned(),
                }
            });
            cells.collect::<Vec<_>>().join(",") + "\n"
        })
        .collect();
    fs::write(&path, turned).unwrap();
    let output = identify(&[&path], &[]);
    assert!(complaint(&output).contains("are they towards the tip"), "{output:?}");
}

#[test]
fn what_is_not_the_datas_fault_has_other_codes() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("data.csv");
    fs::write(&path, sound()).unwrap();
    let missing = folder.path().join("none.csv");
    let output = identify(&[&path, &missing], &[]);
    assert_eq!(output.status.code(), Some(66), "{output:?}");
    let held = ["modulus-percent", "moment-percent", "gain-percent", "base-mm", "base-deg"];
    let held: Vec<String> = held.iter().map(|name| format!("--prior-{name}=0")).collect();
    let held: Vec<&str> = held.iter().map(String::as_str).collect();
    assert_eq!(identify(&[&path], &held).status.code(), Some(2));
    assert_eq!(identify(&[&path], &["--noise-orientation-deg", "0"]).status.code(), Some(2));
    assert_eq!(identify(&[&path], &["--out", "/no/such/folder/out.toml"]).status.code(), Some(73));
    let output = identify(&[&path], &["--out", RIG]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(complaint(&output).contains("must be another file"), "{output:?}");
    let broken = folder.path().join("broken.toml");
    fs::write(&broken, "[rig]\nname = \"UPPER\"\n").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    let output = command.args(["tune", "identify"]).arg(&broken).arg(&path).output().unwrap();
    assert_eq!(output.status.code(), Some(78), "{output:?}");
}

/// Goal: two files count as one, quaternions as tangents, and cells left empty as magnets that were not
/// seen; the model's own equilibria move no parameter.
#[test]
fn several_files_quaternions_and_missing_magnets_are_read() {
    let folder = TempDir::new().unwrap();
    let [first, second] = ["a.csv", "b.csv"].map(|name| folder.path().join(name));
    let text = sound();
    fs::write(&first, &text).unwrap();
    let quaternions: String = text
        .lines()
        .enumerate()
        .map(|(line, row)| {
            let cells: Vec<&str> = row.split(',').collect();
            let head = cells[..8].join(",");
            if line == 0 {
                return format!("{head},m1_qx,m1_qy,m1_qz,m1_qw,m2_qx,m2_qy,m2_qz,m2_qw\n");
            }
            let quaternion = |at: usize| {
                let t: Vec<f64> = cells[at..at + 3].iter().map(|cell| cell.parse().unwrap()).collect();
                // The shortest rotation from z to the tangent.
                let w = ((1.0 + t[2]) / 2.0).sqrt();
                format!("{:.9},{:.9},0,{w:.9}", -t[1] / (2.0 * w), t[0] / (2.0 * w))
            };
            let unseen = ",,,".to_owned();
            let m1 = if line == 4 { unseen } else { quaternion(11) };
            format!("{head},{m1},{}\n", quaternion(17))
        })
        .collect();
    fs::write(&second, quaternions).unwrap();
    let output = identify(
        &[&first, &second],
        &["--json", "--noise-orientation-deg", "0.05", "--noise-position-mm", "0.05"],
    );
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(answer["samples"], 24);
    assert_eq!(answer["data"].as_array().unwrap().len(), 2);
    for parameter in answer["parameters"].as_array().unwrap() {
        let moved = parameter["moved_prior_sigma"].as_f64().unwrap();
        assert!(moved.abs() < 1e-3, "{parameter}");
    }
}
