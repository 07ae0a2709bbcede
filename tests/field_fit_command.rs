//! `magsteer field fit` as a user calls it: what it answers, draws and writes.

mod field_fit_calls;
mod field_support;

use std::fs;
use std::path::Path;
use std::process::Command;

use field_fit_calls::{RIG, answer, array_csv, complaint, fit};
use magsteer::config::Config;
use serde_json::Value;
use tempfile::TempDir;

/// Equal but for the last digit, which reading JSON may change.
fn alike(found: &[f64], expected: &[f64]) -> bool {
    let pairs = || found.iter().zip(expected);
    found.len() == expected.len() && pairs().all(|(a, b)| (a - b).abs() <= 1e-15 * b.abs())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
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
        let distance_mm = coil.distance_mm.unwrap();
        assert!((distance_mm - expected).abs() < 1e-5, "{}: {distance_mm}", coil.name);
    }
    assert_eq!(config.hardware.coils[0].distance_mm, Some(102.1));
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
    // The simulated plant is there as before, though its coils have other types now.
    let checked = Command::new(env!("CARGO_BIN_EXE_magsteer")).arg("check").arg(&out).output().unwrap();
    assert_eq!(checked.status.code(), Some(0), "{checked:?}");
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
