//! What a fault can befall and what it can do there: targets, parts and verbs, with their ranges.

use std::fmt::{self, Display, Formatter};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::description::HardwareDescription;
use crate::message::{COILS_MAX, MAGNETS_MAX, POSE_PARAMETERS_MAX};

use super::checked::FaultRefusal;

/// Longest delay; a driver keeps what it delays in a line of bounded length.
pub const DELAY_MAX: Duration = Duration::from_secs(1);
/// Shortest delay.
pub const DELAY_MIN: Duration = Duration::from_millis(1);
/// Lowest rate of a slow fault, Hz.
pub const RATE_MIN: f64 = 0.1;
/// Highest rate of a slow fault, Hz.
pub const RATE_MAX: f64 = 1_000.0;
/// Shortest period of an intermittent fault.
pub const PERIOD_MIN: Duration = Duration::from_millis(2);
/// Longest period of an intermittent fault.
pub const PERIOD_MAX: Duration = Duration::from_secs(60);
/// Largest share of a coil's turns that may be shorted: beyond it little is left of a coil.
pub const SHORTED_MAX: f64 = 0.9;
/// Longest time before a fault begins, and that it lasts: a week.
pub const TIME_MAX: Duration = Duration::from_secs(7 * 24 * 3600);

/// What a fault befalls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultTarget {
    /// Published magnet poses.
    Poses,
    /// Published currents, angles and driver state.
    Feedback,
    /// Received commands, and set points on their way to amplifiers and motors.
    Actuators,
    /// One coil with its amplifier, in a simulated plant.
    Coil,
    /// One frame with its motor, in a simulated plant.
    Frame,
}

/// One magnet, coil or frame, by its place in the description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A magnet, base first.
    Magnet(usize),
    /// A coil.
    Coil(usize),
    /// A frame.
    Frame(usize),
}

/// Kinds of wrong content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Garbage {
    /// Not a number.
    Nan,
    /// Finite, and far beyond anything physical: 1e300.
    Huge,
    /// A quaternion of norm 2.
    Quaternion,
    /// Values that could be true: within workspace and limits, unit quaternions.
    Random,
}

/// How the epoch of a message goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EpochChange {
    /// One other epoch throughout: what a restart of the sender looks like; for commands, a former holder.
    Other,
    /// Another epoch with every message.
    EveryMessage,
}

/// What is wrong with a coil or a frame itself. Only a simulated plant can do it on request.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// The coil's circuit is broken: no current flows.
    Open,
    /// A part of the coil's turns is shorted.
    Shorted {
        /// Share of the turns, above 0, at most 0.9.
        fraction: f64,
    },
    /// The amplifier goes on with the voltage of this moment and obeys nobody.
    StuckAmplifier,
    /// The frame's motor does not turn any more.
    Stalled,
}

/// What a fault does. The table in the [module](super) says what that means for each target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FaultVerb {
    /// Nothing comes.
    Off,
    /// The content stays as it is.
    Stuck,
    /// The content is wrong.
    Garbage(Garbage),
    /// Less often, or more sluggish.
    Slow {
        /// Messages a second; for actuators, corner frequency of the lag, Hz.
        rate_hz: f64,
    },
    /// Later.
    Delayed {
        /// By how much.
        by: Duration,
    },
    /// Off in the first part of each period.
    Intermittent {
        /// The period.
        period: Duration,
        /// Share of it that is off, above 0 and below 1.
        off_fraction: f64,
    },
    /// The same message again, bit for bit.
    Repeated,
    /// The sequence falls.
    Backward,
    /// Another epoch.
    WrongEpoch(EpochChange),
    /// Another layout version.
    WrongVersion,
    /// A physical condition, in a simulated plant.
    Physical(Condition),
}

/// How deep the faults of a driver reach.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Messages and set points: any driver.
    Channels,
    /// Coils and frames themselves, too: a simulated plant.
    Plant,
}

impl FaultTarget {
    /// Every target.
    pub const ALL: [Self; 5] = [Self::Poses, Self::Feedback, Self::Actuators, Self::Coil, Self::Frame];

    /// Its name, as plans and the command line have it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Poses => "poses",
            Self::Feedback => "feedback",
            Self::Actuators => "actuators",
            Self::Coil => "coil",
            Self::Frame => "frame",
        }
    }
}

