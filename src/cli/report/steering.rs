//! Where the magnets pointed: angles against time, and the rod from its sides.

use magsteer::daemon::target::angle_from_z_deg;
use magsteer::rod::Station;
use nalgebra::Vector3;

use super::run::{Run, Sample, Step};
use crate::cli::figures::{Axis, Chart, GREY, Look, Sheet, Trace};
use crate::cli::model_shapes::Shapes;

pub(super) const DESIRED: Look = Look::Dashed(6);
pub(super) const MEASURED: Look = Look::Line(0);
pub(super) const PREDICTED: Look = Look::Line(1);
/// Views of a sheet, at most.
const VIEWS_MAX: usize = 8;
/// Half the length of the line that shows a target's direction, mm.
const REACH_MM: f64 = 9.0;
/// A run whose targets leave the x-z plane by more than this is one in 3-D.
const PLANAR: f64 = 0.02;

/// An angle of a tangent, deg; `None` where there is none.
type Angle = fn(&[f64; 3]) -> Option<f64>;

/// The paper's Fig. 5: each magnet's angle, desired, measured and predicted.
pub fn angles(run: &Run) -> Sheet {
    let charts = run
        .magnets()
        .iter()
        .enumerate()
        .map(|(index, name)| chart(run, index, format!("{name}, from z (deg)"), angle_from_z_deg));
    Sheet {
        name: "angles",
        caption: "Angle of each magnet from the vertical against time: desired (the operator's target), measured, and predicted by the \
                  model at the measured currents."
            .to_owned(),
        columns: 1,
        height: 190.0,
        charts: charts.collect(),
    }
}

/// The paper's Fig. 6: both angles of each magnet; `None` for a run in the x-z plane.
pub fn convergence(run: &Run) -> Option<Sheet> {
    if !is_spatial(run) {
        return None;
    }
    let angles: [(&str, Angle); 2] =
        [("from z (deg)", angle_from_z_deg), ("azimuth from x (deg)", azimuth_deg)];
    let charts = run.magnets().iter().enumerate().flat_map(|(index, name)| {
        angles.map(|(label, angle)| chart(run, index, format!("{name}, {label}"), angle))
    });
    Some(Sheet {
        name: "convergence",
        caption: "Both angles of each magnet against time, in 3-D.".to_owned(),
        columns: 1,
        height: 170.0,
        charts: charts.collect(),
    })
}

fn is_spatial(run: &Run) -> bool {
    run.steps.iter().flat_map(|step| &step.target).any(|direction| direction[1].abs() > PLANAR)
}

fn chart(run: &Run, magnet: usize, label: String, angle: Angle) -> Chart {
    let curve = |of: fn(&Sample) -> &[[f64; 3]]| -> Vec<(f64, f64)> {
        let samples = run.samples.iter();
        samples.filter_map(|sample| Some((sample.time, angle(of(sample).get(magnet)?)?))).collect()
    };
    Chart {
        title: None,
        x: Axis::new("time (s)").between(0.0, run.samples.last().map_or(1.0, |sample| sample.time)),
        y: Axis::new(label),
        traces: vec![
            Trace::new("measured", MEASURED, curve(|sample| &sample.measured)),
            Trace::new("predicted", PREDICTED, curve(|sample| &sample.predicted)),
            Trace::new("desired", DESIRED, corners(&curve(|sample| &sample.target))),
        ],
        ..Chart::default()
    }
}

/// A curve of steps by its corners alone: a line of few points is drawn broken.
fn corners(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let last = points.len().saturating_sub(1);
    let stays = |index: usize| {
        (index > 0 && index < last)
            && points[index].1 == points[index - 1].1
            && points[index].1 == points[index + 1].1
    };
    points.iter().enumerate().filter(|(index, _)| !stays(*index)).map(|(_, point)| *point).collect()
}

fn azimuth_deg(direction: &[f64; 3]) -> Option<f64> {
    let [x, y, _] = *direction;
    // At the pole there is none.
    (x.hypot(y) > 0.02).then(|| y.atan2(x).to_degrees())
}

