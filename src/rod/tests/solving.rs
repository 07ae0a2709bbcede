//! Outcomes: what converges does so within bounds, and what does not says why.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::PartDescription;
use nalgebra::{Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::fixtures::{
    Dipoles, HORIZONTAL, UPRIGHT, build, default_two_magnets, description, magnet, options,
    reference_two_magnets, section, tip_load, uniform, unit_cantilever,
};
use crate::magnetics::{AppliedField, FieldSample};
use crate::rod::{Failure, Outcome, Pass, PassMode, RodConfig, Scaled, TipLoad};

fn heavy(gamma: f64) -> HardwareDescription {
    let mut part = section(1.0, 1.0, 1.0);
    part.mass_per_length = gamma;
    description(HORIZONTAL, [0.0, 0.0, -1.0], vec![PartDescription::Section(part)])
}

#[test]
fn a_warm_start_needs_a_pass_or_two_after_a_small_change() {
    let manipulator = build(&default_two_magnets(), 25e-3 / 8.0);
    let mut pass = Pass::new(&manipulator);
    let mut field = uniform(Vector3::new(1e-3, 0.0, 5e-3));
    let mode = PassMode::default();
    assert!(manipulator.solve_from_rest(&field, &TipLoad::NONE, mode, &mut pass).converged());
    field.field.z += 1e-5;
    let guess = pass.unknowns();
    let solution = manipulator.solve(&field, &TipLoad::NONE, &guess, mode, &mut pass);
    assert!(solution.converged() && solution.iterations <= 3 && solution.passes <= 4, "{solution:?}");
    // One pass and its Newton step alone bring the controller within a second-order error.
    let exact = pass.unknowns();
    manipulator.pass(&field, &TipLoad::NONE, &guess, mode, &mut pass);
    let predicted = guess + pass.newton_step().expect("regular");
    assert!((predicted - exact).norm() < 1e-3 * (guess - exact).norm());
}

#[test]
fn solves_are_bounded_and_say_that_iterations_ran_out() {
    let config = RodConfig { iterations_max: 1, ..options(0.02) };
    let manipulator = config.build(&heavy(10.0)).expect("valid");
    let mut pass = Pass::new(&manipulator);
    let field = uniform(Vector3::zeros());
    let start = Vector6::zeros();
    let solution = manipulator.solve(&field, &TipLoad::NONE, &start, PassMode::default(), &mut pass);
    assert_eq!(solution.outcome, Outcome::NotConverged { why: Failure::IterationsExhausted });
    assert_eq!(solution.iterations, 1);
    assert!(solution.residual > 1e-3);

    let config = RodConfig { passes_max: 3, iterations_max: 2, ..options(0.02) };
    let manipulator = config.build(&heavy(10.0)).expect("valid");
    let solution = manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
    assert_eq!(solution.outcome, Outcome::NotConverged { why: Failure::IterationsExhausted });
    assert!(solution.load_reached[0] < 1.0 && solution.passes < 20, "{solution:?}");
}

#[test]
fn guesses_loads_and_fields_that_are_no_numbers_are_named() {
    let manipulator = unit_cantilever(10);
    let mut pass = Pass::new(&manipulator);
    let expected = Outcome::NotConverged { why: Failure::NotFinite };
    let mode = PassMode::default();
    let none = uniform(Vector3::zeros());
    let guess = Vector6::repeat(f64::NAN);
    assert_eq!(manipulator.solve(&none, &TipLoad::NONE, &guess, mode, &mut pass).outcome, expected);
    let load = tip_load([f64::INFINITY, 0.0, 0.0], [0.0; 3]);
    assert_eq!(manipulator.solve(&none, &load, &Vector6::zeros(), mode, &mut pass).outcome, expected);
    let rod = build(&default_two_magnets(), 3e-3);
    let mut pass = Pass::new(&rod);
    let wrong = uniform(Vector3::repeat(f64::NAN));
    let solution = rod.solve_from_rest(&wrong, &TipLoad::NONE, mode, &mut pass);
    assert_eq!(solution.outcome, expected);
    assert_eq!(solution.load_reached[1], 0.0);
    // What is left behind is usable: gravity alone.
    assert!(pass.unknowns().iter().all(|entry| entry.is_finite()));
}

#[test]
fn a_singular_jacobian_is_an_outcome() {
    // At beta = 1 exactly the straight rod buckles; a side load keeps the residual from being zero there.
    let parts = vec![PartDescription::Section(section(1.0, 1.0, 1.0)), magnet(1e-12, 0.0, [0.0, 0.0, 1.0])];
    let manipulator = build(&description(UPRIGHT, [0.0; 3], parts), 1.0);
    let mut pass = Pass::new(&manipulator);
    let field = uniform(Vector3::new(0.0, 0.0, -1.0));
    let load = tip_load([0.0; 3], [0.0, 1e-3, 0.0]);
    let solution = manipulator.solve(&field, &load, &Vector6::zeros(), PassMode::default(), &mut pass);
    assert_eq!(solution.outcome, Outcome::NotConverged { why: Failure::SingularJacobian }, "{solution:?}");
    assert_eq!(pass.determinant(), 0.0);
    assert_eq!(pass.newton_step(), None);
}

#[test]
fn a_nearly_straight_rod_is_followed_around_its_buckling_load() {
    let manipulator = unit_cantilever(20);
    let mut pass = Pass::new(&manipulator);
    let none = uniform(Vector3::zeros());
    for side in [1e-2, 1e-3, 1e-5] {
        let load = tip_load([side, 0.0, -4.0], [0.0; 3]);
        let solution = manipulator.solve_from_rest(&none, &load, PassMode::default(), &mut pass);
        assert!(solution.converged() && !solution.lost_stability, "{solution:?}");
        // The branch connected to rest bends far away towards the side load; the straight one is unstable.
        assert!(pass.tip_tangent().x > 0.9, "{}", pass.tip_tangent());
        assert!(pass.determinant() > 0.0);
    }
}

#[test]
fn an_exactly_straight_rod_beyond_its_buckling_load_is_reported_as_unstable() {
    let manipulator = unit_cantilever(20);
    let mut pass = Pass::new(&manipulator);
    let none = uniform(Vector3::zeros());
    for (force, unstable) in [(-2.4, false), (-2.6, true), (-10.0, true)] {
        let load = tip_load([0.0, 0.0, force], [0.0; 3]);
        let solution = manipulator.solve_from_rest(&none, &load, PassMode::default(), &mut pass);
        assert!(solution.converged(), "{solution:?}");
        assert_eq!(solution.lost_stability, unstable, "{force}");
        assert_eq!(pass.tip_tangent(), Vector3::z());
    }
}

#[test]
fn a_fold_stops_the_continuation_with_the_load_that_was_reached() {
    // Strong dipoles nearby make the rod snap towards them: no equilibrium is near beyond the snap.
    let manipulator = build(&reference_two_magnets([1.0, -1.0]), 2e-3);
    let mut pass = Pass::new(&manipulator);
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let (mut folds, mut found) = (0, 0);
    for _ in 0..60 {
        let field = Dipoles::random(6, &mut random);
        let solution = manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
        match solution.outcome {
            Outcome::Converged => {
                found += 1;
                assert_eq!(solution.load_reached, [1.0, 1.0]);
            }
            Outcome::NotConverged { why } => {
                folds += 1;
                assert_eq!(why, Failure::Stalled);
                assert!(solution.load_reached[1] > 0.0 && solution.load_reached[1] < 1.0);
                // The last equilibrium on the way is left behind, and it is about to lose its stability.
                assert!(pass.determinant().abs() < 0.05, "{}", pass.determinant());
                let field = Scaled { field: &field, factor: solution.load_reached[1] };
                let unknowns = pass.unknowns();
                manipulator.pass(&field, &TipLoad::NONE, &unknowns, PassMode::default(), &mut pass);
                assert!(pass.residual() < 1e-11, "{}", pass.residual());
            }
        }
    }
    assert!(folds > 3 && found > 30, "{folds} folds, {found} equilibria");
}

#[test]
fn equilibria_from_rest_do_not_depend_on_how_finely_loads_are_raised() {
    let rod = default_two_magnets();
    let coarse = build(&rod, 3.125e-3);
    let fine = RodConfig { rotation_step_max_deg: 2.0, ..options(3.125e-3) }.build(&rod).expect("valid");
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let (mut a, mut b) = (Pass::new(&coarse), Pass::new(&fine));
    for _ in 0..20 {
        let field = uniform(Vector3::from_fn(|_, _| random.random_range(-15e-3..15e-3)));
        let by_large = coarse.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut a);
        let by_small = fine.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut b);
        assert!(by_large.converged() && by_small.converged());
        assert!(by_small.passes > by_large.passes);
        assert!((a.tip_position() - b.tip_position()).norm() < 1e-10);
    }
}

