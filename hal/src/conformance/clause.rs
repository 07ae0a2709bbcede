//! What the contract asks, clause by clause: name, level, claim, and what would be right.

use std::fmt;

use super::garbage::Garbage;

/// How far a check goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Listens, and sends nothing.
    Static,
    /// Takes authority and commands zero current alone.
    Dry,
    /// Drives a quarter of each coil's greatest current and turns frames by some degrees: for a rig whose
    /// coils, or resistors in their place, may carry that and whose frames may move.
    DummyLoad,
}

impl Level {
    /// The word a person writes and reads.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Static => "static",
            Self::Dry => "dry",
            Self::DummyLoad => "dummy-load",
        }
    }
}

impl fmt::Display for Level {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// What the contract asks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clause {
    /// A read before anything arrived is [`Reading::never`](crate::Reading::never).
    NothingIsNever,
    /// A message that fails a check is reported and never replaces the last good one.
    GarbageIsRefused,

    /// Feedback is published at a steady, sufficient rate.
    FeedbackRate,
    /// Layout version of feedback and poses.
    LayoutVersion,
    /// The driver was started with the same description.
    Fingerprint,
    /// Counts, codes and numbers of feedback.
    FeedbackContents,
    /// Sequence and epoch of feedback.
    FeedbackSequence,
    /// Stamps of feedback.
    FeedbackStamps,
    /// No current and no authority while nobody commands.
    CurrentAtRest,
    /// Measured angles lie in their ranges.
    AnglesInRange,
    /// Poses are published at a steady, sufficient rate.
    PoseRate,
    /// Counts and numbers of poses.
    PoseContents,
    /// Sequence and epoch of poses.
    PoseSequence,
    /// Stamps of poses.
    PoseStamps,

    /// Feedback arrives, idle and at zero current; each message is fresh once, and sequences rise.
    FeedbackArrives,
    /// A claim is granted and its epoch and sequence are echoed; no current flows by it.
    ClaimIsEchoed,
    /// A second claimant is refused at zero current.
    RivalIsRefused,
    /// A command with one thing wrong is refused and counted.
    Garbage(Garbage),
    /// A claim whose epoch does not rise is refused.
    FormerEpochIsRefused,
    /// Once validity ran out authority is lost, in time.
    LapseEndsAuthority,
    /// Authority given up is free at once.
    ReleaseFrees,
    /// Disabled at zero current, the rig stays so until a new claim.
    DisableIsKept,

    /// Without a claim nothing flows, and what was refused is counted.
    NoDriveWithoutClaim,
    /// The current of each coil has the sign that was commanded.
    CurrentSign,
    /// The current flows in the coil that was commanded.
    CurrentOrder,
    /// The current is as great as was commanded.
    CurrentScale,
    /// A current in one coil leaves the others at zero.
    CurrentCrosstalk,
    /// Currents follow set points and get there, never faster than slew.
    CurrentsFollowWithinSlew,
    /// A command that jumps is followed within slew, and counted.
    JumpIsSlewed,
    /// A command beyond the greatest current is held within it, and counted.
    OverLimitIsHeld,
    /// A second claimant is refused while the first commands.
    AuthorityIsExclusive,
    /// Once validity ran out the rig ramps to zero alone, and the former epoch commands nothing any more.
    LapseRampsDown,
    /// The way to zero without a command keeps the slew limit: no cut.
    LapseRampKeepsSlew,
    /// Ordered to ramp down, the rig does and keeps authority.
    OrderRampsDown,
    /// Released, the rig ramps to zero and can be claimed again.
    ReleaseRampsDown,
    /// Disabled, the rig stays so until a new claim.
    DisableLatches,
    /// Each frame turns the way that was commanded.
    AngleSign,
    /// The frame turns that was commanded.
    AngleOrder,
    /// The frame turns as far as was commanded.
    AngleScale,
}

/// What is to be told of a clause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Facts {
    /// Stable name.
    pub id: &'static str,
    /// Least level at which it is tried.
    pub level: Level,
    /// The clause in words.
    pub claim: &'static str,
    /// What would be right, and where to look when it is not.
    pub right: &'static str,
}

