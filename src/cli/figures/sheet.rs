//! Charts of one look, side by side on a sheet as wide as a journal's column: as SVG, as PNG, and every curve as CSV.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use anyhow::Context;
use kuva::backend::svg::SvgBackend;
use kuva::plot::{BandPlot, LegendEntry, LegendShape, LinePlot, ScatterPlot};
use kuva::render::annotations::ReferenceLine;
use kuva::render::figure::{Figure, FigureLegendPosition};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::decades::{numbers, sparse, with_two_numbers};
use super::{GREY, color, write};

/// Sizes of text in a sheet 480 wide: 7 points or more when that is printed 88 mm wide.
const TITLE_SIZE: u32 = 14;
const TEXT_SIZE: u32 = 14;
/// Width of a sheet, and of what stands around its cells.
const SHEET_WIDTH: f64 = 480.0;
const PADDING: f64 = 14.0;
/// Numbers for which a logarithmic axis has room: to the right, where they stand side by side, and upwards.
const NUMBERS_MAX: (usize, usize) = (4, 7);
/// Characters of one of its numbers, likewise.
const CHARACTERS_MAX: (usize, usize) = (6, 5);

/// How a curve is drawn. Colours are counted round and round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Look {
    /// A line.
    Line(usize),
    /// A broken line; for curves of few points.
    Dashed(usize),
    /// A line of this width.
    Wide(usize, f64),
    /// Dots.
    Dots(usize),
    /// A box from the first point to the last, this far to both sides of the first.
    Box(usize, f64),
}

impl Look {
    fn color(self) -> &'static str {
        let (Self::Line(number)
        | Self::Dashed(number)
        | Self::Wide(number, _)
        | Self::Dots(number)
        | Self::Box(number, _)) = self;
        color(number)
    }
}

/// One curve.
#[derive(Debug, Clone)]
pub struct Trace {
    /// What it is; curves of one name share a line of the legend.
    pub name: String,
    /// How it is drawn.
    pub look: Look,
    /// Its points.
    pub points: Vec<(f64, f64)>,
}

/// One axis.
#[derive(Debug, Clone, Default)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// Its ends; as the curves have them when left out.
    pub range: Option<(f64, f64)>,
    /// True for a logarithmic one.
    pub is_log: bool,
    /// What stands below 1, 2, 3, ...; numbers where it is left out. Of the axis to the right alone.
    pub names: Vec<String>,
}

impl Axis {
    /// An axis as far as its curves go.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// The same with these ends.
    pub fn between(self, least: f64, most: f64) -> Self {
        Self { range: Some((least, most)), ..self }
    }

    /// The same with names below 1, 2, 3, ..., from half a place before the first to half a place after the last.
    pub fn named(self, names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let names: Vec<String> = names.into_iter().map(Into::into).collect();
        Self { range: Some((0.5, names.len() as f64 + 0.5)), names, ..self }
    }

    /// The same, logarithmic.
    pub fn logarithmic(self) -> Self {
        Self { is_log: true, ..self }
    }
}

/// Curves over one pair of axes.
#[derive(Debug, Clone, Default)]
pub struct Chart {
    /// Heading, where there is one.
    pub title: Option<String>,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// At least one with points.
    pub traces: Vec<Trace>,
    /// Limits, drawn as grey lines across.
    pub limits: Vec<f64>,
    /// True where a length is as long to the right as upwards.
    pub is_to_scale: bool,
}

/// Charts in rows of so many.
#[derive(Debug, Clone)]
pub struct Sheet {
    /// Name of its files.
    pub name: &'static str,
    /// What it shows, in a sentence or two.
    pub caption: String,
    /// Charts in a row.
    pub columns: usize,
    /// Height of a chart, of a sheet 480 wide.
    pub height: f64,
    /// From left to right, then down.
    pub charts: Vec<Chart>,
}

impl Sheet {
    /// Writes NAME.svg, NAME.png and NAME.csv into a folder and returns the text of the SVG with their paths.
    ///
    /// # Errors
    /// When it cannot be drawn, or a file cannot be written.
    pub fn write(&self, folder: &Path) -> anyhow::Result<(String, Vec<PathBuf>)> {
        let file = |extension: &str| folder.join(format!("{}.{extension}", self.name));
        let svg = SvgBackend::new().render_scene(&self.figure().render());
        let paths = [file("svg"), file("png"), file("csv")];
        let put = |path: &Path, text: &str| {
            std::fs::write(path, text).with_context(|| format!("{}: cannot be written", path.display()))
        };
        put(&paths[0], &svg)?;
        write(&paths[1], self.figure())?;
        put(&paths[2], &self.table())?;
        Ok((svg, paths.into()))
    }

    fn figure(&self) -> Figure {
        let columns = self.columns.clamp(1, self.charts.len().max(1));
        let rows = self.charts.len().div_ceil(columns).max(1);
        let width = (SHEET_WIDTH - 2.0 * PADDING) / columns as f64;
        let (plots, layouts): (Vec<_>, Vec<_>) = self.charts.iter().map(Chart::panel).unzip();
        let mut figure = Figure::new(rows, columns)
            .with_plots(plots)
            .with_layouts(layouts)
            .with_cell_size(width, self.height)
            .with_spacing(8.0)
            .with_padding(PADDING);
        let legend = self.legend();
        if legend.len() > 1 {
            figure = figure
                .with_shared_legend_entries(legend)
                .with_shared_legend_position(FigureLegendPosition::BottomCenter);
        }
        figure
    }

