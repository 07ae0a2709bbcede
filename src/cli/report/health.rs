//! What it took: currents and frame angles with their limits, conditioning and margin, and the loop's timing.

use hdrhistogram::Histogram;
use hdrhistogram::iterators::IterationValue;

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
            // Of frames that stand alike each is to be seen: the later line is drawn on the former, and is thinner.
            let width = 1.3 + 1.7 * (rig.frames.len() - 1 - index) as f64;
            Trace::new(format!("frame {}", frame.name), Look::Wide(rig.coils.len() + index, width), points)
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
    let saturated = chart("at a limit", steering(|sample| f64::from(sample.at_limit)));
    let mut charts =
        vec![Chart { y: margin.y.clone().between(0.0, 1.1), limits: hold.into_iter().collect(), ..margin }];
    if condition.traces.iter().any(|trace| !trace.points.is_empty()) {
        charts.push(Chart { y: condition.y.clone().logarithmic(), ..condition });
    }
    charts.push(Chart { y: saturated.y.clone().between(-0.2, parameters(run) + 0.2), ..saturated });
    Sheet {
        name: "margins",
        caption: "While steering: margin of stability (1 at rest, 0 where the rod snaps through; grey: where the loop holds), condition of the \
                  scaled Jacobian, and how many currents and frame angles were at a limit of value or rate at once; frames that are held \
                  are at none."
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
    let chart = |title: &str, times: &Histogram<u64>| Chart {
        title: Some(title.to_owned()),
        x: Axis::new("time (us)").logarithmic(),
        y: Axis::new("share above").logarithmic(),
        traces: vec![Trace::new("", Look::Line(0), exceeded(times))],
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

/// Share of the values above which each lies, or with which it ends; (us, share).
fn exceeded(times: &Histogram<u64>) -> Vec<(f64, f64)> {
    let count = times.len() as f64;
    let mut below = 0;
    let point = |step: IterationValue<u64>| {
        let share = (count - below as f64) / count;
        below += step.count_since_last_iteration();
        // Nothing stands at zero on a logarithmic axis.
        (step.value_iterated_to().max(100) as f64 * 1e-3, share)
    };
    times.iter_recorded().map(point).collect()
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
    use magsteer::daemon::latency_histogram;

    use super::exceeded;

    #[test]
    fn shares_fall_from_all_to_one_value() {
        let mut times = latency_histogram();
        assert!(exceeded(&times).is_empty());
        let values: Vec<u64> = (1..=1000).map(|value| value * 1_000).collect();
        values.iter().for_each(|value| times.record(*value).expect("within bounds"));
        let points = exceeded(&times);
        assert_eq!(points.first().map(|point| point.1), Some(1.0));
        assert!((points.last().expect("points").1 - 1e-3).abs() < 1e-12);
        assert!(points.windows(2).all(|pair| pair[1].0 > pair[0].0 && pair[1].1 < pair[0].1));
        // So many of the values lie at or above each, to the width of a bucket.
        for (value, share) in points {
            let above = values.iter().filter(|other| **other as f64 * 1e-3 >= value * (1.0 - 2e-3)).count();
            assert!((above as f64 / 1000.0 - share).abs() < 5e-3, "{value} us: {above} and {share}");
        }
    }
}