/// The rod as the model has it at the end of each step, from one side, and of a run in 3-D from three.
pub fn views(run: &Run) -> Option<Sheet> {
    let mut shapes = Shapes::at_rest(&run.config)?;
    let sides: &[[usize; 2]] = if is_spatial(run) { &[[0, 2], [1, 2], [0, 1]] } else { &[[0, 2]] };
    let shown = VIEWS_MAX / sides.len().min(2);
    let mut samples = run.samples.iter().peekable();
    let mut charts = Vec::new();
    for (index, step) in run.steps.iter().enumerate().take(shown) {
        while let Some(sample) = samples.next_if(|sample| sample.time <= step.end) {
            shapes.follow(&sample.currents, &sample.angles);
        }
        charts.extend(sides.iter().map(|side| view(&shapes, step, index, *side)));
    }
    align(&mut charts, sides.len());
    let left_out = run.steps.len().saturating_sub(shown);
    let rest = if left_out > 0 { format!(" Not drawn: {left_out} more.") } else { String::new() };
    (!charts.is_empty()).then(|| Sheet {
        name: "views",
        caption: format!(
            "The rod as the model has it at the measured currents, at the end of each step. Grey: flexible sections; blue: magnets; broken: \
             the target's direction.{rest}"
        ),
        columns: if sides.len() > 1 { sides.len() } else { 2 },
        height: if sides.len() > 1 { 170.0 } else { 190.0 },
        charts,
    })
}

fn view(shapes: &Shapes<'_>, step: &Step, index: usize, [right, up]: [usize; 2]) -> Chart {
    let point = |position: &Vector3<f64>| (position[right] * 1e3, position[up] * 1e3);
    let stations = shapes.stations();
    let names = ["x (mm)", "y (mm)", "z (mm)"];
    let magnets = stations.windows(2).filter(|pair| pair[1].magnet.is_some());
    let magnets = magnets.map(|pair| {
        let ends = [&pair[0], &pair[1]].map(|station: &Station| point(&station.position));
        Trace::new("magnet", Look::Wide(0, 5.0), ends.to_vec())
    });
    let targets = shapes.pass().magnets().iter().zip(&step.target).map(|(magnet, direction)| {
        let (x, z) = point(&magnet.position());
        let ends =
            [-REACH_MM, REACH_MM].map(|length| (x + length * direction[right], z + length * direction[up]));
        Trace::new("target", Look::Dashed(1), ends.to_vec())
    });
    let line = stations.iter().map(|station| point(&station.position)).collect();
    let mut traces = vec![Trace::new("flexible section", Look::Wide(GREY, 2.5), line)];
    traces.extend(magnets);
    traces.extend(targets);
    let angles: Vec<String> =
        step.target.iter().filter_map(angle_from_z_deg).map(|it| format!("{it:.0}")).collect();
    Chart {
        title: Some(format!("{}: ({}) deg", index + 1, angles.join(", "))),
        x: Axis::new(names[right]),
        y: Axis::new(names[up]),
        traces,
        is_to_scale: true,
        ..Chart::default()
    }
}

/// The same ends of the axes for every view from one side.
fn align(charts: &mut [Chart], sides: usize) {
    for side in 0..sides {
        let range = |part: fn(&(f64, f64)) -> f64| {
            let views = charts.iter().skip(side).step_by(sides);
            let values =
                || views.clone().flat_map(|chart| &chart.traces).flat_map(|trace| &trace.points).map(part);
            (values().fold(f64::INFINITY, f64::min) - 3.0, values().fold(f64::NEG_INFINITY, f64::max) + 3.0)
        };
        let (x, y) = (range(|point| point.0), range(|point| point.1));
        for chart in charts.iter_mut().skip(side).step_by(sides) {
            (chart.x.range, chart.y.range) = (Some(x), Some(y));
        }
    }
}
