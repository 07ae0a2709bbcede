//! Mistyped configurations: each is refused with its file, line, value and what would be right.

mod right_config;

use magsteer::config::ProblemKind;
use right_config::{RIGHT, STEERING, line_of, refused};

/// One change to [`RIGHT`], and what the refusal must say.
struct Case {
    claim: &'static str,
    /// Text to be replaced, and by what.
    change: (&'static str, &'static str),
    /// Text on the line that must be named.
    line: &'static str,
    kind: ProblemKind,
    key: &'static str,
    /// Part of the value that must be quoted.
    value: &'static str,
    /// Part of what must be given as right.
    expected: &'static str,
}

use ProblemKind::{Missing, Syntax, UnknownKey, Value};

#[rustfmt::skip]
const CASES: &[Case] = &[
    Case { claim: "an unknown key is refused and the near one suggested",
        change: ("distance_mm = 100.0", "distance = 100.0\ndistance_mm = 100.0"), line: "distance = 100.0",
        kind: UnknownKey, key: "coils[0].distance", value: "100.0", expected: "did you mean `distance_mm`?" },
    Case { claim: "a coil placed in half of one way is refused with both ways",
        change: ("distance_mm = 100.0\n", ""), line: "[[coils]]",
        kind: Value, key: "coils[0]", value: "placed by azimuth_deg, elevation_deg", expected: "or by position_mm and axis" },
    Case { claim: "a coil placed in both ways is refused with both ways",
        change: ("distance_mm = 100.0", "distance_mm = 100.0\nposition_mm = [1.0, 2.0, 3.0]"), line: "[[coils]]",
        kind: Value, key: "coils[0]", value: "distance_mm, position_mm", expected: "azimuth_deg, elevation_deg and distance_mm, or" },
    Case { claim: "an axis without a direction is refused",
        change: ("azimuth_deg = 0.0\nelevation_deg = -30.0\ndistance_mm = 100.0", "position_mm = [-90.0, 0.0, 0.0]\naxis = [0.0, 0.0, 0.0]"),
        line: "axis = [0.0, 0.0, 0.0]", kind: Value, key: "coils[0].axis", value: "[0.0, 0.0, 0.0]", expected: "other than zero" },
    Case { claim: "an unknown table is refused and the near one suggested",
        change: ("[rig]", "[deamon]\nrate_hz = 1000.0\n\n[rig]"), line: "[deamon]",
        kind: UnknownKey, key: "deamon", value: "[deamon]", expected: "did you mean `daemon`?" },
    Case { claim: "an unknown key in an inline table is refused",
        change: ("extensible = false", "extensible = false, color = \"red\""), line: "color = ",
        kind: UnknownKey, key: "manipulator.parts[0].section.color", value: "\"red\"", expected: "one of material, length_mm" },
    Case { claim: "an unknown part is refused",
        change: ("magnet = {", "magnets = {"), line: "magnets = {",
        kind: UnknownKey, key: "manipulator.parts[1].magnets", value: "{ name = \"m1\"", expected: "did you mean `magnet`?" },
    Case { claim: "a missing key is named with its table's line",
        change: ("inductance_h = 0.1\n", ""), line: "[coil_types.air]",
        kind: Missing, key: "coil_types.air.inductance_h", value: "", expected: "given in `coil_types.air`" },
    Case { claim: "a missing table is named",
        change: ("[rig]\nname", "[rig_]\nname"), line: "",
        kind: Missing, key: "rig", value: "", expected: "given in the file" },
    Case { claim: "a text in place of a number is refused",
        change: ("resistance_ohm = 5.0", "resistance_ohm = \"5 ohm\""), line: "resistance_ohm",
        kind: Value, key: "coil_types.air.resistance_ohm", value: "\"5 ohm\"", expected: "a number" },
    Case { claim: "a number in place of a text is refused",
        change: ("type = \"air\"", "type = 1"), line: "type = 1",
        kind: Value, key: "coils[0].type", value: "1", expected: "a text in quotes" },
    Case { claim: "a number in place of a boolean is refused",
        change: ("extensible = false", "extensible = 0"), line: "extensible = 0",
        kind: Value, key: "manipulator.parts[0].section.extensible", value: "0", expected: "true or false" },
    Case { claim: "a vector of two components is refused",
        change: ("gravity_m_per_s2 = [0.0, 0.0, -9.81]", "gravity_m_per_s2 = [0.0, -9.81]"), line: "gravity_m_per_s2",
        kind: Value, key: "rig.gravity_m_per_s2", value: "[0.0, -9.81]", expected: "an array of 3 numbers" },
    Case { claim: "a vector of four components is refused",
        change: ("base_tangent = [1.0, 0.0, 0.0]", "base_tangent = [1.0, 0.0, 0.0, 0.0]"), line: "base_tangent",
        kind: Value, key: "manipulator.base_tangent", value: "[1.0, 0.0, 0.0, 0.0]", expected: "not of 4" },
    Case { claim: "an array in place of a table is refused",
        change: ("[[coils]]", "[coils]"), line: "[coils]",
        kind: Value, key: "coils", value: "[coils]", expected: "an array" },
    Case { claim: "a part with a section and a magnet is refused",
        change: ("[[manipulator.parts]]\nmagnet", "magnet"), line: "[[manipulator.parts]]",
        kind: Value, key: "manipulator.parts[0]", value: "", expected: "exactly one of section, stiffness_section, magnet" },
    Case { claim: "a negative limit is refused",
        change: ("current_max_a = 8.0", "current_max_a = -8.0"), line: "current_max_a",
        kind: Value, key: "coil_types.air.current_max_a", value: "-8", expected: "from 0.001 to 1000" },
    Case { claim: "a slew limit that is not a number is refused",
        change: ("slew_max_a_per_s = 300.0", "slew_max_a_per_s = nan"), line: "slew_max_a_per_s",
        kind: Value, key: "coil_types.air.slew_max_a_per_s", value: "NaN", expected: "from 0.8 to 1000000" },
    Case { claim: "an infinite workspace is refused",
        change: ("workspace_diameter_mm = 110.0", "workspace_diameter_mm = inf"), line: "workspace_diameter_mm",
        kind: Value, key: "rig.workspace_diameter_mm", value: "inf", expected: "from 1 to 10000" },
    Case { claim: "a coefficient that is not a number is refused",
        change: ("[6.4e-7, 1.9e-8]", "[6.4e-7, nan]"), line: "coefficients_si",
        kind: Value, key: "coil_types.air.coefficients_si", value: "NaN", expected: "finite" },
    Case { claim: "a coil without coefficients is refused",
        change: ("[6.4e-7, 1.9e-8]", "[]"), line: "coefficients_si",
        kind: Value, key: "coil_types.air.coefficients_si", value: "0 coefficients", expected: "1 to 10" },
    Case { claim: "a series of order eleven is refused",
        change: ("[6.4e-7, 1.9e-8]", "[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]"), line: "coefficients_si",
        kind: Value, key: "coil_types.air.coefficients_si", value: "11 coefficients", expected: "1 to 10" },
    Case { claim: "a length of zero is refused",
        change: ("length_mm = 25.0", "length_mm = 0.0"), line: "length_mm = 0.0",
        kind: Value, key: "manipulator.parts[0].section.length_mm", value: "0", expected: "from 0.1" },
    Case { claim: "a negative diameter is refused",
        change: ("length_mm = 4.0, diameter_mm = 2.0", "length_mm = 4.0, diameter_mm = -2.0"), line: "diameter_mm = -2.0",
        kind: Value, key: "manipulator.parts[1].magnet.diameter_mm", value: "-2", expected: "from 0.01 to 1000" },
    Case { claim: "a Poisson's ratio above one half is refused",
        change: ("poisson_ratio = 0.45", "poisson_ratio = 0.6"), line: "poisson_ratio",
        kind: Value, key: "manipulator.materials.rubber.poisson_ratio", value: "0.6", expected: "from 0 to 0.5" },
    Case { claim: "a negative density is refused",
        change: ("density_kg_per_m3 = 1030.0", "density_kg_per_m3 = -1.0"), line: "density_kg_per_m3 = -1.0",
        kind: Value, key: "manipulator.materials.rubber.density_kg_per_m3", value: "-1", expected: "0, or from 10 to 30000" },
    Case { claim: "an elevation beyond the zenith is refused",
        change: ("elevation_deg = -30.0", "elevation_deg = -120.0"), line: "elevation_deg",
        kind: Value, key: "coils[0].elevation_deg", value: "-120", expected: "from -90 to 90" },
    Case { claim: "a range of angles that is upside down is refused",
        change: ("angle_max_deg = 180.0", "angle_max_deg = -181.0"), line: "angle_max_deg",
        kind: Value, key: "frames[0].angle_max_deg", value: "-181", expected: "from -180 to 360" },
    Case { claim: "an axis of length zero is refused",
        change: ("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 0.0, 0.0]"), line: "axis = ",
        kind: Value, key: "frames[0].axis", value: "[0.0, 0.0, 0.0]", expected: "other than zero" },
    Case { claim: "an unknown frame is refused and the known ones named",
        change: ("frame = \"bottom\"", "frame = \"side\""), line: "frame = \"side\"",
        kind: Value, key: "coils[0].frame", value: "side", expected: "bottom" },
    Case { claim: "an unknown coil type is refused and the known ones named",
        change: ("type = \"air\"", "type = \"iron\""), line: "type = \"iron\"",
        kind: Value, key: "coils[0].type", value: "iron", expected: "air" },
    Case { claim: "an unknown material is refused and the known ones named",
        change: ("material = \"rubber\"", "material = \"steel\""), line: "material = \"steel\"",
        kind: Value, key: "manipulator.parts[0].section.material", value: "steel", expected: "rubber" },
    Case { claim: "a rig's name that cannot name a channel is refused",
        change: ("name = \"bench\"", "name = \"Bench 1\""), line: "name = \"Bench 1\"",
        kind: Value, key: "rig.name", value: "Bench 1", expected: "lower-case letters, digits and hyphens" },
    Case { claim: "a magnet outside the workspace is refused with its place",
        change: ("workspace_diameter_mm = 110.0", "workspace_diameter_mm = 5.0"), line: "magnet = {",
        kind: Value, key: "manipulator.parts[1].magnet", value: "(-3, 0, 0) mm", expected: "at most 2.5 mm from (0, 0, 0) mm" },
    Case { claim: "a magnet outside the range of a coil's model is refused with the coil",
        change: ("distance_mm = 100.0", "distance_mm = 45.0"), line: "magnet = {",
        kind: Value, key: "manipulator.parts[1].magnet", value: "(-3, 0, 0) mm", expected: "coil \"left\": at least 43 mm" },
    Case { claim: "a key of another table is refused and that table named",
        change: ("base_roll_deg = 0.0", "base_roll_deg = 0.0\nyoung_modulus_mpa = 2.5"), line: "young_modulus_mpa = 2.5",
        kind: UnknownKey, key: "manipulator.young_modulus_mpa", value: "2.5", expected: "did you mean `manipulator.materials.rubber.young_modulus_mpa`?" },
    Case { claim: "a modulus in pascals is refused with the number in megapascals",
        change: ("young_modulus_mpa = 2.0", "young_modulus_mpa = 2000000.0"), line: "young_modulus_mpa",
        kind: Value, key: "manipulator.materials.rubber.young_modulus_mpa", value: "2000000", expected: "from 0.001 to 1000000, in MPa: 2000000 Pa would be 2" },
    Case { claim: "a manipulator without a flexible section is refused",
        change: ("section = { material = \"rubber\", length_mm = 25.0, diameter_mm = 2.0, extensible = false }",
            "magnet = { name = \"m0\", length_mm = 4.0, diameter_mm = 2.0, density_kg_per_m3 = 7500.0, moment_body_a_m2 = [0.0, 0.0, 0.01] }"),
        line: "[[manipulator.parts]]",
        kind: Value, key: "manipulator.parts", value: "no section", expected: "at least one flexible section" },
    Case { claim: "a key given twice is refused",
        change: ("base_roll_deg = 0.0", "base_roll_deg = 0.0\nbase_roll_deg = 1.0"), line: "base_roll_deg = 1.0",
        kind: Syntax, key: "", value: "base_roll_deg", expected: "duplicate key" },
    Case { claim: "a text without its closing quote is refused",
        change: ("name = \"left\"", "name = \"left"), line: "name = \"left",
        kind: Syntax, key: "", value: "", expected: "expected `\"`" },
    Case { claim: "an integer beyond 64 bits is refused",
        change: ("supply_v = 48.0", "supply_v = 99999999999999999999"), line: "supply_v",
        kind: Value, key: "coil_types.air.supply_v", value: "99999999999999999999", expected: "64 bits" },
];

