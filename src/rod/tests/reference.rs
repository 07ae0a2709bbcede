//! `tests/reference/rod_cases.json`: closed forms and high-precision solutions by independent tools.

use std::f64::consts::PI;
use std::path::Path;

use magsteer_hal::description::{ExtensibleStiffness, PartDescription};
use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};
use serde_json::Value;

use super::fixtures::{
    HORIZONTAL, UPRIGHT, build, description, magnet, reference_two_magnets, section, tip_load, uniform,
    unit_cantilever,
};
use crate::magnetics::{AffineField, FieldGradient};
use crate::rod::{Manipulator, Pass, PassMode, TipLoad};

fn cases() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/rod_cases.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect("reference data")).expect("reference JSON")
}

/// A number that the file writes as number or text, "pi/2" included.
fn number(value: &Value) -> f64 {
    match value.as_str() {
        Some("pi/2") => PI / 2.0,
        Some("pi") => PI,
        Some("2*pi") => 2.0 * PI,
        Some(text) => text.parse().expect("a number"),
        None => value.as_f64().expect("a number"),
    }
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|i, _| number(&value[i]))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| number(&value[i][j]))
}

fn rows(value: &Value) -> &Vec<Value> {
    value["rows"].as_array().expect("rows")
}

/// Solves from rest; the reference cases all have an equilibrium on that branch.
fn solved(manipulator: &Manipulator, field: &AffineField, load: &TipLoad, mode: PassMode) -> Pass {
    let mut pass = Pass::new(manipulator);
    let solution = manipulator.solve_from_rest(field, load, mode, &mut pass);
    assert!(solution.converged(), "{solution:?}");
    pass
}

fn no_field() -> AffineField {
    uniform(Vector3::zeros())
}

#[track_caller]
fn close(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected} within {tolerance}");
}

#[test]
fn elastica_under_a_tip_force_matches_elliptic_integrals() {
    let manipulator = unit_cantilever(100);
    for row in rows(&cases()["elastica_tip_force"]) {
        let load = tip_load([number(&row["alpha"]), 0.0, 0.0], [0.0; 3]);
        let pass = solved(&manipulator, &no_field(), &load, PassMode::default());
        let (tip, tangent) = (pass.tip_position(), pass.tip_tangent());
        close(tip.x, number(&row["transverse"]), 1e-7);
        close(tip.z, number(&row["axial"]), 1e-7);
        close(tangent.x.atan2(tangent.z), number(&row["tip_angle_rad"]), 1e-7);
        close(tip.y, 0.0, 1e-12);
    }
}

#[test]
fn a_tip_moment_bends_the_rod_to_an_arc_up_to_the_full_circle() {
    let manipulator = unit_cantilever(200);
    for row in rows(&cases()["pure_moment_circle"]) {
        let moment = number(&row["ML_over_EI"]);
        let load = tip_load([0.0; 3], [0.0, moment, 0.0]);
        let pass = solved(&manipulator, &no_field(), &load, PassMode::default());
        let (tip, tangent) = (pass.tip_position(), pass.tip_tangent());
        close(tip.x, number(&row["transverse"]), 1e-6);
        close(tip.z, number(&row["axial"]), 1e-6);
        let angle = number(&row["tip_angle"]);
        close(tangent.x, angle.sin(), 1e-6);
        close(tangent.z, angle.cos(), 1e-6);
    }
}

#[test]
fn a_skew_tip_moment_winds_the_rod_to_a_helix_with_the_exact_tip_rotation() {
    for row in rows(&cases()["helix_tip_moment"]) {
        let part = section(number(&row["L"]), number(&row["EI"]), number(&row["GJ"]));
        let rod = description(UPRIGHT, [0.0; 3], vec![PartDescription::Section(part)]);
        let manipulator = build(&rod, 1.0 / 400.0);
        let load = tip_load([0.0; 3], vector(&row["m"]).into());
        for poses in [false, true] {
            let pass = solved(&manipulator, &no_field(), &load, PassMode { poses, ..Default::default() });
            assert!((pass.tip_position() - vector(&row["p"])).norm() < 1e-6);
            assert!((pass.tip_rotation() - matrix(&row["R"])).norm() < 1e-6);
        }
    }
}

