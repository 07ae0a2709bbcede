//! How a step goes, on one line that is drawn over and over.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use magsteer::daemon::target::angle_from_z_deg;
use magsteer_hal::operator::StatusMessage;
use magsteer_hal::{HardwareDescription, Stamp};

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

    /// Tells something worth a line of its own where none is drawn over.
    #[cfg(feature = "sim")]
    pub fn milestone(&self, text: impl FnOnce() -> String) {
        if !self.is_terminal {
            output::note(text());
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

/// The live line's text; what matters most stands first.
///
/// `step 1/8  1.2 s  m1 89.7 of 90.0 deg  3.2 A in iron-top-left  1000 Hz  late 33 us, at most 643 us`
pub(super) fn live(
    (label, begin): (&str, Stamp),
    rig: &HardwareDescription,
    target: &[[f64; 3]],
    status: &StatusMessage,
    lateness_max_us: f64,
) -> String {
    let degrees = |direction: &[f64; 3]| angle_from_z_deg(direction).unwrap_or(f64::NAN);
    let magnets = rig.magnets().zip(&status.measured_direction).zip(target);
    let magnets = magnets.map(|((magnet, measured), target)| {
        format!("{} {:5.1} of {:5.1} deg", magnet.name, degrees(measured), degrees(target))
    });
    let magnets: Vec<String> = magnets.collect();
    let currents = rig.coils.iter().zip(&status.measured.current_a);
    let greatest = currents.max_by(|one, other| one.1.abs().total_cmp(&other.1.abs()));
    let greatest =
        greatest.map_or_else(String::new, |(coil, current)| format!("  {current:4.1} A in {}", coil.name));
    format!(
        "{label} {:4.1} s  {}{greatest}  {:.0} Hz  late {:.0} us, at most {lateness_max_us:.0} us",
        Stamp::now().since(begin).as_secs_f64(),
        magnets.join(", "),
        status.rate_measured_hz,
        status.lateness_us,
    )
}
