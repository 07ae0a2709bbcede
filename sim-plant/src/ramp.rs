//! How long the coils take to zero once nobody holds authority any more.

use std::time::Duration;

use magsteer_hal::{COILS_MAX, Stamp};

/// A coil that carries less, A, counts as being at zero: 1/800 of BigMag's greatest current, and some
/// hundredths of a millitesla at the magnets.
pub const CURRENT_ZERO: f64 = 0.01;

/// One way to zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ramp {
    /// From the loss of authority to zero.
    pub from_loss: Duration,
    /// From the last command that was obeyed to zero.
    pub from_last_command: Duration,
}

/// Follows authority and currents through the steps of a plant.
#[derive(Debug, Clone, Default)]
pub struct RampWatch {
    is_driven: bool,
    last_command: Option<Stamp>,
    lost: Option<Stamp>,
    last: Option<Ramp>,
    longest_from_last_command: Duration,
}

impl RampWatch {
    /// A command was obeyed.
    pub fn command_accepted(&mut self, now: Stamp) {
        self.last_command = Some(now);
    }

    /// Takes note of a step.
    pub fn step(&mut self, is_driven: bool, currents: &[f64; COILS_MAX], now: Stamp) {
        if self.is_driven && !is_driven {
            self.lost = Some(now);
        }
        self.is_driven = is_driven;
        let Some(lost) = self.lost.filter(|_| is_zero(currents)) else { return };
        let since_command = self.last_command.map_or(Duration::ZERO, |command| now.since(command));
        self.last = Some(Ramp { from_loss: now.since(lost), from_last_command: since_command });
        self.longest_from_last_command = self.longest_from_last_command.max(since_command);
        self.lost = None;
    }

    /// The longest complete way to zero, from the last command that was obeyed.
    #[must_use]
    pub fn longest_from_last_command(&self) -> Duration {
        self.longest_from_last_command
    }

    /// The last complete way to zero.
    #[must_use]
    pub fn last(&self) -> Option<Ramp> {
        self.last
    }
}

/// True when every current is below [`CURRENT_ZERO`].
#[must_use]
pub fn is_zero(currents: &[f64; COILS_MAX]) -> bool {
    currents.iter().all(|current| current.abs() < CURRENT_ZERO)
}
