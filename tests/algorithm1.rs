//! Algorithm 1 of the paper: its columns, its cost in iterations, its share of a cycle.
//!
//! Goal: each column is the difference of two rods under dead wrenches, as code of this test's own integrates them; smaller steps lead to the
//! frozen-wrench sensitivities of the pass; how the work is shared between cycles and threads changes no bit of it.

#[path = "exact_jacobian/dead_wrenches.rs"]
mod dead_wrenches;
#[path = "algorithm1/states.rs"]
mod states;

use dead_wrenches::Oracle;
use magsteer::control::{Algorithm1, Algorithm1Config, Present, Progress};
use magsteer::rod::{HeldOptions, HeldShape, Outcome, Pass, PassMode, ResidualDerivative, TipLoad, Wrenches};
use nalgebra::{DVector, Vector3, Vector6};
use rand::RngExt;
use states::{Rig, held_wrenches, seeded};

/// Everything in one cycle, to a residual near rounding.
fn thorough(rig: &Rig) -> Algorithm1Config {
    Algorithm1Config {
        residual_tolerance: 1e-11,
        iterations_max: 100,
        problems_per_cycle_max: rig.parameters() as u32 + 1,
        ..rig.algorithm_1.clone()
    }
}

fn algorithm(rig: &Rig, config: &Algorithm1Config) -> Algorithm1 {
    Algorithm1::new(config, &rig.description, rig.manipulator.clone())
}

/// The Jacobian at `present` in one call.
fn complete(algorithm: &mut Algorithm1, present: &Present) -> Progress {
    let progress = algorithm.advance(Some(present));
    assert!(progress.completed, "{progress:?}");
    progress
}

/// Difference of all magnets' tangents over the step of a parameter.
fn column(algorithm: &Algorithm1, magnets: usize, parameter: usize) -> DVector<f64> {
    let turned = |magnet| algorithm.stepped_tangent(magnet, parameter) - algorithm.tangent(magnet);
    stacked((0..magnets).map(turned)) / algorithm.step(parameter)
}

fn stacked(vectors: impl Iterator<Item = Vector3<f64>>) -> DVector<f64> {
    DVector::from_vec(vectors.flat_map(|vector| [vector.x, vector.y, vector.z]).collect())
}

#[test]
fn every_column_is_the_difference_of_two_dead_wrench_rods() {
    let rig = Rig::shipped(0.5);
    let mut random = seeded(1);
    let mut oracle = Oracle::new(&rig.description, 0.5e-3);
    let mut worst = 0.0_f64;
    for derivative in [ResidualDerivative::Differences, ResidualDerivative::Variational] {
        let config = Algorithm1Config { residual_derivative: derivative, ..thorough(&rig) };
        let mut algorithm = algorithm(&rig, &config);
        for _ in 0..4 {
            let (present, pass) = rig.equilibrium(3.0, &mut random);
            complete(&mut algorithm, &present);
            let magnets = pass.magnets().len();
            for parameter in 0..rig.parameters() {
                let stepped = rig.steered(&present.actuation, parameter, algorithm.step(parameter));
                let wrenches = rig.with_field(&stepped, |field| held_wrenches(&rig, &pass, field));
                let there = oracle.tangents(&wrenches, &present.unknowns);
                let here = stacked(pass.magnets().iter().map(|magnet| magnet.tangent()));
                let expected = (there - here) / algorithm.step(parameter);
                let found = column(&algorithm, magnets, parameter);
                worst = worst.max((found - &expected).norm() / expected.norm());
            }
        }
    }
    println!("columns against dead-wrench rods: {worst:.1e}");
    // Both integrate by Runge-Kutta with steps of 0.5 mm, a fiftieth of a section.
    assert!(worst < 1e-6, "{worst}");
}

