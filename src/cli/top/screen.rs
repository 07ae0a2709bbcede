//! What stands where, by the terminal's size.

use magsteer::live::{EventFeed, Figures, History, Level, Link, Rig};
use magsteer_hal::operator::state;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Clear, Paragraph, Wrap};

use super::keys::{HELP, Popup, SIGNS, Ui};
use super::{panels, plots, rod_view};

/// Below this there is room for lines of text alone.
const PICTURES_WIDTH_MIN: u16 = 70;
const PICTURES_HEIGHT_MIN: u16 = 20;
/// From this width on plots get more than the rod.
const WIDE: u16 = 110;
/// Rows of one plot of angles below which magnets share one.
const PLOT_ROWS_MIN: u16 = 7;

/// Everything that is drawn.
pub struct Screen<'a> {
    /// Facts of the rig.
    pub rig: &'a Rig,
    /// The present.
    pub figures: &'a Figures,
    /// The last minute.
    pub history: &'a History,
    /// The journal.
    pub events: Option<&'a EventFeed>,
    /// What the user did.
    pub ui: &'a Ui,
}

impl Screen<'_> {
    /// Draws it into whatever room there is.
    pub fn draw(&self, frame: &mut Frame<'_>) {
        let area = frame.area();
        let [head, alert, body, foot] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Length(1),
            Constraint::Fill(1),
            Constraint::Length(1),
        ])
        .areas(area);
        frame.render_widget(self.head(area.width), head);
        frame.render_widget(self.alert(), alert);
        if area.width >= PICTURES_WIDTH_MIN && area.height >= PICTURES_HEIGHT_MIN {
            self.pictures(frame, body);
        } else {
            frame.render_widget(Paragraph::new(panels::text(self)), body);
        }
        frame.render_widget(self.foot(), foot);
        match self.ui.popup {
            Popup::None => {}
            Popup::Help => help(frame, area),
            Popup::EmergencyStop => confirm(frame, area),
        }
    }

    fn pictures(&self, frame: &mut Frame<'_>, body: Rect) {
        let rows = panels::actuation_rows(self.rig);
        // Two rows are the border. Plots get at least half of what there is.
        let lower = (rows + 2).max(10).min(body.height / 2);
        let [upper, lower] = Layout::vertical([Constraint::Fill(1), Constraint::Length(lower)]).areas(body);
        // Two square views side by side want half of a narrow terminal.
        let plots = if body.width < WIDE { 1 } else { 2 };
        let [left, right] = Layout::horizontal([Constraint::Fill(plots), Constraint::Fill(1)]).areas(upper);
        self.plots(frame, left);
        let halves = [Constraint::Fill(1), Constraint::Fill(1)];
        let views: [Rect; 2] = if rod_view::want_stacking(right) {
            Layout::vertical(halves)
        } else {
            Layout::horizontal(halves)
        }
        .areas(right);
        for (view, area) in self.rig.views.iter().zip(views) {
            rod_view::draw(self, view, frame, area);
        }
        let [left, right] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(lower);
        panels::actuation(self, frame, left);
        let [timing, events] = Layout::vertical([Constraint::Length(6), Constraint::Fill(1)]).areas(right);
        panels::timing(self, frame, timing);
        panels::events(self, frame, events);
    }

    fn plots(&self, frame: &mut Frame<'_>, area: Rect) {
        let plots = plots::of(self.rig);
        let grid = [(plots.len(), 1), (self.rig.magnets.len(), self.rig.angles.count())];
        let fits = |rows: &usize| usize::from(area.height) >= rows * usize::from(PLOT_ROWS_MIN);
        let Some((rows, columns)) = grid.into_iter().find(|(rows, _)| *rows > 0 && fits(rows)) else {
            plots::draw(self, &plots, frame, area);
            return;
        };
        let fill = |count: usize| vec![Constraint::Fill(1); count];
        for (plots, row) in plots.chunks(columns).zip(Layout::vertical(fill(rows)).split(area).iter()) {
            for (plot, area) in plots.iter().zip(Layout::horizontal(fill(columns)).split(*row).iter()) {
                plots::draw(self, std::slice::from_ref(plot), frame, *area);
            }
        }
    }

    fn head(&self, width: u16) -> Line<'_> {
        let figures = self.figures;
        let style = if figures.link == Link::Attached {
            state_style(figures.state_code)
        } else {
            Style::new().fg(Color::Black).bg(Color::DarkGray)
        };
        let mut spans = vec![
            Span::from(format!(" {} ", self.rig.name)).bold(),
            Span::styled(format!(" {} ", figures.state.to_uppercase()), style.add_modifier(Modifier::BOLD)),
        ];
        let link = match figures.age_s {
            Some(age) if figures.link != Link::Attached => format!(" {} {age:.0} s", figures.link.name()),
            _ => format!(" {}", figures.link.name()),
        };
        spans.push(if figures.link == Link::Attached { link.green() } else { link.red().bold() });
        if figures.heard {
            let rate = format!("  {:.0} of {:.0} Hz", figures.rate_measured_hz, figures.rate_hz);
            spans.push(Span::from(format!("{rate}  {} missed  margin ", figures.missed)));
            let margin = format!("{:.2}", figures.stability_margin);
            spans.push(if figures.stability_low { margin.red().bold() } else { margin.into() });
            if width >= WIDE {
                spans.push(Span::from(format!("  cycle {}", figures.cycle)).dim());
            }
        }
        Line::from(spans)
    }

    fn alert(&self) -> Line<'_> {
        let Some(alert) = self.figures.alerts.first() else {
            return Line::from(format!(
                " target {}, recorder {}, a trip would {}",
                self.figures.target_verdict, self.figures.recorder, self.figures.safe_action
            ))
            .dim();
        };
        let more = match self.figures.alerts.len() {
            1 => String::new(),
            count => format!("  (and {} more)", count - 1),
        };
        Line::styled(format!(" {}{more}", alert.text), level_style(alert.level))
    }

    fn foot(&self) -> Line<'_> {
        match &self.ui.message {
            Some((text, true)) => Line::from(format!(" {text}")).red().bold(),
            Some((text, false)) => Line::from(format!(" {text}")).green(),
            None => {
                Line::from(" a arm  g go  h hold  s STOP  e estop  r reset  t time  ? help  q quit").dim()
            }
        }
    }
}

