//! Inputs of the control cycle as they were in a closed loop with the simulated rig.

use std::ops::ControlFlow;
use std::sync::LazyLock;
use std::time::Instant;

use magsteer::control::{Cycle, CycleInput, FrameUse, MarginGuardConfig, ReferenceTarget, Step, Verdict};
use magsteer::daemon::Verb;
use magsteer_hal::MAGNETS_MAX;

use crate::rig_support::{Bench, Setup};

/// Targets in the x-z plane, degrees from x, of base and tip magnet, 0.4 s each: the reference never comes to rest.
const TARGETS_DEG: [[f64; 2]; 6] =
    [[30.0, 45.0], [45.0, 90.0], [20.0, -20.0], [-30.0, -60.0], [0.0, 40.0], [40.0, 10.0]];
const TARGET_LASTS: f64 = 0.4;

/// Consecutive cycles of one closed loop.
pub struct Recording {
    setup: Setup,
    /// Before steering: the model comes to the equilibrium from which it steers.
    idle: Vec<CycleInput>,
    /// Every cycle engaged.
    pub steering: Vec<CycleInput>,
}

/// One closed loop in the plane.
pub static RECORDING: LazyLock<Recording> = LazyLock::new(|| Recording::take("bigmag-planar.toml", None));

impl Recording {
    fn take(config: &str, guard: Option<MarginGuardConfig>) -> Self {
        let mut setup = Setup::shipped(config);
        setup.config.control.as_mut().expect("has a controller").margin_guard = guard;
        let control = setup.config.control.as_ref().expect("has a controller");
        let steered = control.frame_angles == FrameUse::Steer;
        // A way is looked at ahead where it is told how the frames stand.
        let frame_angles = steered.then(|| control.resting_frames(&setup.config.description));
        let mut lockstep = Bench::new(&setup).lockstep;
        let mut inputs = Vec::new();
        let mut run = |verb: Option<Verb>, seconds: f64| {
            verb.into_iter().for_each(|verb| lockstep.request(verb).expect("one request a cycle"));
            let _ = lockstep.run(seconds, |record, _| {
                inputs.push(record.input);
                ControlFlow::Continue(())
            });
        };
        run(None, 0.3);
        run(Some(Verb::Arm), 0.3);
        run(Some(Verb::Go), 0.1);
        for angles in TARGETS_DEG {
            let target = ReferenceTarget { directions: directions(angles), frame_angles };
            run(Some(Verb::SetTarget(target)), TARGET_LASTS);
        }
        let start = inputs.iter().position(|input| input.engaged).expect("the loop steers");
        let steering = inputs.split_off(start);
        assert!(steering.iter().all(|input| input.engaged), "the loop steers to the end");
        Self { setup, idle: inputs, steering }
    }

    /// A controller about to steer.
    pub fn controller(&self) -> Cycle {
        let config = &self.setup.config;
        let control = config.control.as_ref().expect("has a controller");
        let manipulator = config.manipulator.clone().expect("has a model");
        let mut cycle = Cycle::new(control, &config.description, manipulator);
        for input in &self.idle {
            cycle.step(input);
        }
        cycle
    }

    /// What the slowest steps take, with a scout ahead and without, and how many passes the model spends.
    fn report(&self) {
        let mut cycle = self.controller();
        let (mut times, mut scouting) = (Vec::with_capacity(self.steering.len()), Vec::new());
        let (mut passes, mut unconverged, mut saturated) = (0, 0, 0);
        for input in &self.steering {
            let start = Instant::now();
            let outcome = cycle.step(input);
            let time = start.elapsed().as_secs_f64();
            if outcome.verdict == Verdict::Checking { &mut scouting } else { &mut times }.push(time);
            passes += outcome.model.passes;
            unconverged += u32::from(!outcome.model.converged);
            saturated += u32::from(outcome.saturated > 2);
        }
        println!(
            "{:.2} passes a step and one beside; {unconverged} steps without convergence, {saturated} with a coil at a limit.",
            f64::from(passes) / self.steering.len() as f64,
        );
        for (what, times) in [("steering", &mut times), ("steering with a scout under way", &mut scouting)] {
            let count = times.len();
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[((count - 1) as f64 * share) as usize] * 1e6;
            println!(
                "{count} steps one by one, {what}: median {:.1} us, 99 % {:.1} us, longest {:.1} us.",
                at(0.5),
                at(0.99),
                at(1.0),
            );
        }
    }
}

/// Every step by itself, in the plane, and in 3-D, where the margin is guarded.
pub fn report() {
    println!("In the plane:");
    RECORDING.report();
    println!("In 3-D, the margin guarded:");
    let guard = MarginGuardConfig { floor: 0.1, rate_per_s: 10.0 };
    Recording::take("bigmag-3d.toml", Some(guard)).report();
}

fn directions(angles_deg: [f64; 2]) -> [[f64; 3]; MAGNETS_MAX] {
    let mut directions = [[0.0; 3]; MAGNETS_MAX];
    for (direction, angle) in directions.iter_mut().zip(angles_deg) {
        let (sine, cosine) = angle.to_radians().sin_cos();
        *direction = [cosine, 0.0, sine];
    }
    directions
}
