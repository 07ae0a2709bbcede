//! What all runs of a campaign say together, drawn.

use magsteer::math::statistics::{quantile, wilson_interval};

use super::runs::{CampaignRuns, RunOutcome};
use crate::cli::campaign::RunRow;
use crate::cli::figures::{Axis, Chart, Look, Sheet, Trace};

/// What a logarithmic axis has in place of zero.
const LEAST_ERROR_DEG: f64 = 1e-3;

/// Every sheet of a campaign that has something to show.
pub fn sheets(campaign: &CampaignRuns) -> Vec<Sheet> {
    let mut sheets = vec![outcome(campaign)];
    sheets.extend(settling(campaign));
    sheets.extend(errors(campaign));
    sheets.extend(draws(campaign));
    sheets.push(limits(campaign));
    sheets
}

/// Shares of the outcomes, and how many runs had settled in every step by when.
fn outcome(campaign: &CampaignRuns) -> Sheet {
    let runs = campaign.rows.len() as u64;
    let percent = |part: u64| 100.0 * part as f64 / runs as f64;
    let mut bars = Vec::new();
    for (index, outcome) in RunOutcome::ALL.into_iter().enumerate() {
        let x = index as f64 + 1.0;
        let part = campaign.with(outcome).count() as u64;
        let interval = wilson_interval(part, runs).map(|share| (x, 100.0 * share));
        bars.push(Trace::new("", Look::Box(index_of(outcome), 0.22), vec![(x, 0.0), (x, percent(part))]));
        bars.push(Trace::new("95 % interval", Look::Wide(6, 1.5), interval.to_vec()));
    }
    let slowest: Vec<f64> = sorted(campaign.rows.iter().filter_map(|row| row.settle_max_s));
    let mut share = vec![(0.0, 0.0)];
    for (index, time) in slowest.iter().enumerate() {
        share.extend([(*time, percent(index as u64)), (*time, percent(index as u64 + 1))]);
    }
    let end = 1.1 * slowest.last().copied().unwrap_or(1.0);
    share.push((end, percent(slowest.len() as u64)));
    Sheet {
        name: "outcome",
        caption: format!(
            "Above: share of {runs} runs in which every step settled, in which some did not, and which were unstable, with 95 % \
             intervals. Below: share of the runs whose slowest step had settled by then."
        ),
        columns: 1,
        height: 200.0,
        charts: vec![
            Chart {
                x: Axis::new("").named(RunOutcome::ALL.map(RunOutcome::name)),
                y: Axis::new("share of runs (%)").between(0.0, 104.0),
                traces: bars,
                ..Chart::default()
            },
            Chart {
                x: Axis::new("slowest step (s)").between(0.0, end),
                y: Axis::new("share of runs (%)").between(0.0, 104.0),
                traces: vec![Trace::new("", Look::Line(0), share)],
                ..Chart::default()
            },
        ],
    }
}

/// How long each step took to settle, over the plants.
fn settling(campaign: &CampaignRuns) -> Option<Sheet> {
    let chart = by_step(campaign, |row, step| row.settle_s.get(step).copied().flatten());
    let most = greatest(&chart);
    chart.traces.iter().any(|trace| !trace.points.is_empty()).then(|| Sheet {
        name: "settling",
        caption: "How long each step took to settle, of the runs in which it did, over the drawn plants."
            .to_owned(),
        columns: 1,
        height: 240.0,
        charts: vec![Chart { y: Axis::new("settled after (s)").between(0.0, 1.06 * most), ..chart }],
    })
}

/// How far off the worst magnet was at the end of each step, over the plants.
fn errors(campaign: &CampaignRuns) -> Option<Sheet> {
    let chart = by_step(campaign, |row, step| {
        row.rms_step_deg.get(step).copied().flatten().map(|error| error.max(LEAST_ERROR_DEG))
    });
    chart.traces.iter().any(|trace| !trace.points.is_empty()).then(|| Sheet {
        name: "errors",
        caption: "RMS error of the magnet that is farthest off, over the last second of each step, of all runs that played it."
            .to_owned(),
        columns: 1,
        height: 240.0,
        charts: vec![Chart { y: Axis::new("error RMS (deg)").logarithmic(), ..chart }],
    })
}

/// Boxes of a measure of each step.
fn by_step(campaign: &CampaignRuns, measure: impl Fn(&RunRow, usize) -> Option<f64>) -> Chart {
    let mut traces = Vec::new();
    for step in 0..campaign.columns.steps {
        let values = sorted(campaign.rows.iter().filter_map(|row| measure(row, step)));
        let at = |share: f64| quantile(&values, share).map(|value| (step as f64 + 1.0, value));
        let between = |low: f64, high: f64| [at(low), at(high)].into_iter().flatten().collect();
        traces.extend([
            Trace::new("5 to 95 %", Look::Wide(5, 3.0), between(0.05, 0.95)),
            Trace::new("25 to 75 %", Look::Box(0, 0.07), between(0.25, 0.75)),
            Trace::new("median", Look::Dots(6), at(0.5).into_iter().collect()),
            Trace::new("greatest", Look::Dots(1), at(1.0).into_iter().collect()),
        ]);
    }
    // What is drawn later covers what is drawn before.
    traces.sort_by_key(|trace| matches!(trace.look, Look::Dots(_)));
    let steps = campaign.columns.steps;
    Chart { x: Axis::new("step").named((1..=steps).map(|step| step.to_string())), traces, ..Chart::default() }
}

