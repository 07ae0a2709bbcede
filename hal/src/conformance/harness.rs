//! What the suite needs of a rig, and what it reports.

use std::fmt;
use std::time::Duration;

use crate::description::HardwareDescription;
use crate::hardware::Hardware;
use crate::message::{CoilFeedback, PoseMessage};
use crate::time::Stamp;

/// A rig with its clock, as the suite drives it.
pub trait Rig {
    /// The implementation under test.
    type H: Hardware;

    /// The implementation under test.
    fn hardware(&mut self) -> &mut Self::H;

    /// What the rig is.
    fn description(&self) -> &HardwareDescription;

    /// Time as the rig's stamps count it.
    fn now(&self) -> Stamp;

    /// Lets time pass, stepped or real. When it returns, the driver has taken the newest command, lived through
    /// `duration` and published feedback, and poses if its sensor made any.
    fn advance(&mut self, duration: Duration);

    /// Makes the sensor side publish exactly these poses; false when the rig cannot.
    fn inject_pose(&mut self, message: PoseMessage) -> bool {
        let _ = message;
        false
    }

    /// Makes the driver publish exactly this feedback; false when the rig cannot.
    fn inject_feedback(&mut self, message: CoilFeedback) -> bool {
        let _ = message;
        false
    }

    /// True when nothing was published before the first [`Rig::advance`].
    fn starts_silent(&self) -> bool {
        true
    }

    /// How far a measured current may lie off the true one: noise and quantisation of the sensor, A.
    fn current_tolerance(&self) -> f64 {
        1e-6
    }

    /// How long measured currents may take to follow set points that stand still: some time constants of the coils.
    fn settling(&self) -> Duration {
        Duration::ZERO
    }
}

/// What the contract asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clause {
    /// A read before anything arrived is [`Reading::never`](crate::Reading::never).
    NothingIsNever,
    /// Feedback arrives, idle and at zero current; each message is fresh once, and sequences rise.
    FeedbackArrives,
    /// Without a claim nothing flows, and what was refused is counted.
    NoDriveWithoutClaim,
    /// A claim is granted and its epoch and sequence are echoed; no current flows by it.
    ClaimIsEchoed,
    /// Currents follow set points and get there, never faster than slew.
    CurrentsFollowWithinSlew,
    /// A second claimant is refused while the first commands.
    AuthorityIsExclusive,
    /// Once validity ran out the rig ramps to zero alone, and the former epoch commands nothing any more.
    LapseRampsDown,
    /// Released, the rig ramps to zero and can be claimed again.
    ReleaseRampsDown,
    /// Disabled, the rig stays so until a new claim.
    DisableLatches,
    /// A message that fails a check is reported and never replaces the last good one.
    GarbageIsRefused,
}

impl fmt::Display for Clause {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::NothingIsNever => "a read before anything arrived finds nothing",
            Self::FeedbackArrives => "feedback arrives, idle, with rising sequence",
            Self::NoDriveWithoutClaim => "nothing flows without a claim",
            Self::ClaimIsEchoed => "a claim is granted and echoed",
            Self::CurrentsFollowWithinSlew => "currents follow within slew",
            Self::AuthorityIsExclusive => "a second claimant is refused",
            Self::LapseRampsDown => "the rig ramps to zero alone when validity runs out",
            Self::ReleaseRampsDown => "a released rig ramps to zero and is free",
            Self::DisableLatches => "a disabled rig stays so until a new claim",
            Self::GarbageIsRefused => "garbage never replaces the last good message",
        })
    }
}

/// A clause that the rig broke.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// Which.
    pub clause: Clause,
    /// What was found instead.
    pub detail: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}: {}", self.clause, self.detail)
    }
}
