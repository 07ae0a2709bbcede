//! The true field against numbers of other tools: `tests/reference/field_cases.json`.
//!
//! The entries are strings with 18 significant digits, made with mpmath and checked against magpylib; the
//! axis of loops and coils is z there, that of multipoles x.

mod field_support;
mod validation;

use field_support::{cases, in_space, matrix, number, off, vector};
use magsteer_sim_plant::field::{Axial, Dipole, LoopField, Multipole, Sheet, Winding};
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;
use validation::{Row, hold};

/// What is promised, relative to the greatest component.
const RELATIVE_MAX: f64 = 1e-9;

/// Greatest deviations of flux and gradient over the rows of an entry; rows without a gradient count for the
/// flux alone.
fn deviations(case: &Value, field: impl Fn(f64, f64) -> Axial) -> [f64; 2] {
    let mut worst = [0.0_f64; 2];
    for row in case["rows"].as_array().expect("rows") {
        let (flux, gradient) = in_space(&field, &Vector3::z(), &vector(&row["p"]));
        worst[0] = worst[0].max(off(flux, vector(&row["B"])));
        if row["gradB"].is_array() {
            worst[1] = worst[1].max(off(gradient, matrix(&row["gradB"])));
        }
    }
    worst
}

fn loop_of(radius: f64, at: f64) -> impl Fn(f64, f64) -> Axial {
    move |x, r| LoopField::new(radius, x - at, r).axial(r * r)
}

/// The field of the thin solenoid of the reference, 1e4 A/m.
fn thin_solenoid(x: f64, r: f64) -> Axial {
    scaled(Sheet { radius: 0.02, from: -0.03, to: 0.03 }.at(x, r), 1e4)
}

fn scaled(field: Axial, factor: f64) -> Axial {
    Axial {
        along: factor * field.along,
        radial: factor * field.radial,
        slope: factor * field.slope,
        bend: factor * field.bend,
    }
}

fn sum(left: Axial, right: Axial) -> Axial {
    Axial {
        along: left.along + right.along,
        radial: left.radial + right.radial,
        slope: left.slope + right.slope,
        bend: left.bend + right.bend,
    }
}

/// Greatest deviations of flux and gradient from the basis of eq. (4), order by order.
fn basis_deviations(case: &Value) -> [f64; 2] {
    let mut worst = [0.0_f64; 2];
    for row in case["rows"].as_array().expect("rows") {
        let order = row["k"].as_u64().expect("an order") as usize;
        let mut coefficients = vec![0.0; order];
        coefficients[order - 1] = 1.0;
        let series = Multipole::new(&coefficients);
        let (flux, gradient) = in_space(|x, r| series.at(x, r * r), &Vector3::x(), &vector(&row["p"]));
        let [xx, xy, xz, yy, yz] =
            [0, 1, 2, 3, 4].map(|index| number(&row["hess_unique_xx_xy_xz_yy_yz"][index]));
        let hessian = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy);
        worst[0] = worst[0].max(off(flux, vector(&row["grad"])));
        worst[1] = worst[1].max(off(gradient, hessian));
    }
    worst
}

/// Greatest relative difference between the error of a truncated series of a loop and the error that the
/// reference states for it. It holds loop and series to each other; distances are along (0.8, 0.6, 0), errors
/// printed to six digits.
fn truncation_deviation(case: &Value) -> f64 {
    let coefficients: Vec<f64> = case["a"].as_array().expect("coefficients").iter().map(number).collect();
    let mut worst = 0.0_f64;
    for row in case["truncation_error"].as_array().expect("rows") {
        let point = Vector3::new(0.8, 0.6, 0.0) * number(&row["r"]);
        let (exact, _) = in_space(loop_of(0.04, 0.0), &Vector3::x(), &point);
        for (order, expected) in row["rel_err"].as_object().expect("errors by order") {
            let series = Multipole::new(&coefficients[..order.parse().expect("an order")]);
            let (flux, _) = in_space(|x, r| series.at(x, r * r), &Vector3::x(), &point);
            let error = (flux - exact).norm() / exact.norm();
            worst = worst.max((error / number(expected) - 1.0).abs());
        }
    }
    worst
}

fn dipole_rows(case: &Value) -> [Row; 4] {
    let first = Dipole { position: Vector3::new(0.2, -0.1, 0.3), moment: vector(&case["m1"]) };
    // The offset stands in the reference's words.
    let offset = Vector3::new(0.03, 0.01, 0.04);
    let second = Dipole { position: first.position + offset, moment: vector(&case["m2"]) };
    let field = first.field_at(&second.position);
    let wrench = first.wrench_on(&second);
    let row =
        |what: &str, deviation: f64| Row::new(format!("two dipoles: {what}"), deviation, RELATIVE_MAX, "");
    [
        row("field", off(field.flux, vector(&case["B"]))),
        row("gradient", off(field.gradient, matrix(&case["gradB"]))),
        row("force", off(wrench.force, vector(&case["force_on_m2"]))),
        row("torque", off(wrench.torque, vector(&case["torque_on_m2"]))),
    ]
}

#[test]
fn loops_coils_multipoles_and_dipoles_agree_with_the_reference() {
    let cases = cases();
    let row = |what: &str, deviation: f64| Row::new(what, deviation, RELATIVE_MAX, "");
    let [flux, gradient] = deviations(&cases["current_loop"], loop_of(0.04, 0.0));
    let mut rows = vec![row("current loop: field", flux), row("current loop: gradient", gradient)];
    let pair = |x: f64, r: f64| sum(loop_of(0.1, -0.05)(x, r), loop_of(0.1, 0.05)(x, r));
    rows.push(row("Helmholtz pair: field", deviations(&cases["helmholtz"], pair)[0]));
    rows.push(row("thin solenoid: field", deviations(&cases["thin_solenoid"], thin_solenoid)[0]));
    // 600 turns carry the reference's 5e5 A/m^2 at 1 A; its middle is at 0, that of a `Winding` at -length /
    // 2.
    let thick = Winding { inner_radius: 0.02, outer_radius: 0.04, length: 0.06, turns: 600.0 };
    let centred = |x: f64, r: f64| thick.at(x - 0.03, r);
    rows.push(row("thick coil: field", deviations(&cases["thick_coil"], centred)[0]));
    let [flux, gradient] = basis_deviations(&cases["multipole_basis"]);
    rows.extend([
        row("multipoles k = 1 to 6: field", flux),
        row("multipoles k = 1 to 6: gradient", gradient),
    ]);
    rows.extend(dipole_rows(&cases["dipole_dipole"]));
    let truncation = truncation_deviation(&cases["loop_multipole_coefficients"]);
    rows.push(Row::new("error of a loop's truncated series, of that stated", truncation, 5e-6, ""));
    hold("field.md", "reference", &rows);
}
