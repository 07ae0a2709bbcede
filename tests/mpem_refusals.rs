//! Calibrations of multipole electromagnet models that are refused: by line, key, value and what would be
//! right.
#![cfg(feature = "mpem")]

use magsteer::magnetics::mpem::{placed_coils, read};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const FIXTURE: &str = include_str!("reference/calibration.yaml");

/// One change to the fixture, and what the refusal must say: the text on the line that it names, its key, the
/// value found, and what would be right.
struct Case {
    change: (&'static str, &'static str),
    line: &'static str,
    key: &'static str,
    value: &'static str,
    expected: &'static str,
}

#[rustfmt::skip]
const CASES: &[Case] = &[
    // Numbers.
    Case { change: ("- 2.5e-06", "- .nan"), line: "- .nan", key: "West.Src_0.B_Coeff[0]", value: ".nan", expected: "a finite number" },
    Case { change: ("- 2.5e-06", "- -.Inf"), line: "- -.Inf", key: "West.Src_0.B_Coeff[0]", value: "-.Inf", expected: "a finite number" },
    Case { change: ("- 2.5e-06", "- 1e999"), line: "- 1e999", key: "West.Src_0.B_Coeff[0]", value: "1e999", expected: "a finite number" },
    Case { change: ("- -1.25e-07", "- 1.25e-07 T"), line: "1.25e-07 T", key: "West.Src_0.B_Coeff[1]", value: "1.25e-07 T", expected: "a number" },
    Case { change: ("- 2.5e-06", "- \"2.5e-06\""), line: "\"2.5e-06\"", key: "West.Src_0.B_Coeff[0]", value: "\"2.5e-06\"", expected: "a number" },
    Case { change: ("- 2.5e-06", "-"), line: "      -\n", key: "West.Src_0.B_Coeff[0]", value: "nothing", expected: "a number" },
    // Counts.
    Case { change: ("      - 0.004\n", ""), line: "    Source_Position:", key: "West.Src_0.Source_Position", value: "2 numbers", expected: "three numbers" },
    Case { change: ("[[0.0], [0.0], [-2.0]]", "[[0.0], [0.0], [-2.0], [1.0]]"), line: "[-2.0], [1.0]", key: "Below.Src_0.Source_Direction", value: "4 numbers", expected: "three numbers" },
    Case { change: ("[[0.0], [0.0], [-2.0]]", "[[0.0, 1.0], [0.0], [-2.0]]"), line: "[[0.0, 1.0]", key: "Below.Src_0.Source_Direction[0]", value: "a sequence of 2", expected: "a number" },
    Case { change: ("[[0.0], [0.0], [-2.0]]", "[0.0, 0.0, 0.0]"), line: "[0.0, 0.0, 0.0]", key: "Below.Src_0.Source_Direction", value: "[0.0, 0.0, 0.0]", expected: "other than zero" },
    Case { change: ("    - -0.01\n    - 0.02\n", "    - -0.01\n"), line: "    - -0.01\n", key: "Workspace_Dimensions[2]", value: "a sequence of 1", expected: "two numbers" },
    Case { change: ("  -\n    - -0.01\n    - 0.02\n", ""), line: "Workspace_Dimensions", key: "Workspace_Dimensions", value: "a sequence of 2", expected: "three pairs" },
    Case { change: ("    - -0.01\n    - 0.02\n", "    - 0.02\n    - -0.01\n"), line: "    - 0.02\n    - -0.01", key: "Workspace_Dimensions[2]", value: "from 0.02 to -0.01", expected: "the least number first" },
    // Keys and names.
    Case { change: ("System_Name: \"three coils\"\n", ""), line: "Coil_List", key: "System_Name", value: "missing", expected: "given" },
    Case { change: ("    A_Coeff: ~\n", ""), line: "  Src_0:\n", key: "West.Src_0.A_Coeff", value: "missing", expected: "given" },
    Case { change: ("    A_Coeff: ~\n", "    A_Coef: ~\n"), line: "A_Coef: ~", key: "West.Src_0.A_Coef", value: "unknown", expected: "A_Coeff, B_Coeff" },
    Case { change: ("System_Name", "Units: m\nSystem_Name"), line: "Units: m", key: "Units", value: "unknown", expected: "or a name of Coil_List" },
    Case { change: ("  - Below\n", ""), line: "Below:", key: "Below", value: "unknown", expected: "a name of Coil_List" },
    Case { change: ("  - South\n", "  - South\n  - North\n"), line: "Coil_List", key: "North", value: "missing", expected: "given" },
    Case { change: ("  - South\n", "  - South\n  - West\n"), line: "  - West\nWest:", key: "Coil_List[3]", value: "West again", expected: "listed once" },
    Case { change: ("  Source_List: [Src_0]", "  Source_List: []"), line: "Source_List: []", key: "Below.Source_List", value: "without a source", expected: "one or more sources" },
    Case { change: ("South:\n", "West:\n"), line: "West:\n  Source_List: [Only]", key: "West", value: "given before, on line 7", expected: "given once" },
    Case { change: ("Coil_List:\n  - West\n  - Below\n  - South\n", "Coil_List: ~\n"), line: "Coil_List", key: "Coil_List", value: "~", expected: "a sequence of names" },
    // YAML beyond what calibrations need.
    Case { change: ("    A_Coeff: ~\n", "    A_Coeff: !!opencv-matrix {}\n"), line: "opencv-matrix", key: "YAML", value: "opencv-matrix", expected: "without tags" },
    Case { change: ("- 2.5e-06", "- !!float 2.5e-06"), line: "!!float", key: "YAML", value: "float", expected: "without tags" },
    Case { change: ("- 2.5e-06", "- &b 2.5e-06"), line: "&b", key: "YAML", value: "an anchor", expected: "without anchors" },
    Case { change: ("  Source_List: [Only]", "  Source_List: [Only]\n  ? [a, b]\n  : 1"), line: "[a, b]", key: "YAML", value: "a sequence of 2", expected: "a name before the colon" },
    Case { change: ("South:\n", "---\nSouth:\n"), line: "---\nSouth", key: "file", value: "a second document", expected: "one document" },
    Case { change: ("# A calibration", "%YAML:1.0\n# A calibration"), line: "%YAML", key: "file", value: "%YAML:1.0", expected: "OpenCV" },
    Case { change: ("[0.1, 0.9, 0.2]", "[[[[[[[[[[[[[[[[[0.1]]]]]]]]]]]]]]]]]"), line: "[[[[[[", key: "YAML", value: "levels", expected: "five levels" },
    // What our array cannot have.
    Case { change: ("  Source_List: [Only]\n", "  Source_List: [Only, More]\n  More: {A_Coeff: ~, B_Coeff: [1.0e-9], Source_Direction: [0, 1, 0], Source_Position: [0, -0.1, 0]}\n"), line: "South:\n", key: "South.Source_List", value: "2 sources (Only, More)", expected: "one source" },
    Case { change: ("A_Coeff: [0.0, 0.0]", "A_Coeff: [0.0, 1.0e-4]"), line: "  Only:", key: "South.Only.A_Coeff", value: "of order 2", expected: "empty or zero" },
    Case { change: ("B_Coeff: [-1.8e-6]", "B_Coeff: [1e-6, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1e-19]"), line: "  Only:", key: "South.Only.B_Coeff", value: "of order 11", expected: "1 to 10" },
    Case { change: ("B_Coeff: [-1.8e-6]", "B_Coeff: [0.0]"), line: "  Only:", key: "South.Only.B_Coeff", value: "without a term", expected: "1 to 10" },
    Case { change: ("South", "South_Offset"), line: "South_Offset:", key: "South_Offset", value: "without currents", expected: "left out" },
    Case { change: ("Source_Direction: [0.1, 0.9, 0.2]", "Source_Direction: [0.9, 0.1, 0.0]"), line: "  Only:", key: "South.Only.Source_Position", value: "behind it", expected: "in front of it" },
    // Units.
    Case { change: ("    - -0.02\n    - 0.03\n", "    - -20.0\n    - 30.0\n"), line: "    - -20.0\n", key: "Workspace_Dimensions[1]", value: "from -20 to 30", expected: "in m, not in mm" },
    Case { change: ("[0.0, -0.09, 0.0]", "[0.0, -90.0, 0.0]"), line: "  Only:", key: "South.Only.Source_Position", value: "90.0", expected: "in m, not in mm" },
    Case { change: ("B_Coeff: [-1.8e-6]", "B_Coeff: [-1.8e-3]"), line: "  Only:", key: "South.Only.B_Coeff", value: "T/A at the workspace's centre", expected: "in m, A and T" },
    Case { change: ("B_Coeff: [-1.8e-6]", "B_Coeff: [-1.8e-10]"), line: "  Only:", key: "South.Only.B_Coeff", value: "T/A at the workspace's centre", expected: "in m, A and T" },
];

