//! Commands with one thing wrong each, which a driver refuses and counts.

use crate::guard::VALIDITY_MAX;
use crate::message::CoilCommand;
use crate::time::Stamp;

use super::clause::{Facts, Level};

/// What is wrong with an otherwise good command of the holder of authority, at zero current.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Garbage {
    /// Another layout version.
    Schema,
    /// One coil too many.
    CoilCount,
    /// One frame too many.
    FrameCount,
    /// No known order.
    Order,
    /// A current that is no number.
    CurrentNan,
    /// A current that is infinite.
    CurrentInfinite,
    /// An angle that is no number.
    AngleNan,
    /// Published in the future.
    Future,
    /// Its validity ran out.
    Expired,
    /// No validity at all.
    NoValidity,
    /// A sequence that was there before.
    Sequence,
    /// Another token.
    Token,
    /// Another epoch.
    Epoch,
    /// A claim that asks for current.
    ClaimWithCurrent,
}

impl Garbage {
    /// Every kind.
    pub const ALL: [Self; 14] = [
        Self::Schema,
        Self::CoilCount,
        Self::FrameCount,
        Self::Order,
        Self::CurrentNan,
        Self::CurrentInfinite,
        Self::AngleNan,
        Self::Future,
        Self::Expired,
        Self::NoValidity,
        Self::Sequence,
        Self::Token,
        Self::Epoch,
        Self::ClaimWithCurrent,
    ];

    /// Makes `command`, about to be sent at `now`, wrong.
    pub(super) fn spoil(self, command: &mut CoilCommand, now: Stamp) {
        let header = &mut command.header;
        match self {
            Self::Schema => header.schema += 1,
            Self::CoilCount => command.coil_count += 1,
            Self::FrameCount => command.pose_parameter_count += 1,
            Self::Order => command.order = 77,
            Self::CurrentNan => command.actuation.current_a[0] = f64::NAN,
            Self::CurrentInfinite => command.actuation.current_a[0] = f64::INFINITY,
            Self::AngleNan => command.actuation.angle_rad[0] = f64::NAN,
            Self::Future => {
                header.publish_stamp_ns = now.after(VALIDITY_MAX).nanoseconds();
                header.valid_until_ns = now.after(VALIDITY_MAX * 2).nanoseconds();
            }
            Self::Expired => header.valid_until_ns = now.nanoseconds() - 1_000_000,
            Self::NoValidity => header.valid_until_ns = 0,
            Self::Sequence => header.sequence = 1,
            Self::Token => command.token ^= 1,
            Self::Epoch => header.epoch += 1,
            Self::ClaimWithCurrent => {
                command.order = crate::message::order::CLAIM;
                header.epoch += 1;
                command.actuation.current_a[0] = 1e-6;
            }
        }
    }

    /// True for what a rig without frames or coils cannot be sent.
    pub(super) const fn needs_frame(self) -> bool {
        matches!(self, Self::AngleNan)
    }

    pub(super) const fn facts(self) -> Facts {
        let right = "refused: commands_refused rises, accepted_sequence does not, and no current flows";
        let (id, claim) = match self {
            Self::Schema => ("refuses-schema", "a command of another layout version is refused"),
            Self::CoilCount => ("refuses-coil-count", "a command for more coils is refused"),
            Self::FrameCount => ("refuses-frame-count", "a command for more frames is refused"),
            Self::Order => ("refuses-order", "an unknown order is refused"),
            Self::CurrentNan => ("refuses-current-nan", "a current that is no number is refused"),
            Self::CurrentInfinite => ("refuses-current-infinite", "an infinite current is refused"),
            Self::AngleNan => ("refuses-angle-nan", "an angle that is no number is refused"),
            Self::Future => ("refuses-future", "a command published in the future is refused"),
            Self::Expired => ("refuses-expired", "a command whose validity ran out is refused"),
            Self::NoValidity => ("refuses-no-validity", "a command without validity is refused"),
            Self::Sequence => ("refuses-sequence", "a command with a former sequence is refused"),
            Self::Token => ("refuses-token", "a command with another token is refused"),
            Self::Epoch => ("refuses-epoch", "a command of another epoch is refused"),
            Self::ClaimWithCurrent => {
                ("refuses-claim-with-current", "a claim that asks for current is refused")
            }
        };
        Facts { id, level: Level::Dry, claim, right }
    }
}
