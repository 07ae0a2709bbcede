//! The samples as CSV: angles in deg, currents in A.

use std::fmt::Write;

use magsteer::control::plan::{Plan, Unreached, target_columns};
use magsteer_hal::HardwareDescription;

use super::sample::Sample;

/// One line a sample. Cells that only a way has are empty where none was found.
pub fn text(rig: &HardwareDescription, samples: &[Sample], plans: &[Result<Plan, Unreached>]) -> String {
    let magnets: Vec<&str> = rig.magnets().map(|magnet| magnet.name.as_str()).collect();
    let mut columns = target_columns(&magnets);
    columns.extend(magnets.iter().map(|magnet| format!("{magnet}_from_rest_deg")));
    columns.extend(["bend_deg", "weight", "reached", "obstacle", "error_deg"].map(str::to_owned));
    columns.extend(rig.coils.iter().enumerate().map(|(index, _)| format!("i{index}_a")));
    columns.extend(rig.frames.iter().map(|frame| format!("theta_{}_deg", frame.name)));
    let of_way = ["current_max_a", "path_current_max_a", "stability_margin", "path_margin_min", "condition"];
    columns.extend(of_way.map(str::to_owned));
    let mut text = columns.join(",") + "\n";
    for (sample, plan) in samples.iter().zip(plans) {
        let directions = sample.target[..magnets.len()].iter().flatten().map(|value| format!("{value:.9}"));
        let mut cells: Vec<String> = directions.collect();
        let angles = sample.from_rest.iter().chain([&sample.bend]);
        cells.extend(angles.map(|angle| format!("{:.4}", angle.to_degrees())));
        cells.push(format!("{:.6}", sample.weight));
        match plan {
            Ok(plan) => cells.extend(of_plan(rig, plan)),
            Err(unreached) => {
                cells.extend(["0".to_owned(), unreached.closest.name().to_owned()]);
                cells.resize(columns.len(), String::new());
            }
        }
        // Writing to a string does not fail.
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

fn of_plan(rig: &HardwareDescription, plan: &Plan) -> Vec<String> {
    let actuation = &plan.posture.equilibrium.actuation;
    let currents = &actuation.current_a[..rig.coils.len()];
    let mut cells = vec!["1".to_owned(), String::new(), format!("{:.5}", plan.error.to_degrees())];
    cells.extend(currents.iter().map(|current| format!("{current:.5}")));
    cells.extend(
        actuation.angle_rad[..rig.frames.len()].iter().map(|angle| format!("{:.4}", angle.to_degrees())),
    );
    let current_max = currents.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
    let of_way = [
        current_max,
        plan.walked.current_max,
        plan.posture.margin,
        plan.walked.margin_min,
        plan.posture.condition,
    ];
    cells.extend(of_way.map(|value| format!("{value:.5}")));
    cells
}
