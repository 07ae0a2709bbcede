//! The second variation against closed forms, against the determinant's sign, and against itself in other
//! frames and units.

use std::f64::consts::PI;
use std::path::Path;

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{ExtensibleStiffness, PartDescription};
use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::fixtures::{
    Dipoles, UPRIGHT, build, default_two_magnets, description, magnet, reference_two_magnets, section,
    tip_load, uniform, unit_cantilever,
};
use crate::magnetics::{AffineField, AppliedField, FieldGradient};
use crate::rod::{Manipulator, Pass, PassMode, Stability, TipLoad};

fn limit(name: &str) -> f64 {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/rod_cases.json");
    let text = std::fs::read_to_string(path).expect("reference data");
    let cases: Value = serde_json::from_str(&text).expect("reference JSON");
    cases["stability"][name].as_str().expect("a number").parse().expect("a number")
}

fn no_field() -> AffineField {
    uniform(Vector3::zeros())
}

/// Field against the rod's axis.
fn against(beta: f64) -> AffineField {
    uniform(Vector3::new(0.0, 0.0, -beta))
}

/// The stability of the upright straight rod that passes `force` on to its clamp.
fn straight(manipulator: &Manipulator, field: &AffineField, tip_force: f64, force: f64) -> Stability {
    let mut pass = Pass::new(manipulator);
    let load = tip_load([0.0, 0.0, tip_force], [0.0; 3]);
    let mut unknowns = Vector6::zeros();
    unknowns[2] = force;
    manipulator.pass(field, &load, &unknowns, PassMode::default(), &mut pass);
    assert!(pass.residual() < 1e-13 * (1.0 + force.abs()), "a straight rod is in equilibrium");
    manipulator.stability(&mut pass)
}

/// The load between `low` and `high` at which the margin vanishes, by bisection. Both bending planes buckle
/// there at once.
fn critical(stability: impl Fn(f64) -> Stability, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    assert_eq!(stability(low).unstable_modes, 0);
    assert_eq!(stability(high).unstable_modes, 2);
    for _ in 0..60 {
        let load = 0.5 * (low + high);
        let Stability { unstable_modes, margin } = stability(load);
        assert_eq!(unstable_modes == 0, margin > 0.0, "{margin}");
        if margin > 0.0 { low = load } else { high = load }
    }
    0.5 * (low + high)
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected} within {tolerance}");
}

fn self_weight_column(weight: f64) -> Manipulator {
    let mut part = section(1.0, 1.0, 1.0);
    part.mass_per_length = weight;
    build(&description(UPRIGHT, [0.0, 0.0, -1.0], vec![PartDescription::Section(part)]), 0.01)
}

#[test]
fn the_margin_vanishes_at_the_known_limits_of_stability() {
    let column = unit_cantilever(100);
    let expected = limit("euler_cantilever_Pcr_L2_over_EI");
    let found = critical(|force| straight(&column, &no_field(), -force, -force), 1.0, 4.0);
    close(found, expected, 1e-6 * expected);

    let point = || magnet(1e-9, 0.0, [0.0, 0.0, 1.0]);
    let tip = vec![PartDescription::Section(section(1.0, 1.0, 1.0)), point()];
    let tip = build(&description(UPRIGHT, [0.0; 3], tip), 0.01);
    let expected = limit("antiparallel_tip_magnet_beta_cr");
    close(critical(|beta| straight(&tip, &against(beta), 0.0, 0.0), 0.5, 2.0), expected, 1e-6 * expected);

    let half = || PartDescription::Section(section(0.5, 1.0, 1.0));
    let two = build(&description(UPRIGHT, [0.0; 3], vec![half(), point(), half(), point()]), 0.01);
    let expected = limit("two_equal_magnets_beta_cr");
    close(critical(|beta| straight(&two, &against(beta), 0.0, 0.0), 0.4, 1.5), expected, 1e-6 * expected);

    let expected = limit("self_weight_column_wL3_over_EI_cr");
    let heavy = |weight| straight(&self_weight_column(weight), &no_field(), 0.0, -weight);
    close(critical(heavy, 5.0, 10.0), expected, 1e-6 * expected);
}