#[rustfmt::skip]
const STEERING_CASES: &[Case] = &[
    Case { claim: "an unknown key of the monitors is refused and the near one suggested",
        change: ("open_share = 0.5", "open_shares = 0.5\nopen_share = 0.5"), line: "open_shares",
        kind: UnknownKey, key: "daemon.monitors.open_shares", value: "0.5", expected: "did you mean `open_share`?" },
    Case { claim: "a key of a table below is refused and that table named",
        change: ("damping = 1e-4", "damping = 1e-4\nframe_share_deg = 1.0"), line: "frame_share_deg = 1.0",
        kind: UnknownKey, key: "control.frame_share_deg", value: "1.0", expected: "did you mean `control.secondary.frame_share_deg`?" },
    Case { claim: "a key of another section is refused and that section named",
        change: ("damping = 1e-4", "damping = 1e-4\npose_hold_ms = 60.0"), line: "pose_hold_ms = 60.0",
        kind: UnknownKey, key: "control.pose_hold_ms", value: "60.0", expected: "did you mean `daemon.pose_hold_ms`?" },
    Case { claim: "a table at the wrong level is refused and the right one named",
        change: ("[daemon.recorder]", "[recorder]\nfolder = \"other\"\n\n[daemon.recorder]"), line: "[recorder]",
        kind: UnknownKey, key: "recorder", value: "[recorder]", expected: "did you mean `daemon.recorder`?" },
    Case { claim: "a key that resembles none is refused with some of those that there are",
        change: ("damping = 1e-4", "damping = 1e-4\nxyz = 60.0"), line: "xyz = 60.0",
        kind: UnknownKey, key: "control.xyz", value: "60.0", expected: " more" },
    Case { claim: "a mode that there is not is refused",
        change: ("mode = \"active\"", "mode = \"off\""), line: "mode = \"off\"",
        kind: Value, key: "daemon.mode", value: "\"off\"", expected: "passive" },
    Case { claim: "a share that leaves no warning is refused",
        change: ("coil_heat_warn = 0.8", "coil_heat_warn = 1.0"), line: "coil_heat_warn",
        kind: Value, key: "daemon.monitors.coil_heat_warn", value: "1", expected: "above 0 and below 1" },
    Case { claim: "a rate above the range is refused with the range",
        change: ("rate_hz = 1000.0\ncommand", "rate_hz = 50000.0\ncommand"), line: "rate_hz = 50000.0",
        kind: Value, key: "daemon.rate_hz", value: "50000", expected: "from 50 to 10000" },
    Case { claim: "a rate below the range is refused with the range",
        change: ("rate_hz = 1000.0\ncommand", "rate_hz = 49.0\ncommand"), line: "rate_hz = 49.0",
        kind: Value, key: "daemon.rate_hz", value: "49", expected: "from 50 to 10000" },
    Case { claim: "a time-out shorter than the one before it is refused",
        change: ("pose_stop_ms = 250.0", "pose_stop_ms = 40.0"), line: "pose_stop_ms",
        kind: Value, key: "daemon.pose_stop_ms", value: "40", expected: "above pose_hold_ms = 50" },
    Case { claim: "an unknown word is refused and the known ones named",
        change: ("\"best-effort\"", "\"best-efort\""), line: "realtime",
        kind: Value, key: "daemon.realtime", value: "\"best-efort\"", expected: "best-effort, enforce; did you mean `best-effort`?" },
    Case { claim: "a priority that the kernel does not have is refused",
        change: ("priority = 80", "priority = 100"), line: "priority",
        kind: Value, key: "daemon.priority", value: "100", expected: "from 1 to 99" },
    Case { claim: "a fraction of a whole number is refused",
        change: ("priority = 80", "priority = 80.5"), line: "priority",
        kind: Value, key: "daemon.priority", value: "80.5", expected: "a whole number" },
    Case { claim: "a negative whole number is refused",
        change: ("priority = 80", "priority = 80\ncpu = -1"), line: "cpu = -1",
        kind: Value, key: "daemon.cpu", value: "-1", expected: "a whole number from 0" },
    Case { claim: "a mesh without a step is refused",
        change: ("segment_length_max_mm = 3.2", "segment_length_max_mm = 0.0"), line: "segment_length_max_mm",
        kind: Value, key: "rod.segment_length_max_mm", value: "0", expected: "from 0.001 to 1000" },
    Case { claim: "a tolerance below rounding is refused",
        change: ("residual_tolerance = 1e-10", "residual_tolerance = 1e-20"), line: "residual_tolerance",
        kind: Value, key: "rod.residual_tolerance", value: "0.00000000000000000001", expected: "from 0.00000000000001 to 0.01" },
    Case { claim: "a gain of zero is refused",
        change: ("proportional_per_s = 5.0", "proportional_per_s = 0.0"), line: "proportional_per_s",
        kind: Value, key: "control.proportional_per_s", value: "0", expected: "from 0.001 to 1000" },
    Case { claim: "an unknown law is refused and the known ones named",
        change: ("\"bounded\"", "\"pseudoinverse\""), line: "allocation",
        kind: Value, key: "control.allocation", value: "\"pseudoinverse\"", expected: "one of bounded, truncated-svd" },
    Case { claim: "an unknown Jacobian is refused and the known ones named",
        change: ("\"exact\"", "\"numeric\""), line: "jacobian",
        kind: Value, key: "control.jacobian", value: "\"numeric\"", expected: "one of exact, algorithm-1" },
    Case { claim: "Algorithm 1 has no hidden defaults",
        change: ("\"exact\"", "\"algorithm-1\""), line: "[control]",
        kind: Value, key: "control.algorithm_1", value: "nothing", expected: "given, since `jacobian` is" },
    Case { claim: "an unknown feedback is refused and the known ones named",
        change: ("\"delayed-reference\"", "\"model\""), line: "feedback",
        kind: Value, key: "control.feedback", value: "\"model\"", expected: "one of delayed-reference, disturbance-estimate" },
    Case { claim: "the estimate of a bias has no hidden defaults",
        change: ("\"delayed-reference\"", "\"disturbance-estimate\""), line: "[control]",
        kind: Value, key: "control.disturbance", value: "nothing", expected: "given, since `feedback` is" },
    Case { claim: "a reference that may not move is refused",
        change: ("reference_speed_max_deg_per_s = 300.0", "reference_speed_max_deg_per_s = 0.0"), line: "reference_speed_max_deg_per_s",
        kind: Value, key: "control.reference_speed_max_deg_per_s", value: "0", expected: "from 0.1 to 100000" },
    Case { claim: "a missing time-out has no hidden default",
        change: ("model_stop_ms = 250.0\n", ""), line: "[daemon]",
        kind: Missing, key: "daemon.model_stop_ms", value: "", expected: "given in `daemon`" },
    Case { claim: "a recorder that reaches too far back is refused with the range",
        change: ("\nseconds = 10.0", "\nseconds = 61.0"), line: "seconds = 61.0",
        kind: Value, key: "daemon.recorder.seconds", value: "61", expected: "from 1 to 60" },
    Case { claim: "a recorder that keeps nothing is refused",
        change: ("flights_max = 100", "flights_max = 0"), line: "flights_max",
        kind: Value, key: "daemon.recorder.flights_max", value: "0", expected: "from 1 to 10000" },
    Case { claim: "a recorder without a folder is refused",
        change: ("folder = \"runs/daemon\"", "folder = \"\""), line: "folder",
        kind: Value, key: "daemon.recorder.folder", value: "", expected: "the path of a folder" },
    Case { claim: "a recorder has no hidden defaults",
        change: ("\nseconds = 10.0", ""), line: "[daemon.recorder]",
        kind: Missing, key: "daemon.recorder.seconds", value: "", expected: "given in `daemon.recorder`" },
];

