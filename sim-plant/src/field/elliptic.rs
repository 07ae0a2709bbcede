//! Complete elliptic integrals for current loops and current sheets, to machine precision.
//!
//! **Problem.** Written with the usual `K` and `E`, the field of a loop is a difference of nearly equal
//! numbers near its axis and far away. The integrals below are those combinations of `K` and `E` that the
//! field consists of; none is small.
//!
//! | symbol | meaning |
//! |---|---|
//! | `m`, `kc` | parameter, `m = k^2`; complementary modulus, `kc^2 = 1 - m` |
//! | `R` | `sqrt(1 - m sin^2 w)`, under integrals over `w` from 0 to pi/2 |
//! | `K` | `int 1 / R` |
//! | `B`, `D`, `C` | `int cos^2 / R`, `int sin^2 / R`, `int sin^2 cos^2 / R^3`                    (F1) |
//!
//! **Method.** The arithmetic-geometric mean from `a_0 = 1`, `b_0 = kc`, with `c_0^2 = m`,
//! `c_(n+1) = c_n^2 / (4 a_(n+1))`. With `s = sum_(n >= 1) 2^n c_n^2 / m^2` and `S = m s`
//!
//! `K = pi / (2 a)`, `B = K (1 - S) / 2`, `D = K (1 + S) / 2`, `C = K s`                     (F2)
//!
//! where `c_1 / m = 1 / (2 (1 + kc))` and `c_n / m^2` of the later terms are followed instead of `c_n`, so
//! that nothing is divided by a small `m`. For the slopes, `dB/dm = C / 2`, `dD/dm = (D - C) / (2 kc^2)`, and
//! `dC/dm = (D - 4 C + 3 m C) / (2 m kc^2) = K [7 s - (3 + kc) / (1 + kc)^3 - 8 s_2 / m] / (4 kc^2)` with
//! `s_2` the part of `s` from `n = 2` on.
//!
//! Sources: Abramowitz and Stegun 17.6 (the mean); Jahnke and Emde, Tables of Functions, chapter V (`B`, `C`,
//! `D`); Bulirsch, Numerische Mathematik 7 (1965) 78 and 13 (1969) 305 (`cel`).

use std::f64::consts::{FRAC_PI_2, PI};

/// The mean has converged to rounding when the last half difference is below this share: it is squared by the
/// next step.
const CONVERGED: f64 = 1e-8;
/// Quadratic convergence needs seven steps from `kc = 1e-12`.
const ITERATIONS_MAX: usize = 12;

/// Complete elliptic integrals of one modulus, (F1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Complete {
    /// `B` of the module's head.
    pub b: f64,
    /// `C` of the module's head.
    pub c: f64,
    /// `D` of the module's head.
    pub d: f64,
    /// `dB/dm`.
    pub b_slope: f64,
    /// `dC/dm`.
    pub c_slope: f64,
    /// `dD/dm`.
    pub d_slope: f64,
}

impl Complete {
    /// The integrals at a complementary modulus, 0 < `kc` <= 1.
    #[must_use]
    pub fn new(kc: f64) -> Self {
        let m = (1.0 - kc) * (1.0 + kc);
        let sum = 1.0 + kc;
        let first = 0.5 / sum; // c_1 / m
        let (mut a, mut b) = (0.5 * sum, kc.sqrt());
        let mut later = 0.0; // s_2 / m^2
        let mut weight = 4.0;
        let mut square = first * first;
        for _ in 0..ITERATIONS_MAX {
            (a, b) = (0.5 * (a + b), (a * b).sqrt());
            let ratio = square / (4.0 * a); // c_n / m^2, n = 2 first
            later += weight * ratio * ratio;
            weight *= 2.0;
            square = (m * ratio) * (m * ratio);
            if m * m * ratio <= CONVERGED * a {
                break;
            }
        }
        let s = 2.0 * first * first + m * m * later;
        let k = PI / (2.0 * a);
        let (b, d, c) = (0.5 * k * (1.0 - m * s), 0.5 * k * (1.0 + m * s), k * s); // (F2)
        let bracket = 7.0 * s - (3.0 + kc) / (sum * sum * sum) - 8.0 * m * later;
        let half = 0.5 / (kc * kc);
        Self { b, c, d, b_slope: 0.5 * c, c_slope: 0.5 * half * k * bracket, d_slope: half * (d - c) }
    }
}

