//! `magsteer field fit` as a user calls it: files that are right, files that are wrong, and what comes of
//! them.

mod field_support;

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use magsteer::config::Config;
use magsteer::magnetics::{AppliedField, CoilArray, FieldSample};
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;
use tempfile::TempDir;

const GRID: &str = include_str!("reference/coil_grid.csv");
const RIG: &str = "config/bigmag-planar.toml";

fn fit(file: &Path, options: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_magsteer"));
    command.args(["field", "fit"]).arg(file).args(options).current_dir(env!("CARGO_MANIFEST_DIR"));
    command.output().unwrap()
}

fn answer(output: &Output) -> Value {
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Equal but for the last digit, which reading JSON may change.
fn alike(found: &[f64], expected: &[f64]) -> bool {
    let pairs = || found.iter().zip(expected);
    found.len() == expected.len() && pairs().all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// A calibration of BigMag with turned frames, each coil driven, with noise of 0.05 mT (uniform up to 0.0866
/// mT); and the angles, deg.
fn array_csv(rows: usize) -> (String, &'static str) {
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let rig = field_support::bigmag();
    let posed = CoilArray::new(&rig).posed(&[30_f64.to_radians(), (-45_f64).to_radians()]);
    let mut text = "px,py,pz,i0,i1,i2,i3,i4,i5,bx,by,bz\n".to_owned();
    for _ in 0..rows {
        let position = Vector3::from_fn(|_, _| random.random_range(-0.03..0.03));
        let currents: Vec<f64> = (0..6).map(|_| random.random_range(-8.0..8.0)).collect();
        let mut sample = FieldSample::default();
        posed.actuated(&currents).evaluate(&position, &mut sample);
        let field = sample.field + Vector3::from_fn(|_, _| random.random_range(-8.66e-5..8.66e-5));
        let cells: Vec<String> =
            position.iter().chain(&currents).chain(&field).map(|value| format!("{value:.9}")).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    (text, "30,-45")
}

#[test]
fn the_answer_has_its_stable_keys() {
    let found = answer(&fit(Path::new("tests/reference/coil_grid.csv"), &["--json"]));
    assert_eq!(found["order"], 4);
    let coefficients = numbers(&found["coefficients"]);
    assert!((coefficients[0] - 6.492e-7).abs() < 0.0005e-7, "{coefficients:?}");
    assert_eq!(found["origin_m"], 0.0);
    assert!((found["rms_norm_mt"].as_f64().unwrap() - 0.0982).abs() < 5e-5);
    let orders = found["orders"].as_array().unwrap();
    assert_eq!(orders.len(), 10);
    for (index, report) in orders.iter().enumerate() {
        assert_eq!(report["order"], index + 1);
        let [fitted, left_out] =
            ["rms_norm_mt", "holdout_rms_norm_mt"].map(|key| report[key].as_f64().unwrap());
        assert!(fitted < left_out, "{report}");
    }
    let coil = &found["coils"][0];
    assert_eq!(coil["coefficients"], found["coefficients"]);
    assert_eq!(numbers(&coil["standard_deviations"]).len(), 4);
    assert!(coil["valid_from_x_mm"].as_f64().unwrap() < 45.0);
    // What `sha256sum tests/reference/coil_grid.csv` prints.
    let digest = "fe7baf641bed385bac4da9af7ebce44c0fa794d56b6f5898a9f0ca2da78b13e0";
    assert_eq!(found["data"]["sha256"], digest);
}

#[test]
fn an_order_can_be_asked_for() {
    let found = answer(&fit(Path::new("tests/reference/coil_grid.csv"), &["--order", "6", "--json"]));
    assert_eq!(found["order"], 6);
    assert_eq!(numbers(&found["coefficients"]).len(), 6);
    assert!((found["rms_norm_mt"].as_f64().unwrap() - 0.0978).abs() < 5e-5);
    for order in ["0", "11", "many"] {
        let output = fit(Path::new("tests/reference/coil_grid.csv"), &["--order", order]);
        assert_eq!(output.status.code(), Some(2), "{order}: {output:?}");
    }
}

#[test]
fn people_get_tables() {
    let output = fit(Path::new("tests/reference/coil_grid.csv"), &[]);
    let text = String::from_utf8(output.stdout).unwrap();
    for part in ["1.6372", "0.0982", "4 *", "order 4: the lowest", "a4 ", "valid from x = 38.5 mm"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let help = String::from_utf8(fit(Path::new("--help"), &[]).stdout).unwrap();
    for part in ["Examples", "magsteer field fit", "--json", "--fit-origin", "px,py,pz,i0,...,iN,bx,by,bz"] {
        assert!(help.contains(part), "{part}: {help}");
    }
}

/// Goal: coefficients of one coil, written over a rig, are what the rig then uses; the rest of the type
/// stays.
#[test]
fn a_rig_uses_the_coefficients_written_for_it() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("fitted.toml");
    let options = ["--config", RIG, "--coil-type", "air", "--out", out.to_str().unwrap(), "--json"];
    let found = answer(&fit(Path::new("tests/reference/coil_grid.csv"), &options));
    let (_, config) = Config::load(&out).unwrap_or_else(|problems| panic!("{problems}"));
    for coil in &config.description.coils {
        let is_air = coil.name.starts_with("air");
        assert_eq!(alike(&coil.coefficients, &numbers(&found["coefficients"])), is_air, "{}", coil.name);
        assert_eq!((coil.valid_from_x - 0.0385).abs() < 1e-9, is_air, "{}", coil.name);
        assert_eq!(coil.current_max, 8.0);
    }
    let text = fs::read_to_string(&out).unwrap();
    assert!(text.contains(found["data"]["sha256"].as_str().unwrap()), "{text}");
}

/// Goal: without a rig the file holds the fitted keys alone, and a rig can extend it.
#[test]
fn a_rig_can_extend_the_coefficients_alone() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("air.toml");
    let options = ["--coil-type", "air", "--out", out.to_str().unwrap()];
    let output = fit(Path::new("tests/reference/coil_grid.csv"), &options);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let shipped = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(RIG)).unwrap();
    let (head, tail) = shipped.split_once("[coil_types.air]\n").unwrap();
    // The two keys that were fitted are left to the file that is extended.
    let rest: Vec<&str> = tail.lines().skip(2).collect();
    let text = format!("extends = \"air.toml\"\n{head}[coil_types.air]\n{}\n", rest.join("\n"));
    let rig = folder.path().join("rig.toml");
    fs::write(&rig, text).unwrap();
    let (_, config) = Config::load(&rig).unwrap_or_else(|problems| panic!("{problems}"));
    let air = config.description.coils.iter().find(|coil| coil.name == "air-top").unwrap();
    assert!((air.coefficients[0] - 6.492e-7).abs() < 0.0005e-7);
}

/// Goal: an expansion point that moved back moves the coils of the type away from the centre by as much.
#[test]
fn a_fitted_origin_moves_the_coils_of_the_type() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("fitted.toml");
    let options =
        ["--config", RIG, "--coil-type", "air", "--fit-origin", "--out", out.to_str().unwrap(), "--json"];
    let found = answer(&fit(Path::new("tests/reference/coil_grid.csv"), &options));
    let origin = found["origin_m"].as_f64().unwrap();
    assert!(origin < -1e-3, "{origin}");
    let (_, config) = Config::load(&out).unwrap_or_else(|problems| panic!("{problems}"));
    for coil in &config.hardware.coils {
        let expected = match coil.coil_type.as_str() {
            "air" => 85.5 - origin * 1e3,
            _ => continue,
        };
        assert!((coil.distance_mm - expected).abs() < 1e-5, "{}: {}", coil.name, coil.distance_mm);
    }
    assert_eq!(config.hardware.coils[0].distance_mm, 102.1);
}