/// Each case with the right text that it changes.
fn cases() -> impl Iterator<Item = (&'static Case, String)> {
    let steering = || format!("{RIGHT}{STEERING}");
    CASES
        .iter()
        .map(|case| (case, RIGHT.to_owned()))
        .chain(STEERING_CASES.iter().map(move |case| (case, steering())))
}

#[test]
fn the_configuration_that_the_cases_change_is_right() {
    for (case, right) in cases() {
        assert_eq!(refused(&right), vec![]);
        assert_eq!(right.matches(case.change.0).count(), 1, "{}: what it changes stands once", case.claim);
    }
}

/// Proves SR-22.
#[test]
fn each_mistyped_configuration_is_refused_with_file_line_value_and_range() {
    assert!(CASES.len() >= 25);
    for (case, right) in cases() {
        let claim = case.claim;
        let text = right.replace(case.change.0, case.change.1);
        let problems = refused(&text);
        let found = problems.iter().find(|problem| problem.problem == case.kind && problem.key == case.key);
        let problem = found.unwrap_or_else(|| panic!("{claim}: not among {problems:#?}"));
        assert!(problem.value.contains(case.value), "{claim}: {problem:?}");
        assert!(problem.expected.contains(case.expected), "{claim}: {problem:?}");
        let line = line_of(&text, case.line);
        assert_eq!(problem.line, line, "{claim}: {problem:?}");
        let message = problem.to_string();
        for part in [&format!("bench.toml:{line}:"), case.key, case.value, case.expected] {
            assert!(message.contains(part), "{claim}: {part:?} is not in {message:?}");
        }
    }
}

