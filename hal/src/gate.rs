//! The last check before current flows.
//!
//! Terms: a *request* is what the control law asks for; an *admitted* command is one that is finite, within every
//! coil's magnitude and frame's range, and no further from the previous admitted one than slew and speed allow in the
//! time since. [`crate::Hardware::write`] accepts an [`AdmittedCommand`] alone, and [`Gate`] is its only maker.
//!
//! What is absent: a clock, an allocation after construction, a panic, a way to build an [`AdmittedCommand`] elsewhere.

use std::time::Duration;

use crate::description::HardwareDescription;
use crate::limits::{Limits, between, usable_period};
use crate::message::{Actuation, COILS_MAX, order};
use crate::time::Stamp;

/// Who commands, and for how long each command stays good.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Authority {
    /// Rises with every claim on this host.
    pub epoch: u64,
    /// Names the holder within the epoch.
    pub token: u64,
    /// A command is void this long after it was sent.
    pub validity: Duration,
}

/// A command that passed the gate: the only thing that [`crate::Hardware::write`] accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdmittedCommand {
    order: u32,
    authority: Authority,
    pose_source_stamp: Stamp,
    actuation: Actuation,
}

impl AdmittedCommand {
    /// One of [`crate::message::order`].
    #[must_use]
    pub const fn order(&self) -> u32 {
        self.order
    }

    /// In whose name it is sent.
    #[must_use]
    pub const fn authority(&self) -> Authority {
        self.authority
    }

    /// Set points, A and rad; unused entries zero.
    #[must_use]
    pub const fn actuation(&self) -> &Actuation {
        &self.actuation
    }

    /// When the poses that it was computed from were true; zero for orders that need none.
    #[must_use]
    pub const fn pose_source_stamp(&self) -> Stamp {
        self.pose_source_stamp
    }
}

/// How many entries of a request the gate had to change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Limited {
    /// Currents cut to their greatest magnitude.
    pub magnitude: u32,
    /// Currents held back by their slew limit.
    pub slew: u32,
    /// Angles cut to their range.
    pub range: u32,
    /// Angles held back by their speed limit.
    pub speed: u32,
}

impl Limited {
    /// True when anything was changed.
    #[must_use]
    pub const fn any(&self) -> bool {
        self.magnitude + self.slew + self.range + self.speed > 0
    }
}

/// What the gate let through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Admitted {
    /// For [`crate::Hardware::write`].
    pub command: AdmittedCommand,
    /// How far it differs from the request.
    pub limited: Limited,
}

/// A request that the gate refused; its previous command stands unchanged.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refused {
    /// A current that is not finite.
    #[error("requested current of coil {coil} is {value_a} A: must be finite")]
    Current {
        /// Which coil.
        coil: usize,
        /// The value requested.
        value_a: f64,
    },
    /// An angle that is not finite.
    #[error("requested angle of frame {frame} is {value_rad} rad: must be finite")]
    Angle {
        /// Which frame.
        frame: usize,
        /// The value requested.
        value_rad: f64,
    },
    /// A time since the previous command that is not finite or negative.
    #[error("period is {period_s} s: must be finite and >= 0")]
    Period {
        /// The period given.
        period_s: f64,
    },
}

/// Admits commands; remembers the one admitted last.
///
/// ```text
/// request ──▶ finite? ──▶ magnitude, range ──▶ slew, speed against `previous` ──▶ AdmittedCommand
///               │ no
///               ▼
///            Refused, `previous` unchanged
/// ```
///
/// `period_s` must be the time between the `now` of this write and that of the write before: the driver
/// judges slew by the publish stamps that [`crate::Hardware::write`] makes of them.
#[derive(Debug, Clone)]
pub struct Gate {
    limits: Limits,
    previous: Actuation,
}

impl Gate {
    /// A gate for the coils and frames of `description`. Its previous command has zero currents and every
    /// angle at zero, or at the nearest end of its range; [`Gate::seed`] it before driving.
    #[must_use]
    pub fn new(description: &HardwareDescription) -> Self {
        let limits = Limits::new(description);
        let previous = limits.nearest(&Actuation::default(), &Actuation::default());
        Self { limits, previous }
    }

    /// Bumpless entry: takes the measured actuation, held within the limits, for the previous command.
    pub fn seed(&mut self, measured: &Actuation) {
        self.previous = self.limits.nearest(measured, &self.previous);
    }

