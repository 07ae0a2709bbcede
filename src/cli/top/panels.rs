//! Currents, frames, timing and events; and all of it as text where there is no room for pictures.

use magsteer::daemon::LatencySummary;
use magsteer::live::{CoilFigures, Rig};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::screen::{Screen, block, level_style};

/// Coils beyond which bars stand in two columns.
const COLUMN_MAX: usize = 8;
/// Widest name of a coil that is shown in full.
const NAME_WIDTH: usize = 19;
/// Width of a name that goes before that of the bar, and of the bar that goes before that.
const NAME_WIDTH_NARROW: usize = 11;
const BAR_MIN: usize = 7;

/// Rows that the bars of a rig take.
pub fn actuation_rows(rig: &Rig) -> u16 {
    let rows = rig.coils.len().div_ceil(columns(rig)) + rig.frames.len();
    u16::try_from(rows).unwrap_or(u16::MAX)
}

fn columns(rig: &Rig) -> usize {
    1 + usize::from(rig.coils.len() > COLUMN_MAX)
}

/// Bars of currents, then frames.
pub fn actuation(screen: &Screen<'_>, frame: &mut Frame<'_>, area: Rect) {
    let hottest = format!("heat {:.0} %", 100.0 * screen.figures.coil_heat);
    let title = Line::from(vec![" currents ".bold(), format!("{hottest} ").into()]);
    let block = block(title);
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let columns = columns(screen.rig);
    let rows = screen.rig.coils.len().div_ceil(columns);
    let coil_rows = u16::try_from(rows).unwrap_or(u16::MAX);
    let [coils, frames] = Layout::vertical([Constraint::Length(coil_rows), Constraint::Fill(1)]).areas(inner);
    let areas = Layout::horizontal(vec![Constraint::Fill(1); columns]).split(coils);
    for (column, area) in areas.iter().enumerate() {
        let pairs = screen.rig.coils.iter().zip(&screen.figures.coils).enumerate();
        let lines = pairs.skip(column * rows).take(rows);
        let width = usize::from(area.width);
        let lines = lines.map(|(index, (name, coil))| coil_line(index, name, coil, width));
        frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()), *area);
    }
    let lines: Vec<Line<'_>> = frame_lines(screen, usize::from(frames.width)).collect();
    frame.render_widget(Paragraph::new(lines), frames);
}

/// Columns that a frame takes in full.
const FRAME_WIDTH: usize = 48;

/// `frame bottom   45.00 of 45.00 deg  -180 to 180`: measured, commanded, range; the same shorter where there
/// is less room.
fn frame_lines<'a>(screen: &'a Screen<'_>, width: usize) -> impl Iterator<Item = Line<'a>> {
    let frames = screen.rig.frames.iter().zip(&screen.figures.frames).zip(&screen.rig.angle_range_deg);
    frames.map(move |((name, frame), [least, greatest])| {
        if width < FRAME_WIDTH {
            return Line::from(vec![
                format!("{:<8}", short_name(name, 8)).into(),
                format!("{:>6.1}", frame.measured_deg).bold(),
                format!(" of {:.1}\u{b0}", frame.commanded_deg).into(),
                format!(" in {least:.0}..{greatest:.0}").dim(),
            ]);
        }
        Line::from(vec![
            format!("frame {name:<9}").into(),
            format!("{:>7.2}", frame.measured_deg).bold(),
            format!(" of {:.2} deg", frame.commanded_deg).into(),
            format!("  {least:.0} to {greatest:.0}").dim(),
        ])
    })
}

/// `0 iron-bottom-right -3.21 A [    ███|      ]`: zero in the middle, limits at the ends, a stroke for the
/// command.
fn coil_line(index: usize, name: &str, coil: &CoilFigures, width: usize) -> Line<'static> {
    let room = width.saturating_sub(12);
    let name_width = NAME_WIDTH.min((room / 2).max(NAME_WIDTH_NARROW.min(room.saturating_sub(BAR_MIN))));
    let number = format!("{index} ");
    let short = format!("{number}{}", short_name(name, name_width.saturating_sub(number.len())));
    let bar_width = room.saturating_sub(name_width);
    let mut spans = vec![
        Span::from(format!("{short:<name_width$}")),
        Span::from(format!("{:>7.2} A ", coil.measured_a)).bold(),
    ];
    spans.extend(bar(coil, bar_width));
    if coil.saturated {
        spans.push(Span::from(" !").red().bold());
    }
    Line::from(spans)
}

