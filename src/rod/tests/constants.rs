//! Derivatives with the manipulator's constants: against differences of full re-solves of other
//! manipulators, and an identity that they obey together.

use magsteer_hal::HardwareDescription;
use magsteer_hal::description::{PartDescription, Rows3};
use nalgebra::{Matrix3, Rotation3, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::fixtures::{
    Dipoles, POSES, build, default_two_magnets, mixed_chain, polish, reference_two_magnets,
};
use crate::rod::{ByConstants, Constant, Pass, TipLoad};

fn matrix(rows: &Rows3) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| rows[row][column])
}

/// The same rig with one constant changed.
fn changed(rig: &HardwareDescription, constant: Constant, by: f64) -> HardwareDescription {
    let mut rig = rig.clone();
    let factor = by.exp();
    let chain = &mut rig.manipulator;
    match constant {
        Constant::BasePosition(axis) => chain.base_position[axis] += by,
        Constant::BaseRotation(axis) => {
            let turn =
                Rotation3::from_scaled_axis(Vector3::from_fn(|row, _| if row == axis { by } else { 0.0 }));
            let turned = turn.matrix() * matrix(&chain.base_rotation);
            chain.base_rotation = [0, 1, 2].map(|row| [0, 1, 2].map(|column| turned[(row, column)]));
        }
        Constant::Stiffness(index) => {
            let sections = chain.parts.iter_mut().filter_map(|part| match part {
                PartDescription::Section(section) => Some(section),
                PartDescription::Magnet(_) => None,
            });
            let section = sections.into_iter().nth(index).expect("there");
            section.bending_stiffness *= factor;
            section.torsion_stiffness *= factor;
            if let Some(extensible) = &mut section.extensible {
                extensible.shear *= factor;
                extensible.axial *= factor;
            }
        }
        Constant::Moment(index) => {
            let magnets = chain.parts.iter_mut().filter_map(|part| match part {
                PartDescription::Magnet(magnet) => Some(magnet),
                PartDescription::Section(_) => None,
            });
            let magnet = magnets.into_iter().nth(index).expect("there");
            magnet.moment_body = magnet.moment_body.map(|component| component * factor);
        }
        Constant::Gravity => rig.gravity = rig.gravity.map(|component| component * factor),
    }
    rig
}

/// Tangents and positions of all magnets, and the base unknowns.
fn found(pass: &Pass) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>, Vector6<f64>) {
    let magnets = || pass.magnets().iter();
    (
        magnets().map(|magnet| magnet.tangent()).collect(),
        magnets().map(|magnet| magnet.position()).collect(),
        pass.unknowns(),
    )
}

/// Greatest deviation from central differences of fourth order, each sort relative to its greatest entry.
fn deviation(rig: &HardwareDescription, mesh: f64, field: &Dipoles, pass: &Pass, by: &ByConstants) -> f64 {
    let (mut worst, mut scale) = ([0.0_f64; 3], [0.0_f64; 3]);
    for (index, constant) in by.constants().iter().enumerate() {
        // Positions in metres: a step of 1 is as long as the rod is.
        let unit = if matches!(constant, Constant::BasePosition(_)) { 0.05 } else { 1.0 };
        let largest = (0..pass.magnets().len())
            .map(|magnet| by.tangent(magnet)[index].norm() * unit)
            .fold(0.05, f64::max);
        let step = unit * 1e-4 / largest;
        let magnets = pass.magnets().len();
        let mut sums = (vec![Vector3::zeros(); magnets], vec![Vector3::zeros(); magnets], Vector6::zeros());
        for (offset, weight) in [(-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)] {
            let other = build(&changed(rig, *constant, offset * step), mesh);
            let mut there = Pass::new(&other);
            let solution = other.solve(field, &TipLoad::NONE, &pass.unknowns(), POSES, &mut there);
            assert!(solution.converged(), "{solution:?}");
            polish(&other, field, &TipLoad::NONE, &mut there);
            let weight = weight / (12.0 * step);
            let (tangents, positions, unknowns) = found(&there);
            for magnet in 0..magnets {
                sums.0[magnet] += tangents[magnet] * weight;
                sums.1[magnet] += positions[magnet] * weight;
            }
            sums.2 += unknowns * weight;
        }
        let mut compare = |sort: usize, found: f64, expected: f64| {
            worst[sort] = worst[sort].max(found * unit);
            scale[sort] = scale[sort].max(expected * unit);
        };
        for magnet in 0..magnets {
            compare(0, (by.tangent(magnet)[index] - sums.0[magnet]).norm(), sums.0[magnet].norm());
            compare(1, (by.position(magnet)[index] - sums.1[magnet]).norm(), sums.1[magnet].norm());
        }
        compare(2, (by.unknowns()[index] - sums.2).norm(), sums.2.norm());
    }
    (0..3).map(|sort| worst[sort] / scale[sort]).fold(0.0, f64::max)
}

