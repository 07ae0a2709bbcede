//! Pointing two magnets in 3-D: what planner and loop reach. Prints tables; `cargo bench --bench pointing -- [COUNT] [CONE_DEG…] [FILE.toml…]`.
//!
//! Pairs of pointing targets are drawn uniformly in a cone about each magnet's rest direction, one pair after another. The planner leads
//! from each to the next through its model; the loop follows the way on the simulated plant, whose parameters are off as the
//! configuration says, and is judged by the plant's true poses.

use std::ops::ControlFlow;
use std::time::Instant;

use magsteer::control::Directions;
use magsteer::control::plan::{Plan, Planner, Standing, Waypoint, draw_targets};
use magsteer::daemon::lockstep::{PlayEnd, TimedTarget};
use magsteer::math::angle_between;
use nalgebra::Vector3;

#[path = "../../tests/rig_support/mod.rs"]
mod rig_support;

use rig_support::{Bench, Setup};

/// Of the targets: those of `magsteer plan --seed 7`.
const SEED: u64 = 7;
/// Time at a target after the reference has arrived, s.
const STAY: f64 = 2.0;
/// Time at a waypoint on the way after the reference has arrived, s.
const PASS: f64 = 0.5;
/// Speeds at which the time of a leg is reckoned: the frames' own, and a fraction of the magnets'.
const FRAME_SPEED: f64 = 45.0_f64.to_radians();
const MAGNET_SPEED: f64 = 50.0_f64.to_radians();
/// Greatest angle between truth and model at the end of a step of a rod that is where the model says, rad.
const SAME_BRANCH: f64 = 30.0_f64.to_radians();

fn main() {
    let numbers: Vec<f64> = std::env::args().skip(1).filter_map(|word| word.parse().ok()).collect();
    let (count, cones) = numbers.split_first().map_or((40, &[30.0, 60.0][..]), |(count, cones)| {
        (*count as usize, if cones.is_empty() { &[30.0, 60.0][..] } else { cones })
    });
    let named: Vec<String> = std::env::args().filter(|word| word.ends_with(".toml")).collect();
    let shipped = ["bigmag-3d.toml", "bigmag-14.toml"].map(str::to_owned);
    for name in if named.is_empty() { &shipped[..] } else { &named[..] } {
        let setup = Setup::shipped(name);
        for cone in cones {
            survey(name, &setup, *cone, count);
        }
    }
}

fn survey(name: &str, setup: &Setup, cone_deg: f64, count: usize) {
    let config = &setup.config;
    let control = config.control.as_ref().expect("has a controller");
    let manipulator = config.manipulator.clone().expect("has a model");
    let plan = control.plan.as_ref().expect("has a planner");
    let planner = Planner::new(plan, control, &config.description, manipulator);
    let rest = &planner.rest().posture.directions;
    let targets = draw_targets(rest, 2, cone_deg.to_radians(), count, SEED);
    let begin = Instant::now();
    let plans = planned(&planner, &targets);
    let planning = begin.elapsed().as_secs_f64() / count as f64;
    let reached = plans.iter().flatten().count();
    let played = play(setup, &planner, &plans, &targets);
    println!(
        "{name}, {cone_deg} deg: planned {reached} of {count} ({planning:.2} s each), in closed loop {} of {count}; \
         stopped {}, off the branch {}; {:.0} s",
        played.settled,
        played.stopped,
        played.astray,
        begin.elapsed().as_secs_f64()
    );
    for note in played.notes {
        println!("    {note}");
    }
}

/// A way to every target from the one reached before it.
fn planned(planner: &Planner, targets: &[Directions]) -> Vec<Option<Plan>> {
    let mut at = planner.rest().clone();
    let plan = |target| {
        let plan = planner.plan(&at, target).ok()?;
        at = plan.standing();
        Some(plan)
    };
    targets.iter().map(plan).collect()
}

/// What became of the ways on the plant.
#[derive(Default)]
struct Outcome {
    settled: usize,
    stopped: usize,
    astray: usize,
    notes: Vec<String>,
}