#[test]
fn a_scaled_field_is_scaled_in_every_part() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let field = Dipoles::random(3, &mut random);
    let (mut whole, mut part) = (FieldSample::default(), FieldSample::default());
    let point = Vector3::new(0.01, -0.02, 0.005);
    field.evaluate(&point, &mut whole);
    Scaled { field: &field, factor: 0.25 }.evaluate(&point, &mut part);
    assert_eq!(part.field * 4.0, whole.field);
    assert_eq!(part.gradient.matrix() * 4.0, whole.gradient.matrix());
    let moment = Vector3::new(1.0, 2.0, 3.0);
    let (a, b) = (part.second_gradient.contract(&moment), whole.second_gradient.contract(&moment));
    assert!((a.matrix() * 4.0 - b.matrix()).norm() < 1e-12 * b.matrix().norm());
    for (a, b) in part.columns.iter().zip(&whole.columns).take(3) {
        assert_eq!((a.field * 4.0, a.gradient.xz * 4.0), (b.field, b.gradient.xz));
    }
}

#[test]
fn configurations_out_of_range_are_refused_by_key() {
    let rod = default_two_magnets();
    let good = options(3e-3);
    let wrong = [
        (RodConfig { segment_length_max_mm: 0.0, ..good }, "rod.segment_length_max_mm"),
        (RodConfig { segment_length_max_mm: f64::NAN, ..good }, "rod.segment_length_max_mm"),
        (RodConfig { segment_length_max_mm: 1e-6, ..good }, "rod.segment_length_max_mm"),
        (RodConfig { residual_tolerance: 0.0, ..good }, "rod.residual_tolerance"),
        (RodConfig { iterations_max: 0, ..good }, "rod.iterations_max"),
        (RodConfig { rotation_step_max_deg: 180.0, ..good }, "rod.rotation_step_max_deg"),
        (RodConfig { passes_max: 0, ..good }, "rod.passes_max"),
    ];
    for (config, key) in wrong {
        let refused = config.build(&rod).expect_err("out of range");
        assert!(refused.iter().any(|invalid| invalid.key == key), "{refused:?}");
    }
    let mut rigid = rod.clone();
    rigid.manipulator.parts.retain(|part| matches!(part, PartDescription::Magnet(_)));
    assert!(good.build(&rigid).is_err());
    assert!(good.build(&rod).is_ok());
}
