//! From an operator's message to what it asks of the loop.

use std::time::Duration;

use magsteer_hal::HardwareDescription;
use magsteer_hal::operator::{Cause, OperatorRequest, verb};

use crate::control::ReferenceTarget;

use super::state::Verb;

/// How many magnets and frames a target of this rig names.
#[derive(Debug, Clone, Copy)]
pub struct RigCounts {
    magnets: u32,
    frames: u32,
}

impl RigCounts {
    /// Those of a rig.
    pub fn of(description: &HardwareDescription) -> Self {
        Self {
            magnets: u32::try_from(description.magnets().count()).unwrap_or(u32::MAX),
            frames: u32::try_from(description.frames.len()).unwrap_or(u32::MAX),
        }
    }
}

/// The target that a request names.
fn target(request: &OperatorRequest, rig: RigCounts) -> Result<ReferenceTarget, Cause> {
    let frame_angles = match request.pose_parameter_count {
        0 => None,
        count if count == rig.frames => Some(request.angle_rad),
        _ => return Err(Cause::TargetInvalid),
    };
    let target = ReferenceTarget { directions: request.direction, frame_angles };
    if request.magnet_count == rig.magnets { Ok(target) } else { Err(Cause::TargetInvalid) }
}

/// What an operator's request asks of the loop. Whether a target is one that the rig can take is the supervisor's to say.
///
/// # Errors
/// The cause by which the request is refused: an unknown verb, a target of another count of magnets or frames.
pub fn verb_of(request: &OperatorRequest, rig: RigCounts) -> Result<Verb, Cause> {
    match request.verb {
        verb::ARM => Ok(Verb::Arm),
        verb::GO => Ok(Verb::Go),
        verb::HOLD => Ok(Verb::Hold),
        verb::RETREAT => Ok(Verb::Retreat),
        verb::STOP => Ok(Verb::Stop),
        verb::RESET => Ok(Verb::Reset),
        verb::ESTOP => Ok(Verb::EmergencyStop),
        verb::SET_TARGET if request.valid_ms == 0 => target(request, rig).map(Verb::SetTarget),
        verb::SET_TARGET => {
            let valid = Duration::from_millis(u64::from(request.valid_ms));
            target(request, rig).map(|target| Verb::StreamTarget(target, valid))
        }
        _ => Err(Cause::UnknownVerb),
    }
}

#[cfg(test)]
mod tests {
    use super::{Cause, Duration, OperatorRequest, ReferenceTarget, RigCounts, Verb, verb, verb_of};

    #[test]
    fn unknown_verbs_and_targets_for_another_count_of_magnets_or_frames_are_refused() {
        let request = |verb, magnet_count| OperatorRequest { verb, magnet_count, ..Default::default() };
        let turning = |pose_parameter_count| OperatorRequest {
            pose_parameter_count,
            angle_rad: [0.5; 8],
            ..request(verb::SET_TARGET, 2)
        };
        let rig = RigCounts { magnets: 2, frames: 2 };
        let parse = |request: &OperatorRequest| verb_of(request, rig);
        assert_eq!(parse(&request(0, 2)), Err(Cause::UnknownVerb));
        assert_eq!(parse(&request(99, 2)), Err(Cause::UnknownVerb));
        assert_eq!(parse(&request(verb::SET_TARGET, 3)), Err(Cause::TargetInvalid));
        assert_eq!(parse(&request(verb::SET_TARGET, 2)), Ok(Verb::SetTarget([[0.0; 3]; 8].into())));
        assert_eq!(parse(&turning(3)), Err(Cause::TargetInvalid));
        let turned = ReferenceTarget { directions: [[0.0; 3]; 8], frame_angles: Some([0.5; 8]) };
        assert_eq!(parse(&turning(2)), Ok(Verb::SetTarget(turned)));
        let streamed = OperatorRequest { valid_ms: 200, ..request(verb::SET_TARGET, 2) };
        let expected = Verb::StreamTarget([[0.0; 3]; 8].into(), Duration::from_millis(200));
        assert_eq!(parse(&streamed), Ok(expected));
        assert_eq!(parse(&request(verb::GO, 0)), Ok(Verb::Go));
    }
}