/// Plays plan after plan; where the loop stops, a new rig goes on from rest.
fn play(setup: &Setup, planner: &Planner, plans: &[Option<Plan>], targets: &[Directions]) -> Outcome {
    let mut outcome = Outcome::default();
    let mut next = 0;
    while next < plans.len() {
        let mut ways: Vec<(usize, Plan)> = plans
            .iter()
            .enumerate()
            .skip(next)
            .filter_map(|(index, plan)| Some((index, plan.clone()?)))
            .collect();
        let Some((index, first)) = ways.first_mut() else { break };
        // A new rig starts from rest, wherever the plan began.
        if next > 0 {
            match planner.from_rest(&targets[*index]) {
                Ok(plan) => *first = plan,
                Err(_) => {
                    next = *index + 1;
                    continue;
                }
            }
        }
        next = play_on(setup, planner.rest(), &ways, &mut outcome);
    }
    outcome
}

/// Plays ways on a new rig until the loop stops; the index of the target to go on with.
fn play_on(setup: &Setup, rest: &Standing, ways: &[(usize, Plan)], outcome: &mut Outcome) -> usize {
    let mut steps = Vec::new();
    let mut last_of = Vec::new();
    let rest = &rest.posture;
    let mut from = Waypoint { directions: rest.directions, frame_angles: rest.present.actuation.angle_rad };
    for (index, plan) in ways {
        for (leg, waypoint) in plan.waypoints.iter().enumerate() {
            let is_last = leg + 1 == plan.waypoints.len();
            let duration = travel(&from, waypoint) + if is_last { STAY } else { PASS };
            let duration = (duration * 1e3).ceil() * 1e-3;
            steps.push(TimedTarget { target: waypoint.target(), duration });
            last_of.push(is_last.then_some(*index));
            from = *waypoint;
        }
    }
    let mut bench = Bench::new(setup);
    let mut worst = vec![(0.0_f64, f64::INFINITY, 0.0_f64); steps.len()];
    let played = bench.lockstep.play(
        &steps,
        |rig| rig.plant().truth(),
        |seen| {
            if let Some(step) = seen.step {
                let (apart, margin, current) = &mut worst[step];
                *apart = seen.truth.magnets[..seen.truth.magnet_count as usize]
                    .iter()
                    .zip(&seen.record.outcome.predicted)
                    .map(|(magnet, predicted)| {
                        angle_between(&Vector3::from(magnet.tangent()), &Vector3::from(*predicted))
                    })
                    .fold(0.0, f64::max);
                *margin = margin.min(seen.record.outcome.model.margin);
                *current = seen
                    .record
                    .admitted
                    .current_a
                    .iter()
                    .fold(*current, |most, current| most.max(current.abs()));
            }
            ControlFlow::Continue(())
        },
    );
    for (step, (played, target)) in played.steps.iter().zip(&last_of).enumerate() {
        let Some(target) = target else { continue };
        let (apart, margin, current) = worst[step];
        if played.response.settled_s.is_some() {
            outcome.settled += 1;
        } else {
            outcome.notes.push(format!(
                "target {target}: RMS {:.2?} deg, model {:.1} deg off, margin {margin:.2}, current {current:.2} A, planned {:.2} A at margin {:.2}, swing {:.1} deg",
                played.response.error_rms_deg,
                apart.to_degrees(),
                ways.iter().find(|(index, _)| index == target).map_or(f64::NAN, |(_, plan)| plan.walked.current_max),
                ways.iter().find(|(index, _)| index == target).map_or(f64::NAN, |(_, plan)| plan.walked.margin_min),
                played.swing.to_degrees()
            ));
        }
        outcome.astray += usize::from(apart > SAME_BRANCH);
    }
    let ended = played.steps.len();
    if played.end == PlayEnd::Complete {
        return usize::MAX;
    }
    outcome.stopped += 1;
    let target =
        last_of[ended.saturating_sub(1)..].iter().flatten().next().copied().unwrap_or(usize::MAX - 1);
    outcome.notes.push(format!("target {target}: {:?}", played.end));
    target + 1
}

fn travel(from: &Waypoint, to: &Waypoint) -> f64 {
    let magnets = from.directions.iter().zip(&to.directions).take(2);
    let turn = magnets.map(|(from, to)| angle_between(&Vector3::from(*from), &Vector3::from(*to)));
    let frames = from.frame_angles.iter().zip(&to.frame_angles).map(|(from, to)| (to - from).abs());
    let slowest = turn.fold(0.0, f64::max) / MAGNET_SPEED;
    // Half a second to start and to stop.
    0.5 + slowest.max(frames.fold(0.0, f64::max) / FRAME_SPEED)
}
