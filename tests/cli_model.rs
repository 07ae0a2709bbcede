//! `magsteer field` and `magsteer shape`, as another program would call them, against numbers made by independent tools.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use nalgebra::{Matrix3, Vector3};
use serde_json::{Value, json};

fn magsteer(arguments: &[&str]) -> Output {
    let root = env!("CARGO_MANIFEST_DIR");
    Command::new(env!("CARGO_BIN_EXE_magsteer")).args(arguments).current_dir(root).output().unwrap()
}

fn answer(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}{output:?}"))
}

/// The answer of a command that must succeed.
fn ask(arguments: &[&str]) -> Value {
    let output = magsteer(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
    answer(&output)
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A number, or a text that holds one, as the reference files have both.
fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| value.as_str().unwrap().parse().unwrap())
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().unwrap().iter().map(number))
}

fn matrix(value: &Value) -> Vec<Vec<f64>> {
    let rows = value.as_array().unwrap().iter();
    rows.map(|row| row.as_array().unwrap().iter().map(number).collect()).collect()
}

fn reference(case: &str) -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/rod_cases.json");
    let cases: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    cases[case].clone()
}

fn list(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
}

/// Goal: the field of each coil alone, as the published coefficients give it (mT per A, to their six decimals).
#[test]
fn field_at_agrees_with_the_test_vectors_of_the_array() {
    let cases = [
        (
            ["0", "0", "0"],
            "0,0",
            [
                [-2.105592, 2.072903, -2.189702, 2.088892, 0.0, 0.0],
                [0.0; 6],
                [1.431496, 1.357503, -1.422009, -1.363811, 0.712599, -0.712599],
            ],
        ),
        (
            ["0.02", "0.01", "-15e-3"],
            "30,-45",
            [
                [-3.568104, 1.54767, -0.765141, 1.220814, 0.239142, 0.101491],
                [-2.172848, 0.863916, 1.52386, -0.689881, 0.119571, 0.050745],
                [2.852145, 0.593322, -1.546604, -1.065856, 0.924062, -0.478856],
            ],
        ),
    ];
    for ([x, y, z], angles, expected_mt) in cases {
        for coil in 0..6 {
            let mut currents = [0.0; 6];
            currents[coil] = 1.0;
            let currents = list(&currents);
            let found =
                ask(&["field", "at", x, y, z, "--currents", &currents, "--angles-deg", angles, "--json"]);
            assert_eq!(found["valid"], true);
            let field_mt = vector(&found["field_t"]) * 1e3;
            for axis in 0..3 {
                let expected = expected_mt[axis][coil];
                assert!((field_mt[axis] - expected).abs() < 1e-6, "coil {coil}, axis {axis}: {field_mt:?}");
            }
            let gradient = matrix(&found["gradient_t_per_m"]);
            assert!((gradient[0][0] + gradient[1][1] + gradient[2][2]).abs() < 1e-12, "no divergence");
            assert!((gradient[0][1] - gradient[1][0]).abs() < 1e-12, "no curl");
        }
    }
}

