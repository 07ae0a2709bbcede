//! Gauss-Legendre quadrature.
//!
//! Nodes are the zeros of the Legendre polynomial `P_n`, found by Newton's method from
//! `cos(pi (i + 3/4) / (n + 1/2))`; weights are `2 / ((1 - z^2) P_n'(z)^2)`.
//! Source: Abramowitz and Stegun 25.4.29.

use std::f64::consts::PI;

/// Newton's method on a polynomial from a good guess: four steps reach rounding for every order used here.
const ITERATIONS: usize = 8;

/// Nodes and weights over an interval.
#[must_use]
pub fn gauss_legendre<const N: usize>(from: f64, to: f64) -> [(f64, f64); N] {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    std::array::from_fn(|index| {
        let mut z = (PI * (index as f64 + 0.75) / (N as f64 + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..ITERATIONS {
            let (mut last, mut now) = (1.0, z);
            for k in 1..N {
                let k = k as f64;
                (last, now) = (now, ((2.0 * k + 1.0) * z * now - k * last) / (k + 1.0));
            }
            slope = N as f64 * (z * now - last) / (z * z - 1.0);
            z -= now / slope;
        }
        (middle - half * z, half * 2.0 / ((1.0 - z * z) * slope * slope))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn n_nodes_integrate_polynomials_of_degree_two_n_minus_one_exactly() {
        fn check<const N: usize>() {
            for degree in 0..(2 * N) as i32 {
                let sum: f64 = gauss_legendre::<N>(0.5, 1.5).iter().map(|(x, w)| w * x.powi(degree)).sum();
                let exact = (1.5_f64.powi(degree + 1) - 0.5_f64.powi(degree + 1)) / f64::from(degree + 1);
                assert!((sum / exact - 1.0).abs() < 1e-13, "{N} nodes, degree {degree}");
            }
        }
        check::<1>();
        check::<2>();
        check::<5>();
        check::<16>();
        check::<48>();
    }
}
