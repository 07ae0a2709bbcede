//! What a person wants to see of a flight first: its extremes, and some rows around the trip.

use serde::Serialize;

use super::reading::Flight;
use super::refusal::refusal_text;
use crate::daemon::target::angle_from_z_deg;

/// The worst value of something over a flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Extreme {
    /// What it is, its unit last.
    pub name: String,
    /// Its worst value.
    pub value: f64,
    /// When, from the trip.
    pub at_s: f64,
}

/// One cycle of the table. Angles of tangents are those from global z.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// From the trip.
    pub at_s: f64,
    /// Number of the cycle.
    pub cycle: u64,
    /// State code.
    pub state: u32,
    /// From its deadline to its begin.
    pub lateness_us: f64,
    /// From its begin to its end.
    pub execution_us: f64,
    /// Age of the newest poses.
    pub pose_age_ms: Option<f64>,
    /// Margin of stability.
    pub stability_margin: Option<f64>,
    /// Scaled residual of the statics.
    pub model_residual: Option<f64>,
    /// Target of each magnet.
    pub target_deg: Vec<Option<f64>>,
    /// Reference of each magnet.
    pub desired_deg: Vec<Option<f64>>,
    /// Tangent of each magnet as measured.
    pub measured_deg: Vec<Option<f64>>,
    /// The same as the model has it.
    pub predicted_deg: Vec<Option<f64>>,
    /// Current of each coil as measured.
    pub measured_a: Vec<Option<f64>>,
    /// The same as commanded.
    pub commanded_a: Vec<Option<f64>>,
}

/// The extract of one flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Extract {
    /// First and last record, from the trip.
    pub span_s: Option<[f64; 2]>,
    /// Periods skipped within the flight.
    pub missed: u64,
    /// Why poses were refused in the cycle of the trip, if they were.
    pub pose_refused: Option<String>,
    /// The same of the driver's feedback.
    pub feedback_refused: Option<String>,
    /// Worst values over the whole flight.
    pub extremes: Vec<Extreme>,
    /// Some cycles around the trip, in order; that of the trip is among them.
    pub rows: Vec<Row>,
}

impl Extract {
    /// Of `flight`, with about `rows_max` rows from `before` s before the trip to `after` s after it.
    #[must_use]
    pub fn new(flight: &Flight, before: f64, after: f64, rows_max: usize) -> Self {
        let records = flight.records();
        let span = records.checked_sub(1).and_then(|last| Some([flight.seconds(0)?, flight.seconds(last)?]));
        let trip =
            (0..records).find(|record| flight.count(*record, "cycle") == Some(flight.header.trigger_cycle));
        let refused = |what: &str| {
            let [code, expected, actual] = ["", "_expected", "_actual"]
                .map(|part| flight.count(trip?, &format!("{what}_refused{part}")));
            refusal_text(code?, expected.unwrap_or(0), actual.unwrap_or(0))
        };
        let missed = flight.column("missed").map_or(0, |column| {
            (0..records)
                .filter_map(|record| flight.record(record).get(column))
                .fold(0, |sum: u64, missed| sum.saturating_add(*missed))
        });
        Self {
            span_s: span,
            missed,
            pose_refused: refused("pose"),
            feedback_refused: refused("feedback"),
            extremes: extremes(flight),
            rows: rows(flight, (before, after), trip, rows_max),
        }
    }
}

/// Value of a direction's angle from global z over the flight, deg, for each magnet; for pictures.
#[must_use]
pub fn tangent_deg(flight: &Flight, record: usize, magnet: &str, what: &str) -> Option<f64> {
    let part = |axis: &str| flight.number(record, &format!("magnet.{magnet}.{what}_{axis}"));
    angle_from_z_deg(&[part("x")?, part("y")?, part("z")?])
}

/// The greatest of a column's values, times a factor; of those without a sign when `unsigned`.
fn most(flight: &Flight, column: &str, name: &str, value: impl Fn(f64) -> f64) -> Option<Extreme> {
    let at = flight.column(column)?;
    let values = (0..flight.records()).filter_map(|record| Some((record, flight.number_at(record, at)?)));
    let worst = values.max_by(|one, other| value(one.1).total_cmp(&value(other.1)))?;
    Some(Extreme { name: name.to_owned(), value: worst.1, at_s: flight.seconds(worst.0)? })
}

fn extremes(flight: &Flight) -> Vec<Extreme> {
    let scaled = |column: &str, name: &str, factor: f64| {
        let extreme = most(flight, column, name, |value| value);
        extreme.map(|extreme| Extreme { value: factor * extreme.value, ..extreme })
    };
    let mut found = vec![
        scaled("lateness_ns", "lateness_us", 1e-3),
        scaled("execution_ns", "execution_us", 1e-3),
        scaled("pose_age_s", "pose_age_ms", 1e3),
        scaled("model_residual", "model_residual", 1.0),
        most(flight, "stability_margin", "stability_margin", |value| -value),
    ];
    for coil in &flight.header.coils {
        let column = format!("coil.{coil}.measured_a");
        found.push(most(flight, &column, &column, f64::abs));
    }
    found.into_iter().flatten().collect()
}

fn rows(flight: &Flight, (before, after): (f64, f64), trip: Option<usize>, rows_max: usize) -> Vec<Row> {
    let is_within = |record: &usize| flight.seconds(*record).is_some_and(|at| at >= -before && at <= after);
    let within: Vec<usize> = (0..flight.records()).filter(is_within).collect();
    let every = within.len().div_ceil(rows_max.max(1)).max(1);
    let last = within.last().copied();
    // The cycle of the trip lies on the grid, so that the others are evenly apart.
    let offset = within.iter().position(|record| Some(*record) == trip).unwrap_or(0) % every;
    let on_grid = within.iter().enumerate().filter(|(index, _)| index % every == offset);
    let mut chosen: Vec<usize> = on_grid.map(|(_, record)| *record).collect();
    chosen.extend(last.filter(|last| chosen.last() != Some(last)));
    chosen.into_iter().filter_map(|record| row(flight, record)).collect()
}

fn row(flight: &Flight, record: usize) -> Option<Row> {
    let header = &flight.header;
    let number = |name: &str| flight.number(record, name);
    let tangents = |what: &str| {
        header.magnets.iter().map(|magnet| tangent_deg(flight, record, magnet, what)).collect::<Vec<_>>()
    };
    let currents = |what: &str| {
        header.coils.iter().map(|coil| number(&format!("coil.{coil}.{what}"))).collect::<Vec<_>>()
    };
    let has_poses = flight.count(record, "pose_stamp_ns").is_some();
    Some(Row {
        at_s: flight.seconds(record)?,
        cycle: flight.count(record, "cycle")?,
        state: u32::try_from(flight.count(record, "state")?).ok()?,
        lateness_us: 1e-3 * number("lateness_ns")?,
        execution_us: 1e-3 * number("execution_ns")?,
        pose_age_ms: number("pose_age_s").filter(|_| has_poses).map(|age| 1e3 * age),
        stability_margin: number("stability_margin"),
        model_residual: number("model_residual"),
        target_deg: tangents("target"),
        desired_deg: tangents("desired"),
        measured_deg: tangents("measured"),
        predicted_deg: tangents("predicted"),
        measured_a: currents("measured_a"),
        commanded_a: currents("commanded_a"),
    })
}