impl FaultVerb {
    /// Its name, as plans and the command line have it.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Stuck => "stuck",
            Self::Garbage(_) => "garbage",
            Self::Slow { .. } => "slow",
            Self::Delayed { .. } => "delayed",
            Self::Intermittent { .. } => "intermittent",
            Self::Repeated => "repeated",
            Self::Backward => "backward",
            Self::WrongEpoch(_) => "wrong-epoch",
            Self::WrongVersion => "wrong-version",
            Self::Physical(Condition::Open) => "open",
            Self::Physical(Condition::Shorted { .. }) => "shorted",
            Self::Physical(Condition::StuckAmplifier) => "stuck-amplifier",
            Self::Physical(Condition::Stalled) => "stalled",
        }
    }

    pub(super) const fn applies_to(&self, target: FaultTarget) -> bool {
        match self {
            Self::Physical(Condition::Stalled) => matches!(target, FaultTarget::Frame),
            Self::Physical(_) => matches!(target, FaultTarget::Coil),
            _ => !matches!(target, FaultTarget::Coil | FaultTarget::Frame),
        }
    }

    pub(super) const fn is_of_headers(&self) -> bool {
        matches!(self, Self::Repeated | Self::Backward | Self::WrongEpoch(_) | Self::WrongVersion)
    }

    pub(super) const fn takes_part(&self, target: FaultTarget, part: Part) -> bool {
        let fits = match target {
            FaultTarget::Poses => matches!(part, Part::Magnet(_)),
            FaultTarget::Feedback | FaultTarget::Actuators => !matches!(part, Part::Magnet(_)),
            FaultTarget::Coil => matches!(part, Part::Coil(_)),
            FaultTarget::Frame => matches!(part, Part::Frame(_)),
        };
        fits && !self.is_of_headers()
    }

    pub(super) fn check_range(&self) -> Result<(), FaultRefusal> {
        let within = |holds: bool, parameter, value, expected| {
            if holds { Ok(()) } else { Err(FaultRefusal::Range { parameter, value, expected }) }
        };
        let share = |value: f64| value > 0.0 && value < 1.0;
        match *self {
            Self::Slow { rate_hz } => {
                let holds = (RATE_MIN..=RATE_MAX).contains(&rate_hz);
                within(holds, "rate_hz", rate_hz, "from 0.1 to 1000")
            }
            Self::Delayed { by } => {
                let holds = (DELAY_MIN..=DELAY_MAX).contains(&by);
                within(holds, "delay_ms", by.as_secs_f64() * 1e3, "from 1 to 1000")
            }
            Self::Intermittent { period, off_fraction } => {
                let holds = (PERIOD_MIN..=PERIOD_MAX).contains(&period);
                within(holds, "period_ms", period.as_secs_f64() * 1e3, "from 2 to 60000")?;
                within(share(off_fraction), "off_fraction", off_fraction, "above 0 and below 1")
            }
            Self::Physical(Condition::Shorted { fraction }) => {
                let holds = fraction > 0.0 && fraction <= SHORTED_MAX;
                within(holds, "turns_fraction", fraction, "above 0, at most 0.9")
            }
            _ => Ok(()),
        }
    }
}

impl Garbage {
    /// As it stands in plans and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nan => "nan",
            Self::Huge => "huge",
            Self::Quaternion => "quaternion",
            Self::Random => "random",
        }
    }
}

impl Part {
    pub(super) const fn kind(self) -> &'static str {
        match self {
            Self::Magnet(_) => "magnet",
            Self::Coil(_) => "coil",
            Self::Frame(_) => "frame",
        }
    }

    pub(super) fn check(self, description: &HardwareDescription) -> Result<(), FaultRefusal> {
        let (index, count) = match self {
            Self::Magnet(index) => (index, description.magnets().count().min(MAGNETS_MAX)),
            Self::Coil(index) => (index, description.coils.len().min(COILS_MAX)),
            Self::Frame(index) => (index, description.frames.len().min(POSE_PARAMETERS_MAX)),
        };
        if index < count { Ok(()) } else { Err(FaultRefusal::NoSuchPart { part: self.kind(), index, count }) }
    }
}

/// The names of the verbs that apply to a target.
#[must_use]
pub const fn verbs_of(target: FaultTarget) -> &'static str {
    match target {
        FaultTarget::Poses | FaultTarget::Feedback | FaultTarget::Actuators => {
            "off, stuck, garbage, slow, delayed, intermittent, repeated, backward, wrong-epoch, wrong-version"
        }
        FaultTarget::Coil => "open, shorted, stuck-amplifier",
        FaultTarget::Frame => "stalled",
    }
}

impl Display for FaultTarget {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

impl Display for Part {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        let (Self::Magnet(index) | Self::Coil(index) | Self::Frame(index)) = self;
        write!(formatter, "{} {index}", self.kind())
    }
}

impl Display for FaultVerb {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())?;
        let milliseconds = |duration: &Duration| duration.as_secs_f64() * 1e3;
        match self {
            Self::Garbage(kind) => write!(formatter, " ({})", kind.name()),
            Self::Slow { rate_hz } => write!(formatter, " ({rate_hz} Hz)"),
            Self::Delayed { by } => write!(formatter, " (by {} ms)", milliseconds(by)),
            Self::Intermittent { period, off_fraction } => {
                write!(formatter, " (off for {off_fraction} of every {} ms)", milliseconds(period))
            }
            Self::WrongEpoch(EpochChange::Other) => formatter.write_str(" (other)"),
            Self::WrongEpoch(EpochChange::EveryMessage) => formatter.write_str(" (every-message)"),
            Self::Physical(Condition::Shorted { fraction }) => {
                write!(formatter, " ({fraction} of the turns)")
            }
            _ => Ok(()),
        }
    }
}
