//! What every magnetic field obeys, whatever its numbers: Maxwell's equations, its far field, and the
//! definition of a gradient.

mod field_support;
mod validation;

use std::f64::consts::PI;

use field_support::{GRID_WINDING, in_space, off};
use magsteer_sim_plant::field::{Axial, Dipole, LoopField, Multipole, Sheet, Winding};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use validation::{Row, hold};

const MU0: f64 = 4e-7 * PI;

/// A field in space and the least distance from its source at which it is asked for, m.
type Case = (&'static str, Box<dyn Fn(f64, f64) -> Axial>, fn(&Vector3<f64>) -> bool);

/// True at points farther than 10 mm from a body of revolution between two radii and two places along x.
fn is_clear(point: &Vector3<f64>, radii: [f64; 2], places: [f64; 2]) -> bool {
    let beside = |value: f64, [least, most]: [f64; 2]| (least - value).max(value - most).max(0.0);
    beside(point.yz().norm(), radii).hypot(beside(point.x, places)) > 0.01
}

fn cases() -> [Case; 4] {
    let series = Multipole::new(&[6.4e-7, 1.9e-8, 1.7e-10, 5.2e-13, 1e-14, 3e-16, 1e-18]);
    let sheet = Sheet { radius: 0.03, from: -0.05, to: 0.0 };
    [
        ("loop", Box::new(|x, r| LoopField::new(0.04, x, r).axial(r * r)), |point| {
            is_clear(point, [0.04; 2], [0.0; 2])
        }),
        ("sheet", Box::new(move |x, r| sheet.at(x, r)), |point| is_clear(point, [0.03; 2], [-0.05, 0.0])),
        ("winding", Box::new(|x, r| GRID_WINDING.at(x, r)), |point| {
            is_clear(point, [0.024, 0.046], [-0.05, 0.0])
        }),
        ("multipoles", Box::new(move |x, r| series.at(x, r * r)), |point| point.norm() > 0.03),
    ]
}

/// Greatest difference between the gradient and the difference quotients of the field, over the gradient:
/// nine entries, so that it holds the field's divergence and curl to zero as well. Sixth order at 1 mm: (1 mm
/// / 10 mm)^6 at worst, rounding near 1e-12.
fn gradient_deviation(field: &dyn Fn(f64, f64) -> Axial, is_outside: fn(&Vector3<f64>) -> bool) -> f64 {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut worst = 0.0_f64;
    let (axis, step) = (Vector3::x(), 2e-4);
    let mut found = 0;
    while found < 300 {
        let point = Vector3::from_fn(|_, _| random.random_range(-0.12..0.12));
        if !is_outside(&point) {
            continue;
        }
        found += 1;
        let (_, gradient) = in_space(field, &axis, &point);
        let quotients = Matrix3::from_columns(&[0, 1, 2].map(|column| {
            let flux = |steps: f64| in_space(field, &axis, &(point + Vector3::ith(column, steps * step))).0;
            let difference = |steps: f64| flux(steps) - flux(-steps);
            (difference(1.0) * 45.0 - difference(2.0) * 9.0 + difference(3.0)) / (60.0 * step)
        }));
        worst = worst.max(off(quotients, gradient));
        assert!((gradient - gradient.transpose()).amax() == 0.0);
        assert!(gradient.trace().abs() <= 1e-14 * gradient.amax());
    }
    worst
}

/// Line integral of the field round a rectangle of the half plane about the whole section of the winding,
/// over `mu0` times turns.
fn ampere(winding: &Winding) -> f64 {
    let (x_low, x_high, r_low, r_high) = (-winding.length - 0.02, 0.02, 0.004, winding.outer_radius + 0.02);
    // Simpson's rule: its error falls with the fourth power of the step.
    let simpson = |from: f64, to: f64, value: &dyn Fn(f64) -> f64| {
        let count = 400;
        let step = (to - from) / f64::from(count);
        let weight = |index| match index {
            0 => 1.0,
            _ if index == count => 1.0,
            _ if index % 2 == 1 => 4.0,
            _ => 2.0,
        };
        (0..=count).map(|index| weight(index) * value(from + step * f64::from(index))).sum::<f64>() * step
            / 3.0
    };
    // Along the axis within, out in front, back outside, in behind: right-handed about the winding's current.
    let within = simpson(x_low, x_high, &|x| winding.at(x, r_low).along);
    let outside = simpson(x_low, x_high, &|x| winding.at(x, r_high).along);
    let front = simpson(r_low, r_high, &|r| r * winding.at(x_high, r).radial);
    let behind = simpson(r_low, r_high, &|r| r * winding.at(x_low, r).radial);
    (within + front - outside - behind) / (MU0 * winding.turns)
}

/// Relative difference between a winding and the dipole of its moment in its middle, at a distance in some
/// direction.
fn dipole_deviation(winding: &Winding, distance: f64) -> f64 {
    let center = Vector3::x() * (-0.5 * winding.length);
    let dipole = Dipole { position: center, moment: Vector3::x() * winding.moment() };
    let point = center + Vector3::new(0.48, 0.6, 0.64) * distance;
    let (flux, gradient) = in_space(|x, r| winding.at(x, r), &Vector3::x(), &point);
    let expected = dipole.field_at(&point);
    off(flux, expected.flux).max(off(gradient, expected.gradient))
}

/// Greatest relative error of a loop's field and its slopes where formulas in `K` and `E` lose digits: within
/// 1 um of its axis, near and far, against the closed form on the axis.
fn near_axis_deviation() -> f64 {
    let a = 0.04_f64;
    let mut worst = 0.0_f64;
    for x in [0.001, 0.03, 0.1, 1.0, 10.0] {
        for r in [0.0, 1e-12, 1e-9] {
            let found = LoopField::new(a, x, r);
            let square = a * a + x * x;
            let along = 0.5 * MU0 * a * a / (square * square.sqrt());
            let along_slope = -3.0 * x / square * along;
            let slope = 0.5 * along * (3.0 / square - 15.0 * x * x / (square * square));
            let pairs = [
                (found.along, along),
                (found.radial, -0.5 * along_slope),
                (found.along_slope, along_slope),
                (found.radial_slope, slope),
                (found.potential, 0.5 * along),
            ];
            for (found, expected) in pairs {
                worst = worst.max((found / expected - 1.0).abs());
            }
        }
    }
    worst
}

#[test]
fn the_field_obeys_maxwell_and_looks_like_a_dipole_from_afar() {
    let mut rows: Vec<Row> = cases()
        .iter()
        .map(|(name, field, is_outside)| {
            let what = format!("{name}: gradient against difference quotients");
            Row::new(what, gradient_deviation(field, *is_outside), 1e-7, "")
        })
        .collect();
    rows.push(Row::new("winding: Ampere's law", ampere(&GRID_WINDING) - 1.0, 1e-9, ""));
    rows.push(Row::new("loop: within 1 nm of its axis", near_axis_deviation(), 1e-13, ""));
    // The next term is smaller by the square of size over distance.
    let (near, far) = (dipole_deviation(&GRID_WINDING, 1.0), dipole_deviation(&GRID_WINDING, 10.0));
    rows.push(Row::new("winding: dipole at 1 m", near, 5e-3, ""));
    rows.push(Row::new("winding: dipole at 10 m", far, 5e-5, ""));
    hold("field.md", "invariants", &rows);
}
