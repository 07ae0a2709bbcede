//! A fault that makes sense, and why others do not.

use std::fmt::{self, Display, Formatter};

use crate::description::HardwareDescription;

use super::kinds::{FaultTarget, FaultVerb, Garbage, Part, Reach, verbs_of};

/// What goes wrong where. Make one with [`Fault::new`], which refuses what makes no sense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    target: FaultTarget,
    part: Option<Part>,
    verb: FaultVerb,
}

/// Why a fault makes no sense, or not here.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum FaultRefusal {
    /// The verb means nothing for the target.
    #[error("{verb} does not apply to {target}; it takes {}", verbs_of(*.target))]
    NotApplicable {
        /// What it was to befall.
        target: FaultTarget,
        /// The verb's name.
        verb: &'static str,
    },
    /// Actuators are given nothing that is not finite or beyond their limits.
    #[error("actuators take `random` garbage alone: coils must never see more than their limits")]
    UnsafeGarbage,
    /// Feedback has no quaternions.
    #[error("feedback has no quaternions: its garbage is `nan`, `huge` or `random`")]
    NoQuaternion,
    /// A part of another kind than the target has, or where the verb takes none.
    #[error("{verb} of {target} cannot be limited to a single {part}")]
    PartKind {
        /// What it was to befall.
        target: FaultTarget,
        /// The verb's name.
        verb: &'static str,
        /// `magnet`, `coil` or `frame`.
        part: &'static str,
    },
    /// A physical condition needs to be told of which coil or frame.
    #[error("a fault of a {target} must say which")]
    PartMissing {
        /// What it was to befall.
        target: FaultTarget,
    },
    /// The rig has no such part.
    #[error("there is no {part} {index}: the rig has {count}")]
    NoSuchPart {
        /// `magnet`, `coil` or `frame`.
        part: &'static str,
        /// Index given.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A parameter out of its range.
    #[error("{parameter} = {value}: must be {expected}")]
    Range {
        /// Name of the parameter.
        parameter: &'static str,
        /// Its value.
        value: f64,
        /// The values that would have been accepted.
        expected: &'static str,
    },
    /// A physical condition, asked of a driver that has no simulated plant.
    #[error("{verb} is a condition of the plant itself: only a simulated plant can have it on request")]
    PlantOnly {
        /// The verb's name.
        verb: &'static str,
    },
    /// No room for one more.
    #[error("{max} faults wait or act already: clear them first")]
    TooMany {
        /// How many there may be for one target.
        max: usize,
    },
    /// Codes that this build does not know.
    #[error("a request that this driver does not know")]
    Unknown,
}

impl Fault {
    /// A fault that fits the rig of `description` and a driver whose faults go as deep as `reach`.
    ///
    /// # Errors
    /// Why it does not.
    pub fn new(
        target: FaultTarget,
        part: Option<Part>,
        verb: FaultVerb,
        description: &HardwareDescription,
        reach: Reach,
    ) -> Result<Self, FaultRefusal> {
        let name = verb.name();
        if !verb.applies_to(target) {
            return Err(FaultRefusal::NotApplicable { target, verb: name });
        }
        match (target, verb) {
            (FaultTarget::Actuators, FaultVerb::Garbage(kind)) if kind != Garbage::Random => {
                return Err(FaultRefusal::UnsafeGarbage);
            }
            (FaultTarget::Feedback, FaultVerb::Garbage(Garbage::Quaternion)) => {
                return Err(FaultRefusal::NoQuaternion);
            }
            _ => (),
        }
        verb.check_range()?;
        match part {
            Some(part) if !verb.takes_part(target, part) => {
                return Err(FaultRefusal::PartKind { target, verb: name, part: part.kind() });
            }
            Some(part) => part.check(description)?,
            None if matches!(verb, FaultVerb::Physical(_)) => {
                return Err(FaultRefusal::PartMissing { target });
            }
            None => (),
        }
        if matches!(verb, FaultVerb::Physical(_)) && reach == Reach::Channels {
            return Err(FaultRefusal::PlantOnly { verb: name });
        }
        Ok(Self { target, part, verb })
    }

    /// What it befalls.
    #[must_use]
    pub const fn target(&self) -> FaultTarget {
        self.target
    }

    /// The one part that it befalls; `None` for all of the target.
    #[must_use]
    pub const fn part(&self) -> Option<Part> {
        self.part
    }

    /// What it does.
    #[must_use]
    pub const fn verb(&self) -> FaultVerb {
        self.verb
    }

    /// True for what befalls commands before the guard judges them.
    pub(super) const fn befalls_commands(&self) -> bool {
        matches!(self.target, FaultTarget::Actuators) && self.verb.is_of_headers()
    }
}

impl Display for Fault {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        match (self.target, self.part) {
            (FaultTarget::Coil | FaultTarget::Frame, Some(part)) => write!(formatter, "{part}")?,
            (target, Some(part)) => write!(formatter, "{target}, {part}")?,
            (target, None) => write!(formatter, "{target}")?,
        }
        write!(formatter, ": {}", self.verb)
    }
}