/// Goal: shear and stretch take part. `theta'' + P (1 - P/EA + P/GA) theta / EI = 0`, clamped and free.
#[test]
fn the_margin_of_an_extensible_column_vanishes_at_its_own_load() {
    let (shear, axial) = (8.0, 30.0);
    let mut part = section(1.0, 1.0, 0.8);
    part.extensible = Some(ExtensibleStiffness { shear, axial });
    let column = build(&description(UPRIGHT, [0.0; 3], vec![PartDescription::Section(part)]), 0.01);
    let found = critical(|force| straight(&column, &no_field(), -force, -force), 1.0, 4.0);
    let softening: f64 = 1.0 / shear - 1.0 / axial;
    let expected = ((1.0 + softening * PI * PI).sqrt() - 1.0) / (2.0 * softening);
    close(found, expected, 1e-6 * expected);
    assert!(expected < 0.85 * PI * PI / 4.0, "far from Euler's load: {expected}");
}

/// Goal: of a straight column the margin is the share of Euler's load that is left, linear through zero; each
/// further load of Euler adds a mode in each plane.
#[test]
fn a_straight_column_loses_its_margin_linearly_and_gains_modes_at_eulers_loads() {
    let euler = PI * PI / 4.0;
    let column = unit_cantilever(200);
    for share in [1e-3, 0.5, 0.999, 0.999_999, 1.000_001, 1.001, 3.0, 8.9, 9.1, 24.9, 25.1, 48.9, 49.1] {
        let found = straight(&column, &no_field(), -share * euler, -share * euler);
        close(found.margin, 1.0 - share, 2e-9 * share.max(1.0));
        let modes = (1..).step_by(2).take_while(|odd| f64::from(odd * odd) < share).count();
        assert_eq!(found.unstable_modes as usize, 2 * modes, "{share}");
    }
    // A pull stiffens: no deformation is easier than without it.
    assert_eq!(straight(&column, &no_field(), 50.0, 50.0), Stability { unstable_modes: 0, margin: 1.0 });
}

/// Goal: with the shipped mesh a section is one span; the limit is found to 3e-6 all the same.
#[test]
fn one_span_of_a_section_finds_eulers_load() {
    let column = unit_cantilever(13);
    let found = critical(|force| straight(&column, &no_field(), -force, -force), 1.0, 4.0);
    close(found, PI * PI / 4.0, 3e-6 * found);
}

#[test]
fn an_unloaded_rod_has_the_margin_one_curved_or_not() {
    let mut part = section(1.0, 1.0, 0.7);
    part.precurvature = [0.4, 2.0, -1.0];
    let curved = build(&description(UPRIGHT, [0.0; 3], vec![PartDescription::Section(part)]), 0.05);
    let mut rig = reference_two_magnets([1.0, -1.0]);
    rig.gravity = [0.0; 3];
    for manipulator in [curved, build(&rig, 2e-3)] {
        let found = straight(&manipulator, &no_field(), 0.0, 0.0);
        assert_eq!(found.unstable_modes, 0);
        close(found.margin, 1.0, 1e-12);
    }
}

#[test]
fn a_state_that_is_not_finite_has_no_margin() {
    let manipulator = build(&default_two_magnets(), 2e-3);
    let mut pass = Pass::new(&manipulator);
    for unknowns in [Vector6::repeat(f64::NAN), Vector6::repeat(f64::INFINITY)] {
        manipulator.pass(&no_field(), &TipLoad::NONE, &unknowns, PassMode::default(), &mut pass);
        let found = manipulator.stability(&mut pass);
        assert!(found.margin.is_nan() && found.unstable_modes > 0, "{found:?}");
    }
    // The next equilibrium is judged as if nothing had been.
    manipulator.solve_from_rest(&no_field(), &TipLoad::NONE, PassMode::default(), &mut pass);
    let mut fresh = Pass::new(&manipulator);
    manipulator.solve_from_rest(&no_field(), &TipLoad::NONE, PassMode::default(), &mut fresh);
    assert_eq!(manipulator.stability(&mut pass), manipulator.stability(&mut fresh));
}

