//! What the simulated driver's fault codes mean.

use std::fmt;

/// The codes of [`CoilFeedback::fault`](magsteer_hal::CoilFeedback) that this driver reports.
pub mod fault_code {
    /// Nothing is wrong, or no longer.
    pub const NONE: u32 = 0;
    /// A coil became too hot. Reported until all have cooled to the temperature of release.
    pub const OVER_TEMPERATURE: u32 = 1;
    /// A measured current stayed too far from its set point for too long: a stuck amplifier, an open coil, or
    /// a supply too weak for what is asked.
    pub const CURRENT_NOT_FOLLOWING: u32 = 2;
    /// A measured frame angle stayed too far from its set point for too long: a stalled motor.
    pub const FRAME_NOT_FOLLOWING: u32 = 3;
}

/// Why the driver cut its amplifiers on its own account.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// [`fault_code::OVER_TEMPERATURE`]
    OverTemperature {
        /// Index of the coil.
        coil: usize,
    },
    /// [`fault_code::CURRENT_NOT_FOLLOWING`]
    CurrentNotFollowing {
        /// Index of the coil.
        coil: usize,
    },
    /// [`fault_code::FRAME_NOT_FOLLOWING`]
    FrameNotFollowing {
        /// Index of the frame.
        frame: usize,
    },
}

impl Fault {
    /// One of [`fault_code`].
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::OverTemperature { .. } => fault_code::OVER_TEMPERATURE,
            Self::CurrentNotFollowing { .. } => fault_code::CURRENT_NOT_FOLLOWING,
            Self::FrameNotFollowing { .. } => fault_code::FRAME_NOT_FOLLOWING,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OverTemperature { coil } => write!(formatter, "coil {coil} is too hot"),
            Self::CurrentNotFollowing { coil } => {
                write!(formatter, "the current of coil {coil} does not follow its set point")
            }
            Self::FrameNotFollowing { frame } => {
                write!(formatter, "frame {frame} does not follow its set point")
            }
        }
    }
}