/// Random equilibria of a rig, each handed to `look` with its derivatives.
fn each(
    rig: &HardwareDescription,
    mesh: f64,
    count: usize,
    seed: u64,
    mut look: impl FnMut(&Dipoles, &Pass, &ByConstants),
) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let manipulator = build(rig, mesh);
    let mut pass = Pass::new(&manipulator);
    let mut by = ByConstants::new(&manipulator);
    let mut checked = 0;
    while checked < count {
        let mut field = Dipoles::random(4, &mut random);
        let strength = random.random_range(0.2..0.6);
        field.strengths.iter_mut().for_each(|entry| *entry *= strength);
        let solution = manipulator.solve_from_rest(&field, &TipLoad::NONE, POSES, &mut pass);
        // Near a fold the derivative itself is without bound, and no difference can follow.
        let regular = (0.05..1e4).contains(&pass.determinant());
        if !solution.converged() || solution.lost_stability || !regular {
            continue;
        }
        checked += 1;
        polish(&manipulator, &field, &TipLoad::NONE, &mut pass);
        assert!(manipulator.differentiate(&field, &mut pass, &mut by));
        look(&field, &pass, &by);
    }
}

#[test]
fn derivatives_with_constants_equal_differences_of_full_solves() {
    let rigs = [
        (reference_two_magnets([1.0, -1.0]), 1e-3, 31),
        (default_two_magnets(), 25e-3 / 4.0, 32),
        (mixed_chain(), 4e-3, 33),
    ];
    for (rig, mesh, seed) in rigs {
        let mut worst = 0.0_f64;
        each(&rig, mesh, 12, seed, |field, pass, by| {
            worst = worst.max(deviation(&rig, mesh, field, pass, by));
        });
        assert!(worst < 1e-6, "seed {seed}: {worst}");
    }
}

/// Goal: a rod that is stiffer, heavier and more magnetic by one factor has the same shape, and transmits
/// greater loads by that factor. So the derivatives with all of these add up to nothing, and to the loads.
#[test]
fn derivatives_with_all_stiffnesses_moments_and_gravity_add_up_to_nothing() {
    let rig = mixed_chain();
    each(&rig, 4e-3, 12, 34, |_, pass, by| {
        let scaled = |constant: &Constant| {
            matches!(constant, Constant::Stiffness(_) | Constant::Moment(_) | Constant::Gravity)
        };
        let chosen = || by.constants().iter().enumerate().filter(|(_, constant)| scaled(constant));
        for magnet in 0..pass.magnets().len() {
            let tangent: Vector3<f64> = chosen().map(|(index, _)| by.tangent(magnet)[index]).sum();
            let sizes: f64 = chosen().map(|(index, _)| by.tangent(magnet)[index].norm()).sum();
            assert!(tangent.norm() < 1e-9 * sizes + 1e-12, "{tangent} of {sizes}");
            let position: Vector3<f64> = chosen().map(|(index, _)| by.position(magnet)[index]).sum();
            assert!(position.norm() < 1e-9 * 0.05 * sizes + 1e-13, "{position}");
        }
        let unknowns: Vector6<f64> = chosen().map(|(index, _)| by.unknowns()[index]).sum();
        assert!((unknowns - pass.unknowns()).norm() < 1e-8 * pass.unknowns().norm(), "{unknowns}");
    });
}