/// An equilibrium that Newton's iteration finds from unknowns that are far from it: of any branch, stable or
/// not.
fn some_equilibrium(
    manipulator: &Manipulator,
    field: &impl AppliedField,
    random: &mut ChaCha8Rng,
    pass: &mut Pass,
) -> bool {
    let (force, moment) = manipulator.residual_units();
    let guess = Vector6::from_fn(|i, _| if i < 3 { force } else { moment } * random.random_range(-6.0..6.0));
    manipulator.solve(field, &TipLoad::NONE, &guess, PassMode::default(), pass).converged()
}

/// Goal: with every mode that an equilibrium loses the determinant of shooting, computed otherwise, changes
/// its sign.
#[test]
fn the_determinants_sign_tells_an_even_number_of_unstable_modes() {
    let mut seen = [0; 8];
    for (rod, mesh) in [(default_two_magnets(), 2e-3), (reference_two_magnets([1.0, 1.0]), 1e-3)] {
        let manipulator = build(&rod, mesh);
        let mut random = ChaCha8Rng::seed_from_u64(8);
        let mut pass = Pass::new(&manipulator);
        for _ in 0..400 {
            let field = Dipoles::random(6, &mut random);
            if !some_equilibrium(&manipulator, &field, &mut random, &mut pass) {
                continue;
            }
            let found = manipulator.stability(&mut pass);
            let modes = found.unstable_modes as usize;
            assert_eq!(
                modes.is_multiple_of(2),
                pass.determinant() > 0.0,
                "{found:?}, {}",
                pass.determinant()
            );
            assert_eq!(modes == 0, found.margin > 0.0, "{found:?}");
            seen[modes.min(7)] += 1;
        }
    }
    assert!(seen[..3].iter().all(|count| *count > 30), "of every sort some: {seen:?}");
}

/// Goal: the determinant of shooting is the product of all eigenvalues of the second variation, the two being
/// computed in ways that share but the state at the parts' ends. The product of finitely many errs by the
/// first order in the spans' length, of which one extrapolation leaves the second.
#[test]
fn the_determinant_is_the_product_of_all_eigenvalues() {
    for (rod, field) in [
        (default_two_magnets(), uniform(Vector3::new(1e-3, 4e-3, 6e-3))),
        (reference_two_magnets([1.0, -1.0]), affine()),
        (reference_two_magnets([1.0, 1.0]), affine()),
    ] {
        let [coarse, fine] = [0.25e-3, 0.125e-3].map(|mesh| {
            let manipulator = build(&rod, mesh);
            let mut pass = Pass::new(&manipulator);
            let solution =
                manipulator.solve_from_rest(&field, &TipLoad::NONE, PassMode::default(), &mut pass);
            assert!(solution.converged());
            manipulator.stability(&mut pass);
            (pass.determinant(), pass.chain.eigenvalue_product())
        });
        let extrapolated = 2.0 * fine.1 - coarse.1;
        assert!((fine.0 - 1.0).abs() > 0.1, "the field matters: {fine:?}");
        close(extrapolated, fine.0, 3e-3 * fine.0);
        assert!((fine.1 / fine.0 - 1.0).abs() < 0.6 * (coarse.1 / coarse.0 - 1.0).abs());
    }
}

fn affine() -> AffineField {
    AffineField {
        field: Vector3::new(2e-3, -3e-3, 6e-3),
        gradient: FieldGradient { xx: 0.05, xy: 0.1, xz: -0.15, yy: 0.02, yz: 0.08 },
    }
}

fn at_rest(rod: &HardwareDescription, mesh: f64, field: &AffineField) -> Stability {
    let manipulator = build(rod, mesh);
    let mut pass = Pass::new(&manipulator);
    let solution = manipulator.solve_from_rest(field, &TipLoad::NONE, PassMode::default(), &mut pass);
    assert!(solution.converged(), "{solution:?}");
    manipulator.stability(&mut pass)
}

