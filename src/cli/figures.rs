//! Pictures of a run as PNG: the one module that knows the plotting library.

#[cfg(any(feature = "record", feature = "sim"))]
mod decades;
#[cfg(feature = "record")]
mod sheet;
mod timing;

use std::path::Path;

use anyhow::{Context, anyhow};
use kuva::backend::png::PngBackend;
use kuva::plot::LinePlot;
use kuva::render::annotations::ReferenceLine;
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

#[cfg(feature = "record")]
pub use sheet::{Axis, Chart, Look, Sheet, Trace};
#[cfg(feature = "sim")]
pub use timing::{CycleBin, MinutePanel, cycle_histograms, minutes};

/// Colours that stay apart in print and for colour-blind readers (Okabe, Ito 2008), and Tol's wine in place of a grey.
const COLORS: [&str; 8] =
    ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#882255"];
/// The colour of what is no curve: of limits and of what stands in the background. No count of curves comes to it.
pub const GREY: usize = usize::MAX;
/// Pixels per unit of the layout: sharp at a journal's column width.
const SCALE: f32 = 2.0;

/// How a curve is drawn.
#[derive(Debug, Clone, Copy)]
pub enum Stroke {
    /// In this colour, counted round and round.
    Color(usize),
    /// The same, dashed.
    Dashed(usize),
}

/// A colour by its number, counted round and round.
fn color(number: usize) -> &'static str {
    if number == GREY { "#999999" } else { COLORS[number % COLORS.len()] }
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
            .with_reference_line(ReferenceLine::vertical(0.0).with_color(color(GREY)));
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
    let (Stroke::Color(number) | Stroke::Dashed(number)) = curve.stroke;
    let line = LinePlot::new()
        .with_data(curve.points.clone())
        .with_color(color(number))
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

#[cfg(test)]
mod tests {
    use super::{GREY, color};

    #[test]
    fn no_curve_has_the_colour_of_limits() {
        assert!((0..100).all(|number| color(number) != color(GREY)));
    }
}