#[test]
fn a_tip_magnet_in_a_perpendicular_field_turns_as_beta_cos_theta_with_its_exact_derivative() {
    // A point magnet: 1e-9 of the rod's length, so truncation is of that order.
    for row in rows(&cases()["tip_magnet_perpendicular_uniform_field"]) {
        let beta = number(&row["beta"]);
        let parts =
            vec![PartDescription::Section(section(1.0, 1.0, 1.0)), magnet(1e-9, 0.0, [0.0, 0.0, 1.0])];
        let manipulator = build(&description(UPRIGHT, [0.0; 3], parts), 0.01);
        let field = uniform(Vector3::new(beta, 0.0, 0.0));
        let pass = solved(&manipulator, &field, &TipLoad::NONE, PassMode::default());
        let tangent = pass.magnets()[0].tangent();
        let theta = tangent.x.atan2(tangent.z);
        close(theta, number(&row["theta_tip"]), 1e-7);
        close(pass.tip_position().x, number(&row["x_over_L"]), 1e-7);
        close(pass.tip_position().z, number(&row["z_over_L"]), 1e-7);
        // dt/dbeta = dtheta/dbeta (cos, 0, -sin); the first parameter is the field along x, with unit moment.
        let [x, _, z] = pass.tangent_jacobian(0);
        let expected = number(&row["dtheta_dbeta"]);
        close(x[0] * theta.cos() - z[0] * theta.sin(), expected, 1e-6 * expected);
    }
}

#[test]
fn two_point_magnets_in_a_uniform_field_match_angles_and_jacobian() {
    for row in rows(&cases()["two_magnets_uniform_field"]) {
        let (beta, psi) =
            ([number(&row["beta1"]), number(&row["beta2"])], number(&row["psi_deg"]).to_radians());
        // EI/L = 1 and |B| = 1, so that a moment is its beta.
        let solve = |beta: [f64; 2], psi: f64| {
            let half = || PartDescription::Section(section(0.5, 1.0, 1.0));
            let point = |beta| magnet(1e-9, 0.0, [0.0, 0.0, beta]);
            let parts = vec![half(), point(beta[0]), half(), point(beta[1])];
            let manipulator = build(&description(UPRIGHT, [0.0; 3], parts), 0.01);
            let field = uniform(Vector3::new(psi.sin(), 0.0, psi.cos()));
            solved(&manipulator, &field, &TipLoad::NONE, PassMode::default())
        };
        let angles = |pass: &Pass| {
            let tangents = [pass.magnets()[0].tangent(), pass.magnets()[1].tangent()];
            tangents.map(|tangent| tangent.x.atan2(tangent.z))
        };
        let pass = solve(beta, psi);
        let theta = angles(&pass);
        close(theta[0], number(&row["theta1"]), 1e-7);
        close(theta[1], number(&row["theta2"]), 1e-7);
        close(pass.tip_position().x, number(&row["x_tip"]), 1e-7);
        close(pass.tip_position().z, number(&row["z_tip"]), 1e-7);
        for magnet in 0..2 {
            let [x, _, z] = pass.tangent_jacobian(magnet);
            let turn = |column: usize| x[column] * theta[magnet].cos() - z[column] * theta[magnet].sin();
            // B = (sin psi, 0, cos psi): the column of psi by the chain rule over Bx and Bz.
            let by_psi = turn(0) * psi.cos() - turn(2) * psi.sin();
            let expected = number(&row["J"][magnet][2]);
            close(by_psi, expected, 1e-6 * expected.abs());
            // The moments are no parameters; their columns stand against differences of full solves.
            for which in 0..2 {
                let step = 1e-5;
                let [mut up, mut down] = [beta, beta];
                up[which] += step;
                down[which] -= step;
                let difference =
                    (angles(&solve(up, psi))[magnet] - angles(&solve(down, psi))[magnet]) / (2.0 * step);
                close(difference, number(&row["J"][magnet][which]), 1e-6);
            }
        }
    }
}

/// The determinant of d(residual)/d(unknowns) of the straight rod under a load.
fn straight_determinant(manipulator: &Manipulator, field: &AffineField, force: f64) -> f64 {
    let mut pass = Pass::new(manipulator);
    let load = tip_load([0.0, 0.0, force], [0.0; 3]);
    let mut straight = nalgebra::Vector6::zeros();
    straight[2] = force;
    manipulator.pass(field, &load, &straight, PassMode::default(), &mut pass);
    assert!(pass.residual() < 1e-14, "a straight rod is in equilibrium");
    pass.determinant()
}

