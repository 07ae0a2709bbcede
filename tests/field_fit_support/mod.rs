//! What the tests of the field's fit share: a coil as a sum of current loops, which knows nothing of
//! multipoles.

use std::f64::consts::PI;

use magsteer::magnetics::fit::{FitRequest, OrderChoice, Reading, Readings, parse};
use magsteer::magnetics::{CoilPose, Multipole};
use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

pub const GRID: &str = include_str!("../reference/coil_grid.csv");

/// The reference grid.
pub fn grid() -> Readings {
    parse(GRID.as_bytes()).expect("the reference grid is sound")
}

/// A coil in its own frame.
pub fn at_home() -> CoilPose {
    CoilPose { origin: Vector3::zeros(), axis: Vector3::x() }
}

/// Complete elliptic integrals K and E of parameter m = k^2, by the arithmetic-geometric mean.
pub fn elliptic(m: f64) -> (f64, f64) {
    let (mut a, mut b) = (1.0_f64, (1.0 - m).sqrt());
    let (mut sum, mut power) = (m / 2.0, 0.5);
    while (a - b).abs() > 1e-15 * a {
        let c = (a - b) / 2.0;
        (a, b) = ((a + b) / 2.0, (a * b).sqrt());
        power *= 2.0;
        sum += power * c * c;
    }
    let k = PI / (2.0 * a);
    (k, k * (1.0 - sum))
}

/// Field (along the axis, away from it), T, of a loop of radius `a` with 1 A at `x` along its axis and `rho`
/// off it (Jackson, Classical Electrodynamics, section 5.5, in the form of Simpson et al.,
/// NASA/TM-2013-217919).
fn current_loop(a: f64, x: f64, rho: f64) -> (f64, f64) {
    let alpha2 = a * a + rho * rho + x * x - 2.0 * a * rho;
    let beta2 = a * a + rho * rho + x * x + 2.0 * a * rho;
    let beta = beta2.sqrt();
    let (k, e) = elliptic(1.0 - alpha2 / beta2);
    let c = 4e-7; // mu_0 / pi
    let along = c / (2.0 * alpha2 * beta) * ((a * a - rho * rho - x * x) * e + alpha2 * k);
    let off = if rho < 1e-9 {
        0.0
    } else {
        c * x / (2.0 * alpha2 * beta * rho) * ((a * a + rho * rho + x * x) * e - alpha2 * k)
    };
    (along, off)
}

/// The winding of `reference/coil_grid.csv`: radii 24 to 46 mm, length 50 mm, 1700 turns, face at x = 0;
/// field for 1 A, T, by 22 x 50 loops.
pub fn winding(point: &Vector3<f64>) -> Vector3<f64> {
    const LAYERS: usize = 22;
    const SLICES: usize = 50;
    let rho = point.y.hypot(point.z);
    let (mut along, mut off) = (0.0, 0.0);
    for layer in 0..LAYERS {
        let radius = 0.024 + 0.022 * (layer as f64 + 0.5) / LAYERS as f64;
        for slice in 0..SLICES {
            let x = point.x + 0.050 * (slice as f64 + 0.5) / SLICES as f64;
            let (a, o) = current_loop(radius, x, rho);
            along += a;
            off += o;
        }
    }
    let scale = 1700.0 / (LAYERS * SLICES) as f64;
    let radial = if rho < 1e-9 { Vector3::zeros() } else { Vector3::new(0.0, point.y, point.z) / rho };
    (Vector3::x() * along + radial * off) * scale
}

/// A reading of one coil.
pub fn reading(position: Vector3<f64>, current: f64, field: Vector3<f64>) -> Reading {
    Reading { line: 0, position, currents: vec![current], field }
}

/// A fit at one order, to 5 %.
pub fn exactly(order: usize) -> FitRequest {
    FitRequest { order: OrderChoice::Exactly(order), fit_origin: false, share: 0.05 }
}

/// A fit that chooses its order, to 5 %.
pub const AUTO: FitRequest = FitRequest { order: OrderChoice::Auto, fit_origin: false, share: 0.05 };

/// Coefficients of BigMag's air coil.
pub const AIR: [f64; 4] = [6.422646756191375e-7, 1.870831551827e-8, 1.746090239903e-10, 5.183775351973e-13];

/// A place in front of a coil: 45 to 130 mm along its axis, 50 mm beside it at most.
pub fn place(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::new(
        random.random_range(0.045..0.13),
        random.random_range(-0.05..0.05),
        random.random_range(-0.05..0.05),
    )
}

/// Three numbers of a normal distribution with unit variance (Box, Muller).
pub fn normal(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| {
        let (u, v): (f64, f64) = (random.random_range(f64::MIN_POSITIVE..1.0), random.random_range(0.0..1.0));
        (-2.0 * u.ln()).sqrt() * (2.0 * PI * v).cos()
    })
}

/// Field of a series at home, T, for 1 A.
pub fn field(coefficients: &[f64], origin: f64, point: &Vector3<f64>) -> Vector3<f64> {
    let pose = CoilPose { origin: Vector3::new(origin, 0.0, 0.0), axis: Vector3::x() };
    Multipole::new(coefficients).evaluate(&pose, point).column.field
}

/// Readings of a series at home, without noise, at currents up to 8 A.
pub fn readings(coefficients: &[f64], origin: f64, count: usize, random: &mut ChaCha8Rng) -> Vec<Reading> {
    let mut one = || {
        let (position, current) = (place(random), random.random_range(-8.0..8.0));
        reading(position, current, field(coefficients, origin, &position) * current)
    };
    (0..count).map(|_| one()).collect()
}
