//! The daemon's loop with its real controller against the simulated rig in lockstep.

use std::path::{Path, PathBuf};
use std::time::Duration;

use magsteer::config::{Config, Document, Experiment};
use magsteer::control::{Cycle, Directions};
use magsteer::daemon::step_response::{Observation, StepResponse, judge};
use magsteer::daemon::{ControlLoop, CycleRecord, LoopOptions, Request, State, Tick, Verb};
use magsteer_hal::Stamp;
use magsteer_hal::fault::{FaultPlanConfig, Injector, Reach};
use magsteer_sim_plant::{PlantConfig, SimulatedRig};

/// A configuration of the rig and its plant.
pub struct Setup {
    pub config: Config,
    pub plant: PlantConfig,
}

impl Setup {
    /// A shipped file.
    pub fn shipped(name: &str) -> Self {
        let (document, config) = Config::load(&shipped_path(name)).expect("shipped");
        let plant = document.section::<PlantConfig>("plant").expect("shipped");
        Self { config, plant }
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
    control_loop: ControlLoop<SimulatedRig, Cycle>,
    tick: Tick,
    period: Duration,
    requests: u32,
}

impl Bench {
    pub fn new(setup: &Setup) -> Self {
        Self::with_faults(setup, None)
    }

    /// With a fault plan as its file has it; times count from the first cycle.
    pub fn with_faults(setup: &Setup, plan: Option<&str>) -> Self {
        let config = setup.config.clone();
        let rig = &config.description;
        let plant = setup.plant.build(rig).expect("shipped");
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
        let control_loop = ControlLoop::new(hardware, cycle, rig, &daemon, LoopOptions::default());
        // Any moment but zero, which the transport takes for "no stamp".
        let tick = Tick::first(Stamp::from_nanoseconds(1_000_000_000));
        Self { control_loop, tick, period: daemon.period(), requests: 0, config }
    }

    /// Runs one cycle.
    pub fn cycle(&mut self) -> CycleRecord {
        let record = self.control_loop.cycle(self.tick);
        self.tick = self.tick.stepped(self.period);
        record
    }

    /// Runs cycles for a time.
    pub fn run(&mut self, seconds: f64, mut look: impl FnMut(&CycleRecord, &SimulatedRig)) {
        let cycles = (seconds / self.period.as_secs_f64()).round() as u64;
        for _ in 0..cycles {
            let record = self.cycle();
            look(&record, self.control_loop.hardware_mut());
        }
    }

    /// Asks for something in the next cycle.
    pub fn request(&mut self, verb: Verb) {
        self.requests += 1;
        self.control_loop.request(Request { id: self.requests, verb }).expect("one request a cycle");
    }

    /// The rig, for its truth, its counts and its faults.
    pub fn rig(&mut self) -> &mut SimulatedRig {
        self.control_loop.hardware_mut()
    }

    /// Present state of the daemon.
    pub fn state(&self) -> &State {
        self.control_loop.state()
    }

    /// Time of the next cycle.
    pub fn now(&self) -> Stamp {
        self.tick.now
    }

    /// Commands that broke a limit, as the plant counts them.
    pub fn limit_breaks(&mut self) -> u64 {
        self.control_loop.hardware_mut().plant().feedback().limit_breaks
    }

    /// Arms, steers through a shipped experiment and judges every step by the plant's truth.
    pub fn play_shipped(&mut self, name: &str) -> Vec<StepResponse> {
        let names: Vec<String> =
            self.config.description.magnets().map(|magnet| magnet.name.clone()).collect();
        let magnets: Vec<&str> = names.iter().map(String::as_str).collect();
        let path = shipped_path("experiments").join(name);
        let experiment =
            Experiment::from_document(&Document::load(&path).expect("shipped"), &magnets).expect("shipped");
        let steps = experiment.steps.iter();
        let steps = steps.map(|step| (experiment.directions(step, &magnets), step.duration_s)).collect();
        self.play(steps)
    }

    /// The same through targets in the x-z plane, deg from z, each for a time in seconds.
    pub fn play_planar(&mut self, targets_deg: &[[f64; 2]], duration_s: f64) -> Vec<StepResponse> {
        let directions = |angles: &[f64; 2]| {
            let mut directions = Directions::default();
            for (direction, angle) in directions.iter_mut().zip(angles) {
                *direction = [angle.to_radians().sin(), 0.0, angle.to_radians().cos()];
            }
            (directions, duration_s)
        };
        self.play(targets_deg.iter().map(directions).collect())
    }

    fn play(&mut self, steps: Vec<(Directions, f64)>) -> Vec<StepResponse> {
        self.run(0.5, |_, _| ());
        self.request(Verb::Arm);
        self.run(0.5, |_, _| ());
        self.request(Verb::Go);
        self.run(0.1, |_, _| ());
        let magnets = self.config.description.magnets().count();
        let mut responses = Vec::new();
        for (target, duration_s) in steps {
            self.request(Verb::SetTarget(target));
            let mut observations = Vec::new();
            let period = self.period.as_secs_f64();
            self.run(duration_s, |record, rig| {
                let tangent = rig.plant().truth().magnets.map(|magnet| magnet.tangent());
                let currents = record.input.measured.current_a;
                let current = currents.iter().fold(0.0_f64, |most, current| most.max(current.abs()));
                let time = observations.len() as f64 * period;
                observations.push(Observation { time, tangent, current });
            });
            responses.push(judge(&target[..magnets], &observations));
        }
        responses
    }
}