const fn facts(id: &'static str, level: Level, claim: &'static str, right: &'static str) -> Facts {
    Facts { id, level, claim, right }
}

impl Clause {
    /// Stable name, level, claim and what would be right.
    #[must_use]
    pub const fn facts(self) -> Facts {
        match self {
            Self::NothingIsNever => facts(
                "nothing-is-never",
                Level::Static,
                "a read before anything arrived finds nothing",
                "no message before the driver's first",
            ),
            Self::GarbageIsRefused => facts(
                "garbage-is-refused",
                Level::Static,
                "garbage never replaces the last good message",
                "a message that fails a check is reported and the former one kept",
            ),
            Self::Garbage(garbage) => garbage.facts(),
            _ => match self.listened() {
                Some(found) => found,
                None => match self.dry() {
                    Some(found) => found,
                    None => self.driven(),
                },
            },
        }
    }

    const fn listened(self) -> Option<Facts> {
        let (id, claim, right) = match self {
            Self::FeedbackRate => (
                "feedback-rate",
                "feedback is published at a steady rate",
                "the stated rate within 10 %, or any with half of all intervals below 20 ms",
            ),
            Self::LayoutVersion => (
                "layout-version",
                "messages have the layout version of this build",
                "header.schema of feedback and poses as in the generated messages",
            ),
            Self::Fingerprint => (
                "description-fingerprint",
                "the driver runs the same description of the rig",
                "the fingerprint of this configuration: give the driver the same file, or generate its rig anew",
            ),
            Self::FeedbackContents => (
                "feedback-contents",
                "feedback has every coil and frame, finite numbers and known codes",
                "counts of the description; currents in A and angles in rad, finite; a known state; fault 0",
            ),
            Self::FeedbackSequence => (
                "feedback-sequence",
                "the sequence of feedback rises within one epoch",
                "a sequence from 1 on that rises with each message; one epoch a life of the driver",
            ),
            Self::FeedbackStamps => (
                "feedback-stamps",
                "stamps of feedback are of this host's monotonic clock and advance",
                "CLOCK_MONOTONIC in ns: each source stamp after the former, at most 100 ms before its publish stamp, \
                 neither in the future nor 1 s old",
            ),
            Self::CurrentAtRest => (
                "current-at-rest",
                "no current flows and nobody holds authority while nobody commands",
                "state idle, every current zero within the tolerance",
            ),
            Self::AnglesInRange => (
                "angles-in-range",
                "measured frame angles lie in their ranges",
                "rad, from angle_min to angle_max of each frame, 1 degree allowed beyond",
            ),
            Self::PoseRate => (
                "pose-rate",
                "poses are published at a steady rate",
                "the stated rate within 10 %, or any with half of all intervals below 200 ms",
            ),
            Self::PoseContents => (
                "pose-contents",
                "poses have every magnet, unit quaternions and positions in the workspace",
                "counts of the description; metres, within two radii of the workspace; |quaternion| = 1 within 1e-3; \
                 at least half of all messages see every magnet",
            ),
            Self::PoseSequence => {
                ("pose-sequence", "the sequence of poses rises within one epoch", "as feedback-sequence")
            }
            Self::PoseStamps => (
                "pose-stamps",
                "stamps of poses are of this host's monotonic clock and advance",
                "as feedback-stamps, with at most 500 ms from exposure to publication",
            ),
            _ => return None,
        };
        Some(facts(id, Level::Static, claim, right))
    }

    const fn dry(self) -> Option<Facts> {
        let (id, claim, right) = match self {
            Self::FeedbackArrives => (
                "feedback-arrives",
                "feedback arrives, idle, with rising sequence",
                "state idle at zero current, each message once",
            ),
            Self::ClaimIsEchoed => (
                "claim-is-echoed",
                "a claim is granted and echoed",
                "state driven, accepted_epoch and accepted_sequence of the last command obeyed, no current",
            ),
            Self::RivalIsRefused => (
                "rival-is-refused",
                "a second claimant is refused",
                "accepted_epoch stays the holder's, the rival's claims are counted as refused",
            ),
            Self::FormerEpochIsRefused => (
                "former-epoch-is-refused",
                "a claim with an epoch that was granted before is refused",
                "epochs of claims rise over all granted since the driver's start",
            ),
            Self::LapseEndsAuthority => (
                "lapse-ends-authority",
                "authority is lost once the last command's validity ran out, and can be claimed anew",
                "state driven until valid_until_ns and no longer than two periods of feedback after it",
            ),
            Self::ReleaseFrees => (
                "release-frees",
                "authority given up at zero current is free at once",
                "state idle after a release, a new claim is granted",
            ),
            Self::DisableIsKept => (
                "disable-is-kept",
                "a disabled rig stays so until a new claim",
                "state disabled after a disable order, whatever the former holder sends",
            ),
            _ => return None,
        };
        Some(facts(id, Level::Dry, claim, right))
    }