/// Goal: an array measured at turned frames gives each coil its coefficients, to four of their deviations, in
/// a file that loads.
#[test]
fn an_array_is_calibrated_from_superposed_currents() {
    let folder = TempDir::new().unwrap();
    let (data, out) = (folder.path().join("array.csv"), folder.path().join("calibrated.toml"));
    let (text, angles) = array_csv(400);
    fs::write(&data, text).unwrap();
    let options =
        ["--config", RIG, "--angles-deg", angles, "--order", "4", "--out", out.to_str().unwrap(), "--json"];
    let found = answer(&fit(&data, &options));
    let rig = field_support::bigmag();
    let coils = found["coils"].as_array().unwrap();
    assert_eq!(coils.len(), 6);
    let mut errors = Vec::new();
    for (index, (coil, expected)) in coils.iter().zip(&rig.coils).enumerate() {
        assert_eq!(coil["name"], expected.name.as_str());
        assert_eq!(found["coefficients"][index], coil["coefficients"]);
        let deviations = numbers(&coil["standard_deviations"]);
        for ((a, expected), deviation) in
            numbers(&coil["coefficients"]).iter().zip(&expected.coefficients).zip(deviations)
        {
            errors.push((a - expected) / deviation);
        }
    }
    assert!(errors.iter().all(|error| error.abs() < 4.0), "{errors:?}");
    let square = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    assert!((0.3..3.0).contains(&square), "the deviations are about right: {errors:?}");
    let (_, config) = Config::load(&out).unwrap_or_else(|problems| panic!("{problems}"));
    for (coil, expected) in config.description.coils.iter().zip(coils) {
        assert!(alike(&coil.coefficients, &numbers(&expected["coefficients"])), "{}", coil.name);
        assert_eq!(coil.inductance, 0.1);
        assert!(coil.frame.is_some());
    }
    // At other angles the coils were elsewhere: the same readings cannot be explained.
    let wrong = fit(&data, &["--config", RIG, "--order", "4", "--json"]);
    assert!(complaint(&wrong).contains("% of the measured field"), "{wrong:?}");
    let wrong = answer(&wrong);
    let norm = |found: &Value| found["rms_norm_mt"].as_f64().unwrap();
    assert!(norm(&wrong) > 10.0 * norm(&found), "{} {}", norm(&wrong), norm(&found));
}