#[test]
fn one_mistake_gives_one_problem() {
    // Elsewhere one change breaks two things: a renamed key is unknown and missing, for one.
    let twofold = ["rig", "manipulator.parts"];
    for (case, right) in cases().filter(|(case, _)| !twofold.contains(&case.key) && case.kind != Syntax) {
        let problems = refused(&right.replace(case.change.0, case.change.1));
        assert_eq!(problems.len(), 1, "{}: {problems:#?}", case.claim);
    }
}

#[test]
fn all_problems_of_a_file_are_reported_at_once() {
    let text = RIGHT
        .replace("name = \"bench\"", "nmae = \"bench\"")
        .replace("current_max_a = 8.0", "current_max_a = \"much\"")
        .replace("supply_v = 48.0\n", "")
        .replace("base_roll_deg = 0.0", "base_roll_deg = [0.0]")
        .replace("magnet = { name = \"m1\"", "magnet = { nmae = \"m1\"")
        .replace("density_kg_per_m3 = 1030.0", "density_kg_per_m3 = true");
    let keys: Vec<String> = refused(&text).into_iter().map(|problem| problem.key).collect();
    let expected = [
        "rig.name",
        "rig.nmae",
        "coil_types.air.supply_v",
        "coil_types.air.current_max_a",
        "manipulator.base_roll_deg",
        "manipulator.materials.rubber.density_kg_per_m3",
        "manipulator.parts[1].magnet.name",
        "manipulator.parts[1].magnet.nmae",
    ];
    let mut sorted = keys.clone();
    sorted.sort();
    let mut all = expected.map(str::to_owned);
    all.sort();
    assert_eq!(sorted, all, "in the order reported: {keys:?}");
}

