//! A flight as text: why, some rows, the worst values.

use magsteer::daemon::recorder::{Extract, Flight, Row};
use magsteer_hal::operator::state;

/// Columns with one value a magnet or coil: heading, and what of a row.
type Group = (&'static str, fn(&Row) -> &Vec<Option<f64>>, usize);

const GROUPS: [Group; 4] = [
    ("target (deg)", |row| &row.target_deg, 1),
    ("measured (deg)", |row| &row.measured_deg, 1),
    ("predicted (deg)", |row| &row.predicted_deg, 1),
    ("currents (A)", |row| &row.measured_a, 2),
];

/// Everything that `show` prints for people.
pub fn text(flight: &Flight, extract: &Extract) -> String {
    let header = &flight.header;
    let mut text = format!(
        "{}\n{} cycle {}, rig {} at {} Hz, config {:.12}, version {}\n",
        header.words(),
        header.trigger_time,
        header.trigger_cycle,
        header.rig,
        header.rate_hz,
        header.config_sha256,
        header.program,
    );
    let refused = [("poses", &extract.pose_refused), ("feedback", &extract.feedback_refused)];
    for (what, reason) in refused {
        text += &reason.as_ref().map_or(String::new(), |reason| format!("{what} refused: {reason}\n"));
    }
    if let Some([first, last]) = extract.span_s {
        text += &format!(
            "{} records, {first:.3} s to {last:.3} s; {} periods missed; {} records never came to the recorder\n\n",
            flight.records(),
            extract.missed,
            header.records_dropped
        );
    }
    text += &rows(&extract.rows, header.trigger_cycle);
    text += "\nworst                                value      at (s)\n";
    for extreme in &extract.extremes {
        text += &format!("{:32} {:>9} {:>11.3}\n", extreme.name, number(extreme.value), extreme.at_s);
    }
    text
}

fn rows(rows: &[Row], trigger_cycle: u64) -> String {
    let widths = GROUPS.map(|(heading, of, _)| {
        let count = rows.first().map_or(0, |row| of(row).len());
        (8 * count).max(heading.len() + 1)
    });
    let mut text = format!(
        "{:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>7}",
        "at (s)", "cycle", "state", "late us", "exec us", "pose ms", "margin"
    );
    for ((heading, ..), width) in GROUPS.iter().zip(widths) {
        text += &format!(" {heading:>width$}");
    }
    text += "\n";
    for row in rows {
        let mark = if row.cycle == trigger_cycle { '>' } else { ' ' };
        let optional = |value: Option<f64>, digits: usize| {
            value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
        };
        text += &format!(
            "{mark}{:>8.3} {:>9} {:>9} {:>8.0} {:>8.1} {:>8} {:>7}",
            row.at_s,
            row.cycle,
            state::name(row.state),
            row.lateness_us,
            row.execution_us,
            optional(row.pose_age_ms, 1),
            optional(row.stability_margin, 3),
        );
        for ((_, of, digits), width) in GROUPS.iter().zip(widths) {
            let values: String =
                of(row).iter().map(|value| format!("{:>8}", optional(*value, *digits))).collect();
            text += &format!(" {values:>width$}");
        }
        text += "\n";
    }
    text
}

/// Four digits, however small.
fn number(value: f64) -> String {
    let is_plain = value == 0.0 || (1e-3..1e6).contains(&value.abs());
    if is_plain { format!("{value:.3}") } else { format!("{value:.2e}") }
}