/// The greatest error of each run against everything that was drawn.
fn draws(campaign: &CampaignRuns) -> Option<Sheet> {
    let judged = campaign.rows.iter().filter_map(|row| row.rms_max_deg);
    // Where runs stand of which no step was judged.
    let above = 1.8 * judged.fold(LEAST_ERROR_DEG, f64::max);
    let charts = campaign.columns.drawn.iter().enumerate().map(|(index, key)| {
        let (label, factor) = shown(key);
        let traces = RunOutcome::ALL.map(|outcome| {
            let points = campaign.with(outcome).filter_map(|row| {
                Some((factor * row.drawn.get(index)?, row.rms_max_deg.unwrap_or(above).max(LEAST_ERROR_DEG)))
            });
            Trace::new(outcome.name(), Look::Dots(index_of(outcome)), points.collect())
        });
        Chart {
            x: Axis::new(label),
            y: Axis::new("error (deg)").logarithmic(),
            traces: traces.into_iter().filter(|trace| !trace.points.is_empty()).collect(),
            ..Chart::default()
        }
    });
    (!campaign.columns.drawn.is_empty()).then(|| Sheet {
        name: "draws",
        caption: "Greatest RMS error of a magnet at the end of a step of each run against everything that was drawn for its plant. What \
                  failed runs have in common stands together; runs that ended before a step was judged stand in the topmost row."
            .to_owned(),
        columns: 2,
        height: 190.0,
        charts: charts.collect(),
    })
}

/// How close the runs came to the limit of the currents, and to a snap-through.
fn limits(campaign: &CampaignRuns) -> Sheet {
    let most = 1.1 * campaign.current_limit;
    let chart = |y: Axis, limits: Vec<f64>, values: Vec<f64>| {
        let share = |index: usize| 100.0 * (index as f64 + 0.5) / values.len() as f64;
        let points = values.iter().enumerate().map(|(index, value)| (share(index), *value)).collect();
        Chart {
            x: Axis::new("share of runs below (%)").between(0.0, 100.0),
            y,
            traces: vec![Trace::new("", Look::Dots(0), points)],
            limits,
            ..Chart::default()
        }
    };
    let currents = sorted(campaign.rows.iter().map(|row| row.current_max_a));
    let margins = sorted(campaign.rows.iter().filter_map(|row| row.margin_min));
    let mut charts = vec![chart(
        Axis::new("largest current (A)").between(0.0, most),
        vec![campaign.current_limit],
        currents,
    )];
    if !margins.is_empty() {
        let least = margins[0].min(0.0) * 1.1;
        let axis = Axis::new("smallest margin").between(least, 1.1);
        charts.push(chart(axis, campaign.margin_hold.into_iter().collect(), margins));
    }
    Sheet {
        name: "limits",
        caption: "Largest current of each run with the limit (grey), and the smallest margin of stability that the model had while steering \
                  (1 at rest, 0 where the rod snaps through; grey: where the loop holds). Runs in the order of the measure."
            .to_owned(),
        columns: 2,
        height: 230.0,
        charts,
    }
}

/// Colour of an outcome.
fn index_of(outcome: RunOutcome) -> usize {
    match outcome {
        RunOutcome::Settled => 0,
        RunOutcome::Unsettled => 4,
        RunOutcome::Unstable => 1,
    }
}

/// The last part of a key with its unit in brackets, and the factor to that unit: shares are shown in percent.
pub fn shown(key: &str) -> (String, f64) {
    let last = key.rsplit('.').next().unwrap_or(key);
    let units = [
        ("_relative", "%", 100.0),
        ("_deg", "deg", 1.0),
        ("_mm", "mm", 1.0),
        ("_ms", "ms", 1.0),
        ("_us", "us", 1.0),
        ("_hz", "Hz", 1.0),
    ];
    for (end, unit, factor) in units {
        if let Some(name) = last.strip_suffix(end) {
            return (format!("{} ({unit})", name.replace('_', " ")), factor);
        }
    }
    (last.replace('_', " "), 1.0)
}

fn greatest(chart: &Chart) -> f64 {
    let values = chart.traces.iter().flat_map(|trace| &trace.points).map(|point| point.1);
    values.fold(1e-3, f64::max)
}

/// Values in order.
pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn the_unit_of_a_key_stands_in_brackets() {
        let cases = [
            ("plant.sensors.tracker.poses.latency_ms", "latency (ms)", 1.0),
            ("plant.errors.modulus_relative", "modulus (%)", 100.0),
            ("plant.amplifier.bandwidth_hz", "bandwidth (Hz)", 1.0),
            ("plant.sensors.tracker.poses.dropout_probability", "dropout probability", 1.0),
            ("seed", "seed", 1.0),
        ];
        for (key, label, factor) in cases {
            assert_eq!(shown(key), (label.to_owned(), factor));
        }
    }
}