/// The load between `low` and `high` at which the determinant vanishes.
///
/// Rod and load are round, so both bending planes buckle at once: the determinant is the square of one plane's and
/// touches zero. Its square root is linear on either side, so a golden-section search finds the touch sharply.
fn critical(determinant: impl Fn(f64) -> f64, low: f64, high: f64) -> f64 {
    let (mut low, mut high) = (low, high);
    let root = |load: f64| determinant(load).abs().sqrt();
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..90 {
        let (a, b) = (high - ratio * (high - low), low + ratio * (high - low));
        if root(a) < root(b) {
            high = b;
        } else {
            low = a;
        }
    }
    assert!(root(0.5 * (low + high)) < 1e-5, "the determinant vanishes there");
    0.5 * (low + high)
}

#[test]
fn the_determinant_vanishes_at_the_known_limits_of_stability() {
    let stability = &cases()["stability"];
    let column = unit_cantilever(100);
    let euler = critical(|force| straight_determinant(&column, &no_field(), -force), 1.0, 4.0);
    let expected = number(&stability["euler_cantilever_Pcr_L2_over_EI"]);
    close(euler, expected, 1e-6 * expected);

    let tip = vec![PartDescription::Section(section(1.0, 1.0, 1.0)), magnet(1e-9, 0.0, [0.0, 0.0, 1.0])];
    let tip = build(&description(UPRIGHT, [0.0; 3], tip), 0.01);
    let against = |beta: f64| uniform(Vector3::new(0.0, 0.0, -beta));
    let one = critical(|beta| straight_determinant(&tip, &against(beta), 0.0), 0.5, 2.0);
    close(one, number(&stability["antiparallel_tip_magnet_beta_cr"]), 1e-6);

    let half = || PartDescription::Section(section(0.5, 1.0, 1.0));
    let point = || magnet(1e-9, 0.0, [0.0, 0.0, 1.0]);
    let two = build(&description(UPRIGHT, [0.0; 3], vec![half(), point(), half(), point()]), 0.01);
    let found = critical(|beta| straight_determinant(&two, &against(beta), 0.0), 0.4, 1.5);
    close(found, number(&stability["two_equal_magnets_beta_cr"]), 1e-6);

    let expected = number(&stability["self_weight_column_wL3_over_EI_cr"]);
    let self_weight = |weight: f64| {
        let mut part = section(1.0, 1.0, 1.0);
        part.mass_per_length = weight;
        let rod = description(UPRIGHT, [0.0, 0.0, -1.0], vec![PartDescription::Section(part)]);
        let manipulator = build(&rod, 0.01);
        let mut pass = Pass::new(&manipulator);
        let mut straight = nalgebra::Vector6::zeros();
        straight[2] = -weight;
        manipulator.pass(&no_field(), &TipLoad::NONE, &straight, PassMode::default(), &mut pass);
        pass.determinant()
    };
    close(critical(self_weight, 5.0, 10.0), expected, 1e-6 * expected);
}

#[test]
fn the_45_degree_bend_matches_in_space_with_both_torsional_stiffnesses() {
    // Tangent +y, curving to +x with radius 100: body z = +y, body x = +x, body y = -z,
    // so the curvature vector -z/100 (from +y to +x) is +1/100 about body y.
    let base = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
    let (young, radius) = (1e7, 100.0);
    let shear = young / 2.0;
    for row in rows(&cases()["bend45"]) {
        let torsion =
            if row["torsion"].as_str().expect("text").contains("/6") { 1.0 / 6.0 } else { 0.140577 };
        let mut part = section(radius * PI / 4.0, young / 12.0, shear * torsion);
        part.extensible = Some(ExtensibleStiffness { shear, axial: young });
        part.precurvature = [0.0, 1.0 / radius, 0.0];
        let rod = description(base, [0.0; 3], vec![PartDescription::Section(part)]);
        let manipulator = build(&rod, radius * PI / 4.0 / 200.0);
        let load = tip_load([0.0, 0.0, number(&row["P"])], [0.0; 3]);
        let pass = solved(&manipulator, &no_field(), &load, PassMode::default());
        let tip = vector(&row["tip"]);
        assert!((pass.tip_position() - tip).norm() < 1e-6 * tip.norm(), "{}", pass.tip_position());
        let moment = vector(&row["m0"]);
        assert!((pass.base_moment() - moment).norm() < 1e-6 * moment.norm(), "{}", pass.base_moment());
    }
}

