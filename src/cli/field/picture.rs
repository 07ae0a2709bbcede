//! The fit as a picture: the paper's Fig. 3, dipole against multipole, and the error of each order.
//!
//! A grid of one coil is drawn along its lines: field components against y in three planes, and along the
//! axis towards the coil, where series go wrong. Anything else is drawn as modelled against measured
//! components.

use anyhow::anyhow;
use kuva::backend::png::PngBackend;
use kuva::plot::{LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::annotations::{ReferenceLine, TextAnnotation};
use kuva::render::figure::{Figure, FigureLegendPosition};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use magsteer::magnetics::fit::{CoilFit, FieldFit, OrderReport, Reading};
use nalgebra::Vector3;

use super::fit::Subject;

/// Colours that stay apart in print and for colour-blind readers (Okabe, Ito 2008).
const MEASURED: &str = "#000000";
const DIPOLE: &str = "#D55E00";
const CHOSEN: &str = "#0072B2";
const FITTED: &str = "#999999";
const FOLDS: &str = "#CC79A7";
const REGION: &str = "#009E73";
/// Pixels per unit of the layout: sharp at a journal's column width.
const SCALE: f32 = 2.0;
/// Readings that make a line.
const LINE_MIN: usize = 5;
/// Points of a model's curve.
const CURVE_POINTS: usize = 161;
/// Points of a dash and of the gap after it: the library starts its own dashes anew at every point.
const DASH: (usize, usize) = (4, 2);

/// Draws the fit; returns the bytes of a PNG.
///
/// # Errors
/// When the picture cannot be rendered.
pub(super) fn draw(subject: &Subject, found: &FieldFit) -> anyhow::Result<Vec<u8>> {
    let order = |order: usize| found.orders.iter().find(|report| report.order == order);
    let (Some(chosen), Some(dipole)) = (order(found.order), order(1).or_else(|| found.orders.first())) else {
        return Err(anyhow!("no order to draw"));
    };
    let fits = Fits { subject, coils: &found.coils, dipole, chosen };
    let grid = Grid::of(subject);
    let mut panels = match &grid {
        Some(grid) => vec![fits.across(grid, 0), fits.across(grid, 1), fits.along(grid)],
        None => vec![fits.parity(0), fits.parity(1), fits.parity(2)],
    };
    panels.push(errors(found));
    let (plots, layouts): (Vec<_>, Vec<_>) = panels.into_iter().unzip();
    let figure = Figure::new(2, 2)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(480.0, 360.0)
        .with_padding(30.0)
        .with_shared_legend_entries(legend(&fits, found, grid.is_some()))
        .with_shared_legend_position(FigureLegendPosition::BottomCenter);
    let picture = PngBackend::new().with_scale(SCALE).render_scene(&figure.render());
    picture.map_err(|reason| anyhow!("the picture cannot be drawn: {reason}"))
}

/// What the colours mean: of the fields, drawn as lines or as dots, and of the errors.
fn legend(fits: &Fits<'_>, found: &FieldFit, by_lines: bool) -> Vec<LegendEntry> {
    let entry = |label: String, color: &str, is_line: bool, dasharray: Option<&str>| LegendEntry {
        label,
        color: color.to_owned(),
        shape: if is_line { LegendShape::Line } else { LegendShape::Circle },
        dasharray: dasharray.map(str::to_owned),
    };
    let (dipole, chosen) = (fits.dipole.order, fits.chosen.order);
    let dashes = by_lines.then_some("6 4");
    let measured = if by_lines { "measured" } else { "modelled as measured" };
    let mut entries = vec![
        entry(measured.to_owned(), MEASURED, !by_lines, None),
        entry(format!("dipole (P = {dipole})"), DIPOLE, by_lines, dashes),
        entry(format!("multipole (P = {chosen})"), CHOSEN, by_lines, None),
        entry("error of all readings".to_owned(), FITTED, true, None),
        entry("error of readings left out in folds".to_owned(), FOLDS, false, None),
    ];
    if let Some(region) = found.regions.first() {
        entries.push(entry(format!("error of a region left out: {}", region.name), REGION, true, None));
    }
    entries
}

type Panel = (Vec<Plot>, Layout);

/// The planes and the line of a grid to draw, in m.
struct Grid {
    /// Three distances from the coil.
    planes: Vec<f64>,
    /// Off the axis, in the direction that is not drawn.
    z: f64,
    /// Largest current, to which fields are scaled.
    current: f64,
}

impl Grid {
    /// The grid that one coil was measured on; `None` when the readings stand on no lines.
    fn of(subject: &Subject) -> Option<Self> {
        if subject.poses.len() != 1 {
            return None;
        }
        let readings = &subject.readings.readings;
        let z = *distinct(readings.iter().map(|reading| reading.position.z)).first()?;
        let in_plane = || readings.iter().filter(move |reading| same(reading.position.z, z));
        let lines = distinct(in_plane().map(|reading| reading.position.x));
        let is_line = |x: &f64| in_plane().filter(|reading| same(reading.position.x, *x)).count() >= LINE_MIN;
        let lines: Vec<f64> = lines.into_iter().filter(is_line).collect();
        if lines.len() < 3 {
            return None;
        }
        let planes = vec![lines[0], lines[lines.len() / 4], lines[lines.len() / 2]];
        let current = readings.iter().fold(0.0_f64, |most, reading| most.max(reading.currents[0].abs()));
        Some(Self { planes, z, current })
    }
}

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-5
}

