//! What mechanics demands whatever the numbers.

use magsteer_hal::description::{ExtensibleStiffness, PartDescription, Rows3};
use nalgebra::{Matrix3, Rotation3, Vector3};

use super::fixtures::{
    UPRIGHT, build, default_two_magnets, description, magnet, reference_two_magnets, section, tangent_rows,
    tip_load, uniform,
};
use crate::magnetics::{AffineField, FieldGradient};
use crate::rod::{Manipulator, Pass, PassMode, TipLoad};

fn field() -> AffineField {
    AffineField {
        field: Vector3::new(2e-3, -3e-3, 6e-3),
        gradient: FieldGradient { xx: 0.05, xy: 0.1, xz: -0.15, yy: 0.02, yz: 0.08 },
    }
}

fn solved(manipulator: &Manipulator, field: &AffineField, load: &TipLoad, mode: PassMode) -> Pass {
    let mut pass = Pass::new(manipulator);
    let solution = manipulator.solve_from_rest(field, load, mode, &mut pass);
    assert!(solution.converged(), "{solution:?}");
    pass
}

#[test]
fn without_load_the_rod_is_straight() {
    let mut rod = reference_two_magnets([1.0, -1.0]);
    rod.gravity = [0.0; 3];
    let manipulator = build(&rod, 3e-3);
    let pass = solved(&manipulator, &uniform(Vector3::zeros()), &TipLoad::NONE, PassMode::default());
    assert_eq!(pass.tip_tangent(), Vector3::x());
    assert!((pass.tip_position() - Vector3::new(53e-3, 0.0, 0.0)).norm() < 1e-16);
    assert!((pass.determinant() - 1.0).abs() < 1e-12);
    assert_eq!(pass.unknowns().norm(), 0.0);
}

#[test]
fn without_load_a_precurved_rod_keeps_its_curve() {
    let mut part = section(1.0, 1.0, 0.7);
    part.precurvature = [0.0, std::f64::consts::FRAC_PI_2, 0.0];
    let rod = description(UPRIGHT, [0.0; 3], vec![PartDescription::Section(part)]);
    let pass = solved(&build(&rod, 0.01), &uniform(Vector3::zeros()), &TipLoad::NONE, PassMode::default());
    let radius = 2.0 / std::f64::consts::PI;
    assert!((pass.tip_position() - Vector3::new(radius, 0.0, radius)).norm() < 1e-8);
    assert!((pass.tip_tangent() - Vector3::x()).norm() < 1e-8);
}

#[test]
fn base_reaction_is_the_sum_of_all_loads() {
    let rod = reference_two_magnets([1.0, -1.0]);
    let manipulator = build(&rod, 0.1e-3);
    let load = tip_load([2e-4, -3e-4, 1e-4], [1e-6, 2e-6, -3e-6]);
    let pass = solved(&manipulator, &field(), &load, PassMode::default());
    let (tip, gravity) = (pass.tip_position(), Vector3::new(0.0, 0.0, -9.81));
    let mut force = load.force;
    let mut moment = load.moment + tip.cross(&load.force);
    for magnet in pass.magnets() {
        force += magnet.force() + magnet.weight();
        moment += magnet.torque() + magnet.position().cross(&(magnet.force() + magnet.weight()));
    }
    // Weight of the sections, by the trapezoidal rule over the mesh.
    let shape = manipulator.shape(&pass);
    let masses: Vec<f64> = manipulator
        .sections()
        .flat_map(|section| {
            vec![section.mass_per_length * section.length / section.segments as f64; section.segments]
        })
        .collect();
    let mut mass = masses.iter();
    for pair in shape.windows(2).filter(|pair| pair[1].magnet.is_none()) {
        let weight = gravity * *mass.next().expect("one mass a step");
        force += weight;
        moment += (0.5 * (pair[0].position + pair[1].position)).cross(&weight);
    }
    assert!(mass.next().is_none());
    assert!((force - pass.base_force()).norm() < 1e-12 * (1.0 + force.norm()), "{force}");
    // The trapezoidal rule errs by h^2 / 12 of the curvature: some 4e-7 of the moment.
    assert!(
        (moment - pass.base_moment()).norm() < 1e-6 * moment.norm(),
        "{moment:?} {:?}",
        pass.base_moment()
    );
}

