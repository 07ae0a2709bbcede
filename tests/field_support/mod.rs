//! What the field's tests and benchmarks share: the shipped rig, reference numbers, and oracles that use
//! none of the code under test.

#![expect(dead_code, reason = "each test binary and the benchmark use their own part")]

use std::f64::consts::PI;

use magsteer::magnetics::{FieldGradient, FieldSecondGradient};
use magsteer_hal::HardwareDescription;
use magsteer_hal::config::HardwareConfig;
use nalgebra::{Matrix3, Vector3};
use serde_json::Value;

pub const MU_0: f64 = 4e-7 * PI;

/// The rig of `config/bigmag-planar.toml`, by its hardware tables alone.
pub fn bigmag() -> HardwareDescription {
    let text = include_str!("../../config/bigmag-planar.toml");
    let mut tables: toml::Table = text.parse().expect("the shipped file is TOML");
    tables.retain(|key, _| ["rig", "frames", "coil_types", "coils", "manipulator"].contains(&key));
    let config: HardwareConfig = tables.try_into().expect("the shipped file has the hardware tables");
    config.build().expect("the shipped file is valid")
}

/// One entry of `tests/reference/field_cases.json`.
pub fn reference(entry: &str) -> Value {
    let mut cases: Value =
        serde_json::from_str(include_str!("../reference/field_cases.json")).expect("reference data is JSON");
    cases[entry].take()
}

/// A number, written in the reference as a number or as text.
pub fn number(value: &Value) -> f64 {
    match value {
        Value::String(text) => text.parse().expect("a number"),
        value => value.as_f64().expect("a number"),
    }
}

/// Three numbers.
pub fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|row, _| number(&value[row]))
}

/// Three rows of three numbers.
pub fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_fn(|row, column| number(&value[row][column]))
}

/// The reference has its coils along z; the coils here are along x. `(x, y, z) -> (z, x, y)` keeps handedness.
pub fn from_z_axis(v: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.z, v.x, v.y)
}

/// The three matrices `dG/dx_k`.
pub fn second_gradient_matrices(second: &FieldSecondGradient) -> [Matrix3<f64>; 3] {
    [0, 1, 2].map(|axis| second.contract(&Vector3::ith(axis, 1.0)).matrix())
}

/// Sixth-order central difference of a matrix-valued function at zero.
pub fn difference<const R: usize, const C: usize>(
    step: f64,
    function: impl Fn(f64) -> nalgebra::SMatrix<f64, R, C>,
) -> nalgebra::SMatrix<f64, R, C> {
    let odd = |multiple: f64| function(multiple * step) - function(-multiple * step);
    (odd(1.0) * 45.0 - odd(2.0) * 9.0 + odd(3.0)) / (60.0 * step)
}

/// Largest magnitude of an entry.
pub fn largest(gradient: &FieldGradient) -> f64 {
    gradient.matrix().amax()
}

/// Complete elliptic integrals K and E of parameter `m`, by the arithmetic-geometric mean.
fn elliptic(m: f64) -> (f64, f64) {
    let (mut a, mut b) = (1.0, (1.0 - m).sqrt());
    let (mut sum, mut power) = (0.5 * m, 1.0);
    // Convergence is quadratic: eight steps suffice for any m that is not within 1e-12 of one.
    for _ in 0..12 {
        let c: f64 = 0.5 * (a - b);
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
        sum += power * c * c;
        power *= 2.0;
    }
    let k = PI / (2.0 * a);
    (k, k * (1.0 - sum))
}

/// Field at `p` of a circular loop about the x axis with its centre at `(center, 0, 0)`, 1 A.
pub fn loop_field(radius: f64, center: f64, p: &Vector3<f64>) -> Vector3<f64> {
    let axial = p.x - center;
    let radial = p.y.hypot(p.z);
    let outer = (radius + radial).powi(2) + axial * axial;
    let inner = (radius - radial).powi(2) + axial * axial;
    let (k, e) = elliptic(4.0 * radius * radial / outer);
    let scale = MU_0 / (2.0 * PI * outer.sqrt());
    let squares = radial * radial + axial * axial;
    let along = scale * (k + (radius * radius - squares) / inner * e);
    if radial == 0.0 {
        return Vector3::new(along, 0.0, 0.0);
    }
    let outward = scale * axial / radial * (-k + (radius * radius + squares) / inner * e);
    Vector3::new(along, outward * p.y / radial, outward * p.z / radial)
}

/// Terms of the exterior expansion of coaxial loops, as `e_k` in `B_x(x) = sum_k e_k x^-(k+2)` on the axis.
///
/// A loop of radius a at distance z from the expansion point has `1/(a^2 + (x - z)^2)^(3/2)` on its axis, the
/// generating function of the Gegenbauer polynomials of index 3/2.
#[derive(Clone)]
pub struct AxialMoments {
    pub moments: Vec<f64>,
    /// Largest distance of the source from the expansion point, m.
    pub reach: f64,
}

impl AxialMoments {
    /// Enough terms that the rest is far below rounding at 1.4 times the reach.
    const COUNT: usize = 160;

    pub fn none() -> Self {
        Self { moments: vec![0.0; Self::COUNT], reach: 0.0 }
    }

    /// Adds a loop of `current` (A).
    pub fn add_loop(&mut self, radius: f64, center: f64, current: f64) {
        let distance = radius.hypot(center);
        self.reach = self.reach.max(distance);
        let cosine = center / distance;
        let (mut before, mut gegenbauer) = (0.0, 1.0);
        let mut power = MU_0 * current * radius * radius / 2.0;
        for (n, moment) in self.moments.iter_mut().enumerate() {
            *moment += power * gegenbauer;
            let n = n as f64;
            let next = ((2.0 * n + 3.0) * cosine * gegenbauer - (n + 2.0) * before) / (n + 1.0);
            (before, gegenbauer) = (gegenbauer, next);
            power *= distance;
        }
    }

    /// `a_k` for k = 1 to `order`.
    pub fn coefficients(&self, order: usize) -> Vec<f64> {
        // On the axis psi_k has the slope (-1)^(k+1) (k+1)! x^-(k+2).
        let mut signed_factorial = -1.0;
        let term = |(index, moment): (usize, &f64)| {
            signed_factorial *= -((index + 2) as f64);
            moment / signed_factorial
        };
        self.moments[..order].iter().enumerate().map(term).collect()
    }

    /// Bound on the norm of the field left out beyond `order` at distance `r`: term by term no larger than on the axis.
    pub fn field_tail(&self, order: usize, r: f64) -> f64 {
        let terms = self.moments.iter().enumerate().skip(order);
        terms.map(|(index, moment)| moment.abs() * r.powi(-(index as i32 + 3))).sum()
    }
}

/// Nodes and weights of the Gauss-Legendre rule with `count` nodes on `[least, most]`.
pub fn gauss_legendre(count: usize, least: f64, most: f64) -> Vec<(f64, f64)> {
    let legendre = |x: f64| {
        let (mut before, mut value) = (1.0, x);
        for n in 2..=count {
            let n = n as f64;
            (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
        }
        (value, count as f64 * (x * value - before) / (x * x - 1.0))
    };
    let node = |index: usize| {
        let mut x = (PI * (index as f64 + 0.75) / (count as f64 + 0.5)).cos();
        for _ in 0..20 {
            let (value, slope) = legendre(x);
            x -= value / slope;
        }
        let slope = legendre(x).1;
        let half = 0.5 * (most - least);
        (least + half * (1.0 + x), half * 2.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..count).map(node).collect()
}