/// Values that stand apart, the smallest magnitude of a cluster first for signed ones.
fn distinct(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(|a, b| a.abs().total_cmp(&b.abs()).then(a.total_cmp(b)));
    values.dedup_by(|a, b| same(*a, *b));
    values
}

struct Fits<'a> {
    subject: &'a Subject,
    coils: &'a [CoilFit],
    dipole: &'a OrderReport,
    chosen: &'a OrderReport,
}

impl Fits<'_> {
    /// A field component (0 for x, 1 for y) against y, in each plane.
    fn across(&self, grid: &Grid, component: usize) -> Panel {
        let mut plots = Vec::new();
        let mut labels = Vec::new();
        let mut all = (0.0, 0.0);
        for plane in &grid.planes {
            let readings = || {
                let readings = self.subject.readings.readings.iter();
                readings
                    .filter(|reading| same(reading.position.z, grid.z) && same(reading.position.x, *plane))
            };
            let range = ends(readings().map(|reading| reading.position.y));
            let at = |y: f64| Vector3::new(*plane, y, grid.z);
            all = (range.0.min(all.0), range.1.max(all.1));
            let end = self.field(self.chosen, at(range.1), grid.current)[component] * 1e3;
            labels.push((format!("{:.0} mm", plane * 1e3), range.1 * 1e3, end));
            self.model(&mut plots, range, grid.current, component, &at);
            plots.push(measured(readings(), grid.current, |reading| reading.position.y, component));
        }
        let name = ["Bx", "By", "Bz"][component];
        let (least, most) = (all.0 * 1e3, all.1 * 1e3);
        let mut layout = Layout::auto_from_plots(&plots)
            .with_title(format!("{name} across the axis, by distance from the coil"))
            .with_title_size(14)
            .with_x_label("y (mm)")
            .with_y_label(format!("{name} at {} A (mT)", grid.current))
            .with_x_axis_min(least - 0.05 * (most - least))
            .with_x_axis_max(most + 0.2 * (most - least));
        for (text, x, y) in labels {
            let beside = x + 0.1 * (most - least);
            layout = layout.with_annotation(TextAnnotation::new(text, beside, y).with_font_size(11));
        }
        (plots, layout)
    }

    /// The axial component against x, on the line nearest to the axis.
    fn along(&self, grid: &Grid) -> Panel {
        let readings = &self.subject.readings.readings;
        let in_plane = || readings.iter().filter(|reading| same(reading.position.z, grid.z));
        let y = distinct(in_plane().map(|reading| reading.position.y)).first().copied().unwrap_or(0.0);
        let on_line = || in_plane().filter(move |reading| same(reading.position.y, y));
        let (nearest, furthest) = ends(on_line().map(|reading| reading.position.x));
        let from_x = nearest - 0.015_f64.min(nearest / 2.0);
        let mut plots = Vec::new();
        self.model(&mut plots, (from_x, furthest), grid.current, 0, &|x| Vector3::new(x, y, grid.z));
        plots.push(measured(on_line(), grid.current, |reading| reading.position.x, 0));
        let mut layout = Layout::auto_from_plots(&plots)
            .with_title("Bx along the axis")
            .with_title_size(14)
            .with_x_label("x (mm)")
            .with_y_label(format!("Bx at {} A (mT)", grid.current));
        if let [coil] = self.coils {
            let from = (coil.origin + coil.range.from_x) * 1e3;
            let line = ReferenceLine::vertical(from).with_color("#999999");
            let height = 0.9 * self.field(self.dipole, Vector3::new(from_x, y, grid.z), grid.current).x * 1e3;
            let label = TextAnnotation::new(format!("valid from {from:.1} mm"), from + 22.0, height);
            layout = layout.with_reference_line(line).with_annotation(label.with_font_size(11));
        }
        (plots, layout)
    }

    /// Both models along a curve; `at` gives a point for a coordinate in m.
    fn model(
        &self,
        plots: &mut Vec<Plot>,
        (from, to): (f64, f64),
        current: f64,
        component: usize,
        at: &dyn Fn(f64) -> Vector3<f64>,
    ) {
        let curve = |report: &OrderReport| -> Vec<(f64, f64)> {
            let point = |index: usize| {
                let along = from + (to - from) * index as f64 / (CURVE_POINTS - 1) as f64;
                (along * 1e3, self.field(report, at(along), current)[component] * 1e3)
            };
            (0..CURVE_POINTS).map(point).collect()
        };
        let line = |points: &[(f64, f64)], color: &str| -> Plot {
            LinePlot::new().with_data(points.to_vec()).with_color(color).with_stroke_width(1.4).into()
        };
        let dashed = curve(self.dipole);
        let dashes = dashed.chunks(DASH.0 + DASH.1).map(|chunk| &chunk[..chunk.len().min(DASH.0 + 1)]);
        plots.extend(dashes.map(|dash| line(dash, DIPOLE)));
        plots.push(line(&curve(self.chosen), CHOSEN));
    }

    /// Field of the one coil, T.
    fn field(&self, report: &OrderReport, position: Vector3<f64>, current: f64) -> Vector3<f64> {
        let reading = Reading { line: 0, position, currents: vec![current], field: Vector3::zeros() };
        report.field(&self.subject.poses, &reading)
    }

    /// Modelled against measured, of one component.
    fn parity(&self, component: usize) -> Panel {
        let readings = &self.subject.readings.readings;
        let points = |report: &OrderReport| -> Vec<(f64, f64)> {
            let point = |reading: &Reading| {
                let modelled = report.field(&self.subject.poses, reading)[component];
                (reading.field[component] * 1e3, modelled * 1e3)
            };
            readings.iter().map(point).collect()
        };
        let dots = |report, color: &str| -> Plot {
            ScatterPlot::new().with_data(points(report)).with_color(color).with_size(1.8).into()
        };
        let (least, most) = ends(readings.iter().map(|reading| reading.field[component] * 1e3));
        let diagonal = LinePlot::new().with_data(vec![(least, least), (most, most)]).with_color(MEASURED);
        let plots = vec![
            dots(self.dipole, DIPOLE),
            dots(self.chosen, CHOSEN),
            diagonal.with_stroke_width(0.8).into(),
        ];
        let name = ["Bx", "By", "Bz"][component];
        let layout = Layout::auto_from_plots(&plots)
            .with_title(format!("{name}, modelled against measured"))
            .with_title_size(14)
            .with_x_label(format!("{name} measured (mT)"))
            .with_y_label(format!("{name} modelled (mT)"));
        (plots, layout)
    }
}