#[test]
fn all_values_out_of_range_are_reported_at_once_and_in_the_order_of_the_file() {
    let text = RIGHT
        .replace("workspace_diameter_mm = 110.0", "workspace_diameter_mm = -1.0")
        .replace("supply_v = 48.0", "supply_v = 0.0")
        .replace("poisson_ratio = 0.45", "poisson_ratio = 0.6")
        .replace("[[coils]]", "[[coils]]\nsize = 1");
    // An unknown key and values out of range at once: ranges of a section are checked once its keys are right.
    let keys: Vec<String> =
        refused(&text.replace("size = 1\n", "")).into_iter().map(|problem| problem.key).collect();
    assert_eq!(
        keys,
        [
            "rig.workspace_diameter_mm",
            "coil_types.air.supply_v",
            "manipulator.materials.rubber.poisson_ratio"
        ]
    );
    let keys: Vec<String> = refused(&text).into_iter().map(|problem| problem.key).collect();
    assert_eq!(keys, ["coils[0].size"]);
}

/// Goal: a misspelt table of a map makes a second table, from which keys are missing; the first is what was
/// meant.
#[test]
fn a_misspelt_name_of_a_table_is_told_by_the_keys_that_it_lacks() {
    let text = format!("{RIGHT}\n[manipulator.materials.ruber]\nyoung_modulus_mpa = 2.5\n");
    let problems = refused(&text);
    let keys: Vec<&str> = problems.iter().map(|problem| problem.key.as_str()).collect();
    let table = "manipulator.materials.ruber";
    assert_eq!(keys, [format!("{table}.density_kg_per_m3"), format!("{table}.poisson_ratio")]);
    for problem in &problems {
        assert_eq!(problem.problem, Missing);
        assert!(problem.expected.ends_with("did you mean `manipulator.materials.rubber`?"), "{problem}");
    }
}

