//! Experiments as CSV: a step a line, for scripts that other programs write.
//!
//! | column | is |
//! |---|---|
//! | `duration_s` | time until the next step, s |
//! | `NAME_deg` | angle of a magnet about y from z, deg |
//! | `NAMEx,NAMEy,NAMEz` | direction of a magnet, world, in place of its angle |
//! | `FRAME_deg` | angle of a frame, deg; all of them or none |
//! | `until` | `settled`, or nothing; may be left out |
//!
//! Columns stand in any order; every magnet has either an angle or a direction.

use magsteer_hal::HardwareDescription;
use magsteer_hal::invalid::Checks;

use super::experiment::{Experiment, ExperimentStep, Until};
use crate::math::csv::{CsvRow, CsvTable, Refusal};

/// What a column means.
enum Column {
    Duration,
    Until,
    MagnetAngle(String),
    /// Component 0 to 2 of a magnet's direction.
    MagnetDirection(String, usize),
    FrameAngle(String),
}

/// Reads the bytes of a CSV file for the magnets and frames of a rig.
///
/// # Errors
/// The first line, column and value that is refused.
pub fn experiment_of_csv(bytes: &[u8], rig: &HardwareDescription) -> Result<Experiment, Refusal> {
    let header = format!(
        "duration_s,{}",
        rig.magnets().map(|magnet| format!("{}_deg", magnet.name)).collect::<Vec<_>>().join(",")
    );
    let table = CsvTable::new(bytes, &header)?;
    let known = format!("{header}, or directions as {}, frames as FRAME_deg, until", direction_columns(rig));
    table.check_columns(|name| meaning(name, rig).is_some(), &known)?;
    let columns: Vec<Column> = table.columns.iter().filter_map(|name| meaning(name, rig)).collect();
    if !columns.iter().any(|column| matches!(column, Column::Duration)) {
        return Err(table.refuse_header("no column duration_s", format!("the header {header}")));
    }
    let steps: Vec<ExperimentStep> =
        table.rows().map(|row| step(&row?, &columns, rig)).collect::<Result<_, _>>()?;
    if steps.is_empty() {
        return Err(table.refuse_header("the last line of the file", "followed by at least one step"));
    }
    Ok(Experiment {
        description: "Steps of a CSV file".to_owned(),
        axis: [0.0, 1.0, 0.0],
        zero_direction: [0.0, 0.0, 1.0],
        steps,
    })
}

fn direction_columns(rig: &HardwareDescription) -> String {
    let first = rig.magnets().next().map_or("m1", |magnet| magnet.name.as_str());
    format!("{first}x,{first}y,{first}z")
}

fn meaning(name: &str, rig: &HardwareDescription) -> Option<Column> {
    match name {
        "duration_s" => return Some(Column::Duration),
        "until" => return Some(Column::Until),
        _ => {}
    }
    let angle_of = name.strip_suffix("_deg");
    for magnet in rig.magnets() {
        if angle_of == Some(&magnet.name) {
            return Some(Column::MagnetAngle(magnet.name.clone()));
        }
        let component = name.strip_prefix(magnet.name.as_str()).and_then(|rest| match rest {
            "x" => Some(0),
            "y" => Some(1),
            "z" => Some(2),
            _ => None,
        });
        if let Some(component) = component {
            return Some(Column::MagnetDirection(magnet.name.clone(), component));
        }
    }
    let frame = rig.frames.iter().find(|frame| angle_of == Some(&frame.name))?;
    Some(Column::FrameAngle(frame.name.clone()))
}

fn step(row: &CsvRow<'_>, columns: &[Column], rig: &HardwareDescription) -> Result<ExperimentStep, Refusal> {
    let mut step = ExperimentStep::default();
    for (index, column) in columns.iter().enumerate() {
        match column {
            Column::Duration => step.duration_s = row.number(index)?,
            Column::Until => {
                step.until = match row.text(index) {
                    "" => None,
                    "settled" => Some(Until::Settled),
                    other => {
                        let value = format!("{other:?}");
                        return Err(Refusal::new(row.line, "until", value, "`settled`, or nothing"));
                    }
                };
            }
            Column::MagnetAngle(name) => {
                step.target_deg.insert(name.clone(), row.number(index)?);
            }
            Column::MagnetDirection(name, component) => {
                // A component that has no column of its own stays zero.
                step.target_direction.entry(name.clone()).or_default()[*component] = row.number(index)?;
            }
            Column::FrameAngle(name) => {
                step.frames_deg.insert(name.clone(), row.number(index)?);
            }
        }
    }
    let mut checks = Checks::new();
    step.check("step", rig, &mut checks);
    let refused = checks.into_result(()).err().and_then(|found| found.into_iter().next());
    refused.map_or(Ok(step), |invalid| {
        let column = invalid.key.trim_start_matches("step.").to_owned();
        Err(Refusal::new(row.line, column, invalid.value, invalid.expected))
    })
}

#[cfg(test)]
mod tests {
    use super::{Until, experiment_of_csv};

    /// A rig of two magnets and two frames.
    fn read(text: &str) -> Result<super::Experiment, String> {
        let rig = magsteer_hal::scripted::example_description();
        experiment_of_csv(text.as_bytes(), &rig).map_err(|refusal| refusal.to_string())
    }

    #[test]
    fn angles_directions_and_ends_of_steps_are_read() {
        let text = "m1_deg,m2x,m2y,m2z,duration_s,until\n90,0,0,2,4,settled\n80,0,1,0,2.5,\n";
        let experiment = read(text).expect("well formed");
        let [first, second] = &experiment.steps[..] else { panic!("two steps") };
        assert_eq!((first.until, second.until), (Some(Until::Settled), None));
        assert_eq!((first.duration_s, second.duration_s), (4.0, 2.5));
        let rig = magsteer_hal::scripted::example_description();
        let target = experiment.target(first, &rig);
        assert!((target.directions[0][0] - 1.0).abs() < 1e-15, "90 deg about y from z is x");
        assert_eq!(target.directions[1], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn refusals_name_line_column_value_and_what_is_right() {
        let refused = |text: &str| read(text).expect_err("refused");
        assert!(refused("m1_deg,m2_deg\n90,90\n").contains("no column duration_s"));
        assert!(refused("duration_s,m1_deg,m7_deg\n1,90,90\n").contains("\"m7_deg\""));
        let refusal = refused("duration_s,m1_deg,m2_deg\n4,90,90\n4,400,90\n");
        assert!(refusal.starts_with("3: target_deg.m1: 400: must be"), "{refusal}");
        let refusal = refused("duration_s,m1_deg,m2_deg\n0,90,90\n");
        assert!(refusal.starts_with("2: duration_s: 0: must be > 0"), "{refusal}");
        let refusal = refused("duration_s,m1_deg\n4,90\n");
        assert!(refusal.contains("nothing for m2"), "{refusal}");
        let refusal = refused("duration_s,m1_deg,m2_deg,until\n4,90,90,never\n");
        assert!(refusal.contains("`settled`, or nothing"), "{refusal}");
        assert!(refused("duration_s,m1_deg,m2_deg\n").contains("at least one step"));
        assert!(refused("").contains("an empty file"));
    }
}
