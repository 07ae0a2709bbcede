//! `magsteer field fit` on files that are wrong, and on such as only look so.

mod field_fit_calls;
mod field_support;

use std::fmt::Write;
use std::fs;
use std::path::Path;

use field_fit_calls::{GRID, RIG, answer, array_csv, complaint, fit};
use tempfile::TempDir;

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
