//! Pointing two magnets in 3-D: what planner and loop reach. Prints tables;
//! `cargo bench --bench pointing -- [COUNT] [CONE_DEG…] [FILE.toml…] [seed=N…]`.
//!
//! Files are those of `config`, or named by an absolute path; each seed draws other targets, those of `magsteer plan --seed N`. Pairs of pointing targets are drawn uniformly in a cone about each magnet's
//! rest direction, one pair after another. The planner leads from each to the next through its model; the guide leads a loop from each to the
//! next on the simulated plant, whose parameters are off as the configuration says, and is judged by the plant's true poses.

use std::time::Instant;

use magsteer::control::Directions;
use magsteer::control::plan::{Planner, draw_targets};

#[path = "../../tests/rig_support/mod.rs"]
mod rig_support;

use rig_support::Setup;
use rig_support::lead::Lead;

/// Of the targets where none is named.
const SEED: u64 = 7;
const MAGNETS: usize = 2;

fn main() {
    let numbers: Vec<f64> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let (count, cones) = numbers.split_first().map_or((40, &[30.0, 60.0][..]), |(count, cones)| {
        (*count as usize, if cones.is_empty() { &[30.0, 60.0][..] } else { cones })
    });
    let named: Vec<String> = std::env::args().filter(|word| word.ends_with(".toml")).collect();
    let shipped = ["bigmag-3d.toml", "bigmag-14.toml"].map(str::to_owned);
    let seeds = std::env::args().filter_map(|word| word.strip_prefix("seed=")?.parse().ok());
    let mut seeds: Vec<u64> = seeds.collect();
    if seeds.is_empty() {
        seeds.push(SEED);
    }
    for name in if named.is_empty() { &shipped[..] } else { &named[..] } {
        let setup = Setup::shipped(name);
        for cone in cones {
            for seed in &seeds {
                survey(name, &setup, *cone, count, *seed);
            }
        }
    }
}

fn survey(name: &str, setup: &Setup, cone_deg: f64, count: usize, seed: u64) {
    let config = &setup.config;
    let control = config.control.as_ref().expect("has a controller");
    let manipulator = config.manipulator.clone().expect("has a model");
    let plan = control.plan.as_ref().expect("has a planner");
    let planner = Planner::new(plan, control, &config.description, manipulator);
    let rest = &planner.rest().posture.directions;
    let targets = draw_targets(rest, MAGNETS, cone_deg.to_radians(), count, seed);
    let begin = Instant::now();
    let planned = planned(&planner, &targets);
    let planning = begin.elapsed().as_secs_f64() / count as f64;
    let mut lead = Lead::new(setup, planner);
    let mut settled = 0;
    for (index, target) in targets.iter().enumerate() {
        let (has_settled, story) = lead.to(target);
        settled += usize::from(has_settled);
        if !story.is_empty() {
            println!(
                "    target {index} {}: {}",
                if has_settled { "settled" } else { "FAILED" },
                story.join("; ")
            );
        }
    }
    let Lead { at_first, released, stopped, snapped, slowest_order, .. } = lead;
    println!(
        "{name}, {cone_deg} deg, seed {seed}: planned {planned} of {count} ({planning:.2} s each); in closed loop {settled} of {count}, \
         {at_first} on the first way; released {released}, stopped {stopped}, snapped {snapped}; longest plan {slowest_order:.1} s; {:.0} s",
        begin.elapsed().as_secs_f64()
    );
}

/// How many targets the planner reaches, each from the last that it reached.
fn planned(planner: &Planner, targets: &[Directions]) -> usize {
    let mut at = planner.rest().clone();
    let mut reached = 0;
    for target in targets {
        if let Ok(plan) = planner.plan(&at, target) {
            at = plan.standing();
            reached += 1;
        }
    }
    reached
}