    /// One entry for every name.
    fn legend(&self) -> Vec<LegendEntry> {
        let mut entries: Vec<LegendEntry> = Vec::new();
        for trace in self.charts.iter().flat_map(|chart| &chart.traces) {
            if trace.name.is_empty() || entries.iter().any(|entry| entry.label == trace.name) {
                continue;
            }
            let shape = match trace.look {
                Look::Dots(_) => LegendShape::Circle,
                Look::Box(..) => LegendShape::Rect,
                _ => LegendShape::Line,
            };
            entries.push(LegendEntry {
                label: trace.name.clone(),
                color: trace.look.color().to_owned(),
                shape,
                dasharray: matches!(trace.look, Look::Dashed(_)).then(|| "6 4".to_owned()),
            });
        }
        entries
    }

    /// Every point of every curve, a line each.
    fn table(&self) -> String {
        let mut text = String::from("chart,curve,x,y\n");
        for (index, chart) in self.charts.iter().enumerate() {
            // Writing to a string does not fail.
            let _ = writeln!(
                text,
                "# chart {}: {}, x = {}, y = {}",
                index + 1,
                chart.title.as_deref().unwrap_or(self.name),
                chart.x.label,
                chart.y.label
            );
            for trace in &chart.traces {
                let name = trace.name.replace([',', '\n'], " ");
                for (x, y) in &trace.points {
                    let _ = writeln!(text, "{},{name},{x},{y}", index + 1);
                }
            }
        }
        text
    }
}

impl Chart {
    fn panel(&self) -> (Vec<Plot>, Layout) {
        let drawn = self.traces.iter().filter(|trace| !trace.points.is_empty());
        let plots: Vec<Plot> = drawn.map(Trace::plot).collect();
        let x = self.range(&self.x, |point| point.0, NUMBERS_MAX.0);
        let y = self.range(&self.y, |point| point.1, NUMBERS_MAX.1);
        let mut layout = Layout::new(x, y)
            .with_x_label(self.x.label.clone())
            .with_y_label(self.y.label.clone())
            .with_label_size(TEXT_SIZE)
            .with_tick_size(TEXT_SIZE - 2)
            .with_ticks(4)
            .with_x_axis_min(x.0)
            .with_x_axis_max(x.1)
            .with_y_axis_min(y.0)
            .with_y_axis_max(y.1);
        if let Some(title) = &self.title {
            layout = layout.with_title(title.clone()).with_title_size(TITLE_SIZE);
        }
        if !self.x.names.is_empty() {
            layout = layout.with_x_categories(self.x.names.clone());
        }
        if self.is_to_scale {
            layout = layout.with_equal_aspect();
        }
        if self.x.is_log {
            layout = layout.with_log_x().with_x_tick_format(numbers(x, CHARACTERS_MAX.0));
        }
        if self.y.is_log {
            layout = layout.with_log_y().with_y_tick_format(numbers(y, CHARACTERS_MAX.1));
        }
        for limit in &self.limits {
            layout = layout.with_reference_line(ReferenceLine::horizontal(*limit).with_color(color(GREY)));
        }
        (plots, layout)
    }

    /// Ends of an axis: those stated, or those of the points and a little more.
    fn range(&self, axis: &Axis, part: fn(&(f64, f64)) -> f64, numbers_max: usize) -> (f64, f64) {
        if let Some(range) = axis.range {
            return range;
        }
        let points = || self.traces.iter().flat_map(|trace| &trace.points).map(part);
        let finite = || points().filter(|value| value.is_finite());
        let (least, most) =
            (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
        if least > most {
            return (0.0, 1.0);
        }
        if axis.is_log {
            let ends = (least.max(f64::MIN_POSITIVE) / 1.3, most.max(f64::MIN_POSITIVE) * 1.3);
            return sparse(with_two_numbers(ends), numbers_max);
        }
        let margin = (0.06 * (most - least)).max(1e-3 * most.abs()).max(1e-9);
        (least - margin, most + margin)
    }
}

impl Trace {
    /// A curve.
    pub fn new(name: impl Into<String>, look: Look, points: Vec<(f64, f64)>) -> Self {
        Self { name: name.into(), look, points }
    }

    fn plot(&self) -> Plot {
        let color = self.look.color();
        let line = |width: f64| {
            LinePlot::new().with_data(self.points.clone()).with_color(color).with_stroke_width(width)
        };
        match self.look {
            Look::Line(_) => line(1.3).into(),
            Look::Dashed(_) => line(1.5).with_dashed().into(),
            Look::Wide(_, width) => line(width).into(),
            Look::Box(_, half_width) => {
                let (first, last) = (self.points.first(), self.points.last());
                let (x, low) = first.copied().unwrap_or_default();
                let high = last.map_or(low, |point| point.1);
                let band = BandPlot::new([x - half_width, x + half_width], [low, low], [high, high]);
                band.with_color(color).with_opacity(1.0).into()
            }
            Look::Dots(_) => {
                ScatterPlot::new().with_data(self.points.clone()).with_color(color).with_size(3.5).into()
            }
        }
    }
}
