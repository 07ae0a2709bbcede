//! What each cause makes of the daemon: its response, whether it is a monitor's, and whether currents may be
//! held on its account.
//!
//! | table | says |
//! |---|---|
//! | [`response`] | what happens to the outputs |
//! | [`is_monitor`] | judged and told, but not acted upon, in passive mode |
//! | [`holds_currents`] | the present currents are known and harmless, so that they may be kept for a while |
//!
//! When a cause is over, so that a reset is allowed, stands in [`Watch::persists`](super::watch::Watch::persists).

use magsteer_hal::operator::Cause;

/// What a cause makes of the outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Response {
    /// A request is refused, nothing else.
    Refuse,
    /// Ramp to zero, then idle.
    Stop,
    /// Ramp to zero, then a latched fault.
    Trip,
    /// Cut the amplifiers, a latched fault.
    Disable,
}

/// What `cause` makes of the outputs; follows from the ranges of its codes.
#[must_use]
pub const fn response(cause: Cause) -> Response {
    match cause.code() {
        0..100 => Response::Refuse,
        100..200 => Response::Stop,
        200..300 => Response::Trip,
        _ => Response::Disable,
    }
}

/// True for a judgement by a limit that commissioning has yet to find: in passive mode it is told and counted only.
///
/// False for what leaves the loop without a sensor, a driver, a finite request or authority, for what the operator
/// orders, and for what cuts the amplifiers: those act in every mode.
#[must_use]
pub const fn is_monitor(cause: Cause) -> bool {
    matches!(
        cause,
        Cause::ModelNotConverged
            | Cause::FieldModelInvalid
            | Cause::Overruns
            | Cause::SensorRestarted
            | Cause::PoseImplausible
            | Cause::NotFollowing
            | Cause::StabilityLost
            | Cause::PoseOutsideWorkspace
            | Cause::PoseTooFast
            | Cause::CoilOpen
            | Cause::CoilOverheated
            | Cause::ModelOff
            | Cause::NotProgressing
    )
}

/// True where a trip leaves currents that are known, obeyed and harmless, so that `safe_action = "hold-then-ramp"`
/// may keep them. False where nobody sees or commands them, where they are what is wrong, and where the rod has left
/// the equilibrium that they belong to: then the ramp begins at once.
#[must_use]
pub const fn holds_currents(cause: Cause) -> bool {
    matches!(
        cause,
        Cause::PoseStale
            | Cause::ModelNotConverged
            | Cause::FieldModelInvalid
            | Cause::Overruns
            | Cause::RequestNotFinite
            | Cause::SensorRestarted
            | Cause::PoseImplausible
            | Cause::PoseOutsideWorkspace
            | Cause::PoseTooFast
            | Cause::ModelOff
            | Cause::NotProgressing
    )
}

#[cfg(test)]
mod tests {
    use super::{Cause, Response, holds_currents, is_monitor, response};

    #[test]
    fn nothing_that_cuts_or_that_an_operator_orders_is_a_monitors_or_holds_currents() {
        for &cause in Cause::ALL {
            if response(cause) != Response::Trip {
                assert!(!is_monitor(cause) && !holds_currents(cause), "{cause:?}");
            }
        }
    }

    #[test]
    fn what_takes_authority_feedback_or_a_finite_request_acts_in_every_mode() {
        for cause in [
            Cause::PoseStale,
            Cause::FeedbackStale,
            Cause::DescriptionMismatch,
            Cause::CommandNotSent,
            Cause::RequestNotFinite,
            Cause::AuthorityLost,
            Cause::DriverFault,
            Cause::OverCurrent,
            Cause::EmergencyStop,
        ] {
            assert!(!is_monitor(cause), "{cause:?}");
        }
    }
}