#[test]
fn field_at_a_point_outside_the_models_range_answers_no_and_names_the_coil() {
    let output = magsteer(&["field", "at", "0", "0", "-0.06", "--currents", "0,0,0,0,1,0", "--json"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(answer(&output)["valid"], false);
    assert!(complaint(&output).contains("air-bottom"), "{output:?}");
    assert!(complaint(&output).contains("43.00 mm"), "{output:?}");
}

#[test]
fn field_at_needs_no_file_beside_the_program() {
    let elsewhere = tempfile::TempDir::new().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_magsteer"))
        .args(["field", "at", "0", "0", "0", "--currents", "1,0,0,0,0,0", "--json"])
        .current_dir(elsewhere.path())
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!((vector(&answer(&output)["field_t"]).x * 1e3 + 2.105592).abs() < 1e-6);
}

#[test]
fn a_wrong_count_is_a_usage_error_that_names_the_right_one() {
    let file = "config/bigmag-planar.toml";
    let none_of_coils = "config/reference-cantilever.toml";
    let cases: [(&[&str], &str); 8] = [
        (&["shape", file], "must be 6, one for each of the coils (iron-bottom-right"),
        (&["shape", file, "--currents", "1,2"], "--currents: 2 values: must be 6"),
        (
            &["shape", file, "--currents", "0,0,0,0,0,0", "--angles-deg", "-5"],
            "must be 2, one for each of the frames (bottom, top)",
        ),
        (&["shape", none_of_coils, "--currents", "1"], "must be 0"),
        (&["shape", file, "--uniform-field-t", "1,2"], "2 numbers: must be 3"),
        (&["shape", file, "--uniform-field-t", "0,0,1", "--currents", "0,0,0,0,0,0"], "cannot be used with"),
        (&["shape", none_of_coils, "--tip-force-n", "0,inf,0"], "must be finite"),
        (&["field", "at", "0", "0", "0", "--currents", "1,x"], "must be a number"),
    ];
    for (arguments, expected) in cases {
        let output = magsteer(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {output:?}");
        assert!(complaint(&output).contains(expected), "{arguments:?}: {}", complaint(&output));
        assert!(output.stdout.is_empty());
    }
}

/// Goal: the elastica under a dead tip force, to its discretisation error.
#[test]
fn shape_bends_the_reference_cantilever_into_the_elastica() {
    for row in reference("elastica_tip_force")["rows"].as_array().unwrap() {
        let force = format!("{},0,0", number(&row["alpha"]));
        let found = ask(&["shape", "config/reference-cantilever.toml", "--tip-force-n", &force, "--json"]);
        assert_eq!(found["converged"], true);
        let tip = vector(&found["tip_position_m"]);
        let expected = Vector3::new(number(&row["transverse"]), 0.0, number(&row["axial"]));
        assert!((tip - expected).norm() < 1e-8, "alpha {}: {tip:?} instead of {expected:?}", row["alpha"]);
        let tangent = vector(&found["tip_tangent"]);
        assert!((tangent.x.atan2(tangent.z) - number(&row["tip_angle_rad"])).abs() < 1e-8);
        let moment = vector(&found["base_moment_nm"]);
        assert!((moment.y - number(&row["alpha"]) * expected.z).abs() < 1e-7, "dead load times lever");
    }
}

#[test]
fn shape_bends_the_reference_cantilever_into_a_circle_by_a_tip_moment() {
    let found = ask(&["shape", "config/reference-cantilever.toml", "--tip-moment-nm", "0,2.5,0", "--json"]);
    let (sine, cosine) = 2.5_f64.sin_cos();
    let expected = Vector3::new((1.0 - cosine) / 2.5, 0.0, sine / 2.5);
    assert!((vector(&found["tip_position_m"]) - expected).norm() < 1e-9, "{found}");
}

/// A file that differs from a shipped one; the folder lives as long as it is held.
fn variant(of: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::TempDir::new().unwrap();
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(of);
    let path = folder.path().join("variant.toml");
    fs::write(&path, format!("extends = {base:?}\n{text}")).unwrap();
    (folder, path)
}

/// Rotation vector of a rotation matrix given by rows, away from half a turn.
fn log(rows: &[Vec<f64>]) -> Vector3<f64> {
    let axis = Vector3::new(rows[2][1] - rows[1][2], rows[0][2] - rows[2][0], rows[1][0] - rows[0][1]);
    let sine = axis.norm() / 2.0;
    let cosine = (rows[0][0] + rows[1][1] + rows[2][2] - 1.0) / 2.0;
    axis * (sine.atan2(cosine) / (2.0 * sine))
}

/// Turns the change of a rotation vector into an angular change in the world.
fn left_jacobian(rotation: &Vector3<f64>) -> Matrix3<f64> {
    let (angle, cross) = (rotation.norm(), rotation.cross_matrix());
    Matrix3::identity()
        + cross * ((1.0 - angle.cos()) / angle.powi(2))
        + cross * cross * ((angle - angle.sin()) / angle.powi(3))
}

/// Goal: poses, wrenches, base load and Jacobian of two magnets in an affine field, to the digits of the reference.
#[test]
fn shape_meets_the_two_magnet_reference_in_an_affine_field() {
    let magnet = |name: &str| {
        format!(
            "[[manipulator.parts]]\nmagnet = {{ name = \"{name}\", length_mm = 4.0, diameter_mm = 2.0, \
            density_kg_per_m3 = 7500.0, moment_body_a_m2 = [0.0, 0.0, 0.0132] }}\n"
        )
    };
    let section = |length: f64| {
        format!(
            "[[manipulator.parts]]\nsection = {{ material = \"rubber\", length_mm = {length:?}, \
            diameter_mm = 2.0, extensible = true }}\n"
        )
    };
    let parts = [section(25.0), magnet("m1"), section(20.0), magnet("m2")].concat();
    let text = format!("[manipulator]\nbase_position_mm = [0.0, 0.0, 0.0]\n{parts}");
    let (_folder, path) = variant("reference-two-magnets.toml", &text);
    let case = reference("two_magnets_affine");
    let inputs =
        ["B0x", "B0y", "B0z", "Gxx", "Gxy", "Gxz", "Gyy", "Gyz"].map(|name| number(&case["inputs"][name]));
    let (field, gradient) = (list(&inputs[..3]), list(&inputs[3..]));
    let path = path.to_str().unwrap();
    let found = ask(&["shape", path, "--uniform-field-t", &field, "--gradient-t-per-m", &gradient, "--json"]);
    let close = |key: &str, actual: Vector3<f64>, expected: Vector3<f64>| {
        let error = (actual - expected).norm();
        assert!(error < 1e-6 * expected.norm(), "{key}: {actual:?} instead of {expected:?}");
    };
    let base: Vec<f64> = case["xi_n0_m0"].as_array().unwrap().iter().map(number).collect();
    close("base force", vector(&found["base_force_n"]), Vector3::from_column_slice(&base[..3]));
    close("base moment", vector(&found["base_moment_nm"]), Vector3::from_column_slice(&base[3..]));
    let jacobian = matrix(&case["J"]);
    let exact = matrix(&found["jacobian"]["exact"]);
    for index in 0..2 {
        let (actual, expected) = (&found["magnets"][index], &case["magnets"][index]);
        close("force", vector(&actual["force_n"]), vector(&expected["F"]));
        let magnetic = vector(&actual["magnetic_force_n"]);
        let weight = vector(&actual["force_n"]) - magnetic;
        assert!(weight.x.abs() < 1e-12 && weight.y.abs() < 1e-12 && weight.z < -9e-4, "{weight}");
        let keys = [("position_m", "p"), ("tangent", "tangent"), ("field_t", "B"), ("torque_nm", "T")];
        for (key, reference) in keys {
            close(key, vector(&actual[key]), vector(&expected[reference]));
        }
        for row in 0..3 {
            close("rotation", vector(&actual["rotation"][row]), vector(&expected["R"][row]));
        }
        // Rows of the reference: position, then the rotation vector log R, whose derivative becomes one of the
        // tangent by the left Jacobian of rotations.
        let tangent = vector(&expected["tangent"]);
        let left = left_jacobian(&log(&matrix(&expected["R"])));
        for column in 0..8 {
            let by = |row: usize| jacobian[6 * index + 3 + row][column];
            let turning = (left * Vector3::new(by(0), by(1), by(2))).cross(&tangent);
            let actual = |row: usize| exact[3 * index + row][column];
            close("Jacobian", Vector3::new(actual(0), actual(1), actual(2)), turning);
        }
    }
    assert_eq!(found["jacobian"]["columns"], case["jac_columns"]);
    assert_eq!(
        found["jacobian"]["rows"],
        serde_json::json!(["m1.tx", "m1.ty", "m1.tz", "m2.tx", "m2.ty", "m2.tz"])
    );
}

/// Goal: the exact Jacobian, currents per ampere and angles per degree, is the derivative of the command's own answers.
#[test]
fn the_exact_jacobian_is_the_derivative_of_the_tangents_in_the_units_of_the_arguments() {
    let file = "config/reference-two-magnets.toml";
    let at = [1.0, -0.5, 0.5, 0.25, -1.0, 0.5, 20.0, -35.0];
    let shape = |at: &[f64; 8]| {
        let (currents, angles) = (list(&at[..6]), list(&at[6..]));
        ask(&["shape", file, "--currents", &currents, "--angles-deg", &angles, "--json"])
    };
    let tangents = |found: &Value| -> Vec<f64> {
        (0..2).flat_map(|magnet| vector(&found["magnets"][magnet]["tangent"]).as_slice().to_vec()).collect()
    };
    let center = shape(&at);
    let columns = ["I0", "I1", "I2", "I3", "I4", "I5", "theta_bottom_deg", "theta_top_deg"];
    assert_eq!(center["jacobian"]["columns"], serde_json::json!(columns));
    let exact = matrix(&center["jacobian"]["exact"]);
    let frozen = matrix(&center["jacobian"]["frozen_wrench"]);
    let scale = exact.iter().flatten().fold(0.0_f64, |most, entry| most.max(entry.abs()));
    assert!(scale > 1e-3, "the point is worth the test");
    // Truncation of the differences is about (1e-4)^2, rounding about 1e-12 / 1e-4.
    let step = 1e-4;
    let mut frozen_error = 0.0_f64;
    for column in 0..8 {
        let moved = |by: f64| {
            let mut moved = at;
            moved[column] += by;
            tangents(&shape(&moved))
        };
        let (ahead, behind) = (moved(step), moved(-step));
        for row in 0..6 {
            let difference = (ahead[row] - behind[row]) / (2.0 * step);
            let error = (exact[row][column] - difference).abs();
            assert!(error < 1e-6 * scale, "{row}, {column}: {} and {difference}", exact[row][column]);
            frozen_error = frozen_error.max((frozen[row][column] - difference).abs());
        }
    }
    assert!(frozen_error > 0.01 * scale, "wrenches that stay frozen give another Jacobian: {frozen_error}");
}

#[test]
fn shape_answers_no_with_a_reason_when_the_search_ends_before_the_equilibrium() {
    let (_folder, path) = variant("reference-cantilever.toml", "[rod]\npasses_max = 3\n");
    let path = path.to_str().unwrap();
    let output = magsteer(&["shape", path, "--tip-force-n", "10,0,0", "--json"]);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    assert_eq!(answer(&output)["converged"], false);
    assert!(complaint(&output).contains("no equilibrium was found: the bound on iterations"), "{output:?}");
}

/// Goal: the margin is the share of Euler's load, pi^2/4 here, that is left, though the straight column remains an equilibrium beyond
/// it; there it is unstable in both planes, and in as many ways more as odd multiples of pi/2 are passed.
#[test]
fn the_stability_margin_vanishes_at_eulers_load() {
    for (force, modes) in [("0", 0), ("-2.46", 0), ("-2.48", 2), ("-3", 2), ("-50", 4)] {
        let load = format!("0,0,{force}");
        let found = ask(&["shape", "config/reference-cantilever.toml", "--tip-force-n", &load, "--json"]);
        assert_eq!((&found["converged"], &found["unstable_modes"]), (&json!(true), &json!(modes)), "{found}");
        let expected = 1.0 + force.parse::<f64>().unwrap() * 4.0 / std::f64::consts::PI.powi(2);
        let margin = found["stability_margin"].as_f64().unwrap();
        assert!((margin - expected).abs() < 1e-8, "{margin} {expected}");
    }
    let told = magsteer(&["shape", "config/reference-cantilever.toml", "--tip-force-n", "0,0,-3"]);
    assert!(complaint(&told).contains("not stable"), "{told:?}");
}

#[test]
fn shape_answers_no_when_a_magnet_is_driven_out_of_the_models_range() {
    // Loaded upwards, the tip magnet comes within 43 mm of the upper air coil's expansion point.
    let file = "config/bigmag-planar.toml";
    let output =
        magsteer(&["shape", file, "--currents", "0,0,0,0,0,0", "--tip-force-n", "0,0,0.2", "--json"]);
    let found = answer(&output);
    let height = vector(&found["magnets"][1]["position_m"]).z;
    assert_eq!(found["magnets"][1]["field_valid"], height < 0.0855 - 0.043, "{height}");
    assert!(height > 0.0855 - 0.043, "the load must do it: {height}");
    assert_eq!(output.status.code(), Some(1));
    assert!(complaint(&output).contains("m2"), "{output:?}");
}

#[test]
fn shape_refuses_a_file_without_a_model() {
    let folder = tempfile::TempDir::new().unwrap();
    let path = folder.path().join("bare.toml");
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/reference-cantilever.toml");
    let text = fs::read_to_string(shipped).unwrap();
    fs::write(&path, &text[..text.find("[rod]").unwrap()]).unwrap();
    let output = magsteer(&["shape", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(78), "{output:?}");
    assert!(complaint(&output).contains("rod is missing: must be a table [rod]"), "{output:?}");
}

#[test]
fn every_command_has_help_with_an_example_and_tables_for_people() {
    for command in [&["check"][..], &["field", "at"], &["shape"]] {
        let output = magsteer(&[command, &["--help"]].concat());
        let help = String::from_utf8(output.stdout).unwrap();
        assert!(
            help.contains("Example") && help.contains(&format!("magsteer {}", command.join(" "))),
            "{help}"
        );
        assert!(help.contains("--json"), "{help}");
    }
    let table = magsteer(&["shape", "config/bigmag-planar.toml", "--currents", "2,-1,0,0,1.5,0"]);
    let text = String::from_utf8(table.stdout).unwrap();
    for part in ["equilibrium", "m1 position", "m2 torque", "theta_top_deg", "m2.tz"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}