/// Goal: the columns tend to the frozen-wrench sensitivities of the pass, in proportion to the step.
#[test]
fn small_steps_lead_to_the_frozen_wrench_sensitivities() {
    let rig = Rig::shipped(2.0);
    let mut random = seeded(2);
    let mut pass = Pass::new(&rig.manipulator);
    for _ in 0..5 {
        let (present, _) = rig.equilibrium(3.0, &mut random);
        let frozen = PassMode { poses: false, wrenches: Wrenches::Frozen };
        rig.with_field(&present.actuation, |field| {
            rig.manipulator.pass(field, &TipLoad::NONE, &present.unknowns, frozen, &mut pass);
        });
        let magnets = pass.magnets().len();
        let limit = |parameter: usize| {
            let tangents = (0..magnets).map(|magnet| {
                let rows = pass.tangent_jacobian(magnet);
                Vector3::new(rows[0][parameter], rows[1][parameter], rows[2][parameter])
            });
            stacked(tangents)
        };
        let off = |share: f64| {
            let config = thorough(&rig);
            let config = Algorithm1Config {
                current_step_a: share * config.current_step_a,
                angle_step_deg: share * config.angle_step_deg,
                ..config
            };
            let mut algorithm = algorithm(&rig, &config);
            complete(&mut algorithm, &present);
            let columns = (0..rig.parameters()).map(|parameter| {
                (column(&algorithm, magnets, parameter) - limit(parameter)).norm() / limit(parameter).norm()
            });
            columns.fold(0.0, f64::max)
        };
        let [whole, tenth, hundredth] = [1.0, 0.1, 0.01].map(off);
        println!("worst column off the limit: {whole:.1e}, {tenth:.1e}, {hundredth:.1e}");
        // First order in the step: a tenth of it leaves a tenth, but for what the second order did to the larger step.
        assert!((0.05..0.2).contains(&(hundredth / tenth)), "{tenth} {hundredth}");
        assert!(hundredth < 1e-2 && hundredth < whole, "{whole} {hundredth}");
    }
}

/// Goal: the guess (14) changes no column; with moderate pulls it saves iterations. With strong ones, where what moves meets another arm of
/// lever and another restoring weight, it does not, and none is claimed.
#[test]
fn the_informed_guess_saves_iterations_and_changes_no_column() {
    let rig = Rig::shipped(2.0);
    let configs = [true, false].map(|informed_guess| Algorithm1Config { informed_guess, ..thorough(&rig) });
    let [mut with, mut without] = configs.map(|config| algorithm(&rig, &config));
    for (current_max, saves) in [(0.5, true), (1.0, true), (2.0, true), (3.0, false)] {
        let mut random = seeded(3);
        let (mut iterations, mut sweeps, mut worst) = ([0, 0], [0, 0], 0.0_f64);
        for _ in 0..20 {
            let (present, pass) = rig.equilibrium(current_max, &mut random);
            for (index, algorithm) in [&mut with, &mut without].into_iter().enumerate() {
                let progress = complete(algorithm, &present);
                iterations[index] += progress.iterations;
                sweeps[index] += progress.sweeps;
            }
            let magnets = pass.magnets().len();
            for parameter in 0..rig.parameters() {
                let [guessed, plain] = [&with, &without].map(|it| column(it, magnets, parameter));
                worst = worst.max((guessed - &plain).norm() / plain.norm());
            }
        }
        println!(
            "to {current_max} A, with and without: {iterations:?} iterations, {sweeps:?} sweeps; {worst:.1e} apart"
        );
        // Residuals of 1e-11 over a step of 0.2 A, times the amplification of shooting.
        assert!(worst < 1e-7, "{worst}");
        assert!(!saves || (iterations[0] < iterations[1] && sweeps[0] < sweeps[1]));
    }
}

/// Goal: threads change nothing.
#[test]
fn in_parallel_every_bit_is_as_in_series() {
    let rig = Rig::shipped(2.0);
    for derivative in [ResidualDerivative::Differences, ResidualDerivative::Variational] {
        let mut random = seeded(4);
        let config = Algorithm1Config { residual_derivative: derivative, ..thorough(&rig) };
        let mut serial = algorithm(&rig, &config);
        assert!(
            serial.start_workers(1 << 20).expect("nothing to start").is_none(),
            "one thread is the caller"
        );
        let mut parallel = [2, 3].map(|threads| {
            let mut parallel = algorithm(&rig, &Algorithm1Config { threads, ..config.clone() });
            let pool = parallel.start_workers(1 << 20).expect("threads are to be had").expect("asked for");
            assert_eq!(pool.current_num_threads(), threads as usize);
            (parallel, pool)
        });
        for _ in 0..10 {
            let (present, pass) = rig.equilibrium(3.0, &mut random);
            let progress = complete(&mut serial, &present);
            for (parallel, pool) in &mut parallel {
                // From within, as the loop does, and from outside.
                for within in [true, false] {
                    let found = if within {
                        pool.install(|| complete(parallel, &present))
                    } else {
                        complete(parallel, &present)
                    };
                    assert_eq!(found, progress);
                    for parameter in 0..rig.parameters() {
                        for magnet in 0..pass.magnets().len() {
                            let of = |algorithm: &Algorithm1| algorithm.stepped_tangent(magnet, parameter);
                            assert_eq!(of(parallel).map(f64::to_bits), of(&serial).map(f64::to_bits));
                        }
                    }
                }
            }
        }
    }
}