#[test]
fn a_heavy_rod_droops_as_the_heavy_elastica() {
    for row in rows(&cases()["heavy_elastica"]) {
        let gamma = number(&row["gamma"]);
        let mut part = section(1.0, 1.0, 1.0);
        part.mass_per_length = gamma;
        let rod = description(HORIZONTAL, [0.0, 0.0, -1.0], vec![PartDescription::Section(part)]);
        let manipulator = build(&rod, 0.01);
        let pass = solved(&manipulator, &no_field(), &TipLoad::NONE, PassMode::default());
        close(-pass.tip_position().z, number(&row["droop"]), 1e-6);
        close(pass.tip_position().x, number(&row["axial"]), 1e-6);
        let tangent = pass.tip_tangent();
        close((-tangent.z).atan2(tangent.x), number(&row["tip_angle"]), 1e-6);
        // Drooping from +x to -z turns about +y.
        close(pass.base_moment().y, number(&row["root_curvature"]), 4e-6);
    }
}

/// The reference differentiates the rotation vector `log R` itself; a pass yields `phi` of `dR = [phi]x R`.
/// `d log R = J_l^-1 phi`, with the inverse of the left Jacobian of the rotation group.
fn derivative_of_log(rotation: &Matrix3<f64>) -> Matrix3<f64> {
    let log = Rotation3::from_matrix_unchecked(*rotation).scaled_axis();
    let angle = log.norm();
    let cross = log.cross_matrix();
    let factor = 1.0 / angle.powi(2) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin());
    Matrix3::identity() - cross * 0.5 + cross * cross * factor
}

#[test]
fn two_magnets_in_an_affine_field_match_poses_wrenches_and_the_full_jacobian() {
    let case = &cases()["two_magnets_affine"];
    let input = |name: &str| number(&case["inputs"][name]);
    let field = AffineField {
        field: Vector3::new(input("B0x"), input("B0y"), input("B0z")),
        gradient: FieldGradient {
            xx: input("Gxx"),
            xy: input("Gxy"),
            xz: input("Gxz"),
            yy: input("Gyy"),
            yz: input("Gyz"),
        },
    };
    let manipulator = build(&reference_two_magnets([1.0, 1.0]), 0.5e-3);
    let pass = solved(&manipulator, &field, &TipLoad::NONE, PassMode { poses: true, ..Default::default() });
    let base = &case["xi_n0_m0"];
    for i in 0..6 {
        close(pass.unknowns()[i], number(&base[i]), if i < 3 { 1e-8 } else { 1e-10 });
    }
    for (index, expected) in case["magnets"].as_array().expect("magnets").iter().enumerate() {
        let found = &pass.magnets()[index];
        assert!((found.position() - vector(&expected["p"])).norm() < 5e-8);
        assert!((found.tangent() - vector(&expected["tangent"])).norm() < 1e-6);
        assert!((found.rotation() - matrix(&expected["R"])).norm() < 1e-6);
        assert!((found.field() - vector(&expected["B"])).norm() < 1e-8);
        // The reference counts the weight in with the force.
        let force = found.force() + found.weight();
        assert!((force - vector(&expected["F"])).norm() < 1e-6 * force.norm());
        assert!((found.torque() - vector(&expected["T"])).norm() < 1e-6 * vector(&expected["T"]).norm());
        let positions = pass.position_jacobian(index).expect("asked for");
        let rotations = pass.rotation_jacobian(index).expect("asked for");
        let matrix = |rows: [&[f64]; 3]| SMatrix::<f64, 3, 8>::from_fn(|i, j| rows[i][j]);
        let log = derivative_of_log(&found.rotation()) * matrix(rotations);
        for (block, rows) in [matrix(positions), log].into_iter().enumerate() {
            let expected: Vec<Vec<f64>> = (0..3)
                .map(|row| {
                    let row = &case["J"][6 * index + 3 * block + row];
                    (0..8).map(|column| number(&row[column])).collect()
                })
                .collect();
            let scale = expected.iter().flatten().fold(0.0_f64, |scale, entry| scale.max(entry.abs()));
            for (i, expected) in expected.iter().enumerate() {
                for (j, expected) in expected.iter().enumerate() {
                    close(rows[(i, j)], *expected, 1e-6 * scale);
                }
            }
        }
    }
}
