//! Goal: with Algorithm 1 a cycle allocates nothing either: not alone, and not with threads that help, as long as the loop runs inside of
//! their pool. From outside each cycle is handed over through a queue that does allocate, now and then.
//!
//! Method: a global allocator counts in every thread, while told to. One test alone in this file, so that no other thread allocates.

mod counting_allocator;

use std::f64::consts::FRAC_1_SQRT_2;
use std::path::Path;

use counting_allocator::allocations_everywhere;
use magsteer::config::Config;
use magsteer::control::{Cycle, CycleInput, Directions, JacobianKind, PoseSource, Step};
use magsteer_hal::{Actuation, MagnetPose, PoseMessage};

const CYCLES: u32 = 2_000;

/// Currents that wander, so that problems differ and some fail.
fn input(cycle: u32) -> CycleInput {
    let mut measured = Actuation::default();
    let phase = f64::from(cycle) * 2e-3;
    for (index, current) in measured.current_a[..6].iter_mut().enumerate() {
        *current = 2.0 * (phase * (1.0 + 0.1 * index as f64)).sin();
    }
    if cycle % 500 > 480 {
        // An actuation that leaps: no model, and a Jacobian that grows old.
        measured.current_a[0] = 1e6;
    }
    let pose = MagnetPose {
        orientation_xyzw: [0.0, FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2],
        valid: 1,
        ..MagnetPose::default()
    };
    let mut poses = PoseMessage { magnet_count: 2, magnets: [pose; 8], ..PoseMessage::default() };
    (poses.magnets[0].position_m, poses.magnets[1].position_m) =
        ([-0.0275, 0.0, -0.002], [0.0025, 0.0, -0.01]);
    let mut target = Directions::default();
    (target[0], target[1]) = ([0.0, 0.0, 1.0], [0.6, 0.0, 0.8]);
    CycleInput {
        period: 1e-3,
        pose: Some(poses),
        pose_is_fresh: cycle.is_multiple_of(5),
        pose_age: 5e-3,
        measured,
        admitted: measured,
        target: target.into(),
        engaged: cycle % 100 > 10,
    }
}

fn steps(cycle: &mut Cycle, from: u32, to: u32) -> u32 {
    (from..to).map(|number| u32::from(cycle.step(&input(number)).model.converged)).sum()
}

#[test]
fn a_cycle_with_algorithm_1_allocates_nothing() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/bigmag-planar.toml");
    let (_, config) = Config::load(&path).expect("shipped");
    let manipulator = config.manipulator.expect("shipped");
    let mut control = config.control.expect("shipped");
    control.jacobian = JacobianKind::Algorithm1;
    for (threads, poses) in [
        (1, PoseSource::Modelled),
        (1, PoseSource::Measured),
        (2, PoseSource::Modelled),
        (4, PoseSource::Modelled),
    ] {
        let algorithm_1 = control.algorithm_1.as_mut().expect("shipped");
        (algorithm_1.threads, algorithm_1.magnet_poses) = (threads, poses);
        algorithm_1.problems_per_cycle_max = 9;
        let mut cycle = Cycle::new(&control, &config.description, manipulator.clone());
        let pool = cycle.start_workers(1 << 20).expect("threads are to be had");
        let mut run = |pool_entered: bool| {
            // The first cycles register each thread with the queues.
            let mut converged = steps(&mut cycle, 0, 200);
            let counted = allocations_everywhere(|| converged += steps(&mut cycle, 200, CYCLES));
            println!(
                "{threads} threads, {poses:?}, inside the pool: {pool_entered}: {counted} allocations in {CYCLES} cycles, {converged} converged"
            );
            assert!((CYCLES / 2..CYCLES).contains(&converged), "{converged}");
            counted
        };
        let Some(pool) = pool else {
            assert_eq!(run(false), 0);
            continue;
        };
        assert_eq!(pool.install(|| run(true)), 0);
        // Said, and not forbidden: nobody runs the loop like this.
        let outside = run(false);
        assert!(outside < u64::from(CYCLES), "less than one a cycle: {outside}");
    }
}
