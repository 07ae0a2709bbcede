//! How a step goes, on one line that is drawn over and over.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use magsteer::daemon::target::angle_from_z_deg;
use magsteer_hal::Stamp;
use magsteer_hal::operator::StatusMessage;

use crate::cli::output;

/// A line on standard error that is drawn over and over on a terminal, and once elsewhere.
pub struct LiveLine {
    is_terminal: bool,
    drawn: Option<Instant>,
    text: String,
}

impl LiveLine {
    pub fn new() -> Self {
        Self { is_terminal: std::io::stderr().is_terminal(), drawn: None, text: String::new() }
    }

    pub fn draw(&mut self, text: impl FnOnce() -> String, every: Duration) {
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < every) {
            return;
        }
        self.drawn = Some(Instant::now());
        self.text = text();
        if self.is_terminal {
            // A line that wraps could not be drawn over.
            let shown: String = self.text.chars().take(terminal_width().saturating_sub(1)).collect();
            // Nothing can be done when standard error is closed.
            let _ = write!(std::io::stderr(), "\r\x1b[2K{shown}");
        }
    }

    /// Leaves nothing behind: what the line told of came to nothing.
    pub fn erase(&mut self) {
        if self.is_terminal && self.drawn.is_some() {
            // As above.
            let _ = write!(std::io::stderr(), "\r\x1b[2K");
        }
        (self.drawn, self.text) = (None, String::new());
    }

    pub fn end(&mut self) {
        if self.is_terminal {
            // As above.
            let _ = writeln!(std::io::stderr());
        } else if !self.text.is_empty() {
            output::note(&self.text);
        }
    }
}

/// Columns of the terminal; 80 when it does not say.
fn terminal_width() -> usize {
    let size = rustix::termios::tcgetwinsize(std::io::stderr());
    size.ok().map(|size| usize::from(size.ws_col)).filter(|columns| *columns > 0).unwrap_or(80)
}

/// What a step is to reach.
pub(super) struct Goal<'a> {
    /// Which step.
    pub label: &'a str,
    /// Names of the magnets, base to tip.
    pub magnets: &'a [String],
    /// Where each shall point, a unit vector, world.
    pub target: &'a [[f64; 3]],
}

/// The live line's text; what matters most stands first.
pub(super) fn live(goal: &Goal<'_>, begin: Stamp, status: &StatusMessage, lateness_max_us: f64) -> String {
    let degrees = |direction| angle_from_z_deg(direction).unwrap_or(f64::NAN);
    let magnets = goal.magnets.iter().zip(goal.target).zip(&status.measured_direction);
    let angles: String = magnets
        .map(|((name, target), measured)| {
            format!("  {name} {:5.1} of {:.1} deg", degrees(measured), degrees(target))
        })
        .collect();
    let coils = (status.coil_count as usize).min(status.measured.current_a.len());
    let currents: String =
        status.measured.current_a[..coils].iter().map(|current| format!("{current:5.1}")).collect();
    format!(
        "{} {:4.1} s{angles} measured  {:.0} Hz  late {:.0}, at most {lateness_max_us:.0} us  currents{currents} A",
        goal.label,
        Stamp::now().since(begin).as_secs_f64(),
        status.rate_measured_hz,
        status.lateness_us,
    )
}