fn measured<'a>(
    readings: impl Iterator<Item = &'a Reading>,
    current: f64,
    coordinate: fn(&Reading) -> f64,
    component: usize,
) -> Plot {
    let driven = readings.filter(|reading| reading.currents[0] != 0.0);
    let point = |reading: &Reading| {
        (coordinate(reading) * 1e3, reading.field[component] * 1e3 * current / reading.currents[0])
    };
    let points: Vec<(f64, f64)> = driven.map(point).collect();
    ScatterPlot::new().with_data(points).with_color(MEASURED).with_size(2.2).into()
}

fn ends(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), value| (least.min(value), most.max(value)))
}

/// What each order leaves: of all readings, of left-out folds and of the first region.
fn errors(found: &FieldFit) -> Panel {
    let curve = |of: &dyn Fn(&OrderReport) -> Option<f64>| -> Vec<(f64, f64)> {
        found.orders.iter().filter_map(|report| Some((report.order as f64, of(report)? * 1e3))).collect()
    };
    let line = |points: Vec<(f64, f64)>, color: &str| -> Plot {
        LinePlot::new().with_data(points).with_color(color).with_stroke_width(1.4).into()
    };
    let folds = curve(&|report| report.holdout_rms_norm);
    let mut plots: Vec<Plot> = vec![
        line(curve(&|report| Some(report.rms_norm)), FITTED),
        ScatterPlot::new().with_data(folds).with_color(FOLDS).with_size(3.5).into(),
    ];
    if !found.regions.is_empty() {
        plots.push(line(curve(&|report| report.region_rms_norms.first().copied().flatten()), REGION));
    }
    let layout = Layout::auto_from_plots(&plots)
        .with_title("error of each order")
        .with_title_size(14)
        .with_x_label("order P")
        .with_y_label("RMS norm (mT)")
        .with_log_y()
        .with_x_tick_step(1.0)
        .with_x_axis_min(0.0)
        .with_x_axis_max(11.0)
        .with_reference_line(ReferenceLine::vertical(found.order as f64).with_color("#999999"));
    (plots, layout)
}
