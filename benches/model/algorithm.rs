//! The exact pass against the paper's Algorithm 1, both sides in one run, for both sizes of the paper.

use divan::black_box;
use magsteer::config::Config;
use magsteer::control::{Algorithm1, Algorithm1Config, HeldPose, Present};
use magsteer::daemon::kernel::request_helper_realtime;
use magsteer::magnetics::CoilArray;
use magsteer::rod::{Pass, PassMode, ResidualDerivative, TipLoad};
use magsteer_hal::{Actuation, MAGNETS_MAX};

use crate::subjects::{ANGLES, CURRENTS, load};
use crate::turns::{Timed, mean, medians, timed};

const TURNS: usize = 300;
/// Of the threads that are timed.
const PRIORITY: u32 = 10;

/// Shipped files, and what the paper's authors report of their own program for as many parameters.
const RIGS: [(&str, &str); 2] = [
    ("bigmag-planar.toml", "158 ms with, 165 ms without the guess; 20 ms one problem"),
    ("bigmag-14.toml", "260 ms with, 420 ms without the guess"),
];

/// One way to go through Algorithm 1.
struct Variant {
    tolerance: f64,
    derivative: ResidualDerivative,
    guess: bool,
    threads: u32,
}

/// Prints a table for each rig, all of it under the loop's scheduling where that is permitted: what helps must not wait for a busy machine.
pub fn report() {
    let realtime = std::thread::spawn(|| {
        let granted = request_helper_realtime(PRIORITY);
        println!("\nThe Jacobians below run under {}, threads that help included.", granted.got);
        tables();
    });
    realtime.join().expect("what is timed does not fail");
}

fn tables() {
    for (file, paper) in RIGS {
        let config = load(file);
        let present = present(&config);
        let shipped = config.control.as_ref().and_then(|control| control.algorithm_1.clone());
        let shipped = shipped.expect("shipped");
        let mut names = vec!["exact: one pass".to_owned()];
        let mut calls = vec![exact(&config, &present)];
        let mut counts = vec![String::new()];
        for variant in Variant::all() {
            let (call, work) = algorithm_1(&config, &shipped, &present, &variant);
            names.push(variant.title());
            counts.push(work);
            calls.push(call);
        }
        let times = medians(&mut calls, TURNS);
        let parameters = config.description.coils.len() + config.description.frames.len();
        println!(
            "\n{:<66}{:>9}{:>9}  work",
            format!("Jacobian with {parameters} parameters, {file}"),
            "us",
            "of exact"
        );
        for ((name, time), count) in names.iter().zip(&times).zip(&counts) {
            println!("{name:<66}{:>9.2}{:>9.1}  {count}", time * 1e6, time / times[0]);
        }
        println!("For context, the paper, its own program and machine: {paper}.");
    }
}

impl Variant {
    /// Residuals to 1e-6, as loose as the columns bear, and to 1e-10, as every other solve of the shipped configuration.
    fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for tolerance in [1e-10, 1e-6] {
            for derivative in [ResidualDerivative::Differences, ResidualDerivative::Variational] {
                for threads in [1, 2] {
                    all.extend([true, false].map(|guess| Self { tolerance, derivative, guess, threads }));
                }
            }
        }
        all
    }

    fn title(&self) -> String {
        let derivative = match self.derivative {
            ResidualDerivative::Differences => "differences",
            ResidualDerivative::Variational => "variational",
        };
        let guess = if self.guess { "with" } else { "without" };
        let threads =
            if self.threads == 1 { "serial".to_owned() } else { format!("{} threads", self.threads) };
        format!("Algorithm 1, {derivative} to {:.0e}, {threads}, {guess} guess", self.tolerance)
    }
}

/// The rig under currents that bend it by tens of degrees.
fn present(config: &Config) -> Present {
    let manipulator = config.manipulator.as_ref().expect("has a model");
    let mut actuation = Actuation::default();
    actuation.current_a[..6].copy_from_slice(&CURRENTS);
    actuation.angle_rad[..2].copy_from_slice(&ANGLES);
    let posed = CoilArray::new(&config.description).posed(&ANGLES);
    let mut pass = Pass::new(manipulator);
    let field = posed.actuated(&CURRENTS);
    let found = manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
    assert!(found.converged(), "{found:?}");
    let mut poses = [HeldPose::default(); MAGNETS_MAX];
    for (pose, magnet) in poses.iter_mut().zip(pass.magnets()) {
        *pose = HeldPose { position: magnet.position(), rotation: magnet.rotation() };
    }
    Present { actuation, unknowns: pass.unknowns(), poses }
}

fn exact(config: &Config, present: &Present) -> Timed {
    let manipulator = config.manipulator.clone().expect("has a model");
    let posed = CoilArray::new(&config.description).posed(&ANGLES);
    let (mut pass, unknowns) = (Pass::new(&manipulator), present.unknowns);
    timed(move || {
        let field = black_box(&posed).actuated(black_box(&CURRENTS));
        manipulator.pass(&field, &TipLoad::NONE, black_box(&unknowns), PassMode::default(), &mut pass);
        black_box(&pass);
    })
}

/// A whole Jacobian a call, and in words what it takes.
fn algorithm_1(
    config: &Config,
    shipped: &Algorithm1Config,
    present: &Present,
    variant: &Variant,
) -> (Timed, String) {
    let parameters = config.description.coils.len() + config.description.frames.len();
    let chosen = Algorithm1Config {
        residual_tolerance: variant.tolerance,
        informed_guess: variant.guess,
        residual_derivative: variant.derivative,
        problems_per_cycle_max: parameters as u32 + 1,
        threads: variant.threads,
        ..shipped.clone()
    };
    let manipulator = config.manipulator.clone().expect("has a model");
    let mut algorithm = Algorithm1::new(&chosen, &config.description, manipulator);
    let pool = algorithm.start_workers(8 << 20).expect("threads are to be had");
    let progress = algorithm.advance(Some(present));
    assert!(progress.completed, "{progress:?}");
    let work = format!(
        "{} problems, {} iterations, {} sweeps",
        progress.problems, progress.iterations, progress.sweeps
    );
    let present = *present;
    let mut call = move || {
        black_box(algorithm.advance(Some(black_box(&present))));
    };
    let timed: Timed = match pool {
        // From within, as the daemon's loop does.
        Some(pool) => Box::new(move |calls| pool.install(|| mean(&mut call, calls))),
        None => timed(call),
    };
    (timed, work)
}
