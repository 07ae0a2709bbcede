//! Physical conditions of coils and frames, for a simulated plant to take on.

use std::time::Duration;

use crate::message::{COILS_MAX, POSE_PARAMETERS_MAX};

use super::checked::{Fault, FaultRefusal};
use super::kinds::{Condition, FaultVerb, Part};
use super::plan::Scheduled;
use super::slots::{Events, Slots};

/// A coil or a frame takes on a physical condition, or is sound again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConditionChange {
    /// Which coil or frame.
    pub part: Part,
    /// Its condition; `None` when it is sound again.
    pub condition: Option<Condition>,
}

/// One condition a coil and a frame, `None` where it is sound.
#[derive(Debug, Clone, PartialEq)]
struct Conditions {
    coils: [Option<Condition>; COILS_MAX],
    frames: [Option<Condition>; POSE_PARAMETERS_MAX],
}

impl Conditions {
    const SOUND: Self = Self { coils: [None; COILS_MAX], frames: [None; POSE_PARAMETERS_MAX] };

    fn of(&mut self, part: Part) -> Option<&mut Option<Condition>> {
        match part {
            Part::Coil(coil) => self.coils.get_mut(coil),
            Part::Frame(frame) => self.frames.get_mut(frame),
            Part::Magnet(_) => None,
        }
    }

    fn parts() -> impl Iterator<Item = Part> {
        (0..COILS_MAX).map(Part::Coil).chain((0..POSE_PARAMETERS_MAX).map(Part::Frame))
    }
}

/// What befalls the plant itself.
#[derive(Debug, Clone)]
pub(super) struct PlantFaults {
    pub(super) slots: Slots<()>,
    /// What the plant was told.
    told: Conditions,
}

impl PlantFaults {
    pub(super) fn new(scheduled: &[Scheduled]) -> Self {
        let physical = |fault: &Fault| matches!(fault.verb(), FaultVerb::Physical(_));
        Self { slots: Slots::new(scheduled, physical), told: Conditions::SOUND }
    }

    pub(super) fn push(&mut self, scheduled: Scheduled) -> Result<(), FaultRefusal> {
        self.slots.push(scheduled)
    }

    /// The next difference between what acts and what the plant was told; of several faults of one part the
    /// one given last counts.
    pub(super) fn next_change(&mut self, now: Duration, events: &mut Events) -> Option<ConditionChange> {
        self.slots.update(now, events);
        let mut acting = Conditions::SOUND;
        for (fault, ()) in self.slots.active() {
            let place = fault.part().and_then(|part| acting.of(part));
            if let (FaultVerb::Physical(condition), Some(place)) = (fault.verb(), place) {
                *place = Some(condition);
            }
        }
        if acting == self.told {
            return None;
        }
        for part in Conditions::parts() {
            let (Some(acts), Some(told)) = (acting.of(part), self.told.of(part)) else { continue };
            if acts != told {
                *told = *acts;
                return Some(ConditionChange { part, condition: *acts });
            }
        }
        None
    }
}