/// Bulirsch's `cel(kc, p, a, b) = int (a cos^2 + b sin^2) / ((cos^2 + p sin^2) sqrt(cos^2 + kc^2 sin^2))`
/// over 0 to pi/2, for `kc` > 0 and `p` > 0.
#[must_use]
pub fn cel(kc: f64, p: f64, a: f64, b: f64) -> f64 {
    let (mut kc, mut e, mut m) = (kc, kc, 1.0);
    let mut p = p.sqrt();
    let mut b = b / p;
    let mut a = a;
    for _ in 0..=ITERATIONS_MAX {
        let f = a;
        a += b / p;
        let g = e / p;
        b = 2.0 * (b + f * g);
        p += g;
        let last = m;
        m += kc;
        if (last - kc).abs() <= CONVERGED * last {
            break;
        }
        kc = 2.0 * e.sqrt();
        e = kc * m;
    }
    FRAC_PI_2 * (b + a * m) / (m * (m + p))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Trapezoids over a period of a smooth integrand: exact to rounding with enough of them.
    fn integral(kc: f64, integrand: impl Fn(f64, f64, f64) -> f64) -> f64 {
        let count = 20_000;
        let sample = |index: i32| {
            let (sine, cosine) = (FRAC_PI_2 * f64::from(index) / f64::from(count)).sin_cos();
            let root = (cosine * cosine + kc * kc * sine * sine).sqrt();
            let weight = if index == 0 || index == count { 0.5 } else { 1.0 };
            weight * integrand(sine * sine, cosine * cosine, root)
        };
        (0..=count).map(sample).sum::<f64>() * FRAC_PI_2 / f64::from(count)
    }

    fn assert_near(found: f64, expected: f64, what: &str) {
        assert!((found / expected - 1.0).abs() < 2e-13, "{what}: {found} instead of {expected}");
    }

    #[test]
    fn integrals_and_their_slopes_agree_with_quadrature() {
        for kc in [1.0, 0.999_999, 0.9, 0.5, 0.1, 0.01, 0.003] {
            let found = Complete::new(kc);
            assert_near(found.b, integral(kc, |_, c2, root| c2 / root), "B");
            assert_near(found.d, integral(kc, |s2, _, root| s2 / root), "D");
            assert_near(found.c, integral(kc, |s2, c2, root| s2 * c2 / root.powi(3)), "C");
            // The derivative by m brings (3/2) sin^2 / R^2 under the last integral, 1/2 under the others.
            let slope = integral(kc, |s2, c2, root| 1.5 * s2 * s2 * c2 / root.powi(5));
            assert_near(found.c_slope, slope, "C'");
            assert_near(found.d_slope, integral(kc, |s2, _, root| 0.5 * s2 * s2 / root.powi(3)), "D'");
            assert_near(found.b_slope, integral(kc, |s2, c2, root| 0.5 * s2 * c2 / root.powi(3)), "B'");
        }
    }

    #[test]
    fn bulirschs_integral_agrees_with_quadrature() {
        for (kc, p, a, b) in
            [(1.0, 1.0, 1.0, 1.0), (0.6, 0.04, 1.0, -0.2), (0.3, 0.7, 2.0, 0.3), (0.02, 1.0, 1.0, 0.0004)]
        {
            let expected = integral(kc, |s2, c2, root| (a * c2 + b * s2) / ((c2 + p * s2) * root));
            assert_near(cel(kc, p, a, b), expected, "cel");
        }
    }

    #[test]
    fn all_known_values_at_the_axis_are_met() {
        let found = Complete::new(1.0);
        for (value, expected) in [(found.b, PI / 4.0), (found.d, PI / 4.0), (found.c, PI / 16.0)] {
            assert!((value - expected).abs() < 2e-16);
        }
        assert!((found.c_slope - 3.0 * PI / 64.0).abs() < 2e-16);
        // Legendre's relation K E' + E K' - K K' = pi/2 with K = B + D, E = B + kc^2 D.
        let (left, right) = (Complete::new(0.6), Complete::new(0.8));
        let (k, e) = (left.b + left.d, left.b + 0.36 * left.d);
        let (k_other, e_other) = (right.b + right.d, right.b + 0.64 * right.d);
        assert!((k * e_other + e * k_other - k * k_other - FRAC_PI_2).abs() < 1e-15);
    }
}