#[test]
fn rotating_the_world_changes_nothing() {
    let rod = reference_two_magnets([1.0, -1.0]);
    let turn: Matrix3<f64> = *Rotation3::from_scaled_axis(Vector3::new(0.4, -1.1, 0.7)).matrix();
    let mut turned = rod.clone();
    let base = turn * Matrix3::from_fn(|i, j| rod.manipulator.base_rotation[i][j]);
    turned.manipulator.base_rotation = core::array::from_fn(|i| core::array::from_fn(|j| base[(i, j)]));
    turned.gravity = (turn * Vector3::from(rod.gravity)).into();
    let g = turn * affine().gradient.matrix() * turn.transpose();
    let gradient =
        FieldGradient { xx: g[(0, 0)], xy: g[(0, 1)], xz: g[(0, 2)], yy: g[(1, 1)], yz: g[(1, 2)] };
    let here = at_rest(&rod, 2e-3, &affine());
    let there = at_rest(&turned, 2e-3, &AffineField { field: turn * affine().field, gradient });
    assert!(here.margin < 0.9, "the field matters: {here:?}");
    close(there.margin, here.margin, 1e-9);
}

/// Goal: the margin has no unit. Lengths in units of 1 mm and forces of 1 uN, with the second as unit of
/// time.
#[test]
fn other_units_change_nothing() {
    let rod = reference_two_magnets([1.0, -1.0]);
    let (length, force) = (1e2, 1e6);
    let mut scaled = rod.clone();
    for part in &mut scaled.manipulator.parts {
        match part {
            PartDescription::Section(section) => {
                section.length *= length;
                section.bending_stiffness *= force * length * length;
                section.torsion_stiffness *= force * length * length;
                section.mass_per_length *= force / length / length;
                section.extensible = section.extensible.map(|stiffness| ExtensibleStiffness {
                    shear: stiffness.shear * force,
                    axial: stiffness.axial * force,
                });
            }
            PartDescription::Magnet(magnet) => {
                magnet.length *= length;
                magnet.mass *= force / length;
                // The tesla stays: the moment is in newton metres per tesla.
                magnet.moment_body = magnet.moment_body.map(|moment| moment * force * length);
            }
        }
    }
    scaled.gravity = scaled.gravity.map(|component| component * length);
    let mut field = affine();
    field.gradient = field.gradient * (1.0 / length);
    close(at_rest(&scaled, 2e-3 * length, &field).margin, at_rest(&rod, 2e-3, &affine()).margin, 1e-9);
}

#[test]
fn an_extensible_rod_of_huge_stiffness_has_the_margin_of_a_kirchhoff_rod() {
    let with = |stiffness: Option<f64>| {
        let mut rod = reference_two_magnets([1.0, -1.0]);
        for part in &mut rod.manipulator.parts {
            if let PartDescription::Section(section) = part {
                section.extensible = stiffness.map(|shear| ExtensibleStiffness { shear, axial: 2.0 * shear });
            }
        }
        at_rest(&rod, 2e-3, &affine()).margin
    };
    let kirchhoff = with(None);
    close(with(Some(1e6)), kirchhoff, 1e-6);
    assert!((with(Some(0.5)) - kirchhoff).abs() > 1e-4, "shear has an effect");
}

/// Goal: the search that starts from the last mode ends where one without memory ends, also when another mode
/// has become the weakest.
#[test]
fn the_last_mode_does_not_bias_the_next_search() {
    let manipulator = build(&default_two_magnets(), 2e-3);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut pass = Pass::new(&manipulator);
    let mut worst = 0.0_f64;
    for _ in 0..300 {
        let field = Dipoles::random(6, &mut random);
        if !some_equilibrium(&manipulator, &field, &mut random, &mut pass) {
            continue;
        }
        let biased = manipulator.stability(&mut pass);
        let mut fresh = Pass::new(&manipulator);
        let unknowns = pass.unknowns();
        manipulator.pass(&field, &TipLoad::NONE, &unknowns, PassMode::default(), &mut fresh);
        let plain = manipulator.stability(&mut fresh);
        assert_eq!(biased.unstable_modes, plain.unstable_modes);
        worst = worst.max((biased.margin - plain.margin).abs() / (1.0 + plain.margin.abs()));
    }
    println!("margins with and without memory: {worst:.1e} apart");
    assert!(worst < 1e-6, "{worst}");
}
