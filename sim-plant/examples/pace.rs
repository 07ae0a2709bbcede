//! How fast the plant runs: microseconds a simulated millisecond, driven at 1 kHz.
//!
//! `cargo run --release -p magsteer-sim-plant --example pace`

#[path = "../src/fixture.rs"]
mod fixture;

use std::time::{Duration, Instant};

use magsteer_hal::{Actuation, Authority, Gate, Hardware, Stamp};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};

/// Simulated milliseconds of one measurement.
const MILLISECONDS: u32 = 10_000;

fn main() {
    let description = fixture::bigmag();
    println!("element_mm  step_us  us/ms  times real time");
    for (element_mm, step_us) in [(5.0, 500), (2.5, 500), (2.5, 1000), (1.25, 500)] {
        let mut tables = fixture::plant_tables();
        tables["rod"]["element_length_max_mm"] = element_mm.into();
        tables["step_us"] = step_us.into();
        let config: PlantConfig = serde_json::from_value(tables).expect("a configuration");
        let plant = config.build(&description).expect("valid");
        let mut rig = SimulatedRig::new(plant, &description);
        let mut gate = Gate::new(&description);
        let authority = Authority { epoch: 1, token: 1, validity: Duration::from_millis(100) };
        let cycle = Duration::from_millis(1);
        let mut now = Stamp::from_nanoseconds(1_000_000_000);
        rig.read(now);
        rig.write(&gate.claim(authority), now).expect("sent");
        let start = Instant::now();
        for millisecond in 0..MILLISECONDS {
            now = now.after(cycle);
            let mut request = Actuation::default();
            for (coil, current) in request.current_a.iter_mut().take(6).enumerate() {
                // Slow waves, each coil at its own pace; the rod swings through some 60 degrees.
                *current = 0.8 * (f64::from(millisecond) * 1e-3 * (3.0 + coil as f64)).sin();
            }
            let admitted =
                gate.drive(&request, cycle.as_secs_f64(), authority, Stamp::default()).expect("finite");
            rig.write(&admitted.command, now).expect("sent");
            rig.read(now);
        }
        let microseconds = start.elapsed().as_secs_f64() * 1e6 / f64::from(MILLISECONDS);
        let counts = rig.plant().counts();
        assert_eq!((counts.steps_unsolved, rig.plant().guard().limit_breaks()), (0, 0));
        println!("{element_mm:>10}  {step_us:>7}  {microseconds:>5.1}  {:.0}", 1e3 / microseconds);
    }
}
