//! The daemon's loop with its real controller against the simulated rig in lockstep.
#![allow(dead_code, reason = "every test file compiles its own copy and uses a part of it")]

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use magsteer::config::{Config, Document, Experiment, ExperimentStep};
use magsteer::control::{Cycle, Directions};
use magsteer::daemon::lockstep::{Lockstep, PlayEnd, TimedTarget};
use magsteer::daemon::step_response::StepResponse;
use magsteer::daemon::{CycleRecord, Verb};
use magsteer_hal::HardwareDescription;
use magsteer_hal::fault::{FaultPlanConfig, Injector, Reach};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};

pub mod lead;

/// A configuration of the rig and its plant.
pub struct Setup {
    pub config: Config,
    pub plant: PlantConfig,
    /// What the plant is built as, before its errors.
    pub nominal: HardwareDescription,
}

impl Setup {
    /// A shipped file.
    pub fn shipped(name: &str) -> Self {
        let (document, config) = Config::load(&shipped_path(name)).expect("shipped");
        let plant = document.section::<PlantConfig>("plant").expect("shipped");
        let nominal = config.nominal(&document).expect("shipped");
        Self { config, plant, nominal }
    }

    /// The same with another seed of the plant.
    pub fn seeded(mut self, seed: u64) -> Self {
        self.plant.seed = seed;
        self
    }
}

fn shipped_path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config").join(name)
}

/// A loop that steers a simulated rig under stepped time.
pub struct Bench {
    config: Config,
    pub lockstep: Lockstep<SimulatedRig, Cycle>,
}

impl Bench {
    pub fn new(setup: &Setup) -> Self {
        Self::with_faults(setup, None)
    }

    /// With a fault plan as its file has it; times count from the first cycle.
    pub fn with_faults(setup: &Setup, plan: Option<&str>) -> Self {
        let config = setup.config.clone();
        let rig = &config.description;
        let plant = setup.plant.build_as(rig, &setup.nominal).expect("shipped");
        let manipulator = config.manipulator.clone().expect("has a model");
        let control = config.control.clone().expect("has a controller");
        let daemon = config.daemon.clone().expect("has a daemon");
        let cycle = Cycle::new(&control, rig, manipulator);
        let mut hardware = SimulatedRig::new(plant, rig);
        if let Some(plan) = plan {
            let document =
                Document::from_text("plan.toml", plan).unwrap_or_else(|problems| panic!("{problems}"));
            let plan: FaultPlanConfig = document.read().unwrap_or_else(|problems| panic!("{problems}"));
            let plan = plan.build(rig, Reach::Plant).unwrap_or_else(|refused| panic!("{refused:?}"));
            hardware.allow_faults(Injector::new(rig, &plan, setup.plant.seed));
        }
        let lockstep = Lockstep::new(hardware, cycle, rig, &daemon);
        Self { lockstep, config }
    }

    /// Runs cycles for a time.
    pub fn run(&mut self, seconds: f64, mut look: impl FnMut(&CycleRecord, &SimulatedRig)) {
        let flow = self.lockstep.run(seconds, |record, rig| {
            look(record, rig);
            ControlFlow::Continue(())
        });
        assert!(flow.is_continue());
    }

    /// Asks for something in the next cycle.
    pub fn request(&mut self, verb: Verb) {
        self.lockstep.request(verb).expect("one request a cycle");
    }

    /// Commands that broke a limit, as the plant counts them.
    pub fn limit_breaks(&mut self) -> u64 {
        self.lockstep.control_loop().hardware().plant().feedback().limit_breaks
    }

    /// Arms, steers through a shipped experiment and judges every step by the plant's truth.
    pub fn play_shipped(&mut self, name: &str) -> Vec<StepResponse> {
        let rig = &self.config.description;
        let path = shipped_path("experiments").join(name);
        let experiment =
            Experiment::from_document(&Document::load(&path).expect("shipped"), rig).expect("shipped");
        let target = |step: &ExperimentStep| TimedTarget {
            target: experiment.target(step, rig),
            duration: step.duration_s,
        };
        let steps: Vec<TimedTarget> = experiment.steps.iter().map(target).collect();
        self.play(&steps)
    }

    /// The same through targets in the x-z plane, deg from z, each for a time in seconds.
    pub fn play_planar(&mut self, targets_deg: &[[f64; 2]], duration_s: f64) -> Vec<StepResponse> {
        let target = |angles: &[f64; 2]| TimedTarget {
            target: directions_planar(*angles).into(),
            duration: duration_s,
        };
        let steps: Vec<TimedTarget> = targets_deg.iter().map(target).collect();
        self.play(&steps)
    }

    fn play(&mut self, steps: &[TimedTarget]) -> Vec<StepResponse> {
        let truth = |rig: &SimulatedRig| rig.plant().truth();
        let played = self.lockstep.play(steps, truth, |_| ControlFlow::Continue(()));
        assert_eq!(played.end, PlayEnd::Complete, "the loop steers to the end");
        played.steps.into_iter().map(|step| step.response).collect()
    }
}

/// Directions in the x-z plane, deg from z.
pub fn directions_planar(angles_deg: [f64; 2]) -> Directions {
    let mut directions = Directions::default();
    for (direction, angle) in directions.iter_mut().zip(angles_deg) {
        *direction = [angle.to_radians().sin(), 0.0, angle.to_radians().cos()];
    }
    directions
}

/// Prints how each step went.
pub fn report(name: &str, steps: &[StepResponse]) {
    for step in steps {
        println!(
            "{name}: {:?} settled {:?} mean {:.2?} rms {:.2?} current {:.2}",
            step.target_deg.iter().map(|angle| angle.round()).collect::<Vec<_>>(),
            step.settled_s,
            step.error_mean_deg,
            step.error_rms_deg,
            step.current_max_a
        );
    }
}
