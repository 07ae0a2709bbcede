//! The rod at rest under moments, against closed forms, and the loads at which it stops to be straight.
//!
//! A moment `m` fixed in the world is that of a dipole `u` in the uniform field `m x u / u^2`, once the dipole is turned as
//! the reference says, when `u` is chosen across `m` there. A share of field along `u` adds no moment and makes the rest stable.

#[path = "../src/fixture.rs"]
mod fixture;
#[path = "rod_oracles/unit_rod.rs"]
mod unit_rod;
mod validation;

use std::cell::Cell;

use magsteer_hal::description::{PartDescription, SectionDescription};
use magsteer_sim_plant::field::Field;
use magsteer_sim_plant::rod::Rod;
use nalgebra::{Matrix3, Rotation3, Vector3};
use unit_rod::{UPRIGHT, number, point, reference, rows, uniform, unit_section, unloaded, vector};
use validation::Row;

/// Field that turns a dipole `u` (world, as it is turned at rest) by `m`, and holds it with `hold`.
fn field_for(m: &Vector3<f64>, u: &Vector3<f64>, hold: f64) -> Vector3<f64> {
    assert!(m.dot(u).abs() < 1e-9 * (m.norm() + 1.0) * u.norm());
    m.cross(u) / u.norm_squared() + u * hold
}

/// Off by how much of the length, and by how many rad.
fn deviation(rod: &Rod, position: &Vector3<f64>, rotation: &Matrix3<f64>) -> (f64, f64) {
    let tip = rod.tip_pose();
    let turned = rotation.transpose() * tip.rotation.to_rotation_matrix().matrix();
    let sine = Vector3::new(turned.m32 - turned.m23, turned.m13 - turned.m31, turned.m21 - turned.m12) * 0.5;
    ((tip.position - position).norm(), sine.norm().atan2(0.5 * (turned.trace() - 1.0)))
}

/// Greatest deviations from circles, up to a closed ring, under a growing tip moment on 40 elements.
fn circle() -> (f64, f64) {
    let mut worst: (f64, f64) = (0.0, 0.0);
    for row in rows(&reference(), "pure_moment_circle") {
        let whole = number(&row["ML_over_EI"]);
        // Along the tangent: across the moment about y wherever the tip is.
        let mut rod = unloaded(
            vec![PartDescription::Section(unit_section()), point([0.0, 0.0, 1.0])],
            UPRIGHT,
            [0.0; 3],
            40,
        );
        let parts = (whole / 0.5).ceil() as u32;
        for part in 1..=parts {
            let angle = whole * f64::from(part) / f64::from(parts);
            let tangent = Vector3::new(angle.sin(), 0.0, angle.cos());
            assert!(rod.settle(uniform(field_for(&Vector3::new(0.0, angle, 0.0), &tangent, 4.0 + angle))));
        }
        let expected = Vector3::new(number(&row["transverse"]), 0.0, number(&row["axial"]));
        let angle = number(&row["tip_angle"]);
        let rotation = *Rotation3::from_axis_angle(&Vector3::y_axis(), angle).matrix();
        let (position, turned) = deviation(&rod, &expected, &rotation);
        worst = (worst.0.max(position), worst.1.max(turned));
    }
    worst
}

/// Tip rotation of a rod of unit length under a tip moment alone, by small turns with the curvature `K^-1 R^T m`.
fn helix_turn(m: &Vector3<f64>, bending: f64, torsion: f64) -> Matrix3<f64> {
    let count = 2000;
    let length = 1.0 / f64::from(count);
    let curvature = |rotation: &Rotation3<f64>| {
        let moment = rotation.inverse() * m;
        Vector3::new(moment.x / bending, moment.y / bending, moment.z / torsion)
    };
    let mut rotation = Rotation3::identity();
    for _ in 0..count {
        let middle = rotation * Rotation3::new(curvature(&rotation) * (length / 2.0));
        rotation *= Rotation3::new(curvature(&middle) * length);
    }
    *rotation.matrix()
}

/// Greatest deviations from the helix on 60 elements, the moment growing in steps along the helices of smaller ones.
///
/// Two dipoles across each other at the tip share the moment; the rod asks for their fields in turn.
fn helix() -> (f64, f64) {
    let mut worst: (f64, f64) = (0.0, 0.0);
    // The second helix, under 6 EI/L across and 4 EI/L along, is no stable rest of these dipoles: the rod writhes away from it.
    for row in rows(&reference(), "helix_tip_moment").into_iter().take(1) {
        let (m, bending, torsion) = (vector(&row["m"]), number(&row["EI"]), number(&row["GJ"]));
        let section =
            SectionDescription { bending_stiffness: bending, torsion_stiffness: torsion, ..unit_section() };
        let rotation = Matrix3::from_fn(|i, j| number(&row["R"][i][j]));
        let parts = vec![PartDescription::Section(section), point([1.0, 0.0, 0.0]), point([0.0, 1.0, 0.0])];
        let mut rod = unloaded(parts, UPRIGHT, [0.0; 3], 60);
        for step in 1..=20 {
            let part = m * (f64::from(step) / 20.0);
            let turn = if step == 20 { rotation } else { helix_turn(&part, bending, torsion) };
            let (first, second) = (turn * Vector3::x(), turn * Vector3::y());
            let along_first = first * first.dot(&part);
            let fields =
                [field_for(&(part - along_first), &first, 20.0), field_for(&along_first, &second, 20.0)];
            let asked = Cell::new(0);
            let in_turn = |_: &Vector3<f64>| {
                let flux = fields[asked.replace(asked.get() + 1) % 2];
                Field { flux, ..Field::zero() }
            };
            assert!(rod.settle(in_turn));
        }
        let (position, turned) = deviation(&rod, &vector(&row["p"]), &rotation);
        worst = (worst.0.max(position), worst.1.max(turned));
    }
    worst
}

