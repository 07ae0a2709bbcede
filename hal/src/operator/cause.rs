//! Why the daemon refused a request or stopped: stable codes with the words a person reads.
//!
//! Codes never change their meaning; new ones take free numbers. A higher code is a worse cause, and
//! where several apply at once the daemon reports the worst.

/// Declares the causes once: name, code, text.
macro_rules! causes {
    ($($(#[doc = $doc:literal])+ $name:ident = $code:literal, $text:literal;)+) => {
        /// Why a request was refused, or why the daemon stopped.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[repr(u32)]
        pub enum Cause {
            $($(#[doc = $doc])+ $name = $code,)+
        }

        impl Cause {
            /// Every cause, the mildest first.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// The cause with this code; `None` for 0 and for codes of a newer daemon.
            #[must_use]
            pub const fn from_code(code: u32) -> Option<Self> {
                match code {
                    $($code => Some(Self::$name),)+
                    _ => None,
                }
            }

            /// What happened, in words.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)+
                }
            }
        }
    };
}

causes! {
    // 1 to 99: a request is refused, nothing else happens.
    /// The request makes no sense in the present state.
    WrongState = 1, "not possible in this state";
    /// A verb that this daemon does not know.
    UnknownVerb = 2, "unknown request";
    /// Not one finite unit vector a magnet, or a frame angle out of its range.
    TargetInvalid = 3, "the target needs one unit direction a magnet of the rig, and frame angles within their ranges if any";
    /// Another request is under way.
    Busy = 4, "another request is under way";
    /// Real-time scheduling is required by the configuration and was not granted.
    RealtimeMissing = 5, "real-time scheduling is enforced by the configuration but was not granted";
    /// The driver did not confirm the claim of authority in time.
    ArmTimeout = 6, "the driver did not confirm authority in time";
    /// The driver still serves another holder, ramps down or carries current.
    DriverBusy = 7, "the driver is not idle at zero current";
    /// The daemon is ending and takes no more orders.
    Ending = 8, "the daemon is ending";
    /// On the way to the target the rod would snap through, or come too close to it; the target before stays in force.
    TargetCrossesSnapThrough = 9, "the rod would snap through on the way to the target";
    /// On the way to the target a magnet would leave the field model's range; the target before stays in force.
    TargetOutsideField = 10, "on the way to the target a magnet would leave the field model's range";
    /// The margin of stability fell below what is allowed: the currents are kept until another target is set, or a retreat asked for.
    NearSnapThrough = 11, "held close to a snap-through until another target is set, or `retreat`";
    /// No newer target came while the last of a stream was valid: the magnets are held where the reference was.
    StreamEnded = 12, "held because the stream of targets ended";
    /// A retreat was asked for, and is under way.
    Retreating = 13, "going back along the way that led close to a snap-through";
    /// Records are asked for, and this daemon keeps none, or has none yet.
    NotRecording = 20, "this daemon has no records to write";
    /// The rig is on another machine, and reaches this one through a tunnel that carries no commands.
    OnlyWatched = 21, "this machine only watches the rig; it is commanded on its own machine";

    // 100 to 199: a wanted stop; ramp to zero, then idle.
    /// The operator asked for a stop.
    OperatorStop = 100, "stopped by the operator";
    /// The process was told to end.
    Terminated = 101, "the process was asked to end";

    // 200 to 299: a trip; ramp to zero, then a latched fault.
    /// No valid poses for longer than the stop limit.
    PoseStale = 200, "no fresh poses";
    /// The model found no equilibrium for longer than its limit.
    ModelNotConverged = 201, "the model found no equilibrium";
    /// A magnet stayed outside the field model's range for longer than its limit.
    FieldModelInvalid = 202, "a magnet lies outside the field model's range";
    /// Too many periods were missed.
    Overruns = 203, "the loop missed too many periods";
    /// No valid feedback for longer than its limit.
    FeedbackStale = 204, "no fresh feedback from the driver";
    /// The driver runs with another description of the rig.
    DescriptionMismatch = 205, "the driver runs another description of the rig";
    /// Commands could not be handed to the transport.
    CommandNotSent = 206, "commands could not be sent";
    /// The controller asked for a value that is no finite number.
    RequestNotFinite = 207, "the controller asked for a value that is not finite";
    /// The driver no longer obeys this daemon's epoch: it restarted, or its watchdog ran out.
    AuthorityLost = 208, "the driver no longer obeys this daemon";
    /// Poses come from another life of the sensor than when authority was granted.
    SensorRestarted = 209, "the pose sensor restarted";
    /// Measured directions lie further off the model than can be believed.
    PoseImplausible = 210, "measured poses and the model disagree";
    /// Measured currents or angles stay away from the commanded ones.
    NotFollowing = 211, "currents or angles do not follow commands";
    /// The equilibrium that the model follows is no longer stable: the rod has snapped through, or is about to.
    StabilityLost = 212, "the rod is not stable where the model has it";

    /// Magnets were seen where the rod does not reach.
    PoseOutsideWorkspace = 213, "magnets are seen outside of the workspace";
    /// Measured poses move faster than a rod does.
    PoseTooFast = 214, "measured poses move faster than the rod can";
    /// A coil that was asked for current carries none.
    CoilOpen = 215, "a coil does not carry the current that it is asked for: open circuit";
    /// A coil took up more heat than it may hold, by its measured current.
    CoilOverheated = 216, "a coil is too hot by the current that it carried";
    /// Model and measurement differ by more than they may for long.
    ModelOff = 217, "the model stays away from what is measured";
    /// The controller froze, or comes no nearer to a target that is clear.
    NotProgressing = 218, "the controller makes no progress towards its target";

    // 300 to 399: the amplifiers are cut at once.
    /// The measured current did not reach zero within the ramp's time-out.
    RampTimeout = 300, "the driver did not report zero current in time";
    /// The driver cut its amplifiers by itself.
    DriverDisabled = 301, "the driver cut its amplifiers";
    /// The driver reports a fault of its own.
    DriverFault = 302, "the driver reports a fault";
    /// A measured current lies beyond its coil's limit.
    OverCurrent = 303, "a measured current lies beyond its limit";
    /// The emergency stop was pressed.
    EmergencyStop = 304, "emergency stop";
}

impl Cause {
    /// The stable code, as messages carry it.
    #[must_use]
    pub const fn code(self) -> u32 {
        self as u32
    }
}

/// What a person reads for a code; empty for 0, which means that there is no cause.
#[must_use]
pub const fn text(code: u32) -> &'static str {
    match (code, Cause::from_code(code)) {
        (_, Some(cause)) => cause.text(),
        (0, None) => "",
        (_, None) => "a cause that this version does not know",
    }
}

#[cfg(test)]
mod tests {
    use super::{Cause, text};

    #[test]
    fn codes_read_back_and_are_listed_from_mild_to_bad() {
        for pair in Cause::ALL.windows(2) {
            assert!(pair[0].code() < pair[1].code(), "{pair:?}");
            assert!(pair[0] < pair[1], "order of causes follows their codes: {pair:?}");
        }
        for &cause in Cause::ALL {
            assert_eq!(Cause::from_code(cause.code()), Some(cause));
            assert_eq!(text(cause.code()), cause.text());
            assert!(!cause.text().is_empty());
        }
    }

    #[test]
    fn no_cause_and_unknown_codes_are_told_apart() {
        assert_eq!(Cause::from_code(0), None);
        assert_eq!(text(0), "");
        assert_eq!(Cause::from_code(9_999), None);
        assert!(text(9_999).contains("does not know"));
    }
}