/// A name in at most so many letters: its longest words lose their ends, so that names which differ in one
/// word still do. Numbers lose nothing while words have something to lose.
pub fn short_name(name: &str, width: usize) -> String {
    let mut words: Vec<Vec<char>> = name.split('-').map(|word| word.chars().collect()).collect();
    let hyphens = words.len() - 1;
    while words.iter().map(Vec::len).sum::<usize>() + hyphens > width {
        // Of words as long as each other the first.
        let is_word = |word: &[char]| word.len() > 1 && !word.iter().all(char::is_ascii_digit);
        let longest = words.iter_mut().rev().max_by_key(|word| (is_word(word.as_slice()), word.len()));
        if longest.and_then(Vec::pop).is_none() {
            break;
        }
    }
    let words: Vec<String> = words.into_iter().map(String::from_iter).collect();
    words.join("-").chars().take(width).collect()
}

fn bar(coil: &CoilFigures, width: usize) -> Vec<Span<'static>> {
    if width < 5 {
        return Vec::new();
    }
    let cells = width - 2;
    let place = |current: f64| {
        let share = (0.5 + 0.5 * current / coil.limit_a.max(1e-9)).clamp(0.0, 1.0);
        // Within 0 to cells - 1.
        (share * (cells - 1) as f64).round() as usize
    };
    let (zero, measured, commanded) = (place(0.0), place(coil.measured_a), place(coil.commanded_a));
    let colour = if coil.saturated { Color::Red } else { Color::Green };
    let filled = measured.min(zero)..=measured.max(zero);
    let mut spans = vec![Span::from("[").dark_gray()];
    for cell in 0..cells {
        spans.push(if cell == commanded && cell != zero {
            Span::from("|").fg(if coil.saturated { Color::Red } else { Color::White }).bold()
        } else if filled.contains(&cell) && measured != zero {
            Span::styled("\u{2588}", Style::new().fg(colour))
        } else if cell == zero {
            Span::from("\u{250a}").dark_gray()
        } else {
            Span::from(" ")
        });
    }
    spans.push(Span::from("]").dark_gray());
    spans
}

/// Quantiles of the last minute, or of the time since the start while there is none.
pub fn timing(screen: &Screen<'_>, frame: &mut Frame<'_>, area: Rect) {
    let figures = screen.figures;
    let (timing, span) =
        figures.last_minute.as_ref().map_or((&figures.timing, "so far"), |minute| (minute, "last minute"));
    let row = |name: &str, latency: &LatencySummary| {
        Line::from(format!(
            "{name:<12}{:>6.0}{:>6.0}{:>6.0}{:>8.0}",
            latency.p50, latency.p99, latency.p999, latency.max
        ))
    };
    let age = figures.pose_age_ms.map_or("none".to_owned(), |age| format!("{age:.1} ms"));
    let title =
        Line::from(vec![" timing, us ".bold(), format!("{span} ").into(), format!("poses {age} ").dim()]);
    let lines = vec![
        Line::from(format!("{:<12}{:>6}{:>6}{:>6}{:>8}", "", "p50", "p99", "p99.9", "max")).dim(),
        row("lateness", &timing.lateness_us),
        row("execution", &timing.execution_us),
        row("pose to cmd", &timing.pose_to_command_us),
    ];
    frame.render_widget(Paragraph::new(lines).block(block(title)), area);
}

/// The newest events, the newest at the bottom.
pub fn events(screen: &Screen<'_>, frame: &mut Frame<'_>, area: Rect) {
    let rows = usize::from(area.height.saturating_sub(2));
    let lines = screen.events.map_or_else(Vec::new, |events| {
        let mut lines: Vec<Line<'_>> = events
            .lines()
            .rev()
            .take(rows)
            .map(|event| {
                let time = event.time.get(11..19).unwrap_or(&event.time).to_owned();
                Line::from(vec![
                    format!("{time} ").dim(),
                    Span::styled(event.text.clone(), level_style(event.level)),
                ])
            })
            .collect();
        lines.reverse();
        lines
    });
    frame.render_widget(Paragraph::new(lines).block(block(" events ".bold())), area);
}

/// What matters most, for a terminal without room.
pub fn text<'a>(screen: &'a Screen<'_>) -> Vec<Line<'a>> {
    let angles = |angles: &[f64]| match angles {
        [] => "-".to_owned(),
        angles => angles.iter().map(|angle| format!("{angle:.1}")).collect::<Vec<_>>().join("/"),
    };
    let magnets = screen.rig.magnets.iter().zip(&screen.figures.magnets).map(|(name, magnet)| {
        let (measured, target) = (angles(&magnet.measured_deg), angles(&magnet.target_deg));
        Line::from(format!("{name}: {measured} of {target} deg"))
    });
    let coils = screen.rig.coils.iter().zip(&screen.figures.coils).map(|(name, coil)| {
        let limit = if coil.saturated { "  LIMIT" } else { "" };
        Line::from(format!("{name}: {:.2} of {:.1} A{limit}", coil.measured_a, coil.limit_a))
    });
    let lateness = Line::from(format!("late p99.9 {:.0} us", screen.figures.timing.lateness_us.p999));
    magnets.chain([lateness]).chain(coils).chain(frame_lines(screen, 0)).collect()
}