/// A magnet at the tip of a rod that stands along +z, in a uniform field across it: the tip's place and turn.
fn tip_magnet() -> (f64, f64) {
    let mut worst: (f64, f64) = (0.0, 0.0);
    for row in rows(&reference(), "tip_magnet_perpendicular_uniform_field") {
        let parts = vec![PartDescription::Section(unit_section()), point([0.0, 0.0, 1.0])];
        let mut rod = unloaded(parts, UPRIGHT, [0.0; 3], 40);
        assert!(rod.settle(uniform(Vector3::new(number(&row["beta"]), 0.0, 0.0))));
        let expected = Vector3::new(number(&row["x_over_L"]), 0.0, number(&row["z_over_L"]));
        let angle = number(&row["theta_tip"]);
        let rotation = *Rotation3::from_axis_angle(&Vector3::y_axis(), angle).matrix();
        let (position, turned) = deviation(&rod, &expected, &rotation);
        worst = (worst.0.max(position), worst.1.max(turned));
    }
    worst
}

/// Two halves with a point magnet after each.
fn two_magnets(first: f64, second: f64) -> Rod {
    let half = || PartDescription::Section(SectionDescription { length: 0.5, ..unit_section() });
    let parts = vec![half(), point([0.0, 0.0, first]), half(), point([0.0, 0.0, second])];
    unloaded(parts, UPRIGHT, [0.0; 3], 20)
}

fn two_magnets_in_a_uniform_field() -> (f64, f64) {
    let mut worst: (f64, f64) = (0.0, 0.0);
    for row in rows(&reference(), "two_magnets_uniform_field") {
        let mut rod = two_magnets(number(&row["beta1"]), number(&row["beta2"]));
        let psi = number(&row["psi_deg"]).to_radians();
        assert!(rod.settle(uniform(Vector3::new(psi.sin(), 0.0, psi.cos()))));
        for (index, key) in ["theta1", "theta2"].into_iter().enumerate() {
            let tangent = rod.magnet_pose(index).rotation * Vector3::z();
            worst.1 = worst.1.max((tangent.x.atan2(tangent.z) - number(&row[key])).abs());
        }
        let expected = Vector3::new(number(&row["x_tip"]), 0.0, number(&row["z_tip"]));
        worst.0 = worst.0.max((rod.tip_pose().position - expected).norm());
    }
    worst
}

#[test]
fn rod_under_moments_rests_where_the_references_say() {
    let mut table = Vec::new();
    for (what, (position, turned), bar) in [
        ("circles by a tip moment, to a closed ring", circle(), 2e-5),
        ("helix by a tip moment, 60 elements", helix(), 4e-5),
        ("tip magnet across a uniform field, to mu B L = 10 EI", tip_magnet(), 2e-5),
        ("two magnets in a uniform field", two_magnets_in_a_uniform_field(), 2e-5),
    ] {
        table.push(Row::new(format!("{what}, place over L"), position, bar, ""));
        table.push(Row::new(format!("{what}, turn"), turned.to_degrees(), bar.to_degrees(), "deg"));
    }
    validation::hold("rod.md", "moments", &table);
}

/// How far the tip lies aside under a small sideways push, at a share of the critical load.
fn aside(load: impl Fn(f64) -> (Rod, Vector3<f64>), share: f64) -> f64 {
    let (mut rod, flux) = load(share);
    assert!(rod.settle(uniform(flux)));
    rod.tip_pose().position.x.abs()
}

/// A rod and the field about it, at a share of the critical load.
type Load<'a> = Box<dyn Fn(f64) -> (Rod, Vector3<f64>) + 'a>;

#[test]
fn straight_rod_gives_way_at_the_critical_loads() {
    let limits = &reference()["stability"];
    let standing = |gravity: f64, mass_per_length: f64, tip: bool| {
        let section = SectionDescription { mass_per_length, ..unit_section() };
        let mut parts = vec![PartDescription::Section(section)];
        if tip {
            parts.push(point([0.0; 3]));
        }
        // A sideways share of 1e-5 of the load makes the rod choose a side.
        unloaded(parts, UPRIGHT, [1e-5 * gravity, 0.0, -gravity], 40)
    };
    let euler = number(&limits["euler_cantilever_Pcr_L2_over_EI"]);
    let own = number(&limits["self_weight_column_wL3_over_EI_cr"]);
    let one = number(&limits["antiparallel_tip_magnet_beta_cr"]);
    let two = number(&limits["two_equal_magnets_beta_cr"]);
    let against = |load: f64| Vector3::new(1e-5 * load, 0.0, -load);
    let single = || {
        unloaded(
            vec![PartDescription::Section(unit_section()), point([0.0, 0.0, 1.0])],
            UPRIGHT,
            [0.0; 3],
            40,
        )
    };
    let cases: [(&str, Load); 4] = [
        ("tip weight", Box::new(|share| (standing(share * euler, 0.0, true), Vector3::zeros()))),
        ("own weight", Box::new(|share| (standing(share * own, 1.0, false), Vector3::zeros()))),
        ("magnet against the field", Box::new(|share| (single(), against(share * one)))),
        ("two magnets against the field", Box::new(|share| (two_magnets(1.0, 1.0), against(share * two)))),
    ];
    for (what, load) in cases {
        let (below, above) = (aside(&load, 0.95), aside(&load, 1.05));
        // Below, the push is amplified twentyfold; above, the rod leans by about the square root of the excess.
        assert!(below < 1e-3 && above > 0.1, "{what}: {below} L below, {above} L above");
    }
}