#[test]
fn every_mistake_is_refused_with_line_key_value_and_what_would_be_right() {
    let mut wrong = Vec::new();
    for Case { change, line, key, value, expected } in CASES {
        assert!(FIXTURE.contains(change.0), "{}: not in the fixture", change.0);
        // A coil is renamed wherever it stands.
        let count = if change.0 == "South" { usize::MAX } else { 1 };
        let text = FIXTURE.replacen(change.0, change.1, count);
        let found = read(text.as_bytes()).and_then(|calibration| placed_coils(&calibration));
        let refusal = found.expect_err(change.1);
        let at = text[..text.find(line).unwrap()].matches('\n').count() + 1;
        if refusal.line != at
            || refusal.column != *key
            || !refusal.value.contains(value)
            || !refusal.expected.contains(expected)
        {
            wrong.push(format!("{at}: {key}: {value}: {expected}: is {refusal}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Goal: wherever the file is cut, it is refused at a line that it has, or says that its last line has no
/// end.
#[test]
fn a_file_that_was_cut_is_never_taken_for_whole() {
    for cut in 0..FIXTURE.len() - 1 {
        let text = &FIXTURE[..cut];
        match read(text.as_bytes()) {
            Ok(calibration) => assert!(!calibration.ends_with_line_end, "cut after {cut} bytes"),
            Err(refusal) => {
                let lines = text.matches('\n').count() + 1;
                assert!((1..=lines).contains(&refusal.line), "cut after {cut} bytes: {refusal}");
            }
        }
    }
}

/// Goal: no bytes whatever make the reader panic, and what it lets through is finite.
#[test]
fn spoiled_bytes_are_refused_or_read_as_finite_numbers() {
    const LETTERS: &[u8] = b"-:[]{}&*!|>'\"%@`#,? \n\t0e.n~\xff";
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for _ in 0..3000 {
        let mut bytes = FIXTURE.as_bytes().to_vec();
        for _ in 0..random.random_range(1..4) {
            let at = random.random_range(0..bytes.len());
            bytes[at] = LETTERS[random.random_range(0..LETTERS.len())];
        }
        let Ok(calibration) = read(&bytes) else { continue };
        for source in calibration.coils.iter().flat_map(|coil| &coil.sources) {
            let numbers =
                source.falling.iter().chain(&source.rising).chain(&source.position).chain(&source.direction);
            assert!(numbers.into_iter().all(|number| number.is_finite()));
        }
        let _ = placed_coils(&calibration);
    }
}
