//! The plant keeps the contract of [`Hardware`](magsteer_hal::Hardware), in lockstep.

#[path = "../src/fixture.rs"]
mod fixture;

use std::time::Duration;

use magsteer_hal::conformance::{Rig, run};
use magsteer_hal::{CoilFeedback, Hardware, HardwareDescription, PoseMessage, Stamp};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};

struct LockstepRig {
    description: HardwareDescription,
    hardware: SimulatedRig,
    now: Stamp,
}

impl LockstepRig {
    fn new() -> Self {
        let description = fixture::bigmag();
        let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
        let plant = config.build(&description).expect("valid");
        let mut hardware = SimulatedRig::new(plant, &description);
        let now = Stamp::from_nanoseconds(1_000_000_000);
        hardware.read(now);
        Self { description, hardware, now }
    }
}

impl Rig for LockstepRig {
    type H = SimulatedRig;

    fn hardware(&mut self) -> &mut SimulatedRig {
        &mut self.hardware
    }

    fn description(&self) -> &HardwareDescription {
        &self.description
    }

    fn now(&self) -> Stamp {
        self.now
    }

    fn advance(&mut self, duration: Duration) {
        self.now = self.now.after(duration);
    }

    fn inject_pose(&mut self, message: PoseMessage) -> bool {
        self.hardware.inject_pose(message);
        true
    }

    fn inject_feedback(&mut self, message: CoilFeedback) -> bool {
        self.hardware.inject_feedback(message);
        true
    }

    fn settling(&self) -> Duration {
        // 200 Hz: fifteen time constants leave 2 A a factor of 3e-7.
        Duration::from_millis(15)
    }
}

#[test]
fn simulated_rig_keeps_the_contract() {
    let found: Vec<String> = run(LockstepRig::new).iter().map(ToString::to_string).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}
