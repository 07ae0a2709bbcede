//! Field of a circular current loop, anywhere but on the wire, without loss of digits near the axis or far
//! away.
//!
//! | symbol | meaning |
//! |---|---|
//! | `a` | radius of the loop, in the plane `x = 0`, current 1 A right-handed about `+x` |
//! | `x`, `r` | place along the axis, distance from it |
//! | `alpha^2`, `beta^2` | `(a - r)^2 + x^2`, `(a + r)^2 + x^2` |
//! | `m`, `kc` | `4 a r / beta^2`, `alpha / beta` |
//! | `B`, `C`, `D` | integrals (F1) of that modulus; `F = D - C`, a prime for `d/dm` |
//! | `b`, `q`, `s` | as in `axial` |
//!
//! `b = mu0 a^2 / (pi alpha^2 beta) W`, `W = B + D + 4 r [r C - (a + r) D] / beta^2`             (F3)
//!
//! `q = 4 mu0 a^2 x F / (pi alpha^2 beta^3)`                                                 (F4)
//!
//! Their derivatives by `x`, with `dm/dx = -2 x m / beta^2`:                                   (F5)
//!
//! `s = 4 mu0 a^2 / (pi alpha^2 beta^3) [F (1 - 3 x^2 / beta^2 - 2 x^2 / alpha^2) - 2 m x^2 F' / beta^2]`
//!
//! `db/dx = -mu0 a^2 x / (pi alpha^2 beta) [W (1 / beta^2 + 2 / alpha^2) + (2 / beta^2) X]`,
//! `X = m B' + m D' + V + m V'`, `V = 4 r [r C - (a + r) D] / beta^2`, `V' = 4 r [r C' - (a + r) D'] / beta^2`
//!
//! Vector potential, over `r`: `h = 4 mu0 a^2 C / (pi beta^3)`                                 (F6)
//!
//! Source: Smythe, Static and Dynamic Electricity, 7.10, whose `K` and `E` are here `B + D` and `B + kc^2 D`.

use std::f64::consts::PI;

use super::axial::Axial;
use super::elliptic::Complete;
use super::sample::MU0;

/// What one ampere in a loop makes at a place of the half plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LoopField {
    /// `b`, T.
    pub along: f64,
    /// `q`, T/m.
    pub radial: f64,
    /// `db/dx`, T/m.
    pub along_slope: f64,
    /// `s`, T/m^2.
    pub radial_slope: f64,
    /// `h`, T.
    pub potential: f64,
}

impl LoopField {
    /// Loop of `radius`, seen from `x` along its axis and `r` from it, all in m.
    #[must_use]
    pub fn new(radius: f64, x: f64, r: f64) -> Self {
        let (a, x2) = (radius, x * x);
        let (difference, sum) = (a - r, a + r);
        let alpha2 = difference * difference + x2;
        let beta2 = sum * sum + x2;
        let (alpha2_inverse, beta2_inverse) = (1.0 / alpha2, 1.0 / beta2);
        let beta_inverse = beta2_inverse.sqrt();
        let m = 4.0 * a * r * beta2_inverse;
        let integrals = Complete::new((alpha2 * beta2_inverse).sqrt());
        let Complete { b, c, d, b_slope, c_slope, d_slope } = integrals;
        let scale = MU0 * a * a / PI * beta_inverse;
        let v = 4.0 * r * (r * c - sum * d) * beta2_inverse;
        let v_slope = 4.0 * r * (r * c_slope - sum * d_slope) * beta2_inverse;
        let w = b + d + v;
        let (f, f_slope) = (d - c, d_slope - c_slope);
        let radial = 4.0 * scale * alpha2_inverse * beta2_inverse;
        let by_m = m * (b_slope + d_slope + v_slope) + v;
        let along_bracket = w * (beta2_inverse + 2.0 * alpha2_inverse) + 2.0 * beta2_inverse * by_m;
        let radial_bracket = f * (1.0 - x2 * (3.0 * beta2_inverse + 2.0 * alpha2_inverse))
            - 2.0 * m * x2 * beta2_inverse * f_slope;
        Self {
            along: scale * alpha2_inverse * w,                        // (F3)
            radial: radial * x * f,                                   // (F4)
            along_slope: -scale * alpha2_inverse * x * along_bracket, // (F5)
            radial_slope: radial * radial_bracket,                    // (F5)
            potential: 4.0 * scale * beta2_inverse * c,               // (F6)
        }
    }

    /// The same as four numbers of the half plane, at the squared distance `u` from the axis.
    #[must_use]
    pub fn axial(&self, u: f64) -> Axial {
        Axial::from_slopes(self.along, self.radial, self.along_slope, self.radial_slope, u)
    }
}

/// Second and third derivative by `x` of the field on the axis of a loop of `radius` with 1 A, T/m^2 and
/// T/m^3.
#[must_use]
pub fn bends_on_axis(radius: f64, x: f64) -> [f64; 2] {
    let (a2, x2) = (radius * radius, x * x);
    let r2 = a2 + x2;
    let seventh = r2.powi(3) * r2.sqrt();
    let scale = 0.5 * MU0 * a2 / seventh;
    [scale * (12.0 * x2 - 3.0 * a2), scale * x * (45.0 * a2 - 60.0 * x2) / r2]
}