#[cfg(feature = "figures")]
#[test]
fn pictures_are_drawn_for_grids_and_arrays() {
    let folder = TempDir::new().unwrap();
    let data = folder.path().join("array.csv");
    let (text, angles) = array_csv(80);
    fs::write(&data, text).unwrap();
    let picture = folder.path().join("fit.png");
    let path = picture.to_str().unwrap();
    for (file, options) in [
        (Path::new("tests/reference/coil_grid.csv"), vec!["--picture", path]),
        (data.as_path(), vec!["--config", RIG, "--angles-deg", angles, "--picture", path]),
    ] {
        let output = fit(file, &options);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let bytes = fs::read(&picture).unwrap();
        assert!(bytes.starts_with(b"\x89PNG") && bytes.len() > 10_000, "{} bytes", bytes.len());
        fs::remove_file(&picture).unwrap();
    }
}

/// Line `line` (1 first) with the cell `column` (0 first) replaced.
fn with_cell(text: &str, line: usize, column: usize, cell: &str) -> String {
    let replaced = |(index, row): (usize, &str)| {
        if index + 1 != line {
            return row.to_owned();
        }
        let mut cells: Vec<&str> = row.split(',').collect();
        cells[column] = cell;
        cells.join(",")
    };
    text.lines().enumerate().map(replaced).collect::<Vec<_>>().join("\n") + "\n"
}

/// Every cell of a column, after the header, mapped.
fn with_column(text: &str, columns: &[usize], map: impl Fn(usize, f64) -> f64) -> String {
    let mut lines = text.lines();
    let mut mapped = format!("{}\n", lines.next().unwrap());
    for (index, row) in lines.enumerate() {
        let cells = row.split(',').enumerate().map(|(column, cell)| {
            if columns.contains(&column) {
                map(index, cell.parse().unwrap()).to_string()
            } else {
                cell.to_owned()
            }
        });
        writeln!(mapped, "{}", cells.collect::<Vec<_>>().join(",")).unwrap();
    }
    mapped
}