#[test]
fn rotating_the_world_rotates_the_solution() {
    let rod = reference_two_magnets([1.0, -1.0]);
    let turn: Matrix3<f64> = *Rotation3::from_scaled_axis(Vector3::new(0.4, -1.1, 0.7)).matrix();
    let mut turned = rod.clone();
    let base = Matrix3::from_fn(|i, j| rod.manipulator.base_rotation[i][j]);
    let rotated = turn * base;
    turned.manipulator.base_rotation =
        core::array::from_fn(|i| core::array::from_fn(|j| rotated[(i, j)])) as Rows3;
    turned.gravity = (turn * Vector3::from(rod.gravity)).into();
    let gradient = turn * field().gradient.matrix() * turn.transpose();
    let turned_field = AffineField {
        field: turn * field().field,
        gradient: FieldGradient {
            xx: gradient[(0, 0)],
            xy: gradient[(0, 1)],
            xz: gradient[(0, 2)],
            yy: gradient[(1, 1)],
            yz: gradient[(1, 2)],
        },
    };
    let mode = PassMode { poses: true, ..PassMode::default() };
    let here = solved(&build(&rod, 2e-3), &field(), &TipLoad::NONE, mode);
    let there = solved(&build(&turned, 2e-3), &turned_field, &TipLoad::NONE, mode);
    for (a, b) in here.magnets().iter().zip(there.magnets()) {
        assert!((turn * a.position() - b.position()).norm() < 1e-13);
        assert!((turn * a.rotation() - b.rotation()).norm() < 1e-10);
        assert!((turn * a.torque() - b.torque()).norm() < 1e-14);
    }
    // dt/dB0 is a tensor: it turns on both sides.
    for magnet in 0..2 {
        let tensor = |pass: &Pass| Matrix3::from_fn(|i, j| pass.tangent_jacobian(magnet)[i][j]);
        let (expected, found) = (turn * tensor(&here) * turn.transpose(), tensor(&there));
        assert!((expected - found).norm() < 1e-9 * expected.norm());
    }
}

#[test]
fn the_scheme_is_of_fourth_order_in_positions_and_sensitivities() {
    for (rod, poses) in [(reference_two_magnets([1.0, -1.0]), false), (default_two_magnets(), true)] {
        let mode = PassMode { poses, ..PassMode::default() };
        let at = |segments: f64| {
            let pass = solved(&build(&rod, 25e-3 / segments), &field(), &TipLoad::NONE, mode);
            (pass.tip_position(), Vector3::from_fn(|i, _| pass.tangent_jacobian(1)[i][2]))
        };
        let exact = at(256.0);
        let error =
            |found: (Vector3<f64>, Vector3<f64>)| [(found.0 - exact.0).norm(), (found.1 - exact.1).norm()];
        let (coarse, fine) = (error(at(4.0)), error(at(8.0)));
        for kind in 0..2 {
            let order = (coarse[kind] / fine[kind]).log2();
            assert!((3.6..4.8).contains(&order), "order {order} from {coarse:?} to {fine:?}");
        }
    }
}

#[test]
fn the_default_mesh_errs_by_less_than_a_micrometre_and_1e_5_rad() {
    let rod = default_two_magnets();
    // The strongest bend of the demonstration: some 60 degrees between clamp and tip.
    for strength in [0.5, 1.0, 1.5, -1.0] {
        let field = uniform(Vector3::new(1e-3, 4e-3, 14e-3) * strength);
        let at = |step: f64| solved(&build(&rod, step), &field, &TipLoad::NONE, PassMode::default());
        let (coarse, exact) = (at(25e-3 / 8.0), at(25e-3 / 128.0));
        for (a, b) in coarse.magnets().iter().zip(exact.magnets()) {
            assert!((a.position() - b.position()).norm() < 1e-6);
            assert!((a.tangent() - b.tangent()).norm() < 1e-5);
        }
    }
}

