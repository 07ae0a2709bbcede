//! The plant keeps the contract of [`Hardware`](magsteer_hal::Hardware), in lockstep.

#[path = "../src/fixture.rs"]
mod fixture;

use std::time::Duration;

use magsteer_hal::conformance::{SteppedRig, run};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};

fn lockstep_rig() -> SteppedRig<SimulatedRig> {
    let description = fixture::bigmag();
    let config: PlantConfig = serde_json::from_value(fixture::plant_tables()).expect("a configuration");
    let plant = config.build(&description).expect("valid");
    let hardware = SimulatedRig::new(plant, &description);
    // 200 Hz: fifteen time constants leave 2 A a factor of 3e-7.
    SteppedRig::new(description, hardware, Duration::from_millis(15))
        // A motor starts and stops within half a second; encoders have steps of 0.01 degrees.
        .with_frames(Duration::from_millis(500), 0.05_f64.to_radians())
}

#[test]
fn simulated_rig_keeps_the_contract() {
    let found: Vec<String> = run(lockstep_rig).iter().map(ToString::to_string).collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}
