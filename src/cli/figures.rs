//! Pictures of a run as PNG: the one module that knows the plotting library.

#[cfg(feature = "record")]
mod sheet;
mod timing;

use std::path::Path;

use anyhow::{Context, anyhow};
use kuva::backend::png::PngBackend;
use kuva::plot::{Histogram, LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::figure::{Figure, FigureLegendPosition};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

#[cfg(feature = "record")]
pub use sheet::{Axis, Chart, Look, Sheet, Trace};
#[cfg(feature = "sim")]
pub use timing::{CycleBin, MinutePanel, cycle_histograms, minutes};

/// Colours that stay apart in print and for colour-blind readers (Okabe, Ito 2008).
const COLORS: [&str; 8] =
    ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999"];
const MEASURED_COLOR: &str = COLORS[0];
const PREDICTED_COLOR: &str = COLORS[1];
/// Pixels per unit of the layout: sharp at a journal's column width.
const SCALE: f32 = 2.0;

/// How a measure spreads over the members of a sample.
pub struct Spread {
    /// What is measured, with its unit.
    pub label: String,
    /// One value, not negative, a member that has one; at least one.
    pub values: Vec<f64>,
    /// Members, those without a value included.
    pub members: usize,
}

/// A measure against one parameter.
pub struct Scatter {
    /// The parameter, with its unit.
    pub label: String,
    /// (parameter, measure) of every member that has one.
    pub points: Vec<(f64, f64)>,
    /// Parameters of the members without a measure.
    pub without: Vec<f64>,
}

/// Draws a histogram, and beside it the share of the members that lie below each value.
///
/// # Errors
/// When the picture cannot be rendered or written.
pub fn spread(path: &Path, spread: &Spread) -> anyhow::Result<()> {
    let mut sorted = spread.values.clone();
    sorted.sort_by(f64::total_cmp);
    // From zero, so that two samples can be compared at a glance; a sample of zeros would have bins of no
    // width.
    let range = (0.0, 1.04 * sorted.last().copied().unwrap_or(1.0).max(1e-6));
    let bins = (2.0 * (sorted.len() as f64).sqrt()).ceil().clamp(10.0, 40.0) as usize;
    let width = (range.1 - range.0) / bins as f64;
    let mut counts = vec![0.0; bins];
    for value in &sorted {
        counts[(((value - range.0) / width) as usize).min(bins - 1)] += 1.0;
    }
    let highest = counts.iter().copied().fold(0.0, f64::max);
    let edges = (0..=bins).map(|index| range.0 + index as f64 * width).collect();
    let histogram = Histogram::from_bins(edges, counts).with_color(MEASURED_COLOR);
    let mut steps = vec![(range.0, 0.0)];
    for (index, value) in sorted.iter().enumerate() {
        let share = |count: usize| 100.0 * count as f64 / spread.members as f64;
        steps.extend([(*value, share(index)), (*value, share(index + 1))]);
    }
    steps.push((range.1, steps.last().map_or(0.0, |last| last.1)));
    let curve = LinePlot::new().with_data(steps).with_color(MEASURED_COLOR).with_stroke_width(1.6);
    let layout = |y_label: &str, y_max: f64| {
        let layout = Layout::new(range, (0.0, y_max)).with_x_label(&*spread.label).with_y_label(y_label);
        layout.with_x_axis_min(range.0).with_x_axis_max(range.1).with_y_axis_max(y_max)
    };
    let level = |value: f64| {
        ReferenceLine::horizontal(value).with_color(COLORS[7]).with_label(format!("{value:.0} %"))
    };
    let layouts = vec![
        layout("runs that settled", (1.1 * highest).ceil()),
        layout("share of all runs below (%)", 103.0)
            .with_reference_line(level(50.0))
            .with_reference_line(level(95.0)),
    ];
    let figure = Figure::new(1, 2)
        .with_plots(vec![vec![histogram.into()], vec![curve.into()]])
        .with_layouts(layouts)
        .with_cell_size(460.0, 340.0)
        .with_padding(30.0);
    write(path, figure)
}

/// Draws one panel a parameter, the measure upwards; members without a measure stand in a row above the
/// others.
///
/// # Errors
/// When the picture cannot be rendered or written.
pub fn scatters(path: &Path, measure: &str, panels: &[Scatter]) -> anyhow::Result<()> {
    let columns = panels.len().clamp(1, 3);
    let rows = panels.len().div_ceil(columns).max(1);
    let measures = || panels.iter().flat_map(|panel| panel.points.iter().map(|point| point.1));
    let top = measures().fold(0.0_f64, f64::max).max(1e-6);
    let has_without = panels.iter().any(|panel| !panel.without.is_empty());
    let (plots, layouts) = panels
        .iter()
        .map(|panel| {
            let dots = |points: Vec<(f64, f64)>, color: &str| -> Plot {
                ScatterPlot::new()
                    .with_data(points)
                    .with_color(color)
                    .with_size(2.5)
                    .with_marker_opacity(0.6)
                    .into()
            };
            let above = panel.without.iter().map(|value| (*value, 1.08 * top)).collect();
            let values = || panel.points.iter().map(|point| point.0).chain(panel.without.iter().copied());
            let least = values().fold(f64::INFINITY, f64::min);
            let most = values().fold(f64::NEG_INFINITY, f64::max);
            let margin = (0.05 * (most - least)).max(1e-3 * most.abs()).max(1e-9);
            let layout = Layout::new((least - margin, most + margin), (0.0, 1.15 * top))
                .with_x_label(&*panel.label)
                .with_y_label(measure)
                .with_ticks(4)
                .with_x_axis_min(least - margin)
                .with_x_axis_max(most + margin)
                .with_y_axis_max(1.15 * top);
            (vec![dots(panel.points.clone(), MEASURED_COLOR), dots(above, PREDICTED_COLOR)], layout)
        })
        .unzip::<Vec<Plot>, Layout, Vec<_>, Vec<_>>();
    let entry = |label: &str, color: &str| LegendEntry {
        label: label.to_owned(),
        color: color.to_owned(),
        shape: LegendShape::Circle,
        dasharray: None,
    };
    let mut figure = Figure::new(rows, columns)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(400.0, 300.0)
        .with_padding(30.0);
    if has_without {
        let legend =
            vec![entry("a run", MEASURED_COLOR), entry("a run that did not settle", PREDICTED_COLOR)];
        figure = figure
            .with_shared_legend_entries(legend)
            .with_shared_legend_position(FigureLegendPosition::BottomCenter);
    }
    write(path, figure)
}

/// How a curve is drawn.
#[derive(Debug, Clone, Copy)]
pub enum Stroke {
    /// In this colour, counted round and round.
    Color(usize),
    /// The same, dashed.
    Dashed(usize),
}

/// One curve of a panel.
pub struct Curve {
    /// What it is.
    pub name: String,
    /// How it is drawn.
    pub stroke: Stroke,
    /// (s, value).
    pub points: Vec<(f64, f64)>,
}

/// Curves over one axis of time.
pub struct Panel {
    /// What goes upwards, with its unit.
    pub label: String,
    /// At least one; those without points are left out.
    pub curves: Vec<Curve>,
}

/// Draws panels one below the other, over the same time; a line marks time zero.
///
/// # Errors
/// When there is nothing to draw, or the picture cannot be rendered or written.
pub fn stacked(path: &Path, title: &str, panels: &[Panel]) -> anyhow::Result<()> {
    let drawn = |panel: &&Panel| panel.curves.iter().any(|curve| !curve.points.is_empty());
    let panels: Vec<&Panel> = panels.iter().filter(drawn).collect();
    let points = || panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
    let first = points().fold(f64::INFINITY, |least, point| least.min(point.0));
    let last = points().fold(f64::NEG_INFINITY, |most, point| most.max(point.0));
    if panels.is_empty() || first >= last {
        return Err(anyhow!("{}: cannot be drawn: there is nothing to draw", path.display()));
    }
    let mut plots = Vec::new();
    let mut layouts = Vec::new();
    for (index, panel) in panels.iter().enumerate() {
        let curves = panel.curves.iter().filter(|curve| !curve.points.is_empty());
        let lines: Vec<Plot> = curves.map(line).collect();
        let mut layout = Layout::auto_from_plots(&lines)
            .with_x_label("time from the trip (s)")
            .with_y_label(panel.label.clone())
            .with_x_axis_min(first)
            .with_x_axis_max(last)
            .with_reference_line(ReferenceLine::vertical(0.0).with_color(COLORS[7]));
        if index == 0 {
            layout = layout.with_title(title).with_title_size(14);
        }
        layouts.push(layout);
        plots.push(lines);
    }
    let figure = Figure::new(plots.len(), 1)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(900.0, 230.0)
        .with_padding(30.0)
        .with_keep_panel_legends();
    write(path, figure)
}

fn line(curve: &Curve) -> Plot {
    let (Stroke::Color(color) | Stroke::Dashed(color)) = curve.stroke;
    let line = LinePlot::new()
        .with_data(curve.points.clone())
        .with_color(COLORS[color % COLORS.len()])
        .with_stroke_width(1.2)
        .with_legend(curve.name.clone());
    match curve.stroke {
        Stroke::Color(_) => line.into(),
        Stroke::Dashed(_) => line.with_dashed().into(),
    }
}

fn write(path: &Path, figure: Figure) -> anyhow::Result<()> {
    let scene = figure.render();
    let picture = PngBackend::new().with_scale(SCALE).render_scene(&scene);
    let bytes = picture.map_err(|reason| anyhow!("{}: cannot be drawn: {reason}", path.display()))?;
    std::fs::write(path, bytes).with_context(|| format!("{}: cannot be written", path.display()))
}