fn without_column(text: &str, column: usize) -> String {
    let without = |row: &str| {
        let cells = row.split(',').enumerate().filter(|(index, _)| *index != column).map(|(_, cell)| cell);
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    text.lines().map(without).collect()
}

fn first_lines(text: &str, count: usize) -> String {
    text.lines().take(count).map(|line| format!("{line}\n")).collect()
}

/// Goal: each wrong file ends with 65 and one sentence that says line, column, value and what would be right.
#[test]
fn every_wrong_file_is_refused_with_its_place() {
    let header = GRID.lines().next().unwrap();
    let at_one_place = format!("{header}\n{}", "60,0,0,4,8.1,0,0\n".repeat(20));
    let on_the_axis_at_one_x = format!("{header}\n{}", "60,0,0,4,8.1,0,0\n60,0,0,2,4.0,0,0\n".repeat(10));
    let cut = &GRID[..GRID.len() - 11];
    let (array, _) = array_csv(60);
    let array_header = array.lines().next().unwrap();
    let mut latin = GRID.as_bytes()[..100].to_vec();
    latin.extend(b"\xb5T\n");
    let few: String = first_lines(GRID, 3);
    let weak = with_column(&array, &[3, 4, 5, 6, 7, 8], |_, current| current / 50.0);
    let weak_in_millitesla = with_column(&weak, &[9, 10, 11], |_, b| b * 1e3 / 50.0);
    let wrong: Vec<(&str, Vec<u8>, &[&str], &str)> = vec![
        ("empty", vec![], &[], ":1: header: an empty file: must be the header x_mm,"),
        ("blank", b"\n\n \n".to_vec(), &[], ":1: header: an empty file: must be the header"),
        (
            "header alone",
            format!("{header}\n").into(),
            &[],
            ":1: header: the last line of the file: must be followed by",
        ),
        (
            "no header",
            GRID.lines().nth(1).unwrap().into(),
            &[],
            ":1: header: 45.0,-50.0,0.0,4.0,4.4,-5.5,0.0: must be x_mm,",
        ),
        (
            "other unit",
            GRID.replace("x_mm", "x_m").into(),
            &[],
            ":1: header: column \"x_m\": must be one of x_mm,",
        ),
        (
            "other columns",
            GRID.replace("bz_mt", "t_s").into(),
            &[],
            ":1: header: column \"t_s\": must be one of",
        ),
        ("semicolons", GRID.replace(',', ";").into(), &[], ":1: header: x_mm;y_mm;"),
        ("column twice", GRID.replace("y_mm", "x_mm").into(), &[], ":1: header: column x_mm twice: must be"),
        (
            "no column bz",
            "x_mm,y_mm,z_mm,current_a,bx_mt,by_mt\n1,2,3,4,5,6\n".into(),
            &[],
            ":1: header: no column bz_mt: must be",
        ),
        (
            "current missing",
            array.replace("i3", "i7").into(),
            &["--config", RIG],
            ":1: header: no column i3: must be",
        ),
        (
            "too few currents",
            without_column(&array, 8).into(),
            &["--config", RIG],
            ":1: i4: the last of 5 currents: must be i5, one current a coil (iron-bottom-right,",
        ),
        ("not UTF-8", latin, &[], ":3: text: 0xb5 as byte 26: must be UTF-8"),
        ("UTF-16", b"\xff\xfex\0_\0".to_vec(), &[], ":1: text: 0xff as byte 1: must be UTF-8"),
        ("a word", with_cell(GRID, 7, 4, "high").into(), &[], ":7: bx_mt: \"high\": must be a number"),
        ("an empty cell", with_cell(GRID, 7, 4, "").into(), &[], ":7: bx_mt: \"\": must be a number"),
        ("NaN", with_cell(GRID, 9, 5, "NaN").into(), &[], ":9: by_mt: \"NaN\": must be a finite number"),
        (
            "infinite",
            with_cell(GRID, 9, 3, "-inf").into(),
            &[],
            ":9: current_a: \"-inf\": must be a finite number",
        ),
        (
            "too large",
            with_cell(GRID, 9, 3, "1e999").into(),
            &[],
            ":9: current_a: \"1e999\": must be a finite number",
        ),
        (
            "cut",
            cut.into(),
            &[],
            ":379: by_mt: nothing, after 5 of 7 columns: must be a number: the line is cut short",
        ),
        (
            "a column more",
            GRID.replacen("0.0\n", "0.0,1\n", 1).into(),
            &[],
            ":2: line: \"1\" after the last column: must be 7 columns",
        ),
        (
            "far away",
            with_cell(GRID, 5, 0, "20000").into(),
            &[],
            ":5: x_mm: 20000: must be at most 10 m: in mm, as the header says?",
        ),
        (
            "strong",
            with_cell(GRID, 5, 4, "20000").into(),
            &[],
            ":5: bx_mt: 20000: must be at most 10 T: in mT, as the header says?",
        ),
        (
            "a current beyond reason",
            with_cell(GRID, 5, 3, "-1e200").into(),
            &[],
            ":5: current_a: -1e200: must be at most 10000 A",
        ),
        (
            "metres for millimetres",
            with_column(GRID, &[0, 1, 2], |_, x| x * 1e-3).into(),
            &[],
            ":2: y_mm: -0.05: must be at least 1 mm from the coil's expansion point at (0, 0, 0): metres in place of millimetres?",
        ),
        (
            "one row in metres",
            with_cell(&with_cell(GRID, 12, 0, "0.045"), 12, 1, "0").into(),
            &[],
            ":12: x_mm: 0.045: must be at least 1 mm",
        ),
        (
            "tesla for millitesla",
            with_column(GRID, &[4, 5, 6], |_, b| b * 1e-3).into(),
            &[],
            ": bx_mt: 0.0125: must be above 0.1 mT somewhere (this is the largest field of the file): tesla in place of millitesla?",
        ),
        (
            "some rows in tesla",
            with_column(GRID, &[4, 5, 6], |row, b| if row > 250 { b * 1e-3 } else { b }).into(),
            &[],
            "a thousand times less: in mT in all rows?",
        ),
        (
            "some rows in microtesla",
            with_column(GRID, &[4, 5, 6], |row, b| if row == 200 { b * 1e3 } else { b }).into(),
            &[],
            "a thousand times more: in mT in all rows?",
        ),
        (
            "never driven",
            with_column(GRID, &[3], |_, _| 0.0).into(),
            &[],
            ":1: current_a: 0 in every row: must be other than 0 in some rows",
        ),
        (
            "one place",
            at_one_place.into(),
            &[],
            ":1: rows: do not determine a2 of the coil at order 2: must be spread over more places",
        ),
        (
            "one place, two currents",
            on_the_axis_at_one_x.into(),
            &[],
            ":1: rows: do not determine a2 of the coil at order 2",
        ),
        (
            "few",
            few.clone().into(),
            &["--order", "6"],
            ":1: rows: 2, which give 6 equations for the 6 unknowns of order 6: must be at least 3",
        ),
        (
            "one row",
            first_lines(GRID, 2).into(),
            &[],
            ":1: rows: 1, which give 3 equations for the 2 unknowns of order 2: must be at least 10",
        ),
        (
            "array in millimetres",
            with_column(&array, &[0, 1, 2], |_, x| x * 1e3).into(),
            &["--config", RIG],
            "must be at most 10 m: in m, as the header says?",
        ),
        (
            "one row of an array in millimetres",
            with_cell(&with_cell(&array, 8, 0, "3.0"), 8, 1, "0").into(),
            &["--config", RIG],
            ":8: px: 3: must be within ten radii (0.55 m) of the workspace's centre: millimetres in place of metres?",
        ),
        (
            "array in millitesla",
            weak_in_millitesla.into(),
            &["--config", RIG],
            ":1: bx, by, bz: 1e3 times what the configured coefficients give: must be in tesla: millitesla?",
        ),
        (
            "a coil of an array never driven",
            with_column(&array, &[6], |_, _| 0.0).into(),
            &["--config", RIG],
            ":1: i3: 0 in every row: must be other than 0 in some rows: without current coil iron-top-left cannot be fitted",
        ),
        (
            "few rows of an array",
            first_lines(&array, 3).into(),
            &["--config", RIG],
            ":1: rows: 2, which give 6 equations for the 6 unknowns of order 1: must be at least 3",
        ),
        (
            "array header alone",
            format!("{array_header}\n").into(),
            &["--config", RIG],
            ":1: header: the last line of the file",
        ),
    ];
    let folder = TempDir::new().unwrap();
    let mut failures = Vec::new();
    for (name, bytes, options, expected) in wrong {
        let path = folder.path().join(format!("{}.csv", name.replace(' ', "-")));
        fs::write(&path, bytes).unwrap();
        let output = fit(&path, options);
        let complaint = complaint(&output);
        let place = format!("{}:", path.display());
        let errors = complaint.lines().filter(|line| line.starts_with("error:")).count();
        let is_right = output.status.code() == Some(65)
            && complaint.contains(&place)
            && complaint.contains(expected)
            && errors == 1
            && output.stdout.is_empty();
        if !is_right {
            failures.push(format!("{name}: {:?}: {complaint}", output.status.code()));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn what_is_not_the_datas_fault_has_other_codes() {
    let missing = fit(Path::new("tests/reference/no-such.csv"), &[]);
    assert_eq!(missing.status.code(), Some(66), "{missing:?}");
    assert!(complaint(&missing).contains("no-such.csv: cannot be read: no such file"), "{missing:?}");
    let grid = Path::new("tests/reference/coil_grid.csv");
    let no_rig = fit(grid, &["--config", "config/no-such.toml"]);
    assert_eq!(no_rig.status.code(), Some(66), "{no_rig:?}");
    let folder = TempDir::new().unwrap();
    let array = folder.path().join("array.csv");
    fs::write(&array, array_csv(60).0).unwrap();
    let out = folder.path().join("out.toml");
    let out = out.to_str().unwrap();
    for (file, options, expected) in [
        (array.as_path(), vec![], "`--config FILE` must say where its coils are"),
        (&array, vec!["--config", RIG, "--coil-type", "air"], "must be left out: each coil of an array"),
        (&array, vec!["--config", RIG, "--angles-deg", "1"], "1 values: must be 2"),
        (grid, vec!["--angles-deg", "1,2"], "one coil is measured in its own frame"),
        (grid, vec!["--config", RIG, "--out", out], "must say which coil type was measured (air, iron)"),
        (
            grid,
            vec!["--config", RIG, "--coil-type", "gold", "--out", out],
            "must be a coil type of the configuration",
        ),
        (grid, vec!["--valid-within-percent", "0"], "above 0"),
    ] {
        let output = fit(file, &options);
        assert_eq!(output.status.code(), Some(2), "{options:?}: {output:?}");
        assert!(complaint(&output).contains(expected), "{options:?}: {output:?}");
    }
    let nowhere = fit(grid, &["--out", "/no/such/folder/out.toml"]);
    assert_eq!(nowhere.status.code(), Some(73), "{nowhere:?}");
}

/// Goal: what other programs make of a CSV does no harm: a mark in front, carriage returns, blank lines,
/// remarks, other orders of columns, no last line end.
#[test]
fn harmless_differences_change_nothing() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("grid.csv");
    let expected = answer(&fit(Path::new("tests/reference/coil_grid.csv"), &["--json"]));
    let swapped: String = GRID
        .lines()
        .map(|line| {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells.swap(0, 6);
            cells.join(" , ") + "\r\n"
        })
        .collect();
    let remarked = format!("\u{feff}# probe 3\n\n{GRID}\n# end\n");
    for text in [swapped, remarked, GRID.trim_end().to_owned()] {
        fs::write(&path, text).unwrap();
        let output = fit(&path, &["--json"]);
        assert_eq!(answer(&output)["coefficients"], expected["coefficients"]);
        let is_cut = complaint(&output).contains("the last line has no end");
        assert_eq!(is_cut, !fs::read_to_string(&path).unwrap().ends_with('\n'));
    }
}