/// Goal: a Jacobian spread over cycles is the one of the shape it was begun at, whatever became of the rod meanwhile; its age says so.
#[test]
fn spread_over_cycles_it_is_the_jacobian_of_where_it_began() {
    let rig = Rig::shipped(2.0);
    let mut random = seeded(5);
    let (begun, pass) = rig.equilibrium(3.0, &mut random);
    let (later, _) = rig.equilibrium(3.0, &mut random);
    let mut whole = algorithm(&rig, &thorough(&rig));
    complete(&mut whole, &begun);
    for per_cycle in 1..=rig.parameters() as u32 + 1 {
        let config =
            Algorithm1Config { problems_per_cycle_max: per_cycle, age_max_cycles: 12, ..thorough(&rig) };
        let mut spread = algorithm(&rig, &config);
        let cycles = (rig.parameters() as u32 + 1).div_ceil(per_cycle);
        for cycle in 1..=cycles {
            let present = if cycle == 1 { &begun } else { &later };
            assert_eq!(spread.age(), None);
            let progress = spread.advance(Some(present));
            assert!(progress.problems <= per_cycle, "{progress:?}");
            assert_eq!(progress.completed, cycle == cycles);
        }
        assert_eq!(spread.age(), Some(cycles - 1));
        for parameter in 0..rig.parameters() {
            let columns = [&whole, &spread].map(|it| column(it, pass.magnets().len(), parameter));
            assert_eq!(columns[0], columns[1]);
        }
        // Nothing present any more: the last one stays, and grows too old.
        for age in cycles..=12 {
            assert!(spread.is_fresh());
            assert_eq!(spread.advance(None), Progress::default());
            assert_eq!(spread.age(), Some(age));
        }
        spread.advance(None);
        assert!(!spread.is_fresh());
    }
}

/// Goal: a problem that is given up takes its Jacobian with it, and the next one is begun.
#[test]
fn a_problem_given_up_discards_its_jacobian_alone() {
    let rig = Rig::shipped(2.0);
    let mut random = seeded(6);
    let (present, pass) = rig.equilibrium(3.0, &mut random);
    let mut algorithm = algorithm(&rig, &thorough(&rig));
    complete(&mut algorithm, &present);
    let kept = column(&algorithm, pass.magnets().len(), 0);
    let mut absurd = present;
    absurd.actuation.current_a[0] = 1e9;
    let failed = algorithm.advance(Some(&absurd));
    assert!(failed.failed && !failed.completed, "{failed:?}");
    absurd.actuation.current_a[0] = f64::NAN;
    let failed = algorithm.advance(Some(&absurd));
    assert!(failed.failed && !failed.completed, "{failed:?}");
    assert_eq!(algorithm.age(), Some(2));
    assert_eq!(column(&algorithm, pass.magnets().len(), 0), kept);
    complete(&mut algorithm, &present);
    assert_eq!(algorithm.age(), Some(0));
}

/// Goal: from a poor guess Levenberg-Marquardt comes to the equilibrium, or says within its bound that it did not.
#[test]
fn from_a_poor_guess_it_converges_or_says_so_within_its_bound() {
    let rig = Rig::shipped(2.0);
    let mut random = seeded(7);
    let (force_unit, moment_unit) = rig.manipulator.residual_units();
    let (mut found, mut given_up, mut same) = (0, 0, 0);
    for case in 0..300 {
        let (present, pass) = rig.equilibrium(3.0, &mut random);
        let wrenches = rig.with_field(&present.actuation, |field| states::wrenches(&rig, &pass, field));
        let size = [0.3, 3.0, 30.0][case % 3];
        let mut guess = present.unknowns;
        for (row, entry) in guess.iter_mut().enumerate() {
            *entry += size * random.random_range(-1.0..1.0) * if row < 3 { force_unit } else { moment_unit };
        }
        let options = HeldOptions {
            residual_tolerance: 1e-9,
            iterations_max: 60,
            damping_start: 1e-4,
            derivative: [ResidualDerivative::Differences, ResidualDerivative::Variational][case % 2],
        };
        let mut shape = HeldShape::default();
        let solution = rig.manipulator.solve_held(&wrenches, &guess, &options, &mut shape);
        assert!(solution.iterations <= options.iterations_max);
        match solution.outcome {
            Outcome::Converged => {
                found += 1;
                assert!(solution.residual <= options.residual_tolerance);
                let scaled =
                    (shape.unknowns - present.unknowns).component_div(&Vector6::from_fn(|row, _| {
                        if row < 3 { force_unit } else { moment_unit }
                    }));
                same += u32::from(scaled.norm() < 1e-6);
            }
            Outcome::NotConverged { .. } => {
                given_up += 1;
                // What is left behind is no worse than the guess.
                assert!(!solution.residual.is_nan());
            }
        }
    }
    println!(
        "{found} found, {same} of them the equilibrium that the guess was made from; {given_up} given up"
    );
    assert!(found > 150 && same > 100, "{found} {same}");
    assert!(given_up > 0, "the bound must be met by some of these guesses");
}