    /// Admits the nearest command to `request` that every limit allows `period_s` after the previous one.
    ///
    /// # Errors
    /// When a current or angle in use, or the period, is not finite.
    pub fn drive(
        &mut self,
        request: &Actuation,
        period_s: f64,
        authority: Authority,
        pose_source_stamp: Stamp,
    ) -> Result<Admitted, Refused> {
        self.check(request, period_s)?;
        let mut limited = Limited::default();
        for coil in 0..self.limits.coil_count {
            let (requested, limit) = (request.current_a[coil], self.limits.current_max[coil]);
            let within = between(requested, -limit, limit);
            limited.magnitude += u32::from(within != requested);
            let previous = self.previous.current_a[coil];
            let admitted = approach(previous, within, self.limits.slew_max[coil] * period_s);
            limited.slew += u32::from(admitted != within);
            self.previous.current_a[coil] = admitted;
        }
        for frame in 0..self.limits.frame_count {
            let requested = request.angle_rad[frame];
            let within = between(requested, self.limits.angle_min[frame], self.limits.angle_max[frame]);
            limited.range += u32::from(within != requested);
            let previous = self.previous.angle_rad[frame];
            let admitted = approach(previous, within, self.limits.speed_max[frame] * period_s);
            limited.speed += u32::from(admitted != within);
            self.previous.angle_rad[frame] = admitted;
        }
        Ok(Admitted { command: self.command(order::DRIVE, authority, pose_source_stamp), limited })
    }

    /// Moves every current towards zero by what its slew limit allows in `period_s`; frames hold.
    /// A period that is not finite or negative counts as zero.
    pub fn ramp_to_zero(&mut self, period_s: f64, authority: Authority) -> AdmittedCommand {
        let period = usable_period(period_s);
        for coil in 0..self.limits.coil_count {
            let previous = self.previous.current_a[coil];
            self.previous.current_a[coil] = approach(previous, 0.0, self.limits.slew_max[coil] * period);
        }
        self.command(order::RAMP_DOWN, authority, Stamp::default())
    }

    /// Asks for authority: zero currents, frames where they were commanded last.
    pub fn claim(&mut self, authority: Authority) -> AdmittedCommand {
        self.at_zero(order::CLAIM, authority)
    }

    /// Gives authority up; the driver ramps to zero by itself.
    pub fn release(&mut self, authority: Authority) -> AdmittedCommand {
        self.at_zero(order::RELEASE, authority)
    }

    /// Cuts the amplifiers.
    pub fn disable(&mut self, authority: Authority) -> AdmittedCommand {
        self.at_zero(order::DISABLE, authority)
    }

    /// What was admitted or seeded last.
    #[must_use]
    pub const fn previous(&self) -> &Actuation {
        &self.previous
    }

    /// True when every current admitted last is exactly zero.
    #[must_use]
    pub fn is_at_zero(&self) -> bool {
        self.previous.current_a.iter().all(|current| *current == 0.0)
    }

    fn check(&self, request: &Actuation, period_s: f64) -> Result<(), Refused> {
        if !period_s.is_finite() || period_s < 0.0 {
            return Err(Refused::Period { period_s });
        }
        let not_finite = |value: &f64| !value.is_finite();
        if let Some(coil) = request.current_a[..self.limits.coil_count].iter().position(not_finite) {
            return Err(Refused::Current { coil, value_a: request.current_a[coil] });
        }
        if let Some(frame) = request.angle_rad[..self.limits.frame_count].iter().position(not_finite) {
            return Err(Refused::Angle { frame, value_rad: request.angle_rad[frame] });
        }
        Ok(())
    }

    fn at_zero(&mut self, order: u32, authority: Authority) -> AdmittedCommand {
        self.previous.current_a = [0.0; COILS_MAX];
        self.command(order, authority, Stamp::default())
    }

    fn command(&self, order: u32, authority: Authority, pose_source_stamp: Stamp) -> AdmittedCommand {
        AdmittedCommand { order, authority, pose_source_stamp, actuation: self.previous }
    }
}

/// The value nearest to `target` that lies within `step` of `previous`.
fn approach(previous: f64, target: f64, step: f64) -> f64 {
    between(target, previous - step, previous + step)
}

#[cfg(test)]
mod tests;
