//! The simulated driver finds fault with its own hardware, and the daemon answers: cut, latched, mended,
//! armed anew.
#![cfg(feature = "sim")]

use std::path::Path;

use magsteer::config::Config;
use magsteer::control::{Cycle, Directions};
use magsteer::daemon::{ControlLoop, CycleRecord, LoopOptions, Request, Tick, Verb};
use magsteer_hal::Stamp;
use magsteer_hal::message::driver_state;
use magsteer_hal::operator::{Cause, state};
use magsteer_sim_plant::actuation::fault_code;
use magsteer_sim_plant::{PlantConfig, SimulatedRig};

/// The shipped rig under stepped time, its plant changed.
struct Bench {
    control_loop: ControlLoop<SimulatedRig, Cycle>,
    tick: Tick,
    period: std::time::Duration,
    requests: u32,
}

impl Bench {
    fn new(change: impl FnOnce(&mut PlantConfig)) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
        let (document, config) = Config::load(&path).expect("shipped");
        let mut plant = document.section::<PlantConfig>("plant").expect("shipped");
        change(&mut plant);
        let rig = &config.description;
        let hardware = SimulatedRig::new(plant.build(rig).expect("valid"), rig);
        let control = config.control.clone().expect("has a controller");
        let cycle = Cycle::new(&control, rig, config.manipulator.clone().expect("has a model"));
        let daemon = config.daemon.as_ref().expect("has a daemon");
        let control_loop = ControlLoop::new(hardware, cycle, rig, daemon, LoopOptions::default());
        // Any moment but zero, which the transport takes for "no stamp".
        let tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
        Self { control_loop, tick, period: daemon.period(), requests: 0 }
    }

    fn cycle(&mut self) -> CycleRecord {
        let record = self.control_loop.cycle(self.tick);
        self.tick = self.tick.stepped(self.period);
        record
    }

    /// Runs cycles until one holds, at most so many; it.
    fn until(&mut self, cycles: u32, holds: impl Fn(&CycleRecord) -> bool) -> Option<CycleRecord> {
        (0..cycles).map(|_| self.cycle()).find(|record| holds(record))
    }

    /// Asks for something and runs until it is answered: why it was refused, if it was.
    fn ask(&mut self, verb: Verb) -> Result<(), Cause> {
        self.requests += 1;
        let id = self.requests;
        self.control_loop.request(Request { id, verb }).expect("one request a cycle");
        let answer = |record: &CycleRecord| {
            record
                .decision
                .answers
                .iter()
                .flatten()
                .find(|answer| answer.id == id)
                .map(|answer| answer.refused)
        };
        let record = self.until(500, |record| answer(record).is_some()).expect("answered");
        answer(&record).flatten().map_or(Ok(()), Err)
    }
}

/// Goal: a coil that gets too hot under way is cut by the driver; the daemon shows the driver's fault, stays
/// cut, refuses a reset as long as the driver complains, and is armed anew once it has cooled. Nothing
/// resumes by itself.
///
/// Proves SR-12 and SR-03.
#[test]
fn a_coil_too_hot_ends_in_a_latched_fault_until_it_has_cooled() {
    let mut bench = Bench::new(|plant| {
        // Warm within a tenth of a second: 2 A warm a coil by 10 K.
        plant.winding.heat_capacity_j_per_k = 0.2;
        plant.driver.temperature_max_celsius = 24.0;
        plant.driver.temperature_release_celsius = 21.0;
    });
    let idle = |record: &CycleRecord| record.decision.state == state::IDLE && record.pose_age().is_some();
    assert!(bench.until(500, idle).is_some());
    bench.ask(Verb::Arm).expect("healthy");
    bench.ask(Verb::Go).expect("healthy");
    let mut target = Directions::default();
    for direction in &mut target[..2] {
        *direction = [70.0_f64.to_radians().sin(), 0.0, 70.0_f64.to_radians().cos()];
    }
    bench.ask(Verb::SetTarget(target.into())).expect("unit directions");
    let fault = bench.until(2000, |record| record.decision.state == state::FAULT).expect("too hot");
    assert_eq!(fault.decision.cause, Some(Cause::DriverFault));
    let feedback = fault.feedback.expect("told");
    assert_eq!((feedback.fault, feedback.state), (fault_code::OVER_TEMPERATURE, driver_state::DISABLED));
    assert_eq!(bench.ask(Verb::Reset), Err(Cause::DriverFault));
    let cooled = |record: &CycleRecord| record.feedback.is_some_and(|feedback| feedback.fault == 0);
    assert!(bench.until(2000, cooled).is_some());
    assert_eq!(bench.cycle().decision.state, state::FAULT, "only a reset leaves a fault");
    assert!(bench.control_loop.hardware_mut().plant().is_currentless());
    bench.ask(Verb::Reset).expect("cooled");
    bench.ask(Verb::Arm).expect("cooled");
    let armed = bench.cycle();
    assert_eq!(armed.decision.state, state::ARMED);
    assert_eq!(armed.feedback.map(|feedback| feedback.state), Some(driver_state::DRIVEN));
}