#[test]
fn a_coil_from_which_every_magnet_is_too_near_is_blamed_itself() {
    let coil = &RIGHT[RIGHT.find("[[coils]]").unwrap()..RIGHT.find("[manipulator]").unwrap()];
    let magnet = &RIGHT[RIGHT.rfind("[[manipulator.parts]]").unwrap()..];
    let more =
        format!("{}\n{}", magnet.replace("m1", "m2"), coil.replace("left", "near").replace("100.0", "35.0"));
    let problems = refused(&format!("{RIGHT}\n{more}"));
    assert_eq!(problems.len(), 1, "{problems:#?}");
    assert_eq!(problems[0].key, "coils[1]");
    assert!(
        problems[0].value.contains("\"m1\" at ") && problems[0].value.contains("\"m2\" at "),
        "{problems:?}"
    );
    assert!(problems[0].expected.starts_with("at least 43 mm"), "{problems:?}");
}

#[test]
fn names_given_twice_are_refused() {
    let coil = &RIGHT[RIGHT.find("[[coils]]").unwrap()..RIGHT.find("[manipulator]").unwrap()];
    let magnet = &RIGHT[RIGHT.rfind("[[manipulator.parts]]").unwrap()..];
    let frame = &RIGHT[RIGHT.find("[[frames]]").unwrap()..RIGHT.find("[coil_types.air]").unwrap()];
    for (added, key, name) in
        [(coil, "coils", "left"), (magnet, "manipulator.parts", "m1"), (frame, "frames", "bottom")]
    {
        let problems = refused(&format!("{RIGHT}\n{added}"));
        assert_eq!(problems.len(), 1, "{problems:#?}");
        assert!(problems[0].key.starts_with(key), "{problems:?}");
        assert!(problems[0].value.contains(name), "{problems:?}");
        assert!(problems[0].expected.contains("unique"), "{problems:?}");
        assert!(problems[0].line > 1, "{problems:?}");
    }
}

