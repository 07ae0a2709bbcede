//! How fast the rod alone runs, and how many iterations its steps take, driven as in `pace`.
//!
//! `cargo run --release -p magsteer-sim-plant --example rod_pace`
//!
//! The same run is made several times, and of each part of it the fastest counts: a shared machine only adds.

#[path = "../src/fixture.rs"]
mod fixture;

use std::time::{Duration, Instant};

use magsteer_sim_plant::field::{CoilArray, Field};
use magsteer_sim_plant::rod::{Meshing, Rod, Stepping};

/// Steps of one run, in parts of so many.
const STEPS: u32 = 10_000;
const PART: u32 = 100;
const RUNS: usize = 8;

/// What one run took and found.
struct Run {
    parts: Vec<Duration>,
    iterations: usize,
    missing_percent: f64,
}

fn run(amplitude: f64, element_mm: f64, step: f64) -> Run {
    let description = fixture::bigmag();
    let meshing = Meshing { element_length_max: element_mm * 1e-3 };
    let undamped = Stepping { step, retardation: 0.0 };
    let mut rod = Rod::new(&description.manipulator, description.gravity, meshing, undamped);
    rod.set_magnet_interaction(true);
    assert!(rod.settle(|_| Field::zero()));
    let mode = rod.first_mode().expect("has mass");
    rod.set_stepping(Stepping { step, retardation: mode.retardation(0.2) });
    let start_energy = rod.energy().total();
    let mut array = CoilArray::as_described(&description);
    let mut run = Run { parts: Vec::new(), iterations: 0, missing_percent: 0.0 };
    for part in 0..STEPS / PART {
        let start = Instant::now();
        for index in 0..PART {
            let time = f64::from(part * PART + index) * step;
            let mut currents = [0.0; 6];
            for (coil, current) in currents.iter_mut().enumerate() {
                *current = amplitude * (time * (3.0 + coil as f64)).sin();
            }
            array.actuate(&currents, &[0.0, 0.0]);
            let solve = rod.step(|point| array.at(point));
            assert!(solve.converged);
            run.iterations += solve.iterations;
        }
        run.parts.push(start.elapsed());
    }
    let ledger = rod.ledger();
    let missing = ledger.coils - ledger.lost() - (rod.energy().total() - start_energy);
    run.missing_percent = 100.0 * missing / ledger.coils;
    run
}

fn main() {
    println!("amplitude_a  element_mm  step_us  us/step  iterations/step  missing_percent");
    for (amplitude, element_mm, step_us) in [
        (0.8, 2.5, 500),
        (3.0, 2.5, 500),
        (0.8, 5.0, 500),
        (0.8, 1.25, 500),
        (0.8, 2.5, 1000),
        (0.8, 2.5, 250),
    ] {
        let runs: Vec<Run> =
            (0..RUNS).map(|_| run(amplitude, element_mm, f64::from(step_us) * 1e-6)).collect();
        let fastest = |part: usize| runs.iter().map(|run| run.parts[part]).min().unwrap_or_default();
        let total: Duration = (0..runs[0].parts.len()).map(fastest).sum();
        println!(
            "{amplitude:>11}  {element_mm:>10}  {step_us:>7}  {:>7.2}  {:>15.2}  {:>15.4}",
            total.as_secs_f64() * 1e6 / f64::from(STEPS),
            runs[0].iterations as f64 / f64::from(STEPS),
            runs[0].missing_percent
        );
    }
}