    const fn driven(self) -> Facts {
        let (id, claim, right) = match self {
            Self::NoDriveWithoutClaim => (
                "no-drive-without-claim",
                "nothing flows without a claim",
                "drive commands without authority are refused and counted, currents stay zero",
            ),
            Self::CurrentSign => (
                "current-sign",
                "the current of each coil has the sign that was commanded",
                "a positive set point measures a positive current: mend polarity of amplifier or sensor",
            ),
            Self::CurrentOrder => (
                "current-order",
                "the current flows in the coil that was commanded",
                "channel k drives and measures coil k of the description",
            ),
            Self::CurrentScale => (
                "current-scale",
                "the current is as great as was commanded",
                "amperes: a factor of 1000 means that mA were taken for A",
            ),
            Self::CurrentCrosstalk => (
                "current-crosstalk",
                "a current in one coil leaves the others at zero",
                "the others measure zero within the tolerance",
            ),
            Self::CurrentsFollowWithinSlew => (
                "currents-follow-within-slew",
                "currents follow within slew",
                "set points are reached, never faster than slew_max_a_per_s",
            ),
            Self::JumpIsSlewed => (
                "jump-is-slewed",
                "a command that jumps is followed within slew",
                "the driver moves its set point by slew_max_a_per_s at most, and counts the jump in limit_breaks",
            ),
            Self::OverLimitIsHeld => (
                "over-limit-is-held",
                "a command beyond the greatest current is held within it",
                "no more than current_max_a, and the command is counted in limit_breaks",
            ),
            Self::AuthorityIsExclusive => (
                "rival-under-current",
                "a second claimant is refused while the first commands",
                "currents and accepted_epoch stay the holder's",
            ),
            Self::LapseRampsDown => (
                "watchdog-ramps-down",
                "the rig ramps to zero alone when validity runs out",
                "zero within validity + current / slew + settling; the former epoch commands nothing any more",
            ),
            Self::LapseRampKeepsSlew => (
                "watchdog-keeps-slew",
                "the way to zero without a command is a ramp, not a cut",
                "currents fall no faster than slew_max_a_per_s",
            ),
            Self::OrderRampsDown => (
                "ramp-order-keeps-authority",
                "ordered to ramp down, the rig does and keeps authority",
                "zero within current / slew + settling, state driven",
            ),
            Self::ReleaseRampsDown => (
                "release-ramps-down",
                "a released rig ramps to zero and is free",
                "zero within current / slew + settling, then idle; a new claim is granted",
            ),
            Self::DisableLatches => (
                "disable-latches",
                "a disabled rig stays so until a new claim",
                "state disabled at once, currents zero, drive commands of the former holder refused",
            ),
            Self::AngleSign => (
                "angle-sign",
                "each frame turns the way that was commanded",
                "a rising set point measures a rising angle",
            ),
            Self::AngleOrder => (
                "angle-order",
                "the frame turns that was commanded",
                "motor k turns and measures frame k of the description; the others stand still",
            ),
            _ => (
                "angle-scale",
                "the frame turns as far as was commanded",
                "radians: a factor of 57.3 means that degrees were taken for radians",
            ),
        };
        facts(id, Level::DummyLoad, claim, right)
    }

    /// Stable name.
    #[must_use]
    pub const fn id(self) -> &'static str {
        self.facts().id
    }

    /// Least level at which it is tried.
    #[must_use]
    pub const fn level(self) -> Level {
        self.facts().level
    }
}

impl fmt::Display for Clause {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.facts().claim)
    }
}