#[test]
fn more_than_the_capacities_are_refused_with_the_capacity() {
    let coil = &RIGHT[RIGHT.find("[[coils]]").unwrap()..RIGHT.find("[manipulator]").unwrap()];
    let frame = &RIGHT[RIGHT.find("[[frames]]").unwrap()..RIGHT.find("[coil_types.air]").unwrap()];
    // A short magnet, so that nine of them stay inside the workspace.
    let magnet =
        &RIGHT[RIGHT.rfind("[[manipulator.parts]]").unwrap()..].replace("length_mm = 4.0", "length_mm = 1.0");
    for (added, name, count, key, capacity) in [
        (coil, "left", 33, "coils", "at most 32"),
        (frame, "bottom", 9, "frames", "at most 8"),
        (magnet.as_str(), "m1", 9, "manipulator.parts", "at most 8"),
    ] {
        let mut text = RIGHT.to_owned();
        for index in 1..count {
            text.push_str(&added.replacen(name, &format!("{name}{index}"), 1));
        }
        let problems = refused(&text);
        assert_eq!(problems.len(), 1, "{problems:#?}");
        assert_eq!(problems[0].key, key);
        assert!(problems[0].value.contains(&count.to_string()), "{problems:?}");
        assert!(problems[0].expected.contains(capacity), "{problems:?}");
        let full = text.replace(&added.replacen(name, &format!("{name}{}", count - 1), 1), "");
        assert_eq!(refused(&full), vec![], "the capacity itself is allowed");
    }
}