#[test]
fn modes_with_and_without_twist_agree() {
    let manipulator = build(&reference_two_magnets([1.0, -1.0]), 3e-3);
    let load = tip_load([1e-4, 2e-4, -3e-4], [2e-6, -1e-6, 3e-6]);
    let axial = solved(&manipulator, &field(), &load, PassMode::default());
    let full = solved(&manipulator, &field(), &load, PassMode { poses: true, ..PassMode::default() });
    assert!((axial.unknowns() - full.unknowns()).norm() < 1e-13);
    for magnet in 0..2 {
        let rotations = [axial.magnets()[magnet].rotation(), full.magnets()[magnet].rotation()];
        assert!((rotations[0] - rotations[1]).norm() < 1e-11);
        let scale = tangent_rows(&full, magnet).concat().iter().fold(0.0_f64, |s, entry| s.max(entry.abs()));
        for (a, b) in tangent_rows(&axial, magnet).concat().iter().zip(tangent_rows(&full, magnet).concat()) {
            assert!((a - b).abs() < 1e-10 * scale, "{a} {b}");
        }
    }
    assert!(axial.rotation_jacobian(0).is_none() && axial.position_jacobian(0).is_none());
}

#[test]
fn an_extensible_rod_of_huge_stiffness_is_a_kirchhoff_rod() {
    let rigid = reference_two_magnets([1.0, -1.0]);
    let with = |stiffness: Option<f64>| {
        let mut rod = rigid.clone();
        for part in &mut rod.manipulator.parts {
            if let PartDescription::Section(section) = part {
                section.extensible =
                    stiffness.map(|value| ExtensibleStiffness { shear: value, axial: 2.0 * value });
            }
        }
        solved(&build(&rod, 2e-3), &field(), &TipLoad::NONE, PassMode::default())
    };
    let (kirchhoff, stiff, soft) = (with(None), with(Some(1e9)), with(Some(10.0)));
    let gap = |pass: &Pass| (pass.tip_position() - kirchhoff.tip_position()).norm();
    // 6 mN over 1e9 N is a strain of 6e-12.
    assert!(gap(&stiff) < 1e-12, "{}", gap(&stiff));
    assert!(gap(&soft) > 1e-7, "stretch has an effect: {}", gap(&soft));
}

#[test]
fn a_magnet_between_sections_is_rigid_and_one_at_the_clamp_does_not_move() {
    let sections = || PartDescription::Section(section(0.02, 1e-6, 1e-6));
    let parts = vec![
        magnet(4e-3, 0.0, [0.0, 0.0, 0.01]),
        sections(),
        magnet(4e-3, 0.0, [0.0, 0.0, 0.01]),
        sections(),
    ];
    let manipulator = build(&description(UPRIGHT, [0.0; 3], parts), 1e-3);
    let mode = PassMode { poses: true, ..PassMode::default() };
    let pass = solved(&manipulator, &uniform(Vector3::new(8e-3, 0.0, 0.0)), &TipLoad::NONE, mode);
    assert_eq!(pass.magnets()[0].position(), Vector3::new(0.0, 0.0, 2e-3));
    assert_eq!(pass.magnets()[0].tangent(), Vector3::z());
    for rows in [pass.tangent_jacobian(0), pass.position_jacobian(0).expect("asked for")] {
        assert!(rows.iter().all(|row| row.iter().all(|entry| *entry == 0.0)));
    }
    assert!(pass.magnets()[1].tangent().x > 0.1, "the other one turns");
    // Nothing loads the last section: it leaves the magnet straight.
    assert!((pass.tip_tangent() - pass.magnets()[1].tangent()).norm() < 1e-9);
    let shape = manipulator.shape(&pass);
    assert!((shape.last().expect("stations").position - pass.tip_position()).norm() < 1e-15);
}
