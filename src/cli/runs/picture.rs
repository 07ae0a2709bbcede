//! A flight as a picture: a panel a magnet, then currents, margin and lateness, all against the time from the
//! trip.

use std::path::Path;

use magsteer::daemon::recorder::{Flight, tangent_deg};

use crate::cli::figures::{Curve, GREY, Panel, Stroke, stacked};

/// Points of a curve: more than a picture has pixels across. Peaks of lateness between them are kept.
const POINTS: usize = 2_000;

/// Draws `flight` into `path`, all of it or so many seconds around the trip.
pub fn draw(path: &Path, flight: &Flight, around: Option<f64>) -> anyhow::Result<()> {
    let within = |record: &usize| {
        let at = flight.seconds(*record);
        at.is_some_and(|at| around.is_none_or(|around| at.abs() <= around))
    };
    let records: Vec<usize> = (0..flight.records()).filter(within).collect();
    let step = records.len().div_ceil(POINTS).max(1);
    let shown: Vec<usize> = records.iter().copied().step_by(step).collect();
    let curve = |name: &str, stroke: Stroke, value: &dyn Fn(usize) -> Option<f64>| Curve {
        name: name.to_owned(),
        stroke,
        points: shown.iter().filter_map(|record| Some((flight.seconds(*record)?, value(*record)?))).collect(),
    };
    let mut panels = Vec::new();
    for magnet in &flight.header.magnets {
        let angle = |what: &'static str| move |record: usize| tangent_deg(flight, record, magnet, what);
        panels.push(Panel {
            label: format!("angle of {magnet} (deg)"),
            curves: vec![
                curve("measured", Stroke::Color(0), &angle("measured")),
                curve("predicted", Stroke::Color(1), &angle("predicted")),
                curve("desired", Stroke::Color(6), &angle("desired")),
                curve("target", Stroke::Dashed(GREY), &angle("target")),
            ],
        });
    }
    let currents = flight.header.coils.iter().enumerate().map(|(index, coil)| {
        let column = flight.column(&format!("coil.{coil}.measured_a"));
        curve(coil, Stroke::Color(index), &|record| flight.number_at(record, column?))
    });
    panels.push(Panel { label: "coil current (A)".to_owned(), curves: currents.collect() });
    let margin = flight.column("stability_margin");
    panels.push(Panel {
        label: "margin of stability".to_owned(),
        curves: vec![curve("margin", Stroke::Color(2), &|record| flight.number_at(record, margin?))],
    });
    panels.push(Panel {
        label: "time of the loop (us)".to_owned(),
        curves: vec![
            Curve {
                name: "lateness".to_owned(),
                stroke: Stroke::Color(1),
                points: peaks(flight, &records, step, "lateness_ns"),
            },
            Curve {
                name: "execution".to_owned(),
                stroke: Stroke::Color(0),
                points: peaks(flight, &records, step, "execution_ns"),
            },
        ],
    });
    let header = &flight.header;
    let words = header.words();
    // What came after it is longer than a picture is wide; `runs show` prints all.
    let trip = words.split(", then").next().unwrap_or_default();
    let title = format!("{}, cycle {}: {trip}", header.rig, header.trigger_cycle);
    stacked(path, &title, &panels)
}

/// The greatest of every `step` values, us.
fn peaks(flight: &Flight, records: &[usize], step: usize, column: &str) -> Vec<(f64, f64)> {
    let Some(column) = flight.column(column) else { return Vec::new() };
    let values = records.chunks(step).filter_map(|chunk| {
        let most = chunk.iter().filter_map(|record| flight.number_at(*record, column)).fold(0.0, f64::max);
        Some((flight.seconds(chunk[0])?, 1e-3 * most))
    });
    values.collect()
}
