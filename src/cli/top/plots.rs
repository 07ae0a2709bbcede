//! Angles against time: target, reference, measured, predicted.

use magsteer::live::{AngleSample, Angles, Rig};
use ratatui::Frame;
use ratatui::layout::{Alignment, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType};

use super::screen::{Screen, block};

/// One angle of one magnet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plot {
    /// As `m1`, or `m1 azimuth`.
    pub name: String,
    /// Index into a sample's angles.
    pub index: usize,
    /// Index of the magnet.
    pub magnet: usize,
}

/// Colours of the magnets, base to tip.
pub const COLOURS: [Color; 8] = [
    Color::Cyan,
    Color::Yellow,
    Color::Magenta,
    Color::Green,
    Color::LightBlue,
    Color::LightRed,
    Color::LightGreen,
    Color::White,
];
/// Colours of the other curves.
const TARGET: Color = Color::DarkGray;
const REFERENCE: Color = Color::Gray;
const PREDICTED: Color = Color::Blue;
/// Least span of the angles shown, deg.
const SPAN_MIN_DEG: f64 = 10.0;

/// The plots of a rig.
pub fn of(rig: &Rig) -> Vec<Plot> {
    let count = rig.angles.count();
    let plots = rig.magnets.iter().enumerate().flat_map(|(magnet, name)| {
        (0..count).map(move |angle| Plot {
            name: match (rig.angles, angle) {
                (Angles::Planar, _) => name.clone(),
                (Angles::Spatial, 0) => format!("{name} from z"),
                (Angles::Spatial, _) => format!("{name} azimuth"),
            },
            index: magnet * count + angle,
            magnet,
        })
    });
    plots.collect()
}

/// The lines of one plot; a place for each of target, reference, predicted, measured: the last is drawn on
/// top.
type Lines = [Vec<(f64, f64)>; 4];

fn lines(screen: &Screen<'_>, plot: &Plot) -> Lines {
    let mut lines = Lines::default();
    let Some(last) = screen.history.samples().next_back() else { return lines };
    for sample in screen.history.samples() {
        let time = sample.time_s - last.time_s;
        let Some(angles) = sample.angles_deg.get(plot.index).filter(|_| time >= -screen.ui.reach_s) else {
            continue;
        };
        let AngleSample { target, desired, measured, predicted } = *angles;
        for (line, angle) in lines.iter_mut().zip([target, desired, predicted, measured]) {
            line.extend(angle.map(|angle| (time, angle)));
        }
    }
    lines
}

/// Draws the plots into one chart.
pub fn draw(screen: &Screen<'_>, plots: &[Plot], frame: &mut Frame<'_>, area: Rect) {
    let lines: Vec<(&Plot, Lines)> = plots.iter().map(|plot| (plot, lines(screen, plot))).collect();
    let values = || lines.iter().flat_map(|(_, lines)| lines.iter().flatten().map(|(_, angle)| *angle));
    let [low, high] = bounds(values());
    let datasets = lines.iter().flat_map(|(plot, [target, desired, predicted, measured])| {
        let colour = COLOURS[plot.magnet % COLOURS.len()];
        let line = |points, marker, colour| {
            Dataset::default().data(points).marker(marker).style(Style::new().fg(colour))
        };
        [
            line(target.as_slice(), Marker::Braille, TARGET).graph_type(GraphType::Line),
            line(desired, Marker::Braille, REFERENCE).graph_type(GraphType::Line),
            line(predicted, Marker::Braille, PREDICTED).graph_type(GraphType::Scatter),
            line(measured, Marker::Braille, colour).graph_type(GraphType::Line),
        ]
    });
    let reach = screen.ui.reach_s;
    let labels = [low, 0.5 * (low + high), high].map(|angle| Span::from(format!("{angle:.0}")));
    let chart = Chart::new(datasets.collect())
        .block(block(title(screen, plots, area.width)).title_bottom(legend(plots)))
        .legend_position(None)
        .x_axis(
            Axis::default()
                .bounds([-reach, 0.0])
                .labels([format!("-{reach:.0} s"), String::new(), "now".to_owned()])
                .labels_alignment(Alignment::Right)
                .style(Style::new().fg(Color::DarkGray)),
        )
        .y_axis(Axis::default().bounds([low, high]).labels(labels).style(Style::new().fg(Color::DarkGray)));
    frame.render_widget(chart, area);
}

/// The curves, each in its own colour; what is measured has the magnet's.
fn legend(plots: &[Plot]) -> Line<'static> {
    let measured = match plots {
        [plot] => COLOURS[plot.magnet % COLOURS.len()],
        _ => Color::White,
    };
    Line::from(vec![
        Span::from(" measured").fg(measured),
        Span::from(" target").fg(TARGET),
        Span::from(" reference").fg(REFERENCE),
        Span::from(" predicted ").fg(PREDICTED),
    ])
}

/// `m1 69.8 of 70.0 deg`: measured and target; `m1 69.8/70.0` where that is too long for a border of `width`,
/// and the measured angle alone where that is too.
fn title(screen: &Screen<'_>, plots: &[Plot], width: u16) -> Line<'static> {
    let angle =
        |angles: &[f64], at: usize| angles.get(at).map_or("-".to_owned(), |angle| format!("{angle:.1}"));
    let line = |words: &dyn Fn(&str, &str) -> String| {
        let mut spans = Vec::new();
        for plot in plots {
            let Some(magnet) = screen.figures.magnets.get(plot.magnet) else { continue };
            let at = plot.index % screen.rig.angles.count();
            let colour = COLOURS[plot.magnet % COLOURS.len()];
            spans.push(Span::from(format!(" {} ", plot.name)).fg(colour).bold());
            spans.push(words(&angle(&magnet.measured_deg, at), &angle(&magnet.target_deg, at)).into());
        }
        Line::from(spans)
    };
    // The corners take two columns.
    let fits = |line: &Line<'_>| line.width() + 2 <= usize::from(width);
    let full = line(&|measured, target| format!("{measured} of {target} deg "));
    if fits(&full) {
        return full;
    }
    let short = line(&|measured, target| format!("{measured}/{target} "));
    if fits(&short) { short } else { line(&|measured, _| format!("{measured} ")) }
}

/// A little more than what is plotted.
fn bounds(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let low = values.clone().fold(f64::INFINITY, f64::min);
    let high = values.fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return [0.0, 180.0];
    }
    let margin = f64::max(0.08 * (high - low), 0.5 * (SPAN_MIN_DEG - (high - low)));
    [low - margin, high + margin]
}