#[test]
fn a_magnet_may_come_first_and_a_coil_may_stand_still() {
    let magnet = &RIGHT[RIGHT.rfind("[[manipulator.parts]]").unwrap()..].replace("\"m1\"", "\"m0\"");
    let at = RIGHT.find("[[manipulator.parts]]").unwrap();
    let text = format!("{}{magnet}\n{}", &RIGHT[..at], &RIGHT[at..]).replace("frame = \"bottom\"\n", "");
    assert_eq!(refused(&text), vec![]);
}

/// Goal: whatever stands in place of a value, and whichever line is missing, the answer is a configuration or problems with
/// places: never a panic.
///
/// Proves SR-22.
#[test]
fn no_value_and_no_missing_line_escapes_the_checks() {
    let odd = [
        "nan",
        "-inf",
        "-1",
        "0",
        "0.0",
        "1e308",
        "-1e308",
        "5e-324",
        "9223372036854775807",
        "\"\"",
        "\"x\"",
        "true",
        "1979-05-27",
        "[]",
        "[nan, inf, 0]",
        "[[1]]",
        "{}",
        "{ x = 1 }",
        "[{}]",
    ];
    let right = format!("{RIGHT}{STEERING}");
    let mut refusals = 0;
    let mut check = |text: &str, change: &str| {
        for problem in refused(text) {
            refusals += 1;
            assert!(problem.line >= 1 && problem.column >= 1, "{change}: {problem:?}");
            assert!(!problem.expected.is_empty(), "{change}: {problem:?}");
            assert!(problem.to_string().starts_with("bench.toml:"), "{change}: {problem}");
        }
    };
    for (at, line) in right.lines().enumerate() {
        let with = |replacement: &str| {
            let lines = right.lines().enumerate();
            lines
                .map(|(index, line)| if index == at { replacement } else { line })
                .collect::<Vec<_>>()
                .join("\n")
        };
        check(&with(""), &format!("without {line}"));
        let Some((key, _)) = line.split_once(" = ") else { continue };
        for value in odd {
            let replacement = format!("{key} = {value}");
            check(&with(&replacement), &replacement);
        }
    }
    assert!(refusals > 1000, "most of these are wrong: {refusals}");
}