/// The colours of a state.
pub fn state_style(code: u32) -> Style {
    let (text, ground) = match code {
        state::ACTIVE => (Color::Black, Color::Green),
        state::HOLDING => (Color::Black, Color::Cyan),
        state::ARMED => (Color::Black, Color::Yellow),
        state::SAFE_STOP => (Color::Black, Color::LightRed),
        state::FAULT => (Color::White, Color::Red),
        _ => (Color::Black, Color::Gray),
    };
    Style::new().fg(text).bg(ground)
}

/// The colours of an alert or an event.
pub fn level_style(level: Level) -> Style {
    match level {
        Level::Note => Style::new(),
        Level::Warning => Style::new().fg(Color::Yellow),
        Level::Grave => Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD),
    }
}

/// A bordered block with a title.
pub fn block<'a>(title: impl Into<Line<'a>>) -> Block<'a> {
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().fg(Color::DarkGray))
        .title(title)
}

fn help(frame: &mut Frame<'_>, area: Rect) {
    let line = |(key, what): &(&'static str, &'static str)| {
        Line::from(vec![format!(" {key:<10}").bold(), (*what).into()])
    };
    let (keys, signs) = (HELP.iter().map(line), SIGNS.iter().map(line));
    let lines: Vec<Line<'_>> = keys.chain([Line::from("")]).chain(signs).collect();
    popup(frame, area, " keys and signs ", Color::Cyan, lines);
}

fn confirm(frame: &mut Frame<'_>, area: Rect) {
    let lines = vec![
        Line::from(" Cut the amplifiers at once?").bold(),
        Line::from(" The rod sags to its unloaded shape; a reset is needed afterwards."),
        Line::from(" y: cut them    any other key: leave them"),
    ];
    popup(frame, area, " emergency stop ", Color::Red, lines);
}

fn popup(frame: &mut Frame<'_>, area: Rect, title: &str, colour: Color, lines: Vec<Line<'_>>) {
    let height = u16::try_from(lines.len()).unwrap_or(u16::MAX).saturating_add(2);
    let [middle] = Layout::vertical([Constraint::Length(height.min(area.height))])
        .flex(ratatui::layout::Flex::Center)
        .areas(area);
    let [place] = Layout::horizontal([Constraint::Length(area.width.min(80))])
        .flex(ratatui::layout::Flex::Center)
        .areas(middle);
    frame.render_widget(Clear, place);
    let block = block(title).border_style(Style::new().fg(colour));
    frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: false }).block(block), place);
}
