//! Derivatives: every Jacobian against differences of full re-solves, on fine and coarse meshes.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::PartDescription;
use nalgebra::{Matrix3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::fixtures::{
    Dipoles, POSES, build, default_two_magnets, mixed_chain, polish, reference_two_magnets, rotation_between,
    tip_load,
};
use crate::magnetics::{AffineField, AppliedField, FieldGradient, FieldSample};
use crate::rod::{Manipulator, Pass, PassMode, TipLoad, Wrenches};

const FROZEN: PassMode = PassMode { poses: true, wrenches: Wrenches::Frozen };

/// A field whose parameters a test can change.
trait Steerable: AppliedField + Clone {
    fn steer(&mut self, parameter: usize, by: f64);
}

impl Steerable for AffineField {
    fn steer(&mut self, parameter: usize, by: f64) {
        let g = &mut self.gradient;
        let b = &mut self.field;
        *match parameter {
            0 => &mut b.x,
            1 => &mut b.y,
            2 => &mut b.z,
            3 => &mut g.xx,
            4 => &mut g.xy,
            5 => &mut g.xz,
            6 => &mut g.yy,
            _ => &mut g.yz,
        } += by;
    }
}

impl Steerable for Dipoles {
    fn steer(&mut self, parameter: usize, by: f64) {
        self.strengths[parameter] += by;
    }
}

fn affine(scale: f64, random: &mut ChaCha8Rng) -> AffineField {
    let mut entry = |size: f64| random.random_range(-size..size) * scale;
    AffineField {
        field: Vector3::new(entry(6e-3), entry(6e-3), entry(6e-3)),
        gradient: FieldGradient {
            xx: entry(0.1),
            xy: entry(0.1),
            xz: entry(0.1),
            yy: entry(0.1),
            yz: entry(0.1),
        },
    }
}

/// A step of a parameter that turns the magnets by about 7e-5 rad: truncation and rounding of a difference of fourth
/// order then stay below 1e-7, close to folds too.
fn step(pass: &Pass, parameter: usize) -> f64 {
    let turn = |magnet| {
        let rows = pass.rotation_jacobian(magnet).expect("asked for");
        Vector3::from_fn(|i, _| rows[i][parameter]).norm()
    };
    7e-5 / (0..pass.magnets().len()).map(turn).fold(0.0, f64::max)
}

/// Tangent, rotation vector and position rows of all magnets with one parameter, by a central
/// difference of fourth order between full re-solves.
fn difference<F: Steerable>(
    manipulator: &Manipulator,
    field: &F,
    load: &TipLoad,
    parameter: usize,
    at: &Pass,
    scratch: &mut Pass,
) -> Vec<[Vector3<f64>; 3]> {
    let step = step(at, parameter);
    let mut sums = vec![[Vector3::zeros(); 3]; at.magnets().len()];
    for (offset, weight) in [(-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0)] {
        let mut steered = field.clone();
        steered.steer(parameter, offset * step);
        let solution = manipulator.solve(&steered, load, &at.unknowns(), PassMode::default(), scratch);
        assert!(solution.converged(), "{solution:?}");
        polish(manipulator, &steered, load, scratch);
        for (sum, (there, here)) in sums.iter_mut().zip(scratch.magnets().iter().zip(at.magnets())) {
            let weight = weight / step;
            sum[0] += there.tangent() * weight;
            sum[1] += rotation_between(&here.rotation(), &there.rotation()) * weight;
            sum[2] += there.position() * weight;
        }
    }
    sums
}

/// Greatest deviation of the Jacobians from differences, each block relative to its greatest entry.
fn deviation<F: Steerable>(manipulator: &Manipulator, field: &F, load: &TipLoad, pass: &Pass) -> f64 {
    let mut scratch = Pass::new(manipulator);
    let (mut worst, mut scale) = ([0.0_f64; 3], [0.0_f64; 3]);
    for parameter in 0..field.parameter_count() {
        let differences = difference(manipulator, field, load, parameter, pass, &mut scratch);
        // Columns of different units: compare in units of a change of the parameter by its step.
        let unit = step(pass, parameter);
        for (magnet, expected) in differences.iter().enumerate() {
            let blocks = [
                pass.tangent_jacobian(magnet),
                pass.rotation_jacobian(magnet).expect("asked for"),
                pass.position_jacobian(magnet).expect("asked for"),
            ];
            for (block, (rows, expected)) in blocks.iter().zip(expected).enumerate() {
                let found = Vector3::from_fn(|i, _| rows[i][parameter]);
                worst[block] = worst[block].max((found - expected).norm() * unit);
                scale[block] = scale[block].max(expected.norm() * unit);
            }
        }
    }
    (0..3).map(|block| worst[block] / scale[block]).fold(0.0, f64::max)
}

/// Checks random equilibria of one rod in random fields of one kind. Returns the greatest deviation.
fn check<F: Steerable>(
    rod: &HardwareDescription,
    mesh: f64,
    count: usize,
    seed: u64,
    make: impl Fn(&mut ChaCha8Rng) -> F,
) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let manipulator = build(rod, mesh);
    let mut pass = Pass::new(&manipulator);
    let (mut worst, mut checked, mut turned) = (0.0_f64, 0, 0.0_f64);
    while checked < count {
        let field = make(&mut random);
        let mut entry = |size: f64| random.random_range(-size..size);
        let load = tip_load([entry(1e-3), entry(1e-3), entry(1e-3)], [entry(1e-5), entry(1e-5), entry(1e-5)]);
        let solution = manipulator.solve_from_rest(&field, &load, POSES, &mut pass);
        // Near a fold the derivative itself is without bound, and no difference can follow; where the pull is
        // so strong that the determinant is huge, differences drown in the rounding that shooting amplifies.
        let regular = (0.05..1e4).contains(&pass.determinant());
        if !solution.converged() || solution.lost_stability || !regular {
            continue;
        }
        checked += 1;
        polish(&manipulator, &field, &load, &mut pass);
        turned = turned.max(1.0 - pass.tip_tangent().x);
        worst = worst.max(deviation(&manipulator, &field, &load, &pass));
    }
    assert!(turned > 0.3, "the equilibria are far from straight: {turned}");
    worst
}

