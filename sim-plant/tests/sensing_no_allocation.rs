//! Goal: a plant's step allocates nothing, whichever sensor is mounted, exposures and reconstructions
//! included.
//!
//! Method: a global allocator counts per thread while steps run.

#[path = "../../tests/counting_allocator/mod.rs"]
mod counting_allocator;
#[path = "../src/fixture.rs"]
mod fixture;

use counting_allocator::allocations_in;
use magsteer_sim_plant::PlantConfig;
use serde_json::json;

#[test]
fn steps_with_exposures_allocate_nothing() {
    for sensor in ["tracker", "camera", "fibre"] {
        for polynomial in [false, true] {
            let mut tables = fixture::plant_tables();
            tables["sensor"] = json!(sensor);
            tables["sensors"]["camera"]["point_cloud"]["rate_hz"] = json!(120.0);
            if polynomial {
                tables["sensors"]["camera"]["point_cloud"]["centreline"] =
                    json!({"polynomial": {"degree": 6}});
            }
            let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
            let mut plant = config.build(&fixture::bigmag()).expect("valid");
            let (messages, allocations) = allocations_in(|| {
                let mut messages = 0;
                for _ in 0..400 {
                    plant.advance();
                    while plant.take_pose().is_some() {
                        messages += 1;
                    }
                }
                messages
            });
            assert_eq!(allocations, 0, "{sensor}");
            assert!(messages > 10, "{sensor}: {messages}");
        }
    }
}
