//! What it took: currents and frame angles with their limits, conditioning and margin, and the loop's timing.

use super::run::{Run, Sample};
use crate::cli::figures::{Axis, Chart, Look, Sheet, Trace};

/// Currents, and angles of frames that moved, against time, with their limits.
pub fn actuation(run: &Run) -> Sheet {
    let rig = &run.config.description;
    let coils = rig.coils.iter().enumerate().map(|(index, coil)| {
        let points = curve(run, |sample| sample.currents.get(index).copied());
        Trace::new(coil.name.clone(), Look::Line(index), points)
    });
    let most = rig.coils.iter().fold(0.0_f64, |most, coil| most.max(coil.current_max));
    let mut charts = vec![Chart {
        y: Axis::new("current (A)").between(-1.1 * most, 1.1 * most),
        traces: coils.collect(),
        limits: vec![-most, most],
        ..over_time(run)
    }];
    if !rig.frames.is_empty() {
        let frames = rig.frames.iter().enumerate().map(|(index, frame)| {
            let points = curve(run, |sample| sample.angles.get(index).map(|angle| angle.to_degrees()));
            Trace::new(format!("frame {}", frame.name), Look::Line(rig.coils.len() + index), points)
        });
        let least = rig.frames.iter().fold(0.0_f64, |least, frame| least.min(frame.angle_min)).to_degrees();
        let most = rig.frames.iter().fold(0.0_f64, |most, frame| most.max(frame.angle_max)).to_degrees();
        charts.push(Chart {
            y: Axis::new("frame angle (deg)").between(1.1 * least, 1.1 * most),
            traces: frames.collect(),
            limits: vec![least, most],
            ..over_time(run)
        });
    }
    Sheet {
        name: "actuation",
        caption: "Measured coil currents and frame angles against time; grey lines are their limits."
            .to_owned(),
        columns: 1,
        height: 220.0,
        charts,
    }
}

/// Margin of stability, condition of the Jacobian and saturation against time.
pub fn margins(run: &Run) -> Sheet {
    let steering = |of: fn(&Sample) -> f64| {
        curve(run, move |sample| Some(of(sample)).filter(|value| sample.steers && value.is_finite()))
    };
    let chart = |label: &str, points: Vec<(f64, f64)>| Chart {
        y: Axis::new(label),
        traces: vec![Trace::new("", Look::Line(0), points)],
        ..over_time(run)
    };
    let margin = chart("stability margin", steering(|sample| sample.margin));
    let hold = run.config.daemon.as_ref().map(|daemon| daemon.stability_hold);
    let condition = chart("condition", steering(|sample| sample.condition));
    let saturated = chart("at a limit", steering(|sample| f64::from(sample.saturated)));
    let mut charts =
        vec![Chart { y: margin.y.clone().between(0.0, 1.1), limits: hold.into_iter().collect(), ..margin }];
    if condition.traces.iter().any(|trace| !trace.points.is_empty()) {
        charts.push(Chart { y: condition.y.clone().logarithmic(), ..condition });
    }
    charts.push(Chart { y: saturated.y.clone().between(-0.2, parameters(run) + 0.2), ..saturated });
    Sheet {
        name: "margins",
        caption: "While steering: margin of stability (1 at rest, 0 where the rod snaps through; grey: where the loop holds), condition of the \
                  scaled Jacobian, and number of currents and angles at a limit of value or rate, frames that are held among them."
            .to_owned(),
        columns: 1,
        height: 150.0,
        charts,
    }
}

fn parameters(run: &Run) -> f64 {
    (run.config.description.coils.len() + run.config.description.frames.len()) as f64
}

/// The loop's timing: how often each time was exceeded.
pub fn timing(run: &Run) -> Sheet {
    let times = &run.times;
    let chart = |title: &str, values: &[f64]| Chart {
        title: Some(title.to_owned()),
        x: Axis::new("time (us)").logarithmic(),
        y: Axis::new("share above").logarithmic(),
        traces: vec![Trace::new("", Look::Line(0), exceeded(values))],
        ..Chart::default()
    };
    Sheet {
        name: "timing",
        caption: format!(
            "How often a cycle began later than its deadline by so much, and took so long; {} cycles at {} Hz.",
            times.lateness.len(),
            run.info.rate_hz
        ),
        columns: 2,
        height: 220.0,
        charts: vec![chart("lateness", &times.lateness), chart("execution", &times.execution)],
    }
}

/// Share of the values that lie above each; of many values as many as a curve shows.
fn exceeded(values: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let count = sorted.len();
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut above = count;
    // From all to one, evenly on a logarithmic axis.
    while above >= 1 {
        let value = sorted[count - above].max(0.1);
        points.push((value, above as f64 / count as f64));
        above = (above as f64 / 1.05).floor().min(above as f64 - 1.0) as usize;
    }
    points
}

/// p50, p99, p99.9 and the greatest; zeros without values.
pub fn quantiles(values: &[f64]) -> [f64; 4] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| {
        let index = (share * sorted.len() as f64).ceil() as usize;
        sorted.get(index.clamp(1, sorted.len().max(1)) - 1).copied().unwrap_or(0.0)
    };
    [at(0.5), at(0.99), at(0.999), at(1.0)]
}

fn over_time(run: &Run) -> Chart {
    let end = run.samples.last().map_or(1.0, |sample| sample.time);
    Chart { x: Axis::new("time (s)").between(0.0, end), ..Chart::default() }
}

fn curve(run: &Run, of: impl Fn(&Sample) -> Option<f64>) -> Vec<(f64, f64)> {
    run.samples.iter().filter_map(|sample| Some((sample.time, of(sample)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::{exceeded, quantiles};

    #[test]
    fn quantiles_are_values_of_the_sample() {
        let values: Vec<f64> = (1..=1000).rev().map(f64::from).collect();
        assert_eq!(quantiles(&values), [500.0, 990.0, 999.0, 1000.0]);
        assert_eq!(quantiles(&[7.0]), [7.0; 4]);
        assert_eq!(quantiles(&[]), [0.0; 4]);
    }

    #[test]
    fn shares_fall_from_all_to_one_value() {
        let values: Vec<f64> = (1..=1000).map(f64::from).collect();
        let points = exceeded(&values);
        assert_eq!(points.first(), Some(&(1.0, 1.0)));
        assert_eq!(points.last(), Some(&(1000.0, 1e-3)));
        assert!(points.windows(2).all(|pair| pair[1].0 > pair[0].0 && pair[1].1 < pair[0].1));
        // At least as many as the share says lie at or above each value.
        for (value, share) in points {
            assert_eq!(
                values.iter().filter(|other| **other >= value).count(),
                (share * 1000.0).round() as usize
            );
        }
        assert!(exceeded(&[]).is_empty());
    }
}