#[test]
fn jacobian_equals_differences_of_full_solves_in_affine_fields() {
    let worst = check(&reference_two_magnets([1.0, -1.0]), 1e-3, 50, 11, |random| affine(1.0, random));
    assert!(worst < 1e-6, "{worst}");
    let worst = check(&default_two_magnets(), 25e-3 / 8.0, 50, 12, |random| affine(3.0, random));
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn jacobian_equals_differences_of_full_solves_in_strongly_non_uniform_fields() {
    let dipoles = |random: &mut ChaCha8Rng| Dipoles::random(6, random);
    let worst = check(&reference_two_magnets([1.0, -1.0]), 1e-3, 50, 13, dipoles);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn jacobian_equals_differences_on_a_mesh_too_coarse_to_be_accurate() {
    let dipoles = |random: &mut ChaCha8Rng| Dipoles::random(5, random);
    let worst = check(&reference_two_magnets([1.0, -1.0]), 13e-3, 30, 14, dipoles);
    assert!(worst < 1e-7, "{worst}");
}

#[test]
fn jacobian_equals_differences_for_precurved_sections_and_oblique_moments_in_any_order() {
    let dipoles = |random: &mut ChaCha8Rng| {
        let mut dipoles = Dipoles::random(9, random);
        dipoles.strengths.iter_mut().for_each(|strength| *strength *= 0.5);
        dipoles
    };
    let worst = check(&mixed_chain(), 4e-3, 30, 15, dipoles);
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn newton_step_solves_the_linearised_residual() {
    let manipulator = build(&mixed_chain(), 4e-3);
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let field = affine(0.3, &mut random);
    let mut pass = Pass::new(&manipulator);
    assert!(manipulator.solve_from_rest(&field, &TipLoad::NONE, POSES, &mut pass).converged());
    let (exact, (force, moment)) = (pass.unknowns(), manipulator.residual_units());
    let units = Vector6::new(force, force, force, moment, moment, moment);
    let way = Vector6::from_fn(|i, _| units[i] * random.random_range(-1.0..1.0));
    let mut error = |size: f64| {
        manipulator.pass(&field, &TipLoad::NONE, &(exact + way * size), PassMode::default(), &mut pass);
        let corrected = pass.unknowns() + pass.newton_step().expect("regular") - exact;
        corrected.component_div(&units).norm()
    };
    // A wrong Jacobian would leave an error of first order: a tenth the step, a tenth the error.
    let (coarse, fine) = (error(1e-3), error(1e-4));
    assert!(coarse < 1e-4 && (60.0..160.0).contains(&(coarse / fine)), "{coarse} {fine}");
}

#[test]
fn frozen_wrench_jacobian_equals_differences_with_wrenches_held_in_the_world() {
    // With its moment removed a magnet feels nothing; its frozen wrench is then a dead load. A single magnet at
    // the tip makes that load a tip load, which the solver knows on its own.
    let mut rod = reference_two_magnets([1.0, 1.0]);
    rod.manipulator.parts.truncate(2);
    let manipulator = build(&rod, 1e-3);
    let mut bare = rod.clone();
    if let PartDescription::Magnet(magnet) = &mut bare.manipulator.parts[1] {
        magnet.moment_body = [0.0; 3];
    }
    let bare = build(&bare, 1e-3);
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let field = affine(1.0, &mut random);
    let mut pass = Pass::new(&manipulator);
    assert!(manipulator.solve_from_rest(&field, &TipLoad::NONE, FROZEN, &mut pass).converged());
    let magnet = &pass.magnets()[0];
    let (center, moment) = (magnet.position(), magnet.tangent() * 0.0132);
    let mut scratch = Pass::new(&bare);
    for parameter in 0..8 {
        let step = step(&pass, parameter);
        let mut sum = [Vector3::zeros(); 3];
        for (offset, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
            let mut steered = field;
            steered.steer(parameter, offset * step);
            let mut sample = FieldSample::default();
            steered.evaluate(&center, &mut sample);
            let force = sample.gradient.matrix() * moment;
            let torque = moment.cross(&sample.field);
            // The dead wrench acts at the centre, half a magnet below the tip, and the arm turns with the rod.
            let mut load = TipLoad { force, moment: torque };
            for _ in 0..200 {
                let guess = pass.unknowns();
                assert!(bare.solve(&steered, &load, &guess, PassMode::default(), &mut scratch).converged());
                let arm = scratch.magnets()[0].tangent() * 2e-3;
                load.moment = torque - arm.cross(&force);
            }
            let there = &scratch.magnets()[0];
            let weight = weight / (12.0 * step);
            sum[0] += there.tangent() * weight;
            sum[1] += rotation_between(&pass.magnets()[0].rotation(), &there.rotation()) * weight;
            sum[2] += there.position() * weight;
        }
        let rows = [
            pass.tangent_jacobian(0),
            pass.rotation_jacobian(0).expect("asked for"),
            pass.position_jacobian(0).expect("asked for"),
        ];
        for (rows, expected) in rows.iter().zip(&sum) {
            let found = Vector3::from_fn(|i, _| rows[i][parameter]);
            assert!((found - expected).norm() < 1e-6 * expected.norm(), "{found} {expected}");
        }
    }
}

#[test]
fn frozen_and_following_wrenches_differ_where_gradients_are_strong() {
    let manipulator = build(&default_two_magnets(), 25e-3 / 8.0);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut pass = Pass::new(&manipulator);
    let field = affine(5.0, &mut random);
    assert!(manipulator.solve_from_rest(&field, &TipLoad::NONE, POSES, &mut pass).converged());
    let following = Matrix3::from_fn(|i, j| pass.tangent_jacobian(1)[i][j]);
    let unknowns = pass.unknowns();
    manipulator.pass(&field, &TipLoad::NONE, &unknowns, FROZEN, &mut pass);
    let frozen = Matrix3::from_fn(|i, j| pass.tangent_jacobian(1)[i][j]);
    assert!((following - frozen).norm() > 0.05 * following.norm());
    assert!(pass.residual() < 1e-11, "the equilibrium is the same");
}
