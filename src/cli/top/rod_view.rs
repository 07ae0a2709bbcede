//! The rod in a projection, true to scale.

use magsteer::live::{Link, RodSource, View};
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::canvas::{Canvas, Circle, Context, Line as Stroke};

use super::plots::COLOURS;
use super::screen::{Screen, block};

/// Dots of a cell, across and down: about square on most terminals.
const DOTS: [f64; 2] = [2.0, 4.0];
/// Room around the workspace, relative to its radius.
const ROOM: f64 = 1.08;
/// Length of the arrow that shows a target, relative to the workspace's radius.
const ARROW: f64 = 0.28;

/// Cells of a view that are its border.
const BORDER: u16 = 2;

/// Dots across the smaller side of a view.
fn dots(width: u16, height: u16) -> f64 {
    let [across, down] = [width, height].map(|cells| f64::from(cells.saturating_sub(BORDER)));
    (across * DOTS[0]).min(down * DOTS[1])
}

/// Whether two views are larger one above the other than side by side.
pub fn want_stacking(area: Rect) -> bool {
    dots(area.width, area.height / 2) > dots(area.width / 2, area.height)
}

/// Draws one view.
pub fn draw(screen: &Screen<'_>, view: &View, frame: &mut Frame<'_>, area: Rect) {
    let rig = screen.rig;
    let [dots_x, dots_y] = [
        f64::from(area.width.saturating_sub(2)) * DOTS[0],
        f64::from(area.height.saturating_sub(2)) * DOTS[1],
    ];
    let half = ROOM * rig.workspace_radius_mm;
    let per_dot = 2.0 * half / dots_x.min(dots_y).max(1.0);
    let center = [rig.workspace_center_mm[view.right], rig.workspace_center_mm[view.up]];
    let bounds = |middle: f64, dots: f64| {
        let reach = 0.5 * dots.max(1.0) * per_dot;
        [middle - reach, middle + reach]
    };
    let rod = &screen.figures.rod;
    let note = match rod.source {
        _ if screen.figures.link != Link::Attached => "old".red(),
        RodSource::Model => "".into(),
        RodSource::Measured => "measured".yellow(),
        RodSource::None => "not known".red(),
    };
    let title = Line::from(vec![format!(" {} ", view.name).bold(), note]);
    let canvas = Canvas::default()
        .block(block(title).title_bottom(format!(" circle {:.0} mm ", 2.0 * rig.workspace_radius_mm)))
        .marker(Marker::Braille)
        .x_bounds(bounds(center[0], dots_x))
        .y_bounds(bounds(center[1], dots_y))
        .paint(|context| paint(screen, view, center, context));
    frame.render_widget(canvas, area);
}

fn paint(screen: &Screen<'_>, view: &View, center: [f64; 2], context: &mut Context<'_>) {
    let (rig, rod) = (screen.rig, &screen.figures.rod);
    let flat = |point: &[f64; 3]| [point[view.right], point[view.up]];
    let mut stroke = |from: [f64; 2], to: [f64; 2], color: Color| {
        context.draw(&Stroke { x1: from[0], y1: from[1], x2: to[0], y2: to[1], color });
    };
    for (magnet, ends) in rod.measured_mm.iter().enumerate() {
        let (Some(ends), Some(figures)) = (ends, screen.figures.magnets.get(magnet)) else { continue };
        let Some(direction) = rig.direction(&figures.target_deg) else { continue };
        let middle: [f64; 3] = std::array::from_fn(|axis| 0.5 * (ends[0][axis] + ends[1][axis]));
        let length = ARROW * rig.workspace_radius_mm;
        let tip: [f64; 3] = std::array::from_fn(|axis| middle[axis] + length * direction[axis]);
        stroke(flat(&middle), flat(&tip), Color::DarkGray);
    }
    for pair in rod.line_mm.windows(2) {
        stroke(flat(&pair[0]), flat(&pair[1]), Color::White);
    }
    // Thick: across the tangent by the magnet's radius, both ways.
    for (magnet, ends) in rod.measured_mm.iter().enumerate() {
        let Some([start, end]) = ends else { continue };
        let [start, end] = [flat(start), flat(end)];
        let (along, radius) = ([end[0] - start[0], end[1] - start[1]], rig.magnet_radius_mm[magnet]);
        let length = along[0].hypot(along[1]).max(1e-9);
        let across = [-along[1] / length * radius, along[0] / length * radius];
        let color = COLOURS[magnet % COLOURS.len()];
        for side in [-1.0, -0.5, 0.0, 0.5, 1.0] {
            let moved = |point: [f64; 2]| [point[0] + side * across[0], point[1] + side * across[1]];
            stroke(moved(start), moved(end), color);
        }
    }
    let workspace =
        Circle { x: center[0], y: center[1], radius: rig.workspace_radius_mm, color: Color::DarkGray };
    context.draw(&workspace);
}
