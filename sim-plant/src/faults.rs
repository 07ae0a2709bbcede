//! Faults by script that befall the plant itself: from what the contract calls them to what is wrong with a
//! coil or a frame.

use magsteer_hal::fault::{Condition, ConditionChange, Part};

use crate::actuation::{CoilCondition, FrameCondition, Held};
use crate::plant::Plant;

impl Plant {
    /// Takes a physical condition on, or loses it. False, and nothing done, when there is no such part or it
    /// cannot be in that condition; faults are checked against the rig when they are made.
    pub fn take_on(&mut self, change: &ConditionChange) -> bool {
        match (change.part, change.condition) {
            (Part::Coil(coil), None) => self.set_coil_condition(coil, CoilCondition::Healthy),
            (Part::Coil(coil), Some(condition)) => match coil_condition(condition) {
                Some(condition) => self.set_coil_condition(coil, condition),
                None => false,
            },
            (Part::Frame(frame), None) => self.set_frame_condition(frame, FrameCondition::Healthy),
            (Part::Frame(frame), Some(Condition::Stalled)) => {
                self.set_frame_condition(frame, FrameCondition::Stalled)
            }
            (Part::Frame(_), Some(_)) | (Part::Magnet(_), _) => false,
        }
    }
}

const fn coil_condition(condition: Condition) -> Option<CoilCondition> {
    match condition {
        Condition::Open => Some(CoilCondition::Open),
        Condition::Shorted { fraction } => Some(CoilCondition::ShortedTurns { share: fraction }),
        Condition::StuckAmplifier => Some(CoilCondition::StuckAmplifier { holds: Held::Voltage }),
        Condition::Stalled => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::PlantConfig;
    use crate::fixture;

    #[test]
    fn every_condition_that_a_plan_may_name_is_one_the_plant_can_be_in() {
        let description = fixture::bigmag();
        let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
        let mut plant = config.build(&description).expect("valid");
        let shorted = Condition::Shorted { fraction: magsteer_hal::fault::SHORTED_MAX };
        for condition in [Some(Condition::Open), Some(shorted), Some(Condition::StuckAmplifier), None] {
            assert!(plant.take_on(&ConditionChange { part: Part::Coil(5), condition }), "{condition:?}");
            assert!(!plant.take_on(&ConditionChange { part: Part::Coil(6), condition }), "{condition:?}");
        }
        for condition in [Some(Condition::Stalled), None] {
            assert!(plant.take_on(&ConditionChange { part: Part::Frame(1), condition }), "{condition:?}");
            assert!(!plant.take_on(&ConditionChange { part: Part::Frame(2), condition }), "{condition:?}");
        }
        let stalled = Some(Condition::Stalled);
        assert!(!plant.take_on(&ConditionChange { part: Part::Coil(0), condition: stalled }));
        assert!(!plant.take_on(&ConditionChange { part: Part::Frame(0), condition: Some(Condition::Open) }));
    }
}
