//! Timing of very many cycles: histograms over decades, and quantities minute by minute.
#![cfg(feature = "sim")]

use std::path::Path;

use kuva::plot::LinePlot;
use kuva::render::figure::Figure;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

use super::decades::{numbers, with_two_numbers};
use super::{COLORS, Curve, line, write};

/// Height at which an empty bin is drawn: a single cycle is to be seen, and the axis is logarithmic.
const FLOOR: f64 = 0.5;
/// Characters of a number for which there is room beside an axis.
const CHARACTERS_MAX: usize = 7;

/// Cycles between two edges of time.
pub struct CycleBin {
    pub from_us: f64,
    pub to_us: f64,
    pub cycles: f64,
}

/// Curves minute by minute.
pub struct MinutePanel {
    /// What goes upwards, with its unit.
    pub label: String,
    /// Over decades; values must be positive.
    pub logarithmic: bool,
    /// (min, value).
    pub curves: Vec<Curve>,
}

/// Draws one histogram below the other over the same axis of time; both axes are logarithmic.
///
/// # Errors
/// When the picture cannot be rendered or written.
pub fn cycle_histograms(path: &Path, histograms: &[(&str, Vec<CycleBin>)]) -> anyhow::Result<()> {
    let bins = || histograms.iter().flat_map(|(_, bins)| bins);
    let least = bins().fold(f64::INFINITY, |least, bin| least.min(bin.from_us));
    let most = bins().fold(1.0, |most: f64, bin| most.max(bin.to_us));
    let highest = bins().fold(1.0, |most: f64, bin| most.max(bin.cycles));
    let mut plots = Vec::new();
    let mut layouts = Vec::new();
    for (index, (label, bins)) in histograms.iter().enumerate() {
        let color = COLORS[index % COLORS.len()];
        let outline = LinePlot::new().with_data(outline(bins)).with_color(color).with_stroke_width(1.4);
        plots.push(vec![Plot::from(outline)]);
        // From a power of ten on, so that the numbers begin where the curves do.
        let from = 10_f64.powf(least.min(most).max(1e-3).log10().floor());
        let (to, top) = (1.2 * most, 2.0 * highest);
        layouts.push(
            Layout::new((from, to), (FLOOR, top))
                .with_log_scale()
                .with_x_tick_format(numbers((from, to), CHARACTERS_MAX))
                .with_y_tick_format(numbers((FLOOR, top), CHARACTERS_MAX))
                .with_x_label(format!("{label} (us)"))
                .with_y_label("cycles")
                .with_x_axis_min(from)
                .with_x_axis_max(to)
                .with_y_axis_min(FLOOR)
                .with_y_axis_max(top),
        );
    }
    let figure = Figure::new(plots.len(), 1)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(900.0, 300.0)
        .with_padding(30.0);
    write(path, figure)
}

/// The outline of the bins, down to the floor on both sides of each that has no neighbour.
fn outline(bins: &[CycleBin]) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for bin in bins {
        // Edges of neighbours are powers of the same root: equal but for rounding.
        let joins = points.last().is_some_and(|last| (bin.from_us / last.0 - 1.0).abs() < 1e-6);
        if joins {
            points.pop();
        } else {
            points.push((bin.from_us, FLOOR));
        }
        points.extend([(bin.from_us, bin.cycles), (bin.to_us, bin.cycles), (bin.to_us, FLOOR)]);
    }
    points
}

/// Draws panels one below the other over the same minutes.
///
/// # Errors
/// When the picture cannot be rendered or written.
pub fn minutes(path: &Path, panels: &[MinutePanel]) -> anyhow::Result<()> {
    let times = || panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
    let last = times().fold(1.0, |most: f64, point| most.max(point.0));
    let mut plots = Vec::new();
    let mut layouts = Vec::new();
    for panel in panels {
        let lines: Vec<Plot> = panel.curves.iter().map(line).collect();
        let mut layout = Layout::auto_from_plots(&lines)
            .with_x_label("time (min)")
            .with_y_label(panel.label.clone())
            .with_x_axis_min(0.0)
            .with_x_axis_max(last);
        if panel.logarithmic {
            let values = panel.curves.iter().flat_map(|curve| &curve.points).map(|point| point.1);
            let least = values.clone().filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min);
            let most = values.fold(0.0, f64::max).max(least);
            let ends = if least.is_finite() { (least / 1.3, 1.3 * most) } else { (1.0, 10.0) };
            let ends = with_two_numbers(ends);
            layout = layout
                .with_log_y()
                .with_y_tick_format(numbers(ends, CHARACTERS_MAX))
                .with_y_axis_min(ends.0)
                .with_y_axis_max(ends.1);
        } else {
            let most = panel.curves.iter().flat_map(|curve| &curve.points);
            let most = most.fold(0.0, |most: f64, point| most.max(point.1));
            layout = layout.with_y_axis_min(0.0).with_y_axis_max(1.1 * most.max(1.0));
        }
        layouts.push(layout);
        plots.push(lines);
    }
    let figure = Figure::new(plots.len(), 1)
        .with_plots(plots)
        .with_layouts(layouts)
        .with_cell_size(900.0, 260.0)
        .with_padding(30.0)
        .with_keep_panel_legends();
    write(path, figure)
}

#[cfg(test)]
mod tests {
    use super::{CycleBin, FLOOR, outline};

    #[test]
    fn neighbours_share_an_edge_and_gaps_go_down_to_the_floor() {
        let bin = |from_us: f64, cycles: f64| CycleBin { from_us, to_us: 2.0 * from_us, cycles };
        let points = outline(&[bin(1.0, 5.0), bin(2.0, 7.0), bin(8.0, 1.0)]);
        let expected = [
            (1.0, FLOOR),
            (1.0, 5.0),
            (2.0, 5.0),
            (2.0, 7.0),
            (4.0, 7.0),
            (4.0, FLOOR),
            (8.0, FLOOR),
            (8.0, 1.0),
            (16.0, 1.0),
            (16.0, FLOOR),
        ];
        assert_eq!(points, expected);
    }
}
